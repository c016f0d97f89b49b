import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.effects.generic import TEMPLATES
from errorscreen.effects.latent_input import KNOTS, PULSE, latent
from errorscreen.events import Event, InputSignal
from errorscreen.exceptions import EngineWarning, InputError, SimulationError
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator
from errorscreen.simulators.ode.effects import _hats
from errorscreen.testing import check_effect, check_simulator
from tests.simulators.models import (
    MODELS,
    TIME,
    loop,
    oscillator,
    oscillator_rhs,
    push,
    tanks,
    tanks_rhs,
)

BUILT = {name: build() for name, build in MODELS.items()}
IN_PYTHON = {name: build(compile=False) for name, build in MODELS.items()}
EFFECTS = [(model, effect.name) for model, built in BUILT.items() for effect in built.effects]
#: every template once at every kind of place
KINDS = {
    (getattr(effect, "template", effect.name), getattr(effect, "acts_on", "")): (model, effect.name)
    for model, built in BUILT.items()
    for effect in built.effects
}


def effects_of(model, effect):
    """Extended model, and parameters with the effect at values inside its bounds."""
    simulator = BUILT[model].extend(effect)
    theta = simulator.parameters.nominal
    if effect.startswith("latent"):
        theta[-KNOTS:] = 0.1 * np.arange(KNOTS) / KNOTS
        theta[-KNOTS - len(PULSE) : -KNOTS] = 0.2, 0.3, 0.1
    return simulator, theta


@pytest.mark.parametrize("model", MODELS)
def test_models_keep_the_contract(model):
    check_simulator(BUILT[model])


@pytest.mark.parametrize(("model", "effect"), EFFECTS)
def test_effects_keep_the_contract(model, effect):
    check_effect(BUILT[model], effect)


@pytest.mark.parametrize(("model", "effect"), KINDS.values(), ids=[" ".join(kind) for kind in KINDS])
def test_python_and_machine_code_agree(model, effect):
    simulator, theta = effects_of(model, effect)
    plain = IN_PYTHON[model].extend(effect)
    # to the last bits of powers and hyperbolic functions
    assert np.allclose(simulator.simulate(theta).values, plain.simulate(theta).values, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("model", "effect"), [p for p in EFFECTS if "relay" not in p[1]])
def test_effects_change_the_response(model, effect):
    simulator, theta = effects_of(model, effect)
    y, plain = simulator.simulate(theta).values[0], BUILT[model].baseline()
    assert np.abs(y - plain).max() > 1e-6 * np.ptp(plain)


def test_an_unknown_signal_is_that_of_the_devices():
    rng = np.random.default_rng(0)
    values = np.r_[rng.uniform(-1.0, 1.0), 0.3, 0.05, rng.uniform(-1.0, 1.0, KNOTS)]
    for t in rng.uniform(0.0, 12.0, 200):
        expected, _ = latent(0.0, t, 1.0, KNOTS**2 / 10.0, 1.0, *values)
        assert _hats(t, 1.0, KNOTS**2 / 10.0, values[None], 0, 0) == pytest.approx(expected, abs=1e-12)


def test_all_templates_are_offered_somewhere():
    offered = {e.template for build in MODELS.values() for e in build().effects if hasattr(e, "template")}
    assert offered == set(TEMPLATES)


def test_what_resists_motion_acts_on_rates_where_the_model_has_any():
    resisting = {"viscous", "drag", "coulomb", "stribeck", "hysteresis"}
    found = {(e.template, e.reads) for e in oscillator().effects if getattr(e, "acts_on", "") == "equation"}
    assert {reads for template, reads in found if template in resisting} == {"velocity"}
    assert {reads for template, reads in found if template == "quadratic"} == {"position", "velocity"}


def test_linear_oscillator_is_exact():
    # piecewise constant input: x(t + h) = e^{A h} x + A^{-1} (e^{A h} - 1) B u
    simulator = oscillator(interpolation="hold", step=0.002)
    A = np.array([[0.0, 1.0], [-4.0, -0.4]])
    F = expm(A * 0.02)
    G = np.linalg.solve(A, (F - np.eye(2)) @ np.array([0.0, 1.0]))
    x, expected = np.zeros(2), []
    for u in simulator.event.signals["force"]:
        expected.append(x[0])
        x = F @ x + G * u
    assert np.allclose(simulator.baseline()[0], expected, atol=1e-10)


