import numpy as np
import pytest

from errorscreen._runtime.persistence import save_arrays
from errorscreen.exceptions import InputError
from errorscreen.workflow.stages import StageStore

KEY = "a" * 64


def test_a_stage_is_computed_once_and_read_back_exactly(tmp_path):
    calls = []

    def compute():
        calls.append(1)
        return {"x": np.array([0.1, np.nan])}, {"names": ["a"], "seconds": 0.1}

    for _ in range(2):
        store = StageStore(tmp_path)
        arrays, meta = store.get("one", KEY, compute)
        assert np.array_equal(arrays["x"], [0.1, np.nan], equal_nan=True)
        assert meta == {"names": ["a"], "seconds": 0.1}
    assert len(calls) == 1
    assert store.reused == ["one"]


def test_a_stage_that_depends_on_something_else_has_another_folder(tmp_path):
    store = StageStore(tmp_path)
    store.get("one", KEY, lambda: ({"x": np.zeros(1)}, {}))
    arrays, _ = store.get("one", "b" * 64, lambda: ({"x": np.ones(1)}, {}))
    assert arrays["x"][0] == 1
    assert store.folder(KEY) != store.folder("b" * 64)
    assert store.reused == []


def test_a_failed_stage_leaves_nothing(tmp_path):
    def fail():
        raise KeyboardInterrupt

    store = StageStore(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        store.get("one", KEY, fail)
    assert list(store.folder(KEY).iterdir()) == []


def of(value):
    return lambda: ({"x": np.full(3, value)}, {})


@pytest.mark.parametrize("damage", ["truncated", "foreign", "another stage", "another study"])
def test_a_file_that_does_not_fit_is_computed_again_and_said(damage, tmp_path):
    store = StageStore(tmp_path)
    store.get("one", KEY, of(0.0))
    path = store.folder(KEY) / "one.npz"
    if damage == "truncated":
        path.write_bytes(path.read_bytes()[:100])
    elif damage == "foreign":
        save_arrays(path, format="errorscreen-checkpoint", version=1, arrays={"y": np.zeros(2)})
    elif damage == "another stage":
        store.get("two", KEY, of(2.0))
        (store.folder(KEY) / "two.npz").replace(path)
    else:  # the folder's name holds the beginning of the key only
        StageStore(tmp_path / "other").get("one", KEY[:-1] + "b", of(3.0))
        (tmp_path / "other" / KEY[:16] / "one.npz").replace(path)
    lines = []
    again = StageStore(tmp_path, lines.append)
    assert again.get("one", KEY, of(1.0))[0]["x"].tolist() == [1.0] * 3
    assert again.reused == []
    (line,) = lines
    assert "one.npz holds no finished stage" in line


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "stages").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        StageStore(tmp_path / "stages")
