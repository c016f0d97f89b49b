"""All problems of a case file at once, before any long work, and the expected time of the run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.cases import Case
from errorscreen.cases.case_file import examine_case
from errorscreen.cases.case_models import RecordingSection
from errorscreen.data.preparation import proposed_window
from errorscreen.effects import EFFECTS, common_skew, measurement_effects, mva_base
from errorscreen.events import Playback
from errorscreen.exceptions import DataWarning, InputError, MissingExtraError, unknown_name
from errorscreen.learning.regressors import require_network
from errorscreen.models.device import Remark
from errorscreen.screening import SCREENERS
from errorscreen.workflow.init_case import CHECK
from errorscreen.workflow.run import nominal_response
from errorscreen.workflow.study import Study
from errorscreen.workflow.suspect_readings import doubts

#: parameter vectors of the timed batch
_BATCH = 256
#: Measured on the demo and on examples/dyr: simulations of the fit of all parameters beside its library;
#: simulations of a full search for each draw of each effect; and time for each simulation of a study, which come in
#: small batches, over that in a large one.
_FIT, _SEARCH, _OVERHEAD = 3500, 80, 3.0
#: s that the network takes for a sample, an epoch and a pixel of its images; and s of compiling and writing
_TRAINING, _START = 8e-7, 15.0


@dataclass(frozen=True)
class Checked:
    """Result of `check_case`.

    Parameters
    ----------
    problems : tuple of str
        What keeps the case from running.
    suspects : tuple of str
        Doubts about readings.
    seconds : (float, float) or None
        Least and most time that is expected of a run; None with problems.
    advice : tuple of str
        What would make the result better, or the run shorter.
    """

    problems: tuple[str, ...]
    suspects: tuple[str, ...]
    seconds: tuple[float, float] | None = None
    advice: tuple[str, ...] = ()

    def summary(self) -> str:
        """All of it in words.

        Examples
        --------
        >>> print(Checked((), (), (20.0, 400.0)).summary())
        No problem was found.
        Expected time of errorscreen run: about 20 seconds if parameters explain the error, up to about 7 minutes if a
        cause is searched.
        """
        lines = [f"Problem: {text}" for text in self.problems]
        lines += [f"Suspect reading: {text}" for text in self.suspects]
        lines = lines or ["No problem was found."]
        if self.seconds is not None:
            least, most = map(in_words, self.seconds)
            lines.append(f"Expected time of errorscreen run: {least}")
            if most != least:
                lines[-1] += f" if parameters explain the error, up to {most} if a\ncause is searched"
            lines[-1] += "."
        return "\n".join([*lines, *self.advice])


def check_case(path: str | os.PathLike[str]) -> Checked:
    """Check case file, recordings, model, names of effects, extras and readings.

    Parameters
    ----------
    path : path-like
        Case file.

    Returns
    -------
    Checked
        With every problem that can be seen without the others being mended.

    Raises
    ------
    InputError
        If the file is no TOML file.
    """
    examined = examine_case(path)
    problems = [str(error) for error in examined.problems]
    case, folder = examined.case, Path(path).parent
    suspects: list[str] = []
    with warnings.catch_warnings():  # doubts are told below
        warnings.simplefilter("ignore", DataWarning)
        for where, section in examined.recordings.items():
            found = recording_problems(section, folder)
            problems += [f"[{where}] {text}" for text in found]
        for where, section in examined.mended.items():
            found = recording_problems(section, folder, only_columns=True)
            problems += [f"[{where}] {text}" for text in found]
        if case is None:
            return Checked(tuple(dict.fromkeys(problems)), ())
        problems += _missing_extras(case)
        problems += [text for text in _model_problems(case) if not any(text in told for told in problems)]
        if problems:
            problems += _unknown_effects(case)
            return Checked(tuple(dict.fromkeys(problems)), ())
        try:
            study = Study.from_case(case)
            suspects = doubts(study.observations)
            for one in study.observations:
                nominal_response(study.simulator, one)
        except InputError as error:
            return Checked((str(error),), tuple(suspects))
        told = [_unchecked(Path(path)), study.typical]
        advice = (*filter(None, told), *_remarks(study), *_long_recordings(study))
        return Checked((), tuple(suspects), _expected_seconds(study), advice)


def _unchecked(path: Path) -> str:
    """Sentence on the guesses of `errorscreen init` that nobody has confirmed; empty without any."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    keys = [line.split("=")[0].strip() for line in lines if CHECK in line and not line.startswith("#")]
    if not keys:
        return ""
    return (
        f"Guesses that nobody has confirmed yet: {', '.join(keys)}. Correct each, or delete its mark {CHECK.strip()} "
        "in the case file."
    )