def reference(rhs, x0, event, name="force", t_end=None):
    """Output of an adaptive integrator that is restarted at every sample."""
    out, x = [], np.array(x0, dtype=float)
    u = event.signals[name]
    for k, t in enumerate(event.time):
        out.append(x.copy())
        if k + 1 < len(event.time):
            x = solve_ivp(
                rhs, (t, event.time[k + 1]), x, args=(u[k],), rtol=1e-9, atol=1e-11, method="LSODA"
            ).y[:, -1]
    return np.array(out).T


def force_terms(v, x, name, a):
    """Acceleration that each template adds, with the hard equations of the literature."""
    return {
        "viscous": -a[0] * v,
        "quadratic": a[0] * x**2,
        "cubic": a[0] * x**3,
        "drag": -a[0] * abs(v) * v,
        "offset": a[0],
    }[name]


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("velocity.viscous(velocity)", [0.3]),
        ("velocity.quadratic(position)", [0.5]),
        ("velocity.cubic(position)", [-1.5]),
        ("velocity.drag(velocity)", [0.8]),
        ("velocity.offset", [0.7]),
    ],
)
def test_terms_against_an_adaptive_integrator(effect, values):
    simulator = oscillator(interpolation="hold", step=0.005).extend(effect)
    name = effect.split(".")[1].split("(")[0]

    def rhs(t, x, u):
        return [x[1], u - 0.4 * x[1] - 4.0 * x[0] + force_terms(x[1], x[0], name, values)]

    y = simulator.simulate([0.4, 4.0, *values]).values[0, 0]
    assert np.allclose(y, reference(rhs, [0, 0], simulator.event)[0], atol=1e-7)


def test_forcing_is_a_sine_at_a_frequency_in_hertz():
    simulator = oscillator(step=0.005).extend("velocity.forcing")
    quiet = InputSignal(TIME, "quiet", 0.0, {"force": np.zeros(len(TIME))})
    y = simulator.simulate([0.4, 4.0, 0.5, 0.7, 0.3], quiet).values[0, 0]

    def rhs(t, x, u):
        return [x[1], -0.4 * x[1] - 4.0 * x[0] + 0.5 * np.sin(2 * np.pi * 0.7 * t + 0.3)]

    assert np.allclose(y, reference(rhs, [0, 0], quiet)[0], atol=1e-6)


def test_coulomb_friction_stops_the_motion_where_it_should():
    # free oscillation with friction alone: the amplitude falls by 2 F / k each half period until |k x| < F
    simulator = oscillator(
        step=0.00025, initial={"position": 1.0}, effects=None, templates=["coulomb"]
    ).extend("velocity.coulomb(velocity)")
    quiet = InputSignal(np.arange(0, 20, 0.02), "free", 0.0, {"force": np.zeros(1000)})
    F, k = 0.5, 4.0
    theta = np.array([0.1, k, F])
    y = simulator.simulate(theta, quiet).values[0, 0]
    turning = [1.0]
    half = np.exp(-0.1 / 2 * np.pi / np.sqrt(k - 0.05**2))
    while abs(turning[-1]) * k > F:
        centre = np.sign(turning[-1]) * F / k
        turning.append(centre - (turning[-1] - centre) * half)
    found = np.r_[1.0, y[1:-1][np.diff(np.sign(np.diff(y))) != 0]]
    assert np.allclose(found[: len(turning) - 1], turning[:-1], atol=2e-3)
    # it stays where it has stopped
    assert abs(y[-1] - turning[-1]) < 1e-3
    assert np.ptp(y[-400:]) < 1e-9


def test_hysteresis_tends_to_coulomb_friction_for_a_short_way():
    simulator = oscillator(step=0.0005)
    bouc = simulator.extend("velocity.hysteresis(velocity)")
    dry = simulator.extend("velocity.coulomb(velocity)").simulate([0.4, 4.0, 0.5]).values
    ways = (0.1, 0.02, 0.002)
    far, near, nearest = (np.abs(bouc.simulate([0.4, 4.0, 0.5, y]).values - dry).max() for y in ways)
    assert far > 2 * near > 3 * nearest


