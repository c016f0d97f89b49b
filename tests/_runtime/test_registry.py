import re
import sys

import pytest

from errorscreen._runtime.registry import Registry, _installed, other_packages
from errorscreen.exceptions import InputError


def numbers(**items):
    return Registry("number", "errorscreen.no_such_group", int, items)


def test_a_registry_is_a_mapping_in_the_order_of_registration():
    registry = numbers(two=2)
    registry.register("one", 1)
    assert (list(registry), list(registry.values()), len(registry)) == (["two", "one"], [2, 1], 2)
    assert registry["one"] == 1
    assert "three" not in registry
    assert registry.get("three") is None
    assert registry.get("three", 3) == 3


def test_an_unknown_name_is_answered_with_the_nearest():
    message = "key: unknown number 'thre' (did you mean 'three'?). Allowed: one, three."
    with pytest.raises(InputError, match=re.escape(message)):
        numbers(one=1, three=3).find("thre", "key")


def test_a_name_is_taken_once_and_objects_are_of_one_class():
    registry = numbers(one=1)
    with pytest.raises(InputError, match="number 'one': the name is taken"):
        registry.register("one", 2)
    with pytest.raises(
        InputError, match=r"number 'two': '2' cannot be registered\. Allowed: an object of int"
    ):
        registry.register("two", "2")
    classes = Registry("kind", "errorscreen.no_such_group", int, {"bool": bool}, classes=True)
    with pytest.raises(InputError, match="Allowed: a subclass of int"):
        classes.register("one", 1)


@pytest.fixture
def other(tmp_path, monkeypatch):
    """An installed package that adds the numbers one and two, and an effect."""
    info = tmp_path / "other-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    points = "[errorscreen.test_numbers]\ntwo = other_numbers:TWO\none = other_numbers:ONE\n"
    (info / "entry_points.txt").write_text(
        points + "[errorscreen.effects]\nnothing = other_numbers:NOTHING\n"
    )
    (tmp_path / "other_numbers.py").write_text("ONE, TWO = 1, 2\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    _installed.cache_clear()
    yield
    _installed.cache_clear()
    sys.modules.pop("other_numbers", None)


@pytest.mark.usefixtures("other")
def test_entry_points_come_last_and_are_loaded_when_they_are_looked_up():
    registry = Registry("number", "errorscreen.test_numbers", int, {"zero": 0})
    assert list(registry) == ["zero", "one", "two"]
    assert "other_numbers" not in sys.modules
    assert dict(registry) == {"zero": 0, "one": 1, "two": 2}
    assert "other 1.0" in other_packages()


@pytest.mark.usefixtures("other")
def test_an_entry_point_may_not_take_a_name():
    registry = Registry("number", "errorscreen.test_numbers", int, {"one": 1})
    assert registry["one"] == 1
    with pytest.raises(InputError, match="package other, entry point 'one' of .*: the name 'one' is taken"):
        list(registry)
