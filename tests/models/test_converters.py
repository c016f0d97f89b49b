"""Converter units: PSS/E, a second form with branches and half the step, rest, limits, and both engines."""

import cmath
import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import signal

from errorscreen.bench.reference_models import play
from errorscreen.exceptions import InputError
from errorscreen.models.renewables import REECA1, REECB1, REGCA1, REGCB1, REPCA1
from errorscreen.models.unit import Record, unit
from tests.models.imposed import needs, records, rms, run, table

H, STOP, F0 = 0.001, 3.0, 50.0
HALF = np.arange(round(STOP / H) * 2 + 1) * H / 2
TIME = HALF[::2]
START = {"P": 0.7, "Q": 0.15}
NAMES = ["P", "Q", "Ipcmd", "Iqcmd", "Pref", "Qext", "Pord"]


def magnitude(t, depth, exp=np.exp):
    return 1.01 - depth * exp(-(((t - 1.0) / 0.15) ** 2))


def turn(t, exp=np.exp):
    return 0.3 * exp(-(((t - 1.6) / 0.5) ** 2))


def voltage(depth):
    """Real and imaginary part at half steps."""
    V, angle = magnitude(HALF, depth), turn(HALF)
    return np.column_stack([V * np.cos(angle), V * np.sin(angle)])


def within(x, low, high):
    return min(max(x, low), high)


def band(x, low, high):
    return x - within(x, low, high)


def controlled(x, error, kp, ki, low, high):
    """PI with a limited output: output and slope of the integral."""
    y = x + kp * error
    stopped = (y >= high and error > 0) or (y <= low and error < 0)
    return within(y, low, high), 0.0 if stopped else ki * error


def points(x, table):
    for (x1, y1), (x2, y2) in pairwise(table):
        if x < x2:
            return y1 + (y2 - y1) * max(x - x1, 0.0) / (x2 - x1)
    return table[-1][1]


