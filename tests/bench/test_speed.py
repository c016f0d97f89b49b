"""The speed benchmark runs and its result has the documented form; nothing is asserted about time."""

import json
import logging
import sys
from functools import partial
from pathlib import Path

import pytest

from errorscreen.bench import speed, timing
from errorscreen.bench.labels import plot_labels
from errorscreen.cli import main
from errorscreen.models import DEVICES


@pytest.mark.slow
def test_result_and_table(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(timing, "_SHORTEST", 0.003)
    monkeypatch.setattr(speed, "first_use_seconds", lambda device: (2.0, 0.5))
    monkeypatch.setattr(speed, "BATCHES", (1, 20))
    monkeypatch.setattr(speed, "cwt_speed", partial(speed.cwt_speed, n_signals=2, n_samples=101))
    assert main(["bench", "speed", "--no-cnn", "--no-labels", "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert set(result["simulations_per_second"]) == set(DEVICES)
    for figures in result["simulations_per_second"].values():
        assert set(figures) == {"1", "20"}
        assert all(value > 0 for value in figures.values())
    assert set(result["threads"]) == {"1", "2"}
    assert set(result["cwt"]) >= {"signals_per_second", "ratio_to_pywt"}
    assert result["compile_seconds"] == dict.fromkeys(DEVICES, 2.0)
    assert result["cached_import_seconds"] == dict.fromkeys(DEVICES, 0.5)
    assert not any("labels" in key or "andes" in key for key in result)
    table = (tmp_path / "table.md").read_text()
    assert all(name in table for name in DEVICES)
    assert "39-bus" not in table
    assert "Written" in capsys.readouterr().out


MEASURED = {
    "threads": {},
    "cwt": {"signals_per_second": 1.0, "ratio_to_pywt": 1.0},
    "machine": timing.machine(),
    "labels_102500_seconds": 30.0,
    "labels_102500_seconds_default_step": 60.0,
    "labels_simulations": 102500,
    "labels_peak_gib": None,
    "labels_scaling": [{"n": 984, "seconds": 0.3}, {"n": 9840, "seconds": 3.0}],
    "labels_exponent": 1.0,
    "andes": None,
}


def test_labels_are_in_the_table_and_plotted(tmp_path):
    table = speed.table(MEASURED)
    assert "| 102500 simulations at 5 ms | 30.0 s |" in table
    assert 'pip install "errorscreen[andes]"' in table
    plot_labels(MEASURED, tmp_path / "labels.png")
    assert (tmp_path / "labels.png").read_bytes().startswith(b"\x89PNG")


def test_without_torch_the_rest_is_measured(tmp_path, monkeypatch, caplog):
    monkeypatch.delitem(sys.modules, "errorscreen.learning.network", raising=False)
    monkeypatch.delattr("errorscreen.learning.network", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.setattr(speed, "DEVICES", {})
    monkeypatch.setattr(speed, "cwt_speed", lambda: MEASURED["cwt"])
    with caplog.at_level(logging.INFO):
        result = speed.measure_speed(tmp_path, labels=False)
    assert "cnn_epoch_seconds" not in result
    assert "no epoch of the network: torch is not installed" in caplog.messages[-1]


@pytest.mark.slow
def test_first_use_is_measured_in_new_processes(monkeypatch):
    """With a cache that the first process fills for the second, which is not started here."""
    begun, stored = [], []

    def in_new_process(code, ERRORSCREEN_CACHE_DIR):
        begun.append((code, ERRORSCREEN_CACHE_DIR))
        if len(begun) == 1:
            assert not list(Path(ERRORSCREEN_CACHE_DIR).iterdir())
            return timing.in_new_process(code, ERRORSCREEN_CACHE_DIR=ERRORSCREEN_CACHE_DIR)
        stored.extend(Path(ERRORSCREEN_CACHE_DIR).rglob("*.nbi"))
        return "0.5"

    monkeypatch.setattr(speed, "in_new_process", in_new_process)
    compiled, cached = speed.first_use_seconds("pv_plant")
    assert compiled > 0
    assert cached == 0.5
    assert begun[0] == begun[1]
    assert stored
