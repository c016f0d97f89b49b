"""Machines: records of other programs, a second method, and a bank of all side by side at one imposed voltage."""

import cmath
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from errorscreen.engine.kernels import new_engine
from errorscreen.engine.stages import Call, Model
from errorscreen.exceptions import InputError
from errorscreen.models.machines import MACHINES
from errorscreen.models.unit import SHORTEST, Record, unit

from .imposed import rms
from .networks import smib, three_bus

NAMES = ("GENSAL", "GENSAE", "GENTPJ1", "GENCLS")
BANK = {part.name: part for part in MACHINES if part.name in NAMES}
STEP, F0, V0, ANGLE, P0, Q0 = 0.001, 50.0, 1.02, 0.1, 0.8, 0.25
GIVEN = {"V": V0, "angle": ANGLE, "P": P0, "Q": Q0, "Ra": 0.003, "f0": F0, "Xsource": 0.3}
RECORDS = {
    "GENSAL": {"D": 1.0},
    "GENSAE": {"D": 1.0},
    "GENTPJ1": {"D": 1.0, "Xppd": 0.2, "Xppq": 0.25, "Kis": 0.06},
    "GENCLS": {"D": 1.0},
}


def own(part, call):
    """A call of the bank, where each machine has its own ports."""

    def renamed(name):
        ports = {*part.ports, "Efd", "Pm"}
        if name in ports:
            return f"{part.name}.{name}0" if name in ("Efd", "Pm") else f"{part.name}.{name}"
        if name[:2] == "d_" and name[2:] in ports:
            return f"d_{part.name}.{name[2:]}"
        return name

    return Call(call.function, tuple(map(renamed, call.reads)), tuple(map(renamed, call.writes)))


@pytest.fixture(scope="module")
def model():
    calls = [own(p, p.call(f)) for p in BANK.values() for f in (*p.stages, *p.closing)]
    named = [f"{p.name}.{n}" for p in BANK.values() for n in (*p.typical, *p.setpoints)]
    states = tuple(f"{p.name}.{n}" for p in BANK.values() for n in p.states)
    constants = (*named, "Ra", "f0", "shortest")
    return Model("machines", ("Vr", "Vi"), states, constants, tuple(calls), tuple(f"{n}.P" for n in BANK))


@pytest.fixture(scope="module")
def engine(model):
    return new_engine("compiled", model, None)


def starting(part, record, given=GIVEN):
    """Start of a machine and all its quantities."""
    values = {**part.typical, **record, **given, "shortest": SHORTEST * STEP}
    values = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    start = part.start(values)
    return start, values | start.states | start.setpoints


def simulate(engine, voltage, until, names=None, records=None):
    """Quantities of the bank for a voltage phasor as a function of time."""
    values = {"shortest": SHORTEST * STEP, "Ra": GIVEN["Ra"], "f0": F0}
    for part in BANK.values():
        found = starting(part, (records or RECORDS).get(part.name, {}))[1]
        values |= {f"{part.name}.{name}": value for name, value in found.items()}
    x0, constants = (
        np.array([[float(values[n]) for n in names]])
        for names in (engine.model.states, engine.model.constants)
    )
    half = np.arange(2 * round(until / STEP) + 1) * STEP / 2
    phasor = np.array([voltage(t) for t in half])
    names = names or [f"{name}.{quantity}" for name in BANK for quantity in "PQ"]
    u = np.column_stack([phasor.real, phasor.imag])
    return half[::2], dict(
        zip(names, engine.integrate(x0, constants, u, h=STEP, record=names)[0], strict=True)
    )


def at_rest(t):
    return V0 * cmath.exp(1j * ANGLE)


def dip(depth):
    """A voltage that sags, turns and comes back, with soft edges."""

    def voltage(t):
        sag = (math.tanh((t - 0.2) / 0.02) - math.tanh((t - 0.5) / 0.02)) / 2
        return V0 * (1 - depth * sag) * cmath.exp(1j * (ANGLE + 0.3 * depth * sag))

    return voltage


