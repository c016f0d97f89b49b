"""Labels are timed, and compared with ANDES where it is installed; nothing is asserted about time."""

import contextlib
import io
import logging

import numba
import pytest

from errorscreen.bench import labels
from errorscreen.bench.speed import dip_event
from errorscreen.simulators import PlantSimulator
from tests.power.andes_reference import andes, prepare

#: simulations of one sample of the plant that stands in for the 39-bus system, which compiles for long
COST = 18


def printed(code):
    """What code prints in this process, which has imported all that new ones would have to import first."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(code, {})
    return out.getvalue()


@pytest.fixture
def tiny(monkeypatch):
    for name, value in {"SAMPLES": 3, "SIZES": (18, 70), "ANDES_RUNS": 1, "ANDES_COARSE_RUNS": 1}.items():
        monkeypatch.setattr(labels, name, value)
    monkeypatch.setattr(labels, "load_ieee39", lambda **step: PlantSimulator("pv_plant", dip_event(), **step))
    monkeypatch.setattr(labels, "in_new_process", printed)


@pytest.mark.slow
@andes
def test_everything_at_a_tiny_size(tiny, caplog):
    prepare()
    with caplog.at_level(logging.INFO):
        found = labels.measure_labels()
    assert [row["n"] for row in found["labels_scaling"]] == [COST, 4 * COST]
    assert found["labels_simulations"] == 3 * COST
    threads = numba.config.NUMBA_NUM_THREADS
    assert found["labels_threads"] == threads
    assert found["labels_peak_gib"] is None or found["labels_peak_gib"] > 0.05
    reference = found["andes"]
    assert reference["variables"] > 500
    assert reference["default_step"] > reference["coarse_step"] == labels.COARSE
    first, second, same_step = reference["ratios"]
    assert (
        found["ratio_to_andes"]
        == first["ratio"]
        == pytest.approx(3 * COST * reference["default_step_seconds"] / found["labels_102500_seconds"])
    )
    assert found["ratio_to_andes_default_step"] == second["ratio"]
    assert (first["step"], second["step"], same_step["step"]) == (0.005, 0.0025, 0.005)
    assert first["per_core"] == first["ratio"] / threads
    assert "times its throughput" in caplog.text
    table = "\n".join(labels.label_rows(found))
    assert "| 54 simulations at 2.5 ms |" in table
    assert f"({first['per_core']:.0f} per core)" in table


def test_without_andes_the_ratio_is_null_and_the_extra_is_named(tiny, monkeypatch, caplog):
    monkeypatch.setattr(labels.importlib.util, "find_spec", lambda name: None)
    run = {"simulations": 123, "seconds": 0.5, "threads": 2, "peak_gib": 0.3}
    monkeypatch.setattr(labels, "label_run_in_new_process", lambda step, samples: run)
    with caplog.at_level(logging.INFO):
        found = labels.measure_labels()
    assert found["andes"] is found["ratio_to_andes"] is found["ratio_to_andes_default_step"] is None
    assert found["labels_peak_gib"] == 0.3
    assert 'pip install "errorscreen[andes]"' in caplog.messages[-1]


def test_a_proportion_has_exponent_one():
    assert labels.exponent([{"n": n, "seconds": 3e-4 * n} for n in labels.SIZES]) == pytest.approx(1)
