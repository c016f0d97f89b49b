"""Readings that a wrong unit, base, sign or nominal frequency would explain."""

import warnings

import numpy as np
import pandas as pd
import pytest

from errorscreen.data import Recording, from_frame
from errorscreen.data.plausibility import Doubt
from errorscreen.exceptions import DataWarning

TIME = np.arange(0, 6, 0.02)
DIP = np.where((TIME >= 2) & (TIME < 2.2), 0.7, 1.0) + 1e-4 * np.random.default_rng(0).standard_normal(
    len(TIME)
)
#: Hz: a swing after the event
SWING = 0.02 + 0.3 * np.sin(5 * (TIME - 2)) * np.exp(-(TIME - 2)) * (TIME >= 2)
ANGLE = 2 * np.pi * np.concatenate([[0.0], np.cumsum(0.5 * (SWING[1:] + SWING[:-1]) * 0.02)])


def doubts(time=TIME, f_nominal=50.0, **values):
    """Doubts about a recording, which are warned of as well."""
    values = {"V": DIP, **values}
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        rec = Recording.from_arrays(time, values, base_mva=1, f_nominal=f_nominal)
    found = [str(note) for note in rec.assumptions if isinstance(note, Doubt)]
    assert [str(w.message).split(": ", 1)[1] for w in seen] == found
    return found, rec.assumptions


@pytest.mark.parametrize(
    ("factor", "told"),
    [
        (1 / np.sqrt(3), "1/√3: measured from line to neutral? Then set line_neutral = true"),
        (np.sqrt(2), "√2: a peak value? Then set scale = 0.70711"),
        (np.sqrt(2 / 3), "√(2/3): a peak value from line to neutral? Then set scale = 1.22474"),
        (np.sqrt(3), "√3: a base from line to neutral?"),
        (20.0, "V before the event is 20 pu: check its unit and base_kv."),
    ],
)
def test_a_voltage_of_another_kind_is_named_by_its_factor(factor, told):
    (found,), _ = doubts(V=factor * DIP)
    assert told in found


@pytest.mark.parametrize("V", [0.9, 1.0, 1.1])
def test_a_usual_voltage_is_not_doubted(V):
    assert doubts(V=V * DIP)[0] == []


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1 / 86400, "d"), (1 / 3600, "h")])
def test_time_in_another_unit_is_named(factor, unit):
    (found,), _ = doubts(time=factor * TIME)
    assert f"time_unit = '{unit}' (0.02 s)" in found


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1e3, "mHz (unit = 'mHz' or 'mHz deviation')"), (0.02, "pu (unit = 'pu' or 'pu deviation')")],
)
def test_a_unit_of_the_frequency_is_named_by_the_angle(factor, unit):
    """Its level is that of 50 Hz, and only its moves are of another size."""
    moves = SWING - SWING[0]
    angle = 2 * np.pi * np.concatenate([[0.0], np.cumsum(0.5 * (moves[1:] + moves[:-1]) * 0.02)])
    (found,), _ = doubts(angle=angle, f=50 + factor * moves)
    assert f"with the frequency in {unit} it does" in found


@pytest.mark.parametrize(("samples", "doubted"), [(0.009, 1), (0.011, 0), (950.0, 0), (1050.0, 1)])
def test_limits_of_the_sampling(samples, doubted):
    found, _ = doubts(time=TIME / samples)  # TIME has a sample in each period
    assert len(found) == doubted


@pytest.mark.parametrize(("V", "doubted"), [(0.49, 1), (0.51, 0), (1.3, 0), (1.51, 1)])
def test_limits_of_the_voltage(V, doubted):
    assert len(doubts(V=V * DIP)[0]) == doubted


@pytest.mark.parametrize(("f", "doubted"), [(47.0, 1), (48.0, 0), (52.0, 0), (53.0, 1)])
def test_limits_of_the_frequency(f, doubted):
    assert len(doubts(f=f + SWING)[0]) == doubted


@pytest.mark.parametrize(
    ("sign", "unit", "told"),
    [
        (1.0, 1.0, None),
        (-1.0, 1.0, "the other sign of the angle (scale = -1)"),
        (1.0, 180 / np.pi, "the angle in degrees (unit = 'deg')"),
        (-1.0, 180 / np.pi, "in degrees and of the other sign"),
    ],
)
def test_the_angle_must_follow_from_the_frequency(sign, unit, told):
    found, notes = doubts(angle=sign * unit * ANGLE, f=50 + SWING)
    if told is None:
        assert found == []
        assert any("their slope is 1.00" in note for note in notes)
    else:
        assert told in found[0]


