"""Quantities that are constant within a step and change between steps."""

import numpy as np
import pytest

from errorscreen.engine import Call, Engine, Model, ReferenceEngine
from errorscreen.engine.examples import decay
from errorscreen.engine.linear import state_matrix
from errorscreen.exceptions import InputError

CALLS = (
    Call(decay, ("x", "u", "T"), ("d_x",)),
    Call(decay, ("x", "u", "T"), ("slope",), recorded=True),
)
LAG = Model("switched", (), ("x",), ("T",), CALLS, ("x", "slope"), tables=("u",))

#: the table of a pulse: before, during, after
PULSE = np.array([[0.0], [1.0], [-0.5]])


def pulse(engine, T, steps, first, last, every=1):
    """Lag that follows a pulse between two instants of one second, both multiples of the step."""
    at = np.arange(steps + 1) / steps
    segment = np.select([at >= last - 1e-9, at >= first - 1e-9], [2, 1], 0)
    T = np.reshape(T, (-1, 1))
    u = np.zeros((2 * steps + 1, 0))
    return engine.integrate(np.zeros_like(T), T, u, h=1 / steps, every=every, tables=PULSE, segment=segment)


def exact(t, T, first, last):
    top = 1 - np.exp(-(last - first) / T)
    during, after = 1 - np.exp(-(t - first) / T), -0.5 + (top + 0.5) * np.exp(-(t - last) / T)
    return np.select([t >= last, t >= first], [after, during], 0.0)


def test_a_jump_between_two_steps_keeps_the_order():
    T, first, last, errors = 0.3, 0.25, 0.5, []
    for steps in (16, 32, 64):
        y = pulse(Engine(LAG), T, steps, first, last)
        errors.append(np.abs(y[0, 0] - exact(np.arange(steps + 1) / steps, T, first, last)).max())
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(ratios - 16) < 2)


def test_what_is_recorded_at_the_jump_is_the_value_after_it():
    x, slope = pulse(Engine(LAG), 0.3, 8, 0.25, 0.5, every=2)[0]
    assert slope == pytest.approx((np.array([0.0, 1.0, -0.5, -0.5, -0.5]) - x) / 0.3, abs=1e-12)


def test_numpy_few_lanes_and_many_agree_bit_for_bit():
    T = np.random.default_rng(0).uniform(0.05, 2, 37)
    together = pulse(Engine(LAG), T, 40, 0.25, 0.5)
    assert np.array_equal(pulse(ReferenceEngine(LAG), T, 40, 0.25, 0.5), together)
    for i in (0, 17, 36):
        assert np.array_equal(pulse(Engine(LAG), T[i], 40, 0.25, 0.5)[0], together[i])


def test_each_simulation_can_have_its_own_course_of_the_event():
    rng = np.random.default_rng(0)
    T = rng.uniform(0.05, 2, (37, 1))
    segment = np.sort(rng.integers(0, 3, (37, 41)), axis=1)
    options = {"h": 1 / 40, "every": 2, "tables": PULSE}
    u = np.zeros((81, 0))
    together = Engine(LAG).integrate(np.zeros_like(T), T, u, segment=segment, **options)
    reference = ReferenceEngine(LAG).integrate(np.zeros_like(T), T, u, segment=segment, **options)
    assert np.array_equal(together, reference)
    for i in (0, 17, 36):
        alone = Engine(LAG).integrate(np.zeros((1, 1)), T[i : i + 1], u, segment=segment[i], **options)
        assert np.array_equal(alone[0], together[i])
    few = Engine(LAG, n_threads=2).integrate(
        np.zeros((9, 1)), T[:9], u, segment=np.tile(segment[3], (9, 1)), **options
    )
    shared = Engine(LAG).integrate(np.zeros((9, 1)), T[:9], u, segment=segment[3], **options)
    assert np.array_equal(few, shared)


def test_what_is_recorded_can_be_chosen():
    options = {"h": 0.1, "tables": PULSE, "segment": [0, 1, 1, 1, 2]}
    for engine in (Engine(LAG), ReferenceEngine(LAG)):
        both = engine.integrate(np.ones((3, 1)), np.ones((3, 1)), np.zeros((9, 0)), **options)
        one = engine.integrate(np.ones((3, 1)), np.ones((3, 1)), np.zeros((9, 0)), record=("x",), **options)
        assert np.array_equal(one, both[:, :1])


def test_what_moves_in_a_step_is_not_at_rest():
    x0 = np.array([[1.0], [1.0 + 1e-6], [np.nan], [1.0]])
    still = Engine(LAG).at_rest(x0, np.ones((4, 1)), h=0.1, tables=PULSE[1:2])
    assert still.tolist() == [True, False, False, True]


def test_derivatives_and_state_matrix_take_tables():
    slope = ReferenceEngine(LAG).derivatives(np.zeros((1, 1)), np.ones((1, 1)), np.zeros(0), np.array([3.0]))
    assert slope == 3.0
    assert state_matrix(LAG, [1.0], [0.5], [], [1.0]) == pytest.approx(-2.0)


@pytest.mark.parametrize("engine", [Engine, ReferenceEngine])
@pytest.mark.parametrize(
    ("tables", "segment", "message"),
    [
        (
            np.zeros((2, 3)),
            np.zeros(5),
            r"the tables have shape \(2, 3\).*Allowed: \(number of segments, 1\)",
        ),
        (PULSE, np.zeros(4), "Allowed: 5 integers from 0 to 2"),
        (PULSE, np.zeros((2, 5)), "for all simulations or for each of 1"),
        (PULSE, [0, 0, 3, 0, 0], "rows that the tables do not have"),
        (PULSE, [0, 0, -1, 0, 0], "rows that the tables do not have"),
    ],
)
def test_tables_that_do_not_fit_are_refused(engine, tables, segment, message):
    with pytest.raises(InputError, match=message):
        engine(LAG).integrate(
            np.zeros((1, 1)), np.ones((1, 1)), np.zeros((9, 0)), h=0.1, tables=tables, segment=segment
        )