@pytest.mark.parametrize("part", BANK.values(), ids=lambda part: part.name)
def test_typical_record_keeps_its_rules(part):
    Record(part, {})
    start, _ = starting(part, {})
    assert set(start.states) == set(part.states)
    assert set(start.setpoints) == set(part.setpoints)
    candidates = [one for one in part.fields if one.lower is not None]
    assert all(one.lower <= one.typical <= one.upper for one in candidates)


def test_equilibrium_is_flat(engine):
    found = simulate(engine, at_rest, 5.0)[1]
    for name, values in found.items():
        assert np.abs(values - (P0 if name[-1] == "P" else Q0)).max() < 1e-9, name


def test_both_engines_agree_bit_for_bit(engine, model):
    one, other = (simulate(e, dip(0.7), 0.6)[1] for e in (engine, new_engine("numpy", model, None)))
    for name, values in one.items():
        assert np.array_equal(values, other[name]), name
        assert np.ptp(values) > 0.1, name


@pytest.mark.parametrize("name", ["GENSAL", "GENSAE", "GENTPJ1"])
def test_open_circuit_follows_the_two_points_of_saturation(name):
    for V, S in ((1.0, "S10"), (1.2, "S12")):
        given = {**GIVEN, "V": V, "P": 0.0, "Q": 0.0}
        start, values = starting(BANK[name], {"S10": 0.13, "S12": 0.5}, given)
        assert float(start.setpoints["Efd0"]) == pytest.approx(V * (1 + float(values[S])), abs=1e-12)


def test_short_time_constants_and_absent_saturation_stay_finite(engine):
    records = {name: {"S10": 0.0, "S12": 0.0, "Tppdo": 1e-5, "Tppqo": 1e-5} for name in BANK}
    records["GENCLS"] = {}
    records["GENTPJ1"] |= {"Tpqo": 0.0, "Xpq": 1.7}
    found = simulate(engine, dip(0.8), 3.0, records=records)[1]
    for name, values in found.items():
        assert np.abs(values).max() < 12, name
        assert np.abs(np.diff(values[-500:], 2)).max() < 1e-3, name  # swings, but no noise from step to step


def test_source_is_not_a_unit():
    with pytest.raises(InputError, match="a voltage source, not a unit"):
        Record(BANK["GENCLS"], {"H": 0.0, "D": 0.0})


@pytest.mark.parametrize("name", NAMES)
def test_machines_make_a_unit(name):
    device = unit([Record(BANK[name], {})])
    values = {p.name: np.array([p.nominal]) for p in device.candidates}
    values |= {key: np.array([value]) for key, value in device.constant_values().items()}
    values |= {key: np.array([GIVEN[key]]) for key in ("V", "angle", "P", "Q")}
    states, _, fits = device.initialise(values)
    assert fits.all()
    assert set(states) == set(device.states)


def test_salient_pole_record_with_reactances_out_of_order():
    with pytest.raises(InputError, match="X''d"):
        Record(BANK["GENSAL"], {"Xpp": 0.5})


# --- the record of another program ------------------------------------------------------------------------------------


def test_gensal_beside_openipsl():
    columns = {
        "P_pu": "P", "Q_pu": "Q", "omega": "omega", "delta_rad": "delta", "psi_kd_pu": "GENSAL.psikd", "Epq_pu": "Eq1",
        "psi_q2_pu": "psi2q", "id_pu": "Id", "iq_pu": "Iq",
    }  # fmt: skip
    found = smib("GENSAL", columns)
    assert found.pop("omega") < 1e-6
    assert max(found.values()) < 5e-5


def test_gensal_beside_psse():
    found = three_bus("gensal.csv", "GENSAL/ThreeBus_GENSAL.dyr", {"delta": "delta"})
    assert found["delta"] < 5e-5


# --- a second method --------------------------------------------------------------------------------------------------