class Second:
    """REGCA1 with REECA1 and REPCA1, scalar."""

    def __init__(self, g, e, r, depth):
        self.g, self.e, self.r, self.depth = g, e, r, depth
        V = self.V0 = float(magnitude(0.0, depth))
        self.Ip0, self.Iq0 = START["P"] / V, START["Q"] / V
        self.outer = e["QFLAG"] and e["VFLAG"]
        self.Q0 = (V - e["Vref1"]) if e["QFLAG"] and not e["VFLAG"] else START["Q"]
        self.Y0 = self.measured(V, START["P"], START["Q"])
        self.held = None
        z = V * np.exp(1j * turn(0.0))
        self.x0 = [
            self.Ip0, self.Iq0, V, V, START["P"], V, self.Iq0, self.Iq0, START["P"], self.Y0, self.Q0, self.Q0,
            START["P"], START["P"], START["P"], z.real, z.imag,
        ]  # fmt: skip

    def measured(self, V, P, Q):
        r = self.r
        if not r["RefFlag"]:
            return Q
        if r["VCFlag"]:
            return abs(V - (r["Rc"] + 1j * r["Xc"]) * (P - 1j * Q) / V)
        return V + r["Kc"] * Q

    def power(self, x, V):
        g = self.g
        Ip = min(x[0], self.ceiling(x[2]))
        fade = within((V - g["Lvpnt0"]) / (g["Lvpnt1"] - g["Lvpnt0"]), 0, 1)
        return V * Ip * fade, V * max(x[1] - g["Khv"] * max(V - g["Volim"], 0.0), g["Iolim"])

    def ceiling(self, Vf):
        g = self.g
        if Vf >= g["Brkpt"]:
            return math.inf
        return g["Lvpl1"] * within((Vf - g["Zerox"]) / (g["Brkpt"] - g["Zerox"]), 0, 1)

    def evaluate(self, t, x, dip, hold):
        g, e, r = self.g, self.e, self.r
        V = magnitude(t, self.depth, math.exp)
        Ip, Iq, Vg, Vf, Pf, xq, xv, xi, Pord, yf, xQ, xl, Pfp, xp, xg, *z = map(float, x)
        P, Q = self.power(x, V)
        # plant
        z, point = complex(*z), V * cmath.exp(1j * turn(t, math.exp))
        slope_z = (point - z) / 0.02
        df = (slope_z / z).imag / (2 * math.pi * F0)
        error = within(band(self.Y0 - yf, r["dbd1"], r["dbd2"]), r["emin"], r["emax"])
        order, d_xQ = controlled(xQ, error, r["Kp"], r["Ki"], r["Qmin"], r["Qmax"])
        Qext, d_xl = xl + r["Tft"] / r["Tfv"] * (order - xl), (order - xl) / r["Tfv"]
        u = band(-df, r["fdbd1"], r["fdbd2"])
        lacking = START["P"] - Pfp + (r["Ddn"] if u < 0 else r["Dup"]) * u
        order, d_xp = controlled(xp, lacking, r["Kpg"], r["Kig"], r["Pmin"], r["Pmax"])
        Pref = xg if r["Fflag"] else START["P"]
        # electrical control
        Iqv = within(e["Kqv"] * band(self.V0 - Vf, e["dbd1"], e["dbd2"]), e["Iql1"], e["Iqh1"])
        injected = Iqv if dip else hold(Iqv)
        Qref = Pf * self.Q0 / START["P"] if e["PFFLAG"] else Qext
        through, d_xq = controlled(
            xq, within(Qref, e["Qmin"], e["Qmax"]) - Q, e["Kqp"], e["Kqi"], e["Vmin"], e["Vmax"]
        )
        Vset = through if e["VFLAG"] else within(Qref + e["Vref1"], e["Vmin"], e["Vmax"])
        Imax, active = e["Imax"], points(Vf, e["tables"]["p"])
        Ipmax = min(Imax, active) if self.held is None else self.held
        first = within(Pord / Vf, 0, Ipmax)
        Iqmax = min(points(Vf, e["tables"]["q"]), math.sqrt(Imax**2 - first**2) if e["PQFLAG"] else Imax)
        inner, d_xv = controlled(xv, Vset - Vf, e["Kvp"], e["Kvi"], -Iqmax, Iqmax)
        Iqcmd = within((inner if e["QFLAG"] else xi) + injected, -Iqmax, Iqmax)
        if not e["PQFLAG"] and self.held is None:
            Ipmax = min(active, math.sqrt(max(Imax**2 - Iqcmd**2, 0.0)))
        Ipcmd = within(Pord / Vf, 0, Ipmax)
        d_Pord = within((Pref - Pord) / e["Tpord"], e["dPmin"], e["dPmax"])
        # converter
        d_Ip, top = min((Ipcmd - Ip) / g["Tg"], g["Rrpwr"]), self.ceiling(Vg)
        if Ip >= top:
            d_Ip = min(d_Ip, 0.0) + (top - Ip) / (0.8 * H)
        run_inner, used = e["QFLAG"] and not dip, not dip
        slope = [
            d_Ip, min((Iqcmd - Iq) / g["Tg"], g["Iqrmax"]), (V - Vg) / g["Tfltr"],
            (V - Vf) / e["Trv"], (P - Pf) / e["Tp"], d_xq * bool(run_inner and e["VFLAG"]), d_xv * bool(run_inner),
            (Qref / Vf - xi) / e["Tiq"] * bool(used and not e["QFLAG"]), d_Pord * used,
            (self.measured(V, P, Q) - yf) / r["Tfltr"], d_xQ * (r["Vfrz"] <= V), d_xl,
            (P - Pfp) / r["Tp"], d_xp * r["Fflag"], (order - xg) / r["Tg"] * r["Fflag"],
            slope_z.real, slope_z.imag,
        ]  # fmt: skip
        return slope, (P, Q, Ipcmd, Iqcmd, Pref, Qext, Pord), Ipmax

    def run(self):
        e, fine = self.e, np.linspace(0, STOP, 400001)
        low = fine[magnitude(fine, self.depth) < e["Vdip"]]
        Thld, Thld2 = e["Thld"], e["Thld2"]
        edges = [0.0, STOP]
        if low.size:
            edges += [low[0], low[-1], low[-1] + abs(Thld), low[-1] + Thld2]
        edges, x, out = sorted({*edges}), np.array(self.x0), []
        for a, b in pairwise(edges):
            middle = 0.5 * (a + b)
            dip = bool(low.size and low[0] < middle < low[-1])
            behind = middle - low[-1] if low.size and middle > low[-1] else math.inf
            holds = behind < abs(Thld)
            hold = (lambda Iqv: Iqv if Thld < 0 else e["Iqfrz"]) if holds else (lambda Iqv: 0.0)
            self.held = self.ended if behind < Thld2 else None
            count = round((b - a) / H * 2) + 1
            h, t = (b - a) / count, a
            for _ in range(count):
                k1, outputs, _ = self.evaluate(t, x, dip, hold)
                out.append((t, *outputs))
                k2 = self.evaluate(t + h / 2, x + h / 2 * np.array(k1), dip, hold)[0]
                k3 = self.evaluate(t + h / 2, x + h / 2 * np.array(k2), dip, hold)[0]
                k4 = self.evaluate(t + h, x + h * np.array(k3), dip, hold)[0]
                x = x + h / 6 * (np.array(k1) + 2 * np.array(k2) + 2 * np.array(k3) + np.array(k4))
                t += h
            if dip:
                self.ended = self.evaluate(b, x, dip, hold)[2]
        t, *rows = np.array(out).T
        return np.array([np.interp(TIME, t, row) for row in rows])


