"""The test for noise: calibrated where there is only noise, sensitive where there is more, and told where."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.data.observations import Observation
from errorscreen.discovery import residual_test
from errorscreen.discovery.judge import residual_test as module
from errorscreen.exceptions import InputError
from tests.plants import dip


def seen(values=None, stop=4.0):
    """An observation of two channels with unit noise."""
    event = dip(stop=stop)
    values = np.zeros((2, len(event.time))) if values is None else values
    return Observation(event, values, np.ones(2), ("P", "Q"), ("pu", "pu"))


def residuals(rng, observation, J=None):
    """White noise less what a fit of the columns of J takes of it."""
    w = rng.standard_normal(observation.mask.sum())
    return w if J is None else w - J @ np.linalg.lstsq(J, w, rcond=None)[0]


@pytest.mark.parametrize("fitted", [False, True])
def test_noise_is_conspicuous_as_often_as_it_should(fitted):
    observation = seen()
    rng = np.random.default_rng(0)
    n = int(observation.mask.sum())
    J = np.column_stack([np.sin(k * np.arange(n) / 20) for k in range(1, 9)]) * 10 if fitted else None
    p = [
        residual_test(
            [observation], residuals(rng, observation, J), J, n_bootstrap=200, random_state=i
        ).p_value
        for i in range(100)
    ]
    assert np.mean(np.array(p) < 0.05) <= 0.12
    assert 0.3 < np.mean(p) < 0.75


def test_correlated_noise_is_noise():
    observation = seen(stop=8.0)
    rng = np.random.default_rng(1)
    swing = 3.0 * np.sin(2 * np.pi * observation.time) * (observation.time > 1.0)
    p, found = [], []
    for i in range(40):
        w = rng.standard_normal((2, len(observation.time) + 20))
        z = np.array([np.convolve(row, 0.7 ** np.arange(12), "full")[20:][: w.shape[1] - 20] for row in w])
        z /= z.std()
        p.append(residual_test([observation], z.ravel(), n_bootstrap=200, random_state=i).p_value)
        found.append(
            residual_test([observation], (z + swing).ravel(), n_bootstrap=200, random_state=i).p_value
        )
    assert np.mean(np.array(p) < 0.05) <= 0.15
    assert np.mean(p) < 0.6  # a test that never rejects would pass the line above
    assert np.mean(np.array(found) < 0.05) > 0.9


def test_a_swing_is_found_where_it_is():
    observation = seen()
    time = observation.time
    z = np.random.default_rng(2).standard_normal((2, len(time)))
    z[1] += 2.0 * np.sin(2 * np.pi * 1.0 * time) * (time > 1.0)
    found = residual_test([observation], z.ravel())
    assert found.p_value < 0.002
    first = found.significant[0]
    assert (first.channel, first.band) == ("Q", (0.4, 2.5))
    assert all(cell.channel == "Q" for cell in found.significant)
    # what is beyond noise is about the energy of the swing
    assert found.excess == pytest.approx(2.0 * (time > 1.0).sum(), rel=0.25)


@pytest.mark.parametrize("size", [0.0, 5.0])
def test_draws_that_cannot_reach_are_not_made(monkeypatch, size):
    observation, made, null = seen(), [], module._null

    def counted(observations, n, *rest):
        made.append(n)
        return null(observations, n, *rest)

    monkeypatch.setattr(module, "_null", counted)
    z = np.random.default_rng(7).standard_normal((2, len(observation.time)))
    z[0] += size * (observation.time > 1.0)
    found = residual_test([observation], z.ravel())
    assert made == ([200] if size else [200, 800])
    monkeypatch.setattr(module, "_NEVER", np.inf)
    every = residual_test([observation], z.ravel())
    assert found.p_value == every.p_value
    assert found.excess == pytest.approx(every.excess, rel=0.02, abs=1e-9)
    assert [c.significant for c in found.cells] == [c.significant for c in every.cells]


def test_less_than_noise_is_no_merit():
    observation = seen()
    z = 0.5 * np.random.default_rng(3).standard_normal((2, len(observation.time)))
    assert 0.0 <= residual_test([observation], z.ravel()).excess < 5


def test_gaps_and_several_recordings_keep_their_places():
    values = np.zeros((2, len(dip().time)))
    values[0, 100:130] = np.nan
    first, second = seen(values), replace(seen(), event=replace(dip(), name="other"))
    z = np.random.default_rng(4).standard_normal(first.mask.sum() + second.mask.sum())
    time = second.time
    z[-len(time) :] += 3.0 * (time > 1.5) * (time < 2.0)  # Q of the second
    found = residual_test([first, second], z)
    assert {(c.recording, c.channel) for c in found.significant} == {("other", "Q")}


def test_too_little_to_tell_is_refused():
    observation = seen()
    z = residuals(np.random.default_rng(5), observation)
    with pytest.raises(InputError, match="n_bootstrap"):
        residual_test([observation], z, n_bootstrap=1)
    short = observation.first(int(np.sum(observation.time < observation.event.start)) + 2)
    with pytest.raises(InputError, match="enough samples after the start"):
        residual_test([short], np.zeros(short.mask.sum()))


def test_the_same_seed_gives_the_same_result():
    observation = seen()
    z = residuals(np.random.default_rng(5), observation)
    a, b = (residual_test([observation], z, random_state=3) for _ in range(2))
    assert a == b


def test_an_offset_is_no_noise_though_it_stands_before_the_event_too():
    observation = seen()
    z = np.random.default_rng(3).standard_normal((2, len(observation.time)))
    assert residual_test([observation], z.ravel()).p_value > 0.05
    z[0] += 3.0
    assert residual_test([observation], z.ravel()).p_value < 0.002
