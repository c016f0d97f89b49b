"""Limits of a calibration of ten parameters: their choice, the swarm, or its objective.

``python benchmarks/ten_parameters.py [DRAWS]`` takes the first ten parameters by the true label and by the
identifiability in the hidden draws of ``errorscreen bench paper --seed 2026 --noise-db 40``, calibrates them in three
ways, and renews a table of the docs.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench import Effort
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.paper import PUBLISHED
from errorscreen.bench.paper_draw import FIT_EVENTS, TOP, Setting, hidden, step_error
from errorscreen.calibration import MAPCalibrator, PSOCalibrator
from errorscreen.learning.generation import contribution_labels
from errorscreen.metrics import quiet_level, ranking, reduction, response_error
from errorscreen.screening import IdentifiabilityScreener

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "ten_parameters.md"
SEED, NOISE_DB, DRAWS = 2026, 40.0, 20
EFFORT = Effort()
#: the study's swarm, one with ten times as many simulations, and bounded least squares, which minimises χ² instead of J
CALIBRATORS = {
    "swarm, 2400 simulations": partial(
        PSOCalibrator, n_particles=EFFORT.particles, n_iterations=EFFORT.iterations
    ),
    "swarm, 24 000 simulations": partial(PSOCalibrator, n_particles=60, n_iterations=400),
    "bounded least squares": partial(MAPCalibrator, n_starts=4, library_size=512),
}
SELECTIONS = ("true label", "sensitivity + identifiability")


def reductions(setting, step_errors, draw):
    """Reductions of E against the true response (selections, calibrators, R) in one draw."""
    simulator, name = setting.simulator, FIT_EVENTS[0]
    found = hidden(setting, draw, step_errors, [name])
    recording, truth = found.observations[name], found.truths[name]
    label = contribution_labels(simulator, found.theta, recording.event)[0]
    first = (ranking(label)[:TOP], IdentifiabilityScreener(simulator).fit(recording).ranking_[:TOP])
    thetas = [simulator.parameters.nominal]
    for selection in first:
        names = [simulator.parameters.names[j] for j in selection]
        thetas += [c(simulator, names, random_state=draw).fit(recording).theta_ for c in CALIBRATORS.values()]
    event = recording.event
    responses = simulator.simulate(np.array(thetas), event).require_ok().values
    errors = response_error(responses, truth, quiet_level(truth, event.time, event.start))
    return reduction(errors[0], errors[1:]).reshape(len(first), len(CALIBRATORS), -1)


def main(draws):
    """Calibrate and judge, and return the table."""
    setting = Setting(SEED, NOISE_DB, EFFORT)
    step_errors = step_error(setting)
    tasks = (delayed(reductions)(setting, step_errors, draw) for draw in range(draws))
    found = np.array(Parallel(n_jobs=-1)(tasks))
    rows = []
    for s, selection in enumerate(SELECTIONS):
        for c, calibrator in enumerate(CALIBRATORS):
            gains = found[:, s, c]
            cells = [f"{100 * np.median(g):.1f} ({100 * np.quantile(g, 0.1):.1f})" for g in gains.T]
            reach = np.mean(np.all(gains >= PUBLISHED, axis=1))
            rows.append((selection, calibrator, *cells, f"{100 * reach:.0f} %"))
    ending = (
        f"{draws} draws, seed {SEED}, noise {NOISE_DB:g} dB; reduction of E on the fitted event against the true "
        "response in %, median (tenth percentile)."
    )
    lines = table_lines(("the ten by", "calibrated by", "U", "P", "reach the paper"), rows)
    return "\n".join(lines) + f"\n\n{ending}\n"


if __name__ == "__main__":
    write_text_atomic(TABLE, main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS))
