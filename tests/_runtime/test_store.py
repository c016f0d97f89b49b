"""Entries of a store are computed once, survive a kill, and are refused or made anew where they do not fit."""

import logging
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import errorscreen
from errorscreen._runtime.persistence import save_arrays
from errorscreen._runtime.store import FORMAT, VERSION, Store, digest
from errorscreen.exceptions import InputError

KEY = "a" * 64
RUN = {"seed": "1", "model": "2"}


def of(value):
    return lambda: ({"x": np.full(3, value)}, {})


def test_an_entry_is_computed_once_and_read_back_exactly(tmp_path):
    calls = []

    def compute():
        calls.append(1)
        return {"x": np.array([0.1, np.nan])}, {"names": ("a",), "seconds": 0.1}

    for _ in range(2):
        store = Store(tmp_path, RUN)
        arrays, values = store.get("one", compute)
        assert np.array_equal(arrays["x"], [0.1, np.nan], equal_nan=True)
        assert values == {"names": ["a"], "seconds": 0.1}
    assert len(calls) == 1
    assert store.reused == ["one"]


def test_entries_of_other_inputs_have_another_folder(tmp_path):
    store = Store(tmp_path)
    store.under(KEY).get("one", of(0.0))
    assert store.under("b" * 64).get("one", of(1.0))[0]["x"][0] == 1
    assert store.under(KEY).get("one", of(2.0))[0]["x"][0] == 0
    assert store.reused == ["one"]


def test_two_runs_at_once_may_share_a_folder(tmp_path):
    first, second = Store(tmp_path, RUN), Store(tmp_path, RUN)
    arrays, _ = first.get("one", lambda: second.get("one", of(1.0)))  # both compute it
    assert arrays["x"].tolist() == second.get("one", of(2.0))[0]["x"].tolist() == [1.0] * 3


def test_batches_come_back_by_their_numbers(tmp_path):
    Store(tmp_path, RUN).save(3, {"x": np.arange(2)})
    assert Store(tmp_path, RUN).load(range(5))[3]["x"].tolist() == [0, 1]
    assert list(Store(tmp_path, RUN).load(range(5))) == [3]


def test_a_failed_computation_leaves_nothing(tmp_path):
    def fail():
        raise KeyboardInterrupt

    store = Store(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        store.get("one", fail)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("damage", ["truncated", "pickle", "foreign", "another entry", "another run"])
def test_an_entry_that_does_not_fit_is_computed_again_and_reported(damage, tmp_path, caplog):
    store = Store(tmp_path, RUN)
    store.get("one", of(0.0))
    path = tmp_path / "one.npz"
    if damage == "truncated":
        path.write_bytes(path.read_bytes()[:100])
    elif damage == "pickle":
        with path.open("wb") as handle:
            np.savez(handle, x=np.array([{}], dtype=object))
    elif damage == "foreign":
        save_arrays(path, format="errorscreen-dataset", version=1, arrays={"y": np.zeros(2)})
    elif damage == "another entry":
        store.get("two", of(2.0))
        (tmp_path / "two.npz").replace(path)
    else:
        Store(tmp_path / "other", {"seed": "3"}).get("one", of(3.0))
        (tmp_path / "other" / "one.npz").replace(path)
    again = Store(tmp_path, RUN)
    with caplog.at_level(logging.WARNING):
        assert again.get("one", of(1.0))[0]["x"].tolist() == [1.0] * 3
    assert again.reused == []
    (line,) = caplog.messages
    assert line.startswith(str(path))
    assert line.endswith("it is computed again")


def test_a_folder_of_another_run_is_refused_with_the_difference(tmp_path):
    Store(tmp_path, RUN)
    with pytest.raises(InputError, match=r"belongs to another run: model differ\. .*another folder"):
        Store(tmp_path, {**RUN, "model": "3"})


@pytest.mark.parametrize("text", ["{", f'{{"format": "{FORMAT}", "version": {VERSION + 1}}}'])
def test_a_damaged_manifest_is_an_input_error(text, tmp_path):
    (tmp_path / "store.json").write_text(text)
    with pytest.raises(InputError, match=r"store\.json: is "):
        Store(tmp_path, RUN)


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "stages").write_text("")
    with pytest.raises(InputError, match="the folder cannot be made.*Delete or rename"):
        Store(tmp_path / "stages")


def test_a_folder_that_cannot_be_written_is_an_input_error(tmp_path):
    store = Store(tmp_path / "gone", RUN)
    shutil.rmtree(store.folder)
    with pytest.raises(InputError, match="cannot be written"):
        store.get("one", of(1.0))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_killed_run_keeps_what_was_finished(tmp_path):
    code = (
        "import os, signal, numpy as np\n"
        "from errorscreen._runtime.store import Store\n"
        f"store = Store({str(tmp_path)!r}, {RUN!r})\n"
        "store.get('one', lambda: ({'x': np.zeros(3)}, {}))\n"
        "store.get('two', lambda: os.kill(os.getpid(), signal.SIGKILL))\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    store = Store(tmp_path, RUN)
    assert store.get("one", of(1.0))[0]["x"].tolist() == [0.0] * 3
    assert store.get("two", of(2.0))[0]["x"].tolist() == [2.0] * 3
    assert store.reused == ["one"]


def test_the_fingerprint_of_the_program_covers_all_rooms(tmp_path):
    package = Path(errorscreen.__file__).parent
    copy = shutil.copytree(package, tmp_path / "errorscreen", ignore=shutil.ignore_patterns("__pycache__"))

    def program():
        code = "from errorscreen._runtime.store import program; print(program())"
        return subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip

    before = program()
    with (copy / "data" / "observations.py").open("a") as handle:
        handle.write("\n# changed\n")
    assert program() != before


def test_a_digest_is_that_of_the_values_and_their_types():
    assert digest([1, 2.0], {"a": np.arange(3)}) == digest([1, 2.0], {"a": np.arange(3)})
    assert digest(np.arange(3)) != digest(np.arange(3.0))
