import numpy as np

from errorscreen.discovery.latent import waveform
from errorscreen.effects.latent_input import KNOTS, latent
from tests.plants import dip, plant


def test_the_waveform_is_what_the_effect_injects():
    event = dip(stop=5.0)
    knots = np.random.default_rng(0).uniform(-0.4, 0.4, KNOTS)
    rate = KNOTS**2 / (event.time[-1] - event.start)
    added, _ = latent(0.0, event.time, event.start, rate, 1.0, *knots)
    assert np.abs(added - waveform(knots, event.time, event.start)).max() < 1e-12
    base = plant("pv_plant", event)
    found = base.extend("latent_Ip_cmd").simulate([*base.parameters.nominal, 1.0, *knots]).values[0]
    change = found - base.baseline()
    assert np.array_equal(change[:, event.time <= 1.0], np.zeros((2, int(np.sum(event.time <= 1.0)))))
    assert np.abs(change).max() > 0.02


def test_knots_lie_closer_together_after_the_event():
    time = np.linspace(0.0, 5.0, 5001)
    at = [time[np.argmax(waveform(np.eye(KNOTS)[i], time, 1.0))] for i in range(KNOTS)]
    assert np.all(np.diff(np.diff(at)) > 0)
    assert at[0] > 1.0
    assert np.isclose(at[-1], 5.0)
