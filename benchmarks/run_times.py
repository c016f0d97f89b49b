"""Time of a full ``errorscreen run``.

``python benchmarks/run_times.py OUT [SEED]`` hides causes in recordings as `errorscreen bench discovery` does, writes
each scenario as text files with a case file, and runs the command on it in a new process. The first scenario of each
case runs once before, to compile. Let nothing else run. Cases, reports and the table stay in OUT.
``python benchmarks/run_times.py OUT CASE SEED NUMBER ...`` times scenarios of a study instead.
"""

import json
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.discovery import CASES as STUDIED
from errorscreen.bench.discovery import streams_of
from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.bench.timing import machine
from errorscreen.events import BusFault, GridEvent

SEED, NOISE_DB = 4409, 40.0
#: function that draws the scenarios of a case, and the kinds hidden in turn
CASES = {
    "plant": (
        draw_plant_scenario,
        ("nothing", *2 * ("effect",), *2 * ("other form",), *2 * ("two effects",), *3 * ("outside",)),
    ),
    "39-bus system": (draw_grid_scenario, ("effect", "two effects", *2 * ("outside",))),
}
#: events of the grid that are held out
HELD_OUT = ("fault at bus 16", "line 2-3 out")
#: names in case files of channels that have another name in Python
_CASE_NAMES = {"U": "V"}


def write_case(folder, scenario):
    """Write the recordings of a scenario as text files, and the case file that reads them."""
    folder.mkdir(parents=True, exist_ok=True)
    grid = isinstance(scenario.recordings[0].event, GridEvent)
    held_out = [o for o in scenario.held_out if not grid or o.event.name in HELD_OUT]
    lines = []
    for k, observation in enumerate([*scenario.recordings, *held_out]):
        event = observation.event
        channels = dict(zip(observation.channels, observation.values, strict=True))
        channels |= {} if grid else event.signals
        pd.DataFrame({"time": observation.time, **channels}).to_csv(folder / f"{k}.csv", index=False)
        titles = (
            "[recording]",
            *["[[together]]"] * (len(scenario.recordings) - 1),
            *["[[held_out]]"] * len(held_out),
        )
        lines += [titles[k], f'path = "{k}.csv"', f"event_time = {event.start}"]
        if grid:
            lines.append(_happened(event))
        if k == 0:
            columns = ", ".join(f'{_CASE_NAMES.get(c, c)} = {{ column = "{c}" }}' for c in channels)
            lines += ["base_mva = 100.0", "f_nominal = 60.0", f"columns = {{ {columns} }}"]
    lines.append(
        '[grid]\ncase = "ieee39"' if grid else f'[device]\ntype = "{scenario.simulator.device.name}"'
    )
    write_text_atomic(folder / "case.toml", "\n".join(lines) + "\n")


def _happened(event):
    """Line of a case file about the event in the grid."""
    if isinstance(event, BusFault):
        impedance = complex(event.impedance)
        fault = f"bus = {event.bus}, duration = {event.duration}"
        return f"fault = {{ {fault}, resistance = {impedance.real}, reactance = {impedance.imag} }}"
    return f"line_trip = {{ ends = {list(event.ends)} }}"


def run(folder):
    """Seconds of the command on a case, and its result."""
    start = perf_counter()
    out = folder / "report"
    arguments = ["run", str(folder / "case.toml"), "--out", str(out), "--fresh"]
    subprocess.run([sys.executable, "-m", "errorscreen", *arguments], check=True, capture_output=True)
    return perf_counter() - start, json.loads((out / "result.json").read_text(encoding="utf-8"))


def timed(folder, case, kind, scenario):
    """Cells of the table for a scenario."""
    write_case(folder, scenario)
    seconds, result = run(folder)
    found = ", ".join(cause["name"] for cause in result["verdict"]["causes"][:1])
    simulations = result["run"]["n_simulations"] / 1e3
    hidden = " + ".join(scenario.hidden) or "nothing"
    cells = case, f"{kind}: `{hidden}`", result["verdict"]["kind"], f"{simulations:.0f}", f"{seconds:.0f}"
    print(*cells, found, sep=" | ", flush=True)
    return cells


def drawn(seed):
    """Case, kind and scenario, drawn anew."""
    for case, (draw, kinds) in CASES.items():
        for k, kind in enumerate(kinds):
            yield case, kind, draw(np.random.SeedSequence([seed, k]), NOISE_DB, kind=kind)


def studied(case, seed, numbers):
    """Case, kind and scenario of some numbers of a study."""
    for number in map(int, numbers):
        scenario = STUDIED[case][0](streams_of(int(seed), number)[0], NOISE_DB)
        yield case, f"number {number}, {scenario.kind}", scenario


def main(out, *asked):
    """Time new scenarios, or those of a study, and write the table."""
    if len(asked) > 1:
        case, seed, *numbers = asked
        scenarios = studied(case, seed, numbers)
    else:
        scenarios = drawn(int(asked[0]) if asked else SEED)
    compiled, rows = set(), []
    for k, (case, kind, scenario) in enumerate(scenarios):
        folder = Path(out) / str(k)
        if case not in compiled:
            write_case(folder, scenario)
            run(folder)
            compiled.add(case)
        rows.append(timed(folder, case, kind, scenario))
    on = machine()
    lines = table_lines(("", "hidden", "verdict", "thousand simulations", "seconds"), rows)
    lines.append(f"\n{NOISE_DB:g} dB, {on['cores']} cores ({on['processor']}), one run each.")
    write_text_atomic(Path(out) / "table.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