def test_a_spill_is_conserved():
    # what leaves the upper tank over its brim arrives in the lower one: with r = 1 nothing is lost
    simulator = ODESimulator(
        tanks_rhs, ["upper", "lower"], tanks().parameters, tanks().event, inputs=["flow"],
        outputs=["total", "outflow"], readout=stored_and_outflow, initial={"upper": 1.0, "lower": 1.0},
    )  # fmt: skip
    extended = simulator.extend("upper.overflow_into_lower")
    theta = np.array([0.8, 0.7, 5.0, 1.2, 1.0])
    stored, outflow = extended.simulate(theta).values[0]
    flow = simulator.event.signals["flow"]
    dt = simulator.event.dt
    inflow = np.concatenate([[0.0], np.cumsum(0.5 * (flow[1:] + flow[:-1]) * dt)])
    left = np.concatenate([[0.0], np.cumsum(0.5 * (outflow[1:] + outflow[:-1]) * dt)])
    assert np.allclose(stored - stored[0], inflow - left, atol=2e-2)
    assert not np.allclose(stored, simulator.baseline()[0], atol=1e-2)


def filled(step):
    """The upper tank, filled with 1.5 m/s from a level of 1 m on."""
    time = np.arange(0.0, 20.0, 0.2)
    simulator = ODESimulator(
        tanks_rhs, ["upper", "lower"], tanks().parameters, InputSignal(time, "fill", 0.0, {"flow": 1.5 + 0.0 * time}),
        inputs=["flow"], outputs=["upper"], initial={"upper": 1.0, "lower": 1.0}, step=step,
    )  # fmt: skip
    return simulator.extend("upper.overflow(upper)")


@pytest.mark.parametrize("k", [0.5, 2.0, 30.0, 100.0])
def test_a_level_rests_where_inflow_and_spill_balance_however_fast_it_spills(k):
    level = filled(0.2).simulate([0.8, 0.7, k, 1.2]).values[0, 0]
    balance = brentq(lambda x: 1.5 - 0.8 * np.sqrt(x) - k * (x - 1.2), 1.2, 4.0)
    assert level[-1] == pytest.approx(balance, abs=1e-6)
    # it comes to rest from below, and at once where the spill is steep
    assert level.max() < balance + 1e-6


def test_a_slow_spill_tends_to_its_equation_as_the_step_becomes_short():
    time = filled(0.2).event.time
    expected = solve_ivp(
        lambda t, x: 1.5 - 0.8 * np.sqrt(x) - 2.0 * np.maximum(x - 1.2, 0.0),
        (0.0, time[-1]), [1.0], t_eval=time, rtol=1e-10, atol=1e-12, max_step=0.01,
    ).y[0]  # fmt: skip
    far, near, nearest = (
        np.abs(filled(step).simulate([0.8, 0.7, 2.0, 1.2]).values[0, 0] - expected).max()
        for step in (0.2, 0.05, 0.0125)
    )
    assert far > 2 * near > 4 * nearest
    assert nearest < 2e-3


def test_a_steep_spill_keeps_the_level_at_the_brim():
    """Against a level that is cut off at the brim after each of many short steps."""
    steep = filled(0.05).effects
    most = next(e for e in steep if e.name == "upper.overflow(upper)").strength.upper
    level = filled(0.05).simulate([0.8, 0.7, most, 1.2]).values[0, 0]
    x, h, cut = 1.0, 1e-4, []
    for _ in range(len(level)):
        cut.append(x)
        for _ in range(2000):
            x = min(x + h * (1.5 - 0.8 * np.sqrt(x)), 1.2)
    assert np.abs(level - cut).max() < 0.02
    assert abs(level[-1] - 1.2) < 0.002


def stored_and_outflow(t, x, u, p, y):
    y[0] = x[0] + x[1]
    y[1] = p[1] * max(x[1], 0.0) ** 0.5


def integrating_rhs(t, x, u, p, dx):
    dx[0] = p[0] * u[0]


def integrator(event, outputs_of="u", **options):
    """A model whose output is its input, so that what happens to the input is seen directly, or its integral."""
    return ODESimulator(
        integrating_rhs,
        ["x"],
        [Parameter("a", 1.0, 0.5, 2.0)],
        event,
        inputs=["u"],
        outputs=[outputs_of],
        **options,
    )


RAMPS = InputSignal(TIME, "ramps", 0.0, {"u": np.interp(TIME, [0, 2, 4, 7, 10], [0, 2, 2, -1, 1])})


def passed(effect, *values, event=RAMPS, step=0.02):
    return integrator(event, step=step).extend(effect).simulate([1.0, *values], event).values[0, 0]


