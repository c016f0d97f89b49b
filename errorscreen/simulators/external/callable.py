"""A simulator that is a black box: a function of one parameter vector and an event."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.effects.measurement import measurement_effects
from errorscreen.events import Event
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators.assembly import measured
from errorscreen.simulators.base import Responses, Simulator, Status
from errorscreen.simulators.observations import check_recording
from errorscreen.simulators.signal_records import Names, named, signal_observation
from errorscreen.simulators.user_functions import identity

Function = Callable[[NDArray[np.float64], Event], Any]

#: largest clock skew that is searched for, in samples and as a share of the record
_LATE_SAMPLES, _LATE_SHARE = 50, 0.05

_Array = NDArray[np.float64]


class CallableSimulator(Simulator):
    """Responses of a function ``f(theta, event)`` that runs some other program: an FMU, a subprocess, a service.

    Screening, calibration, diagnosis and measurement effects work as for every simulator. The program has no ports, so
    there are no structural effects, and an unexplained error cannot be located inside it.

    Parameters
    ----------
    function : callable
        ``f(theta, event)`` of one parameter vector (m,) and an event; returns responses (R, L), or (L,) for a single
        channel. Where it raises, or returns values that are not finite, that simulation has failed.
    parameters : ParameterSpace or iterable of Parameter
    recordings : Recording, Observation or Event, or a list of them
        Gives the default event (the first) and the scales of the measurement effects.
    outputs : mapping of str to str, or iterable of str
        Names of the R channels, and their units.
    inputs : iterable of str
        Channels of recordings that drive the program; they reach the function as ``event.signals``.
    vectorized : bool
        Whether the function takes (n, m) at once and returns (n, R, L).
    n_jobs : int, optional
        Simulations at the same time, see `joblib.Parallel`.
    backend : str
        Of joblib: ``"threading"`` for other programs, ``"loky"`` for functions that compute in Python.

    Raises
    ------
    InputError
        If a recording does not fit.

    Examples
    --------
    >>> from errorscreen.events import InputSignal
    >>> time = np.arange(0, 5, 0.1)
    >>> box = CallableSimulator(
    ...     lambda theta, event: theta[0] * np.exp(-event.time / theta[1]),
    ...     [Parameter("A", 1.0, 0.5, 2.0), Parameter("T", 1.0, 0.5, 2.0, "s")],
    ...     InputSignal(time, "decay"), outputs={"level": "m"},
    ... )
    >>> float(box.simulate([[2.0, 1.0]]).values[0, 0, 0])
    2.0
    >>> [effect.name for effect in box.effects]
    ['scale_level', 'offset_level', 'skew_level', 'lag_level']
    """

    def __init__(
        self,
        function: Function,
        parameters: ParameterSpace | Iterable[Parameter],
        recordings: Any,
        *,
        outputs: Names,
        inputs: Names = (),
        vectorized: bool = False,
        n_jobs: int | None = None,
        backend: str = "threading",
    ) -> None:
        if not callable(function):
            raise InputError(
                f"the function is a {type(function).__name__}", allowed="a callable f(theta, event)"
            )
        self.function, self.vectorized, self.n_jobs, self.backend = function, vectorized, n_jobs, backend
        self.parameters = parameters if isinstance(parameters, ParameterSpace) else ParameterSpace(parameters)
        self.inputs = named(inputs, "inputs", empty=True)[0]
        self.channels, units = named(outputs, "outputs")
        self.units = tuple(units.values())
        items = list(recordings) if isinstance(recordings, list | tuple) else [recordings]
        if not items:
            raise InputError("the list of recordings is empty", allowed="at least one recording")
        seen = [item if isinstance(item, Event) else self.observe(item) for item in items]
        self.event = seen[0] if isinstance(seen[0], Event) else seen[0].event
        self.effects = self._measurement([item for item in seen if isinstance(item, Observation)])

    def __repr__(self) -> str:
        return self._short(getattr(self.function, "__name__", type(self.function).__name__))

    def settings(self) -> dict[str, Any]:
        """Function and added effects; see `Simulator.settings`."""
        return {
            "function": identity(self.function),
            "extensions": [effect.name for effect in self.extensions],
        }

    def observe(self, recording: Any) -> Observation:
        """Bring a recording onto the outputs and a uniform time grid, with the inputs as the event."""
        if isinstance(recording, Observation):
            return recording
        recording = check_recording(recording)
        return signal_observation(recording, self.inputs, self.channels, self.units, {})

    def part(self, observation: Observation, samples: int) -> Observation:
        """Return an observation with NaN after the first instants; the event stays, which the program may need."""
        early = np.arange(len(observation.time)) < samples
        return replace(observation, values=np.where(early, observation.values, np.nan))

    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta`; see `Simulator.simulate`.

        `InputError` if the function returns another shape than outputs and event have.
        """
        event = self.event if event is None else event
        theta = self.acting(self.parameters.validate(theta), event)
        own = theta[:, : theta.shape[1] - sum(len(e.parameters) for e in self.extensions)]
        out = np.full((len(own), len(self.channels), len(event.time)), np.nan)
        rows, reasons = self._called(own, event)
        for i, row in enumerate(rows):
            if row is not None:
                out[i] = self._shaped(row, event)
        if self.extensions:
            values = dict(zip(self.parameters.names, theta.T, strict=True))
            with np.errstate(all="ignore"):
                out = measured(out, self.channels, self.extensions, values, event.dt)
        well = np.isfinite(out).all(axis=(1, 2))
        out[~well] = np.nan
        status = np.where(well, Status.OK, Status.FAILED)
        return Responses(out, status.astype(np.int64), event.time, self.channels, "; ".join(reasons[:1]))

    def _called(self, own: _Array, event: Event) -> tuple[list[Any], list[str]]:
        """Results of the function for each row, None where it raises, and the reasons."""
        if self.vectorized:
            try:
                rows = list(self.function(own.copy(), event))
                if len(rows) == len(own):
                    return rows, []
            except Exception:  # a bad row must not spoil the others: run each by itself
                pass
            pairs = [_guarded(lambda t, e: next(iter(self.function(t[None], e))), row, event) for row in own]
        else:
            with Parallel(n_jobs=self.n_jobs, backend=self.backend) as pool:
                pairs = pool(delayed(_guarded)(self.function, row.copy(), event) for row in own)
        return [row for row, _ in pairs], [reason for _, reason in pairs if reason]

    def _shaped(self, values: Any, event: Event) -> _Array:
        shape = (len(self.channels), len(event.time))
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.size != np.prod(shape) or array.shape[-1] != shape[-1]:
            raise InputError(
                f"the function returned shape {array.shape or 'of a single number'}",
                where=f"event {event.name!r}",
                allowed=f"{shape}: channels, then instants of event.time",
            )
        return array.reshape(shape)

    def _measurement(self, observations: list[Observation]) -> tuple[Any, ...]:
        """Measurement effects, with ranges from the measurements, or else from the nominal responses."""
        rows = [o.values for o in observations] or [self.baseline()]
        time = self.event.time
        late = min(_LATE_SHARE * float(time[-1] - time[0]), _LATE_SAMPLES * self.event.dt)
        found: list[Any] = []
        for r, (name, unit) in enumerate(zip(self.channels, self.units, strict=True)):
            size = max(float(np.nanmax(np.abs(row[r]), initial=0.0)) for row in rows)
            if size > 0:
                found += measurement_effects([name], unit=unit, size=size, late=late)
        return tuple(found)


def _guarded(function: Function, theta: _Array, event: Event) -> tuple[Any, str]:
    """Result of one simulation, or None and the reason."""
    try:
        result = function(theta, event)
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"
    return result, "" if result is not None else "it returned nothing"
