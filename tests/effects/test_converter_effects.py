"""Ramp limit and phase-locked loop: their equations by hand, in the plants and in a grid, and as causes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from errorscreen.data.observations import Observation
from errorscreen.discovery import CauseFinder
from errorscreen.effects.ramp_limit import ramp_limit
from errorscreen.events import Playback
from errorscreen.simulators import PowerSystemSimulator
from tests.plants import OPERATING_POINT, dip, plant, random_rows
from tests.simulators.grid.test_simulator import FAULT, MACHINES, UNITS, network

CONVERTERS = ("dfig_plant", "pv_plant")
#: parameter that limits the rise in the device itself
OWN_LIMIT = {"dfig_plant": "RIP", "pv_plant": "RIp"}
TAU = 0.01
NOISE = np.full(2, 2e-3)


def square(depth=0.5, stop=6.0, dt=1 / 400):
    """The voltage is low for 0.2 s and exactly as before otherwise; the angle rests."""
    time = np.arange(0, stop, dt)
    voltage = np.where((time > 1.0) & (time < 1.2), 1.0 - depth, 1.0)
    return Playback(time, "square", 1.0, {"V": voltage, "angle": 0.0 * time}, OPERATING_POINT)


def observed(truth, theta, event):
    """What is recorded of a truth, with noise."""
    y = truth.simulate(theta, event).require_ok().values[0]
    y = y + NOISE[:, None] * np.random.default_rng(0).standard_normal(y.shape)
    return Observation(event, y, NOISE, truth.channels, truth.units)


def deviating(simulator):
    """Parameters of a truth that none of the nominal ones is equal to."""
    rng = np.random.default_rng(3)
    return simulator.parameters.nominal * rng.uniform(0.9, 1.1, len(simulator.parameters))


@settings(max_examples=20)
@given(st.floats(0.05, 10.0), st.floats(0.0, 0.6), st.floats(0.1, 0.6))
def test_a_step_up_takes_its_size_times_the_strength(Tr, low, step):
    """(U1), (U2) by an adaptive method against the straight line that they are meant to be."""
    high = low + step
    t = np.linspace(0, 1.3 * Tr * step + 0.1, 200)

    def acting(u, x):
        return ramp_limit(u, x, Tr, TAU, 1.0 / Tr)

    x = solve_ivp(
        lambda t, y: [acting(high, y[0])[1]], (0, t[-1]), [low], t_eval=t, max_step=TAU / 20, rtol=1e-9
    ).y[0]
    found = np.array([acting(high, a)[0] for a in x])
    assert np.abs(found - np.minimum(high, low + (t + TAU) / Tr)).max() < 1e-4
    # a fall is followed at once, from any part of the ramp
    assert acting(low, x[50])[0] == low


@settings(max_examples=20)
@given(st.floats(0.1, 10.0), st.floats(0.05, 0.95))
def test_a_slower_rise_is_not_changed(Tr, share):
    """Also not by the lag of the memory, once it has settled: it rests `share` of the margin below the command."""
    slope = share / Tr
    t = np.linspace(0, 0.5, 200)
    x = solve_ivp(
        lambda t, y: [ramp_limit(slope * t, y[0], Tr, TAU, 1 / Tr)[1]], (0, 0.5), [0.0], t_eval=t, rtol=1e-9
    ).y[0]
    for instant, memory in zip(t, x, strict=True):
        assert ramp_limit(slope * instant, memory, Tr, TAU, 1 / Tr)[0] == slope * instant


@pytest.mark.parametrize("device", CONVERTERS)
@pytest.mark.parametrize("Tr", [2.0, 4.0, 8.0])
def test_the_current_comes_back_in_a_straight_line(device, Tr):
    """At a voltage of 1 pu the power is the current: it rises by 1/Tr a second until it is what it was."""
    event = square()
    simulator = plant(device, event, step=1 / 800).extend("ramp")
    P = simulator.simulate([*simulator.parameters.nominal[:-1], Tr]).require_ok().values[0, 0]
    left = OPERATING_POINT["P"] - P[event.time > 1.2][0]
    # the regulator behind the command has settled after eight of its time constants
    rising = (event.time > 1.36) & (event.time < 1.2 + 0.9 * Tr * left)
    assert rising.sum() > 50
    assert np.polyfit(event.time[rising], P[rising], 1)[0] == pytest.approx(1 / Tr, rel=1e-4)
    assert np.abs(np.diff(P[rising]) / event.dt * Tr - 1.0).max() < 0.01
    back = event.time[(event.time > 1.2) & (OPERATING_POINT["P"] <= P)][0]
    assert back - 1.2 == pytest.approx(Tr * left, abs=0.05)


@pytest.mark.parametrize("device", CONVERTERS)
@pytest.mark.parametrize("rate", [0.2, 0.4, 1.0])
def test_it_acts_as_a_smaller_limit_of_the_regulator(device, rate):
    """The device's own limit, of the same slope, stands behind the command; its lag is what they differ by."""
    event = square()
    base = plant(device, event, step=1 / 800)
    theta = deviating(base)
    own = theta.copy()
    own[base.parameters.index(OWN_LIMIT[device])] = rate
    expected = base.simulate(own).require_ok().values[0]
    plain = base.simulate(theta).values[0]
    found = base.extend("ramp").simulate([*theta, 1 / rate]).require_ok().values[0]

    def rms(values):
        return np.sqrt(np.mean(values[0, event.time > 1.0] ** 2))

    assert rms(found - expected) < 0.12 * rms(plain - expected)
    assert np.array_equal(found[1], plain[1])  # reactive power does not depend on it


