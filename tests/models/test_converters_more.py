"""REECD1, DERA1 and REGFMA1: a second form with branches and complex numbers, rest, limits, and both engines."""

import cmath
import math

import numpy as np
import pytest

from errorscreen.models.renewables import DERA1, REECA1, REECD1, REGCA1, REGFMA1
from errorscreen.models.unit import Record, unit
from tests.models.imposed import run
from tests.models.test_converters import F0, START, H, band, controlled, points, voltage, within


class Form:
    """Integration of a second form, whose memory changes between steps only."""

    def __init__(self, z, *values):
        self.z = [complex(*row) for row in z]
        self.V0 = abs(self.z[0])
        for name, own in zip(self.names, values, strict=True):
            setattr(self, name, own)
        self.x = np.array(self.begin(), dtype=float)

    def run(self):
        out, x = [], self.x
        for k in range(0, len(self.z) - 1, 2):
            a, b, c = self.z[k : k + 3]
            k1, outputs = self.evaluate(a, x)
            out.append(outputs)
            k2 = np.array(self.evaluate(b, x + H / 2 * np.array(k1))[0])
            k3 = np.array(self.evaluate(b, x + H / 2 * k2)[0])
            x = x + H / 6 * (np.array(k1) + 2 * k2 + 2 * k3 + np.array(self.evaluate(c, x + H * k3)[0]))
            self.after(c, x)
        return np.array([*out, self.evaluate(c, x)[1]]).T

    def after(self, z, x):
        """Change the memory at the end of a step."""


class Storage(Form):
    """REECD1 with a converter of two lags."""

    names = ("e",)

    def begin(self):
        e, V = self.e, self.V0
        self.Ip0, self.Iq0 = START["P"] / V, START["Q"] / V
        self.start_Vc = Vc = self.compensated(V, START["P"], START["Q"])
        self.Qref = START["Q"] if not e["QFLAG"] or e["VFLAG"] else Vc - e["Vref1"]
        self.since, self.dipping, self.end, self.free = math.inf, False, (self.Iq0, self.Ip0), math.inf
        return [self.Ip0, self.Iq0, V, START["P"], Vc, Vc, self.Iq0, self.Iq0, START["P"]]

    def compensated(self, V, P, Q):
        e = self.e
        return abs(V - (e["Rc"] + 1j * e["Xc"]) * (P - 1j * Q) / V) if e["VCMPFLAG"] else V + e["Kc"] * Q

    def evaluate(self, z, x):
        e, V = self.e, abs(z)
        Ip, Iq, Vf, Pf, Vc, xq, xv, xi, Pord = map(float, x)
        P, Q, dip = V * Ip, V * Iq, self.dipping
        Iqv = within(e["Kqv"] * band(self.V0 - Vf, e["dbd1"], e["dbd2"]), e["Iql1"], e["Iqh1"])
        Qref = Pf * self.Qref / START["P"] if e["PFFLAG"] else self.Qref
        through, d_xq = controlled(
            xq, within(Qref, e["Qmin"], e["Qmax"]) - Q, e["Kqp"], e["Kqi"], e["Vmin"], e["Vmax"]
        )
        Vset = through if e["VFLAG"] else within(Qref + e["Vref1"], e["Vmin"], e["Vmax"])
        Imax, top = e["Imax"], points(Vf, e["tables"]["p"])
        wanted = self.end[1] if self.since < e["Thld2"] else Pord / Vf
        first = within(wanted, -e["Ke"] * min(top, Imax), min(top, Imax))
        Iqmax = min(points(Vf, e["tables"]["q"]), math.sqrt(Imax**2 - first**2) if e["PQFLAG"] else Imax)
        inner, d_xv = controlled(xv, Vset - Vc, e["Kvp"], e["Kvi"], -Iqmax, Iqmax)
        Iqcmd = (inner if e["QFLAG"] else xi) + Iqv
        if self.since < abs(e["Thld"]):
            Iqcmd = e["Iqfrz"] if e["Thld"] > 0 else self.end[0]
        Iqcmd = within(Iqcmd, -Iqmax, Iqmax)
        if not e["PQFLAG"]:
            first = min(top, math.sqrt(max(Imax**2 - Iqcmd**2, 0.0)))
            first = within(wanted, -e["Ke"] * first, first)
        if self.free < e["Tblkdelay"]:
            first = Iqcmd = 0.0
        runs = e["QFLAG"] and not dip
        slope = [
            (first - Ip) / 0.02, (Iqcmd - Iq) / 0.02, (V - Vf) / e["Trv"], (P - Pf) / e["Tp"],
            (self.compensated(V, P, Q) - Vc) / e["Tr1"], d_xq * bool(runs and e["VFLAG"]), d_xv * bool(runs),
            (Qref / Vf - xi) / e["Tiq"] * (not e["QFLAG"] and not dip), (START["P"] - Pord) / e["Tpord"] * (not dip),
        ]  # fmt: skip
        return slope, (P, Q, first, Iqcmd)

    def after(self, z, x):
        e, was = self.e, self.dipping
        self.dipping = not e["Vdip"] <= abs(z) <= e["Vup"]
        if self.dipping:
            self.end = self.evaluate(z, x)[1][3:1:-1]
        self.since = 0.0 if was and not self.dipping else math.inf if self.dipping else self.since + H
        outside = e["Vblkh"] > 0 and not e["Vblkl"] <= x[2] <= e["Vblkh"]
        self.free = 0.0 if outside else self.free + H


