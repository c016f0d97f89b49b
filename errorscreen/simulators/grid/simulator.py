"""A grid with machines and plants under test: responses to events at observed buses and branches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.effects import Effect
from errorscreen.engine.kernels import new_engine
from errorscreen.events import Event, GridEvent
from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.models import LOAD, FixedMachine
from errorscreen.parameters import ParameterSpace
from errorscreen.power.load_flow import LoadFlow, solve_load_flow
from errorscreen.power.network import Network
from errorscreen.power.reduction import Reducer
from errorscreen.simulators import assembly
from errorscreen.simulators.base import Responses, Simulator, Status
from errorscreen.simulators.grid.assembly import GridModel, grid_effects, qualified
from errorscreen.simulators.grid.event_tables import courses, events_by_row, steps_at_rest, tables_in_time
from errorscreen.simulators.grid.unit import (
    AtTerminals,
    LoadUnderTest,
    Unit,
    at_rest,
    at_terminals,
    check_terminals,
)
from errorscreen.simulators.observations import observed_after
from errorscreen.simulators.recent import Recent

#: largest plausible value of a channel in pu
_PLAUSIBLE = 1e3
#: sets of rows whose initial states are kept, a few for each thread
_STARTS = 8

Values = dict[str, NDArray[np.float64]]


class PowerSystemSimulator(Simulator):
    """Voltages and powers in a grid after an event.

    The grid is reduced to the terminals of machines and units for each of its states. The load flow does not depend on
    the parameters, so every parameter vector starts at its own exact equilibrium. Integration begins just before the
    grid changes, or at once where an effect moves something earlier.

    Parameters
    ----------
    network : Network
        With one generator for each machine and unit.
    units : iterable of Unit
        Plants under test, whose parameters are the candidates; each device at most once.
    machines : iterable of FixedMachine
        All other generators.
    loads : iterable of LoadUnderTest
        Loads in which effects may act; all others are constant impedances.
    channels : mapping of str to int or (int, int)
        Observed quantities in pu: a bus for the magnitude of its voltage; a pair (sending, receiving bus) for the
        active power that arrives at the receiving bus over the branches between them.
    event : GridEvent
        Default event of `simulate`.
    further : iterable of GridEvent
        Other events whose records may be wrong.
    parameters : ParameterSpace, optional
        Candidates, a subset of those of all devices in any order; all where not given.
    f0 : float
        Nominal frequency in Hz.
    step : float
        Longest step of the integration in seconds. The step used divides that of an event's time axis, and instants at
        which the grid changes must be multiples of it.
    effects : iterable of Effect, optional
        Library; effects inside a unit name it as their device (`Effect.at`). Where not given: the library of each
        unit, measurement effects of the channels, and possible deviations of the events.
    n_threads : int, optional
        Numba's setting where not given. The result does not depend on it.
    engine : {"compiled", "numpy"}
        ``"numpy"`` is the slow reference of the same equations.

    Examples
    --------
    A machine at bus 1 feeds a PV plant's bus; its load rises by a tenth:

    >>> from errorscreen.events import LoadStep
    >>> from errorscreen.power import Branch, Bus, Generator, Load, Network
    >>> grid = Network(
    ...     (Bus(1), Bus(2)), (Branch(1, 2, 0.0, 0.1),), slack=1, loads=(Load(2, 1.5),),
    ...     generators=(Generator(1, v=1.0), Generator(2, p=0.7, v=1.0)),
    ... )
    >>> system = PowerSystemSimulator(
    ...     grid,
    ...     [Unit(2, "pv_plant", rating=100.0)],
    ...     [FixedMachine(1, H=5.0, Xd1=0.1)],
    ...     channels={"U": 2, "P": (1, 2)},
    ...     event=LoadStep(np.arange(0, 2, 0.01), "load step", 1.0, factor=1.1),
    ... )
    >>> system.baseline().round(3)[:, [0, -1]]
    array([[1.   , 0.993],
           [0.8  , 0.926]])
    """

    def __init__(
        self,
        network: Network,
        units: Iterable[Unit],
        machines: Iterable[FixedMachine],
        *,
        loads: Iterable[LoadUnderTest] = (),
        channels: Mapping[str, int | tuple[int, int]],
        event: GridEvent,
        further: Iterable[GridEvent] = (),
        parameters: ParameterSpace | None = None,
        f0: float = 60.0,
        step: float = 0.0025,
        effects: Iterable[Effect] | None = None,
        n_threads: int | None = None,
        engine: str = "compiled",
    ) -> None:
        self.network, self.event = network, event
        self.units_under_test, self.machines = tuple(units), tuple(machines)
        self.loads_under_test = tuple(loads)
        self._items: tuple[Unit | LoadUnderTest, ...] = (*self.units_under_test, *self.loads_under_test)
        self.observed = dict(channels)
        self.f0 = check_real(f0, "f0", low=0, above=True, where="PowerSystemSimulator")
        self.step = check_real(step, "the step", low=0, above=True, where="PowerSystemSimulator")
        check_terminals(network, self.units_under_test, self.machines, self.loads_under_test)
        if not self.observed:
            raise InputError(
                "there is no channel", where="PowerSystemSimulator", allowed="at least one bus or branch"
            )
        candidates = ParameterSpace(p for unit in self.units_under_test for p in unit.model.candidates)
        self.parameters = candidates if parameters is None else parameters
        for name in self.parameters.names:
            candidates.index(name)
        self.channels = tuple(self.observed)
        self.units = ("pu",) * len(self.channels)
        devices = {item.model.name: item.model for item in self._items}
        if effects is None:
            units, loads = self.units_under_test, self.loads_under_test
            kinds = {u.model.name: u.model.name for u in units} | {i.model.name: LOAD.name for i in loads}
            effects = grid_effects(kinds, self.channels, self.network, (event, *further))
        self.effects = tuple(effects)
        self._off = assembly.switched_off(self.effects)
        self._inside = assembly.inside(self.effects)
        for effect in self._inside:
            if effect.device not in devices:
                raise unknown_name(effect.device, devices, kind="device", where=f"effect {effect.name!r}")
            assembly.check_ports(devices[effect.device], [effect])
        self._grid = GridModel((m.bus for m in self.machines), devices.values(), self.observed, self._inside)
        self._engine = new_engine(engine, self._grid.model(), n_threads)
        self._flows: dict[float, LoadFlow] = {}
        self._reducers: dict[float, Reducer] = {}
        self._terminal_values: dict[float, AtTerminals] = {}
        self._recent, self._recent_starts = Recent(), Recent(_STARTS)
        self._reducer(event).anew(self._flow(event).network)  # an unknown bus, or no solution, shows here

    def __repr__(self) -> str:
        units = ", ".join(u.model.name for u in self.units_under_test) or "no unit"
        return self._short(f"{len(self.network.buses)} buses, {len(self.machines)} machines, {units}")

    @property
    def threads(self) -> int:
        """Number of threads that may simulate at the same time: the threads of a batch."""
        return self._engine.threads

    def settings(self) -> dict[str, Any]:
        """Grid, machines, units, channels and longest step; see `Simulator.settings`."""
        return {
            "network": repr(self.network),
            "machines": repr(self.machines),
            "units": [[u.bus, u.model.name, u.rating, dict(u.constants)] for u in self.units_under_test],
            "loads": [[load.bus, dict(load.constants)] for load in self.loads_under_test],
            "channels": {name: repr(where) for name, where in self.observed.items()},
            "f0": self.f0,
            "step": self.step,
            "extensions": [effect.name for effect in self.extensions],
        }

    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta`, driven by a `GridEvent`; see `Simulator.simulate`.

        The value at an instant at which the grid changes is the one just after it. `InputError` for another kind of
        event, or such an instant that is no multiple of the step.
        """
        event = self.event if event is None else event
        if not isinstance(event, GridEvent):
            raise InputError(
                f"a grid cannot be driven by a {type(event).__name__}",
                allowed="BusFault, LineTrip, LoadStep, GridEvent",
            )
        theta = self.parameters.validate(theta)
        x0, constants, start, values, h, every = self._prepared(theta, event)
        tables, segment, possible = self._courses(theta, event, h, every)
        start = start & possible
        steps = every * (len(event.time) - 1)
        # a measurement effect needs every step, not only the compared instants
        present = self._present(event)
        distorted = any(effect.kind == "measurement" for effect in present)
        record = 1 if distorted else every
        out = np.full((len(theta), len(self.channels), steps // record + 1), np.nan)
        # nothing moves before the event, unless it came earlier than recorded or an effect moves things by itself
        wait, acting = steps_at_rest(self._course(event, h, every)[1], every), self._engine.acting(constants)
        resting = (wait > 0) & (segment[..., : wait + 1] == 0).all(axis=-1) & start
        asked = resting & acting
        if asked.any():
            resting[asked] = self._engine.at_rest(x0[asked], constants[asked], h=h, tables=tables[:1])
        for rows, skipped in ((resting, wait), (start & ~resting, 0)):
            if rows.any():
                own = segment if segment.ndim == 1 else segment[rows]
                part = self._engine.integrate(
                    x0[rows], constants[rows], np.zeros((2 * (steps - skipped) + 1, 0)),
                    h=h, every=record, tables=tables, segment=own[..., skipped:],
                )  # fmt: skip
                out[rows, :, : skipped // record] = part[:, :, :1]
                out[rows, :, skipped // record :] = part
        if distorted:
            out = assembly.measured(out, self.channels, present, values, h)[..., ::every]
        status = assembly.statuses(out, _PLAUSIBLE, start)
        status[~possible] = Status.FAILED
        return Responses(out, status, event.time, self.channels)

    def trajectories(
        self, theta: ArrayLike, event: Event, device: str = ""
    ) -> dict[str, NDArray[np.float64]]:
        """States of a unit on the time axis of an event, see `Simulator.trajectories`."""
        assert isinstance(event, GridEvent)
        own = [f"{device}.{s}" for i in self._items if i.model.name == device for s in i.model.states]
        x0, constants, start, _, h, every = self._prepared(self.parameters.validate(theta), event)
        if not start.all() or not own:
            return {}
        tables, segment = self._course(event, h, every)
        steps = every * (len(event.time) - 1)
        out = self._engine.integrate(
            x0, constants, np.zeros((2 * steps + 1, 0)),
            h=h, every=every, tables=tables, segment=segment, record=own,
        )  # fmt: skip
        return {name.removeprefix(f"{device}."): row for name, row in zip(own, out[0], strict=True)}

    def _courses(
        self, theta: NDArray[np.float64], event: GridEvent, h: float, every: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
        """Tables of the grid's states, the state of each step of each row, and rows with a possible event."""
        altering = [e for e in self.extensions if e.kind == "event" and e.acts_in(event)]
        tables, segment = self._course(event, h, every)  # the recorded event must be possible
        if not altering:
            return tables, segment, np.ones(len(theta), dtype=bool)
        true_events = events_by_row(event, altering, theta, self.parameters)
        network, own = self._flow(event).network, self._tables(event)
        return courses(true_events, network, own, tables[0], segment.shape[-1], len(theta), h)

    def _course(
        self, event: GridEvent, h: float, every: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Tables of the recorded states of the grid, and the state of each step."""

        def course() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
            steps = every * (len(event.time) - 1)
            return tables_in_time(event, self._flow(event).network, self._tables(event), h, steps)

        found: tuple[NDArray[np.float64], NDArray[np.int64]] = self._recent.get((event,), (h,), course)
        return found

    def _tables(self, event: GridEvent) -> Callable[[Sequence[Network]], NDArray[np.float64]]:
        """Function from states of the grid to their tables, with the loads' power before an event."""
        return lambda networks: self._grid.tables(self._reducer(event)(networks))

    def _reducer(self, event: GridEvent) -> Reducer:
        """Reducer of the grid's states, kept for each load level."""
        if event.level not in self._reducers:
            flow = self._flow(event)
            self._reducers[event.level] = Reducer(
                flow.network,
                [terminal.bus for terminal in (*self.machines, *self._items)],
                load_voltages=flow.voltage,
                observed=[w for w in self.observed.values() if not isinstance(w, tuple)],
                flows=[w for w in self.observed.values() if isinstance(w, tuple)],
                admittances={m.bus: m.admittance for m in self.machines},
            )
        return self._reducers[event.level]

    def _prepared(self, theta: NDArray[np.float64], event: GridEvent) -> assembly.Prepared:
        h, every = assembly.step_of(event, self.step)
        begin = min(event.start, event.time[-1] - event.dt) - event.time[0]
        instants = float(begin), float(event.time[-1] - event.time[0])

        def start() -> tuple[Any, ...]:
            values, feasible = self._start(theta, event, instants, h)
            return *assembly.starting(self._engine.model, values, feasible, len(theta)), values

        acting = tuple(effect.acts_in(event) for effect in self.extensions)
        model, known = (self.parameters, self.extensions), (event.level, instants, h, acting)
        return *self._recent_starts.get(model, known, start, theta), h, every

    def observe(self, recording: Any, event: Event | None = None) -> Observation:
        """Bring a recording onto this simulator's channels and the time axis of an event, its own where not given.

        Its channels have the names of this simulator's, in pu of the grid's base, and its time stamps are those of the
        event, with the disturbance at ``event.start``. `InputError` if it has none of the channels, or one in another
        unit.
        """
        if isinstance(recording, Observation):
            return recording
        return observed_after(recording, self.event if event is None else event, self.channels, self.units)

    def _flow(self, event: GridEvent) -> LoadFlow:
        """Load flow before an event, kept for each load level."""
        if event.level not in self._flows:
            network = self.network
            if event.level != 1:
                network = network.with_load_scaled(event.level).with_generation_scaled(event.level)
            self._flows[event.level] = solve_load_flow(network)
        return self._flows[event.level]

    def _start(
        self, theta: NDArray[np.float64], event: GridEvent, instants: tuple[float, float], h: float
    ) -> tuple[Values, NDArray[np.bool_]]:
        """All states and constants by name, (n,) or (), and where an equilibrium exists."""
        if event.level not in self._terminal_values:
            found = at_terminals(self._flow(event), self.machines, self._items)
            self._terminal_values[event.level] = found
        machines, powers = self._terminal_values[event.level]
        values: Values = {"f0": np.array(self.f0), **machines}
        feasible = np.ones(len(theta), dtype=bool)
        given = self._named(theta, event)
        clock = {name: np.array(t) for name, t in zip(("t_event", "t_stop"), instants, strict=True)}
        of_device: dict[str, Values] = {}
        for item, (size, voltage, power) in zip(self._items, powers, strict=True):
            own, possible = at_rest(item, given, size, voltage, power, self.f0)
            values |= {qualified(item.model.name, k): v for k, v in own.items()}
            of_device[item.model.name] = own | clock
            feasible = feasible & possible
        values |= self._off | given
        started = assembly.start_effects(self._inside, values, lambda effect: of_device[effect.device], h)
        return values | started, feasible
