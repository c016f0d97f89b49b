"""In what a unit differs from its file."""

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from errorscreen.bench import unit_differences as differ
from errorscreen.exceptions import InputError
from errorscreen.models.standard import PARTS

UNIT = ("GENROU", "SEXS", "TGOV1", "IEEEST")


def slots(records):
    return {PARTS[model].slot for model in records}


@pytest.mark.parametrize("model", UNIT[1:])
def test_a_missing_part_is_in_the_unit_and_not_in_the_file(model):
    whole, one = differ.typical(UNIT), [differ.missing(model)]
    assert differ.truth_of(whole, one) == whole
    assert set(whole) - set(differ.file_of(whole, one)) == {model}


@pytest.mark.parametrize(("model", "gone"), [("TGOV1", {"TGOV1"}), ("SEXS", {"SEXS", "IEEEST"})])
def test_a_part_that_is_off_is_in_the_file_and_not_in_the_unit(model, gone):
    whole, one = differ.typical(UNIT), [differ.off(model)]
    assert differ.file_of(whole, one) == whole
    assert set(whole) - set(differ.truth_of(whole, one)) == gone


def test_saturation_and_flags_change_constants():
    whole = differ.typical(UNIT)
    one = [differ.saturation("GENROU")]
    assert differ.file_of(whole, one)["GENROU"]["S12"] == 0.0 < differ.truth_of(whole, one)["GENROU"]["S12"]
    wind = differ.typical(("REGCA1", "REECA1", "REPCA1"))
    flag = next(e for e in differ.device_of(wind).effects if e.name == "REECA1.QFLAG")
    one = [differ.flag(flag)]
    assert differ.truth_of(wind, one)["REECA1"]["QFLAG"] == 1.0 - wind["REECA1"]["QFLAG"]
    assert differ.file_of(wind, one) == wind
    assert one[0].right == ("REECA1.QFLAG",)


@given(st.integers(0, 2**32 - 1))
def test_another_base_scales_p_and_q_alike(seed):
    one = differ.other_base(np.random.default_rng(seed))
    channels = {"V": np.ones(3), "P": np.array([0.5, 0.6, 0.7]), "Q": np.array([0.1, -0.2, 0.3])}
    found = one.distort(channels, 0.01)
    factor = found["P"] / channels["P"]
    assert np.ptp(factor) < 1e-12
    assert abs(factor[0] - 1) >= 0.08 - 1e-12
    assert found["Q"] == pytest.approx(factor[0] * channels["Q"])
    assert found["V"] is channels["V"]


@given(st.integers(0, 2**32 - 1))
def test_a_fault_of_the_measurement_changes_p_or_q_alone(seed):
    one = differ.fault_of_measurement(np.random.default_rng(seed))
    time = np.linspace(0, 1, 200)
    channels = {"V": np.ones(200), "P": 0.5 + 0.1 * np.sin(9 * time), "Q": 0.2 * np.cos(7 * time)}
    found = one.distort(channels, time[1])
    changed = {name for name in channels if not np.array_equal(found[name], channels[name])}
    assert changed == set(one.slot.split(", "))


def test_two_differences_are_at_places_of_their_own():
    rng = np.random.default_rng(0)
    assert differ.fit_together([differ.missing("SEXS"), differ.off("TGOV1")])
    assert not differ.fit_together([differ.missing("SEXS"), differ.off("SEXS")])
    assert not differ.fit_together([differ.missing("IEEEST"), differ.off("SEXS")])
    assert not differ.fit_together([differ.other_base(rng), differ.fault_of_measurement(rng)])


@given(st.integers(0, 2**32 - 1))
def test_true_parameters_deviate_inside_what_the_user_lets_move(seed):
    whole = differ.typical(UNIT)
    try:
        true = differ.deviated(whole, np.random.default_rng(seed), {"GENROU": ("Xl", "H")})
    except InputError:  # reactances in another order make no machine
        reject()
    space = differ.candidates_of(differ.device_of(whole))
    ratios = {
        name: true[m][c] / whole[m][c] for name in space.names for m, c in [name.split(".")] if whole[m][c]
    }
    moved = [name for name, ratio in ratios.items() if ratio != 1.0]
    assert 12 <= len(moved) <= 20
    assert "GENROU.H" not in moved
    assert all(0.75 <= ratio <= 1.25 for ratio in ratios.values())
    for p in space:
        if p.nominal == 0:  # as the models' own table says
            continue
        assert p.lower >= p.nominal - 0.5 * abs(p.nominal) - 1e-12
        assert p.upper <= p.nominal + 0.5 * abs(p.nominal) + 1e-12


def test_a_family_that_is_not_offered_may_have_several_right_names():
    assert differ.other_family("GAST").right == ("governor", "hydro_governor", "gas_governor")
    assert differ.other_family("ESST4B").right == ("exciter",)
    assert "exciter" not in slots(
        differ.file_of(differ.typical(("GENROU", "ESST4B")), [differ.other_family("ESST4B")])
    )