TABLES = {
    "q": [(0.2, 0.9), (0.5, 1.0), (0.8, 1.05), (1.0, 1.1)],
    "p": [(0.2, 0.3), (0.5, 0.7), (0.8, 1.0), (1.0, 1.1)],
}
CONVERTER = {"Rrpwr": 2.0, "Iqrmax": 4.0, "Lvpl1": 1.1, "Zerox": 0.3, "Volim": 1.0, "Khv": 0.0}
ELECTRICAL = {
    "PFFLAG": 0, "VFLAG": 1, "QFLAG": 1, "PFLAG": 0, "PQFLAG": 0, "Vdip": 0.85, "dbd1": -0.02, "dbd2": 0.03,
    "Kqv": 1.5, "Iqh1": 0.6, "Kqp": 0.2, "Kqi": 1.0, "Kvp": 1.0, "Kvi": 20.0, "Tpord": 0.05, "dPmax": 0.9,
    "dPmin": -0.9, "Tiq": 0.03, "Vref1": 0.0,
}  # fmt: skip
PLANT = {
    "VCFlag": 0, "RefFlag": 1, "Fflag": 0, "Kp": 1.0, "Ki": 2.0, "Tft": 0.05, "Tfv": 0.15, "Vfrz": 0.8, "Kc": 0.05,
    "Rc": 0.01, "Xc": 0.06, "Kpg": 0.8, "Kig": 1.5, "Dup": 10.0, "Ddn": 20.0, "dbd1": -0.002, "dbd2": 0.002,
}  # fmt: skip
CASES = {
    "reactive power, inner voltage": (0.3, {}, {}),
    "deep dip, hold": (0.6, {"Iqfrz": 0.05, "Thld": 0.2, "Thld2": 0.3}, {}),
    "power factor, active first": (0.5, {"PFFLAG": 1, "QFLAG": 0, "PQFLAG": 1, "Thld": -0.15}, {}),
    "voltage and frequency": (0.1, {"VFLAG": 0, "Vref1": 0.9}, {"VCFlag": 1, "Fflag": 1, "Qmin": -1.0}),
    "reactive power of the plant": (0.3, {"QFLAG": 0}, {"RefFlag": 0, "Fflag": 1}),
}


@pytest.fixture(scope="module")
def device():
    return unit([Record(REECA1, {}), Record(REGCA1, {}), Record(REPCA1, {})])


def settings(electrical, plant):
    """Values of the three records, and the same as changes of the device."""
    flat = {f"{quantity}{axis}{k}": value for axis, pairs in TABLES.items() for k, pair in enumerate(pairs, 1)
            for quantity, value in zip("VI", pair, strict=True)}  # fmt: skip
    own = (
        REGCA1.typical | CONVERTER,
        REECA1.typical | ELECTRICAL | flat | electrical,
        REPCA1.typical | PLANT | plant,
    )
    parts = (REGCA1, REECA1, REPCA1)
    changes = {
        f"{part.name}.{name}": value
        for part, values in zip(parts, own, strict=True)
        for name, value in values.items()
    }
    return own, changes


@pytest.mark.parametrize("case", CASES)
def test_converter_unit_is_its_second_form(device, case):
    depth, electrical, plant = CASES[case]
    (g, e, r), changes = settings(electrical, plant)
    found = run(device, voltage(depth), START, NAMES, h=H, changes=changes, f0=F0)
    expected = Second(g, {**e, "tables": TABLES}, r, depth).run()
    assert np.ptp(expected[:2], axis=1).min() > 0.02
    for name, one, other in zip(NAMES, found, expected, strict=True):
        assert np.abs(one - other).mean() < 4e-4, name  # of the order of the step: a dip begins within one


