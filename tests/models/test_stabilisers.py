"""Stabilisers: recorded signals, transfer functions, limits, and both engines."""

import numpy as np
import pytest
from scipy import signal

from errorscreen.bench.reference_models import play
from errorscreen.exceptions import InputError
from errorscreen.models.stabilisers import IEEEST, PSS2A, PSS2B, ST2CUT, STAB1
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from tests.models.imposed import SIGNALS, alone, needs, records, rms, run, table

H, STOP = 0.001, 6.0
HALF = np.arange(round(STOP / H) * 2 + 1) * H / 2
TIME = HALF[::2]
#: power and speed deviation, smooth
SWING = np.column_stack(
    [
        0.8 + 0.15 * np.sin(7 * HALF) * HALF**2 * np.exp(-HALF),
        0.004 * np.sin(7 * HALF + 1) * HALF**2 * np.exp(-HALF),
    ]
)
POWER, SPEED = SWING[::2].T - [[0.8], [0.0]]


def lead_lag(T1, T2):
    return [T1, 1], [T2, 1]


def washout(T):
    return [T, 0], [T, 1]


def through(u, *blocks):
    for block in blocks:
        u = signal.lsim(block, u, TIME)[1]
    return u


def agree(found, expected, share=5e-5):
    """Whether the rms of the difference is below a share of the largest value."""
    return rms(found - expected) < share * np.abs(expected).max()


WIDE = {"LSMAX": 9.0, "LSMIN": -9.0}
FILTERS = {
    "two and two": ({"A1": 0.06, "A2": 0.003, "A3": 0.05, "A4": 0.0008, "A5": 0.03, "A6": 0.002}, 2, 2),
    "two and one": ({"A1": 0.06, "A2": 0.003, "A3": 0.05, "A5": 0.03, "A6": 0.002}, 2, 1),
    "two and none": ({"A1": 0.06, "A2": 0.003, "A5": 0.03, "A6": 0.002}, 2, 0),
    "one and one": ({"A1": 0.06, "A3": 0.05, "A5": 0.03, "A6": 0.002}, 1, 1),
    "none and two": ({"A3": 0.05, "A4": 0.0008, "A5": 0.03, "A6": 0.0004}, 0, 2),
    "one and none": ({"A1": 0.06, "A5": 0.03}, 1, 0),
    "none": ({}, 0, 0),
}


@pytest.fixture(scope="module")
def ieeest():
    return alone(IEEEST)


def changed(part, **values):
    return {f"{part.name}.{name}": value for name, value in values.items()}


@pytest.mark.parametrize("order", FILTERS)
def test_ieeest_is_its_transfer_function(ieeest, order):
    A, *_ = FILTERS[order]
    values = {"IC": 3, "T1": 0.3, "T2": 0.05, "T3": 0.0, "T4": 0.0, "T5": 3.0, "T6": 5.0, "KS": -2.0, **WIDE}
    a = {f"A{k}": 0.0 for k in range(1, 7)} | A
    denominator = np.polymul([a["A2"], a["A1"], 1], [a["A4"], a["A3"], 1])
    (found,) = run(ieeest, SWING, {}, ["Vs"], h=H, changes=changed(IEEEST, **values, **a))
    expected = through(
        POWER,
        (np.trim_zeros([a["A6"], a["A5"], 1], "f"), np.trim_zeros(denominator, "f")),
        lead_lag(0.3, 0.05),
        ([-6.0, 0], [5.0, 1]),
    )
    assert agree(found, expected)


def test_ieeest_without_washout_passes_its_input(ieeest):
    values = {"IC": 3, "T1": 0.0, "T2": 0.0, "T3": 0.0, "T4": 0.0, "T5": 0.0, "T6": 0.0, "KS": 2.0, **WIDE}
    (found,) = run(ieeest, SWING, {}, ["Vs"], h=H, changes=changed(IEEEST, **values))
    assert np.abs(found - 2.0 * SWING[::2, 0]).max() < 1e-12
    (lagging,) = run(ieeest, SWING, {}, ["Vs"], h=H, changes=changed(IEEEST, **values) | {"IEEEST.T6": 0.5})
    assert rms(lagging - 1.6 - 2.0 * through(POWER, ([1], [0.5, 1]))) < 1e-5


