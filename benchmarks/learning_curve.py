"""Ranking quality of the network against samples and whitening, on the 39-bus case: renews its table in the docs.

``python benchmarks/learning_curve.py [OUT] [SAMPLES ...]``; the data set stays in OUT, so that a second call goes on.
"""

import sys
from pathlib import Path

import numpy as np
from sklearn.dummy import DummyRegressor
from sklearn.pipeline import make_pipeline

from errorscreen.augmentation import enlarge_dataset
from errorscreen.bench import Effort
from errorscreen.bench.paper import study_pipeline
from errorscreen.bench.paper_draw import FIT_EVENTS, STEP, TOP, noise_of
from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.features import ChannelScaler, CWTTransformer
from errorscreen.generation import generate_dataset
from errorscreen.metrics import top_k_overlap
from errorscreen.persistence import write_text_atomic
from errorscreen.regressors import CNNContributionRegressor
from errorscreen.screening import ContributionScreener

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "learning_curve.md"
SAMPLES, TEST, EPOCHS, NOISE_DB = (2500, 10000, 20000), 1000, 20, 40.0
SEED = 2026
PUBLISHED, STUDY = "energies, 64 × 256 (the paper's)", "energies and coefficients, 16 × 32"


def as_published(dt, epochs):
    """The paper's form: energies alone, 64 x 256, one scale for each channel."""
    return make_pipeline(
        CWTTransformer(sampling_period=dt, precision=15, n_jobs=-1),
        ChannelScaler(),
        CNNContributionRegressor(max_epochs=epochs, random_state=SEED),
    )


def as_studied(dt, epochs):
    """What `errorscreen bench paper` takes."""
    return study_pipeline(dt, SEED, epochs)


def main(out, sizes):
    """Fit and judge one network for each row, without and with noise, and write the table."""
    event, effort = ieee39_events()[FIT_EVENTS[0]], Effort()
    simulator, most = load_ieee39(step=STEP), max(sizes)
    train, test = (
        generate_dataset(
            simulator, n, event, random_state=SEED + k, progress=True, checkpoint=out / f"{name}-{n}"
        ).valid()
        for k, (name, n) in enumerate((("train", most), ("test", TEST)))
    )
    larger = enlarge_dataset(train, simulator, effort.enlarged, event, random_state=SEED).valid()
    blind = DummyRegressor().fit(train.errors, train.contributions).predict(test.errors)
    lines = [
        "| samples | labels by regression | images | whitened | noise | overlap with the true ten |",
        "|---|---|---|---|---|---|",
        f"| | | mean label, whatever the error | | | {top_k_overlap(test.contributions, blind, TOP):.3f} |",
    ]
    runs = [(train, sizes[0], PUBLISHED, as_published, False), (train, most, STUDY, as_studied, False)]
    runs += [(train, n, STUDY, as_studied, True) for n in sizes]
    runs += [(larger, len(larger), STUDY, as_studied, True)]
    for data, n, images, pipeline, whiten in runs:
        epochs = effort.epochs if data is larger else EPOCHS
        for noise_db in (None, NOISE_DB):
            noise = None if noise_db is None else noise_of(train.baseline, event, noise_db)
            screener = ContributionScreener(
                pipeline(event.dt, epochs), noise=noise, whiten=whiten, random_state=SEED
            )
            screener.fit(data.errors[:n], data.contributions[:n])
            errors = test.errors
            if noise is not None:
                white = np.random.default_rng(SEED).standard_normal(errors.shape)
                errors = errors + noise[:, None] * white
            found = top_k_overlap(test.contributions, screener.predict(errors), TOP)
            level = "none" if noise_db is None else f"{noise_db:g} dB"
            more = effort.enlarged if data is larger else ""
            lines.append(f"| {n} | {more} | {images} | {'yes' if whiten else 'no'} | {level} | {found:.3f} |")
            print(lines[-1], flush=True)
    ending = f"{len(test)} test samples; {EPOCHS} epochs at most, {effort.epochs} with labels by regression."
    return "\n".join(lines) + f"\n\n{ending}\n"


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "errorscreen-learning-curve")
    write_text_atomic(TABLE, main(folder, [int(n) for n in sys.argv[2:]] or list(SAMPLES)))