class Resources(Form):
    """DERA1."""

    names = ("d",)

    def begin(self):
        d, V = self.d, self.V0
        self.gone, self.clocks = False, dict.fromkeys(("l0", "l1", "h0", "h1", "fl", "fh"), 0.0)
        self.lowest, self.highest = d["Vl1"], d["Vh1"]
        self.Q0 = START["Q"] - V * self.voltage(V)
        z = self.z[0]
        return [
            START["P"] / V,
            START["Q"] / V,
            V,
            START["P"],
            self.Q0 / V,
            START["P"],
            START["P"],
            z.real,
            z.imag,
            0,
            1,
        ]

    def voltage(self, V):
        d = self.d
        return within(d["Kqv"] * band((d["Vref0"] or self.V0) - V, d["dbd1"], d["dbd2"]), d["Iql"], d["Iqh"])

    def left(self, V):
        d, share = self.d, 1.0
        if self.gone:
            return 0.0
        if not d["VtripFlag"]:
            return 1.0
        for outer, begin, extreme in ((d["Vl0"], d["Vl1"], self.lowest), (d["Vh0"], d["Vh1"], self.highest)):
            depth = within((V - begin) / (outer - begin), 0, 1)
            worst = max(within((extreme - begin) / (outer - begin), 0, 1), depth)
            share *= 1 - worst + d["Vrfrac"] * (worst - depth)
        return share

    def evaluate(self, z, x):
        d, V = self.d, abs(z)
        Ip, Iq, Vf, Pf, xq, xp, Pord, zr, zi, ff, m = map(float, x)
        slow = complex(zr, zi)
        d_slow = (z - slow) / 0.02
        df = (d_slow / slow).imag / (2 * math.pi * F0)
        u = band(-ff, d["fdbd1"], d["fdbd2"])
        error = within(START["P"] - Pf + (d["Ddn"] if u < 0 else d["Dup"]) * u, d["femin"], d["femax"])
        order, d_xp = controlled(xp, error, d["Kpg"], d["Kig"], d["Pmin"], d["Pmax"])
        rate = within(((order if d["FreqFlag"] else START["P"]) - Pord) / d["Tpord"], d["dPmin"], d["dPmax"])
        Qref = Pf * self.Q0 / START["P"] if d["PfFlag"] else self.Q0
        p, q, Imax = Pord / Vf, xq + self.voltage(Vf), d["Imax"]
        if d["PQFlag"]:
            p = within(p, 0 if d["GenFlag"] else -Imax, Imax)
            room = math.sqrt(Imax**2 - p**2)
            q = within(q, -room, room)
        else:
            q = within(q, -Imax, Imax)
            room = math.sqrt(Imax**2 - q**2)
            p = within(p, 0 if d["GenFlag"] else -room, room)
        slope = [
            min((m * p - Ip) / d["Tg"], d["rrpwr"]), (m * q - Iq) / d["Tg"], (V - Vf) / d["Trv"],
            (V * Ip - Pf) / d["Tp"], (Qref / Vf - xq) / d["Tiq"], d_xp * d["FreqFlag"], rate, d_slow.real, d_slow.imag,
            (df - ff) / d["Trf"], (self.left(Vf) - m) / d["Tv"],
        ]  # fmt: skip
        return slope, (V * Ip, V * Iq, Pord, m)

    def after(self, z, x):
        d, V, f = self.d, x[2], F0 * (1 + x[9])
        beyond = {
            "l0": d["Vl0"] > V, "l1": d["Vl1"] > V, "h0": d["Vh0"] < V, "h1": d["Vh1"] < V,
            "fl": f < d["fl"] and d["Vpr"] <= V, "fh": f > d["fh"] and d["Vpr"] <= V,
        }  # fmt: skip
        for name, on in beyond.items():
            self.clocks[name] = self.clocks[name] + H if on else 0.0
        times = {name: d[f"t{'v' if name[0] in 'lh' else ''}{name}"] for name in beyond}
        over = {name for name, time in times.items() if self.clocks[name] >= time}
        if (d["VtripFlag"] and over & {"l0", "h0"}) or (d["FtripFlag"] and over & {"fl", "fh"}):
            self.gone = True
        if "l1" in over:
            self.lowest = min(self.lowest, V)
        if "h1" in over:
            self.highest = max(self.highest, V)


