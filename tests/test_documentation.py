"""Every public name is documented, every entry point loads, every Python block of the guide runs."""

import contextlib
import importlib
import inspect
import io
import pkgutil
import re
import sys
import tomllib
from enum import Enum
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate
from pydantic import BaseModel

import errorscreen
from errorscreen.effects import EFFECTS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GUIDE = sorted((DOCS / "guide").glob("*.md")) + sorted((DOCS / "how_it_works").glob("*.md"))
#: modules beside the packages that are for the package's own use
INTERNAL = {"__main__"}
#: numpydoc: no docstring, sections unknown or out of order, parameters that do not exist or have no type
CHECKS = {"GL06", "GL07", "GL08", "PR02", "PR06", "RT02", "SS01"}


def documented_names():
    """All names of the API pages: entries of autosummary and data directives, with their module."""
    names = []
    for page in sorted((DOCS / "api").glob("*.md")):
        module = None
        for line in page.read_text(encoding="utf-8").splitlines():
            if match := re.match(r"\.\. currentmodule:: (\S+)", line):
                module = match[1]
            elif match := re.match(r"(?:\.\. py:data:: | {3})(\w+)$", line):
                names.append(f"{module}.{match[1]}")
    return names


def find(name):
    """Object of a dotted name: the longest part that is a module, then attributes."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            found = importlib.import_module(".".join(parts[:k]))
            for part in parts[k:]:
                found = getattr(found, part)
            return found
    raise ModuleNotFoundError(name)


DOCUMENTED = documented_names()
CALLABLE = [n for n in DOCUMENTED if inspect.isclass(find(n)) or inspect.isfunction(find(n))]
PACKAGES = [
    m.name for m in pkgutil.iter_modules(errorscreen.__path__) if m.ispkg and not m.name.startswith("_")
]
MODULES = [m.name for m in pkgutil.iter_modules(errorscreen.__path__) if not m.ispkg]


def test_no_name_is_documented_twice():
    assert len(set(DOCUMENTED)) == len(DOCUMENTED)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_documented(package):
    module = importlib.import_module(f"errorscreen.{package}")
    assert {f"errorscreen.{package}.{name}" for name in getattr(module, "__all__", [])} <= set(DOCUMENTED)


@pytest.mark.parametrize("module", MODULES)
def test_every_module_is_documented_or_internal(module):
    documented = any(name.startswith(f"errorscreen.{module}.") for name in DOCUMENTED)
    assert documented != (module in INTERNAL)


@pytest.mark.parametrize("name", CALLABLE)
def test_docstring(name):
    errors = [f"{code}: {text}" for code, text in validate(name)["errors"] if code in CHECKS]
    assert not errors


@pytest.mark.parametrize("name", CALLABLE)
def test_parameters_are_documented(name):
    """Where there is a section it is complete; without one there are at most two arguments, or a runnable example."""
    target = find(name)
    if inspect.isclass(target) and issubclass(target, BaseModel | Enum | Warning | Exception):
        return  # keys of files, which have tables of their own; members; what is raised and not made
    doc = get_doc_object(target)
    bases = target.__mro__ if inspect.isclass(target) else (target,)
    sections = [get_doc_object(base) for base in bases if base is not object]
    written = {
        n.strip("* ")
        for d in sections
        for p in (*d["Parameters"], *d["Attributes"])
        for n in p.name.split(",")
    }
    missing = set(inspect.signature(target).parameters) - written
    if doc["Parameters"]:
        assert not missing
    elif len(missing) > 2:
        assert doc["Examples"], f"{name} explains neither its parameters nor shows its use"


def test_references_of_the_guide_resolve():
    others = (page for folder in ("reference", "results", "studies") for page in (DOCS / folder).glob("*.md"))
    pages = [*DOCS.glob("*.md"), *GUIDE, *others]
    found = [
        m
        for page in pages
        for m in re.findall(r"\{py:obj\}`(?:[^`<]+<|~?)([\w.]+)>?`", page.read_text(encoding="utf-8"))
    ]
    assert len(found) > 30
    for name in found:
        find(name)
        assert any(name == n or name.startswith(f"{n}.") for n in DOCUMENTED), f"{name} has no page"


def test_files_of_the_method_table_hold_the_names():
    text = (DOCS / "how_it_works" / "method.md").read_text(encoding="utf-8")
    rows = re.findall(r"\{py:obj\}`~([\w.]+)` \| `([\w/.]+)` \|", text)
    assert len(rows) >= 16
    for name, path in rows:
        assert Path(inspect.getsourcefile(find(name))) == ROOT / path


def test_stations_of_the_house_are_there():
    text = (DOCS / "how_it_works" / "house.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \d+ \| `([\w/.]+)` \| `([\w.]+)` \|", text, re.MULTILINE)
    assert 8 <= len(rows) <= 12
    for path, name in rows:
        source = (ROOT / path).read_text(encoding="utf-8")
        assert all(re.search(rf"\b(?:def|class) {part}\b", source) for part in name.split("."))


def test_the_guide_holds_no_seeds_and_no_scenario_numbers():
    """These belong to `docs/studies`, rates to `docs/results`."""
    for page in (DOCS / "guide").glob("*.md"):
        assert not re.search(r"[Ss]eeds? \d|scenario", page.read_text(encoding="utf-8")), page.name


def test_every_effect_of_a_device_has_a_section_with_its_port_and_title(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    pages = importlib.import_module("_tools.pages")
    sections = list(pages.effect_sections())
    assert len({heading.lower() for heading, *_ in sections}) == len(sections)
    assert len({file for _, file, *_ in sections}) == len(sections)
    texts = [pages.effect_text(*section) for section in sections]
    for effect in EFFECTS.values():
        for device in effect.devices if effect.kind != "latent" else ():
            start = f"### `{effect.name}`"
            (text,) = (text for text in texts if text.startswith(start) and f"`{device}`" in text)
            assert text.partition("\n")[0].endswith(f": {effect.title}")
            assert f"Acts on `{effect.port}` of " in text


@pytest.mark.parametrize("page", GUIDE, ids=lambda page: page.stem)
def test_python_blocks_of_the_guide_run(page, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(DOCS / "guide"))
    space = {"__name__": "guide"}
    with contextlib.redirect_stdout(io.StringIO()):
        for block in re.findall(
            r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
        ):
            exec(compile(block, str(page), "exec"), space)
    sys.modules.pop("governor", None)


def test_entry_points_load():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for group, entries in {"console_scripts": project["scripts"], **project.get("entry-points", {})}.items():
        for name, value in entries.items():
            assert callable(EntryPoint(name, value, group).load())
