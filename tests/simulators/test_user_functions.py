"""The functions of a user's model: compiled once, and again when something they refer to has changed."""

from functools import partial
from types import ModuleType

import numba
import numpy as np
import pytest

from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator
from errorscreen.simulators.user_functions import compile_all, identity

EVENT = InputSignal(0.01 * np.arange(200), "push", 0.0, {"force": np.ones(200)})
stiffness = 4.0
table = np.array([4.0, 0.0])
constants = ModuleType("constants")
constants.stiffness = 4.0


def spring(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - stiffness * x[0]


def spring_of_a_table(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - table[0] * x[0]


def spring_of_a_module(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - constants.stiffness * x[0]


def spring_with_arrays(t, x, u, p, dx):
    force = np.zeros(2)
    force[1] = u[0] - p[0] * x[1] - 4.0 * x[0]
    dx[0] = x[1]
    dx[1] = force.sum()


def model(rhs, **settings):
    return ODESimulator(
        rhs,
        ["position", "velocity"],
        [Parameter("damping", 0.4, 0.1, 2.0)],
        EVENT,
        inputs=["force"],
        outputs=["position"],
        **settings,
    )


def responses(rhs, n=3, **settings):
    return model(rhs, **settings).simulate(np.linspace(0.2, 1.0, n)[:, None]).values


def test_a_compiled_function_is_known_by_what_it_was_made_from():
    assert identity(numba.njit(spring)) == identity(spring) != identity(numba.njit(spring_of_a_table))


def test_callable_objects_are_recognised_by_their_state():
    class Box:
        def __init__(self, gain):
            self.gain, self.folder = gain, object()

        def __getstate__(self):
            return {"gain": self.gain}

        def __call__(self, theta, event):
            return self.gain * theta

    assert identity(Box(1.0)) == identity(Box(1.0)) != identity(Box(2.0))
    assert identity(partial(spring, 1.0)) == identity(partial(spring, 1.0)) != identity(partial(spring, 2.0))
    assert identity(partial(spring, 1.0)) != identity(partial(spring_of_a_table, 1.0))


def test_a_function_that_has_not_changed_is_compiled_once():
    assert compile_all([spring])[1][0] is compile_all([spring])[1][0]


def test_a_number_that_a_function_refers_to_may_change(monkeypatch):
    before = responses(spring)
    monkeypatch.setitem(globals(), "stiffness", 9.0)
    assert np.abs(responses(spring) - before).max() > 0.01
    assert np.array_equal(responses(spring), responses(spring, compile=False))


def test_an_array_that_a_function_refers_to_may_change(monkeypatch):
    before = responses(spring_of_a_table)
    monkeypatch.setitem(globals(), "table", np.array([9.0, 0.0]))
    assert np.abs(responses(spring_of_a_table) - before).max() > 0.01


def test_what_another_module_holds_may_change(monkeypatch):
    before = responses(spring_of_a_module)
    monkeypatch.setattr(constants, "stiffness", 9.0)
    assert np.abs(responses(spring_of_a_module) - before).max() > 0.01


def test_a_function_may_make_arrays_of_its_own():
    assert compile_all([spring_with_arrays])[0]
    assert np.allclose(responses(spring_with_arrays), responses(spring), rtol=0, atol=1e-14)


@pytest.mark.parametrize("n", [1, 15, 16, 17, 40])
def test_simulations_do_not_depend_on_those_beside_them(n):
    theta = np.linspace(0.2, 1.0, n)[:, None]
    together = model(spring).simulate(theta).values
    assert np.array_equal(together, np.concatenate([model(spring).simulate(row).values for row in theta]))


def test_a_simulation_that_fails_leaves_those_beside_it_alone():
    def breaks(t, x, u, p, dx):
        dx[0] = x[1]
        dx[1] = u[0] - p[0] * x[1] - 4.0 * x[0]
        if p[0] > 0.75:
            dx[1] = 1.0 / (1.0 - t) if t < 1.0 else np.inf

    theta = np.linspace(0.2, 1.0, 20)[:, None]
    found = model(breaks).simulate(theta)
    well = theta[:, 0] <= 0.75
    assert np.array_equal(found.status == 0, well)
    assert np.array_equal(found.values[well], model(spring).simulate(theta[well]).values)
    assert np.isnan(found.values[~well]).all()


def test_long_arrays_of_a_closure_are_told_apart():
    def closure(values):
        return lambda: values[0]

    one, other = np.zeros(5000), np.zeros(5000)
    other[2500] = 1.0
    assert repr(one) == repr(other)
    assert identity(closure(one)) != identity(closure(other)) == identity(closure(other.copy()))
