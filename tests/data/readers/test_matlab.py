"""MATLAB files; those of version 7.3 are written here by the rules that the package hdf5storage documents."""

import struct
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.io import savemat

import errorscreen as es
from errorscreen.data import read_recording
from errorscreen.data.readers import apart, child, recognised
from errorscreen.data.readers.matlab import read_matlab_columns
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

h5py = pytest.importorskip("h5py")
KV, MW = {"unit": "kV"}, {"unit": "MW"}


def column(values):
    return np.asarray(values).reshape(-1, 1)


def objects(*cells):
    found = np.empty(len(cells), dtype=object)
    found[:] = cells
    return found


def write_5(path, **variables):
    savemat(path, variables, oned_as="column", do_compression=True)
    return path


def write_73(path, **variables):
    """Transposed arrays, structs as groups, texts as numbers of letters, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, file, name, value)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: test".ljust(124) + b"\x00\x02IM")
    return path


def put(file, group, name, value):
    if isinstance(value, dict):
        inside = group.create_group(name)
        inside.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, one in value.items():
            put(file, inside, field, one)
    elif isinstance(value, str):
        codes = np.array([[ord(letter)] for letter in value], dtype=np.uint16)
        group.create_dataset(name, data=codes).attrs["MATLAB_class"] = np.bytes_("char")
    elif isinstance(value, list):
        places = file.require_group("#refs#")
        references = np.empty((len(value), 1), dtype=h5py.ref_dtype)
        for number, one in enumerate(value):
            label = f"{name}{len(places)}"
            put(file, places, label, one)
            references[number, 0] = places[label].ref
        data = group.create_dataset(name, data=references, dtype=h5py.ref_dtype)
        if isinstance(value[0], str):
            data.attrs["MATLAB_class"] = np.bytes_("cell")
    else:
        data = group.create_dataset(name, data=np.atleast_2d(value).T)
        data.attrs["MATLAB_class"] = np.bytes_("double")


def opaque(name, kind):
    """Variable of version 5 that holds an object: its name, the system and class, and numbers that say nothing."""

    def element(code, content):
        return struct.pack("<II", code, len(content)) + content + bytes(-len(content) % 8)

    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    numbers += element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", kind))
    return element(14, element(6, struct.pack("<II", 17, 0)) + texts + element(14, numbers))


VARIABLES = {"time": TIME, "V": V, "P": column(P)}
WRITERS = pytest.mark.parametrize("write", [write_5, write_73])


@WRITERS
def test_vectors(tmp_path, write):
    path = write(tmp_path / "a.mat", **VARIABLES)
    assert recognised(path) == "matlab"
    check(read_recording(path, COLUMNS, **BASES))
    check(es.read(path, {"V": {"column": "V", **KV}, "P": {"column": "P", **MW}}, **BASES))
    milliseconds = write(tmp_path / "b.mat", t=1000 * TIME, V=V, P=P)
    check(read_recording(milliseconds, COLUMNS, time="t", time_unit="ms", **BASES))


@WRITERS
def test_a_matrix_gives_numbered_columns(tmp_path, write):
    matrix = np.stack([TIME, V, P], axis=1)
    columns = {"V": {"column": "data[2]", **KV}, "P": {"column": "data[3]", **MW}}
    check(read_recording(write(tmp_path / "a.mat", data=matrix), columns, time="data[1]", **BASES))
    rec = read_recording(write(tmp_path / "b.mat", data=matrix.T), columns, time="data[1]", **BASES)
    check(rec)  # as Simulink's block To File writes it
    assert any("The rows of 'data' were taken as its columns" in note for note in rec.assumptions)


@WRITERS
def test_names_beside_a_matrix_count_where_they_are_clear(tmp_path, write):
    def names(*texts):
        return list(texts) if write is write_73 else objects(*texts)

    matrix = np.stack([TIME, V, P], axis=1)
    path = write(tmp_path / "a.mat", data=matrix, names=names("time", "V", "P"))
    check(read_recording(path, COLUMNS, **BASES))
    for unclear in (
        {"names": names("time", "V")},
        {"names": names("time", "V", "V")},
        {"names": names("time", "V", "P"), "labels": names("a", "b", "c")},
        {"names": names("time", "V", "P"), "other": matrix},
    ):
        found = read_matlab_columns(write(tmp_path / "b.mat", data=matrix, **unclear))
        assert "data[1]" in found.columns
        assert "V" not in found.columns


@WRITERS
def test_structs(tmp_path, write):
    path = write(tmp_path / "a.mat", s={"t": TIME, "V": V, "inner": {"P": P}})
    columns = {"V": {"column": "s.V", **KV}, "P": {"column": "s.inner.P", **MW}}
    check(read_recording(path, columns, time="s.t", **BASES))


def simulink(write, second="P"):
    """A structure with time of two signals."""
    if write is write_73:
        signals = {"values": [V, P], "dimensions": [1.0, 1.0]}
        return {"time": TIME, "signals": signals | {"label": Texts("V", second)}}
    signals = np.empty((1, 2), dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[0, 0], signals[0, 1] = (column(V), 1.0, "V"), (column(P), 1.0, second)
    return {"time": column(TIME), "signals": signals, "blockName": "model/To Workspace"}


class Texts(list):
    """Field of an array of structs that holds texts, which is no cell."""

    def __init__(self, *texts):
        super().__init__(np.array([ord(letter) for letter in text], dtype=np.uint16) for text in texts)


@WRITERS
def test_structure_with_time_of_simulink(tmp_path, write):
    columns = {"V": {"column": "out.V", **KV}, "P": {"column": "out.P", **MW}}
    path = write(tmp_path / "a.mat", out=simulink(write))
    if write is write_73:
        with h5py.File(path, "r+") as file:
            for reference in file["out/signals/label"][()].reshape(-1):
                file[reference].attrs["MATLAB_class"] = np.bytes_("char")
    check(read_recording(path, columns, time="out.time", **BASES))


def test_equal_labels_are_not_taken(tmp_path):
    path = write_5(tmp_path / "a.mat", out=simulink(write_5, "V"))
    columns = {"V": {"column": "out.signals[1].values", **KV}, "P": {"column": "out.signals[2].values", **MW}}
    check(read_recording(path, columns, time="out.time", **BASES))


def test_dates_as_texts(tmp_path):
    stamps = objects(*(f"2026-05-03T10:00:{t:06.3f}" for t in TIME))
    path = write_5(tmp_path / "a.mat", time=stamps, V=V, P=P)
    check(read_recording(path, COLUMNS, time_unit="iso", **BASES))


def test_objects_are_refused_by_name(tmp_path):
    path = write_5(tmp_path / "a.mat", **VARIABLES)
    path.write_bytes(path.read_bytes() + opaque("out", "timeseries"))
    check(read_recording(path, COLUMNS, **BASES))
    with pytest.raises(InputError, match=r"'out.Data': is of the class timeseries, .*t = x.Time"):
        read_recording(path, {"V": "out.Data"}, **BASES)
    only = tmp_path / "b.mat"
    only.write_bytes(path.read_bytes()[:128] + opaque("out", "timetable"))
    with pytest.raises(InputError, match=r"only 'out' of the class timetable.*writetimetable"):
        read_recording(only, COLUMNS, **BASES)
    path = write_73(tmp_path / "c.mat", **VARIABLES, out=np.zeros((6, 1)))
    with h5py.File(path, "r+") as file:
        file["out"].attrs["MATLAB_class"] = np.bytes_("timeseries")
        file["out"].attrs["MATLAB_object_decode"] = 3
    check(read_recording(path, COLUMNS, **BASES))
    with pytest.raises(InputError, match="'out': is of the class timeseries"):
        read_recording(path, COLUMNS, time="out", **BASES)


@WRITERS
def test_what_does_not_fit_is_told(tmp_path, write):
    path = write(tmp_path / "a.mat", **VARIABLES, slow=V[::2], z=V + 1j * P)
    with pytest.raises(InputError, match="'slow': has 50 values, but the time 'time' has 100"):
        read_recording(path, {"V": "slow"}, **BASES)
    with pytest.raises(InputError, match="unknown variable 't'.*Give time"):
        read_recording(path, COLUMNS, time="t", **BASES)
    with pytest.raises(InputError, match="unknown column 'U'"):
        read_recording(path, {"V": "U"}, **BASES)
    with pytest.raises(InputError, match="sheet does not apply to the format 'matlab'"):
        read_recording(path, COLUMNS, sheet="a", **BASES)
    with pytest.raises(InputError, match="holds no vectors"):
        read_recording(write(tmp_path / "b.mat", n=np.array([[1.0]])), COLUMNS, **BASES)
    if write is write_5:
        with pytest.raises(InputError, match="complex numbers"):
            read_recording(path, {"V": "z"}, **BASES)


def test_links_out_of_the_file_are_not_followed(tmp_path):
    write_73(tmp_path / "secret.mat", V=V)
    path = write_73(tmp_path / "a.mat", time=TIME, P=P)
    with h5py.File(path, "r+") as file:
        file["V"] = h5py.ExternalLink("secret.mat", "/V")
        file["loop"] = h5py.SoftLink("/")
        file.create_dataset("W", (100, 1), "f8", external=[("secret.mat", 0, 800)])
        file["W"].attrs["MATLAB_class"] = np.bytes_("double")
    with pytest.raises(InputError, match="unknown column 'V'"):
        read_recording(path, {"V": "V"}, **BASES)
    with pytest.raises(InputError, match="'W': is of the class numbers in another file"):
        read_recording(path, {"V": "W"}, **BASES)


def test_declared_sizes_are_limited(tmp_path):
    path = write_73(tmp_path / "a.mat", time=TIME)
    with h5py.File(path, "r+") as file:
        file.create_dataset("V", (10**6, 10**6), "f8", chunks=(1000, 1000))
    with pytest.raises(InputError, match="needs too much memory.*at most 2048 MiB"):
        read_recording(path, COLUMNS, **BASES)


def test_a_process_that_ends_or_takes_long_is_told(tmp_path, monkeypatch):
    path = write_5(tmp_path / "a.mat", **VARIABLES)
    program = tmp_path / "program.py"
    monkeypatch.setattr(child, "__file__", str(program))
    program.write_text("import os; os.abort()")
    with pytest.raises(InputError, match=r"process that reads it ended with code -?\d+: a damaged file"):
        read_recording(path, COLUMNS, **BASES)
    program.write_text("import time; time.sleep(600)")
    monkeypatch.setattr(apart, "_SECONDS", 0.5)
    with pytest.raises(InputError, match=r"reading it took more than 0.5 s"):
        read_recording(path, COLUMNS, **BASES)


def test_a_missing_package(tmp_path, monkeypatch):
    path = write_73(tmp_path / "a.mat", **VARIABLES)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r'pip install "errorscreen\[matlab\]"'):
        read_recording(path, COLUMNS, **BASES)


@settings(bounded, max_examples=6)
@given(damages)
def test_damage(tmp_path_factory, damage):
    folder = tmp_path_factory.mktemp("mat")
    for write in (write_5, write_73):
        path = write(folder / "a.mat", **VARIABLES)
        survives(path, path.read_bytes(), damage, format="matlab")
