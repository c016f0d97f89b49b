from dataclasses import replace

import numpy as np
import pytest

from errorscreen.engine import Call, Engine, Model, ReferenceEngine, compiler
from errorscreen.engine.codegen import load_module
from errorscreen.engine.examples import decay
from errorscreen.engine.kernels import FEW_LANES

LAG = Model("lag", ("u",), ("x",), ("T",), (Call(decay, ("x", "u", "T"), ("d_x",)),), ("x",))
ARGUMENTS = np.ones((3, 1)), np.array([[1.0], [2.0], [3.0]]), np.zeros((21, 1))


@pytest.fixture(autouse=True)
def nothing_is_compiled_here(tmp_path, monkeypatch):
    monkeypatch.setenv("ERRORSCREEN_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiler, "_HERE", 0)
    yield
    compiler._HELPER.end()


def test_another_process_compiles_what_would_fill_the_memory_of_this_one():
    expected = ReferenceEngine(LAG).integrate(*ARGUMENTS, h=0.1)
    for name in ("first", "second"):
        model = replace(LAG, name=name)
        found = Engine(model).integrate(*ARGUMENTS, h=0.1)
        assert np.array_equal(found, expected)
        stats = load_module(model, FEW_LANES).integrate.stats
        assert (sum(stats.cache_hits.values()), sum(stats.cache_misses.values())) == (1, 0)


def test_a_model_is_compiled_here_where_no_other_process_can_begin(monkeypatch):
    compiler._HELPER.end()  # one of an earlier test would still compile
    monkeypatch.setattr("sys.executable", "/no/such/python")
    model = replace(LAG, name="here")
    assert np.isfinite(Engine(model).integrate(*ARGUMENTS, h=0.1)).all()
    assert sum(load_module(model, FEW_LANES).integrate.stats.cache_misses.values()) == 1


def test_arrays_that_cannot_be_written_need_no_machine_code_of_their_own():
    model = replace(LAG, name="read only")
    x0, constants, u = (array.copy() for array in ARGUMENTS)
    constants.setflags(write=False)
    u.setflags(write=False)
    Engine(model).integrate(x0, constants, u, h=0.1)
    assert len(load_module(model, FEW_LANES).integrate.signatures) == 1