class Forming(Form):
    """REGFMA1."""

    names = ("g",)
    X = 0.2

    def begin(self):
        z = self.z[0]
        self.E0 = z + 1j * self.X * ((START["P"] + 1j * START["Q"]) / z).conjugate()
        return [cmath.phase(self.E0), START["P"], START["Q"], abs(z), abs(self.E0), 0, 0, 0, 0]

    def evaluate(self, z, x):
        g = self.g
        delta, Pf, Qf, Vf, xv, *limiters = map(float, x)

        def limiter(x, u, kp, ki, sign):
            slope = 0.0 if sign * x <= 0 and sign * u < 0 else ki * u
            return sign * max(sign * (kp * u + x), 0.0), slope

        cases = (
            (g["Pmax"], Pf, "p", -1),
            (g["Pmin"], Pf, "p", 1),
            (g["Qmax"], Qf, "q", -1),
            (g["Qmin"], Qf, "q", 1),
        )
        y = [
            limiter(x, limit - at, g[f"kp{kind}max"], g[f"ki{kind}max"], sign)
            for x, (limit, at, kind, sign) in zip(limiters, cases, strict=True)
        ]
        wanted = (self.V0 if g["VFlag"] else abs(self.E0)) - g["mq"] * (Qf - START["Q"]) + y[2][0] + y[3][0]
        error = wanted - Vf
        E = within(xv + g["kpv"] * error if g["VFlag"] else wanted, g["Emin"], g["Emax"])
        stopped = (xv >= g["Emax"] and error > 0) or (xv <= g["Emin"] and error < 0)
        current = (cmath.rect(E, delta) - z) / (1j * self.X)
        if abs(current) > g["Imax"]:
            current *= g["Imax"] / abs(current)
        S = z * current.conjugate()
        slope = [
            2 * math.pi * F0 * (g["mp"] * (START["P"] - Pf) + y[0][0] + y[1][0]), (S.real - Pf) / g["TPf"],
            (S.imag - Qf) / g["TQf"], (abs(z) - Vf) / g["TVf"], 0.0 if stopped or not g["VFlag"] else g["kiv"] * error,
            *(one[1] for one in y),
        ]  # fmt: skip
        return slope, (S.real, S.imag, E)


TABLES = {
    "q": [(0.2, 0.9), (0.5, 1.0), (0.6, 1.0), (0.7, 1.02), (0.8, 1.05), (0.9, 1.1), (1.0, 1.2), (1.1, 1.2), (1.2, 1.1),
          (1.3, 1.0)],
    "p": [(0.2, 0.3), (0.5, 0.7), (0.8, 1.0), (1.0, 1.1)],
}  # fmt: skip
PLAIN = {"REGCA1.Lvplsw": 0, "REGCA1.Lvpnt0": 0.0, "REGCA1.Lvpnt1": 0.05, "REGCA1.Rrpwr": 1e3}
STORAGE = {
    "voltage, drop": (0.4, {"QFLAG": 1, "VCMPFLAG": 1, "Kqi": 1.0, "Thld": 0.2, "Thld2": 0.3, "Iqfrz": 0.05}),
    "droop, kept current": (
        0.5,
        {"QFLAG": 1, "VFLAG": 0, "Vref1": 0.9, "Thld": -0.2, "PQFLAG": 1, "Kvi": 5.0, "Kqv": 0.5},
    ),
    "blocked": (0.7, {"PFFLAG": 1, "Vblkl": 0.5, "Vblkh": 1.3, "Ke": 0.5}),
}
RESOURCES = {
    "frequency": (0.3, {"FreqFlag": 1, "Dup": 10.0, "dPmax": 0.2, "Kqv": 2.0, "rrpwr": 1.0}),
    "part trips": (0.6, {"Vl0": 0.3, "Vl1": 0.7, "tvl1": 0.05, "Vrfrac": 0.6, "PQFlag": 1}),
    "all trips": (0.6, {"Vl0": 0.6, "Vl1": 0.7, "tvl0": 0.1, "PfFlag": 0}),
    "high voltage": (-0.2, {"Vh0": 1.3, "Vh1": 1.1, "tvh1": 0.05, "GenFlag": 0}),
    "frequency trips": (0.1, {"fl": 49.95, "tfl": 0.05, "Vref0": 1.1}),
    "no trip": (0.6, {"Vl0": 0.6, "Vl1": 0.7, "tvl0": 0.1, "VtripFlag": 0, "FtripFlag": 0}),
}
FREQUENCIES = {"fl": 47.0, "fh": 52.0}
FORMING = {
    "terminal voltage, current at its limit": (0.5, {"kpv": 0.5, "Imax": 1.2}),
    "power at its limits": (0.05, {"Pmax": 0.75, "Pmin": 0.6, "Qmin": -0.1, "Qmax": 0.2}),
    "internal voltage": (0.2, {"VFlag": 0, "QVFlag": 0, "Qmax": 0.3, "kpqmax": 0.1, "Emax": 1.06}),
}


