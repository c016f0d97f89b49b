"""A case file from a recording of unknown layout: everything guessed, each guess with its reason behind ``#``."""

from __future__ import annotations

import importlib.util
import json
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from errorscreen._runtime.files import check_new
from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.cases import load_case
from errorscreen.cases.case_models import RecordingSection
from errorscreen.data.disturbances import find_disturbances
from errorscreen.data.guess_file import FileGuess, guess_file
from errorscreen.data.guesses import Guess
from errorscreen.data.phasors import as_phasors
from errorscreen.data.plausibility import Doubt
from errorscreen.data.preparation import proposed_window
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.models.dyr import DyrFile, read_dyr

#: part of typical values by which those of a unit may differ
TYPICAL_RANGE = 0.6
#: mark of a guess that the file does not tell
CHECK = "CHECK: "


@dataclass(frozen=True)
class Written:
    """What `init_case` wrote.

    Parameters
    ----------
    case : Path
    picture : Path or None
        None where the recording cannot be read yet.
    check : tuple of str
        Guesses that the file does not tell, and doubts about the readings.
    missing : tuple of str
        What has to be stated before the case runs; empty for a case that runs.
    """

    case: Path
    picture: Path | None
    check: tuple[str, ...]
    missing: tuple[str, ...]


def init_case(
    path: str | os.PathLike[str],
    dyr: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
) -> Written:
    """Write a case file for a recording.

    Parameters
    ----------
    path : path-like
        File of the recording.
    dyr : path-like, optional
        Model file of the unit.
    out : path-like, optional
        Case file; the name of the recording with ``.toml`` in the working folder where not given. The picture has the
        same name with ``.png``.

    Raises
    ------
    InputError
        If a file cannot be used, or what would be written exists.
    """
    path = Path(path)
    out = Path(f"{path.stem}.toml" if out is None else out)
    picture = out.with_suffix(".png")
    check_new((out, picture), "Give another name with --out, or move the file away")
    model = None if dyr is None else read_dyr(dyr)
    found = guess_file(path, () if model is None else model.units)
    missing = [f"{name} was not found: state recording.columns.{name}" for name in _missing(found)]
    recording, problem = _read(path, found)
    if recording is not None:
        recording = _mended(path, found, recording)
        found.keys |= _event(recording)
        found.open += _others(out, recording)
    if "f" in found.channels and "angle" not in found.channels:
        found.open.append(
            "The angle of the voltage was not recorded. The frequency shows a jump of the angle at a fault late and "
            "smoothed, if at all: compare with an angle where there is one."
        )
    doubts = [] if recording is None else [t for t in recording.assumptions if isinstance(t, Doubt)]
    device = list(_device(out, found, model, dyr))
    lines = [
        f"# Written by errorscreen init from {_plain(path.name)}. The reason of each guess stands behind it.",
        f"# {CHECK.strip()} marks what the file does not tell. All keys: errorscreen keys",
        *(f"# Doubt: {_plain(text)}" for text in doubts),
        *(f"# Open: {_plain(text)}" for text in found.open),
        f"title = {_toml(path.stem)}",
        "",
        *_recording(out, path, found),
        *device,
        *_screening(),
    ]
    write_text_atomic(out, "\n".join(lines) + "\n")
    final, wrong = _verified(out)
    if problem is not None and final is None and problem.what not in [error.what for error in wrong]:
        wrong.append(problem)
    missing += [str(error) for error in wrong]
    if recording is not None:
        recording.plot().savefig(picture, dpi=110)
    checks = [line.strip("# ") for line in lines[4:] if CHECK in line]
    told = (*checks, *doubts, *found.open)
    return Written(out, None if recording is None else picture, told, tuple(missing))


def _missing(found: FileGuess) -> list[str]:
    """Channels that a case needs and that neither columns nor three phases give."""
    given = {*found.channels}
    if found.waveforms is not None:
        given |= {*("VPQ" if found.waveforms.value.get("current") else "V")}
    elif "phasors" in found.keys:
        given |= {*as_phasors(found.keys["phasors"].value, "").columns}
    return [name for name in "VPQ" if name not in given]


def _section(path: Path, found: FileGuess) -> RecordingSection:
    keys = {key: guess.value for key, guess in found.keys.items()}
    if found.channels:
        keys["columns"] = {name: dict(one.fields) for name, one in found.channels.items()}
    if found.waveforms is not None:
        keys["waveforms"] = found.waveforms.value
    return RecordingSection.model_validate({"path": path.name, **keys})


def _read(path: Path, found: FileGuess) -> tuple[Recording | None, InputError | None]:
    """Recording as it is understood."""
    try:
        return _quietly(_section(path, found), path.parent), None
    except InputError as error:
        return None, error


def _quietly(section: RecordingSection, folder: Path) -> Recording:
    with warnings.catch_warnings():  # doubts are written into the case file
        warnings.simplefilter("ignore", DataWarning)
        return section.load(folder)


def _mended(path: Path, found: FileGuess, recording: Recording) -> Recording:
    """Read an angle of unknown unit in degrees where the frequency says so."""
    angle = found.channels.get("angle")
    doubted = any(isinstance(t, Doubt) and "unit = 'deg'" in t for t in recording.assumptions)
    if angle is None or angle.fields["unit"] != "rad" or "within a turn" not in angle.reason or not doubted:
        return recording
    reason = "in degrees, because in radians it would not follow the frequency"
    found.channels["angle"] = replace(angle, fields={**angle.fields, "unit": "deg"}, reason=reason)
    again, _ = _read(path, found)
    if again is None or any(isinstance(t, Doubt) and "angle" in t for t in again.assumptions):
        found.channels["angle"] = angle
        return recording
    return again


