"""Reference triad of every device: equilibrium, eigenvalues, trajectory against an independent form."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.engine import Engine
from errorscreen.engine.linear import state_matrix
from errorscreen.models import DEVICES
from errorscreen.simulators.assembly import assemble
from tests.models.reference import trajectory
from tests.plants import DEVICE_NAMES, OPERATING_POINT, dip, flat, plant, random_rows

COUNT = {"synchronous_machine": 8, "dfig_plant": 15, "pv_plant": 17}


def values_of(device, **changes):
    nominal = dict(zip(device.candidates.names, device.candidates.nominal, strict=True))
    return {**nominal, **device.constant_values(), **OPERATING_POINT, "angle": 0.0, **changes}


def eigenvalues(device, **changes):
    """Eigenvalues at the operating point, from the compiled equations on the NumPy path."""
    v = {k: np.array([x]) for k, x in values_of(device, **changes).items()}
    states, setpoints, feasible = device.initialise(v)
    assert np.all(feasible)
    model = assemble(device, ())
    everything = {**v, **states, **setpoints}
    x0 = [everything[n][0] for n in model.states]
    constants = [everything[n][0] for n in model.constants]
    return np.linalg.eigvals(state_matrix(model, x0, constants, [v["V"][0], 0.0]))


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_number_of_candidate_parameters_and_ranges(device):
    space = DEVICES[device].candidates
    assert len(space) == COUNT[device]
    assert np.allclose(space.bounds, space.nominal[:, None] * [0.7, 1.3])
    assert all(p.description and p.device == device for p in space)


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_equilibrium_is_flat(device):
    simulator = plant(device, flat(stop=10.0))
    responses = simulator.simulate(random_rows(simulator, 50)).require_ok()
    target = np.array([OPERATING_POINT["P"], OPERATING_POINT["Q"]])[:, None]
    assert np.abs(responses.values - target).max() < 1e-9


@pytest.mark.parametrize("device", DEVICE_NAMES)
@pytest.mark.parametrize("seed", [0, 1])
def test_trajectory_agrees_with_an_independent_form(device, seed):
    event = dip(stop=2.5)
    simulator = plant(device, event, step=2e-4)
    theta = random_rows(simulator, 4, seed)[seed]
    parameters = {**simulator.constants, **dict(zip(simulator.parameters.names, theta, strict=True))}
    expected = trajectory(device, parameters, event)
    found = simulator.simulate(theta).require_ok().values[0]
    assert np.ptp(expected[0]) > 0.3  # the event is felt
    # what is left is the fixed step at the corners of limits and of the piecewise linear voltage
    assert np.abs(found - expected).max() < {"synchronous_machine": 1e-6}.get(device, 2e-4)


@pytest.mark.parametrize(
    ("device", "bound"), [("synchronous_machine", 1e-6), ("dfig_plant", 1e-3), ("pv_plant", 1e-2)]
)
def test_default_step_is_fine_enough(device, bound):
    theta = random_rows(plant(device), 50)
    coarse, fine = (plant(device, step=step).simulate(theta).values for step in (0.0025, 0.00025))
    assert np.nanmax(np.abs(coarse - fine)) < bound


def test_machine_eigenvalues_follow_from_the_textbook_linearisation():
    """State matrix of the two-axis machine at a terminal of imposed voltage (Ra = 0), written out by hand."""
    device = DEVICES["synchronous_machine"]
    v = {k: np.array([x]) for k, x in values_of(device, Ra=0.0).items()}
    x = {k: a[0] for k, a in device.initialise(v)[0].items()}
    p = {k: a[0] for k, a in v.items()}
    sin, cos = np.sin(x["delta"]), np.cos(x["delta"])
    Xd, Xd1, Xq, Xq1 = p["Xd"], p["Xd1"], p["Xq"], p["Xq1"]
    # P = Eq1 V sin/Xd1 - Ed1 V cos/Xq1 + V^2/2 (1/Xq1 - 1/Xd1) sin 2delta
    K1 = x["Eq1"] * cos / Xd1 + x["Ed1"] * sin / Xq1 + (1 / Xq1 - 1 / Xd1) * np.cos(2 * x["delta"])
    A = np.zeros((4, 4))
    A[0, 1] = 2 * np.pi * p["f0"]
    A[1] = np.array([-K1, -p["D"], -sin / Xd1, cos / Xq1]) / p["Tj"]
    A[2] = np.array([-(Xd - Xd1) * sin / Xd1, 0, -Xd / Xd1, 0]) / p["Td10"]
    A[3] = np.array([(Xq - Xq1) * cos / Xq1, 0, 0, -Xq / Xq1]) / p["Tq10"]
    expected = np.sort_complex(np.linalg.eigvals(A))
    assert np.allclose(np.sort_complex(eigenvalues(device, Ra=0.0)), expected, rtol=1e-6, atol=1e-6)
    assert expected.imag.max() > 1  # there is a swing mode


def test_pv_eigenvalues_follow_from_the_control_loops():
    device = DEVICES["pv_plant"]
    p = values_of(device)
    V = p["V"]
    # dc link (W, xdc, Ip): vdc = sqrt(W), array at its maximum; reactive loop (Qf, xq, Iq); voltage filter
    dc = [
        [0, 0, -2 * V / p["Cdc"]],
        [p["KIdc"] / 2, 0, 0],
        [p["KPdc"] / 2 / p["Tg"], 1 / p["Tg"], -1 / p["Tg"]],
    ]
    reactive = [
        [-1 / p["Tq"], 0, V / p["Tq"]],
        [-p["KIQ"], 0, 0],
        [-p["KPQ"] / p["Tg"], 1 / p["Tg"], -1 / p["Tg"]],
    ]
    expected = np.concatenate([np.linalg.eigvals(dc), np.linalg.eigvals(reactive), [-1 / p["Tm"]]])
    assert np.allclose(np.sort_complex(eigenvalues(device)), np.sort_complex(expected), rtol=1e-4, atol=1e-4)
    assert expected.real.max() < 0


def test_dfig_eigenvalues_follow_from_the_control_loops():
    device = DEVICES["dfig_plant"]
    p = values_of(device)
    V, X = p["V"], p["Xpp"]
    voltage = [  # Vref, Ecmd, Epp
        [0, 0, -p["KQI"] * V / X],
        [p["KVI"], 0, -p["KVI"] * p["Xc"] * V / X],
        [0, 1 / p["TCO"], -1 / p["TCO"]],
    ]
    wr, torque = p["wr0"], p["P"] / p["wr0"]
    active = [  # xT, Pord, Ip, wr
        [0, 0, 0, p["KIT"]],
        [wr / p["TPC"], -1 / p["TPC"], 0, (torque + wr * p["KPT"]) / p["TPC"]],
        [0, 1 / V / p["TCO"], -1 / p["TCO"], 0],
        [0, 0, -V / wr / p["Tjw"], 0],
    ]
    single = [-p["KPLL"], -1 / p["TR"], -1 / p["TLPwi"], 0.0, -1 / p["Twowi"]]  # 0: integrator xv
    expected = np.concatenate([np.linalg.eigvals(voltage), np.linalg.eigvals(active), single])
    assert np.allclose(np.sort_complex(eigenvalues(device)), np.sort_complex(expected), rtol=1e-4, atol=1e-4)
    assert expected.real.max() < 1e-9


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_every_parameter_has_an_effect(device):
    event = dip(depth=0.6, stop=5.0, swing=0.5)
    simulator = plant(device, event)
    theta = np.vstack(
        [simulator.parameters.nominal, simulator.parameters.nominal * (1 + 0.1 * np.eye(COUNT[device]))]
    )
    y = simulator.simulate(theta).require_ok().values
    size = np.sqrt(((y[1:] - y[0]) ** 2).sum(axis=1).mean(axis=1))
    assert size.min() > 1e-4 * size.max()


def test_machine_momentum_balance_over_a_swing():
    """Without damping and losses, Tj (omega - 1) is the integral of mechanical minus delivered power."""
    device = DEVICES["synchronous_machine"]
    v = {k: np.array([x]) for k, x in values_of(device, Ra=0.0, D=0.0).items()}
    states, setpoints, _ = device.initialise(v)
    model = replace(assemble(device, ()), outputs=("omega", "P"))
    everything = {**v, **states, **setpoints}
    x0, constants = (
        np.array([[everything[n][0] for n in names]]) for names in (model.states, model.constants)
    )
    h, steps = 1e-3, 3000
    t = np.arange(2 * steps + 1) * h / 2
    V = 1 - 0.7 * np.exp(
        -(((t - 0.5) / 0.1) ** 2)
    )  # smooth, so that the trapezoidal rule below is exact enough
    omega, P = Engine(model).integrate(x0, constants, np.column_stack([V, 0 * V]), h=h)[0]
    impulse = np.concatenate([[0], np.cumsum(setpoints["Pm0"][0] - 0.5 * (P[1:] + P[:-1])) * h])
    assert np.ptp(omega) > 0.005
    assert np.abs(v["Tj"][0] * (omega - 1) - impulse).max() < 1e-6
    assert abs(setpoints["Pm0"][0] - OPERATING_POINT["P"]) < 1e-12


def test_infeasible_operating_points_are_data():
    event = dip()
    simulator = plant("pv_plant", event)
    theta = np.tile(simulator.parameters.nominal, (5, 1))
    theta[2, simulator.parameters.index("Imax")] = 0.5
    responses = simulator.simulate(theta)
    assert list(responses.ok) == [True, True, False, True, True]
    assert np.isnan(responses.values[2]).all()
    assert "NO_EQUILIBRIUM" in responses.failures()
    with pytest.raises(Exception, match="check the sign and base of P and Q"):
        responses.require_ok()
