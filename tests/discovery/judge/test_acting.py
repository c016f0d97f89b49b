"""From when to when a named effect acts."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.conclusions import acting_text
from errorscreen.discovery.fits.hypotheses import hypothesis_at
from errorscreen.discovery.judge.acting import Acting, acting
from errorscreen.discovery.judge.ranking import NamedEffect
from errorscreen.engine.stages import reads_of
from errorscreen.models.machines.two_axis import stator
from tests.plants import dip, plant

NOISE = np.array([0.002, 0.002])


def at_hidden_values(simulator, names, event, **values):
    """Hypothesis at given values of its effects, with a record that they made."""
    extended = simulator
    for name in names:
        extended = extended.extend(name)
    theta = extended.parameters.nominal.copy()
    for name, value in values.items():
        theta[extended.parameters.index(name.replace("__", "."))] = value
    y = extended.simulate(theta, event).require_ok().values[0]
    problem = FitProblem(extended, Observation(event, y, NOISE, extended.channels, extended.units))
    u = problem.scaled(theta)
    return hypothesis_at(extended.extensions, problem, u, 0.0 * u, 0.0, "converged")


@pytest.fixture(scope="module")
def limited():
    """Machine whose field current is limited from somewhere behind a dip of voltage."""
    machine = plant("synchronous_machine", dip(stop=6.0, depth=0.15, duration=3.0))
    return at_hidden_values(
        machine, ["exciter", "field_limiter"], machine.event, field_limiter__If_max=2.4, field_limiter__K=1.0
    )


def test_a_limiter_begins_where_its_quantity_crosses_the_limit(limited):
    """Against the field current of the same machine without the limiter, (L1)."""
    limiter = limited.effects[1]
    (found,) = acting(limited, limiter)
    machine = limited.simulator
    theta = limited.theta.copy()
    theta[machine.parameters.index("field_limiter.K")] = 0.0
    event = machine.event
    values = dict(zip(machine.parameters.names, theta, strict=True)) | machine.constants
    values |= machine.trajectories(theta, event)
    voltage = event.signals["V"] * np.exp(1j * event.signals["angle"])
    values |= {"Vr": voltage.real, "Vi": voltage.imag}
    Id = stator(*(values[name] for name in reads_of(stator)))[2]
    current = values["Eq1"] + (values["Xd"] - values["Xd1"]) * Id
    crossed = event.time[np.argmax(current > 2.4)]
    assert 1.1 < crossed < 4.0
    assert abs(found.begins - crossed) < 1.5 * event.dt
    assert found.begins <= found.start < found.stop <= event.time[-1]
    assert not found.always


def test_a_regulator_acts_all_the_time_where_the_voltage_is_noisy():
    """And beyond noise only in the event: a scale of a channel shows there, too, because the start follows it."""
    event = dip()
    noisy = event.signals["V"] + 1e-4 * np.random.default_rng(0).standard_normal(len(event.time))
    later = np.where(event.time < 0.3, event.signals["V"], noisy)
    for voltage, always in ((event.signals["V"], False), (noisy, True), (later, True)):
        signals = {**event.signals, "V": voltage}
        played = replace(event, signals=signals)
        found = at_hidden_values(
            plant("synchronous_machine", played), ["exciter", "scale_P"], played, scale_P__a=0.1
        )
        regulator, scale = (acting(found, effect)[0] for effect in found.effects)
        assert regulator.always == always
        assert min(regulator.start, scale.start) >= event.start
        assert scale.stop == event.time[-1]


def test_an_effect_that_changes_nothing_has_no_instant():
    event = dip(depth=0.02)
    found = at_hidden_values(
        plant("synchronous_machine", event), ["field_limiter"], event, field_limiter__If_max=4.0
    )
    (one,) = acting(found, found.effects[0])
    assert np.isnan([one.begins, one.start, one.stop]).all()
    assert one.text == ""


def test_sentences_name_the_recording_where_there_are_several_and_the_effect_where_there_are_two(limited):
    one = Acting("dip", 1.43, 1.52, 3.9)
    assert acting_text([NamedEffect("limiter", "limiter", acts=(one,))]) == (
        " It takes effect at 1.43 s, and changes the response by more than noise from 1.52 s to 3.9 s."
    )
    quiet = Acting("swell", np.nan, np.nan, np.nan)
    several = NamedEffect("limiter", "limiter", acts=(one, quiet))
    assert acting_text([several]).startswith(" In dip it takes effect at 1.43 s")
    text = acting_text([several, NamedEffect("lag", "lag", acts=(replace(one, always=True),))])
    assert "In dip limiter takes effect at" in text
    assert "Lag takes effect all the time, and changes" in text
