"""Whole grids: equilibrium, independence of rows, events, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.data.recordings import Recording
from errorscreen.effects import GOVERNOR, Effect
from errorscreen.effects.base import strength
from errorscreen.events import BusFault, Event, GridEvent, LineTrip, LoadStep
from errorscreen.exceptions import InputError
from errorscreen.models.machines.fixed import FixedMachine
from errorscreen.power.elements import Branch, Bus, Generator, Load
from errorscreen.power.network import Network
from errorscreen.simulators import PowerSystemSimulator, Status, Unit
from errorscreen.simulators.grid import simulator as power_system
from errorscreen.simulators.grid.assembly import grid_effects
from errorscreen.testing import check_effect, check_simulator
from tests.plants import random_rows
from tests.power.grid_reference import trajectory

TIME = np.arange(301) * 0.01
FAULT = BusFault(TIME, "fault", 0.5, bus=3, duration=0.1, impedance=0.05j)
MACHINES = (FixedMachine(1, H=5.0, Xd1=0.1, Xd=0.6, Xq=0.5, D=1.0),)
UNITS = (
    Unit(2, "synchronous_machine", 100.0),
    Unit(4, "dfig_plant", 60.0),
    Unit(5, "pv_plant", 50.0, {"dV_LV": 0.1}),
)


def network():
    """A ring of five buses with a machine and the three plants, load in the middle."""
    branches = [(1, 2, 0.1), (2, 3, 0.1), (3, 4, 0.15), (4, 5, 0.2), (5, 1, 0.15), (2, 4, 0.2)]
    return Network(
        tuple(Bus(i) for i in range(1, 6)),
        tuple(Branch(a, b, 0.1 * x, x) for a, b, x in branches),
        slack=1,
        loads=(Load(3, 1.5, 0.3), Load(5, 0.4, 0.1)),
        generators=(
            Generator(1, v=1.0), Generator(2, 0.6, 1.0), Generator(4, 0.3, 1.0), Generator(5, 0.3, 1.0)
        ),
    )  # fmt: skip


def system(event=FAULT, **options):
    options = {"channels": {"U": 3, "P": (2, 3)}, **options}
    return PowerSystemSimulator(network(), UNITS, MACHINES, event=event, **options)


def test_the_grid_of_a_recorded_event_is_reduced_once(monkeypatch):
    reduced = []

    class Counting(power_system.Reducer):
        def __call__(self, networks):
            reduced.append(len(networks))
            return super().__call__(networks)

    monkeypatch.setattr(power_system, "Reducer", Counting)
    simulator = system()
    reduced.clear()
    theta = random_rows(simulator, 2)
    first = simulator.simulate(theta).values
    assert reduced == [3]  # before, during and after the fault
    assert np.array_equal(simulator.simulate(theta).values, first)
    assert len(reduced) == 1
    # another step has other tables
    simulator.with_step_of(simulator.refined(2)).simulate(theta)
    assert reduced == [3, 3]
    longer = simulator.extend("fault_duration")
    reduced.clear()
    longer.simulate(np.c_[np.tile(theta[0], (5, 1)), np.arange(5) * 0.01])
    assert reduced[-1] == 1  # a fault that lasts longer is the same grid


def test_parameter_vectors_start_once_for_several_recordings_and_from_where_each_began(monkeypatch):
    began = []
    plain = power_system.assembly.starting
    monkeypatch.setattr(
        power_system.assembly, "starting", lambda *args: (began.append(args[-1]), plain(*args))[1]
    )
    other = BusFault(TIME, "other", 0.5, bus=5, duration=0.1)
    heavy, late = replace(other, level=1.1, name="heavy"), replace(other, start=0.7, name="late")
    simulator = system(further=(other, heavy, late)).extend("synchronous_machine.oscillation@other")
    theta = random_rows(simulator, 3)
    events = [FAULT, other, replace(FAULT, name="again"), heavy, late]
    found = [simulator.simulate(theta, event).values for event in events]
    # the third begins as the first one does; in the second the oscillation acts
    assert began == [3, 3, 3, 3]
    alone = [system(further=events[1:]).extend("synchronous_machine.oscillation@other") for _ in events]
    for event, values, fresh in zip(events, found, alone, strict=True):
        assert np.array_equal(values, fresh.simulate(theta, event).values)
    changed = theta.copy()
    changed[0, 0] *= 1.01
    began.clear()
    assert not np.array_equal(simulator.simulate(changed).values, found[0])
    assert began == [3]
    # copies with other effects have starts of their own
    began.clear()
    rows = np.c_[theta, np.full((3, 2), 0.1)]  # of time constant and shape
    active, reactive = (
        simulator.extend(f"pv_plant.lag_{power}").simulate(rows).values for power in ("active", "reactive")
    )
    assert not np.array_equal(active, reactive)
    assert began == [3, 3]


def test_contract():
    check_simulator(system(), n=5)


def test_every_parameter_vector_rests_at_its_own_equilibrium():
    simulator = system(GridEvent(TIME))
    y = simulator.simulate(random_rows(simulator, 16)).require_ok().values
    assert np.abs(y - y[:1, :, :1]).max() < 1e-9
    flow = simulator._flow(simulator.event)
    assert y[0, 0, 0] == pytest.approx(flow.magnitude[2], abs=1e-10)
    assert y[0, 1, 0] == pytest.approx(-flow.branch_flows[1, 1].real, abs=1e-9)


def test_reference_path_agrees_bit_for_bit():
    event = replace(FAULT, time=TIME[:81])
    theta = random_rows(system(event), 3)
    assert np.array_equal(
        system(event).simulate(theta).values, system(event, engine="numpy").simulate(theta).values
    )


@pytest.mark.parametrize("row", [0, 1])
def test_trajectory_agrees_with_an_independent_form(row):
    simulator = system(step=5e-4)
    theta = np.vstack([simulator.parameters.nominal, random_rows(simulator, 1)])[row]
    found = simulator.simulate(theta).require_ok().values[0]
    expected = trajectory(simulator, theta, FAULT)
    assert np.isnan(expected[0]).sum() == 4  # both ends, and the two instants of the fault
    assert np.ptp(found, axis=1).min() > 0.5
    assert np.nanmax(np.abs(found - expected)) < 1e-5


def test_parameters_move_nothing_before_the_event_and_something_behind_it():
    simulator = system()
    y = simulator.simulate(random_rows(simulator, 5)).require_ok().values
    at = round(FAULT.start / 0.01)
    assert np.ptp(y[:, :, :at], axis=0).max() < 1e-9
    assert np.ptp(y[:, :, at:], axis=0).max() > 1e-2


@pytest.mark.parametrize("start", [-0.05, 0.0, 0.01, 0.02, 0.5])
@pytest.mark.parametrize("effects", [(), ("lag_U",), ("fault_duration",)], ids=str)
def test_the_wait_for_an_event_is_not_integrated(start, effects, monkeypatch):
    simulator = system()
    for name in effects:
        simulator = simulator.extend(name)
    theta = random_rows(simulator, 5)
    event = replace(FAULT, start=start)
    quick = simulator.simulate(theta, event).require_ok().values
    monkeypatch.setattr(power_system, "steps_at_rest", lambda segment, every: 0)
    whole = simulator.simulate(theta, event).require_ok().values
    assert np.abs(quick - whole).max() < 1e-8
    if start < 0.02:  # there is nothing to leave out
        assert np.array_equal(quick, whole)
    assert np.ptp(quick[:, :, : max(1, round(start / 0.01) - 1)], axis=2).max() == 0
    assert np.ptp(quick, axis=2).min() > 0.02


@pytest.mark.parametrize(
    "effects", [("fault_duration",), ("trip_2_3", "fault_impedance", "pv_plant.ramp")], ids=str
)
def test_rows_to_which_something_else_happened_are_simulated_together(effects):
    simulators = [system(replace(FAULT, time=TIME[:81]), engine=engine) for engine in ("compiled", "numpy")]
    for name in effects:
        simulators = [simulator.extend(name) for simulator in simulators]
    theta = random_rows(simulators[0], 11)
    theta[3, -1] = 0.0
    together, reference = (simulator.simulate(theta).require_ok().values for simulator in simulators)
    alone = [simulators[0].simulate(row).values[0] for row in theta]
    assert np.array_equal(together, alone)
    assert np.array_equal(together, reference)
    assert np.ptp(together, axis=0).max() > 0.01


def test_an_effect_that_moves_nothing_before_the_event_waits_for_it_too(monkeypatch):
    simulator = system().extend("pv_plant.ramp").extend("synchronous_machine.exciter")
    theta, waits = random_rows(simulator, 5), []
    integrate = simulator._engine.integrate

    def watched(x0, constants, u, **options):
        waits.append(len(u) // 2)
        return integrate(x0, constants, u, **options)

    monkeypatch.setattr(simulator._engine, "integrate", watched)
    quick = simulator.simulate(theta).require_ok().values
    assert waits == [1, (len(TIME) - 1 - round(FAULT.start / 0.01) + 1) * 4]
    monkeypatch.setattr(power_system, "steps_at_rest", lambda segment, every: 0)
    assert np.abs(quick - simulator.simulate(theta).values).max() < 1e-8


@pytest.mark.parametrize("name", ["pv_plant.oscillation", "synchronous_machine.latent_Pm"])
def test_an_effect_that_is_off_rests_beside_one_that_is_on(name):
    check_effect(system().extend("pv_plant.ramp"), name)


def test_an_event_that_came_earlier_than_recorded_is_not_missed():
    def earlier(event, d):
        return replace(event, start=event.start + d)

    shifted = Effect(
        "fault_instant", "Fault at another instant", "event", earlier,
        (strength("d", 0.02, 0.2, "s", "event", "d", "later by", -0.2),), kind="event", event_specific=True,
        description="The record has another instant.", source="definition",
    )  # fmt: skip
    simulator = system(effects=[shifted])
    check_effect(simulator, "fault_instant")
    early = simulator.extend("fault_instant").simulate(np.append(simulator.parameters.nominal, -0.2)).values
    recorded = simulator.baseline()
    assert np.abs(early[0, :, : len(TIME) - 20] - recorded[:, 20:]).max() < 1e-9


def test_a_latch_that_begins_to_close_is_not_at_rest():
    generators = tuple(replace(g, v=0.97) for g in network().generators)
    simulator = PowerSystemSimulator(
        replace(network(), generators=generators), UNITS, MACHINES,
        event=replace(FAULT, impedance=0.5j), channels={"U": 3, "P": (2, 3)},
    ).extend("pv_plant.cessation")  # fmt: skip
    theta = simulator.parameters.nominal
    for name, value in (("Tth", 0.0), ("Vth", 0.97 - 0.005 + 1e-10)):
        theta[simulator.parameters.index(f"pv_plant.cessation.{name}")] = value
    y = simulator.simulate(theta).require_ok().values[0]
    assert np.ptp(y[0, : round(FAULT.start / 0.01)]) > 0.005


def test_an_effect_that_may_act_before_the_event_is_integrated_from_the_start():
    simulator = system().extend("pv_plant.oscillation")
    theta = np.repeat(simulator.parameters.nominal[None], 2, axis=0)
    theta[:, simulator.parameters.index("pv_plant.oscillation.A")] = 0.0, 0.1
    theta[:, simulator.parameters.index("pv_plant.oscillation.t0")] = 0.0
    both = simulator.simulate(theta).require_ok().values
    before = both[:, :, : round(FAULT.start / 0.01)]
    assert np.ptp(before[0], axis=1).max() == 0
    assert np.ptp(before[1], axis=1).max() > 1e-3
    assert np.array_equal(both[1:], simulator.simulate(theta[1]).values)


def test_a_fault_that_is_cleared_at_once_or_never_felt():
    still = system().baseline(GridEvent(TIME))
    far = system().baseline(replace(FAULT, impedance=1e9))
    assert np.abs(far - still).max() < 1e-7


@pytest.mark.parametrize(
    "event",
    [
        FAULT,
        LineTrip(TIME, "trip", 0.5, ends=(3, 2)),
        LoadStep(TIME, "load", 0.5, factor=1.1, buses=(3,)),
        replace(FAULT, level=0.9),
        replace(FAULT, bus=2, impedance=0.2j),
    ],
    ids=lambda e: f"{type(e).__name__} {e.level}",
)
def test_default_step_is_fine_enough(event):
    theta = random_rows(system(), 8)
    coarse, fine = (system(step=step).simulate(theta, event).require_ok().values for step in (0.0025, 0.0005))
    assert np.ptp(fine, axis=2).max() > 0.02  # the event is felt
    assert np.abs(coarse - fine).max() < 5e-3 * np.ptp(fine, axis=2).max()


def test_a_tripped_line_carries_nothing():
    y = system().baseline(LineTrip(TIME, "trip", 0.5, ends=(2, 3)))
    assert y[1, 0] > 0.1
    assert np.all(y[1, 50:] == 0)


def test_infeasible_rows_are_data():
    simulator = system()
    theta = np.tile(simulator.parameters.nominal, (3, 1))
    theta[1, simulator.parameters.index("Imax")] = 0.1
    responses = simulator.simulate(theta)
    assert list(responses.status) == [Status.OK, Status.NO_EQUILIBRIUM, Status.OK]


def test_recordings_come_onto_the_channels():
    simulator = system()
    y = simulator.baseline()
    fine = np.arange(601) * 0.005
    recording = Recording.from_arrays(
        fine, {"P": np.interp(fine, TIME, y[1])}, base_mva=100.0, f_nominal=60.0, event_time=0.5,
        noise={"P": 1e-3},
    )  # fmt: skip
    observation = simulator.observe(recording)
    assert observation.channels == ("U", "P")
    assert np.isnan(observation.values[0]).all()
    assert observation.noise[1] == 1e-3
    assert np.median(np.abs(observation.values[1] - y[1])) < 1e-6
    assert simulator.observe(observation) is observation


def test_settings_tell_what_responses_depend_on():
    assert system().settings() == system().settings()
    assert system(step=0.001).settings() != system().settings()


SYSTEM = system()
EFFECTS = [effect.name for effect in SYSTEM.effects]


@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_keep_their_contract(effect):
    check_effect(SYSTEM, effect)


@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_are_identities_at_strength_zero(effect):
    """Bit for bit, also beside simulations that use the effect."""
    extended = SYSTEM.extend(effect)
    m = len(SYSTEM.parameters)
    theta = random_rows(extended, 31, seed=3)  # of thresholds and timers, few act in one fault
    theta[::3, m] = 0.0
    plain, mixed = SYSTEM.simulate(theta[:, :m]).values, extended.simulate(theta).values
    assert np.array_equal(mixed[::3], plain[::3], equal_nan=True)
    limiters = ("limiter", "under_excitation", "volts_per_hertz", "saturation", ".trip", ".trip_high")
    if not effect.endswith(limiters):  # these rest where their limit or time is not reached
        assert np.nanmax(np.abs(mixed - plain)) > 1e-4


def test_effects_inside_units_leave_the_equilibrium_alone():
    restless = ("oscillation", "latent")
    at_rest = [e for e in SYSTEM.effects if e.kind == "mechanism" and not e.name.endswith(restless)]
    for effect in at_rest:
        extended = system(GridEvent(TIME)).extend(effect.name)
        y = extended.simulate(random_rows(extended, 5)).require_ok().values
        assert np.abs(y - y[:1, :, :1]).max() < 1e-9, effect.name


def test_an_effect_of_a_unit_acts_as_in_the_reference_path():
    names = ("synchronous_machine.governor", "pv_plant.cessation", "lag_P")
    simulators = [system(engine=engine) for engine in ("compiled", "numpy")]
    for name in names:
        simulators = [simulator.extend(name) for simulator in simulators]
    theta = random_rows(simulators[0], 5)
    a, b = (simulator.simulate(theta).values for simulator in simulators)
    assert np.array_equal(a, b, equal_nan=True)


def test_event_effects_are_other_events():
    """Duration, impedance and a branch that is opened, against events that say so themselves."""
    nominal = SYSTEM.parameters.nominal
    cases = {
        ("fault_duration", 0.05): replace(FAULT, duration=0.15),
        ("fault_impedance", 0.02): replace(FAULT, impedance=0.07j),
        ("trip_2_3", 1.0): replace(FAULT, opened=((2, 3, 1.0, None),)),
    }
    for (effect, value), event in cases.items():
        found = SYSTEM.extend(effect).simulate([*nominal, value]).values[0]
        expected = SYSTEM.simulate(nominal, event).values[0]
        assert np.abs(found - expected).max() < 1e-9, effect
    opened = SYSTEM.simulate(nominal, replace(FAULT, opened=((2, 3, 1.0, None),))).values[0]
    assert abs(opened[1, -1]) < 1e-9  # nothing arrives over a branch that is open


@pytest.mark.parametrize("effect", ["fault_duration", "fault_impedance", "trip_3_4"])
@pytest.mark.parametrize(
    "event",
    [replace(FAULT, opened=((2, 3, 1.0, None),)), replace(FAULT, duration=0.0025)],
    ids=["opened", "short"],
)
def test_event_effects_are_identities_on_any_fault(effect, event):
    extended = SYSTEM.extend(effect)
    off = extended.parameters.nominal.copy()
    off[-1] = 0.0
    expected = SYSTEM.simulate(SYSTEM.parameters.nominal, event).values
    assert np.array_equal(extended.simulate(off, event).values, expected)


def test_two_branches_can_open_and_an_island_is_a_failure():
    nominal = SYSTEM.parameters.nominal
    both = SYSTEM.extend("trip_2_3").extend("trip_3_4")
    event = replace(FAULT, opened=((2, 3, 0.4, None), (3, 4, 0.7, None)))
    expected = SYSTEM.simulate(nominal, event).values
    assert np.abs(both.simulate([*nominal, 0.4, 0.7]).values - expected).max() < 1e-12
    found = both.simulate([[*nominal, 1.0, 1.0], [*nominal, 1.0, 0.0]])  # bus 3 has no other branch
    assert found.status.tolist() == [Status.FAILED, Status.OK]
    assert np.isnan(found.values[0]).all()


def test_parallel_circuits_open_one_by_one():
    branches = tuple(
        b
        for b in SYSTEM.network.branches
        for b in ([b, replace(b, circuit="2")] if b.ends == (2, 3) else [b])
    )
    grid = replace(SYSTEM.network, branches=branches)
    trips = [e for e in grid_effects({}, ["U"], grid, [FAULT]) if e.name.startswith("trip")]
    assert [e.name for e in trips] == ["trip_2_3_1", "trip_2_3_2", "trip_3_4"]
    (_, _), (_, after) = trips[1].equations(FAULT, 1.0).changes(grid)
    assert [b.circuit for b in after.branches if b.ends == (2, 3) and b.in_service] == ["1"]


def test_records_of_further_events_may_be_wrong_as_well():
    def of_events(system):
        return {e.name for e in system.effects if e.kind == "event"}

    step, fault = LoadStep(TIME, "step", 0.5, factor=1.1), replace(FAULT, name="other", bus=5)
    assert of_events(system(step)) == set()
    found = of_events(system(step, further=[FAULT, fault]))
    assert found == {"fault_duration", "fault_impedance", "trip_2_3", "trip_3_4", "trip_4_5", "trip_5_1"}
    assert found == of_events(system(FAULT)) | of_events(system(fault))


def test_a_fault_of_estimated_duration_acts_smoothly():
    """Also where it ends between two steps: differences over a third of a step agree with those over four steps."""
    extended = SYSTEM.extend("fault_duration")
    h = SYSTEM.step
    d = np.array([0.0, h / 3, 4 * h])
    theta = np.hstack([np.tile(SYSTEM.parameters.nominal, (3, 1)), d[:, None]])
    y = extended.simulate(theta).require_ok().values[:, 0, -50:]
    short, long = (y[1] - y[0]) / (h / 3), (y[2] - y[0]) / (4 * h)
    assert np.abs(short - long).max() < 0.15 * np.abs(long).max()


def test_unknown_effects_are_refused_plainly():
    with pytest.raises(InputError, match=r"unknown effect 'exciter'.*synchronous_machine.exciter"):
        SYSTEM.extend("exciter")
    with pytest.raises(InputError, match="PowerSystemSimulator has no ports"):
        system(effects=()).extend("exciter")
    with pytest.raises(InputError, match=r"effect 'governor': unknown device ''"):
        system(effects=[GOVERNOR])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"units": UNITS[:2]}, r"at the buses \[1, 2, 4\]. Allowed: one at each generator: \[1, 2, 4, 5\]"),
        ({"units": (*UNITS[:2], Unit(5, "dfig_plant", 50.0))}, "each kind at most once"),
        ({"channels": {}}, "there is no channel"),
        ({"channels": {"U": 7}}, "unknown bus '7'"),
        ({"channels": {"P": (1, 3)}}, "no branch connects the buses 1 and 3"),
        ({"step": 0.0}, "the step is 0.0"),
        ({"engine": "gpu"}, "unknown engine 'gpu'"),
    ],
)
def test_bad_input(change, message):
    options = {"units": UNITS, "machines": MACHINES, "channels": {"U": 3}, "event": FAULT, **change}
    with pytest.raises(InputError, match=message):
        PowerSystemSimulator(network(), **options)


def test_bad_units_machines_and_events():
    with pytest.raises(InputError, match=r"unknown device 'pv_plnt' \(did you mean"):
        Unit(2, "pv_plnt", 100.0)
    with pytest.raises(InputError, match="unknown constant 'f0'"):
        Unit(2, "pv_plant", 100.0, {"f0": 50.0})
    with pytest.raises(InputError, match="the rating is -1"):
        Unit(2, "pv_plant", -1)
    with pytest.raises(InputError, match="machine at bus 1: H is 0"):
        FixedMachine(1, H=0, Xd1=0.1)
    with pytest.raises(InputError, match="the duration is 0"):
        replace(FAULT, duration=0)
    with pytest.raises(InputError, match="the load level is -1"):
        GridEvent(TIME, level=-1)
    with pytest.raises(InputError, match=r"a grid cannot be driven by a Event"):
        system().baseline(Event(TIME))
    with pytest.raises(InputError, match=r"changes at 0.501 s. Allowed: multiples of 0.0025 s"):
        system().baseline(replace(FAULT, start=0.501))
    with pytest.raises(InputError, match="unknown bus '9'"):
        system().baseline(replace(FAULT, bus=9))


def test_states_of_a_unit_can_be_seen():
    simulator = system()
    states = simulator.trajectories(simulator.parameters.nominal, FAULT, "synchronous_machine")
    assert set(states) == {"delta", "omega", "Ed1", "Eq1"}
    before = FAULT.time < FAULT.start
    assert all(np.ptp(values[before]) < 1e-9 for values in states.values())
    after = (FAULT.time > FAULT.start) & (FAULT.time < FAULT.start + 0.1)
    assert np.all(np.diff(states["omega"][after]) > 0)  # a fault speeds it up
    # δ follows from ω
    slip = 2 * np.pi * simulator.f0 * (states["omega"] - 1.0)
    slope = np.gradient(states["delta"], FAULT.time)
    assert np.abs(slope - slip)[2:-2].max() < 0.05 * np.abs(slip).max()
    assert simulator.trajectories(simulator.parameters.nominal, FAULT, "nobody") == {}
