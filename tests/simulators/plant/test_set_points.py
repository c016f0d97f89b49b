"""Steps of set-points, of stated and of unknown size."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import errorscreen as es
from errorscreen.data.recordings import Recording
from errorscreen.events import Playback, SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.models.set_points import with_steps
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator

F0 = 60.0
VALUES = {
    "GENSAL": {
        "Tpdo": 5.0, "Tppdo": 0.05, "Tppqo": 0.08, "H": 4.0, "D": 1.0, "Xd": 1.1, "Xq": 0.7, "Xpd": 0.3, "Xpp": 0.2,
        "Xl": 0.12, "S10": 0.0, "S12": 0.0,
    },
    "SEXS": {"TA_TB": 0.2, "TB": 2.0, "K": 40.0, "TE": 0.05, "EMIN": -5.0, "EMAX": 8.0},
    "TGOV1": {"R": 0.05, "T1": 0.2, "VMAX": 1.2, "VMIN": 0.0, "T2": 0.5, "T3": 2.0, "Dt": 0.0},
}  # fmt: skip
P0, Q0 = 0.7, 0.1


def of(*names, **changes):
    return unit([Record(PARTS[n], {**VALUES.get(n, {}), **changes.get(n, {})}) for n in names])


def event(*steps, until=4.0, dt=0.01, P=P0, Q=Q0):
    time = np.arange(0.0, until, dt)
    signals = {"V": np.ones(len(time)), "angle": np.zeros(len(time))}
    return Playback(time, "step test", 0.5, signals, {"V": 1.0, "P": P, "Q": Q}, steps=steps)


def stepped(device, *steps, **options):
    played = event(*steps, **options)
    return played.time, PlantSimulator(device, played, effects=(), constants={"f0": F0}).baseline()


def reference(time, steps):
    """GENSAL, SEXS and TGOV1 at an infinite bus, with phasors, by an adaptive method that stops at each step."""
    m, e, g = VALUES["GENSAL"], VALUES["SEXS"], VALUES["TGOV1"]
    current, mutual = P0 - 1j * Q0, m["Xpd"] - m["Xl"]
    delta = cmath.phase(1 + 1j * m["Xq"] * current)
    i, v = (z * cmath.exp(1j * (math.pi / 2 - delta)) for z in (current, 1.0))
    eq = v.imag + m["Xpd"] * i.real
    Efd = eq + (m["Xd"] - m["Xpd"]) * i.real

    def machine(x):
        delta, _, eq, kd, psi2q = x[:5]
        v = cmath.exp(1j * (math.pi / 2 - delta))
        psi2d = (eq * (m["Xpp"] - m["Xl"]) + kd * (m["Xpd"] - m["Xpp"])) / mutual
        return v, (complex(psi2q, psi2d) - v) / (1j * m["Xpp"])

    def slope(t, x, moved):
        _, w, eq, kd, psi2q, lead, field, gate, heat = x
        v, i = machine(x)
        towards = eq - kd - mutual * i.real
        demand = eq + (m["Xd"] - m["Xpd"]) * (i.real + (m["Xpd"] - m["Xpp"]) / mutual**2 * towards)
        error = Efd / e["K"] + moved["Vref"]
        out = lead + e["TA_TB"] * (error - lead)
        Pm = heat + g["T2"] / g["T3"] * (gate - heat)
        return [
            2 * math.pi * F0 * (w - 1),
            ((Pm - m["D"] * (w - 1)) / w - (v * i.conjugate()).real) / (2 * m["H"]),
            (field - demand) / m["Tpdo"],
            towards / m["Tppdo"],
            ((m["Xq"] - m["Xpp"]) * i.imag - psi2q) / m["Tppqo"],
            (error - lead) / e["TB"],
            (e["K"] * out - field) / e["TE"],
            (P0 + moved["Pref"] - (w - 1 - moved["Fref"]) / g["R"] - gate) / g["T1"],
            (gate - heat) / g["T3"],
        ]

    x = [delta, 1.0, eq, eq - mutual * i.real, (m["Xq"] - m["Xpp"]) * i.imag, Efd / e["K"], Efd, P0, P0]
    moved, powers, begin = {"Vref": 0.0, "Pref": 0.0, "Fref": 0.0}, np.empty((2, len(time))), 0.0
    for step in (*sorted(steps, key=lambda step: step.time), SetPointStep("Vref", float(time[-1]) + 1e-9)):
        rows = (time >= begin) & (time < step.time)
        run = solve_ivp(
            slope,
            (begin, step.time),
            x,
            "LSODA",
            [*time[rows], step.time],
            args=(moved,),
            rtol=1e-10,
            atol=1e-12,
        )
        S = [v * i.conjugate() for v, i in map(machine, run.y.T)]
        powers[:, rows] = np.array([[s.real, s.imag] for s in S])[:-1].T
        x, begin = run.y[:, -1], step.time
        moved = {**moved, step.quantity: moved[step.quantity] + (step.size or 0.0)}
    return powers


def test_steps_at_any_instant_agree_with_a_second_method():
    steps = (
        SetPointStep("Vref", 0.5037, 0.02),
        SetPointStep("Pref", 1.0, -0.1),
        SetPointStep("Fref", 1.5, 0.01),
        SetPointStep("Vref", 2.0, -0.03),
    )
    time, found = stepped(of("GENSAL", "SEXS", "TGOV1"), *steps)
    expected = reference(time, steps)
    assert np.ptp(expected, axis=1).min() > 0.05
    assert abs(found - expected).max() < 2e-6


def test_without_steps_the_model_stays_as_it_was():
    device = of("GENSAL", "SEXS")
    assert with_steps(device, ()) is device
    _, found = stepped(device)
    assert abs(found - [[P0], [Q0]]).max() < 1e-9


@pytest.mark.parametrize(
    ("governor", "gain"),
    [("HYGOV", PARTS["HYGOV"].typical["At"]), ("GGOV1", 1.0), ("IEEEG1", 1.0)],
)
def test_a_step_of_active_power_has_the_same_size_for_all_governors(governor, gain):
    device = of("GENSAL", governor, GENSAL={"D": 2.0}, HYGOV={"Tr": 1.0})
    _, (P, _) = stepped(device, SetPointStep("Pref", 1.0, 0.05), until=100.0, dt=0.05)
    assert P[-1] - P0 == pytest.approx(0.05 * gain, abs=0.002)


@pytest.mark.parametrize(
    ("governor", "gain", "changes"),
    [
        ("TGOV1", 1 / 0.05, {}),
        ("GAST", 1 / 0.04, {"R": 0.04}),
        ("HYGOV", 1 / 0.04, {"R": 0.04}),
        ("GGOV1", 1 / 0.04, {"R": 0.04}),
        ("IEEEG1", 25.0, {"K": 25.0, "T1": 0.0, "T2": 0.0}),
        ("IEESGO", 25.0, {"K1": 25.0, "T1": 0.0, "T2": 0.0, "T3": 0.0}),
    ],
)
def test_a_step_of_frequency_is_one_of_power_over_the_droop(governor, gain, changes):
    """Without a lag of the governor the courses agree; both steps of one set-point add up."""
    s, at, of_power = 0.004, 0.62, 0.02
    steps = {
        "Fref": [SetPointStep("Fref", at, s), SetPointStep("Pref", at, of_power)],
        "Pref": [SetPointStep("Pref", at, gain * s + of_power)],
    }
    device = with_steps(of("GENSAL", governor, **{governor: changes}), steps["Fref"])
    short = {name: event(*some, until=1.2, dt=0.02) for name, some in steps.items()}
    plant = PlantSimulator(device, short["Fref"], effects=(), constants={"f0": F0}, engine="numpy", step=0.02)
    one, other = (plant.baseline(short[name]) for name in steps)
    assert abs(one - other).max() < 1e-12
    assert np.ptp(one[0]) > 1e-3


@pytest.mark.parametrize("s", [0.004, -0.004])
def test_a_plant_controller_answers_to_a_step_of_frequency_by_its_droop(s):
    values = {
        "Fflag": 1, "fdbd1": -0.001, "fdbd2": 0.0005, "Dup": 15.0, "Ddn": 30.0, "Kpg": 0.5, "Kig": 8.0, "Tp": 0.05,
        "Tg": 0.02,
    }  # fmt: skip
    device = of("REGCA1", "REECB1", "REPCA1", REPCA1=values, REGCA1={"Tg": 0.02}, REECB1={"Tpord": 0.02})
    stepped = event(SetPointStep("Fref", 0.6, s), until=3.0, dt=0.02, P=0.6)
    plant = PlantSimulator(device, stepped, effects=(), constants={"f0": F0}, engine="numpy", step=0.01)
    expected = 15.0 * (s - 0.0005) if s > 0 else 30.0 * (s + 0.001)
    assert plant.baseline()[0, -1] - 0.6 == pytest.approx(expected, abs=2e-4)


def test_references_of_a_converter_step_in_front_of_their_control():
    changes = {"REGCA1": {"Tg": 0.02}, "REECB1": {"Tpord": 0.05}}
    device = of("REGCA1", "REECB1", **changes)
    s, T1, T2 = 0.05, 0.05, 0.02
    time, (P, _) = stepped(device, SetPointStep("Pref", 1.0, s), P=0.6)
    t = np.maximum(time - 1.0, 0.0)
    expected = 0.6 + s * (1 - (T1 * np.exp(-t / T1) - T2 * np.exp(-t / T2)) / (T1 - T2))
    away = abs(time - 1.0) > 1e-9
    assert abs(P - expected)[away].max() < 1e-4


def test_set_points_follow_from_parts_and_flags():
    def names(*parts, **changes):
        return {*of(*parts, **changes).set_points}

    assert names("GENSAL", "SEXS", "TGOV1") == {"Vref", "Pref", "Fref"}
    assert names("GENSAL") == set()
    assert names("REGCA1", "REECB1") == {"Pref", "Qext"}
    assert names("REGCA1", "REECB1", "REPCA1", REPCA1={"RefFlag": 1, "Fflag": 1}) == {"Vref", "Pref", "Fref"}
    assert names("REGCA1", "REECB1", "REPCA1", REPCA1={"RefFlag": 0}) == {"Qref", "Pref"}
    driven = unit([Record(PARTS[n], {}) for n in ("GENROU", "SEXS", "TGOV1")], inputs=["Efd"])
    assert {*driven.set_points} == {"Pref", "Fref"}


def test_a_plant_controller_brings_the_regulated_quantity_to_its_reference():
    device = of("REGCA1", "REECB1", "REPCA1", REPCA1={"RefFlag": 0, "dbd1": 0.0, "dbd2": 0.0, "Ki": 5.0})
    _, (_, Q) = stepped(device, SetPointStep("Qref", 1.0, 0.05), P=0.6, until=20.0)
    assert Q[-1] - Q0 == pytest.approx(0.05, abs=1e-3)


def recording(size, *steps):
    """A step test of the unit, with a step that is known from the code above."""
    true = event(SetPointStep("Vref", 1.0, size))
    P, Q = reference(true.time, true.steps)
    rng = np.random.default_rng(0)
    values = {**true.signals, "P": P, "Q": Q}
    values = {name: array + rng.normal(0, 2e-4, len(array)) for name, array in values.items()}
    found = Recording.from_arrays(true.time, values, base_mva=100.0, f_nominal=F0, event_time=1.0)
    return replace(found, steps=steps)


def test_a_size_that_is_not_stated_is_found():
    measured = recording(0.02, SetPointStep("Vref", 1.0))
    plant = PlantSimulator(of("GENSAL", "SEXS", "TGOV1"), measured, effects=())
    size = plant.parameters["Vref.step"]
    assert (size.nominal, size.lower, size.upper) == (0.0, -0.1, 0.1)
    fit = es.calibrate(plant, measured, parameters=["Vref.step"], n_starts=1)
    assert fit.values_["Vref.step"] == pytest.approx(0.02, abs=2e-4)
    assert any("a size that is to be found" in note for note in plant.observe(measured).assumptions)
    other = recording(0.03, SetPointStep("Vref", 1.0, 0.03))  # stated sizes and sought ones side by side
    seen = plant.observe(other)
    assert abs(plant.baseline(seen.event) - seen.values).max() < 0.02


def test_a_step_that_cannot_be_is_refused():
    device = of("GENSAL", "SEXS")
    for step, words in (
        (SetPointStep("Pref", 1.0, 0.1), "has no set-point Pref.*Allowed: Vref"),
        (SetPointStep("Vref", 0.4, 0.1), "behind the quiet part"),
        (SetPointStep("Vref", 40.0, 0.1), "behind the quiet part"),
    ):
        with pytest.raises(InputError, match=words):
            PlantSimulator(device, recording(0.02, step), effects=())
    with pytest.raises(InputError, match="has no set-point Vref"):
        PlantSimulator("synchronous_machine", event(SetPointStep("Vref", 1.0, 0.1)))
    plant = PlantSimulator(device, event(SetPointStep("Vref", 1.0, 0.01)), effects=())
    for step in (SetPointStep("Vref", 1.0), SetPointStep("Pref", 1.0, 0.1)):
        with pytest.raises(InputError, match="built without such a step"):
            plant.simulate(plant.parameters.nominal, event(step))
    with pytest.raises(InputError, match="the size is 0"):
        SetPointStep("Vref", 1.0, 0.0)
