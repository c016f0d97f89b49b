"""Wind turbines: a second form driven by the recorded power, rest, limits, and both engines."""

import math
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from errorscreen.models.renewables import REECA1, REGCA1, REPCA1, WTARA1, WTDTA1, WTPTA1, WTTQA1
from errorscreen.models.unit import Record, unit
from tests.models.imposed import run
from tests.models.test_converters import F0, HALF, TIME, H, controlled, points, voltage, within

PARTS = (REGCA1, REPCA1, REECA1, WTDTA1, WTARA1, WTPTA1, WTTQA1)
NAMES = ["P", "Pord", "Pref", "Pset", "wref", "wt", "wg", "theta", "WTDTA1.Ts"]
START = {"P": 0.7, "Q": 0.1}
CASES = {
    "speed": {},
    "power, pitch at rest": {
        "WTTQA1.Tflag": 1, "WTARA1.Theta0": 4.0, "WTPTA1.Kcc": 0.3, "REECA1.PFLAG": 1, "WTTQA1.Temax": 0.7,
    },
    "one mass": {"WTDTA1.Htfrac": 0.0, "WTDTA1.DAMP": 2.0, "WTPTA1.RThetamax": 0.5, "WTPTA1.Thetamax": 0.3},
}  # fmt: skip
COMMON = {
    "REPCA1.Fflag": 1, "REPCA1.Ddn": 10.0, "REPCA1.Dup": 10.0, "REECA1.Tpord": 0.05, "REECA1.Pmax": 1.2,
    "WTTQA1.Twref": 2.0, "WTTQA1.Kpp": 2.0, "WTPTA1.Kic": 20.0, "REECA1.VFLAG": 0, "REECA1.Vdip": 0.7,
}  # fmt: skip


@pytest.fixture(scope="module")
def device():
    return unit([Record(part, {}) for part in PARTS])


class Turbine:
    """Second form of the four parts, scalar, between given powers and the order of power."""

    def __init__(self, changes):
        own = {part.name: dict(part.typical) for part in PARTS}
        for name, value in {**COMMON, **changes}.items():
            part, _, one = name.partition(".")
            own[part][one] = value
        self.q, self.c, self.a, self.d = (own[name] for name in ("WTTQA1", "WTPTA1", "WTARA1", "WTDTA1"))
        self.e = own["REECA1"]
        self.table = [(self.q[f"p{k}"], self.q[f"spd{k}"]) for k in range(1, 5)]
        w, angle = points(START["P"], self.table), self.a["Theta0"]
        self.w0 = w
        self.x0 = [START["P"], w, START["P"] / (w * (w if self.e["PFLAG"] else 1.0)), angle, 0.0, angle, w, w]
        self.x0 += [START["P"] / w, START["P"]]

    def evaluate(self, x, P, Pref, dip):
        Pf, wref, xT, xs, xc, theta, wt, wg, Ts, Pord = map(float, x)
        q, c, d, e = self.q, self.c, self.d, self.e
        error = (Pref - Pf) / wg if q["Tflag"] else wg - wref
        torque, d_xT = controlled(xT, error, q["Kpp"], q["Kip"], q["Temin"], q["Temax"])
        low, high, excess = c["Thetamin"], c["Thetamax"], Pord - Pref
        one, d_xs = controlled(xs, wt - wref + c["Kcc"] * excess, c["Kpw"], c["Kiw"], low, high)
        two, d_xc = controlled(xc, excess, c["Kpc"], c["Kic"], low, high)
        angle = within(theta, low, high)
        rate = within((one + two - theta) / c["Tp"], c["RThetamin"], c["RThetamax"])
        if (theta >= high and rate > 0) or (theta <= low and rate < 0):
            rate = 0.0
        Pm = START["P"] - self.a["Ka"] * angle * (angle - self.a["Theta0"])
        H, Ht = d["H"], d["H"] * d["Htfrac"]
        losses = d["DAMP"] * (wg - self.w0)
        if Ht:
            Hg = H - Ht
            through = Ts + d["Dshaft"] * (wt - wg)
            masses = [(Pm / wt - through) / (2 * Ht), (through - P / wg - losses) / (2 * Hg)]
            masses.append((wt - wg) * (2 * math.pi * d["Freq1"]) ** 2 / (1 / (2 * Ht) + 1 / (2 * Hg)))
        else:
            masses = [((Pm - P) / wg - losses) / (2 * H)] * 2 + [0.0]
        Pset = torque * wg
        order = within((Pset * (wg if e["PFLAG"] else 1.0) - Pord) / e["Tpord"], e["dPmin"], e["dPmax"])
        slope = [
            (P - Pf) / q["Tp"], (points(Pf, self.table) - wref) / q["Twref"], d_xT * (not dip), d_xs, d_xc, rate,
            *masses, order * (not dip),
        ]  # fmt: skip
        return np.array(slope), (Pord, Pset, wref, wt, wg, angle, Ts)

    def run(self, P, Pref, dip):
        """Outputs at every step, from powers and dip at every half step."""
        x, out = np.array(self.x0), []
        for k in range(0, len(P) - 1, 2):
            at = [partial(self.evaluate, P=P[j], Pref=Pref[j], dip=dip[j]) for j in (k, k + 1, k + 2)]
            k1, outputs = at[0](x)
            out.append(outputs)
            k2 = at[1](x + H / 2 * k1)[0]
            k3 = at[1](x + H / 2 * k2)[0]
            x = x + H / 6 * (k1 + 2 * k2 + 2 * k3 + at[2](x + H * k3)[0])
        return np.array([*out, at[2](x)[1]]).T