def test_delay_shifts_and_holds_the_first_value():
    u, y = RAMPS.signals["u"], passed("u.delay", 0.33)
    assert np.allclose(y, np.interp(TIME - 0.33, TIME, u), atol=1e-12)


@given(st.floats(0.001, 1.5))
@settings(max_examples=20)
def test_delay_is_linear_between_steps(d):
    u = np.sin(TIME)
    event = InputSignal(TIME, "sine", 0.0, {"u": u})
    assert np.allclose(passed("u.delay", d, event=event), np.interp(TIME - d, TIME, u), atol=1e-12)


@pytest.mark.parametrize("T", [0.01, 0.2, 3.0])
def test_lag_of_a_ramp_is_exact(T):
    event = InputSignal(TIME, "ramp", 0.0, {"u": 0.5 * TIME})
    assert np.allclose(
        passed("u.lag", T, event=event), 0.5 * (TIME - T * (1 - np.exp(-TIME / T))), atol=1e-12
    )


def test_rate_limit_holds_and_catches_up():
    y = passed("u.rate_limit", 2.0)  # at most 0.5 per second
    assert np.abs(np.diff(y)).max() <= 0.5 * 0.02 + 1e-12
    assert np.allclose(y[:100], 0.5 * TIME[:100], atol=1e-9)


def test_backlash_follows_behind_its_play():
    u, y = RAMPS.signals["u"], passed("u.backlash", 0.3)
    expected, w = [], u[0]
    for v in u:
        w = min(max(w, v - 0.3), v + 0.3)
        expected.append(w)
    assert np.allclose(y, expected, atol=1e-12)


def test_dead_band_and_saturation():
    u = RAMPS.signals["u"]
    assert np.allclose(passed("u.dead_band", 0.4, 0.5), u - np.clip(u - 0.5, -0.4, 0.4))
    assert np.allclose(passed("u.saturation", 1.0, -0.5, 1.2), np.clip(u, -0.5, 1.2))
    assert np.allclose(passed("u.saturation", 0.5, -0.5, 1.2), 0.5 * (u + np.clip(u, -0.5, 1.2)))


def test_relay_trips_after_its_timer_and_comes_back():
    u = RAMPS.signals["u"]
    y = passed("u.relay_above(u)", 1.0, 1.0, 0.7)
    # above 1 from 1 s to 5 s: off from 1.7 s on
    off = (TIME > 1.7 + 0.03) & (TIME < 5.0 - 0.03)
    assert np.allclose(y[off], 0.0)
    on = (TIME < 1.7 - 0.03) | (TIME > 5.0 + 0.03)
    assert np.allclose(y[on], u[on])
    below = passed("u.relay_below(u)", 1.0, -0.5, 0.2)
    assert np.allclose(below[(TIME > 6.75) & (TIME < 7.7)], 0.0)


def test_effects_act_one_after_the_other():
    # the dead band sees what the delay lets through
    y = integrator(RAMPS).extend("u.delay").extend("u.dead_band").simulate([1.0, 0.2, 0.3, 0.0]).values[0, 0]
    u = np.interp(TIME - 0.2, TIME, RAMPS.signals["u"])
    assert np.allclose(y, u - np.clip(u, -0.3, 0.3), atol=1e-12)


def test_effects_on_a_signal_close_the_loop():
    # a saturated valve cannot push harder: the level rises with at most b times the limit
    simulator = loop().extend("valve.saturation")
    y = simulator.simulate([1.0, 0.2, 2.0, 1.0, 1.0, -0.05, 0.05]).values[0, 0]
    assert np.abs(np.diff(y) / 0.02).max() <= 0.05 + 0.2 * np.abs(y).max() + 1e-9
    assert np.abs(np.diff(loop().baseline()[0]) / 0.02).max() > 0.2


@pytest.mark.parametrize("interpolation", ["linear", "hold", "cubic", "bandlimited"])
def test_interpolations_keep_the_samples(interpolation):
    u = np.sin(2 * np.pi * 0.8 * TIME)
    event = InputSignal(TIME, "sine", 0.0, {"u": u})
    y = integrator(event, interpolation=interpolation, step=0.005).baseline(event)[0]
    assert np.allclose(y, u, atol=1e-3 if interpolation == "bandlimited" else 1e-12)