def test_degrees_without_their_unit_turn_too_fast():
    (found,), _ = doubts(angle=np.degrees(ANGLE))
    assert "turns at 1.15 Hz" in found
    assert "unit = 'deg'" in found


def test_angle_and_frequency_that_hardly_move_say_nothing():
    rng = np.random.default_rng(1)
    angle, f = 1e-3 * rng.standard_normal((2, len(TIME)))
    found, notes = doubts(angle=angle + (TIME > 2) * 1e-3, f=50 + f)
    assert found == []
    assert not any("slope" in note for note in notes)


@pytest.mark.parametrize(
    ("f", "nominal", "told"),
    [
        (50 + SWING, 60.0, "f_nominal = 50?"),
        (1 + SWING / 50, 50.0, "unit = 'pu'"),
        (2 * np.pi * (50 + SWING), 50.0, "unit = 'rad/s'"),
        (1e3 * (50 + SWING), 50.0, "unit = 'mHz'"),
        (SWING, 50.0, "unit = 'Hz deviation'"),
        (50 + 1e3 * SWING, 50.0, "unit = 'mHz deviation'"),
        (SWING / 50, 50.0, "'pu deviation'"),
    ],
)
def test_a_frequency_of_another_unit_is_named(f, nominal, told):
    assert told in doubts(f=f, f_nominal=nominal)[0][0]


def test_rows_of_zeros_are_taken_for_lost_frames():
    lost = slice(200, 203)
    V, P = DIP.copy(), 0.5 + 0.2 * (TIME > 2)
    V[lost], P[lost] = 0.0, 0.0
    (found,), _ = doubts(V=V, P=P)
    assert found.startswith("3 rows, the first at 4 s, hold exactly 0 in V, P")
    V[200:], P[200:] = 0.0, 0.0
    assert doubts(V=V, P=P)[0] == [], "a unit that trips stays at zero"
    f = 50 + SWING
    f[lost] = 0.0
    assert any(one.startswith("3 rows, the first at 4 s, hold exactly 0 in f") for one in doubts(f=f)[0])


@pytest.mark.parametrize("name", ["V", "P", "Q"])
def test_zeros_of_one_channel_are_taken_for_lost_frames(name):
    rng = np.random.default_rng(3)
    values = {"V": DIP.copy(), "P": 0.5 + 0.2 * (TIME > 2), "Q": 0.1 + 0.1 * (TIME > 2)}
    values = {key: v + 1e-4 * rng.standard_normal(len(TIME)) for key, v in values.items()}
    values[name][200:203] = 0.0
    values[name][240] = 0.0
    (found,), _ = doubts(**values)
    assert found.startswith(f"4 rows, the first at 4 s, hold exactly 0 in {name}, but not in ")
    assert "lost frames?" in found
    f = 50 + SWING
    assert any("hold exactly 0 in" in one for one in doubts(f=f, **values)[0])


@pytest.mark.parametrize(
    ("V", "P", "Q", "why"),
    [
        (0.002, 0.01, 0.02, "a bolted fault near the terminals"),
        (0.0, 0.0, 1.5, "a simulated one behind the transformer, whose reactance takes Q"),
        (0.15, 0.0, 0.3, "a converter that blocks in a dip"),
    ],
)
def test_faults_are_no_lost_frames(V, P, Q, why):
    values = {"V": DIP.copy(), "P": 0.5 + 0.0 * TIME, "Q": 0.1 + 0.0 * TIME}
    fault = slice(100, 106)
    for name, level in (("V", V), ("P", P), ("Q", Q)):
        values[name][fault] = level
    assert doubts(**values)[0] == [], why


def test_a_power_that_passes_through_zero_or_rests_there_is_not_doubted():
    rng = np.random.default_rng(4)
    about = np.round(0.02 * rng.standard_normal(len(TIME)), 2)  # a coarse meter about zero
    P = np.where((TIME > 3) & (TIME < 4), 0.0, 0.5)  # a test of the set-point
    assert doubts(P=P, Q=about + 0.1 * (TIME > 2))[0] == []


