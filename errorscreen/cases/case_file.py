"""Case files in TOML: recordings, a model, and the stages of a study."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import PrivateAttr, ValidationError

from errorscreen._runtime.files import check_file
from errorscreen.cases.case_models import (
    CalibrationSection,
    ColumnSection,
    DiscoverySection,
    RecordingSection,
    RunSection,
    ScreeningSection,
    SimulationSection,
)
from errorscreen.cases.key_errors import explained, placed, with_others
from errorscreen.cases.keys import key_tables
from errorscreen.cases.limits_section import LimitsSection
from errorscreen.cases.mended import without_wrong_keys
from errorscreen.cases.model_sections import EVENTS, DeviceSection, GridSection
from errorscreen.cases.plant_section import PlantSection
from errorscreen.cases.section import Section, setting
from errorscreen.data.recordings import Recording
from errorscreen.events import SetPointStep
from errorscreen.exceptions import InputError, check_integer
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators.plant.from_raw import RawPlant

#: bytes of the largest case file
_LARGEST = 2**24
#: lists of further recordings, in the order of a study
_FURTHER = ("together", "held_out")
#: keys of [recording] that a further recording does not take over
_OWN = ("path", "name", "event_time", "t_start", "t_end", "level", "load_level", "step", *EVENTS)


class Case(Section):
    """A case: `load_case` reads it.

    Examples
    --------
    >>> case = Case.model_validate({
    ...     "recording": {"path": "r.csv", "base_mva": 737.0, "f_nominal": 60.0, "columns": {"P": {"column": "P"}}},
    ...     "device": {"type": "synchronous_machine", "parameters": {"Xd": {"nominal": 0.95, "relative": 0.4}}},
    ... })
    >>> case.parameters()["Xd"].upper, case.simulation.step
    (1.33, 0.0025)
    """

    title: str = setting("", "for the report")
    recording: RecordingSection
    together: list[RecordingSection] = setting(
        [],
        "further recordings of the same unit that the search for causes fits together with [recording]; keys "
        "not given are those of [recording]",
    )
    held_out: list[RecordingSection] = setting(
        [], "further recordings to judge on; keys not given are those of [recording]"
    )
    device: DeviceSection | None = None
    plant: PlantSection | None = None
    grid: GridSection | None = None
    simulation: SimulationSection = SimulationSection()
    screening: ScreeningSection = ScreeningSection()
    calibration: CalibrationSection = CalibrationSection()
    discovery: DiscoverySection = DiscoverySection()
    limits: LimitsSection = LimitsSection()
    run: RunSection = RunSection()
    _folder: Path = PrivateAttr(default_factory=Path)
    _source: str = PrivateAttr(default="")

    @property
    def folder(self) -> Path:
        """Folder of the case file, which its paths are relative to."""
        return self._folder

    @property
    def source(self) -> str:
        """Name of the case file in messages; empty for a case that was made in Python."""
        return self._source

    @property
    def recordings(self) -> dict[str, RecordingSection]:
        """All recordings by their key: ``"recording"``, those fitted together with it, those held out."""
        found = {"recording": self.recording}
        for key in _FURTHER:
            found |= {f"{key}[{n}]": section for n, section in enumerate(getattr(self, key), start=1)}
        return found

    @property
    def steps(self) -> tuple[SetPointStep, ...]:
        """Steps of set-points in all recordings."""
        return tuple(step for section in self.recordings.values() for step in section.steps)

    def parameters(self) -> ParameterSpace:
        """Candidate parameters of the device or grid with this case's values and bounds.

        Raises
        ------
        InputError
            If there is neither device nor grid, or both; a parameter or a constant is unknown; a range excludes its
            nominal value; or `top_k` is larger than the number of parameters.
        """
        if (self.device is None) == (self.grid is None):
            found = "neither [device] nor [grid] is" if self.grid is None else "[device] and [grid] are both"
            raise InputError(f"{found} given", allowed="one of the two")
        if self.device is not None:
            space = self.device.space(self.folder, self.steps)
        else:
            assert self.grid is not None
            if self.plant is not None:
                raise InputError("[plant] is given with [grid]", allowed="only with [device]")
            space = self.grid.space(self.folder)
        if self.screening.top_k is not None:
            check_integer(self.screening.top_k, "screening.top_k", high=len(space))
        return space

    def network(self) -> RawPlant | None:
        """Unit in the RAW file of [plant], which all recordings must fit in base and frequency; None without a file.

        Raises
        ------
        InputError
            If the file cannot be used, or disagrees with a recording.
        """
        if self.plant is None or self.device is None:
            return None
        found = self.plant.in_network(self.folder, self.device)
        if found is not None:
            for where, section in self.recordings.items():
                found.check(section.base_mva, section.base_kv, section.f_nominal, where)
        return found

    def check_events(self) -> None:
        """Refuse a recording of a grid without its event, and a recording of a device with one.

        Raises
        ------
        InputError
            If a recording of a grid has no `event_time` or not exactly one of `EVENTS`, or has a step of a
            set-point or a level; or a recording of a device has an event or a load level.
        """
        for where, section in self.recordings.items():
            found = list(section.events)
            of_device = [key for key in ("step", "level") if getattr(section, key)]
            if self.grid is not None and of_device:
                raise InputError(f"{of_device[0]} is given", where=where, allowed="only with [device]")
            if self.grid is None:
                found += ["load_level"] * (section.load_level != 1.0)
                if found:
                    raise InputError(f"{found[0]} is given", where=where, allowed="only with [grid]")
            elif len(found) != 1:
                one_of = ", ".join(f"[{where}.{key}]" for key in EVENTS)
                raise InputError(
                    f"{' and '.join(found) or 'no event'} given", where=where, allowed=f"one of {one_of}"
                )
            elif section.event_time is None:
                raise InputError(
                    "event_time is not given",
                    where=where,
                    allowed="the instant of the event in s",
                    remedy="A detected start may be a sample late, which a simulated grid would show as an error",
                )

    def check_inputs(self) -> None:
        """Refuse a recording without the channels that drive the unit; `InputError` names the missing one."""
        for where, section in self.recordings.items():
            for name in () if self.device is None else self.device.inputs:
                if section.columns.get(name, ColumnSection(value=0.0)).value is not None:
                    raise InputError(
                        f"{name} is an input of the unit, but no column is mapped to it",
                        where=f"{where}.columns",
                        allowed="a column for each of device.inputs",
                        remedy=f'Add [{where}.columns.{name}] with column = "…", or leave {name} out of inputs',
                    )

    def check_apart(self) -> None:
        """Refuse a recording that is given twice: the fitted recording cannot confirm its own fit.

        Raises
        ------
        InputError
            If two recordings are the same columns and window of the same file.
        """
        seen: dict[Any, str] = {}
        for where, section in self.recordings.items():
            phases = (str(section.waveforms), str(section.phasors))
            window = (Path(section.path), section.t_start, section.t_end, str(section.columns), phases)
            if window in seen:
                raise InputError(
                    f"{section.path!r} is the file of {seen[window]} too",
                    where=where,
                    allowed="each recording once: as [recording], in [[together]] or in [[held_out]]",
                    remedy="A fitted recording cannot confirm the fit: leave one of them out",
                )
            seen[window] = where

    def load_recording(self) -> Recording:
        """Read the recording; for errors see `errorscreen.data.read_recording`."""
        return self._read([self.recording])[0]

    def load_together(self) -> tuple[Recording, ...]:
        """Read the recordings that are fitted together with the first one."""
        return self._read(self.together)

    def load_held_out(self) -> tuple[Recording, ...]:
        """Read the recordings to judge on."""
        return self._read(self.held_out)

    def _read(self, sections: list[RecordingSection]) -> tuple[Recording, ...]:
        return tuple(section.load(self.folder, self.simulation.dt) for section in sections)


def load_case(path: str | os.PathLike[str]) -> Case:
    """Read and check a case file; the recordings themselves are read by `Case.load_recording`.

    Parameters
    ----------
    path : path-like
        TOML file; for its sections see `case_reference`.

    Raises
    ------
    InputError
        If the file cannot be used; with file, key, found and allowed value.
    """
    path = Path(path)
    examined = examine_case(path)
    if examined.case is None:
        raise with_others(examined.problems)
    if examined.problems:
        raise examined.problems[0]
    return examined.case


class ExaminedCase(NamedTuple):
    """A case file with all of its problems.

    Parameters
    ----------
    case : Case or None
        None where keys are wrong.
    problems : list of InputError
    recordings : dict of str to RecordingSection
        Those whose keys are right, as `Case.recordings`.
    mended : dict of str to RecordingSection
        The others without their wrong keys, as far as their columns are read alike without them.
    """

    case: Case | None
    problems: list[InputError]
    recordings: dict[str, RecordingSection]
    mended: dict[str, RecordingSection]


def examine_case(path: str | os.PathLike[str]) -> ExaminedCase:
    """Read a case file, and tell all of its problems; `InputError` only if it is no TOML file."""
    path = Path(path)
    source = f"case file {path}"
    data = _parse(path, source)
    _inherit(data)
    try:
        case = Case.model_validate(data)
    except ValidationError as error:
        right, mended = _sections(data)
        problems = explained(error, Case, _FURTHER, source)
        problems += _of_model(data, right | mended, path.parent, source)
        return ExaminedCase(None, problems, right, mended)
    case._folder, case._source = path.parent, source
    checks = (case.parameters, case.check_events, case.check_inputs, case.check_apart, case.network)
    return ExaminedCase(case, _told(checks, source), case.recordings, {})


def _told(checks: Iterable[Callable[[], object]], source: str) -> list[InputError]:
    """What checks refuse, each once."""
    problems: dict[str, InputError] = {}
    for check in checks:
        try:
            check()
        except InputError as error:
            found = placed(error, source)
            problems.setdefault(str(found), found)
    return list(problems.values())


def _of_model(
    data: dict[str, Any], recordings: dict[str, RecordingSection], folder: Path, source: str
) -> list[InputError]:
    """Problems of the parameters of a model whose keys are right, in a case file with other wrong keys."""
    sections = {key: data[key] for key in ("device", "grid", "plant") if key in data}
    if not sections or "recording" not in recordings:
        return []
    try:
        case = Case.model_validate({"recording": recordings["recording"], **sections})
    except ValidationError:
        return []
    case._folder = folder
    return _told([case.parameters], source)


def _sections(data: dict[str, Any]) -> tuple[dict[str, RecordingSection], dict[str, RecordingSection]]:
    """Sections of recordings that are right, in a case file that is not, and others without their wrong keys."""
    given = {"recording": data.get("recording")}
    for key in _FURTHER:
        if isinstance(data.get(key), list):
            given |= {f"{key}[{n}]": one for n, one in enumerate(data[key], start=1)}
    found, mended = {}, {}
    for key, one in given.items():
        try:
            found[key] = RecordingSection.model_validate(one)
        except ValidationError:
            section = without_wrong_keys(one)
            if section is not None:
                mended[key] = section
    return found, mended


def case_reference(section: str | None = None) -> str:
    """Key tables of a case file in Markdown.

    Parameters
    ----------
    section : str, optional
        Only this section and those below it, for example ``"recording"``; all where not given.

    Raises
    ------
    InputError
        If there is no such section.

    Examples
    --------
    >>> table = case_reference("simulation").splitlines()
    >>> print(table[0])
    ### `[simulation]`
    >>> print(table[6])
    | `step` | `0.0025` | > 0 | longest integration step in s |
    """
    return key_tables(Case, section)


def _parse(path: Path, source: str) -> dict[str, Any]:
    check_file(path, source, _LARGEST, "a TOML file")
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"byte {error.start} is not UTF-8 text", where=source) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"is not TOML: {error}",
            where=source,
            remedy="Texts need quotes, numbers a decimal point, sections [brackets]",
        ) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=source) from error


def _inherit(data: dict[str, Any]) -> None:
    """Complete further recordings by the keys of the first one."""
    first = data.get("recording")
    common = {k: v for k, v in first.items() if k not in _OWN} if isinstance(first, dict) else {}
    for key in _FURTHER:
        if isinstance(data.get(key), list):
            data[key] = [{**common, **o} if isinstance(o, dict) else o for o in data[key]]