@pytest.mark.parametrize("case", CASES)
def test_wind_turbine_is_its_second_form(device, case):
    changes = {**COMMON, **CASES[case]}
    u = voltage(0.5)
    found = dict(zip(NAMES, run(device, u, START, NAMES, h=H, changes=changes, f0=F0), strict=True))
    P, Pref = (CubicSpline(TIME, found[name])(HALF) for name in ("P", "Pref"))
    expected = Turbine(CASES[case]).run(P, Pref, np.hypot(*u.T) < changes["REECA1.Vdip"])
    assert np.ptp(found["wg"]) > 0.01
    assert np.ptp(found["theta"]) > 0.2
    for name, other in zip(("Pord", "Pset", "wref", "wt", "wg", "theta", "WTDTA1.Ts"), expected, strict=True):
        assert np.abs(found[name] - other).max() < 2e-4 * max(1.0, np.ptp(other)), name


def test_rest_both_engines_and_limits(device):
    changes = {**COMMON, **CASES["power, pitch at rest"]}
    still = np.tile(voltage(0.0)[:1], (5001, 1))
    for one in ({}, changes, {**COMMON, **CASES["one mass"]}):
        assert np.ptp(run(device, still, START, NAMES, h=H, changes=one), axis=1).max() < 1e-9
    u = voltage(0.7)[1400:2401]
    both = [run(device, u, START, NAMES, h=H, changes=changes, kind=kind) for kind in ("compiled", "numpy")]
    assert np.array_equal(*both)
    theta = both[0][NAMES.index("theta")]
    assert theta.min() >= -1e-3
    assert theta.max() <= WTPTA1.typical["Thetamax"]
    zero = {f"{part.name}.{one.name}": 0.0 for part in PARTS for one in part.fields if one.unit == "s"}
    zero["WTDTA1.H"] = WTDTA1.typical["H"]
    assert np.isfinite(run(device, u, START, NAMES, h=H, changes=changes | zero)).all()


def test_parts_of_a_turbine_alone():
    """A drive train without torque control turns at 1, and without a drive train the speed stays."""
    device = unit([Record(REGCA1, {}), Record(REECA1, {"PFLAG": 1}), Record(WTDTA1, {})])
    still = np.tile(voltage(0.0)[:1], (201, 1))
    P, wg = run(device, still, START, ["P", "wg"], h=H, kind="numpy")
    assert wg[0] == 1.0
    assert np.ptp([P, wg], axis=1).max() < 1e-12
    device = unit([Record(REGCA1, {}), Record(WTPTA1, {}), Record(WTTQA1, {})])
    Pset, theta, wg = run(device, still, START, ["Pset", "theta", "wg"], h=H, kind="numpy")
    assert wg[0] == pytest.approx(0.98 + 0.1 / 0.14 * 0.22)
    assert np.ptp([Pset, theta, wg], axis=1).max() < 1e-12


@pytest.mark.parametrize("Tflag", [0, 1])
def test_torque_control_counts_in_pu_of_its_turbine(device, Tflag):
    """A rating is a record on the machine's base with its powers, and its gains for the speed, times the ratio."""
    powers = [f"WTTQA1.{name}" for name in ("p1", "p2", "p3", "p4", "Temax", "Temin")]
    gains = [f"WTTQA1.{name}" for name in ("Kpp", "Kip")] if Tflag == 0 else []
    own = {**{f"WTTQA1.{one.name}": one.typical for one in WTTQA1.fields}, **COMMON, "WTTQA1.Tflag": Tflag}
    by_hand = {**own, **{name: 0.8 * own[name] for name in (*powers, *gains)}}
    u = voltage(0.5)
    names = ["Pset", "wref", "wg"]
    rated = run(device, u, START, names, h=H, changes={**own, "WTTQA1.TRATE": 80.0, "MBASE": 100.0}, f0=F0)
    expected = run(device, u, START, names, h=H, changes=by_hand, f0=F0)
    np.testing.assert_allclose(rated, expected, rtol=0, atol=1e-9)
    plain = run(device, u, START, names, h=H, changes=own, f0=F0)
    assert np.abs(rated - plain).max() > 0.02
