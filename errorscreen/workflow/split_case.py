"""Case files for the disturbances of one recording, one for each."""

from __future__ import annotations

import os
import re
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from errorscreen._runtime.display import aligned
from errorscreen._runtime.files import check_new
from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.cases.case_file import examine_case
from errorscreen.cases.case_models import RecordingSection
from errorscreen.data.disturbances import Disturbance, find_disturbances
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.workflow.init_case import init_case

#: s of a window before its disturbance, the longest first; a shorter one is taken where an earlier move is in the way
_BEFORE = (10.0, 5.0, 2.0)
#: s of a window after its disturbance began, and after it ended, at least
_AFTER, _AFTER_END = 30.0, 5.0
#: s by which a window ends before the next disturbance, because filters run ahead of it
_AHEAD = 0.2
_SECTION = re.compile(r"\s*\[\s*recording\s*\]\s*(#.*)?")
_ANY_SECTION = re.compile(r"""\s*\[{1,2}[\w."' -]+\]{1,2}\s*(#.*)?""")
_KEY = re.compile(r"\s*(t_start|t_end|event_time)\s*=.*")


class _Window(NamedTuple):
    """Part of a recording in seconds, and whether it can be read."""

    start: float
    stop: float
    event: float
    problem: str = ""


@dataclass(frozen=True)
class Split:
    """What `split_case` found and wrote.

    Parameters
    ----------
    recording : str
        Name.
    disturbances : tuple of Disturbance
    units : mapping of str to str
        Of the channels.
    cases : tuple of Path
        A case file for each disturbance; none where there are fewer than two.
    check : tuple of str
        What keeps a case from being read.
    """

    recording: str
    disturbances: tuple[Disturbance, ...]
    units: Mapping[str, str]
    cases: tuple[Path, ...]
    check: tuple[str, ...]

    def summary(self) -> str:
        """The disturbances in words.

        Examples
        --------
        >>> found = (Disturbance(20.0, 24.0, "V", 0.4), Disturbance(55.0, 57.0, "P", 0.1))
        >>> print(Split("unit2", found, {"V": "pu", "P": "pu"}, (), ()).summary())
        2 disturbances in unit2:
        1  20 s  to 24 s  V by 0.4 pu  the largest
        2  55 s  to 57 s  P by 0.1 pu
        """
        if not self.disturbances:
            return f"No disturbance was found in {self.recording}."
        largest = max(self.disturbances, key=lambda one: one.size)
        rows = [
            (
                str(k),
                f"{one.time:.8g} s",
                f"to {one.end:.8g} s",
                f"{one.channel} by {one.size:.3g} {self.units.get(one.channel, '')}".rstrip(),
                "the largest" if one is largest and len(self.disturbances) > 1 else "",
            )
            for k, one in enumerate(self.disturbances, start=1)
        ]
        count = f"{len(rows)} disturbance{'s' * (len(rows) > 1)} in {self.recording}:"
        end = [] if len(rows) > 1 else ["There is nothing to split."]
        return "\n".join([count, aligned(rows), *end])


def split_case(path: str | os.PathLike[str]) -> Split:
    """Find the disturbances in the recording of a case file, and write a case file for each where there are several.

    The files stand beside the given one, with ``_1``, ``_2`` … behind its name. They differ from it in `t_start`,
    `t_end` and `event_time` of [recording] only. A window begins where the former disturbance has ended, but at most 10
    s before its own, and ends before the next one.

    Parameters
    ----------
    path : path-like
        Case file; or a recording, for which `errorscreen.workflow.init_case.init_case` writes one first.

    Raises
    ------
    InputError
        If the case or its recording cannot be read, holds events of its own, or what would be written exists.
    """
    path = Path(path)
    if path.suffix.casefold() != ".toml":
        path = init_case(path).case
    examined = examine_case(path)
    section = examined.recordings.get("recording")
    if section is None:
        raise examined.problems[0]
    if section.events or section.steps or section.level:
        raise InputError(
            "the recording belongs to a stated event",
            where=f"case file {path}, recording",
            allowed="a recording of a device without steps of set-points and without a stated level",
        )
    whole = _read(section, path.parent, t_start=None, t_end=None, event_time=None)
    channels = {name: channel.values for name, channel in whole.channels.items()}
    found = tuple(find_disturbances(whole.time, channels))
    units = {name: channel.unit for name, channel in whole.channels.items()}
    if len(found) < 2:
        return Split(whole.name, found, units, (), ())
    cases = tuple(path.with_name(f"{path.stem}_{k}.toml") for k in range(1, len(found) + 1))
    check_new(cases, "Move the file away")
    windows = [_window(section, path.parent, whole, found, k) for k in range(len(found))]
    text = path.read_bytes().decode("utf-8-sig")
    texts = [_with_window(text, one, f"{k} of {len(found)}", path) for k, one in enumerate(windows, start=1)]
    for case, changed in zip(cases, texts, strict=True):
        write_text_atomic(case, changed)
    check = [f"{case}: {one.problem}" for case, one in zip(cases, windows, strict=True) if one.problem]
    return Split(whole.name, found, units, cases, tuple(check))


def _read(section: RecordingSection, folder: Path, **keys: float | None) -> Recording:
    with warnings.catch_warnings():  # doubts are told by `check` and `run`
        warnings.simplefilter("ignore", DataWarning)
        return section.model_copy(update=keys).load(folder)


def _window(
    section: RecordingSection, folder: Path, whole: Recording, found: tuple[Disturbance, ...], k: int
) -> _Window:
    """The longest window around a disturbance that can be read."""
    one, time = found[k], whole.time
    first = found[k - 1].end if k else float(time[0])
    last = found[k + 1].time - _AHEAD if k + 1 < len(found) else float(time[-1])
    stop = round(min(last, max(one.time + _AFTER, one.end + _AFTER_END)), 6)
    windows = []
    for before in _BEFORE:
        window = _Window(round(max(first, one.time - before), 6), stop, round(one.time, 6))
        try:
            _read(section, folder, t_start=window.start, t_end=window.stop, event_time=window.event)
        except InputError as error:
            windows.append(window._replace(problem=str(error)))
        else:
            return window
    return windows[0]


def _with_window(text: str, window: _Window, which: str, path: Path) -> str:
    """The text of a case file with another window; all else stays as it is."""
    keys = {"t_start": window.start, "t_end": window.stop, "event_time": window.event}
    lines = text.splitlines(keepends=True)
    head = next((k for k, line in enumerate(lines) if _SECTION.fullmatch(line.strip())), None)
    if head is not None:
        tail = next(
            (k for k in range(head + 1, len(lines)) if _ANY_SECTION.fullmatch(lines[k].strip())), len(lines)
        )
        kept = [line for line in lines[head + 1 : tail] if not _KEY.fullmatch(line.strip())]
        end = "\r\n" if lines[head].endswith("\r\n") else "\n"
        comment = f"  # by errorscreen split: disturbance {which}"
        added = [f"{key} = {value!r}{comment}{end}" for key, value in keys.items()]
        changed = "".join([*lines[:head], lines[head].rstrip() + end, *added, *kept, *lines[tail:]])
        data = tomllib.loads(text)
        data["recording"] |= keys
        if _parsed(changed) == data:
            return changed
    raise InputError(
        "[recording] cannot be changed line by line",
        where=f"case file {path}",
        allowed="a section [recording], with t_start, t_end and event_time on lines of their own",
        remedy="Write it so",
    )


def _parsed(text: str) -> dict[str, object] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None
