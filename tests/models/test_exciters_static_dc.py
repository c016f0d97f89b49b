"""Static and DC exciters: records of another program, transfer functions, and clamped steps through a deep dip.

All exciters run side by side without a machine, driven by given quantities of the terminal, so that one compilation
serves all.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from errorscreen.bench.reference_models import play
from errorscreen.engine.kernels import new_engine
from errorscreen.engine.stages import Call, Model
from errorscreen.models.exciters import EXCITERS
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import SHORTEST, Record, unit

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "openipsl_smib"
NAMES = ("SCRX", "IEEET1", "ESST1A", "ESST4B", "EXST1", "ESDC1A", "ESDC2A", "ST5B", "EXPIC1")
BANK = [part for part in EXCITERS if part.name in NAMES]
INPUTS = ("Vc", "Vs", "V", "Vd", "Vq", "Id", "Iq", "If", "VUEL", "VOEL")
AT_REST = {"Vc": 1.02, "Vs": 0.0, "V": 1.0, "Vd": 0.5, "Vq": np.sqrt(0.75), "Id": 0.6, "Iq": 0.5, "If": 2.0}
AT_REST |= {"VUEL": 0.0, "VOEL": 0.0, "UELgate": -1e9, "OELgate": 1e9}
DC = {
    "TR": 0.02,
    "KA": 60,
    "TA": 0.05,
    "KE": 1.0,
    "TE": 0.6,
    "KF": 0.06,
    "E1": 1.5,
    "S1": 0.05,
    "E2": 3.0,
    "S2": 0.4,
}
LEAD = {"TC": 1.0, "TB": 6.0}
RECORDS = {
    "SCRX": {"TA_TB": 0.2, "TB": 5.0, "K": 120, "TE": 0.05, "EMIN": -4, "EMAX": 6},
    "IEEET1": {**DC, "TF": 0.9, "VRMAX": 5, "VRMIN": -4},
    "ESST1A": {
        "TR": 0.02, **LEAD, "TC1": 0.1, "TB1": 0.3, "KA": 150, "TA": 0.05, "KF": 0.02, "TF": 0.8, "KC": 0.15,
        "KLR": 0.5, "ILR": 1.5, "VIMAX": 0.2, "VIMIN": -0.2, "VAMAX": 9, "VAMIN": -7,
    },
    "ESST4B": {
        "KPR": 4.0, "KIR": 3.0, "TA": 0.03, "KPM": 0.7, "KIM": 1.5, "KG": 0.15, "KP": 5.0, "KI": 1.0, "KC": 0.2,
        "XL": 0.1, "THETAP": 20.0,
    },
    "EXST1": {"TR": 0.02, **LEAD, "KA": 150, "TA": 0.05, "KF": 0.02, "TF": 0.8, "KC": 0.15},
    "ESDC1A": {**DC, **LEAD, "TF1": 0.9, "VRMAX": 5, "VRMIN": -4},
    "ESDC2A": {**DC, **LEAD, "TF1": 0.9, "VRMAX": 5, "VRMIN": -4},
    "ST5B": {"TC1": 0.8, "TB1": 6, "TC2": 0.08, "TB2": 0.03, "KR": 120, "T1": 0.01, "KC": 0.1},
    "EXPIC1": {
        "KA": 8.0, "TA1": 0.5, "TA2": 0.05, "TA3": 0.1, "TA4": 0.3, "KF": 0.05, "TF1": 0.6, "TF2": 0.1, "TE": 0.4,
        "E1": 1.5, "S1": 0.05, "E2": 3.0, "S2": 0.4, "KP": 4.0, "KI": 0.5, "KC": 0.2, "EFDMIN": -3,
    },
}  # fmt: skip
STEP = 0.001


@pytest.fixture(scope="module")
def model():
    """All exciters beside each other, each with an output of its own."""
    calls = []
    for part in BANK:
        for function in part.stages:
            call = part.call(function)
            writes = tuple(f"{part.name}.Efd" if name == "Efd" else name for name in call.writes)
            calls.append(Call(call.function, call.reads, writes))
    named = [part.qualified(name) for part in BANK for name in (*part.typical, *part.setpoints)]
    states = tuple(part.qualified(name) for part in BANK for name in part.states)
    outputs = tuple(f"{part.name}.Efd" for part in BANK)
    return Model("bank", INPUTS, states, (*named, "shortest"), tuple(calls), outputs)


@pytest.fixture(scope="module")
def engine(model):
    return new_engine("compiled", model, None)


def starting(part, record=None, at_rest=AT_REST, step=STEP):
    """Start of a part at a field voltage equal to the field current, and all its quantities."""
    values = {**part.typical, **(RECORDS[part.name] if record is None else record), **at_rest}
    values |= {"Efd0": at_rest["If"], "shortest": SHORTEST * step}
    values = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    start = part.start(values)
    return start, values | start.states | start.setpoints


def simulate(engine, inputs, time, records=None, record=None, at_rest=AT_REST):
    """Outputs of all exciters for inputs given as functions of time; others stay at rest."""
    values = {"shortest": SHORTEST * STEP}
    for part in BANK:
        found = starting(part, (records or RECORDS).get(part.name), at_rest)[1]
        values |= {part.qualified(name): found[name] for name in part.own if name in found}
    x0, constants = (
        np.array([[float(values[n]) for n in names]])
        for names in (engine.model.states, engine.model.constants)
    )
    half = np.arange(2 * round(time / STEP) + 1) * STEP / 2
    u = np.column_stack([inputs[n](half) if n in inputs else at_rest[n] + 0 * half for n in INPUTS])
    found = engine.integrate(x0, constants, u, h=STEP, record=record)[0]
    return half, u, dict(zip(record or [part.name for part in BANK], found, strict=True))


def dip(depth):
    """Terminal quantities through a dip with soft edges."""

    def shape(t):
        return (np.tanh((t - 0.2) / 0.01) - np.tanh((t - 0.6) / 0.01)) / 2

    def voltage(size):
        return lambda t: size * (1.0 - depth * shape(t))

    return {
        **{name: voltage(AT_REST[name]) for name in ("Vc", "V", "Vd", "Vq")},
        "Vs": lambda t: 0.05 * (shape(t) - shape(0.0)),
        "If": lambda t: 2.0 + 0.8 * shape(t),
        "Id": lambda t: 0.6 + 0.9 * shape(t),
    }


@pytest.mark.parametrize("part", BANK, ids=lambda part: part.name)
def test_typical_records_keep_their_rules_and_start_within_their_limits(part):
    Record(part, {})
    start, _ = starting(part, {})
    for limit in start.limits:
        assert limit.lower <= limit.value <= limit.upper
    assert set(start.states) == set(part.states)
    assert set(start.setpoints) == set(part.setpoints)
    candidates = [one for one in part.fields if one.lower is not None]
    assert 3 <= len(candidates) <= 7
    assert all(one.lower <= one.typical <= one.upper for one in candidates)


@pytest.mark.parametrize("at_rest", [AT_REST, {**AT_REST, "Vs": 0.03, "If": 1.2, "Iq": 0.9, "V": 0.95}])
@pytest.mark.parametrize("codes", [{}, {"VOS": 2, "CSWITCH": 1, "KIM": 0, "KPM": 1, "TE": 0.3}])
def test_equilibrium_is_flat(engine, at_rest, codes):
    records = {
        part.name: {**RECORDS[part.name], **{k: v for k, v in codes.items() if k in part.typical}}
        for part in BANK
    }
    found = simulate(engine, {}, 5.0, records, at_rest=at_rest)[2]
    for name, values in found.items():
        assert np.abs(values - at_rest["If"]).max() < 1e-9, name


def test_both_engines_agree_bit_for_bit_in_a_dip(engine, model):
    one, other = (simulate(e, dip(0.7), 0.4)[2] for e in (engine, new_engine("numpy", model, None)))
    for name, values in one.items():
        assert np.array_equal(values, other[name]), name
        assert np.ptp(values) > 0.1, name


def test_without_time_constants_the_response_stays_finite_and_within_limits(engine):
    kept = {"TE", "TF", "TF1", "TA1"}  # of rotating exciters, rate feedbacks and the PI regulator
    records = {
        part.name: {
            one.name: 0.0 if one.unit == "s" and one.name not in kept else value
            for one, value in zip(part.fields, {**part.typical, **RECORDS[part.name]}.values(), strict=True)
        }
        for part in BANK
    }
    for part in BANK:
        assert not part.broken(records[part.name]), part.name
    found = simulate(engine, dip(0.8), 3.0, records)[2]
    for name, values in found.items():
        assert np.abs(values).max() < 12.0, name
        assert np.abs(np.diff(values[-1000:])).max() < 2e-3, name  # no oscillation is left


def test_limits_hold_through_a_deep_dip(engine):
    _, u, found = simulate(engine, dip(0.85), 2.0)
    V, If = u[::2, INPUTS.index("V")], u[::2, INPUTS.index("If")]
    slack = 1e-9
    assert np.all(found["SCRX"] <= 6 * V + slack)
    assert np.all(found["SCRX"] >= -4 * V - slack)
    assert np.all(found["ESST1A"] <= 6 * V - 0.15 * If + slack)
    assert np.all(found["EXST1"] <= 6 * V - 0.15 * If + slack)
    assert np.all(found["EXST1"] >= -5 * V - 0.15 * If - slack)
    assert np.all(found["ST5B"] <= 5 * V + slack)
    assert np.all(found["ST5B"] >= -4 * V - slack)
    assert np.all(found["ESST4B"] <= 8.4)
    assert found["ESDC1A"].min() >= 0


# --- small signals: transfer functions of the block diagrams -----------------------------------------------


class Ratio:
    """Ratio of two polynomials of s."""

    def __init__(self, num, den=(1.0,)):
        self.num, self.den = np.poly1d(num), np.poly1d(den)

    def __mul__(self, other):
        return Ratio((self.num * other.num).c, (self.den * other.den).c)

    def behind(self, feedback):
        """Forward path with a negative feedback."""
        return Ratio((self.num * feedback.den).c, (self.den * feedback.den + self.num * feedback.num).c)


def first_order(T):
    return Ratio([1.0], [T, 1.0])


def lead_lag(T1, T2):
    return Ratio([T1, 1.0], [T2, 1.0])


def rotating(v, E):
    root1, root2 = np.sqrt(v["E1"] * v["S1"]), np.sqrt(v["E2"] * v["S2"])
    root = (root2 - root1) / (v["E2"] - v["E1"])
    slope = 2 * root * (root * (E - v["E1"]) + root1)  # of B (E - A)^2
    return Ratio([1.0], [v["TE"], v["KE"] + slope])


def source(v, vr=AT_REST):
    """Available voltage by complex numbers."""
    V, current = complex(vr["Vd"], vr["Vq"]), complex(vr["Id"], vr["Iq"])
    KP = v["KP"] * np.exp(1j * np.deg2rad(v.get("THETAP", 0.0)))
    VE = abs(KP * V + 1j * (v["KI"] + KP * v.get("XL", 0.0)) * current)
    In = v["KC"] * vr["If"] / VE
    factor = 1 - 0.577 * In if In <= 0.433 else np.sqrt(0.75 - In**2) if In < 0.75 else 1.732 * (1 - In)
    return VE * factor


def transfer(name, v):
    """Field voltage over the error of voltage."""
    if name == "SCRX":
        return lead_lag(v["TA_TB"] * v["TB"], v["TB"]) * Ratio([v["K"]], [v["TE"], 1.0])
    if name == "ST5B":
        pair = lead_lag(v["TC1"], v["TB1"]) * lead_lag(v["TC2"], v["TB2"])
        return pair * Ratio([v["KR"]], [v["T1"], 1.0])
    if name == "ESST4B":
        inner = Ratio([v["KPM"], v["KIM"]], [1.0, 0.0]) * Ratio([source(v)])
        return Ratio([v["KPR"], v["KIR"]], [1.0, 0.0]) * first_order(v["TA"]) * inner.behind(Ratio([v["KG"]]))
    if name == "EXPIC1":
        PI = Ratio([v["KA"] * v["TA1"], v["KA"]], [1.0, 0.0])
        forward = PI * lead_lag(v["TA3"], v["TA2"]) * first_order(v["TA4"])
        rate = Ratio([v["KF"], 0.0], [v["TF1"], 1.0]) * first_order(v["TF2"])
        return forward.behind(rate) * Ratio([source(v)]) * rotating(v, 2.0)
    forward = Ratio([v["KA"]], [v["TA"], 1.0])
    if name != "IEEET1":
        forward = forward * lead_lag(v["TC"], v["TB"])
    if name == "ESST1A":
        forward = forward * lead_lag(v["TC1"], v["TB1"])
    if "TE" in v:
        forward = forward * rotating(v, 2.0)
    return forward.behind(Ratio([v["KF"], 0.0], [v.get("TF", v.get("TF1")), 1.0]))


def test_small_signals_follow_the_transfer_functions(engine):
    size = 1e-5
    pulse = {"Vc": lambda t: AT_REST["Vc"] + size * np.exp(-(((t - 0.5) / 0.1) ** 2))}
    half, u, found = simulate(engine, pulse, 3.0)
    for part in BANK:
        v = {**part.typical, **RECORDS[part.name]}
        chain = transfer(part.name, v) * first_order(v.get("TR", 0.0))
        expected = lsim(TransferFunction(chain.num.c, chain.den.c), AT_REST["Vc"] - u[:, 0], half)[1][::2]
        error = found[part.name] - 2.0 - expected
        assert np.abs(expected).max() > size
        assert np.sqrt(np.mean(error**2)) < 1e-5 * np.abs(expected).max(), part.name


# --- large signals: small steps of another method, states clamped to their limits after each ---------------


def limited(x, low, high):
    return min(max(x, low), high)


def saturation(v, E):
    root1, root2 = np.sqrt(v["E1"] * v["S1"]), np.sqrt(v["E2"] * v["S2"])
    root = (root2 - root1) / (v["E2"] - v["E1"])
    return max(0.0, root * (E - v["E1"]) + root1) ** 2


def pi_block(x, u, KP, KI, low, high):
    y = KP * u + x
    held = (y >= high and u > 0) or (y <= low and u < 0)
    return limited(y, low, high), 0.0 if held else KI * u


def entries(v, w, under=False, over=False):
    """Signals of limiters that are added to the error, and limits of the gates that an exciter has for others."""
    floor = w["VUEL"] + v["UELgate"] if under and v["UELgate"] > -1e6 else -np.inf
    ceiling = w["VOEL"] + v["OELgate"] if over and v["OELgate"] < 1e6 else np.inf
    added = (w["VUEL"] if floor == -np.inf else 0.0) + (w["VOEL"] if ceiling == np.inf else 0.0)
    return added, floor, ceiling


def ref_exst1(v, w, x):
    Vm, xl, VA, xF = x
    VF = v["KF"] / v["TF"] * (VA - xF)
    e = limited(v["Vref"] + w["Vs"] + entries(v, w)[0] - Vm - VF, v["VIMIN"], v["VIMAX"])
    y = xl + v["TC"] / v["TB"] * (e - xl)
    drop = v["KC"] * w["If"]
    Efd = limited(VA, w["V"] * v["VRMIN"] - drop, w["V"] * v["VRMAX"] - drop)
    dx = [(w["Vc"] - Vm) / v["TR"], (e - xl) / v["TB"], (v["KA"] * y - VA) / v["TA"], (VA - xF) / v["TF"]]
    return dx, Efd, {}


def ref_esst1a(v, w, x):
    Vm, xl, xl1, VA, xF = x
    added, floor, ceiling = entries(v, w, v["UEL"] > 1, True)
    out = VA - v["KLR"] * max(0.0, w["If"] - v["ILR"])
    out = min(max(out, floor) if v["UEL"] == 3 else out, ceiling)
    VF = v["KF"] / v["TF"] * (out - xF)
    e = limited(v["Vref"] + w["Vs"] + added - Vm - VF, v["VIMIN"], v["VIMAX"])
    e = max(e, floor) if v["UEL"] == 2 else e
    y = xl + v["TC"] / v["TB"] * (e - xl)
    y1 = xl1 + v["TC1"] / v["TB1"] * (y - xl1)
    Efd = limited(out, w["V"] * v["VRMIN"], w["V"] * v["VRMAX"] - v["KC"] * w["If"])
    dx = [
        (w["Vc"] - Vm) / v["TR"], (e - xl) / v["TB"], (y - xl1) / v["TB1"], (v["KA"] * y1 - VA) / v["TA"],
        (out - xF) / v["TF"],
    ]  # fmt: skip
    return dx, Efd, {3: (v["VAMIN"], v["VAMAX"])}


def ref_esdc(v, w, x, feed):
    Vm, xl, VR, E, xF = x
    VF = v["KF"] / v["TF1"] * (E - xF)
    added, floor, _ = entries(v, w, under=True)
    e = v["Vref"] + w["Vs"] + added - Vm - VF
    y = max(xl + v["TC"] / v["TB"] * (e - xl), floor)
    dE = (VR - v["KE"] * E - saturation(v, E)) / v["TE"]
    dx = [(w["Vc"] - Vm) / v["TR"], (e - xl) / v["TB"], (v["KA"] * y - VR) / v["TA"], dE, (E - xF) / v["TF1"]]
    return dx, E, {2: (feed * v["VRMIN"], feed * v["VRMAX"]), 3: (0.0, 1e9)}


def ref_esst4b(v, w, x):
    Vm, xR, VA, xM = x
    added, _, ceiling = entries(v, w, over=True)
    VR, dR = pi_block(xR, v["Vref"] + w["Vs"] + added - Vm, v["KPR"], v["KIR"], v["VRMIN"], v["VRMAX"])
    VB = min(source(v, w), v["VBMAX"])
    low, high = v["VMMIN"], v["VMMAX"]
    for _ in range(60):  # bisection of VM = limited(KPM (VA - KG VB VM) + xM)
        middle = (low + high) / 2
        above = limited(v["KPM"] * (VA - v["KG"] * VB * middle) + xM, v["VMMIN"], v["VMMAX"]) > middle
        low, high = (middle, high) if above else (low, middle)
    Efd = VB * min((low + high) / 2, ceiling)
    dM = pi_block(xM, VA - v["KG"] * Efd, v["KPM"], v["KIM"], v["VMMIN"], v["VMMAX"])[1]
    return [(w["Vc"] - Vm) / v["TR"], dR, (VR - VA) / v["TA"], dM], Efd, {}


def ref_st5b(v, w, x):
    """Limited lead-lags as in the standard: a limited sum with a positive feedback of its output behind TC."""
    Vm, z1, z2, E = x
    low, high = v["VRMIN"] / v["KR"], v["VRMAX"] / v["KR"]
    added, floor, ceiling = entries(v, w, True, True)
    e = min(max(v["Vref"] - Vm + added, floor), ceiling) + w["Vs"]
    y = limited(v["TC1"] / v["TB1"] * (e + (v["TB1"] / v["TC1"] - 1) * z1), low, high)
    z = limited(v["TC2"] / v["TB2"] * (y + (v["TB2"] / v["TC2"] - 1) * z2), low, high)
    dE = (v["KR"] * z - v["KC"] * w["If"] - E) / v["T1"]
    dx = [(w["Vc"] - Vm) / v["TR"], (y - z1) / v["TC1"], (z - z2) / v["TC2"], dE]
    return dx, E, {3: (w["V"] * v["VRMIN"], w["V"] * v["VRMAX"])}


def ref_expic1(v, w, x):
    Vm, xA, x2, x4, xF, xG, E = x
    VA, dA = pi_block(
        xA, v["Vref"] + w["Vs"] + entries(v, w)[0] - Vm - xG, v["KA"] * v["TA1"], v["KA"], v["VR2"], v["VR1"]
    )  # lead on the longer lag: the same product
    y = x4 + v["TA3"] / v["TA4"] * (VA - x4)
    VR = limited(x2, v["VRMIN"], v["VRMAX"])
    E0 = limited(VR * source(v, w), v["EFDMIN"], v["EFDMAX"])
    dx = [
        (w["Vc"] - Vm) / v["TR"], dA, (y - x2) / v["TA2"], (VA - x4) / v["TA4"], (VR - xF) / v["TF1"],
        (v["KF"] * (VR - xF) / v["TF1"] - xG) / v["TF2"], (E0 - v["KE"] * E - saturation(v, E)) / v["TE"],
    ]  # fmt: skip
    return dx, E, {}


REFERENCES = {
    "EXST1": ref_exst1,
    "ESST1A": ref_esst1a,
    "ESST4B": ref_esst4b,
    "ESDC1A": lambda v, w, x: ref_esdc(v, w, x, 1.0),
    "ESDC2A": lambda v, w, x: ref_esdc(v, w, x, w["V"]),
    "ST5B": ref_st5b,
    "EXPIC1": ref_expic1,
}


def clamp(x, limits):
    for k, (low, high) in limits.items():
        x[k] = limited(x[k], low, high)
    return x


def clamped_steps(function, v, x, u):
    """Heun's method on the half steps of the inputs."""
    h, out = STEP / 2, []
    w = [dict(zip(INPUTS, row, strict=True)) for row in u.tolist()]
    x = np.array(x)
    for now, then in pairwise(w):
        dx, Efd, _ = function(v, now, x)
        out.append(Efd)
        ahead = x + h * np.array(dx)
        limits = function(v, then, ahead)[2]
        dx2 = function(v, then, clamp(ahead, limits))[0]
        x = clamp(x + h / 2 * (np.array(dx) + np.array(dx2)), limits)
    return np.array([*out, function(v, w[-1], x)[1]])


