"""The result of a study, as it stands in ``result.json``: classes, JSON schema, reading and writing."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, field, is_dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ValidationError

from errorscreen._runtime.persistence import write_bytes_atomic, write_text_atomic
from errorscreen._runtime.typed import Real, from_json, json_schema, to_json
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.discovery import Contribution, Diagnosis, ModelFit
from errorscreen.exceptions import InputError
from errorscreen.report.version1 import upgraded
from errorscreen.validation import Validation

if TYPE_CHECKING:
    import pandas as pd

#: Raised whenever a reader of the old version would misread the new one.
SCHEMA_VERSION: Literal[2] = 2
#: use of a recording: fitted; fitted together with the first one; or only judged on
Role = Literal["fit", "together", "held_out"]


@dataclass(frozen=True)
class StudyInfo:
    """The model and the base of its quantities.

    Parameters
    ----------
    title : str
    device, device_title : str
        Name of the model, and the same in words.
    base_mva, f_nominal : float
        1 pu of P and Q in MVA, and the nominal frequency in Hz.
    parameters : int
        Number of candidate parameters.
    model_file, model_sha256 : str or None
        File that the model comes from, and its digest.
    """

    title: str
    device: str
    device_title: str
    base_mva: Real
    f_nominal: Real
    parameters: int
    model_file: str | None = None
    model_sha256: str | None = None


@dataclass(frozen=True)
class ChannelInfo:
    """One recorded channel.

    Parameters
    ----------
    name, unit : str
    noise : float
        Standard deviation of the measurement noise, in unit.
    missing : float
        Share of the samples without reading, 0 to 1.
    """

    name: str
    unit: str
    noise: Real
    missing: Real


@dataclass(frozen=True)
class RecordingInfo:
    """One recording.

    Parameters
    ----------
    name : str
    role : {"fit", "together", "held_out"}
        Fitted; fitted together with the first one, but not used for screening; only judged on.
    path : str or None
    start, stop, dt : float
        First and last instant, and the step at which signals are compared, in s.
    event_time : float
        Start of the event in s.
    channels : tuple of ChannelInfo
    assumptions : tuple of str
    initial : dict of str to float
        Operating point before the event: V, P and Q in pu, and what else is played back.
    sha256 : str or None
        Digest of the file, by which it can be told again.
    """

    name: str
    role: Role
    path: str | None
    start: Real
    stop: Real
    dt: Real
    event_time: Real
    channels: tuple[ChannelInfo, ...]
    assumptions: tuple[str, ...] = ()
    initial: dict[str, Real] = field(default_factory=dict)
    sha256: str | None = None


@dataclass(frozen=True)
class Screening:
    """Ranking of the parameters by one screener.

    Parameters
    ----------
    method : str
    contributions : dict of str to float
        By parameter.
    selected : tuple of str
        The largest contribution first.
    rule : str
        How they were selected, for example "the 3 largest".
    overlap : float
        Share of the selection that belongs to the largest true contributions; NaN if those are not known.
    n_simulations, n_failed : int
    seconds : float
    threads : int or None
        Of the training of a network, whose rounding errors depend on them.
    """

    method: str
    contributions: dict[str, Real]
    selected: tuple[str, ...]
    rule: str = ""
    overlap: Real = float("nan")
    n_simulations: int = 0
    n_failed: int = 0
    seconds: Real = float("nan")
    threads: int | None = None


@dataclass(frozen=True)
class Run:
    """How the result was computed.

    Parameters
    ----------
    version, python : str
        Of errorscreen, and of Python.
    packages : dict of str to str
        Versions of libraries that decide the result.
    random_state, n_jobs : int
    step : float
        Longest integration step of the model in s; NaN if it has none.
    n_simulations, n_failed : int
    seconds : float
    started : str
        ISO 8601.
    reused : tuple of str
        Stages taken over from an earlier run.
    """

    version: str
    python: str
    packages: dict[str, str]
    random_state: int
    n_jobs: int
    step: Real
    n_simulations: int
    n_failed: int
    seconds: Real
    started: str
    reused: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class NewRecord:
    """Record of a standard model that the user's file lacks.

    Parameters
    ----------
    model : str
    values : dict of str to float
        Its constants.
    """

    model: str
    values: dict[str, float]


@dataclass(frozen=True)
class Correction:
    """Changes of the user's model file.

    Parameters
    ----------
    path : str
        The corrected file, in the folder of results.
    original : str
        The user's file.
    parameters : tuple of Estimate
        Changed constants, and parameters of added parts, with their intervals; all others keep the values of the file.
    before, chi2_per_sample : float
        χ²/N on the fitted recordings with the values of the file, and with these changes.
    difference : str
        Lines of the file that change, in the unified format.
    values : dict of str to float
        Constants of the file with their new values.
    records : tuple of NewRecord
        Parts that the file lacks.
    """

    path: str
    original: str
    parameters: tuple[Estimate, ...]
    before: Real
    chi2_per_sample: Real
    difference: str
    values: dict[str, float] = field(default_factory=dict)
    records: tuple[NewRecord, ...] = ()


@dataclass(frozen=True, repr=False)
class Result:
    """Result of a study.

    Parameters
    ----------
    study : StudyInfo
    recordings : tuple of RecordingInfo
    diagnosis : Diagnosis
    screening : tuple of Screening
    contributions : dict of str to float or None
        True contributions of the parameters, where the recording was simulated with known ones.
    calibration : tuple of Calibration
    models : tuple of ModelFit
        Errors of the nominal model, then of each calibrated one.
    first_look : tuple of Contribution
        The largest first; empty if not asked for.
    hints : tuple of str
        Doubts about units, bases and signs of the recordings, and about values that are not those of the unit, to be
        settled first.
    advice : tuple of str
        What to check and to record next.
    run : Run
    correction : Correction or None
        Of the user's model file; None without one, and where an effect other than its flags, the measurement or noise
        is named.
    validation : Validation or None
        Errors in windows and figures of steps, by rule; None for a model that is no plant.
    schema_version : int
    """

    study: StudyInfo
    recordings: tuple[RecordingInfo, ...]
    diagnosis: Diagnosis
    screening: tuple[Screening, ...]
    contributions: dict[str, Real] | None
    calibration: tuple[Calibration, ...]
    models: tuple[ModelFit, ...]
    first_look: tuple[Contribution, ...]
    hints: tuple[str, ...]
    advice: tuple[str, ...]
    run: Run
    correction: Correction | None = None
    validation: Validation | None = None
    schema_version: Literal[2] = SCHEMA_VERSION

    @property
    def first_look_compared(self) -> str:
        """Ranks of the named effects in the first look, in one sentence; empty without a first look."""
        if not self.first_look:
            return ""
        ranks = {
            c.name: f"rank {n} of {len(self.first_look)}" for n, c in enumerate(self.first_look, start=1)
        }
        names = dict.fromkeys(effect.original for effect in self.diagnosis.extension)
        if names:
            told = ", and ".join(f"{name}, which has {ranks.get(name, 'no rank')} here" for name in names)
            return f"The search names {told}."
        first = next((c.name for c in self.first_look if c.kind == "effect"), "")
        if not first:
            return "The search names no effect."
        return f"The search names no effect; the first one here, {first}, has {ranks[first]}."

    def summary(self) -> str:
        """Verdict, causes and advice as text."""
        lines = [f"{self.study.title}", self.diagnosis.summary()]
        lines += [f"Next: {sentence}" for sentence in self.advice]
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """Errors of each channel of each recording, one row for each model."""
        import pandas as pd

        extra = [m for m in self.diagnosis.models if m.label not in {own.label for own in self.models}]
        rows = [{"model": m.label, **vars(fit)} for m in (*self.models, *extra) for fit in m.channels]
        return pd.DataFrame(rows).set_index(["model", "recording", "channel"])

    def __repr__(self) -> str:
        return f"<Result of {self.study.title[:60]!r}: {self.diagnosis.final.kind}>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>{self.to_frame().to_html()}"


def write_result(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write ``result.json``, complete or not at all, with null for numbers that do not exist.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    return write_bytes_atomic(path, to_json(result) + b"\n")


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read and check a ``result.json``, also of schema version 1.

    Raises
    ------
    InputError
        If it is missing, is no result, or has an unknown version.
    """
    where = f"file {path}"
    try:
        data = json.loads(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as JSON: {error}", where=where) from error
    version = data.get("schema_version") if isinstance(data, dict) else None
    if version not in (1, SCHEMA_VERSION):
        raise InputError(
            f"schema_version is {version!r}",
            where=where,
            allowed=f"1 or {SCHEMA_VERSION}",
            remedy="Run the case again",
        )
    try:
        if version == 1:
            data = upgraded(data)
        return from_json(Result, json.dumps(data))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(f"{first['msg']} (key {key})", where=where, remedy="Run the case again") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"it is no result of schema version {version}: {error!r}",
            where=where,
            remedy="Run the case again",
        ) from error