class Swing:
    """What the machines have in common, with phasors; a machine gives its flux, saturation and windings."""

    def __init__(self, record, voltage):
        self.c, self.voltage = {**record, **GIVEN}, voltage
        self.current = ((P0 - 1j * Q0) / voltage(0).conjugate()) if voltage else 0
        self.reactance()

    def rotor_angle(self, X):
        return cmath.phase(self.voltage(0) + (self.c["Ra"] + 1j * X) * self.current)

    def run(self, t, x):
        delta, omega, *windings = x
        v = self.voltage(t) * cmath.exp(1j * (math.pi / 2 - delta))
        i, slopes = self.windings(v, windings)
        s = v * i.conjugate()
        torque = s.real + self.c["Ra"] * abs(i) ** 2
        power = self.power / omega - self.c["D"] * (omega - 1) / omega
        return [2 * math.pi * F0 * (omega - 1), (power - torque) / (2 * self.c["H"]), *slopes], s

    def trajectory(self, times):
        solution = solve_ivp(
            lambda t, x: self.run(t, x)[0],
            (0, times[-1]),
            self.start(),
            method="LSODA",
            rtol=1e-9,
            atol=1e-11,
            max_step=0.01,
            t_eval=times,
        )
        return np.array([self.run(t, x)[1] for t, x in zip(times, solution.y.T, strict=True)])


class Classical(Swing):
    def reactance(self):
        self.emf = self.voltage(0) + (self.c["Ra"] + 1j * self.c["Xsource"]) * self.current
        self.power = P0 + self.c["Ra"] * abs(self.current) ** 2

    def start(self):
        return [cmath.phase(self.emf), 1.0]

    def windings(self, v, windings):
        return (1j * abs(self.emf) - v) / (self.c["Ra"] + 1j * self.c["Xsource"]), []


class Salient(Swing):
    """Damper of the d axis by its current, which is that of a winding behind the transient reactance."""

    def exponent(self, u):
        c = self.c
        return c["S10"] * u ** (math.log(c["S12"] / c["S10"]) / math.log(1.2))

    def reactance(self):
        c = self.c
        flux = abs(self.voltage(0) + (c["Ra"] + 1j * c["Xpp"]) * self.current)
        share = self.exponent(flux) * (c["Xq"] - c["Xl"]) / (c["Xd"] - c["Xl"])
        self.delta = self.rotor_angle(c["Xpp"] + (c["Xq"] - c["Xpp"]) / (1 + share))
        turn = cmath.exp(1j * (math.pi / 2 - self.delta))
        i, v = self.current * turn, self.voltage(0) * turn
        behind = v + (c["Ra"] + 1j * c["Xpp"]) * i
        self.eq = v.imag + c["Ra"] * i.imag + c["Xpd"] * i.real
        self.kd = self.eq - (c["Xpd"] - c["Xl"]) * i.real
        self.psi2q = behind.real
        self.efd = self.eq + (c["Xd"] - c["Xpd"]) * i.real + self.exponent(flux) * behind.imag
        self.power = P0 + c["Ra"] * abs(i) ** 2

    def start(self):
        return [self.delta, 1.0, self.eq, self.kd, self.psi2q]

    def windings(self, v, windings):
        c, (eq, kd, psi2q) = self.c, windings
        mutual = c["Xpd"] - c["Xl"]
        psi2d = (eq * (c["Xpp"] - c["Xl"]) + kd * (c["Xpd"] - c["Xpp"])) / mutual
        i = (complex(psi2q, psi2d) - v) / (c["Ra"] + 1j * c["Xpp"])
        S = self.exponent(abs(complex(psi2q, psi2d)))
        towards = eq - kd - mutual * i.real
        field = eq + (c["Xd"] - c["Xpd"]) * (i.real + (c["Xpd"] - c["Xpp"]) / mutual**2 * towards) + S * psi2d
        q = (c["Xq"] - c["Xpp"]) * i.imag - psi2q * (1 + S * (c["Xq"] - c["Xl"]) / (c["Xd"] - c["Xl"]))
        return i, [(self.efd - field) / c["Tpdo"], towards / c["Tppdo"], q / c["Tppqo"]]


