"""Arguments of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any

from errorscreen import __version__

#: examples and exit codes below the help
_EPILOG = """\
examples:
  errorscreen demo                               the whole job on an embedded example
  errorscreen init unit2.csv --dyr unit2.dyr     a commented case file for a recording
  errorscreen check unit2.toml                   all problems at once, and the time of the run
  errorscreen run unit2.toml --out results       result.json, report.html, calibrated.dyr
  errorscreen run units/*.toml --jobs 4          many units, with one index.html
  errorscreen models GGOV1                       the constants of a standard model

exit codes:
  0 done   1 failed on the way   2 bad input   3 a reading is suspect   130 interrupted; of several cases the largest
"""
_RESUMABLE = "Finished stages are kept: give the same command again and it goes on from there."


def parser_of(functions: Mapping[str, Callable[..., Any]]) -> argparse.ArgumentParser:
    """Parser of the command line.

    Parameters
    ----------
    functions : mapping of str to callable
        Of the commands ``demo, run, diagnose, init, split, check, keys, effects, models`` and of the benchmarks
        ``speed, paper, discovery, ablation``; the parsed options hold one as ``command``.
    """
    parser = argparse.ArgumentParser(
        prog="errorscreen",
        description="Show what a dynamic simulation gets wrong against a recording, name the parameters that carry "
        "the error, calibrate them and report it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"errorscreen {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_studies(commands, functions)
    _add_benchmarks(commands, functions)
    return parser


def _add_studies(commands: Any, functions: Mapping[str, Callable[..., Any]]) -> None:
    demo = commands.add_parser("demo", help="the whole job on an embedded example with hidden parameters")
    demo.add_argument(
        "--seed", type=int, default=0, help="draws the hidden parameters and the noise (default 0)"
    )
    demo.add_argument("--no-discovery", action="store_true", help="only parameters, no missing effects")
    demo.set_defaults(command=functions["demo"], default_out="errorscreen-demo", interrupted=_RESUMABLE)

    run = commands.add_parser("run", help="the whole job on the recording and the model of a case file")
    run.add_argument("cases", nargs="+", metavar="CASE.toml", help="case file; several have one index.html")
    run.add_argument("--jobs", type=int, default=1, help="several cases: so many at a time (default 1)")
    run.add_argument("--no-discovery", action="store_true", help="only parameters, no missing effects")
    run.set_defaults(command=functions["run"], default_out=None, interrupted=_RESUMABLE)

    diagnose = commands.add_parser(
        "diagnose", help="what is wrong and what explains it, without network and particle swarm"
    )
    diagnose.add_argument("case", metavar="CASE.toml", help="case file")
    diagnose.set_defaults(command=functions["diagnose"], default_out=None, interrupted=_RESUMABLE)

    for command in (demo, run, diagnose):
        command.add_argument("--json", action="store_true", help="print the result as JSON in place of text")
    for command in (run, diagnose):
        command.add_argument(
            "--accept-readings",
            action="store_true",
            help="go on although a reading of a recording is suspect",
        )

    init = commands.add_parser("init", help="look at a recording and write a commented case file for it")
    init.add_argument("file", metavar="FILE", help="recording")
    init.add_argument("--dyr", metavar="UNIT.dyr", help="model file of the unit")
    init.add_argument(
        "--out", metavar="CASE.toml", help="case file (default: name of FILE here); the picture is CASE.png"
    )
    init.set_defaults(command=functions["init"], default_out=None, interrupted="Start it again.")

    split = commands.add_parser("split", help="a case file for each disturbance of a recording")
    split.add_argument(
        "case", metavar="CASE.toml", help="case file; or a recording, for which init writes one first"
    )
    split.set_defaults(command=functions["split"], out=None, default_out=None, interrupted="Start it again.")

    check = commands.add_parser("check", help="all problems of a case file at once, and the time of its run")
    check.add_argument("case", metavar="CASE.toml", help="case file")
    check.set_defaults(command=functions["check"], out=None, default_out=None, interrupted="")

    keys = commands.add_parser("keys", help="keys of a case file: default, allowed values, meaning")
    keys.add_argument("section", nargs="?", metavar="SECTION", help="for example recording (default: all)")
    keys.set_defaults(command=functions["keys"], out=None, default_out=None, interrupted="")
    effects = commands.add_parser("effects", help="what the search can find missing: name, port, meaning")
    models = commands.add_parser(
        "models", help="models that a DYR file or a case can name, or one of them in full"
    )
    for command, name in ((effects, "effects"), (models, "models")):
        command.add_argument(
            "name", nargs="?", metavar="NAME", help="one of them in full (default: a list of all)"
        )
        command.set_defaults(command=functions[name], out=None, default_out=None, interrupted="")
    _add_folder(demo, demo.get_default("default_out"))
    _add_folder(run, "as the case file says, or CASE-results here; errorscreen-fleet for several")
    _add_folder(diagnose, "as the case file says, or CASE-diagnosis here")


def _add_benchmarks(commands: Any, functions: Mapping[str, Callable[..., Any]]) -> None:
    bench = commands.add_parser("bench", help="measure speed, or how well the methods work")
    kinds = bench.add_subparsers(required=True, metavar="KIND")
    speed = kinds.add_parser("speed", help="simulations, wavelet images and training per second")
    speed.add_argument("--no-cnn", action="store_true", help="leave out the epoch of the network")
    speed.add_argument("--no-labels", action="store_true", help="leave out the labels of the 39-bus system")
    speed.set_defaults(
        command=functions["speed"],
        default_out="errorscreen-bench",
        interrupted="Nothing was written; start it again.",
    )
    paper = kinds.add_parser("paper", help="the 39-bus case study on many hidden draws")
    paper.add_argument("--draws", type=int, default=100, help="hidden parameter vectors (default 100)")
    paper.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default 0)")
    paper.add_argument(
        "--noise-db", type=float, help="level of the response over its noise; no noise where not given"
    )
    paper.add_argument(
        "--samples", type=int, help="simulated errors with exact labels that the network learns from"
    )
    paper.add_argument(
        "--enlarged", type=int, help="further ones, with labels by a regression of the exact ones"
    )
    paper.add_argument(
        "--network",
        default="whitened",
        help="whitened, or published: the paper's images and number of samples (default whitened)",
    )
    paper.add_argument("--jobs", type=int, default=-1, help="processes (default: one for each core)")
    paper.set_defaults(command=functions["paper"], default_out="errorscreen-paper", interrupted=_RESUMABLE)
    found = kinds.add_parser("discovery", help="how often causes are found, on hidden scenarios")
    found.add_argument(
        "--case", default="plant", help="plant, ieee39, traps, andes or models (default plant)"
    )
    found.add_argument("--scenarios", type=int, default=200, help="hidden scenarios (default 200)")
    found.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default 0)")
    found.add_argument(
        "--noise-db", type=float, default=40.0, help="level of the response over its noise (default 40)"
    )
    found.add_argument(
        "--least-size",
        type=float,
        help="least part of an effect that survives a refit, in multiples of the noise (default 3; of units 1)",
    )
    found.add_argument(
        "--largest-size",
        type=float,
        help="scale effects to sizes drawn between the two, evenly by order of magnitude (default: as drawn)",
    )
    found.add_argument("--jobs", type=int, default=-1, help="processes (default: one for each core)")
    found.set_defaults(
        command=functions["discovery"], default_out="errorscreen-discovery", interrupted=_RESUMABLE
    )
    without = kinds.add_parser("ablation", help="what each step of the search is worth, on hidden scenarios")
    without.add_argument(
        "--case", default="plant", help="plant, ieee39, traps, andes or models (default plant)"
    )
    without.add_argument("--scenarios", type=int, default=40, help="hidden scenarios (default 40)")
    without.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default 0)")
    without.add_argument(
        "--step",
        action="append",
        help="a step to leave out; may be given several times (default: each in turn)",
    )
    without.add_argument(
        "--noise-db", type=float, default=40.0, help="level of the response over its noise (default 40)"
    )
    without.add_argument("--jobs", type=int, default=-1, help="processes (default: one for each core)")
    without.set_defaults(
        command=functions["ablation"], default_out="errorscreen-ablation", interrupted=_RESUMABLE
    )
    _add_folder(speed, "errorscreen-bench", stages=False)
    _add_folder(paper, "errorscreen-paper")
    _add_folder(found, "errorscreen-discovery")
    _add_folder(without, "errorscreen-ablation")


def _add_folder(command: argparse.ArgumentParser, default: str, *, stages: bool = True) -> None:
    """Add the folder for results, and what stages in it allow."""
    command.add_argument(
        "--out", metavar="DIR", help=f"folder for result.json and the report (default: {default})"
    )
    if stages:
        command.add_argument("--fresh", action="store_true", help="forget the stages of earlier runs in DIR")
        command.add_argument("--quiet", action="store_true", help="no progress")
