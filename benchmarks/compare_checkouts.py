"""Compare the results, or the run times, of two checkouts of the package.

``python benchmarks/compare_checkouts.py OLD NEW --out OUT`` computes fixed cases in both checkouts and prints where
verdict, names, probabilities, θ or intervals differ. The exit code is 1 if a verdict or a name differs. Finished cases
stay in OUT, by commit: the same call goes on from there. ``--rows`` takes the committed rows of ``OLD/docs/studies``
for the old checkout. ``--time N`` runs `errorscreen demo`, the 39-bus example and the import N times in turn instead,
and prints the ratio of the times.

The file calls itself inside each checkout (``--worker``). It therefore imports only names that both checkouts have.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from time import perf_counter

ROOT = Path(__file__).resolve().parents[1]
NOISE_DB, LEAST_SIZE = 40.0, 3.0
#: seed and number of scenarios of each study
STUDIES = {"plant": (7219, 40), "ieee39": (9137, 20), "traps": (67, 100)}
DEMOS = 4
#: examples with measured recordings, and the path in their case files that `--data` replaces
EXAMPLES, EXAMPLE_DATA = ("grid_fault", "ride_through", "volt_var"), "../../shared/data"
CASES = ("demo", "recordings", *STUDIES)
#: verdicts that name a cause
NAMED = ("effect", "measurement")
#: figures that are compared, and how far the rounding of committed rows may move them
FIGURES, ROUNDED = ("probabilities", "theta", "intervals"), 1e-5


def main(argv=None):
    """Compare, and return the exit code."""
    options = parsed(argv)
    if options.worker:
        return work(options.worker)
    old, new = Path(options.old).resolve(), Path(options.new).resolve()
    out = Path(options.out).resolve()
    if options.time:
        return compare_times(old, new, out, options.time)
    chosen = list(numbers_of(options))
    sides = {old: out / state_of(old), new: out / state_of(new)}
    tasks = []
    for checkout, folder in sides.items():
        if options.rows and checkout == old:
            folder = sides[old] = out / "rows"
            copy_rows(old, folder, chosen)
        missing = [key for key in chosen if not (folder / f"{key}.json").exists()]
        for k in range(options.jobs):
            part = missing[k :: options.jobs]
            tasks += [(checkout, folder, part, options.data)] if part else []
    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(lambda task: compute(*task), tasks))
    rows = [{key: read(folder / f"{key}.json") for key in chosen} for folder in sides.values()]
    return print_differences(*rows, rounded=options.rows)


def parsed(argv):
    """Options of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("old", nargs="?", default=".", help="checkout to compare with")
    parser.add_argument("new", nargs="?", default=str(ROOT), help="checkout to judge (default: this one)")
    parser.add_argument("--out", default="compare-checkouts", help="folder for finished cases")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=CASES)
    parser.add_argument("--scenarios", type=int, help="only so many demo seeds and scenarios of each study")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument(
        "--rows", action="store_true", help="old results from OLD/docs/studies where they exist"
    )
    parser.add_argument("--data", default=str(ROOT.parent / "shared" / "data"), help="measured recordings")
    parser.add_argument("--time", type=int, metavar="N", help="compare run times, N runs of each checkout")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    return parser.parse_args(argv)


def numbers_of(options):
    """Keys of the chosen cases, such as ``plant-3`` and ``run-grid_fault``."""
    for case in options.cases:
        if case == "recordings":
            if Path(options.data).is_dir():
                yield from (f"{command}-{name}" for name in EXAMPLES for command in ("diagnose", "run"))
            else:
                print(f"No measured recordings in {options.data}: left out.", file=sys.stderr)
            continue
        count = DEMOS if case == "demo" else STUDIES[case][1]
        for number in range(min(count, options.scenarios or count)):
            yield f"{case}-{number}"


def state_of(checkout):
    """Commit of a checkout; with changes also a fingerprint of them, so that no stale results are taken."""
    commit, changes = (
        git(checkout, "rev-parse", "--short", "HEAD"),
        git(checkout, "diff", "HEAD", "--", "errorscreen"),
    )
    return commit.strip() + (f"-{hashlib.sha256(changes.encode()).hexdigest()[:8]}" if changes else "")