def test_ieeest_filters_that_no_circuit_has_are_refused():
    Record(IEEEST, {"A1": 0.1, "A3": 0.1, "A6": 0.1})
    with pytest.raises(InputError, match="A6 other than 0 only with A2 or A4 or"):
        Record(IEEEST, {"A1": 0.1, "A6": 0.1})
    with pytest.raises(InputError, match="A5 other than 0"):
        Record(IEEEST, {"A5": 0.1})


def test_ieeest_between_recorded_signals():
    """The part alone behind the recorded power, and the whole unit behind the recorded voltage."""
    folder = needs("openipsl_smib/IEEEST")
    t = table(folder / "trajectory.csv")
    found = records(folder / "unit.dyr", 1)
    own = next(record for record in found if record.part is IEEEST)
    inner = {"filter_out": "IEEEST_filter_out_pu", "lead1_out": "IEEEST_leadlag1_out_pu",
             "lead2_out": "IEEEST_leadlag2_out_pu"}  # fmt: skip
    u = t["P_pu"] + 1j * t["speed_dev_pu"]
    names = ["Vs", *(f"IEEEST.{name}" for name in inner)]
    out = play(
        unit([Record(SIGNALS, {}), own]), t["time_s"], np.abs(u), np.angle(u), {}, names, f_nominal=50.0
    )
    for name, column in zip(names, ["VOTHSG_pu", *inner.values()], strict=True):
        assert rms(out[name] - t[column]) < 2e-5, name
    whole = unit(found)
    start = {"P": t["P_pu"][0], "Q": t["Q_pu"][0]}
    names = ["P", "Q", "omega", "Efd", "Vs"]
    out = play(
        whole, t["time_s"], t["V_pu"], t["V_angle_rad"], start, names, f_nominal=50.0, power=t["PMECH_pu"][0]
    )
    assert rms(out["P"] - t["P_pu"]) < 1e-4
    assert rms(out["Q"] - t["Q_pu"]) < 1e-4
    assert rms(out["omega"] - 1 - t["speed_dev_pu"]) < 1e-6
    assert rms(out["Efd"] - t["EFD_pu"]) < 2e-4
    assert rms(out["Vs"] - t["VOTHSG_pu"]) < 2e-5


PSS2 = {
    "TW1": 2.0, "TW2": 3.0, "T6": 0.05, "TW3": 2.5, "TW4": 4.0, "T7": 2.0, "KS2": 0.3, "KS3": 0.9, "T8": 0.5, "T9": 0.1,
    "KS1": 8.0, "T1": 0.25, "T2": 0.03, "T3": 0.15, "T4": 0.05, "VSTMAX": 9.0, "VSTMIN": -9.0,
}  # fmt: skip


def pss2(speed, power, M=0, N=0, **changes):
    """Output before the limits."""
    T = PSS2 | changes
    y1 = through(speed, *(washout(T[k]) for k in ("TW1", "TW2") if T[k]), ([1], [T["T6"], 1]))
    y2 = through(power, *(washout(T[k]) for k in ("TW3", "TW4") if T[k]), ([T["KS2"]], [T["T7"], 1]))
    ramp = y1 + T["KS3"] * y2
    for _ in range(N):
        ramp = through(ramp, lead_lag(T["T8"], T["T9"]), *[([1], [T["T9"], 1])] * (M - 1))
    return T["KS1"] * through(ramp - y2, lead_lag(T["T1"], T["T2"]), lead_lag(T["T3"], T["T4"]))


@pytest.fixture(scope="module")
def pss2a():
    return alone(PSS2A, **PSS2)


@pytest.mark.parametrize(
    "values",
    [
        {"M": 5, "N": 1},
        {"M": 2, "N": 4},
        {"M": 1, "N": 1, "TW2": 0.0, "TW4": 0.0},
        {"M": 0, "N": 0},
        {"M": 4, "N": 2, "TW3": 0.0, "TW4": 0.0},
    ],
)
def test_pss2a_is_its_transfer_function(pss2a, values):
    (found,) = run(pss2a, SWING, {}, ["Vs"], h=H, changes=changed(PSS2A, **values))
    expected = pss2(SPEED, POWER, **values)
    if not (values.get("TW3", 1) or values.get("TW4", 1)):  # the power itself passes, and cancels but for KS3
        expected += 8.0 * 0.3 * 0.8 * (0.9 - 1.0)
    assert agree(found, expected)


