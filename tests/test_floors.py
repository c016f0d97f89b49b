"""Imports only go down (the house plan's floors), and heavy libraries are imported where they are used."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import errorscreen

ROOT = Path(errorscreen.__file__).parent
FLOORS = [
    {
        "exceptions",
        "parameters",
        "recordings",
        "observations",
        "events",
        "signals",
        "resampling",
        "preparation",
        "threads",
        "processes",
    },
    {"engine", "io", "metrics", "persistence"},
    {"effects", "power"},
    {"simulators", "sampling"},
    {"features", "regressors", "network", "generation", "augmentation", "datasets", "checkpoint"},
    {"screening", "calibration"},
    {"discovery", "testing"},
    {"plotting", "cases"},
    {"cli", "report", "workflow", "bench", "__main__"},
]
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
MODULES = sorted(p for p in ROOT.rglob("*.py") if p != ROOT / "__init__.py")


def room(path):
    relative = path.relative_to(ROOT)
    return relative.parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_only_go_down(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = (
                [node.module]
                if node.module != "errorscreen"
                else [f"errorscreen.{a.name}" for a in node.names]
            )
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if name and name.startswith("errorscreen."):
                other = name.split(".")[1]
                if other == "__version__":
                    continue
                assert other in FLOOR, f"{other} stands on no floor"
                assert FLOOR[other] <= FLOOR[room(path)], (
                    f"{path.name} (floor {FLOOR[room(path)]}) imports {name}"
                )


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("errorscreen", ("torch", "skorch", "matplotlib", "andes", "dask", "numba")),
        ("errorscreen.discovery", ("torch", "skorch", "matplotlib", "andes", "dask")),
        ("errorscreen.cli", ("torch", "skorch", "matplotlib", "andes", "dask")),
    ],
)
def test_heavy_libraries_are_imported_where_they_are_used(module, heavy):
    code = f"import {module}, sys; print(*[m for m in {heavy} if m in sys.modules])"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert found == []
