"""A plant that moves the voltage at its own terminal: playback behind the impedance of the grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from errorscreen.data.recordings import Recording
from errorscreen.effects import measurement_effects
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant.playback import playback_observation
from errorscreen.testing import check_simulator
from tests.plants import DEVICE_NAMES, OPERATING_POINT, dip, flat, plant, random_rows
from tests.simulators.plant.test_playback import recording

Z = 0.03 + 0.12j


def with_power(event, responses):
    """The event with a response (2, L) as the power that was recorded beside its voltage."""
    return replace(event, signals={**event.signals, "P": responses[0], "Q": responses[1]})


def still(event):
    """The event without movement of the angle."""
    return replace(event, signals={"V": event.signals["V"], "angle": 0.0 * event.time})


@settings(max_examples=12)
@given(st.sampled_from(DEVICE_NAMES), st.floats(0, 0.15), st.floats(0.01, 0.3), st.integers(0, 100))
def test_a_simulation_that_agrees_with_the_recording_sees_the_recorded_voltage(device, R, X, seed):
    event = dip(depth=0.25, dt=1 / 240)
    if device != "synchronous_machine":  # in playback their power does not lag behind the angle, (W1), (W12)
        event = still(event)
    simulator = plant(device, event, step=1 / 480)
    theta = random_rows(simulator, 1, seed)
    imposed = simulator.simulate(theta).values[0]
    behind = plant(device, with_power(event, imposed), step=1 / 480, grid_impedance=complex(R, X))
    found = behind.simulate(theta).values[0]
    moved = np.abs(imposed - imposed[:, :1]).max(axis=1)
    assert np.all(np.sqrt(np.mean((found - imposed) ** 2, axis=1)) < 1e-3 * moved)


def machine_in_a_grid(values, voltage, time):
    """P, Q and terminal voltage of the two-axis machine behind Z, integrated by another method from its equations."""
    v = {p.name: p.nominal for p in DEVICES["synchronous_machine"].candidates}
    v |= DEVICES["synchronous_machine"].constant_values() | values
    start = {name: np.array(value) for name, value in {**v, **OPERATING_POINT, "angle": 0.0}.items()}
    states, setpoints, _ = DEVICES["synchronous_machine"].initialise(start)
    E0 = OPERATING_POINT["V"] - Z * np.conj(complex(OPERATING_POINT["P"], OPERATING_POINT["Q"]))

    def stator(x, t):
        delta, _, Eq1, Ed1 = x
        turn = np.exp(1j * (delta - np.pi / 2))
        # (M6) with the terminal behind Z: two real equations in Id, Iq, written out as a linear system
        E = E0 * voltage(t) / turn
        A = np.array([[v["Ra"] + Z.real, -v["Xq1"] - Z.imag], [v["Xd1"] + Z.imag, v["Ra"] + Z.real]])
        Id, Iq = np.linalg.solve(A, [Ed1 - E.real, Eq1 - E.imag])
        current = complex(Id, Iq) * turn
        return Id, Iq, E0 * voltage(t) + Z * current, current

    def rates(t, x):
        _, omega, Eq1, Ed1 = x
        Id, Iq, _, _ = stator(x, t)
        Pe = Ed1 * Id + Eq1 * Iq + (v["Xq1"] - v["Xd1"]) * Id * Iq
        return [
            2 * np.pi * v["f0"] * (omega - 1),
            (setpoints["Pm0"] - Pe - v["D"] * (omega - 1)) / v["Tj"],
            (setpoints["Efd0"] - Eq1 - (v["Xd"] - v["Xd1"]) * Id) / v["Td10"],
            (-Ed1 + (v["Xq"] - v["Xq1"]) * Iq) / v["Tq10"],
        ]

    x0 = [float(states[name]) for name in ("delta", "omega", "Eq1", "Ed1")]
    x = solve_ivp(rates, time[[0, -1]], x0, t_eval=time, rtol=1e-9, atol=1e-10, max_step=0.01).y.T
    V, current = np.array([stator(row, t)[2:] for row, t in zip(x, time, strict=True)]).T
    return V * current.conj(), V


def test_another_machine_moves_the_terminal_as_it_would_in_the_grid():
    def source(t):
        """Voltage behind the impedance over that before the event: a smooth sag that comes back, and a phase shift."""
        bump = np.exp(-(((t - 1.5) / 0.15) ** 2))
        return (1 - 0.2 * bump) * np.exp(0.1j * bump)

    time = np.arange(0, 4, 0.01)
    power, V = machine_in_a_grid({}, source, time)
    signals = {"V": np.abs(V), "angle": np.unwrap(np.angle(V)), "P": power.real, "Q": power.imag}
    event = Playback(time, "sag", 1.0, signals, OPERATING_POINT)
    changes = {"Xd1": 0.24, "Tj": 6.5, "Td10": 7.5}
    other, _ = machine_in_a_grid(changes, source, time)
    truth = np.array([other.real, other.imag])

    def error(**options):
        simulator = PlantSimulator("synchronous_machine", event, **options)
        theta = simulator.parameters.nominal.copy()
        theta[[simulator.parameters.index(name) for name in changes]] = list(changes.values())
        return np.abs(simulator.simulate(theta).values[0] - truth).max()

    assert error(grid_impedance=Z) < 2e-5
    assert error() > 0.02  # the recorded voltage is not the one that this machine would have made


@pytest.mark.parametrize(
    ("device", "constants"),
    [("synchronous_machine", {}), ("dfig_plant", {}), ("pv_plant", {"KPLL": 600.0})],  # nearly the ideal loop
)
def test_the_terminal_follows_the_plant_as_a_fixed_point_of_playback(device, constants):
    event = still(dip(depth=0.2, dt=1 / 240))
    nominal = plant(device, event, step=1 / 480)
    recorded = nominal.baseline()
    theta = random_rows(nominal, 1, seed=3)
    small = 0.01 + 0.02j
    event = with_power(event, recorded)
    behind = plant(device, event, step=1 / 480, grid_impedance=small, constants=constants)
    found = behind.simulate(theta).values[0]
    V_recorded, power = event.signals["V"] + 0j, recorded[0] + 1j * recorded[1]
    E = V_recorded - small * np.conj(power / V_recorded)
    V = V_recorded
    for _ in range(12):  # playback with the voltage that its own current makes
        signals = {"V": np.abs(V), "angle": np.unwrap(np.angle(V))}
        y = plant(device, replace(event, signals=signals), step=1 / 480).simulate(theta).values[0]
        V = E + small * np.conj((y[0] + 1j * y[1]) / V)
    influence = np.sqrt(np.mean((y - nominal.simulate(theta, event).values[0]) ** 2))
    assert np.sqrt(np.mean((found - y) ** 2)) < 0.05 * influence


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_nothing_happens_where_nothing_happens(device):
    P, Q = (np.full(len(flat().time), OPERATING_POINT[name]) for name in "PQ")
    behind = plant(device, with_power(flat(), (P, Q)), grid_impedance=Z)
    response = behind.simulate(random_rows(behind, 4)).values
    assert np.abs(response - [[P, Q]]).max() < 1e-9


def test_the_contract_is_kept():
    event = dip()
    check_simulator(
        plant("dfig_plant", with_power(event, plant("dfig_plant", event).baseline()), grid_impedance=Z)
    )


def test_the_reference_path_agrees():
    event = dip()
    event = with_power(event, plant("dfig_plant", event).baseline())
    compiled, reference = (
        plant("dfig_plant", event, grid_impedance=Z, engine=engine) for engine in ("compiled", "numpy")
    )
    theta = random_rows(compiled, 3)
    assert np.allclose(compiled.simulate(theta).values, reference.simulate(theta).values, atol=1e-9)


def test_power_is_needed_and_must_have_been_recorded():
    with pytest.raises(InputError, match="V, angle, P, Q for this device"):
        plant("synchronous_machine", grid_impedance=0.1j).baseline()
    with pytest.raises(InputError, match="Q was not recorded, so the voltage behind.*Map a column to Q"):
        PlantSimulator(
            "synchronous_machine", recording(drop=("Q",)), operating_point={"Q": 0.15}, grid_impedance=0.1j
        )


def test_where_there_is_no_voltage_no_current_is_known():
    event = dip(depth=1.0)
    event = with_power(event, plant("synchronous_machine", event).baseline())
    with pytest.raises(
        InputError, match=r"falls to \S+ pu, where P and Q give no current.*Leave the impedance out"
    ):
        plant("synchronous_machine", event, grid_impedance=Z).baseline()


def test_faults_of_the_measurement_would_move_the_voltage_behind():
    assert all(e.kind != "measurement" for e in plant("pv_plant", grid_impedance=Z).effects)
    with pytest.raises(
        InputError, match=r"the effects scale_P, .* distort the power.*recorded voltage imposed"
    ):
        plant("pv_plant", grid_impedance=Z, effects=measurement_effects(["P"]))


@pytest.mark.parametrize(("device", "share"), [("synchronous_machine", 0.9), ("dfig_plant", 1.0)])
def test_noise_of_what_is_injected_and_compared_counts_once(device, share):
    event = still(dip(depth=0.3))
    y = plant(device, event).baseline()
    sizes = {"V": 3e-4, "angle": 3e-4, "P": 5e-3, "Q": 5e-3}
    found, noise = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        values = {**event.signals, "P": y[0], "Q": y[1]}
        values = {name: v + sizes[name] * rng.standard_normal(v.shape) for name, v in values.items()}
        record = Recording.from_arrays(
            event.time, values, base_mva=1, f_nominal=60, event_time=1.0, noise=sizes
        )
        simulator = PlantSimulator(device, record, grid_impedance=0.03 + 0.12j)
        observed = simulator.observe(record)
        found.append(np.mean(observed.deviations(simulator.baseline(observed.event)) ** 2))
        noise.append(observed.noise / 5e-3)
    # 2880 values; the level before the event, common to all that follow, scatters more
    assert np.mean(found) == pytest.approx(1.0, abs=0.15)
    assert np.all(np.mean(noise, axis=0) < share)


def test_what_is_injected_has_noise_and_is_told():
    observed = playback_observation(recording(), ("P", "Q"), grid_impedance=0.02 + 0.1j)
    assert set(observed.event.signals) == set(observed.event.noise) == {"V", "angle", "P", "Q"}
    assert any("behind the grid's impedance of 0.02 + j0.1 pu" in note for note in observed.assumptions)


@pytest.mark.parametrize(
    "impedance", [-0.1, -0.1j, 5 + 40j, np.nan, complex(0, np.inf), "0.1+0.2j", True, None]
)
def test_an_impedance_that_is_none_is_refused(impedance):
    with pytest.raises(
        InputError, match=r"the impedance of the grid is .*R >= 0, X >= 0, and a magnitude of at most 1"
    ):
        plant("pv_plant", grid_impedance=impedance)


def test_settings_and_constants_of_the_grid():
    behind = plant("pv_plant", grid_impedance=Z, constants={"KPLL": 60.0})
    constants = behind.settings()["constants"]
    assert [constants[name] for name in ("R_grid", "X_grid", "KPLL")] == [0.03, 0.12, 60.0]
    with pytest.raises(InputError, match="unknown constant 'KPLL'"):  # an ideal loop has no gain
        plant("pv_plant", constants={"KPLL": 60.0})