def test_bandlimited_interpolation_beats_linear_near_the_sampling_rate():
    fine = np.arange(0, 10, 0.002)
    wave = np.sin(2 * np.pi * 8.0 * fine) + 0.5 * np.cos(2 * np.pi * 13.0 * fine + 1)
    coarse = InputSignal(fine[::10], "fast", 0.0, {"u": wave[::10]})
    errors = {}
    for kind in ("linear", "bandlimited"):
        model = integrator(coarse, interpolation=kind, step=0.002, effects=())
        model = copy.copy(model)
        every = InputSignal(coarse.time, "fast", 0.0, coarse.signals)
        inputs = model._injected(every, 10)[:, 0, 0]
        errors[kind] = np.sqrt(np.mean((inputs - wave[: len(inputs)])[500:-500] ** 2))
    assert errors["bandlimited"] < 0.02 * errors["linear"]


def test_results_do_not_depend_on_threads():
    theta = np.random.default_rng(0).uniform([0.1, 1.0], [2.0, 9.0], (50, 2))
    one, two = oscillator(n_threads=1).simulate(theta), oscillator(n_threads=2).simulate(theta)
    assert np.array_equal(one.values, two.values)


def test_pickles_and_copies_simulate_the_same():
    simulator = oscillator().extend("velocity.cubic(position)")
    theta = [0.4, 4.0, -0.3]
    expected = simulator.simulate(theta).values
    for twin in (pickle.loads(pickle.dumps(simulator)), copy.copy(simulator), copy.deepcopy(simulator)):
        assert np.array_equal(twin.simulate(theta).values, expected)


def test_extending_compiles_nothing():
    simulator = oscillator()
    for effect in simulator.effects[:5]:
        extended = simulator.extend(effect)
        extended.baseline()
        assert extended._pointers is simulator._pointers


def recorded(event, y, name="record", noise=0.01, seed=0):
    measured = y + noise * np.random.default_rng(seed).standard_normal(len(y))
    values = {"force": event.signals["force"], "position": measured}
    return Recording.from_signals(event.time, values, name=name, noise={"position": noise})


def test_initial_states_are_fitted_for_each_recording_by_itself():
    events = [push("first", 1), push("second", 2)]
    truth = oscillator(events[0], initial={"position": 0.7, "velocity": -1.0})
    recordings = [recorded(e, truth.baseline(e)[0], e.name) for e in events]
    model = oscillator(recordings, initial={"position": "measured", "velocity": Parameter("v0", 0.1, -3, 3)})
    assert model.parameters.names[2:] == (
        "position(0) of first", "velocity(0) of first", "position(0) of second", "velocity(0) of second",
    )  # fmt: skip
    theta = [0.4, 4.0, 0.7, -1.0, 0.7, -1.0]
    for event, recording in zip(events, recordings, strict=True):
        observation = model.observe(recording)
        expected = truth.baseline(event)
        assert np.allclose(model.simulate(theta, observation.event).values[0], expected, atol=1e-12)


def test_a_recording_that_is_not_fitted_gets_its_own_start():
    event = push("other", 3)
    y = oscillator(event, initial={"position": 0.7, "velocity": -1.0}).baseline()[0]
    model = oscillator(push(), initial={"position": 0.0, "velocity": Parameter("v0", 0.1, -3, 3)})
    observation = model.observe(recorded(event, y, "other"))
    assert observation.event.initial == {"velocity": 0.1}
    settled = model.fit_initial_state(observation)
    before, after = (
        np.sqrt(np.mean((model.simulate(model.parameters.nominal, o.event).values[0] - o.values) ** 2))
        for o in (observation, settled)
    )
    assert after < before
    assert model.fit_initial_state(settled).event.initial["velocity"] == pytest.approx(
        settled.event.initial["velocity"], abs=1e-3
    )


def test_irregular_readings_are_compared_where_they_are():
    rng = np.random.default_rng(5)
    keep = np.sort(rng.choice(len(TIME), 400, replace=False))
    simulator = oscillator()
    y = simulator.baseline()[0]
    jitter = TIME[keep] + rng.uniform(-0.003, 0.003, len(keep))
    columns = {"force": simulator.event.signals["force"], "position": y}
    values = {name: np.interp(jitter, TIME, column) for name, column in columns.items()}
    recording = Recording.from_signals(jitter, values, name="irregular", noise={"position": 0.01})
    observation = simulator.observe(recording)
    assert 390 <= observation.mask.sum() <= 400
    assert any("irregular" in text for text in observation.assumptions)
    at = observation.time[observation.mask[0]]
    assert np.allclose(observation.values[0][observation.mask[0]], np.interp(at, TIME, y), atol=0.05)


