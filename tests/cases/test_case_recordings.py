"""Recordings of case files: windows of a file, and a measured one."""

from pathlib import Path

import numpy as np
import pytest

from errorscreen.cases.case_file import Case, load_case
from errorscreen.exceptions import InputError
from tests.cases.test_case_file import GOOD, write, write_recording


def test_the_grid_fault_case():
    file = Path(__file__).resolve().parents[3] / "shared" / "data" / "grid_fault_recording" / "recording.csv"
    if not file.is_file():
        pytest.skip(f"{file} is not on this machine")
    columns = {
        name: {"column": header, "base": 1000.0} for name, header in (("P", "P_pu1000"), ("Q", "Q_pu1000"))
    }
    case = Case.model_validate(
        {
            "recording": {
                "path": str(file),
                "base_mva": 737.0,
                "f_nominal": 60.0,
                "t_end": 4.1,
                "shift": {"V": -2 / 60, "angle": -2 / 60},
                "columns": {"V": {"column": "V_mag"}, "angle": {"column": "V_ang_rad"}, **columns},
            },
            "device": {
                "type": "synchronous_machine",
                "relative": 0.5,
                "parameters": {
                    "Xd": {"nominal": 0.95},
                    "Xq": {"nominal": 0.68},
                    "D": {"nominal": 1.0, "lower": 0.0, "upper": 2.0},
                },
                "constants": {"Ra": 0.0015},
            },
        }
    )
    rec = case.load_recording()
    assert rec.time[-1] <= 4.1
    assert rec.initial("P")["P"] == pytest.approx(0.846, abs=1e-3)
    assert case.parameters()["Xq"].upper == pytest.approx(1.02)


def test_an_earlier_event_outside_the_window_does_not_count(tmp_path):
    """Neither for the event that is detected, nor for the quiet part of one that is stated."""
    time = np.arange(0, 12, 0.02)
    rng = np.random.default_rng(0)
    dips = sum(np.where(time >= t, np.exp(-2 * np.clip(time - t, 0, None)), 0.0) for t in (1.0, 7.0))
    rows = zip(
        time,
        20 - 8 * dips + 0.002 * rng.normal(size=len(time)),
        -40 + 30 * dips + 0.02 * rng.normal(size=len(time)),
        strict=True,
    )
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "rec.csv").write_text(
        "\n".join(["time,U,P", *(f"{t:.2f},{u},{p}" for t, u, p in rows)])
    )
    for window in ("t_start = 5.0", "t_start = 5.0\nevent_time = 7.0"):
        rec = load_case(write(tmp_path, GOOD.replace("t_end = 2.5", window))).load_recording()
        assert (rec.time[0], rec.event_time, rec.quiet[0]) == (5.0, 7.0, 5.0)
        assert rec.channel("P").noise == pytest.approx(0.02 / 50, rel=0.3)
        assert any("250 of 600 samples lie outside the window" in s for s in rec.assumptions)
    both = load_case(write(tmp_path, GOOD.replace("t_end = 2.5", "event_time = 7.0")))
    with pytest.raises(InputError, match="moves from 1 s on.* set t_start"):
        both.load_recording()


def test_a_window_that_ends_before_the_event_is_refused(tmp_path):
    write_recording(tmp_path)
    case = load_case(write(tmp_path, GOOD.replace("t_end = 2.5", "t_end = 1.1\nevent_time = 1.0")))
    with pytest.raises(InputError, match="3 samples lie after the event at 1 s"):
        case.load_recording()
