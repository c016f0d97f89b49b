"""Each row of the tables in docs/guide/recordings.md is shown by tests."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "guide" / "recordings.md"
BAD_INPUT = "data/test_bad_input::test_unusable_files_are_explained"
CLI = "test_cli::test_a_suspect_reading_ends_a_run_before_the_search"
#: tests of each row, by the first header of its table and the first cell of the row
TESTS = {
    "kind": {
        "comma, semicolon, tabulator, bar or blanks between numbers; a first line `sep=;`; comments above the header": (
            "data/readers/test_csv::test_dialects_give_the_same_recording",
            "data/readers/test_csv::test_the_layout_is_recognised",
        ),
        "decimal comma": (
            "data/readers/test_csv::test_dialects_give_the_same_recording",
            "workflow/test_init_doubtful_files::test_marks_between_thousands_are_refused",
        ),
        "no header; text below titles, as PSS/E writes channels": (
            "data/readers/test_csv::test_a_file_without_headers_is_read_by_names",
            "data/readers/test_registry::test_text_of_channels_below_a_title_is_read",
            "workflow/test_init_case::test_numbers_without_headers",
        ),
        "channels of PSS/E as `dyntools` exports them (`.csv`)": (
            "data/test_guess_psse::test_the_machine_of_the_model_file_is_found_with_its_bus",
            "data/test_guess_psse::test_a_row_that_counts_the_columns_is_no_header",
        ),
        "channels of PSLF as text": ("workflow/test_init_names::test_names_of_channels_in_pslf",),
        "two rows of headers, as simulation programs write them": (
            "data/readers/test_csv::test_two_rows_may_name_a_column",
        ),
        "a row of units below the header": (
            "data/readers/test_csv::test_a_row_of_units_counts_where_none_is_stated",
            BAD_INPUT,  # another unit in the row of units
        ),
        "UTF-16 with or without mark, Latin-1": (
            "data/readers/test_csv::test_the_layout_is_recognised",
            "data/readers/test_csv::test_encodings",
        ),
        "time in ms, µs, ns, ticks of 100 ns, minutes, hours, days": (
            "data/test_timestamps::test_units_of_time",
            "data/test_timestamps::test_serial_dates_count_from_the_first",
        ),
        "dates of ISO 8601, also with `UTC`, a decimal comma or offsets such as `+01:00`": (
            "data/test_timestamps::test_texts_of_historians",
            "data/test_dates::test_an_offset_is_read",
        ),
        "other dates, and times of day": (
            "data/test_timestamps::test_texts_of_historians",
            "data/test_timestamps::test_an_unknown_text_is_refused_with_the_formats_that_fit",
        ),
        "second of century and fraction; date and time of day": (
            "data/test_timestamps::test_time_in_two_columns",
        ),
        "several rows at the instant of a step, as Dynawo (`curves.csv`) and EMT programs write them": (
            "data/test_timestamps::test_rows_of_a_step_at_one_instant",
            "workflow/test_init_case::test_curves_of_dynawo",
        ),
        "a status of each row, as STAT of a concentrator": (
            "workflow/test_init_doubtful_files::test_bits_of_stat_that_say_bad_are_gaps",
            "data/readers/test_csv::test_rows_with_a_bad_status_are_gaps",
        ),
        'numbers or texts that mean "no reading"': (
            "data/readers/test_csv::test_gaps_are_read_in_any_spelling",
            "data/readers/test_csv::test_numbers_may_mark_gaps",
        ),
        "COMTRADE of 1991, 1999 and 2013, in two files or one; ASCII, BINARY, BINARY32, FLOAT32 (extra `comtrade`)": (
            "data/readers/test_comtrade::test_every_kind_of_data_gives_the_same_recording",
            "data/readers/test_comtrade::test_one_file_may_hold_all_parts",
        ),
        "a tag, a time, a value and perhaps a status in each row (long format)": (
            "data/readers/test_long::test_tags_become_columns_in_any_order_of_rows",
            "data/readers/test_long::test_gaps_status_and_several_readings",
        ),
        "three phases as magnitude and angle, as real and imaginary part, or as texts `230.1+12.3j` or `230.1∠12.5`": (
            "data/test_phasors::test_three_phases_give_the_positive_sequence",
            "data/test_phasors::test_real_and_imaginary_parts",
            "data/test_phasors::test_texts_in_a_file",
        ),
        "PSCAD/EMTDC: `.inf` with `_01.out`, `_02.out` … beside it": (
            "data/readers/test_pscad::test_files_of_a_run_are_joined",
            "data/readers/test_pscad::test_equal_names_get_their_group_or_a_number",
        ),
        "workbook `.xlsx` (extra `excel`)": (
            "data/readers/test_excel::test_sheets_headers_and_units",
            "data/readers/test_excel::test_two_rows_of_headers",
            "data/readers/test_excel::test_dates_and_a_text_among_numbers",
            "data/readers/test_excel::test_other_archives_and_a_missing_package",
        ),
        "MATLAB version 5, and 7.3 (extra `matlab`)": (
            "data/readers/test_matlab::test_vectors",
            "data/readers/test_matlab::test_a_matrix_gives_numbered_columns",
            "data/readers/test_matlab::test_structs",
            "data/readers/test_matlab::test_a_missing_package",
        ),
        "Parquet (extra `parquet`)": (
            "data/readers/test_parquet::test_columns_of_numbers",
            "data/readers/test_parquet::test_types_of_time_stamps",
            "data/readers/test_parquet::test_durations_times_of_day_and_texts",
            "data/readers/test_parquet::test_the_index_of_pandas",
            "data/readers/test_parquet::test_a_missing_package",
        ),
        "a pandas table with an index of dates, zones, nullable, categorical or Arrow types, headers of several "
        "levels": (
            "data/test_pandas_tables::test_an_index_of_instants",
            "data/test_pandas_tables::test_types_of_numbers",
            "data/test_pandas_tables::test_arrow_dates",
            "data/test_pandas_tables::test_headers_of_several_levels_are_joined",
        ),
        "`.psout` of PSCAD, `.chf` of PSLF, binary `.out` of PSS/E, tables of Modelica, objects of MATLAB, HDF5, "
        "`.xls`, compressed files, files above 2 GiB": (
            "data/readers/test_registry::test_formats_of_programs_are_refused_by_name",
            "data/readers/test_matlab::test_objects_are_refused_by_name",
            "data/readers/test_excel::test_other_archives_and_a_missing_package",
            "data/readers/test_registry::test_a_file_above_the_largest_size_is_refused_at_once",
        ),
    },
    "check": {
        "V before the event near 1/√3, √2, √(2/3) or √3 pu, or outside 0.5 to 1.5 pu": (
            "data/test_plausibility::test_a_voltage_of_another_kind_is_named_by_its_factor",
            "data/test_plausibility::test_limits_of_the_voltage",
            CLI,
        ),
        "f before the event more than 5 % off `f_nominal`": (
            "data/test_plausibility::test_a_frequency_of_another_unit_is_named",
            "data/test_plausibility::test_limits_of_the_frequency",
        ),
        "the slope of the angle over f − `f_nominal`": (
            "data/test_plausibility::test_the_angle_must_follow_from_the_frequency",
            "data/test_plausibility::test_a_unit_of_the_frequency_is_named_by_the_angle",
        ),
        "jumps of the angle by 360 where its unit is rad; an angle that turns at more than 1 Hz before the event": (
            "data/test_plausibility::test_degrees_without_their_unit_show_in_the_jumps_of_the_angle",
            "data/test_plausibility::test_degrees_without_their_unit_turn_too_fast",
        ),
        "fewer than 0.01 or more than 1000 samples in a period of the nominal frequency": (
            "data/test_plausibility::test_time_in_another_unit_is_named",
            "data/test_plausibility::test_limits_of_the_sampling",
        ),
        "rows in which V, P, Q (or f) are exactly zero between others; or one of V, P, Q is in a few rows while the "
        "others stay": (
            "data/test_plausibility::test_rows_of_zeros_are_taken_for_lost_frames",
            "data/test_plausibility::test_zeros_of_one_channel_are_taken_for_lost_frames",
        ),
        "different rows at one instant, and a sample of the grid missing beside them": (
            "data/test_plausibility::test_a_wrong_stamp_beside_a_missing_sample_is_doubted",
        ),
        "V is one of three columns of phases (`VA`, `VB`, `VC`; `L1`, `L2`, `L3`) that move in different ways": (
            "data/test_phase_headers::test_one_phase_that_dips_alone_is_doubted",
            "data/test_phase_headers::test_the_other_phases_of_a_file_are_looked_at",
        ),
        "V below zero by more than 1 %": ("data/test_plausibility::test_a_negative_magnitude_is_doubted",),
        "equal readings more than ten times as far from the others as these lie apart": (
            "data/test_plausibility::test_equal_readings_far_beyond_the_others_are_doubted",
        ),
        "P above 2 pu, below 0.01 pu or negative; Q above 0.3 pu and 1.5 times P, of a plant": (
            "workflow/test_advice::test_wrong_units_bases_and_signs_are_doubted",
            "test_cli_discovery::test_a_doubtful_sign_is_what_to_check_first",
        ),
        "the error of the model as it is, with the other sign of Q, P or the angle, with P and Q interchanged": (
            "discovery/test_readings::test_a_wrong_reading_is_named",
            "discovery/test_readings::test_the_sign_of_P_alone_is_named_beside_that_of_the_angle",
            "discovery/test_readings::test_interchanged_powers_are_named",
            "workflow/test_check_case::test_a_suspect_reading_is_told_apart",
        ),
    },
    "found in the data": {
        "irregular sampling": (
            "data/test_frames::test_irregular_sampling_is_said",
            "data/test_resampling::test_irregular_samples_are_interpolated_linearly",
        ),
        "samples that a regular grid lacks": (
            "data/test_plausibility::test_lost_samples_of_a_regular_grid_are_told_with_their_places",
        ),
        "gaps, NaN, infinite or absurdly large readings (above 1e12)": (
            "data/readers/test_csv::test_gaps_are_read_in_any_spelling",
            "data/test_frames::test_assumptions_are_written_down",
            "data/test_frames::test_readings_too_large_to_calculate_with_are_gaps",
            BAD_INPUT,  # half of the readings missing
        ),
        "readings held by a slow meter": (
            "data/test_recordings::test_held_readings_are_dropped_or_kept_and_said",
            "simulators/plant/test_injection_noise::test_held_readings_are_uncertain_by_what_the_channel_did_while_they_"
            "were_held",
            "discovery/judge/test_ranking::test_times_are_known_no_better_than_readings_are_stamped",
        ),
        "equal time stamps": (
            "data/test_timestamps::test_equal_duplicates_are_dropped_and_others_averaged",
            "data/test_timestamps::test_stamps_without_decimals_are_refused",
            "data/test_timestamps::test_rows_of_a_step_at_one_instant",
            "data/test_plausibility::test_a_jump_between_equal_stamps_is_removed_before_their_mean",
        ),
        "time that runs backwards": (
            "data/test_timestamps::test_backward_time_is_refused_with_its_line",
            "data/test_timestamps::test_sorting_undoes_any_shuffle",
            "data/test_timestamps::test_a_single_wrong_stamp_is_dropped",
        ),
        "a column that moves by less than 1e-6 of its value, text or phasors among numbers, two columns of one name": (
            BAD_INPUT,  # channel that moves by rounding only, text in a number column, column twice
            "data/test_phasors::test_texts_in_a_file",
        ),
        "implausible values": ("data/test_recordings::test_implausible_values_are_warned_of",),
        "a pipe or a device instead of a file": (
            "workflow/test_paths_that_never_end::test_no_reader_reads_them",
            "workflow/test_paths_that_never_end::test_no_command_reads_them",
        ),
    },
}


def tables():
    """Rows of each table by its first header; a bar behind a backslash does not separate cells."""
    found, rows = {}, None
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if not line.startswith("|"):
            rows = None
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if rows is None:
            rows = found.setdefault(cells[0], [])
        elif set(line) - {*"|-: "}:
            rows.append(cells)
    return found


@cache
def functions(module):
    """Names of the tests of a file, by its text, without importing what it needs."""
    tree = ast.parse((ROOT / "tests" / f"{module}.py").read_text(encoding="utf-8"))
    return {
        one.name for one in tree.body if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")
    }


@pytest.mark.parametrize("table", TESTS)
def test_each_row_has_its_tests(table):
    rows = tables()[table]
    assert all(len(cells) == 2 for cells in rows), "a bar within a cell cuts it off on the page"
    assert [cells[0] for cells in rows] == [*TESTS[table]], "a row without tests, or tests without a row"


def test_all_named_tests_exist():
    named = {name for rows in TESTS.values() for tests in rows.values() for name in tests}
    missing = [name for name in named if name.split("::")[1] not in functions(name.split("::")[0])]
    assert missing == []
    assert all(tests for rows in TESTS.values() for tests in rows.values())
