"""Disturbances of records whose instants are known from how the records are made up here."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from errorscreen.data.disturbances import REST, find_disturbances
from errorscreen.exceptions import InputError

DATA = Path(__file__).parents[3] / "shared" / "data"
TIME = np.arange(0, 120, 0.02)


def noise(seed, size=1e-3):
    return size * np.random.default_rng(seed).normal(size=len(TIME))


def ambient(seed, size=2e-3):
    """Random load: white noise through a lag of 2 s, with a line of 0.5 Hz in it."""
    steps = np.random.default_rng(seed).normal(size=len(TIME))
    slow = np.zeros(len(TIME))
    for k in range(1, len(TIME)):
        slow[k] = 0.99 * slow[k - 1] + 0.14 * steps[k]
    return size * (slow + 0.5 * np.sin(np.pi * TIME + seed))


def after(start, values):
    return np.where(start <= TIME, values(np.maximum(TIME - start, 0.0)), 0.0)


def fault(start, size, length=0.1):
    return -size * ((start <= TIME) & (start + length > TIME))


def swing(start, size, hertz, decay):
    return after(start, lambda t: size * np.sin(2 * np.pi * hertz * t) * np.exp(-t / decay))


def instants(channels, time=TIME):
    return [one.time for one in find_disturbances(time, channels)]


@pytest.mark.parametrize("quiet", [noise, ambient])
def test_each_disturbance_is_found_at_its_instant(quiet):
    V = 1.0 + fault(20.0, 0.4) + fault(55.0, 0.15) + fault(90.0, 0.25) + quiet(0)
    P = 0.8 + swing(20.1, 0.2, 1.0, 2.0) + swing(55.1, 0.08, 1.0, 2.0) + swing(90.1, 0.1, 1.0, 2.0) + quiet(1)
    found = find_disturbances(TIME, {"V": V, "P": P})
    assert [one.time for one in found] == pytest.approx([20.0, 55.0, 90.0], abs=0.041)
    assert [one.channel for one in found] == ["V"] * 3
    assert [one.size for one in found] == pytest.approx([0.4, 0.15, 0.25], abs=0.02)
    for one in found:
        assert 2.0 < one.end - one.time < 20.0


@pytest.mark.parametrize(
    ("P", "why"),
    [
        (fault(30, 0.4) + swing(30.1, 0.3, 1.2, 3.0), "fault, clearing and swings"),
        (fault(30, 0.4) + fault(30.6, 0.4) + fault(33.0, 0.4), "a fault and two reclosings"),
        (fault(30, 0.4) + swing(30.1, 0.3, 0.15, 12.0), "a slow oscillation that dies out"),
        (
            fault(30, 0.4) + after(30.1, lambda t: 0.1 * np.sin(2 * np.pi * 0.3 * t) * (t < 40)),
            "one that stays",
        ),
        (swing(30, 0.2, 1.0, 3.0) + swing(36, 0.3, 1.0, 3.0), "a second swing before the first one is over"),
        (
            swing(30, 0.2, 1.0, 1e9) * (1 + np.cos(2 * np.pi * 0.1 * TIME)) * (TIME < 90),
            "a beat of two modes",
        ),
        (after(30, lambda t: -0.3 * (1 - np.exp(-t / 4.0))), "a slow change to a new level"),
        (after(30, lambda t: -0.2 + 0.01 * np.minimum(t, 20.0)), "a step and a ramp of 20 s"),
    ],
)
def test_one_disturbance_stays_one(P, why):
    found = find_disturbances(TIME, {"P": 0.8 + P + noise(3), "V": 1.0 + 0.1 * P + noise(4)})
    assert len(found) == 1, (why, found)
    assert found[0].time == pytest.approx(30.0, abs=0.2), why


@pytest.mark.parametrize("quiet", [noise, ambient])
@pytest.mark.parametrize("seed", range(5))
def test_noise_is_none(quiet, seed):
    assert instants({"V": 1.0 + quiet(seed), "P": 0.8 + quiet(seed + 10)}) == []


def test_disturbances_closer_than_the_rest_are_one():
    apart = REST + 2.0
    P = 0.8 + noise(0)
    assert instants({"P": P + fault(40, 0.3) + fault(40 + apart, 0.3)}) == pytest.approx([40.0, 40.0 + apart])
    assert instants({"P": P + fault(40, 0.3) + fault(40 + REST - 2.0, 0.3)}) == pytest.approx([40.0])


def test_different_channels_may_show_different_disturbances():
    found = find_disturbances(
        TIME, {"V": 1.0 + fault(20, 0.3), "P": 0.8 - 0.2 * (TIME >= 70) + 0 * TIME, "f": 50 + noise(0)}
    )
    assert [(one.time, one.channel) for one in found] == [(20.0, "V"), (70.0, "P")]


def test_a_record_that_begins_in_a_disturbance():
    P = 0.8 + 0.3 * np.exp(-TIME / 3.0) * np.cos(6 * TIME) + fault(60, 0.2) + noise(0)
    assert instants({"P": P}) == pytest.approx([60.0], abs=0.021)


def test_gaps_and_irregular_samples_are_no_disturbances():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 120, 4000))
    P = 0.8 - 0.2 * ((time > 50) & (time < 50.3)) + 1e-3 * rng.normal(size=len(time))
    P[(time > 20) & (time < 28)] = np.nan
    keep = (time < 70) | (time > 90)
    assert instants({"P": P[keep]}, time[keep]) == pytest.approx([50.0], abs=0.1)


def test_a_record_that_is_nearly_all_holes_is_refused():
    t = np.r_[np.arange(400) * 0.02, 9e10]
    with pytest.raises(InputError, match=r"only 401 samples lie between 0 and 9e\+10 s.*far from the others"):
        find_disturbances(t, {"P": np.where(t < 1, 0.8, 0.5)})


@pytest.mark.parametrize("length", [2, 30])
def test_short_records_hold_none_or_one(length):
    assert len(instants({"P": np.linspace(0, 1, length)}, np.arange(length) / 50)) <= 1


def test_a_coarse_meter_that_flips_between_two_readings():
    P = np.round(0.8 + fault(60, 0.15, 1.0) + 0.002 * np.random.default_rng(0).normal(size=len(TIME)), 2)
    assert instants({"P": P}) == pytest.approx([60.0], abs=0.021)


def shared(path, columns):
    """Time and channels of a table of shared data, scaled to pu, the first row of each instant."""
    if not (DATA / path).exists():
        pytest.skip(f"no {DATA / path}")
    table = pd.read_csv(DATA / path)
    time = table.iloc[:, 0].to_numpy(dtype=float)
    first = np.flatnonzero(np.diff(time, prepend=-1) > 0)
    return time[first], {
        name: table[header].to_numpy(dtype=float)[first] / base for name, (header, base) in columns.items()
    }


PU = {name: (f"{name}_pu", 1.0) for name in "VPQ"}


@pytest.mark.parametrize(
    ("path", "columns", "right"),
    [
        ("grid_fault_recording/recording.csv", {"V": ("V_mag", 1), "P": ("P_pu1000", 0.737)}, 1.03),
        ("psse_three_bus/regca_reecb_repca_default.csv", {name: (name, 1.0) for name in "VPQ"}, 1.0),
        ("psse_three_bus/genrou_sexs.csv", {"V": ("V2", 1.0)}, 1.0),
        ("openipsl_smib/GENROU/trajectory.csv", PU, 2.0),
        ("openipsl_smib/HYGOV/trajectory.csv", PU, 2.0),
        ("openipsl_smib/ESST1A/trajectory.csv", PU, 2.0),
        ("dynawo_case_1/recording.csv", PU, 0.1),
    ],
)
def test_recordings_of_one_event_hold_one(path, columns, right):
    time, values = shared(path, columns)
    assert instants(values, time) == pytest.approx([right], abs=0.05)


def test_a_recording_of_many_events():
    """Its description names a dip at 131.0 s, a trip at 150.8 s and a return at about 272 s, among others."""
    columns = {"V": ("VM", 355.0), "P": ("P_experiment", 2685.0), "Q": ("Q_experiment", 2685.0)}
    time, values = shared("pv_inverter/VoltageRideThrough__CircuitBreakerLogic.csv", columns)
    found = np.array(instants(values, time))
    for known in (131.0, 150.8, 272.0):
        assert np.abs(found - known).min() < 0.3, known