@pytest.mark.parametrize("name", REFERENCES)
def test_large_signals_agree_with_clamped_steps(engine, name):
    part = PARTS[name]
    _, u, found = simulate(engine, dip(0.6), 2.0)
    start, values = starting(part)
    v = {key: float(value) for key, value in values.items()}
    expected = clamped_steps(REFERENCES[name], v, [float(start.states[s]) for s in part.states], u)[::2]
    error = found[name] - expected
    assert np.ptp(expected) > 0.5
    assert np.sqrt(np.mean(error**2)) < 4e-3


@pytest.mark.parametrize(
    ("name", "UEL", "under", "top"),
    [
        # added to the error of the voltage
        *((name, 1, 0.02, None) for name in REFERENCES),
        # signal at a gate of under-excitation, and what a gate of over-excitation gets at rest
        ("ESST1A", 1, 0.02, 2.5),
        ("ESST1A", 2, 0.1, 2.5),
        ("ESST1A", 3, 3.0, 3.5),
        ("ESDC1A", 1, 0.08, 1.0),
        ("ESST4B", 1, 0.02, 0.6),
        ("ST5B", 1, 0.03, 0.04),
    ],
)
def test_signals_of_limiters_are_added_or_enter_at_gates(engine, name, UEL, under, top):
    def during(first, last, size):
        return lambda t: size * (np.tanh((t - first) / 0.01) - np.tanh((t - last) / 0.01)) / 2

    part, at_rest = PARTS[name], {**AT_REST, "UELgate": 0.0, "OELgate": top} if top else AT_REST
    record = {**RECORDS[name], **({"UEL": UEL} if name == "ESST1A" else {})}
    signals = {"VUEL": during(0.2, 0.5, under), "VOEL": during(0.7, 1.0, -0.8 * top if top else -0.03)}
    _, u, found = simulate(engine, signals, 1.2, {**RECORDS, name: record}, at_rest=at_rest)
    start, values = starting(part, record, at_rest)
    v = {key: float(value) for key, value in values.items()}
    expected = clamped_steps(REFERENCES[name], v, [float(start.states[one]) for one in part.states], u)[::2]
    assert expected[200:700].max() > expected[0] + 0.03
    assert expected[700:].min() < expected[0] - 0.01
    assert np.sqrt(np.mean((found[name] - expected) ** 2)) < 4e-3


