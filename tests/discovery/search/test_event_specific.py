"""What belongs to one recording: an error of the event's record, a forced oscillation."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.candidates import candidates
from errorscreen.effects import FAULT_DURATION, GOVERNOR
from errorscreen.exceptions import InputError
from tests.plants import dip, plant, random_rows
from tests.simulators.grid.test_simulator import FAULT, system

NOISE = np.array([2e-3, 2e-3])


def named(event, name):
    return replace(event, name=name)


def observed(simulator, theta, event, seed):
    """A recording of what a simulator makes of an event, with noise; `event` is what the record says."""
    y = simulator.simulate(theta, event).require_ok().values[0]
    noisy = y + NOISE[:, None] * np.random.default_rng(seed).standard_normal(y.shape)
    return Observation(event, noisy, NOISE, simulator.channels, simulator.units)


def test_an_effect_of_one_recording_is_off_in_others():
    here, there = named(dip(stop=4.0), "here"), named(dip(depth=0.2, stop=4.0), "there")
    machine = plant("synchronous_machine", here)
    extended = machine.extend("oscillation@here")
    (effect,) = extended.extensions
    assert (effect.original, effect.recording) == ("oscillation", "here")
    rows = random_rows(machine, 3)
    full = np.hstack([rows, np.tile([0.05, 1.3, 0.2], (3, 1))])
    assert np.array_equal(extended.simulate(full, there).values, machine.simulate(rows, there).values)
    shared = machine.extend("oscillation")
    assert np.array_equal(extended.simulate(full, here).values, shared.simulate(full, here).values)
    # two recordings may each have one of their own, but none may have two
    both = extended.extend("oscillation@there")
    assert both.parameters.names[-6:] == (
        *extended.parameters.names[-3:],
        *(n.replace("here", "there") for n in extended.parameters.names[-3:]),
    )
    for clashing in ("oscillation", "oscillation@here"):
        with pytest.raises(InputError, match="added before"):
            extended.extend(clashing)
    with pytest.raises(InputError, match="unknown effect 'governer@here'"):
        machine.extend("governer@here")


def test_errors_of_the_record_add_up():
    grid = system(FAULT).extend("fault_duration").extend(FAULT_DURATION.during("fault"))
    alone = system(FAULT).extend("fault_duration")
    theta = grid.parameters.nominal[:-2]
    assert np.array_equal(grid.simulate([*theta, 0.02, 0.01]).values, alone.simulate([*theta, 0.03]).values)


def test_rows_that_differ_elsewhere_only_are_simulated_once():
    events = [named(dip(stop=4.0), "one"), named(dip(depth=0.2, stop=4.0), "two")]
    machine = plant("synchronous_machine", events[0])
    recordings = [observed(machine, machine.parameters.nominal, e, i) for i, e in enumerate(events)]
    problem = FitProblem(machine.extend("oscillation@two"), recordings)
    rows = np.tile(problem.simulator.parameters.nominal, (4, 1))
    rows[:, -3] = [0.0, 0.01, 0.02, 0.03]
    z = problem.deviations(rows)
    assert problem.n_simulations == 1 + 4
    assert np.array_equal(z[0], np.tile(z[0][:1], (4, 1, 1)))
    assert len(np.unique(z[1][:, 0].sum(axis=1))) == 4


def test_each_recording_has_candidates_of_its_own():
    grid = system()
    events = [named(FAULT, "first"), named(replace(FAULT, bus=5), "second")]
    recordings = [observed(grid, grid.parameters.nominal, e, i) for i, e in enumerate(events)]
    one = {e.name: e for e in candidates(grid, recordings[:1])}
    assert one["fault_duration"].recording == "first"
    assert "synchronous_machine.oscillation" in one
    both = {e.name: e for e in candidates(grid, recordings)}
    assert {"fault_duration", "fault_duration@first", "fault_duration@second"} <= set(both)
    assert both["fault_duration"].recording == ""  # a relay that is always late
    assert "synchronous_machine.oscillation" not in both  # its phase is another one each time
    # branches at the faulted bus, and only where it is faulted
    assert {"trip_2_3@first", "trip_3_4@first"} <= set(both)
    assert not {"trip_2_3", "trip_2_3@second"} & set(both)
    assert GOVERNOR.at("synchronous_machine").name in both


def test_a_wrong_duration_in_the_record_is_not_expected_of_other_faults():
    """The relay was late once: held-out faults with the right duration do not speak against that."""
    grid = system()
    theta = grid.parameters.nominal * np.random.default_rng(3).uniform(0.9, 1.1, len(grid.parameters))
    true = grid.extend("fault_duration@fault")
    fitted = observed(true, [*theta, 0.03], FAULT, 1)
    held_out = [observed(grid, theta, named(replace(FAULT, bus=bus), f"bus {bus}"), bus) for bus in (2, 5)]
    finder = CauseFinder(
        grid,
        ["fault_duration", "fault_impedance", "pv_plant.volt_var"],
        random_state=0,
        n_starts=2,
        library_size=256,
    ).fit(fitted)
    first = finder.causes_[0]
    assert (first.name, first.event) == ("fault_duration", True)
    value, low, high = first.values["fault_duration.d"]
    assert low <= value <= high
    assert value == pytest.approx(0.03, abs=2e-3)
    confirmed = finder.confirm(held_out)
    assert confirmed.final.kind == "effect"
    assert "belongs to this recording, not to the model" in confirmed.final.text
    assert confirmed.gain.extended < confirmed.gain.recalibrated
    event = held_out[0].event
    without = grid.with_nominal(finder.best_.theta[: len(theta)]).baseline(event)
    assert np.array_equal(finder.predict(event), without)


def test_an_oscillation_of_one_of_two_recordings_is_found_there():
    events = [named(dip(stop=5.0), "calm"), named(dip(depth=0.2, duration=0.2, stop=5.0), "swinging")]
    machine = plant("synchronous_machine", events[0])
    theta = machine.parameters.nominal * np.random.default_rng(5).uniform(0.9, 1.1, len(machine.parameters))
    true = machine.extend("oscillation@swinging")
    recordings = [observed(true, [*theta, 0.05, 1.3, 0.4], e, i) for i, e in enumerate(events)]
    finder = CauseFinder(machine, ["oscillation", "governor"], random_state=0).fit(recordings)
    assert finder.best_.name == "oscillation@swinging"
    found = finder.causes_[0].values
    assert found["oscillation@swinging.A"][0] == pytest.approx(0.05, rel=0.1)
    assert found["oscillation@swinging.f"][0] == pytest.approx(1.3, rel=0.02)
    assert set(finder.tried_) == {"governor", "oscillation@calm", "oscillation@swinging"}