def test_python_runs_where_numba_cannot_and_says_why():
    table = {"k": 4.0}

    def rhs(t, x, u, p, dx):
        dx[0] = x[1]
        dx[1] = u[0] - p[0] * x[1] - table["k"] * x[0]

    with pytest.warns(EngineWarning, match="rhs of the model cannot be compiled"):
        slow = ODESimulator(
            rhs,
            ["position", "velocity"],
            [Parameter("c", 0.4, 0.1, 2.0)],
            push(),
            inputs=["force"],
            outputs=["position"],
        )
    assert np.array_equal(slow.baseline(), oscillator().baseline())


def broken(kind):
    def short(t, x, u, p, dx):
        dx[0] = x[1]

    def beyond(t, x, u, p, dx):
        dx[0], dx[1] = x[1], x[2]

    def writes(t, x, u, p, dx):
        x[0] = 0.5
        dx[0], dx[1] = 0.0, 0.0

    def few(t, x, dx):
        dx[0] = dx[1] = 0.0

    def divides(t, x, u, p, dx):
        dx[0], dx[1] = x[1], 1.0 / float(x[0])

    return {"short": short, "beyond": beyond, "writes": writes, "few": few, "divides": divides, "none": None}[
        kind
    ]


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("short", "leaves dx of velocity unset"),
        ("beyond", "IndexError"),
        ("writes", "rhs changes x"),
        ("few", "takes 3 arguments"),
        ("divides", "ZeroDivisionError"),
        ("none", "rhs is a NoneType"),
    ],
)
def test_mistakes_in_functions_are_named(kind, text):
    with pytest.raises(InputError, match=text):
        ODESimulator(
            broken(kind), ["position", "velocity"], [Parameter("c", 0.4, 0.1, 2.0)], push(), inputs=["force"],
            outputs=["position"],
        )  # fmt: skip


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"outputs": ["speed"]}, "unknown output 'speed'"),
        ({"outputs": "position"}, "outputs is the text"),
        ({"states": ["position", "force"]}, "same name"),
        ({"inputs": ["torque"]}, "unknown input 'torque'"),
        ({"interpolation": "spline"}, "unknown interpolation"),
        ({"signals": ["v"]}, "signals and law"),
        ({"initial": {"speed": 1.0}}, "unknown state 'speed'"),
        ({"initial": {"velocity": "measured"}}, "is no output"),
        ({"initial": {"position": "guess"}}, "'guess'"),
        ({"initial": {"position": "measured"}}, "no reading of it at the beginning"),
        ({"step": 0.0}, "the step"),
        ({"recordings": []}, "empty"),
        (
            {"recordings": [push(), push()], "initial": {"position": Parameter("x", 0.1, -1, 1)}},
            "two recordings",
        ),
        ({"recordings": Event(TIME)}, "not a recording"),
        ({"parameters": []}, "nothing to fit"),
        ({"templates": ["coulom"]}, "did you mean 'coulomb'"),
        ({"constants": {"g": np.nan}}, "constant g"),
    ],
)
def test_absurd_models_are_refused(options, text):
    arguments = {
        "states": ["position", "velocity"],
        "parameters": [Parameter("c", 0.4, 0.1, 2.0), Parameter("k", 4.0, 1.0, 9.0)],
        "recordings": push(),
        "inputs": ["force"],
        "outputs": ["position"],
    } | options
    with pytest.raises(InputError, match=text):
        ODESimulator(oscillator_rhs, **arguments)


def test_a_model_that_diverges_is_refused():
    def rhs(t, x, u, p, dx):
        dx[0] = x[0] ** 2 + p[0]

    with pytest.raises(SimulationError, match="diverges at its nominal parameters"):
        ODESimulator(rhs, ["x"], [Parameter("a", 1.0, 0.5, 2.0)], InputSignal(TIME, "blow-up"), outputs=["x"])


