"""The excitation system that the search adds to a unit without exciter."""

import numpy as np
import pytest

from errorscreen.effects import effects_of
from errorscreen.effects.exciter import EXCITER, UNIT_EXCITER, ceiling, sexs

VALUES = {
    "value": 2.0,
    "Efd0": 2.0,
    "x": 0.02,
    "K": 100.0,
    "TA_TB": 0.1,
    "TB": 10.0,
    "TE": 0.1,
}
#: the voltage of a unit without compensator, and with a stabiliser that rests
UNIT = VALUES | {"Vc": 0.9, "Vs": 0.0, "Vc0": 1.0}


@pytest.mark.parametrize("E", [-3.0, 0.5, 2.9, 4.0])
def test_with_the_usual_ceiling_it_is_sexs(E):
    assert np.array_equal(ceiling(**UNIT, E=E, Emax=5.0), sexs(**VALUES, V=0.9, V0=1.0, E=E))


def test_a_signal_of_the_stabiliser_acts_as_a_lower_voltage_does():
    lower = UNIT | {"Vc": 0.88}
    assert np.allclose(ceiling(**UNIT | {"Vs": 0.02}, E=0.5, Emax=5.0), ceiling(**lower, E=0.5, Emax=5.0))


def test_the_ceiling_limits_the_field_voltage_without_windup():
    Efd, _, dE = ceiling(**UNIT, E=2.0, Emax=3.0)
    assert Efd == 3.0
    assert dE <= 0.0  # outwards it may not go on


def test_units_take_it_and_the_case_study_keeps_its_own():
    assert UNIT_EXCITER in effects_of("unit", "without exciter")
    assert EXCITER in effects_of("synchronous_machine")
    assert UNIT_EXCITER not in effects_of("synchronous_machine")
