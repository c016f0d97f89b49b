"""Tables of the documentation follow from the package: `make generated` renews them."""

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def pages(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("_tools.pages")


def test_tables_are_current(pages):
    """All but numbers of simulations, which take minutes."""
    stale = [
        str(page.relative_to(ROOT))
        for page in pages.pages()
        if pages.renewed(page, computed=False) != page.read_text(encoding="utf-8")
    ]
    assert not stale, "run `make generated`"


def test_every_table_stands_on_a_page(pages):
    found = {
        name for page in pages.pages() for name, _ in pages.MARKED.findall(page.read_text(encoding="utf-8"))
    }
    assert found == {*pages.DECLARED, *pages.COMPUTED, *pages.MEASURED, *pages.DEVICES}


def test_tables_of_results_name_every_parameter_of_the_39_bus_case(pages):
    (text,) = (
        table
        for page in pages.pages()
        for name, table in pages.MARKED.findall(page.read_text(encoding="utf-8"))
        if name == "ieee39_effects"
    )
    for device in pages.DEVICES.values():
        assert all(f"| `{device.name}` | `{name}` |" in text for name in device.candidates.names)
