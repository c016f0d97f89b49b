import numpy as np
import pytest

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