def test_a_ramp_faster_than_the_regulator_shows_nothing():
    event = square()
    simulator = plant("pv_plant", event).extend("ramp")
    nominal = simulator.parameters.nominal[:-1]  # which rises by 3 pu/s
    off, faster, slower = simulator.simulate([[*nominal, Tr] for Tr in (0.0, 0.25, 1.0)]).values[:, 0]
    assert np.abs(faster - off).max() < 0.02
    assert np.abs(slower - off).max() > 0.2


@settings(max_examples=15)
@given(st.floats(-0.6, 14.0), st.integers(0, 100))
def test_a_loop_of_another_gain_in_playback(s, seed):
    """The same as with the constant changed, to rounding."""
    event = dip(depth=0.3, swing=0.6)
    base = plant("dfig_plant", event)
    other = plant("dfig_plant", event, constants={"KPLL": 30.0 / (1.0 + s)})
    theta = random_rows(base, 3, seed)
    found = base.extend("pll").simulate(np.hstack([theta, np.full((3, 1), s)])).values
    assert np.abs(found - other.simulate(theta).values).max() < 1e-9


@pytest.mark.parametrize("engine", ["compiled", "numpy"])
def test_a_loop_of_another_gain_behind_an_impedance(engine):
    event = dip(depth=0.3, swing=0.3, stop=2.0)
    still = plant("dfig_plant", event).baseline()
    event = replace(event, signals={**event.signals, "P": still[0], "Q": still[1]})
    options = {"grid_impedance": 0.02 + 0.1j, "engine": engine}
    base = plant("dfig_plant", event, **options)
    other = plant("dfig_plant", event, constants={"KPLL": 10.0}, **options)
    found = base.extend("pll").simulate([*base.parameters.nominal, 2.0]).values
    expected = other.simulate(base.parameters.nominal).values
    assert np.abs(found - expected).max() < 1e-9
    assert np.abs(found[0] - base.baseline()).max() > 1e-3


@pytest.mark.parametrize("s", [-0.5, 2.0, 9.0])
def test_a_loop_of_another_gain_in_a_grid(s):
    """There the loop turns the current, so that a slow one moves every voltage."""

    def system(gain):
        units = [replace(u, constants={"KPLL": gain}) if u.device == "dfig_plant" else u for u in UNITS]
        return PowerSystemSimulator(network(), units, MACHINES, event=FAULT, channels={"U": 3, "P": (2, 3)})

    base, other = system(30.0), system(30.0 / (1.0 + s))
    theta = random_rows(base, 3)
    found = base.extend("dfig_plant.pll").simulate(np.hstack([theta, np.full((3, 1), s)])).values
    assert np.abs(found - other.simulate(theta).values).max() < 1e-9
    assert np.abs(found - base.simulate(theta).values).max() > 1e-3


def test_a_plant_whose_regulator_rises_slowly_is_named_a_ramp():
    """The rise is limited to 0.4 pu/s, far outside of the bounds of RIp: 1 pu takes 2.5 s."""
    event = dip(depth=0.55, duration=0.2, swing=0.0)
    model = plant("pv_plant", event, n_threads=1)
    theta = deviating(model)
    theta[model.parameters.index("RIp")] = 0.4
    finder = CauseFinder(model, ["ramp", "cessation"], random_state=0).fit(observed(model, theta, event))
    assert finder.verdict_.kind == "effect"
    cause = finder.causes_[0]
    assert (cause.name, cause.exact) == ("ramp", True)
    assert cause.values["ramp.Tr"][0] == pytest.approx(2.5, rel=0.05)


def test_a_plant_with_a_slow_loop_is_named_so():
    """K_PLL is 5 /s instead of 30 /s, which is no parameter: s = 5."""
    event = dip(depth=0.3, duration=0.15, swing=0.6)
    model = plant("dfig_plant", event, n_threads=1)
    truth = plant("dfig_plant", event, constants={"KPLL": 5.0}, n_threads=1)
    finder = CauseFinder(model, ["pll", "lag_active"], random_state=0).fit(
        observed(truth, deviating(model), event)
    )
    assert finder.verdict_.kind == "effect"
    cause = finder.causes_[0]
    assert (cause.name, cause.place, cause.exact) == ("pll", "d_theta", True)
    value, low, high = cause.values["pll.s"]
    assert low < 5.0 < high
    assert value == pytest.approx(5.0, rel=0.25)


#: a volt-var curve: centre and half width of its dead band in pu, and slope
CENTRE, BAND, DROOP = 1.0, 0.02, 8.0