def test_recordings_that_do_not_fit_are_refused():
    model = oscillator(push())
    t = np.arange(0, 1, 0.02)
    good = {"force": np.ones(50), "position": np.zeros(50)}
    for values, units, text in (
        ({"position": good["position"]}, {}, "input 'force' was not recorded"),
        ({"force": good["force"]}, {}, "none of the outputs"),
        (good, {"position": "cm"}, "is in 'cm'"),
        ({**good, "force": np.where((t > 0.3) & (t < 0.6), np.nan, 1.0)}, {}, "has a gap"),
    ):
        with pytest.raises(InputError, match=text):
            model.observe(Recording.from_signals(t, values, units=units, noise=dict.fromkeys(values, 0.1)))


def test_events_without_a_start_are_refused():
    model = oscillator(push("a"), initial={"velocity": Parameter("v0", 0.1, -3, 3)})
    with pytest.raises(InputError, match="initial state 'velocity' is unknown"):
        model.simulate(model.parameters.nominal, push("b"))


def test_kinematic_equations_lack_nothing():
    places = {e.target for e in oscillator().effects if getattr(e, "acts_on", "") == "equation"}
    assert places == {"velocity"}


def test_gaps_in_an_output_are_not_compared():
    model = oscillator(push())
    y = np.where((TIME > 2) & (TIME < 4), np.nan, model.baseline()[0])
    observation = model.observe(recorded(model.event, y))
    assert isinstance(observation, Observation)
    assert np.array_equal(observation.mask[0], np.isfinite(y))


def test_ranges_of_effects_hold_every_recording():
    events = [push("small", 1, 0.1), push("large", 2, 3.0), push("middle", 3)]
    truth = oscillator(events[0])
    recordings = [recorded(e, truth.baseline(e)[0], e.name) for e in events]
    limit = next(
        p for e in oscillator(recordings).effects if e.name == "saturation_position" for p in e.parameters[2:]
    )
    assert limit.upper > truth.baseline(events[1]).max()


def from_the_end_rhs(t, x, u, p, dx):
    dx[-2] = x[-1]
    dx[-1] = u[-1] - p[0] * x[-1] - p[1] * x[-2]


def test_functions_see_their_own_states_only():
    # a hysteresis has a state of its own, behind the model's
    simulator = ODESimulator(
        from_the_end_rhs, ["position", "velocity"], oscillator().parameters, push(), inputs=["force"],
        outputs=["position"],
    )  # fmt: skip
    assert np.array_equal(simulator.baseline(), BUILT["oscillator"].baseline())
    check_effect(simulator, "velocity.hysteresis(velocity)")
    theta = [0.4, 4.0, 0.3, 0.1]
    same = BUILT["oscillator"].extend("velocity.hysteresis(velocity)").simulate(theta).values
    assert np.array_equal(simulator.extend("velocity.hysteresis(velocity)").simulate(theta).values, same)


