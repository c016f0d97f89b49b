"""Command line, see `errorscreen.arguments`."""

from __future__ import annotations

import argparse
import io
import os
import shutil
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from errorscreen._runtime.display import visible
from errorscreen._runtime.log_lines import at_each_line
from errorscreen.arguments import parser_of
from errorscreen.exceptions import ErrorscreenError, InputError, SuspectReadingsError

#: exit codes: bad input, readings that are suspect, a failure on the way, interrupted (as shells count it)
BAD_INPUT, SUSPECT, FAILED, INTERRUPTED = 2, 3, 1, 130
#: interrupts that have come
_interrupts: list[int] = []


def _say(text: str, *, to_errors: bool = False, **options: Any) -> None:
    """Print a text that may hold names from files."""
    print(visible(text), file=sys.stderr if to_errors else sys.stdout, **options)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process where not given.

    Returns
    -------
    int
        0, or 2 for bad input, 3 for suspect readings, 1 for a failure on the way, 130 for Ctrl-C.

    Examples
    --------
    >>> main(["run", "no-such-case.toml"])
    2
    """
    for stream in (sys.stdout, sys.stderr):  # χ² must not end a run on a console that cannot show it
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    options = parser_of(_COMMANDS).parse_args(argv)
    warnings.showwarning = _show_warning
    out = options.default_out if options.out is None else options.out
    try:
        with at_each_line(partial(_line, not getattr(options, "quiet", False))):
            code = options.command(options, out)
            sys.stdout.flush()
    except SuspectReadingsError as error:
        _say(
            f"errorscreen: {error}\nCorrect the case file. If the recording is right as it is, give "
            "--accept-readings.",
            to_errors=True,
        )
        return SUSPECT
    except ErrorscreenError as error:
        _say(f"errorscreen: {error}", to_errors=True)
        return BAD_INPUT if isinstance(error, InputError) else FAILED
    except MemoryError as error:
        _say(
            f"errorscreen: the memory is not enough: {error or 'no more could be had'}. Choose fewer samples, "
            "a smaller library, a longer simulation.dt or a shorter window.",
            to_errors=True,
        )
        return FAILED
    except BrokenPipeError:  # the reader of a pipe has read enough, as head does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except KeyboardInterrupt:
        _say(f"\nerrorscreen: interrupted. {options.interrupted}", to_errors=True)
        return INTERRUPTED
    return code or 0


def script() -> None:
    """Entry point of the ``errorscreen`` command: `main`, then the end of the process, at once after Ctrl-C.
    Otherwise the signal would end Python without 130 if it fell into code that a library generated on import.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    code = main()
    if code == INTERRUPTED:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _interrupt(number: int, frame: Any) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def _line(show: bool, text: str) -> None:
    """Print a line of progress, and raise an interrupt again that a library has swallowed."""
    if _interrupts:
        raise KeyboardInterrupt
    if show:
        _say(text, to_errors=True, flush=True)


def _demo(options: argparse.Namespace, out: str) -> None:
    if options.seed < 0:
        raise InputError(f"the seed is {options.seed}", where="--seed", allowed="a whole number >= 0")
    with _process_for_training(Path(out), options.fresh) as process:
        from errorscreen.workflow.demo import demo_study

        prepare = partial(demo_study, options.seed, Path(out) / "inputs", not options.no_discovery)
        _study(prepare, Path(out), options, process)


def _run(options: argparse.Namespace, out: str | None) -> int:
    if len(options.cases) > 1:
        return _run_fleet(options, Path(out or "errorscreen-fleet"))
    if options.jobs != 1:
        raise InputError(
            f"{options.jobs} jobs for one case",
            where="--jobs",
            allowed="1, or several case files",
            remedy="Within a case, run.n_jobs says how many processes simulate for the network",
        )
    options.case = options.cases[0]
    folder = Path(out or f"{Path(options.case).stem}-results")
    with _process_for_training(folder, options.fresh) as process:
        from errorscreen.cases import load_case
        from errorscreen.workflow import Study

        case = load_case(options.case)
        if options.no_discovery:
            case = case.model_copy(update={"discovery": case.discovery.model_copy(update={"enabled": False})})
        folder = _case_folder(options, case, out, "results")
        _study(lambda: Study.from_case(case), folder, options, process)
    return 0


