"""Files whose first reading would be wrong: `init_case` reads them right, marks the guess, or says what is wrong."""

import numpy as np
import pytest

from errorscreen import read
from errorscreen.exceptions import InputError
from errorscreen.workflow.init_case import init_case
from tests.workflow.test_init_case import TIME, VALUES, check, initiated, write

pytestmark = pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")
V, ANGLE, P, Q = VALUES.values()
HEADERS, NUMBERS = ["time", "V", "P [MW]", "Q [Mvar]"], [V, P, Q]


def line_of(text, key):
    return next(line for line in text.splitlines() if line.startswith(f"{key} ="))


@pytest.mark.parametrize(
    ("stamps", "unit", "marked"),
    [
        ([f"{740000.5 + t / 86400:.10f}" for t in TIME], "d", False),  # days of MATLAB
        ([f"{1e7 * t:.0f}" for t in TIME], "ticks", False),  # from zero, in a column of that name
        ([str(k) for k in range(len(TIME) * 5)], "s", True),  # 1 s or 1 ms
        ([f"{0.1 * k:.1f}" for k in range(200)], "s", False),  # 0.1 ms would make it 0.02 s long
    ],
)
def test_units_of_time_that_several_steps_fit_are_marked(tmp_path, stamps, unit, marked):
    places = np.linspace(0, len(TIME) - 1, len(stamps))
    numbers = [np.interp(places, np.arange(len(TIME)), x) for x in NUMBERS]
    headers = ["Ticks" if unit == "ticks" else "time", *HEADERS[1:]]
    _, case, _, text = initiated(write(tmp_path, headers, numbers, time=stamps))
    assert case.recording.time_unit == unit
    assert ("CHECK" in line_of(text, "time_unit")) == marked
    if marked:
        assert "so is ms (0.001 s)" in line_of(text, "time_unit")


def test_stamps_cut_to_whole_seconds_are_refused(tmp_path):
    path = write(tmp_path, HEADERS, NUMBERS, time=[f"2026-05-03 12:34:{int(50 + t):02d}" for t in TIME])
    written = init_case(path, out=path.with_suffix(".toml"))
    (problem,) = written.missing
    assert "carry several different readings" in problem
    assert "Export the time stamps with all their decimal places" in problem
    assert "on_duplicate =" not in written.case.read_text()


def test_two_rows_at_a_step_are_those_of_a_program_where_no_sample_lacks(tmp_path):
    """A recorder with one wrong stamp repeats one and lacks the next."""
    twice = [np.insert(x, 50, x[49]) for x in NUMBERS]
    stamps = [f"{t:.2f}" for t in np.insert(TIME, 50, TIME[50])]
    _, case, recording, _ = initiated(write(tmp_path, HEADERS, twice, time=stamps))
    assert case.recording.on_duplicate == "keep-step"
    assert recording.channel("V").values[50:52] == pytest.approx(V[49:51], abs=1e-6)
    wrong = [f"{t:.2f}" for t in np.where(np.arange(len(TIME)) == 60, TIME[59], TIME)]
    (tmp_path / "b").mkdir()
    _, case, _, _ = initiated(write(tmp_path / "b", HEADERS, NUMBERS, time=wrong))
    assert case.recording.on_duplicate == "mean"


def test_a_third_of_the_rows_may_repeat_a_stamp(tmp_path):
    """A program with a variable step writes each of its iterations."""
    time = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.035, len(TIME)))
    places = np.sort(np.r_[np.arange(len(TIME)), np.arange(3, len(TIME), 3)])
    numbers = [np.interp(time, TIME, x)[places] + 1e-5 * np.arange(len(places)) for x in NUMBERS]
    _, case, *_ = initiated(write(tmp_path, HEADERS, numbers, time=[f"{t:.6f}" for t in time[places]]))
    assert case.recording.on_duplicate == "last"


def test_day_and_month_are_those_that_do_not_jump_at_midnight(tmp_path):
    midnight = np.datetime64("2026-05-04T00:00:00.000") - np.timedelta64(1500, "ms")
    texts = [str(midnight + np.timedelta64(round(1000 * t), "ms")) for t in TIME]
    stamps = [f"{one[5:7]}/{one[8:10]}/{one[:4]} {one[11:]}" for one in texts]
    _, case, recording, _ = initiated(write(tmp_path, HEADERS, NUMBERS, time=stamps))
    assert case.recording.time_format == "%m/%d/%Y %H:%M:%S.%f"
    assert recording.time[-1] == pytest.approx(TIME[-1])


@pytest.mark.parametrize(
    ("status", "good"),
    [
        ({50: "8000"}, ["0000"]),  # data error
        (
            {50: "0801", 51: "0010", 52: "2000"},
            ["0000", "0010", "0801"],
        ),  # trigger, clock unlocked; not in step
        ({50: "0801"}, None),  # nothing bad
    ],
)
@pytest.mark.parametrize("header", ["STAT", "UNIT2_STAT", "StatusFlags"])
def test_bits_of_stat_that_say_bad_are_gaps(tmp_path, header, status, good):
    path = write(tmp_path, HEADERS, NUMBERS)
    lines = path.read_text().splitlines()
    lines[0] += f",{header}"
    lines[1:] = [f"{line},{status.get(k, '0000')}" for k, line in enumerate(lines[1:])]
    path.write_text("\n".join(lines) + "\n")
    _, case, recording, text = initiated(path)
    quality = case.recording.quality
    assert (None if quality is None else quality.good) == good
    assert np.isnan(recording.channel("P").values).sum() == (good is not None)
    if good:
        assert "CHECK" not in line_of(text, "quality")