def curve(V):
    """Reactive power of a volt-var controller by its corner points."""
    corners = [CENTRE - BAND - 0.1, CENTRE - BAND, CENTRE + BAND, CENTRE + BAND + 0.1]
    return np.interp(V, corners, [0.1 * DROOP, 0.0, 0.0, -0.1 * DROOP])


def staircase(levels, each=2.0, dt=0.02):
    """The voltage goes from one level to the next, where it stays; it starts at the first one."""
    time = np.arange(0, each * len(levels), dt)
    point = {"V": levels[0], "P": 0.5, "Q": 0.1}
    return Playback(time, "staircase", each, {"V": np.array(levels)[(time / each).astype(int)]}, point)


@pytest.mark.parametrize("start", [0.96, 0.99, 1.01, 1.05])
def test_reactive_power_follows_the_curve_wherever_it_starts(start):
    """Inside the dead band or on either slope: what settles is the difference of two points of the curve."""
    levels = [start, 0.99, 0.97, 0.94, 1.0, 1.03, 1.06]
    event = staircase(levels)
    simulator = plant("pv_plant", event).extend("volt_var")
    own = {"K": DROOP, "db": BAND, "Vc": CENTRE - start, "Qm": 1.0, "T": 0.05, "Td": 0.02, "R": 5.0}
    theta = simulator.parameters.nominal.copy()
    theta[-len(own) :] = list(own.values())
    assert simulator.parameters.names[-len(own) :] == tuple(f"volt_var.{name}" for name in own)
    Q = simulator.simulate(theta).require_ok().values[0, 1]
    settled = Q[np.searchsorted(event.time, 2.0 * np.arange(1, len(levels) + 1) - 0.1)]
    assert settled - 0.1 == pytest.approx(curve(np.array(levels)) - curve(start), abs=2e-4)


def test_a_volt_var_controller_that_starts_on_its_slope_is_named():
    """The record is written by corner points and a lag, not by a device; steps in both directions tell the centre."""
    event = staircase([0.96, 0.93, 0.95, 0.985, 1.01, 1.04, 1.06, 1.0, 0.96], each=1.0)
    x, reactive = curve(0.96), []
    for V in event.signals["V"]:
        x += (curve(V) - x) * event.dt / 0.3
        reactive.append(0.1 + x - curve(0.96))
    rng = np.random.default_rng(5)
    noise = np.full(2, 1e-3)
    y = np.array([np.full(len(reactive), 0.5), reactive]) + noise[:, None] * rng.standard_normal(
        (2, len(reactive))
    )
    model = plant("pv_plant", event, n_threads=1)
    rivals = ["lag_reactive", "priority", "lag_Q", "scale_Q", "offset_Q"]
    finder = CauseFinder(model, ["volt_var", *rivals], max_effects=1, random_state=0).fit(
        Observation(event, y, noise, model.channels, model.units)
    )
    cause = finder.causes_[0]
    assert cause.name == "volt_var"
    found = {name.removeprefix("volt_var."): value for name, (value, _, _) in cause.values.items()}
    assert found["K"] == pytest.approx(DROOP, rel=0.1)
    assert found["db"] == pytest.approx(BAND, abs=0.004)
    assert found["Vc"] == pytest.approx(CENTRE - 0.96, abs=0.004)


@pytest.mark.parametrize(("effect", "level"), [("trip", 0.94), ("trip_high", 1.15)])
def test_a_tripped_plant_comes_back_as_its_settings_say(effect, level):
    """Off after the timer, away for the waiting time, a share back at once and the rest in a straight line."""
    time = np.arange(0, 6.0, 0.01)
    event = Playback(
        time, "step", 1.0, {"V": np.where(time > 1.0, level, 1.0)}, {"V": 1.0, "P": 0.6, "Q": 0.1}
    )
    base = plant("pv_plant", event, step=1 / 400)
    simulator = base.extend(effect)
    Tth, Tc, r0, Tramp = 0.5, 1.0, 0.25, 2.0
    vth = 0.95 if level < 1 else 1.1
    P, Q = simulator.simulate([*base.parameters.nominal, 1.0, vth, Tth, Tc, r0, Tramp]).require_ok().values[0]
    before = base.baseline()[0]
    off, back, whole = 1.0 + Tth, 1.0 + Tth + Tc, 1.0 + Tth + Tc + Tramp
    assert np.array_equal(P[time < off], before[time < off])
    away = (time > off + 0.2) & (time < back - 0.02)
    assert np.abs(P[away]).max() < 2e-3
    assert np.abs(Q[away]).max() < 2e-3
    ramp = (time > back + 0.3) & (time < whole - 0.2)
    # the current regulator lags behind the command by its time constant
    share = r0 + (1 - r0) * (time - base.parameters["Tg"].nominal - back) / Tramp
    current = (P / share)[ramp] / level
    # straight, and to what the slow control had come to: it had half a second for the new voltage
    assert np.ptp(current) < 0.01 * current.mean()
    assert current.mean() == pytest.approx(0.6, rel=0.1)
    assert P[-1] == pytest.approx(0.6, rel=0.01)