def test_pss2a_refuses_filters_of_too_many_lags():
    with pytest.raises(InputError, match=r"M \* N <= 8"):
        Record(PSS2A, {"M": 5, "N": 2})
    with pytest.raises(InputError, match="0, 1, 2, 3, 4"):
        Record(PSS2A, {"M": 1, "N": 6})
    with pytest.raises(InputError, match="N other than 0 only with M"):
        Record(PSS2A, {"M": 0, "N": 1})


@pytest.fixture(scope="module")
def pss2b():
    return alone(PSS2B)


def test_pss2b_limits_its_inputs_and_has_a_third_lead_lag(pss2b):
    values = {
        **PSS2,
        "M": 5,
        "N": 1,
        "T10": 0.2,
        "T11": 0.04,
        "VS1MAX": 0.002,
        "VS1MIN": -0.001,
        "VS2MAX": 0.85,
    }
    (found,) = run(pss2b, SWING, {}, ["Vs"], h=H, changes=changed(PSS2B, **values))
    y = pss2(np.clip(SPEED, -0.001, 0.002), np.minimum(POWER, 0.05), 5, 1)
    expected = through(y, lead_lag(0.2, 0.04))
    assert agree(found, expected, 2e-3)  # an input that runs into a limit between two steps costs an order


@pytest.fixture(scope="module")
def st2cut():
    return alone(ST2CUT)


def test_st2cut_is_its_transfer_function_within_its_band_of_voltage(st2cut):
    values = {
        "IC1": 1, "IC2": 3, "K1": 5.0, "K2": 0.4, "T1": 0.03, "T2": 0.06, "T3": 3.0, "T4": 4.0, "T5": 0.2, "T6": 0.04,
        "T7": 0.1, "T8": 0.05, "T9": 0.0, "T10": 0.0, "LSMAX": 9.0, "LSMIN": -9.0, "VCU": 0.1, "VCL": -0.1,
    }  # fmt: skip
    (found,) = run(st2cut, SWING, {}, ["Vs"], h=H, changes=changed(ST2CUT, **values))
    total = through(5.0 * SPEED, ([1], [0.03, 1])) + through(0.4 * POWER, ([1], [0.06, 1]))
    expected = through(total, ([3.0, 0], [4.0, 1]), lead_lag(0.2, 0.04), lead_lag(0.1, 0.05))
    assert agree(found, expected)


@pytest.fixture(scope="module")
def stab1():
    return alone(STAB1, K_T=20.0, T=3.0, T1_T3=5.0, T3=0.05, T2_T4=4.0, T4=0.03, HLIM=0.08)


def test_stab1_is_its_transfer_function(stab1):
    (found,) = run(stab1, SWING, {}, ["Vs"], h=H)
    expected = through(SPEED, ([60.0, 0], [3.0, 1]), lead_lag(0.25, 0.05), lead_lag(0.12, 0.03))
    assert np.abs(expected).max() > 0.1  # limited
    assert rms(found - np.clip(expected, -0.08, 0.08)) < 1e-5


def dip(depth=0.6):
    """Voltage that is low from 1 to 1.15 s, and turns by a swing; real and imaginary part at half steps of 1 ms."""
    V = np.where((HALF >= 1) & (HALF < 1.15), 1 - depth, 1.0)
    angle = 0.1 * np.sin(5 * (HALF - 1)) * (HALF >= 1) * np.exp(1 - HALF)
    return np.column_stack([V * np.cos(angle), V * np.sin(angle)])


GENERIC = {
    "IEEEST": {"IC": 2, "T6": 5.0, "A1": 0.02, "A2": 0.0004, "KS": 200.0, "VCL": 0.7},
    "PSS2B": {"M": 5, "N": 1, "TW4": 0.0, "VS2MAX": 1.2, "VSTMAX": 0.1, "VSTMIN": -0.1},
    "ST2CUT": {"IC1": 4, "IC2": 6, "K1": 20.0, "LSMAX": 0.1, "LSMIN": -0.1, "VCL": -0.3},
    "STAB1": {},
}


