import json
import os
import stat

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from errorscreen._runtime.persistence import (
    load_arrays,
    load_tensors,
    read_json,
    save_arrays,
    save_tensors,
    to_jsonable,
    write_json_atomic,
    write_text_atomic,
)
from errorscreen.exceptions import InputError

PAIRS = [(save_arrays, load_arrays), (save_tensors, load_tensors)]
numbers = hnp.arrays(
    st.sampled_from([np.float64, np.float32, np.int64, np.bool_]), hnp.array_shapes(min_dims=0, min_side=0)
)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize(("save", "load"), PAIRS)
@settings(max_examples=30)
@given(data=st.data())
def test_arrays_and_meta_come_back_as_they_were(tmp_path_factory, save, load, data):
    names = st.text(st.sampled_from("abcdefg_0"), min_size=1)
    arrays = data.draw(st.dictionaries(names, numbers, max_size=3))
    meta = data.draw(st.dictionaries(st.text(), json_values, max_size=3))
    path = tmp_path_factory.mktemp("p") / "file"
    assert save(path, format="f", version=3, arrays=arrays, meta=meta) == path
    read, read_meta = load(path, format="f", version=3)
    assert read.keys() == arrays.keys()
    assert read_meta == meta
    for name, array in arrays.items():
        assert (read[name].dtype, read[name].shape) == (array.dtype, array.shape)
        np.testing.assert_array_equal(read[name], array)


def test_text_arrays_come_back(tmp_path):
    path = save_arrays(tmp_path / "a.npz", format="f", version=1, arrays={"names": ["Xd", "X'd"]})
    assert load_arrays(path, format="f", version=1)[0]["names"].tolist() == ["Xd", "X'd"]


@pytest.mark.parametrize(("save", "load"), PAIRS)
@pytest.mark.parametrize(
    ("format", "version", "message"),
    [
        ("other", 2, "is of format 'f'. Allowed: format 'other'"),
        ("f", 1, "is version 2 of format 'f'. Allowed: version 1. Install a newer errorscreen"),
        ("f", 3, "is version 2 of format 'f'. Allowed: version 3. Make the file anew"),
    ],
)
def test_another_format_or_version_is_named(tmp_path, save, load, format, version, message):
    path = save(tmp_path / "a", format="f", version=2, arrays={"x": np.ones(3)})
    with pytest.raises(InputError) as caught:
        load(path, format=format, version=version)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def foreign_npz(path):
    np.savez(path.open("wb"), x=np.ones(2))


def pickled_npz(path):
    with path.open("wb") as handle:
        np.savez(handle, errorscreen_header=np.array([{"format": "f"}], dtype=object))


def truncated(path):
    save_arrays(path, format="f", version=1, arrays={"x": np.arange(100.0)})
    path.write_bytes(path.read_bytes()[:-200])


def flipped(path):
    save_arrays(path, format="f", version=1, arrays={"x": np.zeros(100)})
    data = bytearray(path.read_bytes())
    data[600] ^= 0xFF
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("load", [load_arrays, load_tensors])
@pytest.mark.parametrize(
    "make",
    [
        foreign_npz,
        pickled_npz,
        truncated,
        flipped,
        lambda path: path.write_bytes(b""),
        lambda path: path.write_text("time,P\n0,1\n"),
        lambda path: np.save(path.open("wb"), np.ones(2)),
    ],
)
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_a_damaged_or_foreign_file_is_an_input_error(tmp_path, load, make):
    path = tmp_path / "a"
    make(path)
    with pytest.raises(InputError, match="damaged or was not written by errorscreen as 'f'"):
        load(path, format="f", version=1)


def test_a_safetensors_file_of_another_program_is_an_input_error(tmp_path):
    from safetensors.numpy import save_file

    save_file({"x": np.ones(2)}, tmp_path / "a")
    with pytest.raises(InputError, match="was not written by errorscreen"):
        load_tensors(tmp_path / "a", format="f", version=1)


@pytest.mark.parametrize("load", [load_arrays, load_tensors, read_json])
def test_a_missing_file_is_an_input_error(tmp_path, load):
    with pytest.raises(InputError, match="is not there"):
        load(tmp_path / "none", format="f", version=1)
    with pytest.raises(InputError, match="is no file"):
        load(tmp_path, format="f", version=1)


def test_python_objects_are_refused_and_no_file_is_left(tmp_path):
    with pytest.raises(InputError, match="array 'x': holds Python objects"):
        save_arrays(tmp_path / "a", format="f", version=1, arrays={"x": [object()]})
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = write_text_atomic(tmp_path / "a.txt", "old")

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text_atomic(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("target", ["missing/a.txt", "a_file/a.txt", "."])
def test_a_target_that_cannot_be_written_is_an_input_error(tmp_path, target):
    (tmp_path / "a_file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        write_text_atomic(tmp_path / target, "x")


def test_files_follow_the_umask(tmp_path):
    (tmp_path / "plain").write_text("x")
    written = write_text_atomic(tmp_path / "atomic", "x")
    assert stat.S_IMODE(written.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def test_json_is_strict_and_numpy_is_understood(tmp_path):
    data = {"c": np.float32(0.5), "t": (1, 2), "p": tmp_path, "bad": [np.inf, float("nan")], "b": np.True_}
    path = write_json_atomic(tmp_path / "a.json", data)
    assert json.loads(path.read_text()) == {
        "c": 0.5,
        "t": [1, 2],
        "p": str(tmp_path),
        "bad": [None, None],
        "b": True,
    }
    with pytest.raises(InputError, match="type set"):
        to_jsonable({"x": {1}})
    with pytest.raises(InputError, match="key 1"):
        to_jsonable({1: 2})


def test_versioned_json_comes_back_without_its_header(tmp_path):
    path = write_json_atomic(tmp_path / "a.json", {"x": 1}, format="f", version=1)
    assert list(json.loads(path.read_text())) == ["format", "version", "x"]
    assert read_json(path, format="f", version=1) == {"x": 1}
    with pytest.raises(InputError, match="is version 1"):
        read_json(path, format="f", version=2)
    path.write_text("[1]")
    with pytest.raises(InputError, match="was not written by errorscreen"):
        read_json(path, format="f", version=1)
