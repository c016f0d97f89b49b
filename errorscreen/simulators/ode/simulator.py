"""A model that a user writes as a function of states, inputs and parameters."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from errorscreen._runtime.threads import parallel_map, threads_left
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.data.resampling import check_steps
from errorscreen.effects.base import Effect
from errorscreen.effects.generic import GenericEffect
from errorscreen.events import Event, InputSignal
from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators.assembly import measured, statuses, step_of
from errorscreen.simulators.base import Responses, Simulator
from errorscreen.simulators.observations import check_recording
from errorscreen.simulators.ode import kernel as ode_kernel
from errorscreen.simulators.ode.initial_states import InitialStates
from errorscreen.simulators.ode.library import Quantities, effect_table, library
from errorscreen.simulators.recent import Recent
from errorscreen.simulators.signal_records import (
    INTERPOLATIONS,
    Names,
    between_samples,
    named,
    signal_observation,
)
from errorscreen.simulators.user_functions import (
    Function,
    check_outputs,
    compile_all,
    evaluate_once,
    identity,
    nothing,
    selection,
)

#: largest plausible response, whatever its unit
_PLAUSIBLE = 1e12
#: simulations that one thread takes at a time
_SHARE = 16
#: share of a record from which its initial state is estimated
_BEGINNING = 1.0 / 3.0

_Array = NDArray[np.float64]


class ODESimulator(Simulator):
    r"""A model :math:`\dot x = f(t, x, u, p)` that a user writes as a Python function.

    Numba compiles the function where it can. Generic effects are rows of a table for the compiled integrator, so a new
    effect never compiles anything.

    Parameters
    ----------
    rhs : callable
        ``rhs(t, x, u, p, dx)`` writes the derivatives of the states x into dx. u holds the inputs, then the internal
        signals; p the parameters, then the constants; each array in the order of declaration.
    states : mapping of str to str, or iterable of str
        Names of the states, and their units.
    parameters : ParameterSpace or iterable of Parameter
        Uncertain parameters; may be empty if initial states are fitted.
    recordings : Recording, Observation, InputSignal, or a list of them
        Recordings to fit: they give the default event (the first), the scales of the effects, and a set of initial
        states for each. Others can be simulated and judged as well.
    inputs : mapping of str to str, or iterable of str
        Names of measured inputs, and their units.
    outputs : mapping of str to str, or iterable of str
        Names of the measured outputs, and their units: states, inputs or signals where `readout` is not given.
    initial : mapping of str to (float, "measured" or Parameter)
        Initial states: a number; ``"measured"`` for an output, known to its noise; or a parameter that is fitted for
        each recording, with its nominal value as the first guess. Zero where not given.
    readout : callable, optional
        ``readout(t, x, u, p, y)`` writes the outputs into y.
    signals : mapping of str to str, or iterable of str
        Names of internal signals, and their units, for example the output of a controller.
    law : callable, optional
        ``law(t, x, u, p, v)`` writes the internal signals into v. Effects can then act on them (dead band, lag,
        saturation, ...).
    constants : mapping of str to float
        Known numbers, behind the parameters in p.
    step : float, optional
        Longest step of the integration in seconds; the distance of the samples where not given.
    interpolation : {"linear", "hold", "cubic", "bandlimited"}
        Course of inputs between their samples.
    templates : iterable of str, optional
        Effects in the library, keys of `errorscreen.effects.generic.TEMPLATES` but ``"latent"``; all where not given.
    effects : iterable of Effect, optional
        The library itself, instead of `templates`.
    compile : bool
        Whether to compile the functions.
    n_threads : int, optional
        Numba's setting where not given. The result does not depend on it.

    Raises
    ------
    InputError
        If names are not unique, a function fails or leaves values unset at the nominal parameters, or a recording does
        not fit.

    Warns
    -----
    EngineWarning
        If the functions cannot be compiled; they then run as Python.

    Examples
    --------
    >>> def rhs(t, x, u, p, dx):
    ...     dx[0] = x[1]
    ...     dx[1] = u[0] - p[0] * x[1] - p[1] * x[0]
    >>> time = np.arange(0, 5, 0.05)
    >>> push = InputSignal(time, "push", 1.0, {"force": 1.0 * (time >= 1.0)})
    >>> model = ODESimulator(
    ...     rhs, {"position": "m", "velocity": "m/s"}, [Parameter("c", 0.5, 0.1, 2.0), Parameter("k", 4.0, 1.0, 9.0)],
    ...     push, inputs={"force": "N/kg"}, outputs=["position"],
    ... )
    >>> round(float(model.baseline()[0, -1]), 2)
    0.24
    >>> model.effects_named(["velocity.coulomb(velocity)"])[0].title
    'Coulomb friction on velocity, in the equation of velocity'
    """

    event: InputSignal

    def __init__(
        self,
        rhs: Function,
        states: Names,
        parameters: ParameterSpace | Iterable[Parameter],
        recordings: Recording | Observation | InputSignal | Sequence[Recording | Observation | InputSignal],
        *,
        outputs: Names,
        inputs: Names = (),
        initial: Mapping[str, float | str | Parameter] | None = None,
        readout: Function | None = None,
        signals: Names = (),
        law: Function | None = None,
        constants: Mapping[str, float] | None = None,
        step: float | None = None,
        interpolation: str = "linear",
        templates: Iterable[str] | None = None,
        effects: Iterable[Effect] | None = None,
        compile: bool = True,
        n_threads: int | None = None,
    ) -> None:
        self.states, of_states = named(states, "states")
        self.inputs, of_inputs = named(inputs, "inputs", empty=True)
        self.signals, of_signals = named(signals, "signals", empty=True)
        self.channels, of_outputs = named(outputs, "outputs")
        self._names = Quantities(self.states, self.inputs, self.signals, self.channels)
        quantities = self._names.readable
        if len(set(quantities)) < len(quantities):
            raise InputError("two states, inputs or signals have the same name", allowed="unique names")
        if interpolation not in INTERPOLATIONS:
            raise unknown_name(interpolation, INTERPOLATIONS, kind="interpolation")
        if (law is None) != (not self.signals):
            raise InputError("signals and law are not given together", allowed="both, or none")
        inside = {**of_states, **of_inputs, **of_signals}
        check_outputs(self.channels, inside, readout is not None)
        self._selected: tuple[int, ...] | None = None
        if readout is None:
            self._selected = tuple(quantities.index(name) for name in self.channels)
            readout = selection(self._selected, len(self.states))
        self.units = tuple(of_outputs[name] or inside.get(name, "") for name in self.channels)
        self.interpolation, self.n_threads = interpolation, n_threads
        self.constants = {k: check_real(v, f"the constant {k}") for k, v in (constants or {}).items()}
        own = parameters if isinstance(parameters, ParameterSpace) else ParameterSpace(parameters)
        self._functions: tuple[Function, ...] = (rhs, law or nothing, readout)
        self._n_own = len(own)
        self._initial = InitialStates(self.states, self.channels, of_states, initial or {})
        self.parameters = own
        self._recent = Recent()
        items = list(recordings) if isinstance(recordings, list | tuple) else [recordings]
        if not items:
            raise InputError("the list of recordings is empty", allowed="at least one recording")
        seen = [item if isinstance(item, InputSignal) else self.observe(item) for item in items]
        events = [self._driven_by(item if isinstance(item, InputSignal) else item.event) for item in seen]
        self.event = events[0]
        self.step = self.event.dt if step is None else check_real(step, "the step", low=0, above=True)
        self._initial, starts = self._initial.fitted_to(seen, len(own))
        self.parameters = ParameterSpace([*own, *starts])
        if not len(self.parameters):
            raise InputError(
                "there is nothing to fit", allowed="at least one parameter or initial state to fit"
            )
        self._check_functions()
        self._pointers: list[Any]
        self._compiled, self._pointers = compile_all(self._functions, compile)
        if effects is None:
            measurements = [item for item in seen if isinstance(item, Observation)]
            units = inside | dict(zip(self.channels, self.units, strict=True))
            nominal, h = self._courses(quantities, self.parameters.nominal[None], self.event, each_step=True)
            p = np.r_[own.nominal, list(self.constants.values())]
            effects = library(
                self._names, units, self.event, nominal, h, self.baseline, rhs, p, measurements, templates
            )
        self.effects = tuple(effects)

    def __repr__(self) -> str:
        return self._short(", ".join(self.states))

    def __copy__(self) -> ODESimulator:
        """Share machine code with the copy."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Leave machine code behind: another process compiles it again."""
        functions = self._functions if self._selected is None else self._functions[:2]
        return {**self.__dict__, "_functions": functions, "_pointers": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._selected is not None:
            self._functions = (*self._functions, selection(self._selected, len(self.states)))
        self._pointers = compile_all(self._functions, self._compiled)[1]

    @property
    def threads(self) -> int:
        """Number of threads that may simulate at the same time; 1 where Python simulates."""
        return int(self.n_threads or numba.config.NUMBA_NUM_THREADS) if self._compiled else 1

    def settings(self) -> dict[str, Any]:
        """Functions, constants, step and added effects; see `Simulator.settings`."""
        return {
            "functions": [identity(function) for function in self._functions],
            "names": [self.states, self.inputs, self.signals, self.channels],
            "constants": self.constants,
            "step": self.step,
            "interpolation": self.interpolation,
            "initial": {name: repr(value) for name, value in self._initial.given.items()},
            "extensions": [effect.name for effect in self.extensions],
        }

    def observe(self, recording: Any) -> Observation:
        """Bring a recording onto this model's outputs and a uniform time grid, with its inputs as the event.

        A missing input, no output at all, or another unit raises `InputError`.
        """
        if isinstance(recording, Observation):
            return recording
        recording = check_recording(recording)
        return signal_observation(recording, self.inputs, self.channels, self.units, self._initial.guesses)

    def fit_initial_state(self, observation: Observation) -> Observation:
        """Return an observation with the initial state that fits its first third best.

        Only fitted and measured initial states change, and only for recordings whose initial states are no parameters.
        """
        event, free = observation.event, self._initial.free
        if not isinstance(event, InputSignal) or not free or self._initial.knows(event):
            return observation
        low, high = np.array([self._initial.bounds(name, observation) for name in free]).T
        scales = high - low
        guess = np.clip([event.initial[name] for name in free], low, high)
        keep = max(2, int(np.ceil(_BEGINNING * len(event.time))))
        part = observation.mask & (np.arange(len(event.time)) < keep)
        if not part.any():
            return observation

        def started(values: _Array) -> InputSignal:
            return replace(event, initial={**event.initial, **dict(zip(free, values.tolist(), strict=True))})

        def residuals(u: _Array) -> _Array:
            y = self.simulate(self.parameters.nominal, started(guess + u * scales)).values[0]
            z = ((y - observation.values) / observation.sigma)[part]
            return np.where(np.isfinite(z), z, 1e6)

        bounds = (low - guess) / scales - 1e-9, (high - guess) / scales + 1e-9
        found = least_squares(residuals, np.zeros(len(free)), bounds=bounds, diff_step=1e-4)
        return replace(observation, event=started(guess + found.x * scales))

    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta`, driven by an `InputSignal`; see `Simulator.simulate`."""
        event = self._driven_by(self.event if event is None else event)
        self._initial.check(event)
        theta = self.acting(self.parameters.validate(theta), event)
        # measurement effects need every step, not only the compared instants
        errors = [e for e in self.extensions if e.kind == "measurement" and not isinstance(e, GenericEffect)]
        each_step = any(e.kind == "measurement" for e in self.extensions)
        out, h, every = self._integrated(theta, event, self._pointers[2], len(self.channels), each_step)
        if errors:
            values = dict(zip(self.parameters.names, theta.T, strict=True))
            with np.errstate(all="ignore"):
                out = measured(out, self.channels, errors, values, h)
        if each_step:
            out = out[..., ::every].copy()
        return Responses(out, statuses(out, _PLAUSIBLE), event.time, self.channels)

    def _integrated(
        self, theta: _Array, event: InputSignal, readout: Any, n_outputs: int, each_step: bool = False
    ) -> tuple[_Array, float, int]:
        """Readout (n, n_outputs, L), step in seconds, and steps between instants; `each_step` reads out all steps."""
        check_steps(event.time[-1] - event.time[0], self.step, "ODESimulator, step")
        h, every = step_of(event, self.step)
        steps, record = every * (len(event.time) - 1), 1 if each_step else every
        x0 = self._initial.values(theta, event)
        p = np.hstack([theta[:, : self._n_own], np.tile(list(self.constants.values()), (len(theta), 1))])
        table, owns, columns, extra = effect_table(
            self._names, self.extensions, self.parameters, event, self.interpolation == "hold"
        )
        out = np.full((len(theta), n_outputs, steps // record + 1), np.nan)
        arguments = (
            *self._pointers[:2], readout, np.hstack([x0, np.zeros((len(theta), extra))]), np.ascontiguousarray(p),
            np.ascontiguousarray(theta[:, columns]), self._injected(event, every), len(self.signals),
            len(self.states), table, owns, float(event.time[0]), h, record, out,
        )  # fmt: skip
        kernel: Any = ode_kernel.compiled() if self._compiled else ode_kernel.integrate
        threads = threads_left(self.threads)
        share = max(1, min(_SHARE, -(-len(theta) // threads)))
        tasks = [(i, min(i + share, len(theta))) for i in range(0, len(theta), share)]

        def run(first: int, last: int) -> None:
            sizes = len(self.states) + extra, len(self.inputs) + len(self.signals), n_outputs
            rooms = ode_kernel.room(*sizes, table, steps, last - first)
            if self._compiled:
                kernel(*arguments, *rooms, first, last)
                return
            for i in range(first, last):
                # as in machine code, an error fails this simulation only
                with contextlib.suppress(Exception):
                    kernel(*arguments, *rooms, i, i + 1)

        with np.errstate(all="ignore"):
            parallel_map([partial(run, *task) for task in tasks], threads)
        return out, h, every

    def trajectories(self, theta: ArrayLike, event: Event, device: str = "") -> dict[str, _Array]:
        """States on the time axis of an event, see `Simulator.trajectories`."""
        event = self._driven_by(event)
        theta = self.acting(self.parameters.validate(theta), event)
        return self._courses(self.states, theta, event)[0]

    def _courses(
        self, names: Sequence[str], theta: _Array, event: InputSignal, each_step: bool = False
    ) -> tuple[dict[str, _Array], float]:
        """First states, inputs and signals of one parameter vector by name, and the step in seconds."""
        readout = compile_all([selection(tuple(range(len(names))), len(self.states))], self._compiled)[1][0]
        out, h, _ = self._integrated(theta, event, readout, len(names), each_step)
        return dict(zip(names, out[0], strict=True)), h

    def _injected(self, event: InputSignal, every: int) -> _Array:
        return np.asarray(
            self._recent.get(
                (event,), (every,), lambda: between_samples(event, self.inputs, every, self.interpolation)
            )
        )

    def _driven_by(self, event: Event) -> InputSignal:
        """Return an event that can drive this model, or raise `InputError`."""
        if not isinstance(event, InputSignal):
            raise InputError(f"a model is not driven by a {type(event).__name__}", allowed="InputSignal")
        for name in self.inputs:
            if name not in event.signals:
                raise unknown_name(name, event.signals, kind="input", where=f"event {event.name!r}")
        return event

    def _check_functions(self) -> None:
        """Evaluate the functions once in Python, because machine code hides mistakes."""
        rhs, law, readout = self._functions
        theta = self.parameters.nominal[None]
        x = self._initial.values(theta, self.event)[0]
        p = np.r_[theta[0, : self._n_own], list(self.constants.values())]
        u = np.array([float(self.event.signals[name][0]) for name in self.inputs])
        t = float(self.event.time[0])
        if self.signals:
            blank = np.zeros(len(self.signals))
            u = np.r_[u, evaluate_once("law", law, self.signals, t, x, np.r_[u, blank], p)]
        evaluate_once("rhs", rhs, [f"dx of {name}" for name in self.states], t, x, u, p)
        evaluate_once("readout", readout, self.channels, t, x, u, p)
