"""A call in a process of its own: its result or error arrives, and the process does not outlive the block."""

import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from errorscreen._runtime import processes
from errorscreen._runtime.processes import subprocess_importing
from errorscreen.exceptions import DataWarning, InputError

HERE = os.getpid()
POSIX = pytest.mark.skipif(
    os.name == "nt", reason="Windows has other signals, and does not tell of dead parents"
)


def gone(number):
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline:
        try:
            os.kill(number, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@contextmanager
def in_subprocess(function, *args, **kwargs):
    with subprocess_importing() as process:
        yield process.call(function, *args, **kwargs)


def sleep_elsewhere(path):
    path.write_text(str(os.getpid()))
    time.sleep(600)


def begun(path):
    deadline = time.monotonic() + 300
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return int(path.read_text())


def test_the_result_comes_from_another_process():
    with in_subprocess(os.getpid) as call:
        assert call.result() != HERE
        assert call.done


def test_a_process_that_began_early_has_imported_what_it_was_asked_for():
    with subprocess_importing("this.module.is.nowhere", "fractions") as process:
        assert process.call(lambda: "fractions" in sys.modules).result()


def test_what_has_no_name_in_a_module_is_passed_on():
    factor = 3
    with in_subprocess(lambda x, *, plus: factor * x + plus, 2, plus=1) as call:
        assert call.result() == 7


def test_an_error_arrives_as_what_it_is():
    def failing():
        raise InputError("meant", where="a file", allowed="less", remedy="Write less")

    with (
        in_subprocess(failing) as call,
        pytest.raises(InputError, match="a file: meant. Allowed: less. Write less"),
    ):
        call.result()


def test_an_error_is_told_as_soon_as_somebody_asks():
    def failing():
        raise InputError("meant")

    with in_subprocess(failing) as call:
        deadline = time.monotonic() + 300
        while not call.done and time.monotonic() < deadline:
            time.sleep(0.05)
        with pytest.raises(InputError, match="meant"):
            call.check()
    with in_subprocess(time.sleep, 600) as call:
        call.check()
        assert not call.done


def test_what_is_copied_is_what_was_there_when_it_began():
    values = {k: np.zeros(1000) for k in range(1000)}
    with in_subprocess(len, values) as call:
        for k in range(1000, 100_000):
            values[k] = k
        assert call.result() == 1000


def test_warnings_arrive_with_the_result():
    def warning():
        warnings.warn("meant", DataWarning, stacklevel=2)
        return 1

    with in_subprocess(warning) as call, pytest.warns(DataWarning, match="meant"):
        assert call.result() == 1


def test_what_cannot_be_copied_is_told_apart_from_errors_of_the_call():
    lock = threading.Lock()
    with in_subprocess(lambda: lock.locked()) as call:
        call.check()
        with pytest.raises(BrokenExecutor, match=r"no process could start: cannot pickle .*lock"):
            call.result()


def test_so_is_a_process_that_is_killed():
    with in_subprocess(os._exit, 1) as call:
        with pytest.raises(BrokenExecutor):
            call.result()
        call.check()


def test_an_interrupt_while_it_begins_leaves_no_process(monkeypatch):
    ended = []

    class Interrupted(processes.ProcessPoolExecutor):
        def submit(self, *args, **kwargs):
            super().submit(*args, **kwargs)
            raise KeyboardInterrupt

        def shutdown(self, **options):
            ended.append(options)
            super().shutdown(**options)

    monkeypatch.setattr(processes, "ProcessPoolExecutor", Interrupted)
    with pytest.raises(KeyboardInterrupt), in_subprocess(time.sleep, 600):
        pass
    assert ended == [{"kill_workers": True}]


@POSIX
@pytest.mark.parametrize("error", [None, KeyboardInterrupt, InputError("meant")])
def test_at_the_end_of_the_block_the_process_ends(error, tmp_path):
    try:
        with in_subprocess(sleep_elsewhere, tmp_path / "number"):
            number = begun(tmp_path / "number")
            if error is not None:
                raise error
    except (KeyboardInterrupt, InputError):
        pass
    assert gone(number)


@POSIX
def test_an_interrupt_does_not_reach_it(tmp_path):
    def waiting():
        (tmp_path / "number").write_text(str(os.getpid()))
        while not (tmp_path / "sent").exists():
            time.sleep(0.05)
        return "done"

    with in_subprocess(waiting) as call:
        os.kill(begun(tmp_path / "number"), signal.SIGINT)
        (tmp_path / "sent").write_text("")
        assert call.result() == "done"


@POSIX
def test_it_does_not_outlive_a_parent_that_is_killed(tmp_path):
    program = (
        "import sys, time, pathlib\n"
        "from tests._runtime.test_processes import in_subprocess, sleep_elsewhere\n"
        "with in_subprocess(sleep_elsewhere, pathlib.Path(sys.argv[1])) as call:\n"
        "    call.result()\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "number")], cwd=Path(__file__).parents[2]
    )
    number = begun(tmp_path / "number")
    parent.kill()
    parent.wait()
    assert gone(number)
