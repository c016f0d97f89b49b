"""Rates of many searched scenarios, counted by hand."""

import pytest

from errorscreen.bench.discovery_output import tables
from errorscreen.bench.discovery_rates import summarise
from tests.bench.test_discovery import record


def test_rates_count_what_they_say():
    place = {"device": "pv_plant", "port": "Pm"}
    rows = [
        *[record("effect", "correct")] * 6, *[record("effect", "wrong", 0.6, False)] * 2,
        *[record("other form", "unknown", 1.0, False)] * 2, *[record("nothing", "correct")] * 3,
        record("nothing", "false alarm", 0.8, False), record("outside", "correct", verdict="unknown", place=place),
        record("two effects", "unknown", 1.0, False),
    ]  # fmt: skip
    found = summarise(rows)
    rates = {name: entry["value"] for name, entry in found["rates"].items()}
    assert rates["correct"] == 0.6
    assert rates["wrong"] == rates["unknown"] == 0.2
    assert rates["false_alarm"] == 0.25
    assert rates["outside_unknown"] == rates["outside_place"] == rates["outside_port"] == 1
    assert rates["both_found"] == 0
    assert found["held_out_ratio_median"] == pytest.approx(0.1)
    assert found["true_structure_ratio_median"] == pytest.approx(1.25)
    assert found["true_structure_ratio_p90"] == pytest.approx(1.25)
    low, high = found["rates"]["correct"]["interval"]
    assert low == pytest.approx(0.262, abs=1e-3)  # 6 of 10, Clopper and Pearson
    assert high == pytest.approx(0.878, abs=1e-3)
    assert found["rates"]["outside_unknown"]["interval"][0] == pytest.approx(0.025)  # one of one tells little
    # 10 right at 0.9, 2 wrong at 0.6, 1 wrong at 0.8, 3 wrong at 1.0, which shares a bin with 0.9
    assert found["expected_calibration_error"] == pytest.approx(
        (13 * abs((10 * 0.9 + 3 * 1.0) / 13 - 10 / 13) + 2 * 0.6 + 0.8) / 16
    )


def test_intervals_are_counted_over_all_parameters():
    found = [
        {"name": f"a.{i}", "true": true, "value": 1.0, "interval": [0.9, 1.2]}
        for i, true in enumerate((0.9, 1.1, 1.3))
    ]
    rows = [
        record("effect", "correct", intervals=found[:2]),
        record("two effects", "correct", intervals=found[2:]),
    ]
    rows.append(record("nothing", "correct", intervals=[]))
    result = summarise(rows)
    holds = result["rates"]["interval_holds"]
    assert (holds["value"], holds["n"]) == (pytest.approx(2 / 3), 3)
    table = tables(
        {"case": "plant", "seed": 1, "noise_db": 40.0, "least_size": 3.0, "scenarios": rows, **result}
    )
    assert "hold the true value | 0.667" in table