def result_schema() -> dict[str, Any]:
    """JSON schema of ``result.json``; its descriptions are those of the docstrings."""
    schema = json_schema(Result)
    described = {name: _classes()[name] for name in schema["$defs"] if name in _classes()}
    for name, definition in (*((n, schema["$defs"][n]) for n in described), ("Result", schema)):
        summary, keys = _described(_classes()[name].__doc__ or "")
        definition["description"] = summary
        for key, text in keys.items():
            if key in definition["properties"]:
                definition["properties"][key]["description"] = text
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def write_json_schema(path: str | os.PathLike[str]) -> Path:
    """Write the JSON schema, for the documentation."""
    return write_text_atomic(path, json.dumps(result_schema(), indent=2) + "\n")


def _classes() -> dict[str, type]:
    """Classes of the result tree by name."""
    import errorscreen.calibration.result as calibration
    import errorscreen.discovery as discovery
    import errorscreen.validation as validation

    spaces = (vars(calibration), vars(discovery), vars(validation), globals())
    return {
        name: c for space in spaces for name, c in space.items() if isinstance(c, type) and is_dataclass(c)
    }


def _described(docstring: str) -> tuple[str, dict[str, str]]:
    """Summary of a numpydoc docstring, and the description of each parameter."""
    summary, _, rest = docstring.partition("\n\n")
    section = re.search(r"Parameters\n\s+-+\n(.*?)(?:\n\n|\Z)", rest, re.DOTALL)
    keys: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else ():
        if re.match(r" {4}\w", line):
            names = line.partition(" : ")[0].replace(",", " ").split()
        elif line.strip():
            keys |= {name: f"{keys.get(name, '')} {line.strip()}".strip() for name in names}
    return summary.strip(), keys
