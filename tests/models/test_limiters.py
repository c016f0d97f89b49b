"""Limiters of the excitation: a second form, entries of all exciters, records, and effects that stand for them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.effects import effects_of
from errorscreen.engine.stages import stage
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.dyr import DyrFile
from errorscreen.models.exciters import EXCITERS
from errorscreen.models.exciters.ac1 import limited
from errorscreen.models.limiters import MNLEX2
from errorscreen.models.part import Part, Start
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from tests.models.imposed import rms, run

H = 0.001


@stage("V", "P", "Q")
def powers(Vr, Vi):
    return 0.0 * Vr + 0.95, Vr + 0.0, Vi + 0.0


@stage("Efd")
def held(VUEL):
    return (VUEL + 1.0,)


#: a machine whose active and reactive power are imposed, and an exciter that shows the signal
POWERS = Part(
    "POWERS", "machine", "imposed powers", (), (powers,), ("V", "P", "Q", "omega", "Efd0", "Pm0"),
    setpoints=("omega", "Efd0", "Pm0"), start=lambda v: Start({}, {"omega": 1.0, "Efd0": 1.0, "Pm0": 1.0}),
)  # fmt: skip
SHOWN = Part("SHOWN", "exciter", "the signal", (), (held,), ("Efd",))
RECORD = {"KF2": 0.2, "TF2": 0.6, "KM": 0.8, "TM": 0.15, "MELMAX": 0.25, "Q0": 1.1, "Radius": 1.7}


def imposed_powers(t):
    """Two excursions into under-excitation, the second one up to the limit of the signal."""
    bump = np.exp(-(((t - 0.6) / 0.15) ** 2)) + 1.9 * np.exp(-(((t - 1.7) / 0.25) ** 2))
    return 0.7 + 0.0 * t, 0.1 - 0.75 * bump


def test_mnlex2_follows_its_second_form_in_both_engines():
    device = unit([Record(POWERS, {}), Record(SHOWN, {}), Record(MNLEX2, RECORD)])
    half = np.arange(2 * 2500 + 1) * H / 2
    u = np.column_stack(imposed_powers(half))
    found = run(device, u, {}, ["VUEL", "MNLEX2.xF"], h=H)
    r = RECORD
    V2 = 0.95**2

    def slope(t, state):
        signal, filtered = min(max(state[0], 0.0), r["MELMAX"]), state[1]
        P, Q = imposed_powers(t)
        margin = abs(P + 1j * (Q - r["Q0"] * V2)) ** 2 - (r["Radius"] * V2) ** 2
        feedback = r["KF2"] * (signal - filtered) / r["TF2"]
        change = (r["KM"] * (margin - feedback) - state[0]) / r["TM"]
        outwards = (state[0] >= r["MELMAX"] and change > 0) or (state[0] <= 0 and change < 0)
        return [0.0 if outwards else change, (signal - filtered) / r["TF2"]]

    exact = solve_ivp(slope, (0, 2.5), [0.0, 0.0], t_eval=half[::2], max_step=1e-3, rtol=1e-8).y
    assert exact[0].max() == pytest.approx(0.25, abs=1e-3)
    assert rms(found - exact) < 3e-4
    assert found[0, 700] > 0.05
    first = run(device, u[:1401], {}, ["VUEL", "MNLEX2.xF"], h=H, kind="numpy")
    np.testing.assert_array_equal(first, found[:, :701])
    instant = {"MNLEX2.TM": 0.0, "MNLEX2.TF2": 0.0, "MNLEX2.KF2": 0.0}
    quick = run(device, u, {}, ["VUEL"], h=H, changes=instant)
    assert np.isfinite(quick).all()
    assert (quick >= 0).all()
    assert (quick <= 0.25).all()


# --- entries of the exciters ------------------------------------------------------------------------------------------


def source(slot, *ports, gate=None):
    """Limiter or stabiliser whose signal is a share of the speed, which a test imposes."""

    @stage(ports[0])
    def signal(omega):
        return (2.0 * (omega - 1.0),)

    rest = {} if gate is None else {ports[1]: gate}
    return Part(
        f"SIGNAL {slot}", slot, "signal", (), (signal,), ports, setpoints=ports[1:],
        start=lambda v: Start({}, {name: 0.0 * v["V"] + value for name, value in rest.items()}),
    )  # fmt: skip


@stage("V", "Vd", "Vq", "omega", "P", "Q", "Id", "Iq", "If")
def moving(Vr, Vi):
    V = 0.0 * Vr + 1.0
    return V, 0.6 * V, 0.8 * V, Vi + 1.0, 0.8 * V, 0.2 * V, 0.6 * V, 0.5 * V, 2.0 * V


MOVING = Part(
    "MOVING", "machine", "imposed speed", (), (moving,),
    ("V", "Vd", "Vq", "omega", "P", "Q", "Id", "Iq", "If", "Efd0", "Pm0"),
    setpoints=("Efd0", "Pm0"), start=lambda v: Start({}, {"Efd0": 2.0, "Pm0": 0.8}),
)  # fmt: skip
SWING = 0.005 * np.sin(np.arange(2 * 60 + 1) * 0.3)


@pytest.mark.parametrize("exciter", EXCITERS, ids=lambda part: part.name)
def test_a_summed_signal_acts_on_every_exciter_as_one_of_the_stabiliser(exciter):
    u = np.column_stack([0 * SWING + 1.0, SWING])

    def played(part):
        device = unit([Record(MOVING, {}), Record(exciter, {}), Record(part, {})])
        return run(device, u, {}, ["Efd"], h=0.002, kind="numpy")

    expected = played(source("stabiliser", "Vs"))
    assert np.ptp(expected) > 1e-4
    for part in (
        source("over_excitation", "VOEL", "OELgate", gate=1e9),
        source("under_excitation", "VUEL", "UELgate", gate=-1e9),
    ):
        np.testing.assert_allclose(played(part), expected, rtol=1e-9)


def test_gates_of_esac1a_act_between_regulator_and_exciter():
    at = {"lowR": -5.0, "highR": 6.0}
    assert limited(2.0, 0.0, 0.0, -1e9, 1e9, **at) == (2.0,)
    assert limited(2.0, 3.0, 0.0, 0.0, 1e9, **at) == (3.0,)
    assert limited(2.0, 3.0, -2.5, 0.0, 4.0, **at) == (1.5,)  # over-excitation has the last word
    assert limited(2.0, 9.0, 0.0, 0.0, 1e9, **at) == (6.0,)


@pytest.mark.parametrize(
    ("name", "UEL"), [("ESST1A", 2), ("ESST1A", 3), ("ESAC1A", 0), ("ESDC2A", 0), ("ST5B", 0)]
)
def test_a_unit_that_starts_beyond_a_gate_rests_there_and_says_so(name, UEL):
    exciter = Record(PARTS[name], {"UEL": UEL} if UEL else {})
    device = unit(
        [Record(MOVING, {}), exciter, Record(source("under_excitation", "VUEL", "UELgate", gate=9.0), {})]
    )
    values = {p.name: p.nominal for p in device.candidates} | device.constant_values()
    values |= {"V": 1.0, "angle": 0.0, "shortest": 0.001}
    values = {one: np.array([value]) for one, value in values.items()}
    assert any("gate of under-excitation" in told for told in device.initialise.problems(values))
    states, setpoints, _ = device.initialise(values)
    known = {**values, **states, **setpoints, "Vr": np.ones(1), "Vi": np.zeros(1)}
    for call in device.stages:
        known |= dict(zip(call.writes, call.function(*(known[one] for one in call.reads)), strict=True))
    assert max(abs(float(known[f"d_{one}"][0])) for one in device.states) < 1e-9


# --- units ------------------------------------------------------------------------------------------------------------

TIME = np.arange(0.0, 8.0, 0.01)


def played(models, V, Q=-0.1, **records):
    device = unit([Record(PARTS[name], records.get(name, {})) for name in models])
    voltage = np.where(TIME > 1.0, V, 1.0)
    event = Playback(TIME, "step", 1.0, {"V": voltage, "angle": 0 * TIME}, {"V": 1.0, "P": 0.5, "Q": Q})
    return PlantSimulator(device, event)


def extended(plant, effect, **values):
    """Responses of a plant with an effect, at values of its parameters."""
    found = plant.extend(next(one for one in plant.effects if one.name == effect))
    theta = found.parameters.nominal.copy()
    for name, value in values.items():
        theta[found.parameters.index(f"{effect}.{name}")] = value
    return found.simulate(theta).require_ok().values[0]


def nominal(plant):
    return plant.simulate(plant.parameters.nominal).require_ok().values[0]


@pytest.fixture(scope="module")
def bare():
    """A unit without limiters while the voltage of the grid is high."""
    return played(("GENROU", "SEXS"), 1.06)


@pytest.fixture(scope="module")
def with_limiter():
    return played(("GENROU", "SEXS", "MNLEX2"), 1.06, MNLEX2={"Radius": 1.75, "KM": 1.0})


def test_the_limiter_rests_in_normal_operation_and_raises_reactive_power_beyond(bare, with_limiter):
    free, held = nominal(bare)[1], nominal(with_limiter)[1]
    before = TIME <= 1.0
    np.testing.assert_array_equal(held[before], free[before])
    assert np.abs(held[before] + 0.1).max() < 1e-9
    assert held[-1] > free[-1] + 0.05


def test_a_limiter_that_does_not_act_is_a_unit_without_it(bare, with_limiter):
    off = extended(with_limiter, "under_excitation_acting", a=1.0)
    np.testing.assert_allclose(off, nominal(bare), atol=1e-12)
    as_it_is = extended(with_limiter, "under_excitation_acting", a=0.0)
    np.testing.assert_array_equal(as_it_is, nominal(with_limiter))


def test_effects_stand_for_limiters_that_a_unit_with_exciter_lacks(bare):
    free = nominal(bare)
    np.testing.assert_array_equal(extended(bare, "under_excitation", K=0.0), free)
    np.testing.assert_array_equal(extended(bare, "field_limiter", K=0.0), free)
    assert extended(bare, "under_excitation", K=2.0, Q_min=-0.2)[1, -1] > free[1, -1] + 0.05
    low = played(("GENROU", "SEXS"), 0.95, Q=0.3)
    assert extended(low, "field_limiter", K=0.2, If_max=1.9)[1, -1] < nominal(low)[1, -1] - 0.05


def test_effects_of_limiters_follow_the_slots():
    def names(*parts):
        device = unit([Record(PARTS[name], {}) for name in parts])
        return {effect.name for effect in effects_of(device.name, *device.tags)}

    assert {"field_limiter", "under_excitation"} <= names("GENROU", "SEXS")
    assert not {"field_limiter", "under_excitation", "under_excitation_acting"} & names("GENROU")
    assert {"field_limiter", "under_excitation_acting"} <= names("GENROU", "SEXS", "MNLEX2")
    assert "under_excitation" not in names("GENROU", "SEXS", "MNLEX2")


def test_a_start_outside_the_circle_names_the_radius():
    far = played(("GENROU", "SEXS", "MNLEX2"), 1.0, MNLEX2={"Radius": 1.0})
    told = far.simulate(far.parameters.nominal).failures()
    assert "MNLEX2: distance from the centre of the circle starts at 1.487 pu, above Radius = 1" in told
    near = played(("GENROU", "SEXS", "MNLEX2"), 1.0, MNLEX2={"Radius": 1.47})
    assert np.abs(nominal(near)[1] + 0.1).max() < 1e-9


# --- records ----------------------------------------------------------------------------------------------------------

UNIT = """101 'GENROU' 1  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /
101 'MNLEX2' 1  0.0 1.0 0.3 0.5 0.1 1.3 1.92 / a limiter
101 'SEXS' 1  0.1 10.0 100.0 0.1 0.0 5.0 /
"""


def test_a_limiter_is_read_from_a_file_and_written_back():
    file = DyrFile("unit.dyr", UNIT)
    assert file.check() == []
    assert file.unit().name == "GENROU+MNLEX2+SEXS"
    assert file.changed(101, 1, {"MNLEX2.Radius": 1.8}) == UNIT.replace("1.92", "1.8 ")


def test_a_limiter_without_exciter_is_refused():
    alone = DyrFile("unit.dyr", "".join(UNIT.splitlines(True)[:2]))
    with pytest.raises(InputError, match="MNLEX2 limits an exciter, but the unit has none"):
        alone.unit()
    assert [
        problem for problem in alone.check() if "unit.dyr:2" in problem and "limits an exciter" in problem
    ]
    assert alone.unit(leave_out=["MNLEX2"]).name == "GENROU"
