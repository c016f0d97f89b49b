"""Threads of linear algebra, and those that share calls; nothing depends on their number."""

import subprocess
import sys
import time
from functools import partial
from threading import Barrier, Event

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from errorscreen._runtime.threads import one_blas_thread, parallel_map, threads_left
from errorscreen.calibration import MAPCalibrator
from errorscreen.discovery import CauseFinder
from tests.toys import oscillator


def blas_threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_one_thread_while_it_runs_and_as_many_as_before_afterwards():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        assert one_blas_thread(blas_threads)() == {1}
        assert blas_threads() == before

    @one_blas_thread
    def failing():
        raise ValueError("meant")

    with pytest.raises(ValueError, match="meant"):
        failing()


@pytest.mark.parametrize("estimator", [MAPCalibrator, CauseFinder])
def test_fits_take_one_thread(estimator):
    simulator, seen = oscillator(), set()
    recording = simulator.record({"omega": 7.0}, 0.02, seed=0)
    response = simulator.response
    simulator.response = lambda p, event: (seen.update(blas_threads()), response(p, event))[1]
    options = {} if estimator is MAPCalibrator else {"max_effects": 0}
    with threadpool_limits(limits=2, user_api="blas"):
        estimator(simulator, n_starts=1, random_state=0, **options).fit(recording)
    assert seen == {1}


@pytest.mark.parametrize("threads", [1, 2, 9])
def test_results_come_in_the_order_of_the_calls(threads):
    assert parallel_map([partial(pow, i, 2) for i in range(5)], threads) == [0, 1, 4, 9, 16]
    assert parallel_map([], threads) == []


def test_calls_run_at_the_same_time():
    both = Barrier(2)
    assert sorted(parallel_map([partial(both.wait, 300.0)] * 2, 2)) == [0, 1]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_ends_what_has_not_begun(error):
    begun, failed = [], Event()

    def fail():
        failed.set()
        raise error("meant")

    def follow():
        failed.wait(300.0)
        time.sleep(0.01)
        begun.append(1)

    with pytest.raises(error, match="meant"):
        parallel_map([follow, fail, *[follow] * 1000], 2)
    assert len(begun) < 1000


def test_after_an_interrupt_nothing_is_waited_for():
    """In a process of its own: the signal belongs to its main thread."""
    code = (
        "import os, signal, threading\n"
        "from errorscreen._runtime.threads import parallel_map\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have it ignored\n"
        "running = threading.Barrier(2, lambda: os.kill(os.getpid(), signal.SIGINT))\n"
        "def forever():\n"
        "    running.wait()\n"
        "    threading.Event().wait()\n"
        "try:\n"
        "    parallel_map([forever] * 2, 2)\n"
        "except KeyboardInterrupt:\n"
        "    os._exit(7)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=600).returncode == 7


def test_calls_beside_others_take_no_threads_of_their_own():
    both = Barrier(2)

    def left(threads):
        both.wait(300.0)
        found = threads_left(threads)
        both.wait(300.0)
        return found

    assert threads_left(4) == 4
    assert parallel_map([partial(left, 4)] * 2, 2) == [1, 1]
    assert parallel_map([partial(threads_left, 4)], 2) == [4]
    assert threads_left(4) == 4


def test_the_last_call_has_the_threads_of_those_that_have_ended():
    def last():
        deadline = time.monotonic() + 300.0
        while threads_left(2) == 1 and time.monotonic() < deadline:
            time.sleep(1e-3)
        return [
            threads_left(1),
            threads_left(2),
            threads_left(4),
            *parallel_map([partial(threads_left, 2)] * 2, 4),
        ]

    # a call of the last one that runs beside another has one thread again, until that has ended too
    found = parallel_map([partial(threads_left, 2), partial(threads_left, 2), last], 2)[-1]
    assert found[:3] == [1, 2, 2]
    assert set(found[3:]) <= {1, 2}