def test_delimiters_inside_quotation_marks_are_part_of_a_name(tmp_path):
    path = write(tmp_path, ["time", '"V, terminal (pu)"', '"P; gross (MW)"', '"Q, gross (Mvar)"'], NUMBERS)
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert case.recording.columns["V"].column == "V, terminal (pu)"


def test_decimal_commas_in_quotation_marks_between_commas(tmp_path):
    path = write(tmp_path, HEADERS, NUMBERS)
    quoted = [",".join(f'"{cell}"' for cell in line.split(",")) for line in path.read_text().splitlines()]
    path.write_text("\n".join([quoted[0], *(line.replace(".", ",") for line in quoted[1:])]) + "\n")
    written, case, recording, _ = initiated(path)
    assert not written.missing
    assert case.recording.decimal == ","
    check(recording)


@pytest.mark.parametrize(
    ("cell", "decimal", "remedy"),
    [
        ("1.209", ",", "without marks between thousands"),
        ('"20,001.38"', ".", "without marks between thousands"),
        ("1.5", ",", "Correct the cells"),
    ],
)
def test_marks_between_thousands_are_refused(tmp_path, cell, decimal, remedy):
    path = tmp_path / "thousands.csv"
    rows = [["0", "960"], ["1", "961"], ["2", cell], ["3", "962"]]
    delimiter = ";" if decimal == "," else ","
    path.write_text("\n".join(delimiter.join(row) for row in [["time", "P"], *rows]) + "\n")
    with pytest.raises(InputError, match="line 4, column 'P'") as caught:
        read(
            path,
            {"P": {"column": "P", "unit": "kW"}},
            time="time",
            decimal=decimal,
            base_mva=1.0,
            f_nominal=50.0,
        )
    assert remedy in str(caught.value)


@pytest.mark.parametrize(
    ("factor", "fields"),
    [(0.69, {"V": "pu"}), (230.0, {"V": "kV"}), (63.5, {"V": "kV"})],
)
def test_units_that_only_a_level_tells_are_marked(tmp_path, factor, fields):
    _, case, _, text = initiated(write(tmp_path, ["time", "V", "P", "Q"], [factor * V, 0.018 * P, 0.018 * Q]))
    for name, unit in {**fields, "P": "pu", "Q": "pu"}.items():
        assert case.recording.columns[name].unit == unit
        assert "CHECK" in line_of(text, name)


def test_a_v_at_the_end_of_a_name_is_no_unit(tmp_path):
    _, case, recording, _ = initiated(write(tmp_path, ["time", "BUS_V", "GEN_P", "GEN_Q"], NUMBERS))
    check(recording)
    assert (case.recording.columns["V"].unit, case.recording.base_kv) == ("pu", None)


@pytest.mark.parametrize(
    ("stamp", "told"),
    [
        ("2026-05-03 12:34:50.000 EST", "names the zone 'EST'"),
        ("Max", "line 202, column 'time': 'Max' is not a number"),
        ("time", "line 202, column 'time': 'time' is not a number"),
    ],
)
def test_the_cell_that_is_no_time_stamp_is_named(tmp_path, stamp, told):
    stamps = [f"{t:.2f}" for t in TIME]
    if "EST" in stamp:
        stamps = [f"2026-05-03 12:34:{50 + t:06.3f} EST" for t in TIME]
    path = write(tmp_path, HEADERS, NUMBERS, time=stamps)
    if "EST" not in stamp:
        path.write_text(path.read_text() + f"{stamp},1.1,100,50\n")
    with pytest.raises(InputError, match=told):
        init_case(path, out=path.with_suffix(".toml"))


def test_dates_with_the_name_of_the_month_in_front(tmp_path):
    stamps = [f"May 03 2026 12:34:{50 + t:06.3f}" for t in TIME]
    _, case, recording, _ = initiated(write(tmp_path, HEADERS, NUMBERS, time=stamps))
    assert case.recording.time_format == "%b %d %Y %H:%M:%S.%f"
    check(recording)


def test_channels_that_never_move_are_left_out_or_stated(tmp_path):
    still = [V, P, np.full_like(Q, 10.0), np.full_like(V, 50.0), np.full_like(V, 0.3)]
    headers = ["time", "V", "P [MW]", "Q [Mvar]", "f [Hz]", "angle [rad]"]
    written, case, recording, _ = initiated(write(tmp_path, headers, still))
    assert not written.missing
    assert {*case.recording.columns} == {"V", "P", "Q"}
    assert (case.recording.columns["Q"].value, case.recording.columns["Q"].column) == (10.0, None)
    assert case.device.constant_frequency
    check(recording)
    assert sum("never moves" in line for line in written.check) == 3