def test_a_wrong_stamp_beside_a_missing_sample_is_doubted():
    """Two rows of a fault at one instant: their mean is neither, and a sample is missing behind them."""
    time, k = TIME.round(2), 110  # in the recovery: the readings differ by 0.3 pu
    assert abs(DIP[k] - DIP[k - 1]) > 0.2
    time[k] = time[k - 1]
    table = {"t": time, "V": DIP, "angle": ANGLE}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (found,) = [note for note in _read(table).assumptions if isinstance(note, Doubt)]
        assert found.startswith(
            "2 rows at 2.18 s differ in 'V', 'angle', and a sample beside them is missing"
        )
        assert "on_duplicate = 'last'" in found
        for one in (
            _read(table, on_duplicate="last"),
            _read({**table, "V": np.where(np.arange(len(DIP)) == k - 1, DIP[k], DIP), "angle": 0.1 * TIME}),
            _read({**table, "t": np.insert(TIME.round(2), k, time[k])[:-1]}),  # no sample is missing
        ):
            assert not any(isinstance(note, Doubt) for note in one.assumptions)


def test_degrees_without_their_unit_show_in_the_jumps_of_the_angle():
    degrees = (np.degrees(20 * ANGLE) + 170.0 + 180.0) % 360.0 - 180.0
    table = {"t": TIME, "V": DIP, "angle": degrees}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rec = _read(table)
    found = [note for note in rec.assumptions if isinstance(note, Doubt)]
    assert any("jumps by 360, but its unit is rad" in note for note in found)


def test_a_jump_between_equal_stamps_is_removed_before_their_mean():
    """The mean of 179.9 and -179.9 degrees is not zero."""
    time, degrees = TIME.round(2), (170.0 + 0.36 * np.arange(len(TIME)) + 180.0) % 360.0 - 180.0
    k = int(np.argmin(degrees)) - 1  # the last before the jump
    time[k + 1] = time[k]
    with pytest.warns(DataWarning, match="their mean was taken"):
        rec = _read({"t": time, "V": DIP, "angle": degrees}, angle={"column": "angle", "unit": "deg"})
    steps = np.degrees(np.diff(rec.channel("angle").values))
    assert steps.min() > 0.1
    assert steps.max() < 1.0


def _read(table, angle="angle", **options):
    columns = {"V": "V", "angle": angle}
    return from_frame(pd.DataFrame(table), columns, time="t", base_mva=1, f_nominal=50, **options)


def test_a_negative_magnitude_is_doubted():
    V = DIP.copy()
    V[120:125] = -0.3
    (found,), _ = doubts(V=V)
    assert found.startswith("V is negative in 5 readings, the first at 2.4 s: a magnitude is not.")
    V[120:125] = -0.005
    assert doubts(V=V)[0] == [], "an instrument may read this of zero"


def test_equal_readings_far_beyond_the_others_are_doubted():
    table = {"t": TIME, "V": np.where((TIME > 4) & (TIME < 4.05), 655.35, DIP), "angle": ANGLE}
    with pytest.warns(
        DataWarning, match=r"2 readings are exactly 655.35, far beyond.*missing = \['655.35'\]"
    ):
        rec = _read(table, event_time=2.0)
    assert any(isinstance(note, Doubt) and "a mark of a gap?" in note for note in rec.assumptions)
    rec = _read(table, missing=["655.35"])
    assert np.isnan(rec.channel("V").values).sum() == 2
    still = np.where((TIME > 2) & (TIME < 2.5), 0.4, 1e-3 * np.sin(TIME))
    rec = _read({**table, "V": DIP, "angle": still})
    assert not any(isinstance(note, Doubt) for note in rec.assumptions), "about zero, 0.4 may well be"


def test_lost_samples_of_a_regular_grid_are_told_with_their_places():
    keep = ~np.isin(np.arange(len(TIME)), [50, 51, 52, 200])
    rec = _read({"t": TIME[keep], "V": DIP[keep], "angle": ANGLE[keep]})
    told = "4 samples are missing in a grid of 0.02 s, in 2 places: 3 after 0.98 s, 1 after 3.98 s."
    assert told in rec.assumptions
    jitter = TIME + 0.006 * np.sin(np.arange(len(TIME)))
    rec = _read({"t": jitter, "V": DIP, "angle": ANGLE})
    assert not any("missing" in note for note in rec.assumptions)
    assert any("s apart (median" in note for note in rec.assumptions)
