import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.engine import Call, Engine, Model, ReferenceEngine
from errorscreen.engine.codegen import cache_directory, load_generated, source
from errorscreen.engine.examples import decay
from errorscreen.engine.kernels import FEW_LANES, LANES, SMALL_BATCH, _tasks
from tests.plants import DEVICE_NAMES, plant, random_rows

LAG = Model("lag", ("u",), ("x",), ("T",), (Call(decay, ("x", "u", "T"), ("d_x",)),), ("x",))


def test_fourth_order():
    errors = []
    for steps in (10, 20, 40):
        y = Engine(LAG).integrate(np.ones((1, 1)), np.ones((1, 1)), np.zeros((2 * steps + 1, 1)), h=1 / steps)
        errors.append(abs(y[0, 0, -1] - np.exp(-1)))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(ratios - 16) < 1.5)


def test_exact_for_a_cubic_input():
    # x' = u - x with x = t^3 needs u = t^3 + 3 t^2; the method integrates it to its order
    h, steps = 0.05, 20
    t = np.arange(2 * steps + 1) * h / 2
    y = Engine(LAG).integrate(np.zeros((1, 1)), np.ones((1, 1)), (t**3 + 3 * t**2)[:, None], h=h)
    assert np.allclose(y[0, 0], t[::2] ** 3, atol=2e-6)


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_numpy_few_lanes_and_many_agree_bit_for_bit(device):
    compiled, reference = plant(device), plant(device, engine="numpy")
    theta = random_rows(compiled, 37)
    together = compiled.simulate(theta)
    assert together.ok.any()
    assert np.array_equal(together.values, reference.simulate(theta).values, equal_nan=True)
    for i in (0, 17, 36):
        assert np.array_equal(compiled.simulate(theta[i]).values[0], together.values[i], equal_nan=True)


@settings(max_examples=20)
@given(st.integers(1, 70), st.randoms(use_true_random=False))
def test_neighbours_and_order_do_not_matter(n, random):
    simulator = plant("pv_plant")
    theta = random_rows(simulator, n, seed=3)
    order = list(range(n))
    random.shuffle(order)
    expected = simulator.simulate(theta).values[order]
    assert np.array_equal(simulator.simulate(theta[order]).values, expected, equal_nan=True)


@given(st.integers(0, 400), st.integers(1, 9))
def test_tasks_hold_each_simulation_once_and_leave_few_lanes_unused(n, threads):
    tasks = _tasks(n, threads)
    lanes = [i for count, first, last in tasks for i in range(first * count, last * count)]
    assert lanes == list(range(len(lanes)))
    spare = len(lanes) - n
    assert 0 <= spare < (FEW_LANES if n % LANES <= SMALL_BATCH else LANES - SMALL_BATCH)


def test_number_of_threads_does_not_matter():
    theta = random_rows(plant("dfig_plant"), 200)
    one, two = (plant("dfig_plant", n_threads=k).simulate(theta).values for k in (1, 2))
    assert np.array_equal(one, two, equal_nan=True)


def test_divergence_shows_as_values_that_are_not_finite():
    unstable = np.full((1, 1), -1e-3)  # growth with 1000/s
    for engine in (Engine(LAG), ReferenceEngine(LAG)):
        y = engine.integrate(np.ones((1, 1)), unstable, np.zeros((4001, 1)), h=0.01)
        assert not np.isfinite(y[0, 0, -1])


def test_generated_module_has_no_equations_and_fresh_processes_hit_the_cache(tmp_path):
    code = (
        "import numpy as np, time\n"
        "from tests.engine.test_kernels import LAG\n"
        "from errorscreen.engine import Engine\n"
        "from errorscreen.engine.codegen import load_module\n"
        "from errorscreen.engine.kernels import FEW_LANES\n"
        "Engine(LAG).integrate(np.ones((1, 1)), np.ones((1, 1)), np.zeros((3, 1)), h=0.1)\n"
        "stats = load_module(LAG, FEW_LANES).integrate.stats\n"
        "print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))\n"
    )
    environment = {**os.environ, "ERRORSCREEN_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.getcwd()}
    outputs = [
        subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert outputs[0].split() == ["0", "1"]
    assert outputs[1].split() == ["1", "0"]
    assert "from errorscreen.engine.examples import decay" in source(LAG, 16)


def test_an_edited_generated_module_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("ERRORSCREEN_CACHE_DIR", str(tmp_path))
    load_generated("edited", "VALUE = 1\n")
    (tmp_path / "edited.py").write_text("raise RuntimeError('must not run')")
    monkeypatch.delitem(sys.modules, "edited")
    assert load_generated("edited", "VALUE = 1\n").VALUE == 1
    assert "must not run" not in (tmp_path / "edited.py").read_text()


def test_a_folder_that_cannot_be_written_is_replaced_by_one_for_the_process(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("ERRORSCREEN_CACHE_DIR", str(file))
    assert cache_directory().is_dir()


def test_without_a_cache_directory_a_process_uses_one_folder_and_removes_it(tmp_path):
    (tmp_path / "file").write_text("")
    program = "from errorscreen.engine.codegen import cache_directory as d; print(d(), d(), sep='\\n')"
    run = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "ERRORSCREEN_CACHE_DIR": str(tmp_path / "file"), "TMPDIR": str(tmp_path)},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    first, second = run.stdout.split()
    assert first == second
    assert Path(first).parent == tmp_path
    assert not Path(first).exists()
