"""Ranking quality of the network against samples and whitening, on the 39-bus case: renews its table in the docs.

``python benchmarks/learning_curve.py [OUT] [SAMPLES ...]``; the data set stays in OUT, and a second call goes on.
"""

import sys
from pathlib import Path

import numpy as np
from sklearn.dummy import DummyRegressor

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench import Effort
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.paper import study_screener
from errorscreen.bench.paper_draw import FIT_EVENTS, STEP, TOP, noise_of
from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.learning.augmentation import enlarge_dataset
from errorscreen.learning.generation import generate_dataset
from errorscreen.metrics import top_k_overlap

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "learning_curve.md"
SAMPLES, TEST, EPOCHS, NOISE_DB = (2500, 10000, 20000), 1000, 20, 40.0
SEED = 2026
IMAGES = {"published": "energies, 64 × 256 (the paper's)", "whitened": "energies and coefficients, 16 × 32"}


def main(out, sizes):
    """Fit and judge one network for each row, and return the table."""
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
    titles = ("samples", "labels by regression", "images", "whitened", "overlap with the true ten")
    overlap = top_k_overlap(test.contributions, blind, TOP)
    rows = [("", "", "mean label, whatever the error", "", f"{overlap:.3f}")]
    noise = noise_of(train.baseline, event, NOISE_DB)
    measured = test.errors + noise[:, None] * np.random.default_rng(SEED).standard_normal(test.errors.shape)
    runs = [(train, sizes[0], "published", False), (train, most, "whitened", False)]
    runs += [(train, n, "whitened", True) for n in sizes]
    runs += [(larger, len(larger), "whitened", True)]
    for data, n, network, whiten in runs:
        epochs = effort.epochs if data is larger else EPOCHS
        screener = study_screener(network, event.dt, noise, SEED, epochs).set_params(whiten=whiten)
        screener.fit(data.errors[:n], data.contributions[:n])
        found = top_k_overlap(test.contributions, screener.predict(measured), TOP)
        more = effort.enlarged if data is larger else ""
        rows.append((n, more, IMAGES[network], "yes" if whiten else "no", f"{found:.3f}"))
        print(*rows[-1], sep=" | ", flush=True)
    ending = (
        f"{len(test)} test samples, noise {NOISE_DB:g} dB; {EPOCHS} epochs at most, {effort.epochs} with labels by "
        "regression."
    )
    return "\n".join(table_lines(titles, rows)) + f"\n\n{ending}\n"


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "errorscreen-learning-curve")
    write_text_atomic(TABLE, main(folder, [int(n) for n in sys.argv[2:]] or list(SAMPLES)))
