import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError, MissingExtraError
from errorscreen.parameters import Parameter
from errorscreen.simulators import CallableSimulator
from errorscreen.simulators.external.fmu import FMU
from errorscreen.testing import check_simulator

EXAMPLE = Path(__file__).parents[3] / "examples" / "plot_fmu.py"
#: the unit of the example
SOURCE = EXAMPLE.read_text(encoding="utf-8").split('"""')[3]
TIME = np.arange(0.0, 4.0, 0.1)
STEP = InputSignal(TIME, "step", 1.0, {"u": 1.0 * (TIME >= 1.0)})


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    builder = pytest.importorskip("pythonfmu.builder", reason="pythonfmu builds the unit")
    pytest.importorskip("fmpy")
    folder = tmp_path_factory.mktemp("fmu")
    (folder / "lag.py").write_text(SOURCE, encoding="utf-8")
    return builder.FmuBuilder.build_FMU(folder / "lag.py", dest=folder)


def lag(unit):
    return FMU(unit, ["K", "T"], ["y"], ["u"])


def test_a_unit_computes_what_its_equations_say(unit):
    y = lag(unit)(np.array([2.0, 0.5]), STEP)[0]
    # the input is known at the end of each communication step
    after = TIME >= 1.0
    assert np.allclose(y[after], 2.0 * (1 - np.exp(-(TIME[after] - 1.0) / 0.5)), atol=1e-6)
    assert np.array_equal(y[~after], np.zeros(int((~after).sum())))


def test_a_unit_keeps_the_contract_of_a_simulator(unit):
    parameters = [Parameter("K", 1.0, 0.5, 2.0), Parameter("T", 1.0, 0.3, 3.0)]
    check_simulator(CallableSimulator(lag(unit), parameters, STEP, outputs=["y"], inputs=["u"]))


def test_a_pickled_unit_unpacks_its_own_files(unit):
    one = lag(unit)
    expected = one(np.array([1.0, 1.0]), STEP)
    assert np.array_equal(pickle.loads(pickle.dumps(one))(np.array([1.0, 1.0]), STEP), expected)


def test_wrong_names_and_files_are_refused(unit, tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        FMU(tmp_path / "none.fmu", ["K"], ["y"])
    with pytest.raises(InputError, match="unknown variable 'Y'"):
        FMU(unit, ["K"], ["Y"])


def test_a_missing_extra_is_named(unit, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(MissingExtraError, match=r"errorscreen\[fmu\]"):
        lag(unit)