# --- values that a record leaves to be computed, and special cases -----------------------------------------


@pytest.mark.parametrize("name", ["IEEET1", "ESDC1A", "ESDC2A"])
def test_zero_as_exciter_constant_or_limit_is_computed(name):
    part = PARTS[name]
    start, _ = starting(part, {**RECORDS[name], "KE": 0.0})
    assert float(start.states["VR"]) == pytest.approx(0.5)  # a tenth of VRMAX
    start, _ = starting(part, {**RECORDS[name], "VRMAX": 0.0})
    assert float(start.setpoints["high"]) == pytest.approx((1 + 0.4) * 3.0)
    assert float(start.setpoints["low"]) == pytest.approx(-(1 + 0.4) * 3.0)


def test_negative_field_current_flows_through_the_resistor_of_scrx():
    part = PARTS["SCRX"]
    _, values = starting(part, {**RECORDS["SCRX"], "rc_rfd": 10.0})
    values |= {"If": np.asarray(-0.1)}
    (function,) = part.stages
    names = part.call(function).reads
    arguments = [values[name.removeprefix("SCRX.")] for name in names]
    assert float(function(*arguments)[0]) == pytest.approx(1.0)
    arguments[[name.removeprefix("SCRX.") for name in names].index("rc_rfd")] = np.asarray(0.0)
    assert float(function(*arguments)[0]) == pytest.approx(2.0)


