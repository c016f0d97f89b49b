"""A functional mock-up unit as a black box, through FMPy (the extra ``fmu``)."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.events import Event
from errorscreen.exceptions import InputError, MissingExtraError, SimulationError, unknown_name


class FMU:
    """A functional mock-up unit (FMI 2 or 3) as a function for `CallableSimulator`.

    Loading a unit runs its machine code: use only files that you trust.

    Parameters
    ----------
    path : str or Path
        The ``.fmu`` file.
    parameters : iterable of str
        Variables that are set to theta, in this order.
    outputs : iterable of str
        Variables that are recorded, in the order of the simulator's outputs.
    inputs : iterable of str
        Input variables, driven by the event's signals of the same names.
    start_values : mapping of str to object, optional
        Other variables that are set before the start.
    step : float, optional
        Communication step in seconds, a part of the event's step; that step where not given.

    Raises
    ------
    InputError
        If the file or a variable does not exist.
    MissingExtraError
        If FMPy is not installed.
    """

    def __init__(
        self,
        path: str | Path,
        parameters: Iterable[str],
        outputs: Iterable[str],
        inputs: Iterable[str] = (),
        *,
        start_values: dict[str, Any] | None = None,
        step: float | None = None,
    ) -> None:
        self.path = Path(path)
        self.parameters, self.outputs, self.inputs = tuple(parameters), tuple(outputs), tuple(inputs)
        self.start_values, self.step = dict(start_values or {}), step
        if not self.path.is_file():
            raise InputError("the file does not exist", where=str(path))
        known = [v.name for v in _fmpy().read_model_description(str(self.path)).modelVariables]
        for name in (*self.parameters, *self.outputs, *self.inputs, *self.start_values):
            if name not in known:
                raise unknown_name(name, known, kind="variable", where=str(path))
        self._folder: str | None = None

    def __repr__(self) -> str:
        return f"FMU({self.path.name!r}, {len(self.parameters)} parameters, {len(self.outputs)} outputs)"

    def __getstate__(self) -> dict[str, Any]:
        """Leave the unpacked files behind: another process unpacks its own."""
        return {**self.__dict__, "_folder": None}

    def __call__(self, theta: NDArray[np.float64], event: Event) -> NDArray[np.float64]:
        """Responses (R, L) at the instants of an event."""
        time = event.time
        signals = getattr(event, "signals", {})
        driven = None
        if self.inputs:
            driven = np.empty(len(time), dtype=[("time", float), *((name, float) for name in self.inputs)])
            driven["time"] = time
            for name in self.inputs:
                driven[name] = signals[name]
        result = _fmpy().simulate_fmu(
            self._unpacked(),
            start_time=float(time[0]),
            stop_time=float(time[-1]),
            output_interval=self.step or event.dt,
            start_values={**self.start_values, **dict(zip(self.parameters, theta.tolist(), strict=True))},
            input=driven,
            output=list(self.outputs),
        )
        reached = float(result["time"][-1]) if len(result) else float("nan")
        if not reached >= time[-1] - 1e-6 * event.dt - 1e-9:
            raise SimulationError(f"{self.path.name} ended at {reached:g} s")
        return np.array([np.interp(time, result["time"], result[name]) for name in self.outputs])

    def _unpacked(self) -> str:
        """Folder with the unit's files, removed with this object."""
        if self._folder is None:
            self._folder = str(_fmpy().extract(str(self.path)))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        return self._folder


def _fmpy() -> Any:
    try:
        import fmpy
    except ImportError:
        raise MissingExtraError("fmpy", extra="fmu") from None
    return fmpy
