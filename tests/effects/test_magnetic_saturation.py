"""Magnetic saturation of a state of own equations: a field test of a generator at no load."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

TIME = np.arange(0.0, 60.0, 0.05)
NOISE = 1e-3


def field_circuit(t, x, u, p, dx):
    dx[0] = (p[1] * u[0] - x[0]) / p[0]


def field_voltage(seed):
    """Steps between a third and 1.35 of the field voltage at no load."""
    levels = np.repeat(np.random.default_rng(seed).uniform(0.3, 1.35, 6), 200)
    levels[:40] = levels[0]
    return levels


def measured(levels, saturation, T=5.3, K=0.98):
    """No-load voltage by an adaptive method that is restarted at each sample, from rest."""
    values = [brentq(lambda e: K * levels[0] - e - saturation(e), 0.0, 3.0)]
    for k in range(len(TIME) - 1):
        span = (TIME[k], TIME[k + 1])
        slope = lambda t, e, u=levels[k]: (K * u - e - saturation(e[0])) / T  # noqa: E731
        values.append(solve_ivp(slope, span, values[-1:], rtol=1e-9, atol=1e-11).y[0, -1])
    return np.array(values)


def simulator(recording):
    space = [Parameter("T", 5.0, 2.5, 7.5, "s"), Parameter("K", 1.0, 0.6, 1.4)]
    return ODESimulator(
        field_circuit, ["E"], space, [recording], inputs=["Uf"], outputs=["E"], interpolation="hold",
        step=0.025, initial={"E": "measured"},
    )  # fmt: skip


def quadratic(e):
    return 0.8 * max(e - 0.8, 0.0) ** 2


def test_its_response_is_that_of_the_equation():
    levels = field_voltage(0)
    truth = measured(levels, quadratic)
    recording = Recording.from_signals(TIME, {"Uf": levels, "E": truth}, noise={"E": NOISE})
    model = simulator(recording).extend("E.magnetic_saturation(E)")
    event = model.observe(recording).event
    y = model.simulate([5.3, 0.98, truth[0], 0.8 / 5.3, 0.8], event).require_ok().values[0, 0]
    assert y == pytest.approx(truth, abs=1e-6)
    plain = model.simulate([5.3, 0.98, truth[0], 0.0, 0.8], event).values[0, 0]
    assert np.abs(plain - truth).max() > 0.05


def test_an_exponential_curve_is_named_magnetic_saturation():
    """The form is not that of the template; before there was one, this was an overflow with 0.6 to 0.8."""
    levels = field_voltage(0)
    noise = NOISE * np.random.default_rng(7).standard_normal(len(TIME))
    recording = Recording.from_signals(
        TIME, {"Uf": levels, "E": measured(levels, lambda e: 0.1 * e**7) + noise}, noise={"E": NOISE}
    )
    finder = CauseFinder(simulator(recording), random_state=0).fit(recording)
    assert finder.verdict_.kind == "effect"
    assert finder.causes_[0].name == "E.magnetic_saturation(E)"
    assert finder.causes_[0].probability > 0.5
