"""Units that recorded field voltage or mechanical power drives in place of their controllers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.data.plausibility import Doubt
from errorscreen.data.recordings import Recording
from errorscreen.effects import effects_of
from errorscreen.events import Playback
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant.connection import Connection
from tests.models.imposed import needs, records, rms, table

TIME = np.arange(0.0, 4.0, 0.01)
NAMES = ("GENROU", "SEXS", "IEEEST", "TGOV1")


def of(*inputs, names=NAMES, **changes):
    return unit([Record(PARTS[name], changes.get(name, {})) for name in names], inputs=inputs)


def recording(**more):
    """Recorded by the whole unit at a dip, with its field voltage and mechanical power."""
    V = np.where((TIME > 1.0) & (TIME < 1.15), 0.8, 1.0)
    event = Playback(TIME, "dip", 1.0, {"V": V, "angle": 0.0 * TIME}, {"V": 1.0, "P": 0.8, "Q": 0.2})
    plant = PlantSimulator(of(), event, channels=("P", "Q", "Efd", "Pm"), step=0.00125, effects=())
    found = dict(zip(plant.channels, plant.baseline(), strict=True))
    values = {"V": V, "angle": 0.0 * TIME, **found, **more}
    return Recording.from_arrays(
        TIME, values, base_mva=100.0, f_nominal=60.0, event_time=1.0, noise=dict.fromkeys(values, 1e-4)
    )


@pytest.fixture(scope="module")
def recorded():
    return recording()


@pytest.mark.parametrize(
    ("inputs", "left"),
    [(["Efd"], "GENROU+TGOV1"), (["Pm"], "GENROU+IEEEST+SEXS")],
)
def test_a_recorded_quantity_stands_for_what_made_it(recorded, inputs, left):
    plant = PlantSimulator(of(*inputs), recorded, step=0.00125, effects=())
    assert plant.device.name == left
    assert not {*inputs} & {*plant.channels}
    assert {name.partition(".")[0] for name in plant.parameters.names} == {*left.split("+")}
    P, Q = plant.baseline()[:2]
    for found, name in ((P, "P"), (Q, "Q")):
        measured = recorded.channel(name).values
        assert rms(found - measured) < 0.03 * rms(measured - measured[0])


def test_a_recorded_input_behind_a_transformer_is_that_of_the_unit(recorded):
    V, P, Q, angle = (recorded.channel(name).values for name in ("V", "P", "Q", "angle"))
    terminal = V * np.exp(1j * angle)
    current = np.conj((P + 1j * Q) / terminal)
    inner = terminal - 0.1j * current
    S, tap = inner * np.conj(current), 1.05
    point = recording(V=tap * abs(inner), angle=np.unwrap(np.angle(inner)), P=S.real, Q=S.imag)
    connection = Connection(reactance=0.1, tap=tap)
    plant = PlantSimulator(of("Efd"), point, connection=connection, effects=(), step=0.00125)
    found = dict(zip(plant.channels, plant.baseline(), strict=True))
    assert rms(found["P"] - S.real) < 0.03 * rms(S.real - S.real[0])
    assert rms(found["Q"] - S.imag) < 0.03 * rms(S.imag - S.imag[0])


def test_the_recorded_course_is_added_to_the_equilibrium_of_the_model():
    """A classical swing: the deviation of the recorded power, whatever its level, turns the rotor."""
    H, X, step = 3.0, 0.2, 0.05
    device = unit([Record(PARTS["GENCLS"], {"H": H, "D": 2.0})], inputs=["Pm"])
    Pm = np.where(TIME >= 0.5, 0.4 + step * np.minimum(1.0, (TIME - 0.5) / 0.5), 0.4)
    event = Playback(
        TIME, "ramp", 0.5, {"V": 1 + 0 * TIME, "angle": 0 * TIME, "Pm": Pm}, {"V": 1.0, "P": 0.8, "Q": 0.1, "Pm": 0.4}
    )  # fmt: skip
    plant = PlantSimulator(device, event, constants={"Xsource": X, "f0": 60.0}, effects=())
    found = plant.baseline()[0]
    E = 1.0 + 1j * X * np.conj(0.8 + 0.1j)

    def slope(t, x):
        delta, w = x
        P, Pm = abs(E) / X * np.sin(delta), 0.8 + step * np.clip((t - 0.5) / 0.5, 0.0, 1.0)
        return [2 * np.pi * 60.0 * w, ((Pm - 2.0 * w) / (1 + w) - P) / (2 * H)]

    run = solve_ivp(
        slope, (0, TIME[-1]), [np.angle(E), 0.0], t_eval=TIME, rtol=1e-9, atol=1e-12, max_step=0.01
    )
    assert abs(found - abs(E) / X * np.sin(run.y[0])).max() < 1e-4


@pytest.mark.parametrize("case", ["IEEEG1", "SCRX"])
def test_recorded_field_voltage_comes_as_near_to_another_program_as_the_whole_model(case):
    """Rows of 20 ms: what happens between them is as unknown for the voltage as for the field voltage."""
    folder = needs(f"openipsl_smib/{case}")
    record = table(folder / "trajectory.csv")
    rows = np.concatenate([np.diff(record["time_s"]) > 1e-6, [True]])
    time = np.arange(0.0, 5.0, 0.02)
    columns = {
        "V": "V_pu",
        "angle": "V_angle_rad",
        "P": "P_pu",
        "Q": "Q_pu",
        "Efd": "EFD_pu",
        "Pm": "PMECH_pu",
    }
    signals = {n: np.interp(time, record["time_s"][rows], record[c][rows]) for n, c in columns.items()}
    signals["angle"] -= signals["angle"][0]
    initial = {name: values[0] for name, values in signals.items()}
    errors = {}
    for inputs in ((), ("Efd",)):
        device = unit(records(folder / "unit.dyr", 1), inputs=inputs)
        event = Playback(time, case, 2.0, {n: signals[n] for n in ("V", "angle", *inputs)}, initial)
        plant = PlantSimulator(device, event, constants={"f0": 50.0}, effects=())
        errors[inputs] = [rms(y - signals[n]) for y, n in zip(plant.baseline(), "PQ", strict=True)]
    assert np.all(np.array(errors[("Efd",)]) < 1.05 * np.array(errors[()]))


def test_a_level_on_another_base_is_told_and_the_same_level_is_not(recorded):
    plant = PlantSimulator(of("Efd"), recorded, effects=())
    same = plant.observe(recorded)
    assert not [note for note in same.assumptions if isinstance(note, Doubt)]
    assert any("in place of SEXS, IEEEST, whose parameters are no candidates" in n for n in same.assumptions)
    other = recording(Efd=0.8 * recorded.channel("Efd").values)
    with pytest.warns(DataWarning, match="factor 1.25"):
        seen = plant.observe(other)
    (doubt,) = [note for note in seen.assumptions if isinstance(note, Doubt)]
    assert "state the factor as scale" in doubt


def test_noise_of_a_recorded_input_makes_the_response_uncertain(recorded):
    plant = PlantSimulator(of("Efd"), recorded, effects=())
    quiet, noisy = recorded.channel("Efd"), replace(recorded.channel("Efd"), noise=1.0)
    other = replace(recorded, channels={**recorded.channels, "Efd": noisy})
    assert quiet.noise < noisy.noise
    sizes = [np.square(plant.observe(one).modes).sum() for one in (recorded, other)]
    assert sizes[1] > 10 * sizes[0]


def test_missing_readings_of_an_input(recorded):
    channels = {name: channel for name, channel in recorded.channels.items() if name != "Efd"}
    plant = PlantSimulator(of("Efd"), recorded, effects=())
    with pytest.raises(InputError, match="Efd was not recorded, but shall drive the unit"):
        plant.observe(replace(recorded, channels=channels))
    efd = recorded.channel("Efd")
    for first, last in ((1.2, 1.5), (1.2, 1.23)):
        gap = replace(efd, values=np.where((first < TIME) & (last > TIME), np.nan, efd.values))
        other = replace(recorded, channels={**recorded.channels, "Efd": gap})
        if last - first > 0.1:
            with pytest.raises(InputError, match="or leave Efd out of inputs"):
                plant.observe(other)
        else:
            assert np.isfinite(plant.observe(other).event.signals["Efd"]).all()


@pytest.mark.parametrize(
    ("names", "inputs", "words"),
    [
        (["GENCLS"], ["Efd"], "Efd cannot drive GENCLS, which has none"),
        (["REGCA1", "REECB1"], ["Pm"], "Pm cannot drive REGCA1"),
        (["GENROU"], ["Efdd"], "did you mean 'Efd'"),
    ],
)
def test_an_input_that_the_unit_does_not_have_is_refused(names, inputs, words):
    with pytest.raises(InputError, match=words):
        of(*inputs, names=names)


def test_nothing_is_missing_or_unknown_where_a_record_drives():
    def names(*inputs, names=("GENSAL",)):
        device = of(*inputs, names=names, GENSAL={"S10": 0.0})
        return {effect.name for effect in effects_of(device.name, *device.tags)}

    everything = names()
    assert everything >= {"exciter", "stabiliser", "governor", "latent_Efd", "latent_Pm", "saturation"}
    assert everything - names("Efd") == {"exciter", "stabiliser", "latent_Efd"}
    assert not names("Efd", "Pm") & {"governor", "latent_Pm", "oscillation", "hydro_governor", "gas_governor"}
    assert "governor_acting" not in names("Pm", names=("GENSAL", "HYGOV"))
