"""The closed form against one linear system that holds the complete grid and all units."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.cases.ieee39_data import MACHINES, ieee39_network
from errorscreen.engine import ReferenceEngine
from errorscreen.models import DFIG_PLANT, PV_PLANT, SYNCHRONOUS_MACHINE
from errorscreen.power.load_flow import solve_load_flow
from errorscreen.simulators.grid.assembly import GridModel
from tests.power.grids import reduce_network

AT = {"synchronous_machine": 30, "dfig_plant": 37, "pv_plant": 38}
DEVICES = {d.name: d for d in (SYNCHRONOUS_MACHINE, DFIG_PLANT, PV_PLANT)}
FIXED = {bus: Xd1 for _, bus, _, _, Xd1, *_ in MACHINES if bus not in AT.values()}
CHANNELS = {"U": 2, "P": (25, 2), "U3": 3}
FLOW = solve_load_flow(ieee39_network())
STATES = {
    "before": lambda n: n,
    "bolted fault": lambda n: n.with_fault(3),
    "fault with impedance": lambda n: n.with_fault(3, 0.001 + 0.01j),
    "fault at the machine": lambda n: n.with_fault(30),
    "line out": lambda n: n.with_line_out(2, 25),
    "loads": lambda n: n.with_load_scaled(1.3, [4, 8]),
}


def random_values(model, rng, n=3):
    """Values of all states and constants, each of shape (n,); reactances and ratings are positive."""
    v = {name: rng.normal(size=n) for name in (*model.states, *model.constants)}
    for name in v:
        if name.split(".")[-1] in {"Ra", "Xd1", "Xq1", "Xpp", "size", "Xd", "Xq"}:
            v[name] = rng.uniform(0.05, 2.0, n)
    return v | {f"machine_{bus}.Bd1": np.full(n, 1 / x) for bus, x in FIXED.items()}


def direct(network, v, units, i):
    """Voltages of all buses and terminal currents of the units, from one real system of equations."""
    Y = network.admittance(FLOW.voltage)
    n, k = len(Y), len(units)
    # unknowns: real and imaginary parts of all V, then of the current of each unit
    A, b = np.zeros((2 * (n + k),) * 2), np.zeros(2 * (n + k))

    def put(row, column, z):  # row pair: z times the complex unknown of a column pair
        A[row : row + 2, column : column + 2] += [[z.real, -z.imag], [z.imag, z.real]]

    for bus, Xd1 in FIXED.items():
        at, p = network.index(bus), f"machine_{bus}."
        E = (v[p + "Ed1"][i] + 1j * v[p + "Eq1"][i]) * np.exp(1j * (v[p + "delta"][i] - np.pi / 2))
        Y[at, at] += 1 / (1j * Xd1)
        J = E / (1j * Xd1)
        b[2 * at : 2 * at + 2] += [J.real, J.imag]
    A[: 2 * n : 2, : 2 * n : 2] = A[1 : 2 * n : 2, 1 : 2 * n : 2] = Y.real
    A[1 : 2 * n : 2, : 2 * n : 2], A[: 2 * n : 2, 1 : 2 * n : 2] = Y.imag, -Y.imag
    for u, name in enumerate(units):
        at, row, p = network.index(AT[name]), 2 * (n + u), f"{name}."
        put(2 * at, row, -1.0 + 0j)  # Y V - I = J
        size = v[p + "size"][i]
        if name == "synchronous_machine":
            s, c = np.sin(v[p + "delta"][i]), np.cos(v[p + "delta"][i])
            park = np.array([[s, -c], [c, s]])  # (M5)
            Z = np.array([[v[p + "Ra"][i], -v[p + "Xq1"][i]], [v[p + "Xd1"][i], v[p + "Ra"][i]]])
            A[row : row + 2, 2 * at : 2 * at + 2] = park  # V_dq + Z I_dq = E'_dq, (M6)
            A[row : row + 2, row : row + 2] = Z @ park / size
            b[row : row + 2] = v[p + "Ed1"][i], v[p + "Eq1"][i]
            continue
        turn = np.exp(1j * v[p + "theta"][i])
        put(row, row, 1 / size + 0j)
        if name == "dfig_plant":
            y = 1 / (1j * v[p + "Xpp"][i])
            put(row, 2 * at, y)
            C = (v[p + "Ip"][i] + v[p + "Epp"][i] * y) * turn  # (W12)
        else:
            C = (v[p + "Ip"][i] - 1j * v[p + "Iq"][i]) * turn  # (PV12)
        b[row : row + 2] = C.real, C.imag
    for bus in network.grounded:
        at = 2 * network.index(bus)
        A[at : at + 2], b[at : at + 2] = 0, 0
        A[[at, at + 1], [at, at + 1]] = 1
    x = np.linalg.solve(A, b)
    z = x[::2] + 1j * x[1::2]
    return z[:n], z[n:]


def solved(network, v, grid, model):
    """All quantities of the model after one evaluation."""
    options = {"load_voltages": FLOW.voltage, "observed": [2, 3], "flows": [(25, 2)]}
    terminals = [*FIXED, *(AT[d.name] for d in grid.devices)]
    reduced = reduce_network(
        network, terminals, admittances={b: 1 / (1j * x) for b, x in FIXED.items()}, **options
    )
    engine, b = ReferenceEngine(model), dict(v)
    engine._set(b, model.tables, grid.tables(reduced))
    with np.errstate(all="ignore"):  # random states may be absurd for the controls behind the grid
        for recorded in (False, True):
            engine._evaluate(b, np.zeros(0), recorded=recorded)
    return b


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(
    "units",
    [tuple(DEVICES), ("dfig_plant", "pv_plant"), ("synchronous_machine",), ("pv_plant",), ()],
    ids=str,
)
@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_equals_the_complete_system(state, units, seed):
    network = STATES[state](ieee39_network())
    grid = GridModel(FIXED, [DEVICES[u] for u in units], CHANNELS)
    model = grid.model()
    v = random_values(model, np.random.default_rng(seed))
    b = solved(network, v, grid, model)
    for i in range(3):
        V, current = direct(network, v, units, i)
        scale = np.abs(V).max() + np.abs(current).max(initial=0)
        for bus, name in [*((bus, f"machine_{bus}") for bus in FIXED), *((AT[u], u) for u in units)]:
            found = b[f"{name}.Vr"][i] + 1j * b[f"{name}.Vi"][i]
            assert abs(found - V[network.index(bus)]) < 1e-10 * scale
        for u, name in enumerate(units):
            found = b[f"{name}.Ir"][i] + 1j * b[f"{name}.Ii"][i]
            assert abs(found - current[u]) < 1e-10 * scale
        assert abs(b["channel.U"][i] - abs(V[network.index(2)])) < 1e-10 * scale
        assert abs(b["channel.U3"][i] - abs(V[network.index(3)])) < 1e-10 * scale
        line = network.branch(2, 25)
        y11, y12, *_ = line.admittances
        at, other = network.indices([2, 25])
        arriving = -(V[at] * np.conj(y11 * V[at] + y12 * V[other])).real
        assert abs(b["channel.P"][i] - arriving) < 1e-9 * scale**2
