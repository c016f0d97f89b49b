import numpy as np
import pytest

from errorscreen.cases.demo import demo_recordings
from errorscreen.exceptions import InputError
from errorscreen.plotting import plot_signature
from errorscreen.simulators import PlantSimulator

RECORDING, HELD_OUT, _ = demo_recordings(random_state=0)
PLANT = PlantSimulator("synchronous_machine", RECORDING)


def test_lines_are_the_change_at_each_strength_and_none_at_zero():
    events = [PLANT.event, PLANT.observe(HELD_OUT[0]).event]
    figure = plot_signature(PLANT, "exciter", events, strengths=(0.0, 0.5))
    assert len(figure.axes) == 4
    extended = PLANT.extend("exciter")
    theta = extended.parameters.embed([0.5 * extended.parameters["exciter.K"].upper], ["exciter.K"])
    for axes, (channel, event) in zip(figure.axes, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True):
        zero, half = axes.get_lines()[:2]
        change = extended.simulate(theta, events[event]).values[0] - PLANT.baseline(events[event])
        assert not np.any(zero.get_ydata())
        assert np.array_equal(half.get_ydata(), change[channel])
        assert change.any()


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(InputError, match="unknown effect 'volt_var'"):
        plot_signature(PLANT, "volt_var")
    with pytest.raises(InputError, match="strengths"):
        plot_signature(PLANT, "exciter", strengths=(2.0,))
