"""The public functions of the package: from a recording to a fit, a diagnosis and causes in a few lines."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from errorscreen.calibration import CALIBRATORS, BaseCalibrator
from errorscreen.data.frames import Specs, from_frame
from errorscreen.data.headers import guess_columns, guess_time, time_unit_of
from errorscreen.data.pandas_tables import headers_of_frame
from errorscreen.data.readers import READERS, check_options, read_recording, recognised
from errorscreen.data.readers.base import LAYOUT_KEYS
from errorscreen.data.recordings import Recording
from errorscreen.discovery.finder import CauseFinder
from errorscreen.exceptions import InputError
from errorscreen.simulators.base import Simulator

if TYPE_CHECKING:
    import pandas as pd

#: Options that decide where the headers of a file are.
_LAYOUT = LAYOUT_KEYS - {"time", "time_unit", "time_format", "time_base", "quality"}


def read(
    source: str | os.PathLike[str] | pd.DataFrame | Mapping[str, Any],
    columns: Specs | None = None,
    *,
    base_mva: float,
    f_nominal: float,
    time: str | Sequence[str] | None = None,
    time_unit: str | None = None,
    format: str | None = None,
    **options: Any,
) -> Recording:
    """Read a recording from a file, a table or arrays.

    Parameters
    ----------
    source : path-like, pandas.DataFrame or mapping of str to array-like of shape (L,)
        A file of a format in `errorscreen.data.READERS`, for example a text file with one header row; a table, or
        columns by header.
    columns : mapping of str to Column, str or mapping, optional
        Source of each channel by its name, see `errorscreen.data.from_frame`. Where not given, headers must name the
        channels beyond doubt: ``V``, ``angle``, ``f``, ``P``, ``Q`` in pu, rad, Hz, pu and pu, or usual spellings with
        a unit, such as ``P [MW]`` or ``V_mag_kV``. Of a COMTRADE record its phases A, B and C are taken.
    base_mva : float
        Base that P and Q are converted to, in MVA: that of the device.
    f_nominal : float
        Nominal frequency in Hz.
    time : str or two of them, optional
        Header of the time stamps; the column ``time`` or ``t``, or the index of a table, where not given. Two headers
        as in `errorscreen.data.from_frame`.
    time_unit : {"s", "ms", "us", "ns", "ticks", "min", "h", "d", "iso"}, optional
        Where not given, the unit in the header, or seconds.
    format : str, optional
        Name in `errorscreen.data.READERS`; recognised by the content of the file where not given.
    **options
        Of `errorscreen.data.read_csv` for a file and `errorscreen.data.from_frame` otherwise: `base_kv`, `t_start`,
        `phasors`, …

    Returns
    -------
    Recording
        Its `assumptions` say how headers and units were understood.

    Raises
    ------
    InputError
        If something cannot be used, or headers leave a doubt; the message lists the headers.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 4, 0.02)
    >>> rec = read({"t [s]": t, "P [MW]": np.where(t < 1, 40.0, 30.0)}, base_mva=50, f_nominal=50)
    >>> round(rec.initial(["P"])["P"], 6), rec.event_time
    (0.8, 1.0)
    """
    reader: Callable[..., Recording]
    phases = bool({"waveforms", "phasors"} & options.keys())
    if isinstance(source, str | os.PathLike):
        where, form = f"file {source}", format or recognised(Path(source))
        found = READERS.find(form, "read")
        check_options(form, options, where)
        reader = partial(read_recording, Path(source), format=form)
        layout = {name: options[name] for name in _LAYOUT & options.keys()}
        guess = found.needs_columns and not phases
        needed = time is None or (columns is None and guess)
        headers = found.headers(Path(source), **layout) if needed and found.headers is not None else []
    else:
        if format is not None:
            raise InputError(
                f"format is {format!r} but the source is no file", where="read", remedy="Leave format out"
            )
        frame = _frame(source)
        headers, where, guess = headers_of_frame(frame), "table", not phases
        reader = partial(from_frame, frame)
    notes = []
    if columns is None and guess:
        columns = guess_columns(headers, where)
        taken = ", ".join(f"{role} from {column.column!r}" for role, column in columns.items())
        notes = [f"Columns were taken by their names: {taken}."]
    if time is None:
        time, unit = guess_time(headers)
        if time is None and not isinstance(source, str | os.PathLike) and not _is_time(frame.index):
            raise InputError(
                f"no column is the time beyond doubt; the columns are {', '.join(map(repr, headers))}",
                where="read",
                allowed="one column such as 'time', 't [s]' or 'time [ms]', or an index of instants",
                remedy="Give time, the header of the time stamps, and time_unit",
            )
    else:
        unit = time_unit_of(time) if isinstance(time, str) else None
    if time is not None:
        options["time"] = time
    if time_unit or unit:
        options["time_unit"] = time_unit or unit
    recording = reader(columns, base_mva=base_mva, f_nominal=f_nominal, **options)
    return replace(recording, assumptions=(*notes, *recording.assumptions))


def _is_time(index: pd.Index[Any]) -> bool:
    """Whether an index holds instants; row numbers are none."""
    return index.dtype.kind in "fmM"


def _frame(source: Any) -> pd.DataFrame:
    import pandas as pd

    if isinstance(source, pd.DataFrame):
        return source
    if not isinstance(source, Mapping):
        raise InputError(
            f"the source is of type {type(source).__name__}",
            where="read",
            allowed="a path, a table or a mapping",
        )
    lengths = {header: np.shape(values) for header, values in source.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise InputError(
            f"the columns have the shapes {lengths}", where="read", allowed="one length for all columns"
        )
    return pd.DataFrame(dict(source))


def calibrate(
    simulator: Simulator,
    recordings: Any,
    method: str = "map",
    parameters: Iterable[str] | None = None,
    *,
    random_state: Any = 0,
    **options: Any,
) -> BaseCalibrator:
    """Fit parameters of a simulator to one recording or to several together, and return the fitted calibrator.

    Parameters
    ----------
    simulator : Simulator
    recordings : Observation, or anything ``simulator.observe`` takes, or a list of them
    method : str
        Name in `errorscreen.calibration.CALIBRATORS`: ``"map"`` gives intervals, ``"pso"`` is the paper's swarm.
    parameters : iterable of str, optional
        Names of the parameters to fit; the others keep their nominal values. All where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
    **options
        Further arguments of the calibrator.

    Raises
    ------
    InputError, SimulationError
        If an argument or a recording cannot be used, or nothing can be simulated.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, truth = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> fit = calibrate(plant, recording, parameters=["Xd1", "Tj"], n_starts=1)
    >>> sorted(fit.values_)
    ['Tj', 'Xd1']
    """
    kind: Any = CALIBRATORS.find(method, "calibrate")
    return kind(simulator, parameters, random_state=random_state, **options).fit(recordings)


def find_causes(
    simulator: Simulator,
    recordings: Any,
    effects: Sequence[str] | None = None,
    *,
    random_state: Any = 0,
    **options: Any,
) -> CauseFinder:
    """Find what a simulator lacks to reproduce one recording or several together; return the fitted finder.

    Parameters
    ----------
    simulator : Simulator
    recordings : Observation, or anything ``simulator.observe`` takes, or a list of them
    effects : sequence of str, optional
        Names of the effects to try; all of the simulator's where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
    **options
        Further arguments of `errorscreen.discovery.CauseFinder`, for example `max_effects`.

    Raises
    ------
    InputError, SimulationError
        If an argument or a recording cannot be used, or nothing can be simulated.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, truth = demo_recordings(0)
    >>> find_causes(PlantSimulator("synchronous_machine", recording), recording, max_effects=0).verdict_.kind
    'parameters'
    """
    return CauseFinder(simulator, effects, random_state=random_state, **options).fit(recordings)