class TypeJ(Swing):
    """Undrill's equations with Eq1, Eq2, Ed1, Ed2, and a bracketed root for the saturation."""

    def curve(self, u):
        c = self.c
        ratio = math.sqrt(1.2 * c["S12"] / c["S10"])
        A = (ratio - 1.2) / (ratio - 1)
        return c["S10"] / (1 - A) ** 2 * max(u - A, 0) ** 2 / u

    def saturation(self, v, i):
        c = self.c
        return self.curve(abs(v + (c["Ra"] + 1j * c["Xl"]) * i) + c["Kis"] * abs(i))

    def factors(self, S):
        return 1 + S, 1 + S * self.c["Xq"] / self.c["Xd"]

    def stator(self, v, flux, S):
        """Current from the voltage and the subtransient voltage for a given saturation."""
        c, (Sd, Sq) = self.c, self.factors(S)
        d, q = (c["Xl"] + (c[name] - c["Xl"]) / s for name, s in (("Xppd", Sd), ("Xppq", Sq)))
        found = np.linalg.solve([[c["Ra"], -q], [d, c["Ra"]]], [(flux - v).real, (flux - v).imag])
        return complex(*found)

    def reactance(self):
        c = self.c
        S = self.saturation(self.voltage(0), self.current)
        Sd, Sq = self.factors(S)
        self.delta = self.rotor_angle(c["Xl"] + (c["Xq"] - c["Xl"]) / Sq)
        turn = cmath.exp(1j * (math.pi / 2 - self.delta))
        i, v = self.current * turn, self.voltage(0) * turn
        gap = v + (c["Ra"] + 1j * c["Xl"]) * i
        self.efd = Sd * gap.imag + (c["Xd"] - c["Xl"]) * i.real
        e2q = gap.imag + (c["Xppd"] - c["Xl"]) / Sd * i.real
        e2d = gap.real - (c["Xppq"] - c["Xl"]) / Sq * i.imag
        self.x0 = [
            e2q + (c["Xpd"] - c["Xppd"]) / Sd * i.real, e2q, e2d - (c["Xpq"] - c["Xppq"]) / Sq * i.imag, e2d,
        ]  # fmt: skip
        self.power = P0 + c["Ra"] * abs(i) ** 2

    def start(self):
        return [self.delta, 1.0, *self.x0]

    def windings(self, v, windings):
        c, (e1q, e2q, e1d, e2d) = self.c, windings
        flux = complex(e2d, e2q)
        S = brentq(lambda S: self.saturation(v, self.stator(v, flux, S)) - S, 0, 20, xtol=1e-14)
        i, (Sd, Sq) = self.stator(v, flux, S), self.factors(S)
        d, q = c["Xpd"] - c["Xppd"], c["Xpq"] - c["Xppq"]
        Eq1 = (e1q * (c["Xd"] - c["Xppd"]) - e2q * (c["Xd"] - c["Xpd"])) / d
        Ed1 = (e1d * (c["Xq"] - c["Xppq"]) - e2d * (c["Xq"] - c["Xpq"])) / q
        Eq2 = (e2q - e1q + i.real * d / Sd) * (c["Xd"] - c["Xppd"]) / d
        Ed2 = (e2d - e1d - i.imag * q / Sq) * (c["Xq"] - c["Xppq"]) / q
        return i, [
            (self.efd - Sd * Eq1) / c["Tpdo"],
            -Sd * d / (c["Xd"] - c["Xppd"]) * Eq2 / c["Tppdo"],
            -Sq * Ed1 / c["Tpqo"],
            -Sq * q / (c["Xq"] - c["Xppq"]) * Ed2 / c["Tppqo"],
        ]


@pytest.mark.parametrize("depth", [0.3, 0.8])
@pytest.mark.parametrize(("name", "system"), [("GENCLS", Classical), ("GENSAE", Salient), ("GENTPJ1", TypeJ)])
def test_beside_a_second_method(engine, name, system, depth):
    times, found = simulate(engine, dip(depth), 2.0)
    expected = system({**BANK[name].typical, **RECORDS[name]}, dip(depth)).trajectory(times[::10])
    assert np.ptp(expected.real) > 0.1
    assert rms(found[f"{name}.P"][::10] - expected.real) < 1e-5
    assert rms(found[f"{name}.Q"][::10] - expected.imag) < 1e-5