def test_converter_unit_of_psse():
    folder = needs("psse_three_bus")
    t = table(folder / "regca_reecb_repca_default.csv")
    device = unit(records(folder / "inputs" / "RENA" / "ThreeBus_REN_A_DEFAULT_FLAG.dyr", 103))
    trip = int(np.searchsorted(t["time"], 1.001))  # a second row of this instant, with the voltage behind it
    time, V = np.insert(t["time"], trip, t["time"][trip - 1]), np.insert(t["V"], trip, t["V"][trip])
    start = {"P": t["P"][0], "Q": t["Q"][0]}
    out = play(device, time, V, 0.0 * V, start, ["P", "Q"], f_nominal=60.0)
    for name in ("P", "Q"):
        assert rms(np.delete(out[name], trip) - t[name]) < 5e-5
        assert np.std(t[name]) > 7e-5


def test_rest_and_both_engines(device):
    """With all that holds and freezes in play."""
    (_, electrical, _), changes = settings({"Thld": 0.2, "Thld2": 0.3}, {"Fflag": 1})
    still = np.tile(voltage(0.0)[:1], (5001, 1))
    assert np.ptp(run(device, still, START, NAMES, h=H, changes=changes), axis=1).max() < 1e-9
    u = voltage(0.6)
    both = [run(device, u, START, NAMES, h=H, changes=changes, kind=kind) for kind in ("compiled", "numpy")]
    assert np.array_equal(*both)
    Ip, Iq = both[0][2:4]
    assert np.hypot(Ip, Iq).max() <= electrical["Imax"] + 1e-9
    zero = {
        f"{part.name}.{one.name}": 0.0
        for part in (REGCA1, REECA1, REPCA1)
        for one in part.fields
        if one.unit == "s"
    }
    assert np.isfinite(run(device, u, START, NAMES, h=H, changes=changes | zero)).all()


def test_converter_alone_keeps_its_currents():
    device = unit([Record(REGCA1, {"Lvpl1": 1.1})])
    P, Q, Ip, Iq = run(device, voltage(0.1), START, ["P", "Q", "Ipcmd", "Iqcmd"], h=H)
    V = magnitude(TIME, 0.1)
    assert np.ptp(Ip) == np.ptp(Iq) == 0.0
    assert np.abs(P - Ip * V).max() < 1e-12
    assert np.abs(Q - Iq * V).max() < 1e-12


def test_converter_as_a_source_of_voltage_is_its_transfer_function():
    """With constant commands the voltage behind the reactance is that of the terminal behind two lags."""
    device = unit([Record(REGCB1, {"Tfltr": 0.03, "Te": 0.02})])
    u = voltage(0.2)
    P, Q = run(device, u, START, ["P", "Q"], h=H)
    V = magnitude(TIME, 0.2)
    behind = V[0] + signal.lsim(([1], np.polymul([0.03, 1], [0.02, 1])), V - V[0], TIME)[1]
    X = device.constant_values()["Xsource"]
    assert np.abs(P - START["P"] / V[0] * V).max() < 1e-9
    assert rms(Q - V * (behind + X * START["Q"] / V[0] - V) / X) < 1e-5
    both = [run(device, u[:2001], START, ["P", "Q"], h=H, kind=kind) for kind in ("compiled", "numpy")]
    assert np.array_equal(*both)


def test_starts_beyond_limits_are_told():
    device = unit([Record(REGCA1, {}), Record(REECB1, {"Imax": 1.0, "Vmax": 1.05, "QFLAG": 1})])
    values = {p.name: np.array([p.nominal]) for p in device.candidates}
    values |= {name: np.array([value]) for name, value in device.constant_values().items()}
    values |= {"V": np.array([1.1]), "P": np.array([1.3]), "Q": np.array([0.1]), "angle": np.array([0.0])}
    *_, limits, fits = device.initialise.explain(values)
    assert fits.all()
    wrong = {limit.quantity for limit in limits if not (limit.lower <= limit.value <= limit.upper).all()}
    assert wrong == {"REECB1: power", "REECB1: current", "REECB1: voltage"}
    with pytest.raises(InputError, match="dPmin < dPmax"):
        Record(REECB1, {"dPmin": 100.0})