def test_sources_without_gains_are_constant():
    for name in ("ESST4B", "EXPIC1"):
        record = {**RECORDS[name], "KP": 0.0, "KI": 0.0, "TE": 0.0}
        start, _ = starting(PARTS[name], {k: v for k, v in record.items() if k in PARTS[name].typical})
        (limit,) = [
            one for one in start.limits if one.quantity in ("inner regulator", "voltage behind the lags")
        ]
        assert float(limit.value) == pytest.approx(2.0)


# --- records of OpenIPSL -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "machine", "name", "inner"),
    [
        ("SCRX", "GENROU", "SCRX", {"If": "XadIfd_pu"}),
        ("IEEET1", "GENROE", "IEEET1", {"IEEET1.VF": "IEEET1_VF_pu", "IEEET1.Vm": "IEEET1_VC_pu"}),
        ("ESST1A", "GENROE", "ESST1A", {"ESST1A.VA": "ESST1A_VA_pu", "ESST1A.VF": "ESST1A_VF_pu"}),
    ],
)
def test_records_of_another_program(case, machine, name, inner):
    folder = DATA / case
    if not folder.is_dir():
        pytest.skip(f"{folder} is not on this machine")
    records = []
    for text in (folder / "unit.dyr").read_text().split("/")[:-1]:
        _, model_name, _, *values = text.replace("'", "").split()
        if model_name in (machine, name):
            part = PARTS[model_name]
            fields = [one.name for one in part.fields]
            records.append(Record(part, dict(zip(fields, map(float, values), strict=True))))
    t = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True)
    names = {"P": "P_pu", "Q": "Q_pu", "omega": "speed_dev_pu", "Efd": "EFD_pu", **inner}
    found = play(
        unit(records),
        t["time_s"],
        t["V_pu"],
        t["V_angle_rad"],
        {"P": t["P_pu"][0], "Q": t["Q_pu"][0]},
        list(names),
        f_nominal=50.0,
        power=t["PMECH_pu"][0],
    )
    found["omega"] = found["omega"] - 1
    bounds = {"P": 2e-5, "Q": 5e-5, "omega": 3e-7}
    for key, column in names.items():
        assert np.sqrt(np.mean((found[key] - t[column]) ** 2)) < bounds.get(key, 1e-4), key
