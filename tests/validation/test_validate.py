"""Criteria of whole recordings: an independent computation, outcomes, and what is not evaluated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import filtfilt

from errorscreen.data.observations import Observation
from errorscreen.events import Event, Playback, SetPointStep
from errorscreen.validation import PROFILES, Limits, WindowLimits, validate, windows

DT = 0.005
TIME = np.arange(0.0, 8.0, DT)
FAULT = (TIME >= 2.0 - 1e-9) & (TIME < 2.4 - 1e-9)


def recorded(P, Q=None, V=None, kind="fault", **changes):
    """Observation of a fault from 2.0 to 2.4 s, or of a step at 2 s."""
    V = np.where(FAULT, 0.5, 1.0) if V is None else V
    steps = (SetPointStep("Pref", 2.0),) if kind == "step" else ()
    V = np.ones(len(TIME)) if kind == "step" else V
    event = Playback(
        TIME, kind, 2.0, {"V": V, "angle": 0 * TIME}, {"V": 1.0, "P": float(P[0]), "Q": 0.0}, steps=steps
    )
    values = np.stack([P, 0 * TIME if Q is None else Q])
    return replace(Observation(event, values, np.full(2, 1e-3), ("P", "Q"), ("pu", "pu")), **changes)


def dip(depth=0.3):
    """Power that falls during the fault, and recovers over a second."""
    after = np.clip(TIME - 2.4, 0.0, None)
    return np.where(FAULT, 0.8 - depth, 0.8 - depth * np.exp(-3.0 * after) * (TIME >= 2.4))


def of(found, **keys):
    (one,) = (c for c in found.criteria if all(getattr(c, key) == value for key, value in keys.items()))
    return one


def test_windows_are_those_of_the_standard():
    seen = recorded(dip())
    told = [(w.name, w.start, w.stop) for w in windows(seen)]
    assert told == [
        ("before", pytest.approx(1.0), pytest.approx(2.0)),
        ("during", pytest.approx(2.14), pytest.approx(2.4)),
        ("after", pytest.approx(2.9), pytest.approx(TIME[-1])),
    ]
    assert [w.name for w in windows(recorded(dip(), kind="step"))] == ["before", "after"]
    early = recorded(dip())
    short = early.first(int(2.1 / DT))
    assert [w.name for w in windows(short)] == ["before"]


def test_figures_are_those_of_another_script():
    """Filter coefficients by hand from the bilinear transform, currents and errors by plain numpy."""
    rng = np.random.default_rng(5)
    P, Q = dip() + 0.01 * rng.standard_normal((2, len(TIME)))
    model = np.stack([dip(0.2), 0.05 * np.sin(TIME)])
    found = validate([recorded(P, Q)], [model], [model])
    k = np.tan(np.pi * 15.0 * DT) / np.sqrt(np.sqrt(2.0) - 1.0)
    b, a = (
        np.array([k**2, 2 * k**2, k**2]) / (1 + k) ** 2,
        np.convolve([1 + k, k - 1], [1 + k, k - 1]) / (1 + k) ** 2,
    )
    V = np.where(FAULT, 0.5, 1.0)
    parts = {"before": (1.0, 2.0), "during": (2.14, 2.4), "after": (2.9, 8.0)}
    signals = {
        "P": (P, model[0]),
        "Q": (Q, model[1]),
        "Ip": (P / V, model[0] / V),
        "Iq": (Q / V, model[1] / V),
    }
    for window, (start, stop) in parts.items():
        part = slice(round(start / DT), round(stop / DT) + 1)
        for name, (measured, simulated) in signals.items():
            more = min(len(TIME[part]) - 1, 25)  # ten time constants of 6.83 ms, and 11 samples
            error = filtfilt(b, a, simulated[part], padlen=more) - filtfilt(b, a, measured[part], padlen=more)
            wanted = {"ME": error.mean(), "MAE": np.abs(error).mean(), "MXE": np.abs(error).max()}
            for measure, value in wanted.items():
                one = of(found, signal=name, window=window, measure=measure)
                assert one.after == pytest.approx(value, abs=1e-9)
                assert one.outcome == "no limit"


def test_limits_decide_and_name_their_source():
    seen = recorded(dip())
    off = seen.values + np.array([[0.045], [0.0]])
    found = validate([seen], [seen.values], [off], PROFILES["rte-measurement"].limits, "RTE, field")
    # 0.045 in all windows: beyond ME 0.04 outside and within 0.05 inside; MAE 0.07 and MXE 0.08 hold
    assert of(found, signal="P", window="before", measure="ME").outcome == "failed"
    assert of(found, signal="P", window="during", measure="ME").outcome == "passed"
    assert of(found, signal="P", window="before", measure="MAE").outcome == "passed"
    assert of(found, signal="P", window="before", measure="ME").before == pytest.approx(0.0, abs=1e-12)
    # the current during the fault is twice as large: 0.09
    assert of(found, signal="Ip", window="during", measure="MXE").outcome == "passed"
    assert of(found, signal="Ip", window="during", measure="ME").outcome == "failed"
    assert "fiche F16" in found.source
    assert "failed" in found.summary()
    judged = len([c for c in found.criteria if np.isfinite(c.limit)])
    assert judged == len(found.criteria) - 2  # there is no limit for frequency and damping
    assert found.summary().startswith(f"{found.count('passed')} of {judged} criteria passed (RTE, field)")


def test_the_recovery_of_the_power_is_compared():
    seen = recorded(dip())
    slow = seen.values.copy()
    after = np.clip(TIME - 2.4, 0.0, None)
    slow[0] = np.where(FAULT, 0.5, 0.8 - 0.3 * np.exp(-1.5 * after) * (TIME >= 2.4))
    found = validate([seen], [seen.values], [slow], PROFILES["rte-simulation"].limits)
    one = of(found, measure="recovery to 90 %")
    # 0.3 exp(-3 t) = 0.08 at 0.4406 s, and twice that
    assert one.after == pytest.approx(np.log(0.3 / 0.08) / 3.0, abs=2e-3)
    assert one.limit == pytest.approx(0.1 * np.log(0.3 / 0.08) / 3.0, abs=2e-3)
    assert one.outcome == "failed"


def test_a_step_has_its_figures():
    rise = np.where(TIME < 2.0, 0.0, 0.2 * (1 - np.exp(-np.clip(TIME - 2.0, 0, None) / 0.5)))
    seen = recorded(0.5 + rise, kind="step")
    slower = seen.values.copy()
    slower[0] = 0.5 + np.where(TIME < 2.0, 0.0, 0.2 * (1 - np.exp(-np.clip(TIME - 2.0, 0, None) / 0.6)))
    found = validate([seen], [seen.values], [slower], PROFILES["rte-tracking-site"].limits)
    one = of(found, signal="P", measure="rise")
    assert one.after == pytest.approx(0.1 * np.log(9.0), abs=5e-3)
    assert one.outcome == "failed"  # a fifth slower, where a tenth is allowed
    assert of(found, signal="P", measure="steady").outcome == "passed"
    still = of(found, signal="Q", measure="rise")
    assert still.outcome == "not evaluated"
    assert "does not follow the step" in still.reason


def test_what_cannot_be_judged_says_why():
    P = dip()
    P[(TIME > 2.03) & (TIME < 2.38)] = np.nan
    seen = recorded(P, V=np.where(FAULT, 0.5, 1.0))
    found = validate(
        [seen], [np.zeros((2, len(TIME)))], [np.zeros((2, len(TIME)))], PROFILES["rte-simulation"].limits
    )
    one = of(found, signal="P", window="during", measure="ME")
    assert one.outcome == "not evaluated"
    assert "values in this window, at least 10 are needed" in one.reason
    assert np.isnan(one.after)
    dead = recorded(dip(), V=np.where(FAULT, 0.0, 1.0))
    told = validate([dead], [dead.values], [dead.values], PROFILES["rte-simulation"].limits)
    assert of(told, signal="Ip", window="during", measure="ME").outcome == "not evaluated"
    assert of(told, signal="P", window="during", measure="ME").outcome == "passed"


def test_a_record_of_no_plant_has_no_criteria():
    seen = Observation(Event(TIME, start=2.0), np.zeros((1, len(TIME))), np.ones(1), ("y",), ("m",))
    assert validate([seen], [seen.values], [seen.values]).criteria == ()


def test_limits_of_ones_own():
    seen = recorded(dip())
    own = Limits("contract 7", "the operator", {"after": WindowLimits(MXE=0.01)})
    found = validate([seen], [seen.values], [seen.values + 0.02], own, "contract")
    judged = [c for c in found.criteria if np.isfinite(c.limit)]
    assert {(c.window, c.measure) for c in judged} == {("after", "MXE")}
    assert all(c.outcome == "failed" for c in judged)
    assert (found.source, found.set_by) == ("contract 7", "the operator")


def test_swings_are_compared_by_frequency_and_damping():
    after = np.clip(TIME - 2.4, 0.0, None)

    def swinging(frequency, damping):
        decay = damping / np.sqrt(1 - damping**2) * 2 * np.pi * frequency
        swing = 0.2 * np.exp(-decay * after) * np.cos(2 * np.pi * frequency * after)
        return np.where(TIME < 2.4, dip(), 0.8 + swing - 0.05 * np.exp(-after))

    seen = recorded(swinging(1.1, 0.05))
    model = np.stack([swinging(1.25, 0.09), 0 * TIME])
    found = validate([seen], [model], [model])
    assert of(found, measure="frequency").after == pytest.approx(0.15, abs=0.01)
    assert of(found, measure="damping ratio").after == pytest.approx(0.04, abs=0.005)
    calm = validate([recorded(0.8 - 0.0 * TIME)], [model], [model])
    assert of(calm, measure="frequency").outcome == "not evaluated"


def test_a_model_that_cannot_be_simulated_is_told_and_ends_nothing():
    seen = recorded(dip(), kind="step")
    lost = np.full((2, len(TIME)), np.nan)
    found = validate([seen], [seen.values], [lost], PROFILES["rte-simulation"].limits)
    assert {one.outcome for one in found.criteria if np.isfinite(one.limit)} == {"not evaluated"}
    assert (
        "the model to use cannot be simulated here"
        in of(found, signal="P", window="before", measure="ME").reason
    )
    assert "cannot be simulated" in of(found, signal="P", window="step", measure="rise").reason


def test_limits_are_for_powers_and_currents_only():
    seen = recorded(dip())
    field = replace(seen, values=np.stack([dip(), 2.0 + dip()]), channels=("P", "Efd"))
    found = validate([field], [field.values], [field.values + 1.0], PROFILES["rte-simulation"].limits)
    assert of(found, signal="Efd", window="before", measure="MAE").outcome == "no limit"
    assert of(found, signal="P", window="before", measure="MAE").outcome == "failed"


def test_noise_around_the_final_level_is_no_overshoot():
    rng = np.random.default_rng(8)
    rise = 0.5 + np.where(TIME < 2.0, 0.0, 0.2 * (1 - np.exp(-np.clip(TIME - 2.0, 0, None) / 0.5)))
    seen = recorded(rise + 1e-3 * rng.standard_normal(len(TIME)), kind="step")
    model = np.stack([rise, 0 * TIME])
    found = validate([seen], [model], [model], PROFILES["rte-tracking-site"].limits)
    told = {
        m: of(found, signal="P", measure=m).outcome for m in ("reaction", "rise", "settling", "overshoot")
    }
    assert set(told.values()) == {"passed"}, told
