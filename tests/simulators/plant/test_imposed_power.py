"""Units that recorded power drives: open circuit, load rejection, and the way there and back."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import errorscreen as es
from errorscreen.bench.reference_models import play
from errorscreen.data.recordings import Recording
from errorscreen.effects import EFFECTS
from errorscreen.events import Playback, SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.models.set_points import with_steps
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.base import Status
from errorscreen.simulators.plant.connection import Connection
from errorscreen.simulators.plant.imposed_power import with_imposed_power
from tests.models.imposed import needs, records, rms, table

F0, V0, P0, Q0 = 60.0, 1.02, 0.6, 0.15
BETWEEN = Connection(
    0.01, 0.12, 1.05, shunt=0.05, auxiliary_p=0.03, auxiliary_q=0.01, conductance=0.02, turn=0.01
)
VALUES = {"GENROU": {"H": 4.0, "S10": 0.1, "S12": 0.4}, "SEXS": {"K": 60.0, "TB": 2.0, "TA_TB": 0.2}}


def of(*names, **changes):
    return unit([Record(PARTS[n], {**VALUES.get(n, {}), **changes.get(n, {})}) for n in names])


#: a whole unit, whose voltage reference can step
UNIT = with_steps(of("GENROU", "SEXS", "TGOV1"), [SetPointStep("Vref", 1.0, 0.02)])


def powered(device, event, **options):
    return PlantSimulator(
        device, event, imposed="power", **{"effects": (), "constants": {"Ra": 0.003}, **options}
    )


def event(P, Q, *, until=4.0, dt=0.02, start=1.0, V=V0, steps=()):
    """P and Q as functions of time, at rest before."""
    time = np.arange(0.0, until - 1e-9, dt)
    P, Q = (f(time) + 0.0 * time for f in (P, Q))
    return Playback(
        time, "test", start, {"P": P, "Q": Q}, {"V": V, "P": P[0], "Q": Q[0], "f": F0}, steps=steps
    )


def constant(value):
    return lambda time: value


def rejection(power, at):
    return lambda time: np.where(time < at, power, 0.0)


@pytest.mark.parametrize("machine", ["GENROU", "GENROE", "GENSAL", "GENSAE", "GENCLS"])
def test_a_unit_rests_at_its_start(machine):
    at_rest = event(constant(P0), constant(Q0), until=1.0, start=0.5)
    plant = powered(of(machine, "SEXS", "TGOV1"), at_rest, connection=BETWEEN, engine="numpy", step=0.01)
    assert plant.channels == ("V", "f")
    assert plant.units == ("pu", "Hz")
    assert abs(plant.baseline() - [[V0], [F0]]).max() < 1e-9


def magnitude(time):
    return V0 - 0.25 * np.exp(-(((time - 1.3) / 0.12) ** 2))


def turned(time):
    return 0.2 * np.exp(-(((time - 1.6) / 0.3) ** 2))


def frequency_of(time, filtered=0.02):
    """Frequency in Hz of the voltage behind the filter, exact for a voltage that is linear in short steps."""
    fine = np.linspace(0.0, time[-1], 20 * (len(time) - 1) + 1)
    u, h = magnitude(fine) * np.exp(1j * turned(fine)), fine[1]
    z, decay = u.copy(), np.exp(-h / filtered)
    rest = filtered / h * (1 - decay)
    for k in range(1, len(fine)):
        z[k] = decay * z[k - 1] + (rest - decay) * u[k - 1] + (1 - rest) * u[k]
    return F0 + ((u - z) / filtered / z).imag[::20] / (2 * np.pi)


@pytest.mark.parametrize("connection", [None, BETWEEN], ids=["terminal", "behind a transformer"])
def test_there_and_back(connection):
    """P and Q of the unit at a voltage give this voltage back; what is left comes from between the samples."""
    options = {"effects": (), "step": 0.00125, "connection": connection, "constants": {"Ra": 0.003, "f0": F0}}
    errors = {}
    for dt in (0.02, 0.005):
        time = np.arange(0.0, 4.0, dt)
        there = Playback(
            time, "dip", 0.9, {"V": magnitude(time), "angle": turned(time)}, {"V": V0, "P": P0, "Q": Q0}
        )  # fmt: skip
        P, Q, speed = PlantSimulator(UNIT, there, channels=("P", "Q", "speed"), **options).baseline()
        back = replace(there, signals={"P": P, "Q": Q})
        found = PlantSimulator(
            UNIT, back, channels=("V", "f", "speed"), imposed="power", **options
        ).baseline()
        expected = np.array([magnitude(time), frequency_of(time), speed])
        errors[dt] = abs(found - expected).max(axis=1)
    assert (errors[0.02] < [3e-4, 2e-3, 3e-6]).all()
    assert (errors[0.005] < [5e-6, 5e-5, 5e-8]).all()


def test_a_load_rejection_follows_the_time_constants_of_the_rotor():
    """Without current, saturation and controls: the windings are linear, and Pm alone moves the speed."""
    m = {**PARTS["GENROU"].typical, "S10": 0.0, "S12": 0.0, "H": 4.0}
    at, P, Q = 1.0, 0.4, 0.1
    rejected = event(rejection(P, at - 1e-9), rejection(Q, at - 1e-9), dt=0.002, V=1.0)
    plant = powered(of("GENROU", GENROU=m), rejected, constants={}, channels=("V", "f", "speed"))
    V, f, speed = plant.baseline()
    current = P - 1j * Q
    delta = np.angle(1 + 1j * m["Xq"] * current)
    v, i = (z * np.exp(1j * (np.pi / 2 - delta)) for z in (1.0, current))
    d, q = m["Xpd"] - m["Xl"], m["Xpq"] - m["Xl"]
    Eq, Ed = v.imag + m["Xpd"] * i.real, v.real - m["Xpq"] * i.imag
    Efd = v.imag + m["Xd"] * i.real
    k_d = (m["Xd"] - m["Xpd"]) * (m["Xpd"] - m["Xpp"]) / d**2
    k_q = (m["Xq"] - m["Xpq"]) * (m["Xpq"] - m["Xpp"]) / q**2
    A_d = np.array([[-(1 + k_d) / m["Tpdo"], k_d / m["Tpdo"]], [1 / m["Tppdo"], -1 / m["Tppdo"]]])
    A_q = np.array([[-(1 + k_q) / m["Tpqo"], k_q / m["Tpqo"]], [1 / m["Tppqo"], -1 / m["Tppqo"]]])
    of_d, of_q = np.array([Eq, Eq - d * i.real]), np.array([Ed, Ed + q * i.imag])
    share_d, share_q = (m["Xpp"] - m["Xl"]) / d, (m["Xpp"] - m["Xl"]) / q
    flux = []
    # the power falls between two samples, half of them early on average
    for t in np.maximum(rejected.time - at + 0.5 * rejected.dt, 0.0):
        x_d, x_q = expm(A_d * t) @ (of_d - Efd) + Efd, expm(A_q * t) @ of_q
        flux.append(
            complex(share_q * x_q[0] + (1 - share_q) * x_q[1], share_d * x_d[0] + (1 - share_d) * x_d[1])
        )
    after = rejected.time >= at
    jump = abs(v + 1j * m["Xpp"] * i)
    assert V[after][0] == pytest.approx(jump, abs=1e-3)  # V jumps to the voltage behind X''
    assert jump - 1.0 > 0.02
    assert abs(V - abs(np.array(flux)))[after].max() < 5e-5
    expected = np.sqrt(1 + np.maximum(rejected.time - at + 0.5 * rejected.dt, 0.0) * P / m["H"])
    assert abs(speed - expected)[after].max() < 1e-6
    late = rejected.time > at + 0.5
    slip = np.gradient(np.unwrap(np.angle(np.array(flux)[late])), rejected.dt) / (2 * np.pi)
    # a phasor that turns by w against the filter's frame is T / (1 + (T w)²) late
    seconds = 0.02 / (1 + (0.02 * 2 * np.pi * F0 * (speed[late] - 1)) ** 2)
    late_speed = speed[late] - seconds * np.gradient(speed[late], rejected.dt)
    assert abs(f[late] - F0 * late_speed - slip).max() < 0.003


def test_an_open_circuit_answers_to_a_step_of_the_reference():
    s, K = 0.02, VALUES["SEXS"]["K"]
    idle = event(constant(0.0), constant(0.0), steps=(SetPointStep("Vref", 1.0, s),), until=12.0, V=0.7)
    V, f, Efd = powered(UNIT, idle, channels=("V", "f", "Efd")).baseline()
    before = idle.time < 1.0
    assert abs(V[before] - 0.7).max() < 1e-9
    assert abs(f - F0).max() < 1e-9
    assert V[-1] - 0.7 == pytest.approx(
        s * K / (1 + K), rel=1e-3
    )  # unsaturated below the air-gap line: V is Efd
    assert Efd[-1] == pytest.approx(V[-1], rel=1e-3)


def test_more_power_than_the_reactance_carries_is_a_failed_simulation():
    def much(time):
        return np.where(time < 1.5, P0, 6.0)

    plant = powered(UNIT, event(much, constant(Q0)))
    responses = plant.simulate(plant.parameters.nominal)
    assert responses.status.tolist() == [Status.DIVERGED]
    assert "from 1.5 s on, no voltage carries the imposed P and Q" in responses.failures()
    low, high = (1.0 - x * (np.array(plant.parameters.names) == "GENROU.Xpp") for x in (0.0, 0.3))

    def near(time):
        return np.where(time < 1.5, P0, 2.9)

    short = event(near, constant(Q0), until=1.51)
    side_by_side = plant.simulate(plant.parameters.nominal * [low, high], short)
    assert side_by_side.status.tolist() == [Status.DIVERGED, Status.OK]


@pytest.mark.parametrize(
    ("device", "options", "words"),
    [
        ("synchronous_machine", {}, "synchronous_machine, which is no voltage behind one reactance"),
        (of("GENTPJ1"), {}, "on GENTPJ1, which is no voltage behind one reactance"),
        (of("REGCA1", "REECB1"), {}, r"on REGCA1\+REECB1"),
        (of("GENROU"), {"imposed": "powr"}, "did you mean 'power'"),
        (of("GENROU"), {"grid_impedance": 0.1j}, 'imposed = "power" and grid_impedance'),
        (of("GENROU"), {"constant_frequency": True}, "does not depend on the angle"),
        (of("GENROU"), {"channels": ["P"]}, "unknown channel 'P'"),
    ],
)
def test_what_cannot_be_is_refused(device, options, words):
    at_rest = event(constant(P0), constant(Q0))
    with pytest.raises(InputError, match=words):
        PlantSimulator(device, at_rest, **{"imposed": "power", "effects": (), **options})


AT = 1.003  # between two samples
CLASSICAL = of("GENCLS", GENCLS={"H": 4.0})
GOVERNORS = tuple(EFFECTS[name] for name in ("steam_governor", "hydro_governor"))


def recorded(device, **options):
    """A load rejection in steps of 1 ms, of which every 20th is recorded."""
    fine = event(rejection(P0, AT), rejection(Q0, AT), until=8.0, dt=0.001)
    V, f = powered(device, fine, **options).baseline()
    return fine.time[::20], {name: signal[::20] for name, signal in {**fine.signals, "V": V, "f": f}.items()}


@pytest.fixture(scope="module")
def truth():
    return recorded(UNIT)


def recording(truth, seed=0, P_noise=1e-3, **more):
    time, values = truth
    rng = np.random.default_rng(seed)
    noise = {"P": P_noise, "Q": P_noise, "V": 5e-4, "f": 2e-3}
    values = {n: v + rng.normal(0.0, noise[n], len(time)) for n, v in values.items()} | more
    values = {n: v for n, v in values.items() if v is not None}
    return Recording.from_arrays(time, values, base_mva=100.0, f_nominal=F0, event_time=1.0, name="rejection")


def test_noise_of_the_power_and_the_instant_of_the_jump_are_uncertain(truth):
    measured = recording(truth)
    plant = powered(UNIT, measured)
    seen = plant.observe(measured)
    assert seen.event.kind == "load rejection"
    assert any("counts as load rejection" in note for note in seen.assumptions)
    assert any("f is not compared within 0.1 s of a jump" in note for note in seen.assumptions)
    assert not any("check its unit" in note for note in seen.assumptions)
    gone = ~seen.mask[1]
    assert gone.any()
    assert abs(seen.time[gone] - 1.01).max() < 0.12
    chi2 = []
    for seed in range(4):
        one = plant.observe(recording(truth, seed)) if seed else seen
        z = one.deviations(plant.baseline(one.event))
        chi2.append(np.nanmean(z**2, axis=1))
    assert (abs(np.mean(chi2, axis=0) - 1.0) < 0.25).all()
    alone = abs(plant.baseline(seen.event)[1] - seen.values[1])[seen.time > 1.2]
    assert rms(alone) > 3 * seen.noise[1]  # which the noise of f would not explain


def test_the_level_before_the_event_makes_the_frequency_drift():
    """Nothing holds the speed: an error of the mean power before the event counts as long as the record lasts."""
    at, dt, sigma = 1.0, 0.02, 2e-3
    quiet, late = int(at / dt), int(6.0 / dt)
    idle = event(rejection(0.1, at), constant(0.02), until=6.2, dt=dt)
    values = {**idle.signals, "V": V0 + 0 * idle.time, "f": F0 + 0 * idle.time}
    rng = np.random.default_rng(0)
    values = {n: v + rng.normal(0, {"f": 2e-3, "V": 5e-4}.get(n, sigma), len(v)) for n, v in values.items()}
    measured = Recording.from_arrays(
        idle.time, values, base_mva=100.0, f_nominal=F0, event_time=at, noise={"P": sigma, "Q": sigma}
    )
    plant = powered(CLASSICAL, measured, effects=GOVERNORS, step=0.01, constants={})
    modes = plant.observe(measured).modes
    span = np.sqrt(((modes[:, 1, late] - modes[:, 1, quiet + 20]) ** 2).sum())
    seconds = (late - quiet - 20) * dt
    level = sigma / np.sqrt(0.95 * quiet) * seconds
    walk = sigma * np.sqrt(dt * seconds)
    assert span == pytest.approx(F0 / (2 * 4.0) * np.hypot(level, walk), rel=0.3)


def test_a_recording_without_what_is_imposed_is_refused(truth):
    for missing, words in (("P", "P was not recorded"), ("V", "V|magnitude"), ("Q", "Q was not recorded")):
        with pytest.raises(InputError, match=words):
            powered(UNIT, recording(truth, **{missing: None}))
    with pytest.raises(InputError, match="neither V nor f was recorded"):
        powered(UNIT, recording(truth, V=None, f=None))
    gap = truth[1]["P"].copy()
    gap[100:140] = np.nan
    with pytest.raises(InputError, match=r'P was not recorded from.*leave imposed = "power" out'):
        powered(UNIT, recording(truth, P=gap))


def test_parameters_are_found_from_a_load_rejection(truth):
    measured = recording(truth)
    wrong = UNIT.candidates.replace(
        {"GENROU.H": {"nominal": 5.5}, "GENROU.Tpdo": {"nominal": 8.0}, "GENROU.Xd": {"nominal": 1.4}}
    ).subset(["GENROU.H", "GENROU.Tpdo", "GENROU.Xd"])
    plant = powered(UNIT, measured, parameters=wrong)
    fit = es.calibrate(plant, measured, n_starts=1)
    for name in wrong.names:
        assert fit.values_[name] == pytest.approx(UNIT.candidates[name].nominal, rel=0.1), name


def test_a_missing_governor_is_named():
    measured = recording(recorded(of("GENCLS", "TGOV1", GENCLS={"H": 4.0}), constants={}))
    plant = powered(CLASSICAL, measured, effects=GOVERNORS, step=0.01, constants={})
    found = es.find_causes(plant, measured, max_effects=1, n_fits=2, n_draws=16)
    assert found.verdict_.kind == "effect"
    assert "turbine-governor" in found.verdict_.text
    assert found.causes_[0].probability > 0.9


@pytest.mark.parametrize("case", ["IEEEG1", "GENROU"])
def test_power_of_another_program_gives_its_voltage(case):
    folder = needs(f"openipsl_smib/{case}")
    row = table(folder / "trajectory.csv")
    S = row["P_pu"] + 1j * row["Q_pu"]
    start = {"P": S[0].real, "Q": S[0].imag, "V": row["V_pu"][0], "angle": row["V_angle_rad"][0]}
    device = replace(with_imposed_power(unit(records(folder / "unit.dyr", 1))), outputs=("V",))
    found = play(
        device, row["time_s"], abs(S), np.angle(S), start, ("V", "omega"), f_nominal=50.0, power=row["PMECH_pu"][0]
    )  # fmt: skip
    assert rms(found["V"] - row["V_pu"]) < 3e-4
    assert rms(found["omega"] - 1 - row["speed_dev_pu"]) < 3e-7
