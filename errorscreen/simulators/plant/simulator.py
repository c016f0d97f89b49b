"""Plant playback: one device, driven by the voltage, or by the power, recorded at its terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.threads import one_blas_thread
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.data.resampling import check_steps, compared_step, low_pass_needed, spacing
from errorscreen.data.signals import correlation_time, within
from errorscreen.effects import Effect
from errorscreen.engine.kernels import new_engine
from errorscreen.events import Event, Playback
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES, Device
from errorscreen.models.unit import SHORTEST
from errorscreen.models.unit_start import UnitStart
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators import assembly
from errorscreen.simulators.base import Responses, Simulator
from errorscreen.simulators.observations import check_recording
from errorscreen.simulators.plant.connection import Connection, power_at_point
from errorscreen.simulators.plant.driving_voltage import driving_signals
from errorscreen.simulators.plant.imposed_power import recorded_voltage, unsolved
from errorscreen.simulators.plant.injection_noise import noise_left, propagated_energy, with_uncertainty
from errorscreen.simulators.plant.limits import limits_that_act
from errorscreen.simulators.plant.playback import levels_apart, playback_observation
from errorscreen.simulators.plant.settings import (
    angle_source_of,
    channels_of,
    device_of,
    effects_in,
    not_compared,
    of_recording,
    told_of,
    units_of,
)
from errorscreen.simulators.plant.step_signals import step_signals
from errorscreen.simulators.recent import Recent

#: a response beyond this is not a machine's or a converter's, in pu
_PLAUSIBLE = 1e3


class PlantSimulator(Simulator):
    """Active and reactive power of one device at its recorded voltage, or voltage and frequency at its recorded power.

    Plant models are validated in the field like this, because no model of the grid is needed. Every parameter vector
    starts at its own exact equilibrium for the recorded pre-event voltage and power.

    Parameters
    ----------
    device : Device or str
        A device or its name: ``"synchronous_machine"``, ``"dfig_plant"``, ``"pv_plant"``.
    recording : Recording, Observation or Playback
        Gives the default event, and the channels where `channels` is not given. Nothing is simulated.
    parameters : ParameterSpace, optional
        Candidate parameters, a subset of the device's in any order; the others keep the device's typical values. All
        of the device's where not given.
    constants : mapping of str to float, optional
        Values of the device's other constants. The nominal frequency ``f0`` is that of the recording.
    channels : iterable of str, optional
        Of ``"P"``, ``"Q"`` and what the device can record beside them (`Device.recordable`), in pu; those of them that
        were recorded where not given. Where power is imposed, ``"V"`` in pu and ``"f"`` in Hz instead of P and Q.
    step : float
        Longest step of the integration in seconds; the step used divides the step of the time axis.
    dt : float, optional
        Step of the time axis for recordings; `errorscreen.data.resampling.compared_step` where not given.
    operating_point : mapping of str to float, optional
        Pre-event ``"P"`` or ``"Q"`` in pu where it was not recorded.
    grid_impedance : complex, default 0
        R + jX of the grid at the terminal, in pu of the device's base. With 0 the recorded voltage is imposed. Else
        the plant is driven by the voltage behind the impedance, :math:`E = V_{rec} - Z I_{rec}`, and its own current
        moves the terminal, :math:`V = E + Z I`. P and Q must be recorded and count as true: there are no measurement
        effects.
    imposed : {"voltage", "power"}
        Recorded quantity that drives the device. ``"power"`` is the way for load rejections and tests on open circuit:
        P and Q must be recorded; see `errorscreen.simulators.plant.imposed_power`.
    constant_frequency : bool, default False
        For recordings without angle and frequency: the frequency keeps its value before the event.
    angle_reactance : float, default 0
        For recordings without angle and frequency: reactance in pu of the device's base to a source of constant angle,
        against which V, P and Q give the angle; see `errorscreen.simulators.plant.terminal_angle`.
    connection : Connection, optional
        Transformer, collector and line between the recorded point and the terminal of the device, where V, P and Q were
        recorded at another point. Not together with `grid_impedance`.
    effects : iterable of Effect, optional
        Library that is compiled in; that of the device where not given.
    n_threads : int, optional
        Numba's setting where not given. The result does not depend on it.
    engine : {"compiled", "numpy"}
        ``"numpy"`` is the slow reference of the same equations.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(0, 2, 0.02)
    >>> voltage = np.where((time > 0.5) & (time < 0.6), 0.7, 1.0)
    >>> event = Playback(time, "dip", 0.5, {"V": voltage}, {"V": 1.0, "P": 0.8, "Q": 0.1})
    >>> plant = PlantSimulator("pv_plant", event)
    >>> responses = plant.simulate(plant.parameters.nominal)
    >>> responses.values.shape, bool(responses.ok.all())
    ((1, 2, 100), True)
    """

    def __init__(
        self,
        device: Device | str,
        recording: Recording | Observation | Playback,
        *,
        parameters: ParameterSpace | None = None,
        constants: Mapping[str, float] | None = None,
        channels: Iterable[str] | None = None,
        step: float = 0.0025,
        dt: float | None = None,
        operating_point: Mapping[str, float] | None = None,
        grid_impedance: complex = 0.0,
        imposed: str = "voltage",
        constant_frequency: bool = False,
        angle_reactance: float = 0.0,
        connection: Connection | None = None,
        effects: Iterable[Effect] | None = None,
        n_threads: int | None = None,
        engine: str = "compiled",
    ) -> None:
        if isinstance(device, str):
            device = DEVICES[device]
        if not step > 0:
            raise InputError(
                f"the step is {step}", where="PlantSimulator", allowed="a positive number of seconds"
            )
        self.device = device = device_of(device, recording, imposed, grid_impedance, connection)
        self.parameters = device.candidates if parameters is None else parameters
        for name in self.parameters.names:
            device.candidates.index(name)
        self.grid_impedance, self.imposed = complex(grid_impedance), imposed
        self.angle_source = angle_source_of(device, constant_frequency, angle_reactance)
        self.connection = connection
        self._behind = self.grid_impedance != 0
        self._inside = inside = imposed == "voltage" and (self._behind or connection is not None)
        self.constants = of_recording(device.constant_values(constants, in_grid=inside), recording, constants)
        self._told = told_of(device, constants)
        if connection is not None:
            self.constants |= connection.constants
        if self._behind:
            grid = self.grid_impedance
            self.constants |= {"R_grid": grid.real, "X_grid": grid.imag, "size": 1.0}
        self.effects = effects_in(device, effects, self._behind, recording)
        if "machine unit" in device.tags:  # exciter, stabiliser and governor may all be missing
            self.usual_effects = 3
        self._off = assembly.switched_off(self.effects)
        self.step, self.dt = step, dt
        self.operating_point = dict(operating_point or {})
        self._recent, self._observed = Recent(), Recent()
        point = None if connection is None else power_at_point(device.interface.kind)
        if imposed == "power":
            point = recorded_voltage
        self.channels = channels_of(recording, channels, device)
        further = [name for name in self.channels if name in device.recordable]
        self._outputs = (*device.outputs, *further)
        model = assembly.assemble(device, self.effects, inside, point, further)
        self._engine = new_engine(engine, model, n_threads)
        self.units = units_of(self.channels)
        if not isinstance(recording, Playback | Observation):  # the event does not depend on uncertainty
            recording = self.without_uncertainty(check_recording(recording))
        self.event = recording.event if isinstance(recording, Observation) else recording

    def __repr__(self) -> str:
        return self._short(self.device.name)

    def observe(self, recording: Any) -> Observation:
        """Bring a recording onto this simulator's channels, units (pu) and time grid; see `Simulator.observe`.

        The result is kept for each recording, because its uncertainty takes many nominal simulations:

        - The noise of the injected voltage propagates through the device, and a stiff device amplifies it. Where
          simulation and measurement differ by more than the channel's noise before the event, that difference is the
          noise. Behind an impedance P and Q are injected as well, and the difference may be smaller.
        - The simulation starts from a level that is a mean of noisy samples (`Observation.level_std`).
        - The voltage between its samples is unknown, and the integration is not exact. Where another interpolation
          or half the step changes the response by more than noise does, that change is uncertain
          (`Observation.extra`). So is the change where averages over several readings are compared, and the
          voltage of each reading is injected instead.

        `InputError` if the recording lacks what the injection needs.
        """
        if isinstance(recording, Observation):
            return recording
        known = (check_recording(recording), self.parameters, self.extensions)
        observation: Observation = self._observed.get(
            known, (self.step,), lambda: self._with_noise(self.without_uncertainty(recording), recording)
        )
        return observation

    def without_uncertainty(self, recording: Recording) -> Observation:
        """Observation of a recording as `observe` gives it, without the uncertainty, which takes many simulations."""
        played_on = partial(
            playback_observation,
            recording,
            self.channels,
            needs_angle=self.device.needs_angle,
            grid_impedance=self.grid_impedance,
            operating_point=self.operating_point,
            driven=self.device.driven,
            imposed=self.imposed,
            angle_source=self.angle_source,
        )
        readings = spacing(recording.time, recording.time)
        observation = played_on(dt=self.dt or compared_step(recording.time, recording.f_nominal))
        event = observation.event
        if low_pass_needed(event.dt, readings) and isinstance(event, Playback):
            fine = played_on(dt=readings).event
            assert isinstance(fine, Playback)
            observation = replace(observation, event=replace(event, fine=fine))
        told = (*self._told, *not_compared(recording, self.channels, self.device))
        return replace(observation, assumptions=(*observation.assumptions, *told))

    @property
    def threads(self) -> int:
        """Number of threads that may simulate at the same time: the threads of a batch."""
        return self._engine.threads

    def settings(self) -> dict[str, Any]:
        """Device, constants, longest step and added effects; see `Simulator.settings`."""
        return {
            "device": self.device.name,
            "constants": self.constants,
            "step": self.step,
            "imposed": self.imposed,
            "extensions": [effect.name for effect in self.extensions],
        }

    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta`, driven by a `Playback`; see `Simulator.simulate`."""
        event = self.event if event is None else event
        if not isinstance(event, Playback):
            raise InputError(f"a plant cannot be driven by a {type(event).__name__}", allowed="Playback")
        return self._run(theta, event)

    def _run(
        self,
        theta: ArrayLike,
        event: Playback,
        interpolation: str = "pchip",
        step: float | None = None,
        jump: tuple[int, int, bool] | None = None,
    ) -> Responses:
        """Simulate with a given interpolation of the voltage, longest step, and jump (see `driving_signals`)."""
        theta = self.parameters.validate(theta)
        x0, constants, start, values, h, every = self._prepared(theta, event, step or self.step)
        # a measurement effect needs every step, not only the compared instants
        acting = self._present(event)
        distorted = any(effect.kind == "measurement" for effect in acting)
        record = 1 if distorted else every
        steps = every * (len(event.time) - 1)
        injected = self._injected(event, every, interpolation, jump)
        if len(start) and start.all():
            out = self._engine.integrate(x0, constants, injected, h=h, every=record)
        else:
            out = np.full((len(theta), len(self._outputs), steps // record + 1), np.nan)
            if start.any():
                out[start] = self._engine.integrate(x0[start], constants[start], injected, h=h, every=record)
        if distorted:
            out = assembly.measured(out, self._outputs, acting, values, h)[..., ::every]
        detail = unsolved(out[start], event.time) if event.by_power else ""
        status = assembly.statuses(out, _PLAUSIBLE, start)
        rows = [self._outputs.index(name) for name in self.channels]
        equilibrium = self.device.initialise
        if not start.all() and isinstance(equilibrium, UnitStart):
            detail = "; ".join(equilibrium.problems(values, int(np.argmin(start))))
        if rows != [*range(out.shape[1])]:  # else no copy: the responses to many rows fill the memory
            out = out[:, rows]
        return Responses(out, status, event.time, self.channels, detail)

    def trajectories(
        self, theta: ArrayLike, event: Event, device: str = ""
    ) -> dict[str, NDArray[np.float64]]:
        """States of the device on the time axis of an event, see `Simulator.trajectories`."""
        assert isinstance(event, Playback)
        x0, constants, start, _, h, every = self._prepared(self.parameters.validate(theta), event, self.step)
        if not start.all():
            return {}
        out = self._engine.integrate(
            x0, constants, self._injected(event, every, "pchip"), h=h, every=every, record=self.device.states
        )
        return dict(zip(self.device.states, out[0], strict=True))

    def _prepared(self, theta: NDArray[np.float64], event: Playback, step: float) -> assembly.Prepared:
        check_steps(event.time[-1] - event.time[0], step, "PlantSimulator, step")
        h, every = assembly.step_of(event, step)
        values = self._values(theta, event)
        if self.connection is not None:
            values |= self.connection.terminal(values)
        if "shortest" in values:
            values["shortest"] = np.full(len(theta), SHORTEST * h)
        with np.errstate(all="ignore"):  # an absurd parameter shows in `feasible`
            states, setpoints, feasible = self.device.initialise(values)
        values |= {**states, **setpoints}
        if self._inside:
            values |= {state: values[name] for state, name in self.device.interface.states}
        # without a disturbance before the end, an unknown input still has a window of one sample
        begin = min(event.start, event.time[-1] - event.dt)
        values |= {
            name: np.full(len(theta), t - event.time[0])
            for name, t in (("t_event", begin), ("t_stop", event.time[-1]))
        }
        values |= assembly.start_effects(assembly.inside(self.effects), values, lambda effect: values, h)
        return *assembly.starting(self._engine.model, values, feasible, len(theta)), values, h, every

    def _injected(self, event: Playback, every: int, *between: Any) -> NDArray[np.float64]:

        def compute() -> NDArray[np.float64]:
            signals = driving_signals(event, every, self.device, self.grid_impedance, *between)
            if self.connection is not None and self.imposed == "voltage":
                signals[:, :2] /= self.connection.tap
            return np.column_stack([signals, *step_signals(event, every, self.device.steps)])

        return np.asarray(self._recent.get((event,), (every, *between), compute))

    @one_blas_thread
    def _with_noise(self, observation: Observation, recording: Recording) -> Observation:
        """Add the uncertainties that `observe` describes."""
        quiet = recording.quiet
        event, nominal = observation.event, self.parameters.nominal
        assert isinstance(event, Playback)
        responses = self.simulate(nominal, event)
        if not responses.ok.all():  # the caller sees this failure when it simulates
            return observation
        part = within(observation.time, quiet)
        errors = (observation.values - responses.values[0])[:, part]
        noise = noise_left(observation, errors, part)
        notes = [
            f"The noise of {name} is taken as {new:.2g} instead of {old:.2g} {unit}, because the noise of the injected "
            "signals passes through the device."
            for name, unit, new, old in zip(self.channels, self.units, noise, observation.noise, strict=True)
            if not old / 1.1 <= new <= 1.1 * old
        ]
        start = self.device.initialise
        if isinstance(start, UnitStart):
            values = self._prepared(nominal[None], event, self.step)[3]
            notes += [f"{told}." for told in start.moved_limits(values)]
            model = {name: float(values[f"{name}0"][0]) for name in self.device.driven}
            notes += levels_apart(event, model)
        observation = replace(
            observation,
            noise=noise,
            level_std=noise * np.sqrt([correlation_time(e) / max(len(e), 1) for e in errors]),
        )
        observation = self.with_uncertainty(observation, nominal)
        assert observation.extra is not None
        extra = np.where(observation.mask, observation.extra, 0.0)
        for name, unit, sigma, more in zip(self.channels, self.units, noise, extra, strict=True):
            if more.max() > sigma:
                notes.append(
                    f"{name} is uncertain by up to {more.max():.2g} {unit} at {observation.time[more.argmax()]:.4g} s, "
                    f"because the {self.imposed} is not known between its samples or the integration step is too "
                    "coarse for it."
                )
        notes += limits_that_act(self, observation)
        return replace(observation, assumptions=(*observation.assumptions, *notes))

    def with_uncertainty(
        self, observation: Observation, theta: ArrayLike, estimated: ArrayLike | None = None
    ) -> Observation:
        """Return an observation with the uncertainty for `theta`; see `Simulator.with_uncertainty`."""
        before = self.parameters.nominal if estimated is None else estimated

        def run_of(values: ArrayLike) -> Callable[..., NDArray[np.float64]]:
            return lambda event, **options: self._run(values, event, **options).values[0]

        return with_uncertainty(observation, run_of(theta), self.step, run_of(before), self.threads)

    def propagated_noise(self, observation: Observation, theta: ArrayLike) -> NDArray[np.float64]:
        """Energy of the propagated noise; see `Simulator.propagated_noise`."""
        return propagated_energy(observation, lambda event: self._run(theta, event).values)

    def _values(self, theta: NDArray[np.float64], event: Playback) -> dict[str, NDArray[np.float64]]:
        """All constants, parameters and the operating point by name, each of shape (n,)."""
        one = np.ones(len(theta))
        values = {p.name: p.nominal * one for p in self.device.candidates}
        values |= {name: value * one for name, value in self.constants.items()}
        values |= self._off
        values |= self._named(theta, event)
        values |= {name: float(event.initial[name]) * one for name in ("V", "P", "Q")}
        values["f_start"] = event.initial.get("f", self.constants.get("f0", 0.0)) * one
        for effect in self._present(event):
            if effect.recorded is not None:
                own = [values[effect.local(p.name)] for p in effect.parameters]
                values |= {name: effect.recorded(values[name], *own) for name in effect.channels}
            elif effect.kind == "constants":
                values |= assembly.changed_constants(effect, values)
        return values | {"angle": 0.0 * one}