@pytest.fixture(scope="module")
def storage():
    return unit([Record(REGCA1, {}), Record(REECD1, {})])


@pytest.fixture(scope="module")
def resources():
    return unit([Record(DERA1, {})])


@pytest.fixture(scope="module")
def forming():
    return unit([Record(REGFMA1, {})])


def named(part, own):
    return {f"{part.name}.{name}": value for name, value in own.items()}


def compare(device, form, names, depth, part, own, changes):
    u = voltage(depth)
    found = run(device, u, START, names, h=H, changes=changes, f0=F0)
    expected = form(u, part.typical | own).run()
    assert np.ptp(found[:2], axis=1).min() > 0.02
    for name, one, other in zip(names, found, expected, strict=True):
        assert np.abs(one - other).mean() < 6e-4, name  # of the order of the step: a dip begins within one


@pytest.mark.parametrize("case", STORAGE)
def test_control_of_storage_is_its_second_form(storage, case):
    depth, own = STORAGE[case]
    own = {"Rc": 0.01, "Xc": 0.06, "Kc": 0.05, "Kvi": 20.0, "Kqv": 1.5, "Tpord": 0.05, **own}
    flat = {f"{quantity}{axis}{k}": value for axis, pairs in TABLES.items() for k, pair in enumerate(pairs, 1)
            for quantity, value in zip("VI", pair, strict=True)}  # fmt: skip
    changes = PLAIN | named(REECD1, own | flat)
    compare(storage, Storage, ["P", "Q", "Ipcmd", "Iqcmd"], depth, REECD1, own | {"tables": TABLES}, changes)


@pytest.mark.parametrize("case", RESOURCES)
def test_distributed_resources_are_their_second_form(resources, case):
    depth, own = RESOURCES[case]
    own = FREQUENCIES | own
    names = ["P", "Q", "DERA1.xo", "DERA1.m"]
    compare(resources, Resources, names, depth, DERA1, own, named(DERA1, own))


@pytest.mark.parametrize("case", FORMING)
def test_grid_forming_converter_is_its_second_form(forming, case):
    depth, own = FORMING[case]
    compare(forming, Forming, ["P", "Q", "REGFMA1.E"], depth, REGFMA1, own, named(REGFMA1, own))


def test_rest_both_engines_and_short_time_constants(storage, resources, forming):
    still, dip = np.tile(voltage(0.0)[:1], (4001, 1)), voltage(0.6)[1600:2001]
    cases = (
        (storage, REECD1, PLAIN | named(REECD1, STORAGE["voltage, drop"][1] | {"Vblkl": 0.3, "Vblkh": 1.3})),
        (resources, DERA1, named(DERA1, FREQUENCIES | RESOURCES["frequency"][1] | {"Vref0": 1.1})),
        (forming, REGFMA1, named(REGFMA1, FORMING["power at its limits"][1])),
    )
    for device, part, changes in cases:
        assert np.ptp(run(device, still, START, ["P", "Q"], h=H, changes=changes), axis=1).max() < 1e-9
        both = [
            run(device, dip, START, ["P", "Q"], h=H, changes=changes, kind=kind)
            for kind in ("compiled", "numpy")
        ]
        assert np.array_equal(*both)
        zero = named(part, {one.name: 0.0 for one in part.fields if one.unit == "s"})
        assert np.isfinite(run(device, dip, START, ["P", "Q"], h=H, changes=changes | zero)).all()


def test_more_points_and_no_extras_are_reec_a(storage):
    """Where the voltage stays out of the dead bands, a droop of zero and no blocking leave REECA1."""
    old = unit([Record(REGCA1, {}), Record(REECA1, {})])
    u = voltage(0.04)[1600:2001]
    own = {"QFLAG": 1, "Kqi": 1.0, "Tr1": REECA1.typical["Trv"], "dbd1": -0.1, "dbd2": 0.1}
    one = run(storage, u, START, ["P", "Q"], h=H, changes=named(REECD1, own), kind="numpy")
    own.pop("Tr1")
    other = run(old, u, START, ["P", "Q"], h=H, changes=named(REECA1, own), kind="numpy")
    assert np.ptp(one, axis=1).min() > 1e-3
    assert np.abs(one - other).max() < 1e-12