def recording_problems(section: RecordingSection, folder: Path, *, only_columns: bool = False) -> list[str]:
    """All problems of a recording: a column that cannot be used is left out to see the others.

    With `only_columns`, which is for a section without its wrong keys, these and a file that is not there.
    """
    found: list[str] = []
    columns = dict(section.columns)
    while True:
        left = section.model_copy(update={"columns": columns})
        try:
            left.load(folder)
        except InputError as error:
            culprits = [role for role in columns if _names(error, role, section)]
            last = bool(found) and not culprits
            if only_columns and not culprits and (folder / section.path).exists():
                return found
            if not last or "event" not in error.what:  # without a column, an event may not be seen
                found.append(str(error))
            if not culprits or len(columns) == len(culprits):
                return found
            for role in culprits:
                del columns[role]
            continue
        return found


def _names(error: InputError, role: str, section: RecordingSection) -> bool:
    """Whether an error is about the column of a channel."""
    spec = section.columns[role]
    headers = [header for header in (spec.column, spec.real, spec.imag) if header]
    marks = [f"channel {role!r}", *(f"column {header!r}" for header in headers)]
    return any(mark in f"{error.where} {error.what}" for mark in marks)


def _missing_extras(case: Case) -> list[str]:
    methods = case.screening.methods if "methods" in case.screening.model_fields_set else ()
    trained = any(SCREENERS[name].trains for name in methods)
    if not trained and not (case.discovery.first_look and case.discovery.enabled):
        return []
    try:
        require_network()
    except MissingExtraError as error:
        return [f"{case.source}, screening.methods: {error} Or leave out the methods that train a network."]
    return []


def _model_problems(case: Case) -> list[str]:
    """Problems of a model file beyond the first one, which `examine_case` tells."""
    if case.device is None or case.device.dyr is None:
        return []
    try:
        file = case.device.file(case.folder)
    except InputError:
        return []
    try:
        case.device.model(case.folder, case.steps)
    except InputError:
        return file.check() if file is not None and len(file.units) == 1 else []
    return []


def _channels(section: RecordingSection) -> list[str]:
    """Names of the channels of a recording: those of the columns, and all that may follow from three phases."""
    follow = section.waveforms or section.phasors or not section.columns
    return list(dict.fromkeys((*section.columns, *(("V", "angle", "f", "P", "Q") if follow else ()))))


def _unknown_effects(case: Case) -> list[str]:
    """Names of no effect at all; which ones fit the model is known only with a recording."""
    faults = (
        *measurement_effects(_channels(case.recording)),
        mva_base(),
        common_skew(),
    )
    known = {effect.name for effect in (*EFFECTS.values(), *faults)}
    return [
        str(unknown_name(name, known, kind="effect", where=f"{case.source}, discovery.effects"))
        for name in case.discovery.effects or ()
        if name not in known
    ]


def _long_recordings(study: Study) -> Iterator[str]:
    """Windows of recordings that are much longer than their event; events of a grid state their end themselves."""
    for one in study.observations:
        window = proposed_window(one.time, one.event.start) if isinstance(one.event, Playback) else None
        if window is not None:
            length, part = one.time[-1] - one.time[0], window[1] - window[0]
            yield (
                f"{one.event.name} lasts {length:.3g} s. t_start = {window[0]:.6g} and t_end = {window[1]:.6g} would "
                f"keep the event and make the run about {length / part:.2g} times shorter."
            )


def _remarks(study: Study) -> list[str]:
    """What the model takes otherwise than its file says, channels that it does not have, and limits that act."""
    texts = [text for one in study.observations for text in one.assumptions if isinstance(text, Remark)]
    return [*dict.fromkeys(texts)]


def _expected_seconds(study: Study) -> tuple[float, float]:
    """Least and most seconds of a run, from a timed batch and the numbers of simulations."""
    simulator, event = study.simulator, study.observation.event
    theta = latin_hypercube(simulator.parameters, _BATCH, 0)
    simulator.simulate(theta, event)  # compiles
    start = perf_counter()
    simulator.simulate(theta, event)
    each = _OVERHEAD * (perf_counter() - start) / _BATCH
    m, n = len(simulator.parameters), len(study.observations)
    screening, calibration, search = study.screening, study.calibration, study.discovery
    trained = [name for name in screening.methods if SCREENERS[name].trains]
    fits = n * (calibration.library + _FIT)
    fits += len(trained) * screening.samples * (m + 1)
    if "pso" in calibration.methods:
        fits += len(screening.methods) * calibration.particles * calibration.iterations
    pixels = screening.frequencies * screening.columns * len(simulator.channels)
    training = len(trained) * screening.samples * screening.epochs * pixels * _TRAINING
    least = _START + training + each * fits
    if not search.enabled:
        return least, least
    effects = simulator.effects_named(search.effects)
    return least, least + each * _SEARCH * n * search.draws * len(effects)


def in_words(seconds: float) -> str:
    """Duration in words.

    >>> in_words(8), in_words(130), in_words(9000)
    ('about 10 seconds', 'about 2 minutes', 'about 2.5 hours')
    """
    if seconds < 100:
        return f"about {max(10, 10 * round(seconds / 10))} seconds"
    if seconds < 5400:
        return f"about {round(seconds / 60)} minutes"
    return f"about {round(seconds / 3600, 1):g} hours"
