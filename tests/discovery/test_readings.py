"""Wrong readings of a recording are told before a cause is searched."""

from dataclasses import replace

import pytest

from errorscreen.cases.demo import demo_recordings
from errorscreen.discovery.readings import better_readings
from errorscreen.simulators import PlantSimulator


@pytest.fixture(scope="module")
def recording():
    return demo_recordings(0)[0]


def read_wrongly(recording, **factors):
    channels = {
        name: replace(channel, values=factors.get(name, 1.0) * channel.values)
        for name, channel in recording.channels.items()
    }
    return replace(recording, channels=channels)


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ({"Q": -1.0}, "With the other sign of Q (scale = -1)"),
        ({"P": -1.0, "Q": -1.0}, "With the other sign of P and Q (sign = 'load')"),
        ({"angle": -1.0}, "With the other sign of the angle (scale = -1)"),
    ],
)
def test_a_wrong_reading_is_named(recording, factors, told):
    """Of a machine whose parameters are wrong by up to a quarter."""
    plant = PlantSimulator("synchronous_machine", recording)
    (found,) = better_readings(plant, read_wrongly(recording, **factors))
    assert found.startswith(told)


def test_the_sign_of_Q_is_named_also_where_P_is_far_off(recording):
    """Parameters far from those of the unit leave much of P, whatever the sign of Q is."""
    plant = PlantSimulator("synchronous_machine", recording)
    space = plant.parameters.replace({"Tj": {"nominal": 2.5, "lower": 2.0}})
    plant = PlantSimulator("synchronous_machine", recording, parameters=space)
    assert better_readings(plant, recording) == []
    (found,) = better_readings(plant, read_wrongly(recording, Q=-1.0))
    assert found.startswith("With the other sign of Q (scale = -1)")


def test_the_sign_of_P_alone_is_named_beside_that_of_the_angle(recording):
    """Both turn the current against the voltage, so neither explains less than the other."""
    plant = PlantSimulator("synchronous_machine", recording)
    (found,) = better_readings(plant, read_wrongly(recording, P=-1.0))
    assert "the other sign of P (scale = -1)" in found


def test_interchanged_powers_are_named(recording):
    plant = PlantSimulator("synchronous_machine", recording)
    P, Q = recording.channel("P"), recording.channel("Q")
    channels = {**recording.channels, "P": replace(P, values=Q.values), "Q": replace(Q, values=P.values)}
    (found,) = better_readings(plant, replace(recording, channels=channels))
    assert found.startswith("With P and Q interchanged")


@pytest.mark.parametrize("seed", range(4))
def test_right_readings_are_not_doubted(seed):
    fitted, held_out, _ = demo_recordings(seed)
    for one in (fitted, *held_out):
        assert better_readings(PlantSimulator("synchronous_machine", one), one) == []


def test_another_model_is_no_wrong_reading(recording):
    """A converter leaves nearly all of a machine's response, and no reading changes that."""
    assert better_readings(PlantSimulator("pv_plant", recording), recording) == []
