"""Units joined from standard models, and what is said of a start that cannot be."""

import numpy as np
import pytest

from errorscreen.effects import effects_of
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator

TIME = np.arange(0.0, 3.0, 0.01)


def played(device, P=0.8, Q=0.2, **options):
    voltage = np.where((TIME > 1.0) & (TIME < 1.1), 0.7, 1.0)
    event = Playback(TIME, "dip", 1.0, {"V": voltage, "angle": 0 * TIME}, {"V": 1.0, "P": P, "Q": Q})
    return PlantSimulator(device, event, **options)


def records(**changes):
    return [Record(PARTS[name], changes.get(name, {})) for name in ("GENROU", "SEXS", "TGOV1")]


@pytest.fixture(scope="module")
def plant():
    return played(unit(records()))


def test_parts_of_a_unit_come_in_any_order():
    one, other = unit(records()), unit(records()[::-1])
    assert (one.name, one.states) == (other.name, other.states) == ("GENROU+SEXS+TGOV1", one.states)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (["SEXS"], "no machine or converter"),
        ([], "no machine or converter"),
        (["GENROU", "GENSAL"], "both in the slot machine"),
        (["GENROU", "REECA1"], "another kind of unit"),
    ],
)
def test_parts_that_make_no_unit_are_refused(parts, words):
    with pytest.raises(InputError, match=words):
        unit([Record(PARTS[name], {}) for name in parts])


def test_a_start_above_a_limit_names_record_number_and_limit(plant):
    low = played(unit(records(SEXS={"EMAX": 1.5})))
    told = low.simulate(low.parameters.nominal).failures()
    assert "SEXS: field voltage starts at 2.129 pu" in told
    assert "above EMAX = 1.5" in told
    assert plant.simulate(plant.parameters.nominal).ok.all()


def test_a_start_just_above_a_limit_rests_there_and_says_so():
    tight = played(unit(records(TGOV1={"VMAX": 0.795})), P=0.8)
    rest = tight.simulate(tight.parameters.nominal).require_ok().values[0, 0]
    assert np.abs(rest[TIME < 1.0] - 0.8).max() < 1e-9
    start = tight.device.initialise
    values = tight._prepared(tight.parameters.nominal[None], tight.event, tight.step)[3]
    assert [
        "TGOV1: valve starts at 0.8 pu, above VMAX = 0.795" in told for told in start.moved_limits(values)
    ] == [True]


def test_values_of_a_fit_that_break_a_rule_have_no_start(plant):
    theta = plant.parameters.nominal.copy()
    theta[plant.parameters.index("GENROU.Xpp")] = 0.35
    theta[plant.parameters.index("GENROU.Xpd")] = 0.3
    told = plant.simulate(theta).failures()
    assert "X''d <= X'd" in told


def test_a_constant_of_zero_has_the_range_of_its_model():
    damping = unit(records(GENROU={"D": 0.0})).candidates["GENROU.D"]
    assert (damping.nominal, damping.lower, damping.upper, damping.scale) == (0.0, 0.0, 4.0, 4.0)


def test_saturation_of_zero_is_left_to_an_effect():
    # PSS/E runs a record with S(1.0) = 0 and S(1.2) = 1 without saturation
    without = unit(records(GENROU={"S10": 0.0, "S12": 1.0}))
    assert not {"GENROU.S10", "GENROU.S12"} & {*without.candidates.names}
    assert "saturation" in [effect.name for effect in effects_of(without.name, *without.tags)]
    with_it = unit(records())
    assert "saturation" not in [effect.name for effect in effects_of(with_it.name, *with_it.tags)]


def test_an_empty_slot_is_offered_to_the_search_and_a_filled_one_may_not_act():
    def names(*parts):
        device = unit([Record(PARTS[name], {}) for name in parts])
        return {effect.name for effect in effects_of(device.name, *device.tags)}

    assert {"exciter", "governor", "stabiliser"} <= names("GENROU")
    assert {"regulator_acting", "stabiliser", "governor"} <= names("GENROU", "SEXS")
    assert not {"exciter", "stabiliser_acting"} & names("GENROU", "SEXS")
    assert {"stabiliser_acting", "governor_acting"} <= names("GENROU", "SEXS", "IEEEST", "TGOV1")


@pytest.mark.parametrize(
    ("effect", "held"), [("regulator_acting", "exciter"), ("governor_acting", "governor")]
)
def test_a_part_that_does_not_act_is_a_unit_without_it(effect, held):
    kept = [record for record in records() if record.part.slot != held]
    bare = played(unit(kept))
    plant = played(unit(records()))
    blocked = plant.extend(next(e for e in plant.effects if e.name == effect))
    theta = blocked.parameters.nominal.copy()
    theta[blocked.parameters.index(f"{effect}.a")] = 1.0
    found = blocked.simulate(theta).require_ok().values
    np.testing.assert_allclose(found, bare.simulate(bare.parameters.nominal).values, atol=1e-12)


def test_a_unit_behind_an_impedance_without_impedance_is_the_unit(plant):
    # as small as can be: the recorded voltage is then imposed
    event = plant.event
    P, Q = plant.simulate(plant.parameters.nominal).values[0]
    signals = {**event.signals, "P": P, "Q": Q}
    behind = PlantSimulator(
        plant.device, Playback(TIME, "dip", 1.0, signals, event.initial), grid_impedance=1e-6j
    )
    np.testing.assert_allclose(behind.simulate(behind.parameters.nominal).values[0, 0], P, atol=1e-3)


def test_a_unit_is_no_part_of_a_simulated_grid(plant):
    from errorscreen.simulators import Unit

    with pytest.raises(InputError, match="cannot be connected to a grid"):
        Unit(38, plant.device, 100.0)


def test_recorded_field_voltage_and_speed_are_compared(plant):
    from errorscreen.data.recordings import Recording

    P, Q = plant.simulate(plant.parameters.nominal).values[0]
    rng = np.random.default_rng(1)
    states = plant.trajectories(plant.parameters.nominal[None], plant.event)
    signals = {**plant.event.signals, "P": P, "Q": Q, "speed": states["omega"], "Efd": states["SEXS.E"]}
    values = {name: one + rng.normal(0, 1e-4, len(TIME)) for name, one in signals.items()}
    recording = Recording.from_arrays(TIME, values, base_mva=100.0, f_nominal=60.0, event_time=1.0)
    both = PlantSimulator(plant.device, recording)
    assert both.channels == ("P", "Q", "Efd", "speed")
    seen = both.observe(recording)
    found = both.simulate(both.parameters.nominal, seen.event).require_ok().values[0]
    assert np.abs(found - seen.values)[:, TIME < 1.0].max() < 2e-3
    assert np.sqrt(np.mean((found - seen.values) ** 2, axis=1)).max() < 2e-2
    assert np.ptp(found[2]) > 0.05
