import numpy as np
import pytest

from errorscreen.exceptions import InputError
from errorscreen.persistence import save_arrays
from errorscreen.workflow.stages import StageStore


def test_a_stage_is_computed_once_and_read_back_exactly(tmp_path):
    calls = []

    def compute():
        calls.append(1)
        return {"x": np.array([0.1, np.nan])}, {"names": ["a"], "seconds": 0.1}

    for _ in range(2):
        store = StageStore(tmp_path, "a" * 64)
        arrays, meta = store.get("one", compute)
        assert np.array_equal(arrays["x"], [0.1, np.nan], equal_nan=True)
        assert meta == {"names": ["a"], "seconds": 0.1}
    assert len(calls) == 1
    assert store.reused == ["one"]


def test_another_study_has_another_folder(tmp_path):
    StageStore(tmp_path, "a" * 64).get("one", lambda: ({"x": np.zeros(1)}, {}))
    arrays, _ = StageStore(tmp_path, "b" * 64).get("one", lambda: ({"x": np.ones(1)}, {}))
    assert arrays["x"][0] == 1


def test_a_failed_stage_leaves_nothing(tmp_path):
    def fail():
        raise KeyboardInterrupt

    store = StageStore(tmp_path, "a" * 64)
    with pytest.raises(KeyboardInterrupt):
        store.get("one", fail)
    assert list(store.folder.iterdir()) == []


def of(value):
    return lambda: ({"x": np.full(3, value)}, {})


@pytest.mark.parametrize("damage", ["truncated", "foreign", "another stage", "another study"])
def test_a_file_that_does_not_fit_is_computed_again_and_said(damage, tmp_path):
    store = StageStore(tmp_path, "a" * 64)
    store.get("one", of(0.0))
    path = store.folder / "one.npz"
    if damage == "truncated":
        path.write_bytes(path.read_bytes()[:100])
    elif damage == "foreign":
        save_arrays(path, format="errorscreen-checkpoint", version=1, arrays={"y": np.zeros(2)})
    elif damage == "another stage":
        store.get("two", of(2.0))
        (store.folder / "two.npz").replace(path)
    else:  # the folder's name holds the beginning of the key only
        StageStore(tmp_path / "other", "a" * 63 + "b").get("one", of(3.0))
        (tmp_path / "other" / ("a" * 16) / "one.npz").replace(path)
    lines = []
    again = StageStore(tmp_path, "a" * 64, lines.append)
    assert again.get("one", of(1.0))[0]["x"].tolist() == [1.0] * 3
    assert again.reused == []
    (line,) = lines
    assert "one.npz holds no finished stage" in line


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "stages").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        StageStore(tmp_path / "stages", "a" * 64)
