import os
import subprocess
import sys

import pytest

import errorscreen
from errorscreen.bench import timing
from errorscreen.bench.timing import best_seconds, in_new_process, peak_gib


def test_the_call_is_warmed_up_and_repeated(monkeypatch):
    monkeypatch.setattr("errorscreen.bench.timing._SHORTEST", 0.0)
    calls = []
    assert best_seconds(lambda: calls.append(0)) > 0
    assert len(calls) == 5  # to warm up, to choose the repetition, and once in each of three rounds


def test_a_new_process_finds_the_same_packages_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = "import os, errorscreen; print(os.getpid()); print(os.environ['MARK'], os.getpid(), errorscreen.__file__)"
    mark, process, file = in_new_process(code, MARK="x").split()
    assert (mark, file) == ("x", errorscreen.__file__)
    assert int(process) != os.getpid()


def test_a_failure_in_a_new_process_is_not_hidden(capfd):
    with pytest.raises(subprocess.CalledProcessError):
        in_new_process("raise ValueError('the reason')")
    assert "the reason" in capfd.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")
def test_peak_memory_counts_this_process_alone():
    """What the parent holds does not count for the child; what the child has released does."""
    held = bytearray(2**28)
    code = (
        f"import runpy; peak_gib = runpy.run_path({timing.__file__!r})['peak_gib']\n{{}}\nprint(peak_gib())"
    )
    small, large = (float(in_new_process(code.format(line))) for line in ("", "bytearray(2**28)"))
    assert small < peak_gib() - 0.1
    assert small + 0.2 < large
    assert len(held) == 2**28