def _run_fleet(options: argparse.Namespace, folder: Path) -> int:
    from errorscreen.workflow.fleet import run_fleet

    passed = [
        f"--{name}"
        for name in ("no-discovery", "accept-readings", "fresh")
        if getattr(options, name.replace("-", "_"))
    ]
    found = run_fleet(options.cases, _writable(folder), jobs=options.jobs, options=passed)
    if options.json:
        _say(found.as_json())
        return found.code
    for row in found.rows:
        _say(f"{row.name}: {row.verdict}. {row.statement}")
    _say(f"{found.summary()}\nWritten: {found.page}")
    return found.code


def _diagnose(options: argparse.Namespace, out: str | None) -> None:
    from errorscreen.cases import load_case
    from errorscreen.workflow import Study

    case = load_case(options.case)
    changes = {
        "screening": case.screening.model_copy(update={"methods": []}),
        "calibration": case.calibration.model_copy(update={"methods": ["map"]}),
        "discovery": case.discovery.model_copy(update={"enabled": True}),
    }
    case = case.model_copy(update=changes)
    folder = _case_folder(options, case, out, "diagnosis", within="diagnose")
    _study(lambda: Study.from_case(case), folder, options)


def _init(options: argparse.Namespace, out: str | None) -> None:
    from errorscreen.workflow.init_case import init_case

    written = init_case(options.file, options.dyr, out)
    for text in written.check:
        _say(f"Check: {text}")
    for text in written.missing:
        _say(f"State: {text}")
    _say("Written: " + ", ".join(str(path) for path in (written.case, written.picture) if path))
    again = "Complete it, then: " if written.missing else ""
    _say(f"Next: {again}errorscreen check {written.case}")


def _split(options: argparse.Namespace, out: None) -> None:
    from errorscreen.workflow.split_case import split_case

    found = split_case(options.case)
    _say(found.summary())
    for text in found.check:
        _say(f"Check: {text}")
    if found.cases:
        _say("Written: " + ", ".join(map(str, found.cases)))
        _say(f"Next: errorscreen check {found.cases[0]}")


def _check(options: argparse.Namespace, out: None) -> int:
    from errorscreen.workflow.check_case import check_case

    found = check_case(options.case)
    _say(found.summary())
    return BAD_INPUT if found.problems else SUSPECT if found.suspects else 0


def _keys(options: argparse.Namespace, out: None) -> None:
    from errorscreen.cases import case_reference

    _say(case_reference(options.section))


def _listed(table: str, options: argparse.Namespace, out: None) -> None:
    from errorscreen.workflow import listings

    _say(getattr(listings, table)(options.name))


def _case_folder(
    options: argparse.Namespace, case: Any, out: str | None, kind: str, within: str = ""
) -> Path:
    """Output folder: the one asked for, that of the case file, or one beside the caller.
    In the folder of the case file, each command but `run` has one of its own (`within`).
    """
    path = Path(options.case)
    if out is not None:
        return Path(out)
    return path.parent / case.run.out / within if case.run.out else Path(f"{path.stem}-{kind}")


def _bench_speed(options: argparse.Namespace, out: str) -> None:
    from errorscreen.bench import measure_speed

    folder = _writable(Path(out))
    measure_speed(folder, cnn=not options.no_cnn, labels=not options.no_labels)
    _say(f"Written: {folder / 'result.json'}, {folder / 'table.md'}")


def _bench_paper(options: argparse.Namespace, out: str) -> None:
    from errorscreen.bench import effort_of, paper_study

    folder, show = Path(out), not options.quiet
    given = {"samples": options.samples, "enlarged": options.enlarged}
    given = {name: value for name, value in given.items() if value is not None}
    with _stages(folder, options):
        paper_study(
            folder,
            draws=options.draws,
            seed=options.seed,
            noise_db=options.noise_db,
            network=options.network,
            effort=replace(effort_of(options.network), **given),
            n_jobs=options.jobs,
            progress=show,
        )
    _say((folder / "tables.md").read_text(encoding="utf-8"))
    _say(
        f"Written: {folder / 'result.json'}, {folder / 'tables.md'}, {folder / 'figure1.png'} to figure4.png"
    )


