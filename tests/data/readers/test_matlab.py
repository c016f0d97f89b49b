"""Variables of MATLAB files."""

import numpy as np
import pytest
import scipy.io
from hypothesis import given

from errorscreen.data import read_recording
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

VARIABLES = {
    "time": TIME, "V": V[:, None], "P": P, "note": "a text", "one": 1.0, "cells": np.array([1, "a"], dtype=object),
    "both": np.stack([V, P], axis=1), "s": {"V": V, "in": {"P": P}},
}  # fmt: skip


@pytest.mark.parametrize("packed", [False, True])
def test_version_5(tmp_path, packed):
    path = tmp_path / "a.dat"
    scipy.io.savemat(path, VARIABLES, do_compression=packed)
    for names in (("V", "P"), ("both[1]", "both[2]"), ("s.V", "s.in.P")):
        columns = {role: {**COLUMNS[role], "column": name} for role, name in zip("VP", names, strict=True)}
        check(read_recording(path, columns, **BASES))
    with pytest.raises(InputError, match="'one' has 1 values, 'time' has 100"):
        read_recording(path, {"V": "one"}, **BASES)
    with pytest.raises(InputError, match="unknown variable 't'.*Give time"):
        read_recording(path, COLUMNS, time="t", **BASES)


def test_version_7_3(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("time", TIME), ("V", V), ("s/P", P)):
            file[name] = values[None, :]
        file["other"] = h5py.ExternalLink("secret.h5", "/x")
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b" ") + content[512:])
    columns = {**COLUMNS, "P": {"column": "s.P", "unit": "MW"}}
    check(read_recording(path, columns, **BASES))
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(InputError, match="is no sound MATLAB file"):
        read_recording(path, columns, **BASES)


def test_without_h5py(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    path = tmp_path / "a.mat"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(ImportError, match=r'pip install "errorscreen\[hdf5\]"'):
        read_recording(path, COLUMNS, **BASES)


@bounded
@given(damages)
def test_damage(tmp_path_factory, damage):
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    scipy.io.savemat(path, VARIABLES, do_compression=bool(damage[0] % 2))
    survives(path, path.read_bytes(), damage, format="matlab")
