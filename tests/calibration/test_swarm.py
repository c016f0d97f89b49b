import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.calibration import ParticleSwarm
from errorscreen.exceptions import InputError

BOUNDS = np.array([[-5.0, 5.0], [0.0, 20.0]])


def start(n=20, seed=0):
    return np.random.default_rng(seed).uniform(*BOUNDS.T, (n, 2))


def rastrigin(x, centre=(1.3, 7.0)):
    z = x - np.asarray(centre)
    return (z**2 - 3 * np.cos(2 * np.pi * z)).sum(axis=1)


def test_it_finds_the_global_minimum_among_many():
    swarm = ParticleSwarm(start(), BOUNDS, random_state=1)
    for _ in range(120):
        swarm.tell(rastrigin(swarm.ask()))
    np.testing.assert_allclose(swarm.best_position, [1.3, 7.0], atol=1e-3)


def test_a_minimum_outside_the_bounds_is_found_on_the_bound():
    swarm = ParticleSwarm(start(), BOUNDS, random_state=1)
    for _ in range(60):
        swarm.tell(((swarm.ask() - [9.0, 4.0]) ** 2).sum(axis=1))
    assert swarm.best_position[0] == 5.0
    assert swarm.best_position[1] == pytest.approx(4.0, abs=1e-3)


@given(
    st.integers(0, 99),
    st.floats(0, 1),
    st.floats(0, 4),
    st.floats(0, 4),
    st.floats(0.01, 2),
    st.floats(0, 0.9),
)
@settings(max_examples=40)
def test_bounds_and_step_hold_and_the_best_never_worsens(seed, inertia, cognitive, social, fastest, share):
    rng = np.random.default_rng(seed)
    swarm = ParticleSwarm(
        start(),
        BOUNDS,
        inertia=inertia,
        cognitive=cognitive,
        social=social,
        max_velocity=fastest,
        random_state=seed,
    )
    best, last = np.inf, swarm.ask()
    for _ in range(15):
        x = swarm.ask()
        assert np.all((x >= BOUNDS[:, 0]) & (x <= BOUNDS[:, 1]))
        assert np.all(np.abs(x - last) <= fastest * np.ptp(BOUNDS, axis=1) * (1 + 1e-9))
        values = rastrigin(x)
        values[rng.random(len(values)) < share] = np.nan
        swarm.tell(values)
        best = min(best, np.nanmin(np.append(values, np.inf)))
        assert swarm.best_value == best
        if np.isfinite(best):
            assert rastrigin(swarm.best_position[None])[0] == pytest.approx(best, abs=1e-9)
        last = x


def test_the_first_move_follows_the_equation():
    x = start(3)
    swarm = ParticleSwarm(x, BOUNDS, social=0.7, max_velocity=10, random_state=5)
    swarm.tell([3.0, 1.0, 2.0])
    # from rest, and at their own best positions, particles are only pulled to the swarm's best
    _, pull = np.random.default_rng(5).random((2, 3, 2))
    np.testing.assert_allclose(swarm.ask(), x + 0.7 * pull * (x[1] - x), rtol=1e-12)


def test_without_any_success_it_stays_and_says_so():
    swarm = ParticleSwarm(start(4), BOUNDS, random_state=0)
    for failed in (np.nan, np.inf):
        swarm.tell(np.full(4, failed))
    assert swarm.best_value == np.inf


def test_the_seed_decides():
    runs = []
    for seed in (3, 3, 4):
        swarm = ParticleSwarm(start(), BOUNDS, random_state=seed)
        for _ in range(10):
            swarm.tell(rastrigin(swarm.ask()))
        runs.append(swarm.ask())
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.allclose(runs[0], runs[2])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"inertia": 1.5}, "inertia is 1.5"),
        ({"cognitive": -1}, "cognitive is -1"),
        ({"social": "x"}, "social is 'x'"),
        ({"max_velocity": 0}, "max_velocity is 0"),
        ({"start": np.zeros((0, 2))}, "start positions have shape"),
        ({"start": np.zeros((3, 1))}, "start positions have shape"),
        ({"start": [[0.0, -1.0]]}, "not inside the bounds"),
    ],
)
def test_wrong_arguments_are_named(options, message):
    with pytest.raises(InputError, match=message):
        ParticleSwarm(**{"start": start(), "bounds": BOUNDS, **options})


def test_a_wrong_number_of_values_is_named():
    with pytest.raises(InputError, match=r"values have shape \(3,\)"):
        ParticleSwarm(start(4), BOUNDS).tell([1.0, 2.0, 3.0])
