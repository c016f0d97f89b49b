"""Time of a search with 20 candidates in a model of four states and 20 000 samples: renews its table in the docs."""

from pathlib import Path
from time import perf_counter

import numba
import numpy as np

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.markdown import table_lines
from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "search_speed.md"
SAMPLES, DT, CANDIDATES, HIDDEN = 20000, 0.02, 20, "v1.cubic(x1)"


def two_masses(t, x, u, p, dx):
    """Two masses on springs, the first of which is pushed."""
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - p[1] * x[0] - p[2] * (x[0] - x[2])
    dx[2] = x[3]
    dx[3] = -p[3] * x[3] - p[2] * (x[2] - x[0])


def model(recording):
    """The model that is fitted."""
    ranges = {"c1": (0.3, 0.1, 1.0), "k1": (2.0, 1.0, 4.0), "k2": (3.0, 1.0, 6.0), "c2": (0.2, 0.1, 1.0)}
    parameters = [Parameter(name, *values) for name, values in ranges.items()]
    return ODESimulator(
        two_masses, ["x1", "v1", "x2", "v2"], parameters, recording, inputs=["force"], outputs=["x2"]
    )


def main():
    """Hide a cubic spring among 20 candidates and search."""
    rng, time = np.random.default_rng(0), DT * np.arange(SAMPLES)
    force = np.repeat(rng.uniform(-2, 2, SAMPLES // 100), 100)
    truth = model(InputSignal(time, "long", 0.0, {"force": force})).extend(HIDDEN)
    y = truth.simulate([0.35, 2.2, 2.8, 0.23, -0.15]).values[0, 0]
    noise = 0.01 * float(y.std())
    values = {"force": force, "x2": y + noise * rng.standard_normal(SAMPLES)}
    recording = Recording.from_signals(time, values, noise={"x2": noise}, name="long")
    simulator = model(recording)
    others = [e.name for e in simulator.effects if e.kind != "latent" and e.name != HIDDEN]
    chosen = [HIDDEN, *others[:: len(others) // (CANDIDATES - 1)][: CANDIDATES - 1]]
    simulator.simulate(np.tile(simulator.parameters.nominal, (2, 1)))
    started = perf_counter()
    simulator.simulate(np.tile(simulator.parameters.nominal, (64, 1)))
    each = (perf_counter() - started) / 64
    started = perf_counter()
    finder = CauseFinder(simulator, effects=chosen, random_state=0).fit(recording)
    seconds = perf_counter() - started
    titles = ("candidates", "threads", "simulations", "ms a simulation", "s a search", "named")
    times = (f"{1e3 * each:.2f}", f"{seconds:.0f}")
    row = (
        len(chosen),
        numba.config.NUMBA_NUM_THREADS,
        finder.n_simulations_,
        *times,
        f"`{finder.causes_[0].name}`",
    )
    text = "\n".join(table_lines(titles, [row])) + "\n"
    write_text_atomic(TABLE, text)
    print(text)


if __name__ == "__main__":
    main()