@pytest.mark.parametrize("name", GENERIC)
def test_rest_limits_and_both_engines(name, request):
    device = request.getfixturevalue(name.lower())
    part = PARTS[name]
    changes = changed(part, **GENERIC[name])
    still = np.tile(dip()[:1], (10001, 1))
    assert np.ptp(run(device, still, {}, ["Vs"], h=H, changes=changes)) < 1e-9
    (found,) = run(device, dip(), {}, ["Vs"], h=H, changes=changes)
    assert np.abs(found).max() == (0.08 if name == "STAB1" else 0.1)
    if "VCL" in GENERIC[name]:  # cut out while the voltage is low
        assert np.abs(found[1010:1140]).max() == 0.0
    short = dip()[:3001]
    both = [run(device, short, {}, ["Vs"], h=H, changes=changes, kind=kind) for kind in ("compiled", "numpy")]
    assert np.array_equal(*both)
    zero = {
        one.name: 0.0
        for one in part.fields
        if one.unit == "s" and one.name not in ("T", "T9", "A1", "A3", "A5")
    }
    assert np.isfinite(run(device, short, {}, ["Vs"], h=H, changes=changes | changed(part, **zero))).all()


def test_dynawo_unit_is_as_far_from_its_record_as_stated():
    folder = needs("dynawo_case_1")
    t = {name: column.copy() for name, column in table(folder / "recording_1ms.csv").items()}
    time = t["time_s"]
    jumps = np.flatnonzero(np.diff(time) < 2e-6)
    time[jumps + 1] = time[jumps]
    device = unit(records(folder / "unit.dyr", 1))
    out = play(
        device, time, t["V_pu"], t["angle_rad"], {"P": t["P_pu"][0] / 5, "Q": t["Q_pu"][0] / 5},
        ["P", "Q", "Efd", "Pm"], f_nominal=50.0, step=0.001,
    )  # fmt: skip
    assert abs(out["Efd"][0] - 2.50886) < 1e-5
    assert abs(out["Pm"][0] - 0.9502022) < 1e-6
    even = np.arange(0, 5, 0.002)
    for name in ("P", "Q"):  # a value of its data differs from that behind the record
        assert 0.4 < rms(np.interp(even, time, 5 * out[name] - t[f"{name}_pu"])) < 0.6


BARE = {
    "IEEEST": {"IC": 4, **dict.fromkeys(("T1", "T2", "T3", "T4", "T5", "T6"), 0.0), "KS": 1.0, **WIDE},
    "ST2CUT": {
        "IC1": 4, "K1": 1.0, "K2": 0.0, **dict.fromkeys([f"T{k}" for k in range(1, 11)], 0.0), **WIDE,
    },
    "PSS2A": {
        "IC1": 4, "KS1": 1.0, "KS2": 0.0, "M": 0, "N": 0, "VSTMAX": 9.0, "VSTMIN": -9.0,
        **dict.fromkeys(("TW1", "TW2", "TW3", "TW4", "T1", "T2", "T3", "T4", "T6", "T7"), 0.0),
    },
}  # fmt: skip


@pytest.mark.parametrize("name", BARE)
def test_accelerating_power_follows_the_governor(name):
    """Code 4 is the mechanical power of now, which a governor moves, less the electrical one."""
    named = {"GENROU": {}, "SEXS": {}, name: BARE[name], "TGOV1": {"T1": 0.1, "T2": 0.0, "T3": 0.2}}
    device = unit([Record(PARTS[one], values) for one, values in named.items()])
    half = np.arange(2401) * 0.0025
    angle = -2 * np.pi * 0.3 * np.clip(half - 0.5, 0.0, None)
    u = np.column_stack([np.cos(angle), np.sin(angle)])
    Vs, Pm, P = run(device, u, {"P": 0.6, "Q": 0.1}, ["Vs", "Pm", "P"], h=0.005, kind="numpy")
    assert np.ptp(Pm) > 0.05
    assert np.abs(Vs - (Pm - P)).max() < 1e-12
