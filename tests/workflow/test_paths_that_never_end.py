"""A pipe, a device and an endless stream are refused at once wherever a path is given."""

import os
import shutil
from pathlib import Path

import pytest

from errorscreen.cli import main
from errorscreen.data import READERS, read_recording
from errorscreen.exceptions import InputError
from tests.data.readers import test_comtrade as comtrade
from tests.data.readers import test_pscad as pscad

DYR = Path(__file__).parents[2] / "examples" / "dyr"
BASES = {"base_mva": 1.0, "f_nominal": 50.0}
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")


@pytest.fixture(params=["pipe", "device", "link to a device"])
def put(request, tmp_path):
    """Function that puts such a path in the place of a file, and returns it.

    Nothing ever writes into the pipe, and the device never ends, so a test that reads one of them does not end.
    """

    def put(path):
        path.unlink(missing_ok=True)
        if request.param == "pipe":
            os.mkfifo(path)
        elif request.param == "link to a device":
            path.symlink_to("/dev/zero")
        return Path("/dev/zero") if request.param == "device" else path

    return put


@pytest.mark.parametrize("form", [None, *READERS])
def test_no_reader_reads_them(tmp_path, put, form):
    with pytest.raises(InputError, match="is a device or a pipe"):
        read_recording(put(tmp_path / "a.csv"), {"P": "P"}, form, **BASES)


def test_no_file_beside_another_is_read(tmp_path, put):
    configuration = comtrade.write(tmp_path, comtrade.waves(comtrade.TIME), comtrade.TIME)
    run = pscad.write(tmp_path)
    for path, beside in ((configuration, "record.dat"), (run, "run_02.out")):
        if put(tmp_path / beside) == tmp_path / beside:
            with pytest.raises(InputError, match="is a device or a pipe"):
                read_recording(path, {"P": "P"}, **BASES)


@pytest.fixture
def folder(tmp_path):
    for name in ("unit.csv", "unit.dyr", "case.toml"):
        shutil.copy(DYR / name, tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "name"),
    [
        *(("init", name) for name in ("unit.csv", "unit.dyr")),
        *(("check", name) for name in ("case.toml", "unit.csv", "unit.dyr", "grid.raw")),
        *(("split", name) for name in ("case.toml", "unit.csv")),
        *(("run", name) for name in ("case.toml", "unit.csv", "unit.dyr", "grid.raw")),
    ],
)
def test_no_command_reads_them(folder, put, monkeypatch, capsys, command, name):
    monkeypatch.chdir(folder)
    case = folder / "case.toml"
    text = case.read_text()
    if name == "grid.raw":
        text += '\n[plant]\nraw = "grid.raw"\nmeasured = 101\n'
    path = put(folder / name)
    if name != "case.toml":
        case.write_text(text.replace(f'"{name}"', f'"{path}"'))
    arguments = {
        "init": [str(path if name == "unit.csv" else folder / "unit.csv"), "--out", "new.toml"],
        "check": [str(path if name == "case.toml" else case)],
        "split": [str(path if name == "case.toml" else case)],
        "run": [str(path if name == "case.toml" else case), "--out", "out", "--quiet"],
    }[command]
    if (command, name) == ("init", "unit.dyr"):
        arguments += ["--dyr", str(path)]
    assert main([command, *arguments]) == 2
    told = capsys.readouterr()
    assert "is a device or a pipe" in told.out + told.err