def git(checkout, *arguments):
    """Output of a command."""
    command = ["git", "-C", str(checkout), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def copy_rows(old, folder, chosen):
    """Write the committed rows of the chosen scenarios as results. They know the θ of rightly named effects only."""
    folder.mkdir(parents=True, exist_ok=True)
    for case, (seed, _) in STUDIES.items():
        path = old / "docs" / "studies" / f"{case}-{seed}.jsonl"
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
            row = json.loads(line)
            key = f"{case}-{row['number']}"
            if key in chosen:
                write(folder / f"{key}.json", row_of(row))


def row_of(row):
    """Result in a row of a study."""
    return {
        "verdict": row["verdict"],
        "names": sorted(row["named"]),
        "probabilities": {cause["name"]: cause["probability"] for cause in row["causes"]},
        "theta": {entry["name"]: entry["value"] for entry in row["intervals"]},
        "intervals": {entry["name"]: entry["interval"] for entry in row["intervals"]},
        "simulations": row["simulations"],
        "seconds": row["seconds"],
    }


def compute(checkout, folder, keys, data):
    """Compute cases in a checkout, in a new process; each is written when it ends."""
    folder.mkdir(parents=True, exist_ok=True)
    task = {"checkout": str(checkout), "folder": str(folder), "keys": keys, "data": str(Path(data).resolve())}
    done = subprocess.run(
        [sys.executable, __file__, "--worker", json.dumps(task)], **surroundings(checkout, folder)
    )
    if done.returncode:
        raise SystemExit(f"{checkout} failed on one of {', '.join(keys)}; finished cases are kept.")


def surroundings(checkout, folder):
    """Working folder and environment in which a process imports the package of a checkout."""
    return {"cwd": folder, "env": {**os.environ, "PYTHONPATH": str(checkout)}}


def work(task):
    """Compute cases in this process, which finds the package of one checkout."""
    import errorscreen

    task = json.loads(task)
    checkout, folder = Path(task["checkout"]), Path(task["folder"])
    if checkout not in Path(errorscreen.__file__).resolve().parents:
        raise SystemExit(f"errorscreen was imported from {errorscreen.__file__}, not from {checkout}.")
    for key in task["keys"]:
        case, _, name = key.partition("-")
        started = perf_counter()
        if case in STUDIES:
            found = search(case, int(name))
        else:
            found = command_line(checkout, folder / "reports" / key, case, name, task["data"])
        write(folder / f"{key}.json", {**found, "seconds": perf_counter() - started})
        print(f"{checkout.name}: {key}, {found['verdict']}", file=sys.stderr, flush=True)
    return 0


def search(case, number):
    """Search one scenario of a study."""
    import numpy as np

    from errorscreen.bench.discovery import CASES as DRAWN
    from errorscreen.bench.discovery import streams_of
    from errorscreen.discovery import CauseFinder
    from errorscreen.exceptions import DataWarning

    of_hidden, of_search = streams_of(STUDIES[case][0], number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # some drawn recordings look odd on purpose
        hidden = DRAWN[case][0](of_hidden, NOISE_DB, least_size=LEAST_SIZE)
        finder = CauseFinder(hidden.simulator, random_state=int(of_search.generate_state(1)[0]))
        finder.fit(list(hidden.recordings))
    verdict, model = finder.verdict_.kind, finder.extended_simulator_
    first = finder.causes_[0]
    told = getattr(first, "values", None) or first.parameters  # the second in old checkouts
    # a value at a bound has no interval in new ones, and one of no width in old ones
    ends = {name: [v if np.isfinite(v) else row[0] for v in row[1:]] for name, row in dict(told).items()}
    return {
        "verdict": verdict,
        "names": sorted(e.name for e in finder.best_.effects) if verdict in NAMED else [],
        "probabilities": {cause.name: cause.probability for cause in finder.causes_},
        "theta": dict(zip(model.parameters.names, model.parameters.nominal.tolist(), strict=True)),
        "intervals": {name: list(map(float, row)) for name, row in ends.items()},
        "simulations": finder.n_simulations_,
    }


def command_line(checkout, report, command, name, data):
    """Run `errorscreen demo` with a seed, or another command on an example, and read its result."""
    report.mkdir(parents=True, exist_ok=True)
    if command == "demo":
        arguments = ["demo", "--seed", name]
    else:
        text = (checkout / "examples" / f"{name}.toml").read_text(encoding="utf-8")
        case = report / f"{name}.toml"
        case.write_text(text.replace(EXAMPLE_DATA, data), encoding="utf-8")
        arguments = [command, str(case)]
    call = [sys.executable, "-m", "errorscreen", *arguments, "--out", str(report), "--fresh", "--quiet"]
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL, **surroundings(checkout, report))
    return result_of(read(report / "result.json"))


def result_of(result):
    """Figures of a ``result.json`` of schema version 1 or 2."""
    if result["schema_version"] == 1:
        verdict, found = result["verdict"], result.get("discovery") or {}
        causes, methods = verdict["causes"], result["calibration"]["methods"]
    else:
        found, methods = result["diagnosis"], result["calibration"]
        verdict, causes = found["confirmed"] or found["verdict"], found["causes"]
    effects = found.get("extension", []) if verdict["kind"] in NAMED else []
    parameters = {p["name"]: p for p in found.get("parameters", [])}
    for method in methods:
        label = method.get("label") or f"{method['method']} on {method['selection']}"
        parameters |= {f"{label}: {p['name']}": p for p in method["parameters"]}
    return {
        "verdict": verdict["kind"],
        "names": sorted(effect["name"] for effect in effects),
        "probabilities": {cause["name"]: cause["probability"] for cause in causes},
        "theta": {name: p["value"] for name, p in parameters.items()},
        "intervals": {name: [p["low"], p["high"]] for name, p in parameters.items()},
        "simulations": result["run"]["n_simulations"],
    }


def print_differences(old, new, rounded):
    """Print a table of the cases that differ, and return 1 if a verdict or a name does."""
    lines, wrong = [], 0
    for key in old:
        one, two = old[key], new[key]
        told = [f"{row['verdict']} {', '.join(row['names'])}".strip() for row in (one, two)]
        figures = [difference(one[name], two[name]) for name in FIGURES]
        lacking = [set(one[name]) != set(two[name]) and not rounded for name in FIGURES]
        wrong += told[0] != told[1]
        if told[0] != told[1] or any(lacking) or max(figures) > (ROUNDED if rounded else 0):
            cells = [f"{figure:.1e}{'+' * lack}" for figure, lack in zip(figures, lacking, strict=True)]
            ratio = two["simulations"] / max(one["simulations"], 1)
            cells = [key, told[0], "same" if told[0] == told[1] else told[1], *cells, f"{ratio:.2f}"]
            lines.append("| " + " | ".join(cells) + " |")
    if lines:
        titles = ("case", "old", "new", *FIGURES, "simulations, new / old")
        print("| " + " | ".join(titles) + " |\n|" + "---|" * len(titles), *lines, sep="\n")
        print("\nFigures: largest relative difference; +: one side has entries that the other lacks.")
    print(f"{len(old)} cases, {len(lines)} with a difference, {wrong} with another verdict or other names.")
    return int(wrong > 0)


def difference(one, two):
    """Largest relative difference of the values that both sides have."""
    largest = 0.0
    for name in one.keys() & two.keys():
        pairs = (
            zip(one[name], two[name], strict=True)
            if isinstance(one[name], list)
            else [(one[name], two[name])]
        )
        for a, b in pairs:
            if a is not None and b is not None and a != b:
                largest = max(largest, abs(a - b) / max(abs(a), abs(b)))
    return largest


def compare_times(old, new, out, rounds):
    """Print medians of the times of both checkouts, taken in turn, after one run of each to compile."""
    out.mkdir(parents=True, exist_ok=True)
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    code += "import compare_checkouts; compare_checkouts.write_grid_recordings()"
    subprocess.run([sys.executable, "-c", code], check=True, **surroundings(old, out))
    commands = {
        "import": ["-c", "import errorscreen"],
        "demo": ["-m", "errorscreen", "demo", "--out", "demo", "--fresh", "--quiet"],
        "39-bus example": ["-m", "errorscreen", "run", "case.toml", "--out", "grid", "--fresh", "--quiet"],
    }
    print("| | old, s | new, s | new / old |\n|---|---|---|---|")
    for title, command in commands.items():
        seconds = [[timed(command, checkout, out) for checkout in (old, new)] for _ in range(rounds + 1)][1:]
        cells = [f"{median(column):.2f}" for column in zip(*seconds, strict=True)]
        print(f"| {title} | {' | '.join(cells)} | {median(b / a for a, b in seconds):.2f} |", flush=True)
    return 0


def timed(arguments, checkout, out):
    """Seconds of a Python process in a checkout, on the 39-bus example of that checkout."""
    (out / "case.toml").write_bytes((checkout / "examples" / "ieee39.toml").read_bytes())
    call, started = [sys.executable, *arguments], perf_counter()
    subprocess.run(call, check=True, capture_output=True, **surroundings(checkout, out))
    return perf_counter() - started


def write_grid_recordings():
    """Write the recordings of the 39-bus example as ``docs/guide/ieee39.md`` does."""
    import numpy as np

    from errorscreen.cases import ieee39_events, load_ieee39

    truth, events, rng = (
        load_ieee39(step=0.0005).extend("pv_plant.lag_active"),
        ieee39_events(),
        np.random.default_rng(0),
    )
    theta = truth.parameters.nominal * np.r_[rng.uniform(0.85, 1.15, 40), 1.0, 1.0]
    theta[truth.parameters.index("pv_plant.lag_active.T")] = 0.2
    for name, file in {"fault at bus 3": "bus3", "fault at bus 16": "bus16", "line 2-3 out": "line"}.items():
        response = truth.simulate(theta, events[name]).require_ok().values[0]
        moved = np.sqrt(np.mean((response - response[:, :1]) ** 2, axis=1, keepdims=True))
        measured = response + 0.01 * moved * rng.standard_normal(response.shape)
        table = np.column_stack([events[name].time, *measured])
        np.savetxt(f"{file}.csv", table, delimiter=",", header="time,V,P", comments="", fmt="%.6f")


def read(path):
    """Read JSON."""
    return json.loads(path.read_text(encoding="utf-8"))


def write(path, value):
    """Write JSON in one step, so that an interruption leaves no half a file."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(value, ensure_ascii=False), encoding="utf-8")
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
