"""Paths that are no ordinary file are refused before anything is read."""

import os
from pathlib import Path

import pytest

from errorscreen._runtime.files import check_file
from errorscreen.cases import load_case
from errorscreen.exceptions import InputError
from errorscreen.models.dyr import read_dyr
from errorscreen.models.raw import read_raw


def test_the_nearest_name_is_proposed(tmp_path):
    (tmp_path / "dip.csv").write_text("a")
    with pytest.raises(InputError, match=r"dip\.cvs: does not exist.*Did you mean dip\.csv"):
        check_file(tmp_path / "dip.cvs", "file dip.cvs", 10, "a file")


def test_a_larger_file_is_refused(tmp_path):
    path = tmp_path / "large"
    path.touch()
    os.truncate(path, 3 * 2**20)
    with pytest.raises(InputError, match="has 3 MiB. Allowed: at most 1 MiB"):
        check_file(path, "file large", 2**20, "a file")
    check_file(path, "file large", 2**22, "a file")


@pytest.mark.parametrize("reader", [load_case, read_dyr, read_raw])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "name with a zero"])
def test_every_reader_refuses_them_at_once(tmp_path, reader, kind):
    path = {"device": Path("/dev/zero"), "folder": tmp_path, "name with a zero": tmp_path / "a\0b"}.get(
        kind, tmp_path / "pipe"
    )
    if kind == "pipe":
        os.mkfifo(path)
    with pytest.raises(InputError, match="is a device or a pipe|is a folder|cannot be read"):
        reader(path)
