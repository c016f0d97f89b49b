"""Flags of renewable units that the search may set otherwise."""

from itertools import combinations, product

import numpy as np
import pytest

from errorscreen.calibration import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery import CauseFinder
from errorscreen.events import Playback
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator, Status
from errorscreen.testing import check_effect

TIME = np.arange(0.0, 3.0, 0.02)
SIGNALS = {
    "V": 1.0 - 0.3 * ((TIME > 1.0) & (TIME < 1.15)) - 0.03 * (TIME >= 1.15),
    "angle": 0.05 * np.sin(3.0 * np.clip(TIME - 1.0, 0.0, None)),
}
EVENT = Playback(TIME, "dip", 1.0, SIGNALS, {"V": 1.0, "P": 0.7, "Q": 0.1})
#: what the search may name beside the flags
OTHERS = ("lag_P", "lag_Q", "offset_Q", "scale_Q")


def plant(**flags):
    """Photovoltaic plant with some flags of its electrical control, and one that holds its reactive power."""
    control = Record(PARTS["REECB1"], flags)
    device = unit([Record(PARTS["REGCA1"], {}), control, Record(PARTS["REPCA1"], {"RefFlag": 0})])
    return PlantSimulator(device, EVENT, step=0.005, n_threads=1)


@pytest.fixture(scope="module")
def stated():
    """The plant as its file says."""
    return plant(QFLAG=0)


def names(simulator):
    return [effect.name for effect in simulator.effects if effect.switch]


def test_each_flag_is_offered_in_its_other_setting(stated):
    titles = {effect.name: effect.title for effect in stated.effects if effect.switch}
    assert titles["REECB1.QFLAG"] == "QFLAG of REECB1 is 1, the file says 0"
    assert titles["REPCA1.RefFlag"] == "RefFlag of REPCA1 is 1, the file says 0"
    assert {*titles} == {
        *(f"REECB1.{flag}" for flag in ("PFFLAG", "VFLAG", "QFLAG", "PQFLAG")),
        *(f"REPCA1.{flag}" for flag in ("VCFlag", "RefFlag", "Fflag")),
        "REGCA1.Lvplsw",
    }


def test_a_speed_that_rests_gives_no_flag_and_a_machine_has_none():
    """PFLAG of REECA1 multiplies with the speed, which is 1 without a drive train."""
    control = [Record(PARTS["REGCA1"], {}), Record(PARTS["REECA1"], {})]
    train = Record(PARTS["WTDTA1"], {})
    own = [{effect.name for effect in unit(records).effects} for records in (control, [*control, train])]
    assert own[1] - own[0] == {"REECA1.PFLAG"}
    assert unit([Record(PARTS["GENROU"], {}), Record(PARTS["GGOV1"], {})]).effects == ()


def test_no_two_records_of_a_unit_share_the_name_of_a_flag():
    """An effect finds its constant by the name that the record gives it."""
    flags = {
        part: {field.name for field in part.fields if field.allowed == "0, 1"} for part in PARTS.values()
    }
    for one, other in combinations(flags, 2):
        assert one.slot == other.slot or not flags[one] & flags[other]


def test_a_switch_is_the_record_with_that_flag_and_off_it_changes_nothing(stated):
    check_effect(stated, "REECB1.QFLAG")
    extended = stated.extend("REECB1.QFLAG")
    other = plant(QFLAG=1)
    assert np.array_equal(extended.baseline(), other.baseline())
    assert np.abs(extended.baseline() - stated.baseline()).max() > 0.1


def test_a_fit_moves_no_switch(stated):
    extended = stated.extend("REECB1.QFLAG").extend("lag_Q")
    assert "REECB1.QFLAG.on" in extended.parameters.names
    assert extended.movable == (*stated.parameters.names, "lag_Q.T")
    observation = Observation(EVENT, extended.baseline(), np.full(2, 1e-3), stated.channels, stated.units)
    assert FitProblem(extended, observation).names == extended.movable


def test_combinations_that_contradict_each_other_fail_and_say_so(stated):
    """A plant controller of reactive power cannot give a reference of voltage within its limits."""
    everything = stated
    for name in names(stated):
        everything = everything.extend(name)
    rows = np.tile(everything.parameters.nominal, (2 ** len(names(stated)), 1))
    rows[:, -len(names(stated)) :] = list(product((0.0, 1.0), repeat=len(names(stated))))
    responses = everything.simulate(rows)
    assert {*responses.status} == {Status.OK, Status.NO_EQUILIBRIUM}
    assert np.isfinite(responses.values[responses.ok]).all()
    on = dict(zip(names(stated), rows[:, -len(names(stated)) :].T, strict=True))
    voltage = (on["REECB1.QFLAG"] == 1) & (on["REECB1.VFLAG"] == 1)
    assert np.array_equal(responses.status == Status.NO_EQUILIBRIUM, voltage)
    assert (
        "RefFlag = 0 orders reactive power, which the electrical control takes as a voltage"
        in responses.detail
    )


def found(simulator, truth, seed=1, moved=1.05):
    """Search in a record of another plant with deviating parameters, at 40 dB."""
    theta = truth.parameters.nominal.copy()
    theta[truth.parameters.index("REPCA1.Ki")] *= moved
    y = truth.simulate(theta).require_ok().values[0]
    noise = 0.01 * np.sqrt(np.mean((y - y[:, :1]) ** 2, axis=1))
    noisy = y + noise[:, None] * np.random.default_rng(seed).standard_normal(y.shape)
    observation = Observation(EVENT, noisy, noise, simulator.channels, simulator.units)
    finder = CauseFinder(
        simulator, [*names(simulator), *OTHERS], max_effects=1, n_fits=2, n_starts=1, library_size=64,
        random_state=0,
    )  # fmt: skip
    return finder.fit(observation)


def test_the_wrong_flag_is_named_without_an_estimate(stated):
    finder = found(stated, plant(QFLAG=1))
    first = finder.causes_[0]
    assert (first.name, first.exact) == ("REECB1.QFLAG", True)
    assert first.probability > 0.9
    assert first.parameters == ()
    assert finder.verdict_.text.startswith("QFLAG of REECB1 is 1, the file says 0")
    # one discrete choice: as many parameters as without it
    best, base = finder.best_, finder.hypotheses_[-1]
    assert best.names == base.names == stated.parameters.names
    assert all(estimate.name in stated.parameters.names for estimate in finder.diagnosis_.parameters)
    assert np.array_equal(
        finder.predict(), plant(QFLAG=1).with_nominal(best.theta[: len(best.names)]).baseline()
    )


def test_right_flags_are_not_named(stated):
    finder = found(stated, stated, moved=1.6)
    assert finder.verdict_.kind == "parameters"
    assert finder.causes_[0].name == "parameters"
