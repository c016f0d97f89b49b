"""Many cases: each is run in a process of its own, and one page shows all of them."""

from __future__ import annotations

import itertools
import json
import logging
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.exceptions import InputError
from errorscreen.report import read_result
from errorscreen.report.fleet_page import FleetRow, render_fleet

#: numbers of threads that libraries read when they are loaded
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: lines of a message that are kept, and what it begins with
_LINES, _OWN = 6, "errorscreen: "
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FleetRun:
    """What became of the cases.

    Parameters
    ----------
    page : Path
        ``index.html``.
    rows : tuple of FleetRow
        In the order of the cases.
    """

    page: Path
    rows: tuple[FleetRow, ...]

    @property
    def code(self) -> int:
        """Exit code: the largest of all cases, 0 if all went through."""
        return max(row.code for row in self.rows)

    def summary(self) -> str:
        """How many cases ended how."""
        counts = Counter(row.verdict for row in self.rows)
        return f"{len(self.rows)} cases: " + ", ".join(f"{n} {kind}" for kind, n in counts.most_common())

    def as_json(self) -> str:
        """What the page says of each case, for programs."""
        keys = ("name", "case", "code", "verdict", "statement", "certainty", "limits")
        return json.dumps([{key: getattr(row, key) for key in keys} for row in self.rows], indent=2)


def run_fleet(
    cases: Sequence[str | Path], out: str | Path, *, jobs: int = 1, options: Sequence[str] = ()
) -> FleetRun:
    """Run case files and write ``index.html``; what has finished in an earlier run is taken over.

    Each case is run by ``errorscreen run`` in a process of its own, so a case that fails leaves the others as they are.

    Parameters
    ----------
    cases : sequence of path-like
    out : path-like
        Folder; each case has a folder in it, by the name of its file.
    jobs : int
        Cases at a time; the cores are shared between them.
    options : sequence of str
        Further options of ``errorscreen run``.

    Raises
    ------
    InputError
        If a case is given twice, or `jobs` is not positive.
    """
    if jobs < 1:
        raise InputError(f"the number of jobs is {jobs}", where="--jobs", allowed="a whole number >= 1")
    folder = Path(out)
    names = _names([Path(case) for case in cases])
    share = max((os.cpu_count() or 1) // jobs, 1)
    environment = {**{name: str(share) for name in _THREADS}, **os.environ}
    running: list[subprocess.Popen[str]] = []

    def run(case: Path, name: str) -> FleetRow:
        command = [
            sys.executable,
            "-m",
            "errorscreen",
            "run",
            str(case),
            "--out",
            str(folder / name),
            "--quiet",
            *options,
        ]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment, encoding="utf-8",
            errors="replace",
        ) as process:  # fmt: skip
            running.append(process)
            _, told = process.communicate()
        row = _row(case, name, folder, process.returncode, told)
        _log.info("%s: %s", name, row.verdict)
        return row

    with ThreadPoolExecutor(jobs) as pool:
        pending = [pool.submit(run, case, name) for name, case in names.items()]
        try:
            rows = tuple(one.result() for one in pending)
        except BaseException:
            for one in pending:
                one.cancel()
            for process in running:
                process.terminate()
            raise
    page = write_text_atomic(folder / "index.html", render_fleet(rows))
    return FleetRun(page, rows)


def _row(case: Path, name: str, folder: Path, code: int, told: str) -> FleetRow:
    if code:
        message = _message(told) or f"it ended with code {code}"
        return FleetRow(name, str(case), code if code > 0 else 1, message=message)
    return FleetRow(name, str(case), 0, read_result(folder / name / "result.json"))


def _message(told: str) -> str:
    """The message of a run that failed, without notes and what libraries say when they are shut down."""
    lines = [line for line in told.strip().splitlines() if not line.startswith("note:")]
    own = next((k for k, line in enumerate(lines) if line.startswith(_OWN)), None)
    if own is None:  # the end of a traceback
        return " ".join(lines[-1:])
    more = itertools.takewhile(lambda line: "resource_tracker" not in line, lines[own + 1 :])
    return " ".join([lines[own].removeprefix(_OWN), *more][:_LINES])


def _names(cases: Sequence[Path]) -> dict[str, Path]:
    """Names of the folders: that of the case file, with that of its folder where several have the same."""
    twice = [str(case) for case, n in Counter(case.resolve() for case in cases).items() if n > 1]
    if twice:
        raise InputError(f"{twice[0]} is given twice", allowed="each case file once")
    stems = Counter(case.stem for case in cases)
    found: dict[str, Path] = {}
    for case in cases:
        name = case.stem if stems[case.stem] == 1 else f"{case.resolve().parent.name}-{case.stem}"
        while name in found:
            name += "_"
        found[name] = case
    return found