def _event(recording: Recording) -> dict[str, Guess]:
    """Instant of the event, and a window around it in a long file."""
    start, time = recording.event_time, recording.time
    keys = {
        "event_time": Guess(round(float(start), 6), "in s, where V, P or Q first leaves its band of rest")
    }
    window = proposed_window(time, start)
    if window is not None:
        first, last = window
        reason = f"the file is {time[-1] - time[0]:.3g} s long; this is a window around the event"
        keys |= {"t_start": Guess(round(first, 6), reason), "t_end": Guess(round(last, 6), reason)}
    return keys


def _others(out: Path, recording: Recording) -> list[str]:
    """Sentence on the disturbances of a recording, where there are several, or where they cannot be told."""
    channels = {name: channel.values for name, channel in recording.channels.items()}
    try:
        found = find_disturbances(recording.time, channels)
    except InputError as error:
        return [f"Further disturbances were not looked for: {error.what}. {error.remedy}."]
    if len(found) < 2:
        return []
    at = ", ".join(f"{one.time:.6g}" for one in found)
    return [
        f"The file holds {len(found)} disturbances, at {at} s. errorscreen split {out} writes a case for each."
    ]


def _recording(out: Path, path: Path, found: FileGuess) -> Iterator[str]:
    relative = _relative(path, out)
    yield "[recording]"
    yield f"path = {_toml(relative)}  # relative to this file"
    for key, guess in found.keys.items():
        yield _line(key, guess)
    if "V" in _missing(found) and "base_kv" not in found.keys:
        yield "# base_kv = 20.0  # STATE: nominal voltage from line to line, where V is in V or kV"
    if "event_time" not in found.keys:
        yield "# event_time = 1.0  # STATE: start of the event in s; it was not found"
    if found.waveforms is not None:
        yield _line("waveforms", found.waveforms)
    yield ""
    yield "[recording.columns]"
    for name, one in found.channels.items():
        yield _line(name, Guess(one.fields, one.reason, one.check))
    units = {"V": "kV", "P": "MW", "Q": "Mvar"}
    for name in _missing(found):
        yield f'# {name} = {{ column = "…", unit = "{units[name]}" }}  # STATE: no column was recognised as {name}'
    yield ""


def _device(
    out: Path, found: FileGuess, model: DyrFile | None, dyr: str | os.PathLike[str] | None
) -> Iterator[str]:
    yield "[device]"
    if model is None or dyr is None:
        yield (
            'type = "synchronous_machine"  # CHECK: typical values; or dfig_plant, pv_plant, or dyr = "unit.dyr", the '
            "model file of the unit"
        )
        yield f"relative = {TYPICAL_RANGE}  # ranges around typical values: those of this unit may be far from them"
    else:
        yield f"dyr = {_toml(_relative(Path(dyr), out))}"
        units = model.units
        recorded = [one for one in units if one == found.machine]
        if len(units) == 1 or recorded:
            bus, id = recorded[0] if recorded else units[0]
            why = "as the recorded machine" if recorded else "the only unit of the file"
            yield f"bus = {_toml(bus)}  # {why}"
            yield f"id = {_toml(id)}"
        else:
            yield "# STATE: bus and id of the recorded unit; the file holds"
            for bus, id in units:
                yield f"# bus = {_toml(bus)}, id = {_toml(id)}"
    phases = found.waveforms is not None or "phasors" in found.keys
    if not phases and not {"angle", "f"} & found.channels.keys():
        yield (
            "constant_frequency = true  # CHECK: no column was taken for the angle of the voltage or the frequency, so "
            "the frequency is held; leave this out with one of them"
        )
    yield ""
    if model is None:
        yield "[device.parameters]  # of a synchronous machine; leave Ra out with other types"
        yield "Ra = { lower = 0.0, upper = 0.01 }  # not known, and otherwise taken to be 0.002 pu"
        yield ""


def _screening() -> Iterator[str]:
    if importlib.util.find_spec("torch") is None or importlib.util.find_spec("skorch") is None:
        yield "[screening]"
        yield 'methods = ["sensitivity"]  # the network needs torch, which is not installed'


def _verified(out: Path) -> tuple[Recording | None, list[InputError]]:
    """The recording read by the written file, and what keeps the file from running."""
    try:
        case = load_case(out)
        return _quietly(case.recording, case.folder), []
    except InputError as error:
        return None, [error]


def _relative(path: Path, out: Path) -> str:
    try:
        return Path(os.path.relpath(path.resolve(), out.resolve().parent)).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def _line(key: str, guess: Guess) -> str:
    reason = _plain(f"{CHECK if guess.check else ''}{guess.reason}")
    return f"{key} = {_toml(guess.value)}  # {reason}"


def _plain(text: str) -> str:
    """Text of a comment: in one line, and without what TOML does not allow there."""
    return " ".join("".join(one if one.isprintable() else " " for one in text).split())


def _toml(value: Any) -> str:
    """A value as TOML; texts of JSON are texts of TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml(one)}' for key, one in value.items() if one is not None)} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str):  # only of the last control character JSON has no escape
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
