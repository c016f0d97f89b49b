"""The steam turbine that the search adds to a unit without governor."""

import numpy as np
import pytest

from errorscreen.effects import effects_of
from errorscreen.effects.governor import GOVERNOR, STEAM_GOVERNOR, steam, tgov1

VALUES = {
    "value": 0.7,
    "omega": 0.997,
    "Pm0": 0.7,
    "g": 0.04,
    "x": 0.01,
    "K": 20.0,
    "db": 5e-4,
    "T1": 0.3,
    "T3": 7.0,
}


def test_with_the_chest_at_the_valve_it_is_tgov1():
    Pm, dg, dc, dx = steam(**VALUES, c=0.04, TCH=0.25, T2_T3=0.3)
    assert np.allclose((Pm, dg, dx), tgov1(**VALUES, T2_T3=0.3), rtol=1e-15)
    assert dc == 0.0


def test_the_chest_follows_the_valve_within_its_limits():
    *_, dc, _ = steam(**{**VALUES, "g": 0.9}, c=0.1, TCH=0.25, T2_T3=0.3)
    assert dc == pytest.approx((0.5 - 0.1) / 0.25)  # 0.5 is what the limit of 1.2 leaves above 0.7


def test_at_rest_nothing_moves():
    rest = {**VALUES, "omega": 1.0, "g": 0.0, "x": 0.0}
    assert steam(**rest, c=0.0, TCH=0.25, T2_T3=0.3) == (0.7, 0.0, 0.0, 0.0)


def test_units_take_it_and_the_case_study_keeps_its_own():
    assert STEAM_GOVERNOR in effects_of("unit", "without governor")
    assert GOVERNOR in effects_of("synchronous_machine")
    assert STEAM_GOVERNOR not in effects_of("synchronous_machine")
