"""The speed benchmark runs and its result has the documented form; nothing is asserted about time."""

import json

import pytest

from errorscreen import bench
from errorscreen.cli import main
from errorscreen.power import DEVICES


@pytest.mark.slow
def test_result_and_table(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bench, "_SHORTEST", 0.003)
    monkeypatch.setattr(bench, "first_use_seconds", lambda device: (2.0, 0.5))
    assert main(["bench", "speed", "--no-cnn", "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert set(result["simulations_per_second"]) == set(DEVICES)
    for figures in result["simulations_per_second"].values():
        assert set(figures) == {"1", "64", "1024"}
        assert all(value > 0 for value in figures.values())
    assert set(result["threads"]) == {"1", "2"}
    assert set(result["cwt"]) >= {"signals_per_second", "ratio_to_pywt"}
    assert result["compile_seconds"] == dict.fromkeys(DEVICES, 2.0)
    assert result["cached_import_seconds"] == dict.fromkeys(DEVICES, 0.5)
    table = (tmp_path / "table.md").read_text()
    assert all(name in table for name in DEVICES)
    assert "Written" in capsys.readouterr().out


def test_first_use_is_measured_in_new_processes():
    compiled, cached = bench.first_use_seconds("pv_plant")
    assert compiled > 0
    assert cached > 0
