"""Causes in public recordings of an electronic oscillator and of falling balls: renews their table in the docs.

``python benchmarks/measured_systems.py DATA [SILVERBOX ...]``: the folder with ``silverbox/multisine.csv`` and
``falling_balls/balls.csv``, and further records of the oscillator to judge on.
"""

import sys
from pathlib import Path
from time import perf_counter

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.markdown import table_lines
from errorscreen.cases import falling_ball, read_falling_ball, read_silverbox, silverbox
from errorscreen.discovery import CauseFinder

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "measured_systems.md"
BALLS = ("Whiffle Ball 1", "Tennis Ball", "Volleyball", "Bowling Ball")
HALF = 10000


def rows_of_silverbox(path, others):
    """Fit on the first half, judge on the second and on other records: free run, in millivolts."""
    half = read_silverbox(path, 0, HALF, name="first half")
    started = perf_counter()
    finder = CauseFinder(silverbox(half), random_state=0).fit(half)
    seconds = perf_counter() - started
    unseen = [read_silverbox(path, HALF, name="second half")]
    unseen += [read_silverbox(other, name=Path(other).stem) for other in others]
    for recording in unseen:
        gain = finder.measure_gain(recording)
        scale = 1e3 * recording.channel("y").noise
        yield (
            f"silverbox, {recording.name}", finder.causes_[0].name, f"{finder.causes_[0].probability:.2f}",
            f"{gain.recalibrated * scale:.2f} mV", f"{gain.extended * scale:.2f} mV",
            f"{gain.recalibrated / gain.extended:.1f}", f"{seconds:.0f}",
        )  # fmt: skip


def row_of_ball(path, ball):
    """Fit on drop 1, judge on drop 2: metres. One effect at most, because there are fewer than sixty readings."""
    first, second = (read_falling_ball(path, ball, drop) for drop in (1, 2))
    started = perf_counter()
    finder = CauseFinder(falling_ball(first), max_effects=1, random_state=0).fit(first)
    gain = finder.measure_gain(second)
    named = finder.verdict_.kind in ("effect", "measurement")
    name = finder.causes_[0].name if named else finder.verdict_.kind
    scale = second.channel("height").noise
    return (
        f"{ball}, drop 2", name, f"{finder.causes_[0].probability:.2f}", f"{gain.recalibrated * scale:.2f} m",
        f"{gain.extended * scale:.2f} m", f"{gain.recalibrated / gain.extended:.1f}",
        f"{perf_counter() - started:.0f}",
    )  # fmt: skip


def main(data, others):
    """Write the table."""
    rows = [row_of_ball(data / "falling_balls" / "balls.csv", ball) for ball in BALLS]
    rows += rows_of_silverbox(data / "silverbox" / "multisine.csv", others)
    titles = ("judged on", "named", "probability", "recalibrated", "extended", "ratio", "s")
    text = "\n".join(table_lines(titles, rows)) + "\n"
    write_text_atomic(TABLE, text)
    print(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
