"""The comparison of two checkouts reports every difference, and fails for another verdict or name only."""

import runpy
from pathlib import Path

import pytest

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "compare_checkouts.py"))
ROW = {
    "verdict": "effect",
    "names": ["exciter"],
    "probabilities": {"exciter": 0.9, "unknown": 0.1},
    "theta": {"Xd": 1.0, "exciter.K": 20.0},
    "intervals": {"exciter.K": [19.0, None]},
    "simulations": 100,
}


@pytest.mark.parametrize(
    ("change", "code", "line"),
    [
        ({}, 0, "1 cases, 0 with a difference"),
        (
            {"theta": {"Xd": 1.0, "exciter.K": 25.0}},
            0,
            "| effect exciter | same | 0.0e+00 | 2.0e-01 | 0.0e+00 | 1.00 |",
        ),
        ({"theta": {"Xd": 1.0}}, 0, "| effect exciter | same | 0.0e+00 | 0.0e+00+ |"),
        ({"verdict": "unknown", "names": []}, 1, "| plant-3 | effect exciter | unknown |"),
        ({"names": ["governor"]}, 1, "1 with another verdict or other names"),
    ],
)
def test_differences_are_reported(change, code, line, capsys):
    assert (
        SCRIPT["print_differences"]({"plant-3": ROW}, {"plant-3": {**ROW, **change}}, rounded=False) == code
    )
    assert line in capsys.readouterr().out


def test_committed_rows_differ_by_rounding_only(capsys):
    row = SCRIPT["row_of"](
        {
            "verdict": "effect", "named": ["exciter"], "simulations": 100, "seconds": 1.0,
            "causes": [{"name": "exciter", "probability": 0.9}, {"name": "unknown", "probability": 0.1}],
            "intervals": [{"name": "exciter.K", "value": 20.0001, "interval": [19.0, None]}],
        }
    )  # fmt: skip
    assert SCRIPT["print_differences"]({"plant-3": row}, {"plant-3": ROW}, rounded=True) == 0
    assert "1 cases, 0 with a difference" in capsys.readouterr().out
