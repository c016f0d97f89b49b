"""Governors: records of other programs, a second method, and a bank of all side by side.

The bank is driven by given speed and power instead of a machine, so that one compilation serves all.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.engine.kernels import new_engine
from errorscreen.engine.stages import Call, Model
from errorscreen.exceptions import InputError
from errorscreen.models.governors import GOVERNORS
from errorscreen.models.unit import SHORTEST, Record

from .imposed import rms
from .networks import smib, three_bus

NAMES = ("HYGOV", "IEEEG1", "GGOV1", "GAST", "IEESGO")
BANK = {part.name: part for part in GOVERNORS if part.name in NAMES}
POWER, STEP = 0.6, 0.002


@pytest.fixture(scope="module")
def model():
    """All governors beside each other, each with an output of its own."""
    calls = []
    for part in BANK.values():
        for function in part.stages:
            call = part.call(function)
            writes = tuple(f"{part.name}.Pm" if name == "Pm" else name for name in call.writes)
            calls.append(Call(call.function, call.reads, writes))
    named = [part.qualified(n) for part in BANK.values() for n in (*part.typical, *part.setpoints)]
    states = tuple(part.qualified(n) for part in BANK.values() for n in part.states)
    outputs = tuple(f"{name}.Pm" for name in BANK)
    return Model("governors", ("omega", "P"), states, (*named, "shortest"), tuple(calls), outputs)


@pytest.fixture(scope="module")
def engine(model):
    return new_engine("compiled", model, None)


def starting(part, record, power=POWER, step=STEP):
    """Start of a part and all its quantities; the electrical power is that of the turbine."""
    values = {**part.typical, **record, "Pm0": power, "P": power, "shortest": SHORTEST * step}
    values = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    start = part.start(values)
    return start, values | start.states | start.setpoints


def simulate(engine, until, omega=None, P=None, record=None, names=None, power=POWER, **records):
    """Quantities of the bank for a speed and a power as functions of time."""
    values = {"shortest": SHORTEST * STEP}
    for part in BANK.values():
        found = starting(part, records.get(part.name, {}), power)[1]
        values |= {part.qualified(name): found[name] for name in part.own if name in found}
    x0, constants = (
        np.array([[float(values[n]) for n in names]])
        for names in (engine.model.states, engine.model.constants)
    )
    half = np.arange(2 * round(until / STEP) + 1) * STEP / 2
    u = np.column_stack(
        [
            half * 0 + 1.0 if omega is None else omega(half),
            half * 0 + power if P is None else P(half),
        ]
    )
    names = names or [f"{name}.Pm" for name in BANK]
    return half[::2], dict(
        zip(names, engine.integrate(x0, constants, u, h=STEP, record=names)[0], strict=True)
    )


def swing(depth):
    """Speed of a unit that loses a share of the other generation, with a fast swing above it."""
    return lambda t: 1.0 - depth * (1 - np.exp(-t / 1.5)) + 0.3 * depth * np.sin(5 * t) * np.exp(-t / 3)


@pytest.mark.parametrize("part", BANK.values(), ids=lambda part: part.name)
def test_typical_record_keeps_its_rules_and_starts_within_its_limits(part):
    Record(part, {})
    start, _ = starting(part, {})
    assert all(limit.lower <= limit.value <= limit.upper for limit in start.limits)
    assert set(start.states) == set(part.states)
    assert set(start.setpoints) == set(part.setpoints)
    candidates = [one for one in part.fields if one.lower is not None]
    assert 3 <= len(candidates) <= 6
    assert all(one.lower <= one.typical <= one.upper for one in candidates)


@pytest.mark.parametrize("droop", [1, 0, -1, -2])
def test_equilibrium_is_flat(engine, droop):
    ggov1 = {"RSELECT": droop, "FLAG": 1, "DM": -0.5, "KIMW": 0.1, "TENG": 0.2, "DB": 1e-4, "KDGOV": 0.2}
    found = simulate(engine, 5.0, GGOV1=ggov1, IEEEG1={"K1": 0.2, "K2": 0.3, "K3": 0.1, "K5": 0.1})[1]
    for name, values in found.items():
        assert np.abs(values - POWER).max() < 1e-9, name


AT_LIMITS = {
    "HYGOV": {"GMAX": 0.5, "Dturb": 0.0}, "IEEEG1": {"PMAX": 0.55}, "GGOV1": {"VMAX": 0.55, "LDREF": 0.58},
    "GAST": {"AT": 0.55, "VMAX": 0.59}, "IEESGO": {"PMAX": 0.5},
}  # fmt: skip


def test_unit_that_starts_at_its_limits_rests_there_and_goes_no_further(engine):
    for name, values in simulate(engine, 5.0, **AT_LIMITS)[1].items():
        assert np.abs(values - POWER).max() < 1e-9, name
    for name, values in simulate(engine, 5.0, lambda t: 1.0 - 0.01 * np.tanh(t), **AT_LIMITS)[1].items():
        assert np.abs(values - POWER).max() < 1e-6, name
    limits = starting(BANK["GAST"], AT_LIMITS["GAST"])[0].limits
    assert [limit.upper < limit.value for limit in limits] == [True, True]


def test_both_engines_agree_bit_for_bit(engine, model):
    inputs = {"omega": swing(0.02), "P": lambda t: POWER + 0.2 * np.sin(3 * t)}
    ggov1 = {"RSELECT": -2, "FLAG": 1, "DM": -0.7, "TENG": 0.1, "KDGOV": 0.3, "DB": 1e-3, "KIMW": 0.2}
    one, other = (
        simulate(e, 1.0, **inputs, GGOV1=ggov1)[1] for e in (engine, new_engine("numpy", model, None))
    )
    for name, values in one.items():
        assert np.array_equal(values, other[name]), name
        assert np.ptp(values) > 0.005, name


def test_without_time_constants_the_response_stays_finite_and_settles(engine):
    records = {
        name: {one.name: 0.0 for one in part.fields if one.unit == "s" and one.allowed == ">= 0"}
        for name, part in BANK.items()
    }
    for name, values in simulate(engine, 6.0, lambda t: 1.0 - 0.002 * np.tanh(5 * t), **records)[1].items():
        assert np.abs(values).max() < 1.5, name
        assert np.abs(np.diff(values[-500:])).max() < 1e-3, name


def test_limits_hold(engine):
    """A state stops on its limit within the step in which it gets there."""
    names = ["HYGOV.c", "IEEEG1.v", "GGOV1.v", "GAST.x1", "IEESGO.y4"]
    upper, lower = dict.fromkeys(names, 1.0) | {"HYGOV.c": 0.8}, dict.fromkeys(names, 0.0) | {"GGOV1.v": 0.15}
    _, found = simulate(engine, 20.0, swing(0.1), names=names, HYGOV={"GMAX": 0.8})
    for name, values in found.items():
        assert values.max() == pytest.approx(upper[name], abs=0.02), name
        assert values.max() < upper[name] + 5e-3, name
    _, found = simulate(engine, 20.0, lambda t: 2.0 - swing(0.1)(t), names=names)
    for name, values in found.items():
        assert values.min() == pytest.approx(lower[name], abs=0.02), name
        assert values.min() > lower[name] - 5e-3, name


@pytest.mark.parametrize(
    ("part", "values", "message"),
    [
        ("IEEEG1", {"T1": 0, "T2": 1}, "T2"),
        ("GGOV1", {"TB": 0, "TC": 1}, "TC"),
        ("GAST", {"VMIN": 2}, "VMIN"),
    ],
)
def test_records_that_break_a_rule(part, values, message):
    with pytest.raises(InputError, match=message):
        Record(BANK[part], values)


# --- the record of another program ------------------------------------------------------------------------------------


def test_hygov_beside_openipsl():
    columns = {
        "PMECH_pu": "Pm", "HYGOV_filter_out_pu": "HYGOV.x", "HYGOV_gate_desired_pu": "HYGOV.c",
        "HYGOV_gate_pu": "HYGOV.g", "HYGOV_flow_pu": "HYGOV.q", "omega": "omega", "P_pu": "P",
    }  # fmt: skip
    found = smib("HYGOV", columns)
    assert found["P_pu"] < 1e-4
    assert found["omega"] < 2e-6
    assert max(found[name] for name in columns if "gate" in name or "flow" in name) < 3e-5
    assert found["PMECH_pu"] < 3e-5
    assert found["HYGOV_filter_out_pu"] < 3e-6


def test_hygov_beside_psse():
    found = three_bus(
        "genrou_sexs_hygov.csv", "HYGOV/ThreeBus_HYGOV.dyr", {"delta": "delta", "omega": "omega", "V2": "V"}
    )
    assert found["delta"] < 1e-4
    assert found["omega"] < 2e-6
    assert found["V2"] < 2e-5


def test_ieeeg1_beside_openipsl():
    columns = {
        "PMECH_pu": "Pm", "IEEEG1_valve_pu": "IEEEG1.v", "IEEEG1_stage_T4_pu": "IEEEG1.y4",
        "IEEEG1_stage_T5_pu": "IEEEG1.y5", "IEEEG1_stage_T6_pu": "IEEEG1.y6", "omega": "omega", "P_pu": "P",
    }  # fmt: skip
    found = smib("IEEEG1", columns)
    assert found["P_pu"] < 1e-4
    assert found["omega"] < 2e-6
    assert found["IEEEG1_valve_pu"] < 2e-5
    assert max(found[f"IEEEG1_stage_T{n}_pu"] for n in (4, 5, 6)) < 1e-5
    assert found["PMECH_pu"] < 5e-6


# --- a second method --------------------------------------------------------------------------------------------------


def limited(x, low, high):
    return min(max(x, low), high)


class Gast:
    def __init__(self, c):
        self.c = c

    def start(self):
        return [POWER] * 3

    def run(self, t, x, omega, P):
        c, (valve, turbine, exhaust) = self.c, x
        u = min(POWER - (omega - 1) / c["R"], c["AT"] + c["KT"] * (c["AT"] - exhaust))
        rate = (u - valve) / c["T1"]
        if (valve >= c["VMAX"] and rate > 0) or (valve <= c["VMIN"] and rate < 0):
            rate = 0.0
        return [rate, (valve - turbine) / c["T2"], (turbine - exhaust) / c["T3"]], turbine - c["Dturb"] * (
            omega - 1
        )


class Ieesgo:
    def __init__(self, c):
        self.c = c

    def start(self):
        return [0.0, 0.0, POWER, POWER, POWER]

    def run(self, t, x, omega, P):
        c, (a, b, chest, reheat, low) = self.c, x
        u = c["K1"] * (omega - 1)
        lead = c["T2"] / c["T1"]
        slope = [
            (u - a) / c["T1"],
            (lead * u + (1 - lead) * a - b) / c["T3"],
            (limited(POWER - b, c["PMIN"], c["PMAX"]) - chest) / c["T4"],
            (chest - reheat) / c["T5"],
            (reheat - low) / c["T6"],
        ]
        return slope, chest * (1 - c["K2"]) + reheat * c["K2"] * (1 - c["K3"]) + low * c["K2"] * c["K3"]


class Ggov1:
    """With plain integrators for the governor; for the load limiter one that follows the stroke."""

    def __init__(self, c):
        self.c = c
        self.stroke = POWER / c["KTURB"] + c["WFNL"]

    def start(self):
        s = self.stroke
        return [POWER, 0.0, s, 0.0, s, s, s, s, POWER]

    def run(self, t, x, omega, P):
        c, (measured, extra, integral, filtered, valve, led, exhaust, load, turbine) = self.c, x
        droop = {1: measured, 0: 0.0, -1: valve}[c["RSELECT"]]
        reference = {1: POWER, 0: 0.0, -1: self.stroke}[c["RSELECT"]] * c["R"]
        error = reference + extra - (omega - 1) - c["R"] * droop
        error = 0.0 if abs(error) < c["DB"] else error - np.sign(error) * c["DB"]
        error = limited(error, c["MINERR"], c["MAXERR"])
        derivative = c["KDGOV"] / c["TDGOV"] * (error - filtered)
        excess = c["LDREF"] / c["KTURB"] + c["WFNL"] - exhaust
        asked = c["KPGOV"] * error + integral + derivative
        allowed = min(1.0, c["KPLOAD"] * excess + load)
        given = limited(min(asked, allowed), c["VMIN"], c["VMAX"])
        fuel = valve * (omega if c["FLAG"] else 1.0)
        heat = fuel * (omega ** c["DM"] if c["DM"] < 0 else 1.0)
        power = c["KTURB"] * (fuel - c["WFNL"])
        rate = c["KIMW"] * (POWER - measured)
        if abs(extra) >= 1.1 * c["R"] and rate * extra > 0:
            rate = 0.0
        follow = c["KIGOV"] / c["KPGOV"] * (given - derivative - integral)
        slope = [
            (P - measured) / c["TPELEC"],
            rate,
            c["KIGOV"] * error if given == asked else follow,
            (error - filtered) / c["TDGOV"],
            limited((given - valve) / c["TACT"], c["RCLOSE"], c["ROPEN"]),
            (heat - led) / c["TSB"],
            (c["TSA"] / c["TSB"] * heat + (1 - c["TSA"] / c["TSB"]) * led - exhaust) / c["TFLOAD"],
            c["KILOAD"] / c["KPLOAD"] * (given - load),
            (power - turbine) / c["TB"],
        ]
        lead = c["TC"] / c["TB"]
        return slope, lead * power + (1 - lead) * turbine - max(c["DM"], 0.0) * (omega - 1)


def second_method(system, omega, P, until):
    solution = solve_ivp(
        lambda t, x: system.run(t, x, omega(t), P(t))[0],
        (0, until),
        system.start(),
        method="LSODA",
        rtol=1e-8,
        atol=1e-10,
        max_step=0.02,
        dense_output=True,
    )
    return lambda times: np.array([system.run(t, solution.sol(t), omega(t), P(t))[1] for t in times])


QUIET = {"KA": 0.0, "LDREF": 2.0}
CASES = {
    "GAST in its range": ("GAST", {"Dturb": 0.3}, 0.003),
    "GAST at its load limit": ("GAST", {"AT": 0.7, "VMAX": 0.9}, 0.02),
    "IEESGO": ("IEESGO", {"T2": 0.5, "T1": 0.3}, 0.004),
    "IEESGO at its limit": ("IEESGO", {"PMAX": 0.7}, 0.02),
    "droop by power": ("GGOV1", {**QUIET, "TC": 0.3, "TB": 0.5, "KIMW": 0.02}, 0.004),
    "droop by stroke": ("GGOV1", {**QUIET, "RSELECT": -1, "KDGOV": 2.0, "DM": 0.5, "DB": 5e-4}, 0.004),
    "no droop, fuel with speed": ("GGOV1", {**QUIET, "RSELECT": 0, "FLAG": 1, "KIGOV": 0.5}, 0.002),
    "load limiter": ("GGOV1", {"KA": 0.0, "LDREF": 0.7, "ROPEN": 0.5}, 0.02),
    "load limiter with speed": ("GGOV1", {"KA": 0.0, "LDREF": 0.7, "FLAG": 1, "DM": -2.0}, 0.02),
}


@pytest.mark.parametrize("case", CASES)
def test_beside_a_second_method(engine, case):
    name, record, depth = CASES[case]
    omega, P = swing(depth), lambda t: POWER + 5 * depth * (1 - np.exp(-t / 2)) + 0 * t
    times, found = simulate(engine, 15.0, omega, P, **{name: record})
    system = {"GAST": Gast, "IEESGO": Ieesgo, "GGOV1": Ggov1}[name]({**BANK[name].typical, **record})
    expected = second_method(system, omega, P, 15.0)(times[::25])
    assert np.ptp(expected) > 0.01
    assert rms(found[f"{name}.Pm"][::25] - expected) < 1e-5


def test_ggov1_with_droop_of_its_own_output_rests_where_the_loop_closes(engine):
    """A lasting speed deviation without dead time: stroke and speed are on the droop, whichever signal it takes."""
    depth = 0.002
    for droop in (-1, -2):
        record = {**QUIET, "RSELECT": droop, "KIGOV": 10.0}
        _, found = simulate(
            engine, 60.0, lambda t: 1.0 - depth * np.tanh(t), names=["GGOV1.v", "GGOV1.y"], GGOV1=record
        )
        stroke = POWER / 1.5 + 0.2 + depth / 0.04
        assert found["GGOV1.v"][-1] == pytest.approx(stroke, abs=1e-5)
        assert found["GGOV1.y"][-1] == pytest.approx(stroke, abs=1e-5)


def test_ggov1_load_limiter_ends_at_its_reference(engine):
    record = {"KA": 0.0, "LDREF": 0.75}
    _, found = simulate(
        engine, 80.0, lambda t: 1.0 - 0.02 * np.tanh(t), P=lambda t: 0 * t + 0.75, GGOV1=record
    )
    assert found["GGOV1.Pm"][-1] == pytest.approx(0.75, abs=1e-3)
    assert found["GGOV1.Pm"].max() < 0.9
    # without gains the limiter is out of service
    record |= {"KPLOAD": 0.0, "KILOAD": 0.0}
    _, found = simulate(
        engine, 80.0, lambda t: 1.0 - 0.02 * np.tanh(t), P=lambda t: 0 * t + 0.75, GGOV1=record
    )
    assert found["GGOV1.Pm"][-1] > 1.0


def test_ggov1_acceleration_control_limits_how_fast_the_request_rises(engine):
    record = {"LDREF": 2.0, "ROPEN": 9.0, "KA": 2.0, "ASET": 0.03, "TACT": 0.05}
    times, found = simulate(
        engine, 4.0, lambda t: 1.0 - 0.02 * np.tanh(4 * t), names=["GGOV1.y"], GGOV1=record
    )
    late = times > 2.0  # when the speed has settled
    rise = np.diff(found["GGOV1.y"])[late[1:]] / STEP
    assert rise.max() == pytest.approx(2.0 * 0.03, rel=1e-3)
    free = simulate(
        engine, 4.0, lambda t: 1.0 - 0.02 * np.tanh(4 * t), names=["GGOV1.y"], GGOV1=record | {"KA": 0.0}
    )
    assert free[1]["GGOV1.y"].max() > found["GGOV1.y"].max() + 0.05


def test_ggov1_transport_delay(engine):
    record = {**QUIET, "TB": 0.0, "RSELECT": -1}
    times, at_once = simulate(engine, 10.0, swing(0.01), GGOV1=record)
    _, late = simulate(engine, 10.0, swing(0.01), GGOV1={**record, "TENG": 0.2})
    expected = np.interp(times - 0.2, times, at_once["GGOV1.Pm"])
    assert rms(late["GGOV1.Pm"] - at_once["GGOV1.Pm"]) > 5e-3
    assert rms(late["GGOV1.Pm"] - expected) < 2e-4


def test_ggov1_counts_in_pu_of_its_turbine(engine):
    """The stroke rises by the speed over the droop, and a turbine of 80 MW on 100 MVA gives 0.8 of its power."""
    slow = lambda t: 1.0 - 0.2 / 60 * np.clip(t / 5, 0, 1)  # noqa: E731
    rise = 0.2 / 60 / 0.04
    for rated, given in ((0.8, {"TRATE": 80.0, "MBASE": 100.0}), (1.0, {})):
        record = {"RSELECT": -1.0, "LDREF": 2.0, "VMAX": 2.0, "KIGOV": 20.0, **given}
        _, out = simulate(engine, 60.0, slow, GGOV1=record)
        assert out["GGOV1.Pm"][0] == pytest.approx(POWER, abs=1e-12)
        assert out["GGOV1.Pm"][-1] == pytest.approx(POWER + rated * 1.5 * rise, abs=1e-4)
        # the droop by power rests where the measured power has risen by as much of the rating
        moved = lambda t, r=rated: POWER + r * rise * np.clip(t / 5, 0, 1)  # noqa: E731
        _, out = simulate(engine, 60.0, slow, moved, GGOV1={**record, "RSELECT": 1.0})
        assert np.ptp(out["GGOV1.Pm"][-5000:]) < 1e-4