def later_beyond(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - p[1] * x[0]
    if t > 5.0:
        dx[1] += p[7]


def later_raises(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - p[1] * x[0]
    if x[0] > 0.5 and p[1] < 3.0:
        raise ValueError("too far")


def overflows(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - p[1] * x[0] + 1e-9 * np.exp(100.0 * x[0])


def arguments():
    return ["position", "velocity"], oscillator().parameters, push()


NAMED = {"inputs": ["force"], "outputs": ["position"]}


def test_indices_that_do_not_exist_never_reach_foreign_memory():
    with pytest.raises(SimulationError, match="diverges at its nominal parameters"):
        ODESimulator(later_beyond, *arguments(), **NAMED)


@pytest.mark.parametrize("compile", [True, False])
def test_errors_inside_functions_are_data(compile):
    simulator = ODESimulator(later_raises, *arguments(), **NAMED, compile=compile, effects=())
    responses = simulator.simulate([[0.4, 4.0], [0.2, 1.5], [0.4, 4.0]])
    assert responses.ok.tolist() == [True, False, True]
    assert np.array_equal(responses.values[0], responses.values[2])


def log_level_rhs(t, x, u, p, dx):
    dx[0] = u[0] - p[0] * np.sqrt(x[0])


def test_a_model_that_is_not_defined_below_zero_is_accepted():
    event = InputSignal(TIME, "fill", 0.0, {"flow": 0.3 + 0.2 * np.sin(TIME)})
    level = np.abs(np.random.default_rng(0).normal(0.4, 0.3, len(TIME))) - 0.2
    recording = Recording.from_signals(TIME, {**event.signals, "level": level}, noise={"level": 0.3})
    model = ODESimulator(
        log_level_rhs, ["level"], [Parameter("a", 0.5, 0.2, 1.0)], recording, inputs=["flow"], outputs=["level"],
        initial={"level": 0.4},
    )  # fmt: skip
    check_simulator(model)


def test_a_start_at_the_far_end_of_its_range_is_found():
    far = Parameter("x0", 1.0, 0.0, 10.0)
    model = oscillator(push("fitted"), initial={"position": far})
    y = oscillator(push("unseen", 5), initial={"position": 9.0}).baseline()[0]
    settled = model.fit_initial_state(model.observe(recorded(push("unseen", 5), y, "unseen")))
    assert settled.event.initial["position"] == pytest.approx(9.0, abs=0.1)


def test_a_measured_start_needs_a_reading():
    event = push("gap")
    y = np.where(TIME < 1.0, np.nan, 1.0)
    with pytest.raises(InputError, match="no reading of it at the beginning"):
        oscillator(recorded(event, y, "gap"), initial={"position": "measured"})


def test_settings_tell_models_apart():
    def build(factor):
        def rhs(t, x, u, p, dx):
            dx[0] = -factor * p[0] * x[0]

        return ODESimulator(
            rhs, ["x"], [Parameter("a", 1.0, 0.5, 2.0)], InputSignal(TIME, "free"), outputs=["x"],
            initial={"x": 1.0}, effects=(),
        )  # fmt: skip

    assert build(2.0).settings() == build(2.0).settings()
    assert build(2.0).settings() != build(3.0).settings()


HELD = InputSignal(TIME, "held", 0.0, {"u": 1.0 * (TIME >= 1.0) - 2.0 * (TIME >= 4.0)})


@pytest.mark.parametrize("step", [0.02, 0.005])
def test_what_is_held_is_held_behind_lags_and_delays_too(step):
    model = integrator(HELD, interpolation="hold", step=step, outputs_of="x")
    plain = model.baseline(HELD)[0]
    delayed = model.extend("u.delay").simulate([1.0, 0.2], HELD).values[0, 0]
    assert np.allclose(delayed[10:], plain[:-10], atol=1e-9)
    T = 0.3
    lagged = (
        integrator(HELD, interpolation="hold", step=step)
        .extend("u.lag")
        .simulate([1.0, T], HELD)
        .values[0, 0]
    )
    t = TIME
    exact = np.where(t < 1, 0, 1 - np.exp(-(t - 1) / T))
    exact = np.where(t < 4, exact, -1 + (2 - np.exp(-3 / T)) * np.exp(-(t - 4) / T))
    assert np.allclose(lagged[1:], exact[1:], atol=1e-9)


@given(st.floats(0.9, 1.1))
@settings(max_examples=20)
def test_a_relay_counts_from_the_instant_and_not_from_the_step(theta):
    # the ramp reaches theta at theta seconds, between two steps
    ramp = InputSignal(TIME, "ramp", 0.0, {"u": TIME.copy()})
    model = integrator(ramp, outputs_of="x").extend("u.relay_above(u)")
    x = model.simulate([1.0, 1.0, theta, 0.5], ramp).values[0, 0]
    assert x[-1] == pytest.approx(0.5 * (theta + 0.5) ** 2, abs=2e-4)


@pytest.mark.parametrize("effect", ["backlash_position", "rate_limit_position"])
def test_another_effect_at_strength_zero_changes_nothing(effect):
    simulator = oscillator(step=0.005).extend(effect)
    theta = simulator.parameters.nominal
    expected = simulator.simulate(theta).values
    assert np.array_equal(simulator.extend("skew_position").simulate([*theta, 0.0]).values, expected)


def test_the_order_of_effects_does_not_matter_to_friction():
    names = ("velocity.coulomb(velocity)", "velocity.offset")
    one, two = (oscillator().extend(a).extend(b) for a, b in (names, names[::-1]))
    y, z = one.simulate([0.4, 4.0, 1.0, 0.8]).values, two.simulate([0.4, 4.0, 0.8, 1.0]).values
    assert np.allclose(y, z, atol=1e-12)


def test_a_readout_needs_names_of_its_own():
    with pytest.raises(InputError, match="the outputs position have the names of states"):
        ODESimulator(oscillator_rhs, *arguments(), **NAMED, readout=lambda t, x, u, p, y: None)
