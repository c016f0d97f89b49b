"""Imports only go down (docs/how_it_works/house.md), and heavy libraries are imported where they are used."""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import errorscreen

ROOT = Path(errorscreen.__file__).parent
#: rooms from the ground up; `discovery` has floors of its own
FLOORS = [
    {"exceptions", "parameters", "events", "arguments", "_runtime"},
    {"data", "engine", "metrics"},
    {"effects", "power"},
    {"models"},
    {"simulators"},
    {"features", "plotting", "calibration", "validation"},
    {"learning"},
    {"screening"},
    {"testing", "cases"},
    {"discovery"},
    {"report"},
    {"workflow", "bench"},
    {"cli", "api"},
    {"__main__"},
]
DISCOVERY = ["fits", "starts", "judge", "search", "unknown_input"]
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
MODULES = sorted(p for p in ROOT.rglob("*.py") if p != ROOT / "__init__.py")


def module_name(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path):
    """Modules of the package that a file imports."""
    known = {module_name(p) for p in MODULES}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in known else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def own(path):
    return {name for name in imported(path) if name.startswith("errorscreen.")}


def floor(name):
    """Floor of a module, and that inside its room; what stands at the top of a room is above its folders."""
    room, *inner = name.split(".")[1:]
    assert room in FLOOR, f"{room} stands on no floor"
    inside = DISCOVERY.index(inner[0]) if room == "discovery" and inner and inner[0] in DISCOVERY else 99
    return FLOOR[room], inside


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_only_go_down(path):
    here = floor(module_name(path))
    for name in own(path) - {"errorscreen.__version__"}:
        assert floor(name) <= here, f"{path.name} {here} imports {name} {floor(name)}"


def test_the_page_on_the_house_tells_these_floors():
    page = (ROOT.parent / "docs" / "how_it_works" / "house.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \|", page.partition("## The way")[0], re.MULTILINE)
    told = [(name, int(floor)) for floor, names in rows for name in re.findall(r"`([\w/]+)(?:\.py)?`", names)]
    rooms = {name.strip("/"): floor for name, floor in told if name.count("/") < 2}
    assert rooms == {
        room: n for n, rooms in enumerate(FLOORS, start=1) for room in rooms if room != "__main__"
    }
    inner = [name.split("/")[1] for name, _ in told if name.count("/") == 2]
    assert inner == DISCOVERY[::-1]


def test_no_modules_import_each_other():
    """No import cycle, also none that only type checkers see."""
    arrows = {module_name(p): own(p) for p in MODULES if p.name != "__init__.py"}
    TopologicalSorter({name: used & arrows.keys() for name, used in arrows.items()}).prepare()


HEAVY = {"torch", "skorch", "matplotlib", "andes", "dask"}


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("errorscreen", {*HEAVY, "numba", "numpy", "pandas", "scipy", "sklearn"}),
        ("errorscreen.discovery", HEAVY),
        ("errorscreen.cli", HEAVY),
        ("errorscreen.api", HEAVY),
    ],
)
def test_heavy_libraries_are_imported_where_they_are_used(module, heavy):
    code = f"import {module}, sys; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert heavy.isdisjoint(found.split())
