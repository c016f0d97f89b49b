"""The excitation system that the search adds to a unit without exciter."""

import numpy as np
import pytest

from errorscreen.effects import effects_of
from errorscreen.effects.exciter import EXCITER, UNIT_EXCITER, ceiling, sexs

VALUES = {
    "value": 2.0,
    "V": 0.9,
    "V0": 1.0,
    "Efd0": 2.0,
    "x": 0.02,
    "K": 100.0,
    "TA_TB": 0.1,
    "TB": 10.0,
    "TE": 0.1,
}


@pytest.mark.parametrize("E", [-3.0, 0.5, 2.9, 4.0])
def test_with_the_usual_ceiling_it_is_sexs(E):
    assert np.array_equal(ceiling(**VALUES, E=E, Emax=5.0), sexs(**VALUES, E=E))


def test_the_ceiling_limits_the_field_voltage_without_windup():
    Efd, _, dE = ceiling(**VALUES, E=2.0, Emax=3.0)
    assert Efd == 3.0
    assert dE <= 0.0  # outwards it may not go on


def test_units_take_it_and_the_case_study_keeps_its_own():
    assert UNIT_EXCITER in effects_of("unit", "without exciter")
    assert EXCITER in effects_of("synchronous_machine")
    assert UNIT_EXCITER not in effects_of("synchronous_machine")
