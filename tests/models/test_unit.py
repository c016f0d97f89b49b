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


@pytest.mark.filterwarnings("error")
def test_a_row_that_divides_by_zero_does_not_warn_while_another_is_explained():
    low = played(unit(records(SEXS={"EMAX": 1.5})))
    space = low.parameters
    theta = np.tile(space.nominal, (2, 1))
    theta[1, space.index("GENROU.Xpd")] = low.device.constant_values()["GENROU.Xl"]
    assert "above EMAX = 1.5" in low.simulate(theta).failures()


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


def test_a_limit_is_a_candidate_where_it_is_named():
    device = unit(records(SEXS={"EMAX": 3.0}))
    assert {"SEXS.EMAX", "TGOV1.VMIN", "GENROU.Xl"} <= {*device.further.names}
    assert device.limits == ("SEXS.EMIN", "SEXS.EMAX", "TGOV1.VMAX", "TGOV1.VMIN")
    named = device.with_candidates(["TGOV1.VMIN", "SEXS.EMAX"])
    assert named.candidates.names == (*device.candidates.names, "SEXS.EMAX", "TGOV1.VMIN")
    ceiling, valve = named.candidates["SEXS.EMAX"], named.candidates["TGOV1.VMIN"]
    assert (ceiling.nominal, ceiling.lower, ceiling.upper) == (3.0, 1.5, 6.0)
    assert (valve.lower, valve.upper, valve.scale) == (-0.5, 0.5, 1.0)
    assert named.limits == ("SEXS.EMIN", "TGOV1.VMAX")
    assert device.with_candidates(["GENROU.H"]) is device


def test_a_named_limit_has_the_sign_that_its_record_allows():
    device = unit([Record(PARTS["GENROU"], {}), Record(PARTS["IEEEG1"], {"UC": 0.0})])
    rate = device.further["IEEEG1.UC"]
    assert (rate.lower, rate.upper, rate.domain) == (-0.5, 0.0, "<= 0")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("SEXS.EMX", "unknown parameter 'SEXS.EMX' .did you mean 'SEXS.EMAX'"),
        ("IEEET1.VRMAX", "IEEET1.VRMAX is 0 and cannot be a candidate"),
        ("IEEET1.Switch", "IEEET1.Switch is 0 and cannot be a candidate"),
    ],
)
def test_what_cannot_be_a_candidate_is_said(name, words):
    parts = ("GENROU", name.partition(".")[0])
    device = unit([Record(PARTS[one], {"VRMAX": 0.0} if one == "IEEET1" else {}) for one in parts])
    with pytest.raises(InputError, match=words):
        device.with_candidates([name])


def test_a_value_of_a_named_limit_is_that_of_another_file():
    truth = played(unit(records(SEXS={"EMAX": 4.0})))
    ours = played(unit(records(SEXS={"EMAX": 3.0})).with_candidates(["SEXS.EMAX"]))
    theta = ours.parameters.nominal.copy()
    expected = truth.simulate(truth.parameters.nominal).require_ok().values
    assert np.abs(ours.simulate(theta).values - expected).max() > 0.02
    theta[ours.parameters.index("SEXS.EMAX")] = 4.0
    np.testing.assert_allclose(ours.simulate(theta).values, expected, atol=1e-12)


def told(*named):
    """Reason why a unit of these records does not start."""
    device = unit([Record(PARTS[name], values) for name, values in named])
    values = {p.name: np.array([p.nominal]) for p in device.candidates}
    values |= {name: np.array([value]) for name, value in device.constant_values().items()}
    values |= {name: np.array([value]) for name, value in zip("VPQ", (1.0, 0.7, 0.15), strict=True)}
    values["angle"] = np.array([0.0])
    *_, fits = device.initialise(values)
    assert bool(fits[0]) == (not device.initialise.problems(values))
    return "; ".join(device.initialise.problems(values))


def test_flags_that_contradict_each_other_are_told_whatever_the_limits():
    plant = {"RefFlag": 0, "Qmax": 1.2, "Qmin": -1.2}

    def flags(REECB1, REPCA1=plant):
        return told(("REGCA1", {}), ("REECB1", REECB1), ("REPCA1", REPCA1))

    assert "REPCA1: RefFlag = 0 orders reactive power" in flags({"QFLAG": 1, "VFLAG": 0})
    assert not flags({"QFLAG": 1, "VFLAG": 1})
    assert not flags({"QFLAG": 0, "VFLAG": 0})
    assert not flags({"QFLAG": 1, "VFLAG": 0}, {**plant, "RefFlag": 1})


@pytest.mark.parametrize("model", ["REECA1", "REECB1", "REECD1"])
def test_a_start_in_a_dip_is_told(model):
    found = told(("REGCA1", {}), (model, {"Vdip": 1.05}))
    assert f"{model}: V before the event is 1 pu, outside of Vdip = 1.05 to Vup" in found
    assert not told(("REGCA1", {}), (model, {"Vdip": 0.9}))


def test_a_turbine_without_a_share_is_told():
    shares = dict.fromkeys(("K1", "K3", "K5", "K7"), 0.0)
    assert "IEEEG1: K1, K3, K5 and K7 are 0" in told(("GENROU", {}), ("IEEEG1", shares))


@pytest.mark.parametrize(
    ("model", "tight", "word"),
    [
        ("ESST1A", {"VRMAX": 1.0, "KC": 0.1}, "VRMAX of at least"),
        ("ESST1A", {"VRMIN": 2.5, "KC": 0.1}, "VRMIN of at most"),
        ("EXST1", {"VRMAX": 1.0, "KC": 0.1}, "VRMAX of at least"),
        ("ST5B", {"VRMAX": 1.0, "KC": 0.1}, "VRMAX of at least"),
        ("ESST4B", {"VMMAX": 0.1}, "VMMAX of at least"),
        ("EXAC2", {"VLR": 0.5}, "VLR of at least"),
    ],
)
def test_the_advised_limit_fits(model, tight, word):
    frame = ("GENROU", {})
    found = told(frame, (model, tight))
    advised = float(found.split(word)[1].split()[0].rstrip(","))
    assert word.split()[0] not in told(frame, (model, {**tight, word.split()[0]: advised}))


def test_the_gate_of_a_governor_is_compared():
    for name, state in (("TGOV1", "g"), ("HYGOV", "g"), ("IEEEG1", "v"), ("GGOV1", "v"), ("GAST", "x1")):
        device = unit([Record(PARTS["GENROU"], {}), Record(PARTS[name], {})])
        assert device.recordable["gate"] == f"{name}.{state}"
    for parts in (("GENROU", "IEESGO"), ("GENROU",)):
        assert "gate" not in unit([Record(PARTS[name], {}) for name in parts]).recordable


def test_a_rating_needs_the_base_of_the_machine():
    device = unit([Record(PARTS["GENROU"], {}), Record(PARTS["GGOV1"], {"TRATE": 90.0})])
    with pytest.raises(
        InputError, match="states TRATE, the rating of its turbine, but the base of the machine"
    ):
        played(device, effects=())
    with pytest.raises(InputError, match="MBASE is 0"):
        played(device, effects=(), constants={"MBASE": 0.0})
    assert played(device, effects=(), constants={"MBASE": 120.0}).constants["MBASE"] == 120.0
    assert "MBASE" not in unit([Record(PARTS["GENROU"], {}), Record(PARTS["GGOV1"], {})]).constant_values()
