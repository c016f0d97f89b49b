import re

import pytest

from errorscreen._runtime.registry import Registry, _installed
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


def test_an_entry_point_may_not_take_a_name(tmp_path, monkeypatch):
    info = tmp_path / "other-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[errorscreen.test_numbers]\none = other:ONE\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    registry = Registry("number", "errorscreen.test_numbers", int, {"one": 1})
    _installed.cache_clear()
    try:
        assert registry["one"] == 1
        with pytest.raises(
            InputError, match="package other, entry point 'one' of .*: the name 'one' is taken"
        ):
            list(registry)
    finally:
        _installed.cache_clear()