def _bench_discovery(options: argparse.Namespace, out: str) -> None:
    from errorscreen.bench import discovery_study

    folder, show = Path(out), not options.quiet
    with _stages(folder, options):
        discovery_study(
            folder,
            case=options.case,
            scenarios=options.scenarios,
            seed=options.seed,
            noise_db=options.noise_db,
            least_size=options.least_size,
            largest_size=options.largest_size,
            n_jobs=options.jobs,
            progress=show,
        )
    _say((folder / "tables.md").read_text(encoding="utf-8"))
    _say(
        "Written: "
        + ", ".join(str(folder / n) for n in ("result.json", "tables.md", "power.png", "reliability.png"))
    )


def _bench_ablation(options: argparse.Namespace, out: str) -> None:
    from errorscreen.bench import ablation_study

    folder = Path(out)
    with _stages(folder, options):
        ablation_study(
            folder,
            case=options.case,
            scenarios=options.scenarios,
            seed=options.seed,
            steps=options.step,
            noise_db=options.noise_db,
            n_jobs=options.jobs,
            progress=not options.quiet,
        )
    _say((folder / "tables.md").read_text(encoding="utf-8"))
    _say("Written: " + ", ".join(str(folder / name) for name in ("result.json", "tables.md")))


@contextmanager
def _process_for_training(folder: Path, fresh: bool) -> Iterator[Any]:
    """A process that imports torch while this one imports the rest and reads the files; None where stages are kept."""
    from errorscreen._runtime.processes import subprocess_importing

    if (folder / "stages").exists() and not fresh:
        yield None
    else:
        with subprocess_importing("errorscreen.workflow.run", "errorscreen.learning.network") as process:
            yield process


def _study(prepare: Callable[[], Any], out: Path, options: argparse.Namespace, process: Any = None) -> None:
    from errorscreen.workflow import run_study, write_outputs
    from errorscreen.workflow.suspect_readings import refuse_suspects
    from errorscreen.workflow.told import told

    with _stages(out, options):
        study = prepare()
        if not getattr(options, "accept_readings", False):
            refuse_suspects(study.observations)
        outcome = run_study(study, out, progress=not options.quiet, process=process)
    written, result = write_outputs(outcome, out), outcome.result
    if getattr(options, "json", False):
        from errorscreen._runtime.typed import to_json

        _say(to_json(result).decode())
        return
    _say("\n".join([*told(study.title, result), "Written: " + ", ".join(map(str, written))]))


@contextmanager
def _stages(out: Path, options: argparse.Namespace) -> Iterator[None]:
    """Forget the stages of earlier runs if that is asked for, and say so where one of them cannot be used."""
    stages = _writable(out) / "stages"
    if options.fresh:
        shutil.rmtree(stages, ignore_errors=True)
    try:
        yield
    except InputError as error:
        if not str(error.where).startswith((f"file {stages}", f"folder {stages}")):
            raise
        remedy = "Delete it, or forget all stages of earlier runs with --fresh"
        raise InputError(error.what, where=error.where, allowed=error.allowed, remedy=remedy) from error


def _writable(folder: Path) -> Path:
    """Make the folder, and see that it can be written to before the work begins."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(
            f"the folder cannot be written: {error.strerror or error}",
            where=f"output folder {folder}",
            allowed="a folder that exists or can be made",
            remedy="Give another one with --out",
        ) from None
    return folder


def _show_warning(message: Any, category: type[Warning], *args: Any, **kwargs: Any) -> None:
    _say(f"note: {message}", to_errors=True)


#: functions of the commands, by the names of `errorscreen.arguments.parser_of`
_COMMANDS: dict[str, Callable[..., Any]] = {
    "demo": _demo,
    "run": _run,
    "diagnose": _diagnose,
    "init": _init,
    "split": _split,
    "check": _check,
    "keys": _keys,
    "effects": partial(_listed, "effects_table"),
    "models": partial(_listed, "models_table"),
    "speed": _bench_speed,
    "paper": _bench_paper,
    "discovery": _bench_discovery,
    "ablation": _bench_ablation,
}
