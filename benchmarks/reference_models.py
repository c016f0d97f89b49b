"""Standard models beside trajectories of OpenIPSL and PSS/E: renews their table in the docs.

``python benchmarks/reference_models.py DATA``: the folder with ``openipsl_smib`` and ``psse_three_bus``; missing ones
are skipped. PSS/E recorded no angle of the terminal voltage for machines: those units run in the network of
``tests/models/networks.py``.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.reference_models import play
from errorscreen.models.dyr import read_dyr

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "tables" / "reference_models.md"
#: columns of the table, and their names in a unit
QUANTITIES = {"P": "P", "Q": "Q", "speed": "omega", "Efd": "Efd", "Pm": "Pm", "rotor angle": "delta"}
#: inner states of OpenIPSL, and their names in a unit. Left out are lags behind a limit, whose states go on beyond it
#: here, and blocks whose states are others here
INNER = {
    "id_pu": "Id", "iq_pu": "Iq", "XadIfd_pu": "If", "Epq_pu": "Eq1", "Epd_pu": "{machine}.Ed1",
    "psi_kd_pu": "{machine}.psikd", "psi_kq_pu": "{machine}.psikq", "psi_q2_pu": "psi2q", "IEEET1_VC_pu": "IEEET1.Vm",
    "ESST1A_VA_pu": "ESST1A.VA", "HYGOV_filter_out_pu": "HYGOV.x", "HYGOV_gate_desired_pu": "HYGOV.c",
    "HYGOV_gate_pu": "HYGOV.g", "HYGOV_flow_pu": "HYGOV.q", "IEEEG1_valve_pu": "IEEEG1.v",
    "IEEEG1_stage_T4_pu": "IEEEG1.y4", "IEEEG1_stage_T5_pu": "IEEEG1.y5", "IEEEG1_stage_T6_pu": "IEEEG1.y6",
    "IEEEG1_stage_T7_pu": "IEEEG1.y7",
}  # fmt: skip
#: columns of OpenIPSL with what is added to them, and those of PSS/E
SMIB = {
    "P": ("P_pu", 0), "Q": ("Q_pu", 0), "speed": ("speed_dev_pu", 1), "Efd": ("EFD_pu", 0), "Pm": ("PMECH_pu", 0),
    "rotor angle": ("delta_rad", 0),
}  # fmt: skip
THREE_BUS = {"speed": "dw_pu", "Efd": "Efd", "rotor angle": "delta_deg"}
MACHINES = {
    "gensal": "GENSAL/ThreeBus_GENSAL",
    "genrou_no_sat": "GENROU/ThreeBus_GENROU_NO_SAT",
    "genrou_normal_sat": "GENROU/ThreeBus_GENROU",
    "genrou_sexs": "SEXS/ThreeBus_SEXS",
    "genrou_sexs_hygov": "HYGOV/ThreeBus_HYGOV",
}
RENEWABLE = ("regca_reecb_repca_default", "RENA/ThreeBus_REN_A_DEFAULT_FLAG")


def rms(x):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def cells(errors, recorded):
    """A cell for each quantity: rms error, and the rms change from the start in brackets; empty if it does not move."""
    for name in QUANTITIES:
        moved = rms(recorded[name] - recorded[name][0]) if name in recorded else 0.0
        yield f"{errors[name]:.1e} ({moved:.1e})" if moved > 1e-7 else ""


def row_of_smib(folder):
    """Unit of OpenIPSL at its recorded voltage, in pu of 100 MVA and rad."""
    device, table = read_dyr(folder / "unit.dyr").unit(), pd.read_csv(folder / "trajectory.csv")
    recorded = {name: table[column].to_numpy() + offset for name, (column, offset) in SMIB.items()}
    start = {"P": recorded["P"][0], "Q": recorded["Q"][0]}
    machine = device.name.partition("+")[0]
    inner = {column: name.format(machine=machine) for column, name in INNER.items() if column in table}
    found = play(
        device, table.time_s, table.V_pu, table.V_angle_rad, start, [*QUANTITIES.values(), *inner.values()],
        f_nominal=50.0, power=table.PMECH_pu[0],
    )  # fmt: skip
    errors = {name: rms(found[own] - recorded[name]) for name, own in QUANTITIES.items()}
    states = {column: rms(found[own] - table[column].to_numpy()) for column, own in inner.items()}
    worst = max(states, key=states.get, default=None)
    told = "" if worst is None else f"{states[worst]:.1e} ({worst.removesuffix('_pu')}, of {len(states)})"
    return f"OpenIPSL `{folder.name}`", device.name, *cells(errors, recorded), told


def row_of_machine(folder, case, file):
    """Unit of PSS/E in its network of three buses."""
    sys.path.insert(0, str(ROOT))
    from tests.models.networks import ThreeBus, beside, simulate

    device, table = read_dyr(folder / "inputs" / f"{file}.dyr").unit(102), pd.read_csv(folder / f"{case}.csv")
    recorded = {name: table[column].to_numpy() for name, column in THREE_BUS.items() if column in table}
    recorded["rotor angle"] = np.deg2rad(recorded.get("rotor angle", np.zeros(len(table))))
    if "speed" in recorded:
        recorded["speed"] = recorded["speed"] + 1.0
    network = ThreeBus()
    start = {"V": network.V, "angle": network.angle, "P": network.power.real, "Q": network.power.imag}
    names = {name: QUANTITIES[name] for name in recorded}
    run = simulate(device, network, start, [*names.values()], 0.005)
    errors = beside(recorded, table.time.to_numpy(), names, *run)
    return f"PSS/E `{case}`", device.name, *cells(errors, recorded), ""


def row_of_renewable(folder, case, file):
    """Plant of PSS/E at its recorded voltage."""
    device, table = read_dyr(folder / "inputs" / f"{file}.dyr").unit(103), pd.read_csv(folder / f"{case}.csv")
    trip = int(np.searchsorted(table.time, 1.001))  # a second row of this instant, with the voltage behind it
    time, V = np.insert(table.time, trip, table.time[trip - 1]), np.insert(table.V, trip, table.V[trip])
    start = {"P": table.P[0], "Q": table.Q[0]}
    found = play(device, time, V, 0.0 * V, start, ["P", "Q"], f_nominal=60.0)
    errors = {name: rms(np.delete(found[name], trip) - table[name]) for name in "PQ"}
    return f"PSS/E `{case}`", device.name, *cells(errors, {name: table[name].to_numpy() for name in "PQ"}), ""


def main(data):
    """Write the table."""
    smib, three = data / "openipsl_smib", data / "psse_three_bus"
    work = [(smib / "*", None)] if not smib.is_dir() else []
    work += [(path, partial(row_of_smib, path)) for path in sorted(smib.glob("*/"))]
    work += [(three, partial(row_of_machine, three, *case)) for case in MACHINES.items()]
    work += [(three, partial(row_of_renewable, three, *RENEWABLE))]
    rows = []
    for path, row in work:
        if row is None or not path.is_dir():
            print(f"skipped: {path} is missing")
            continue
        rows.append(row())
        print(*rows[-1], sep=" | ", flush=True)
    if rows:
        titles = ("case", "unit", *QUANTITIES, "inner states, the worst")
        write_text_atomic(TABLE, "\n".join(table_lines(titles, rows)) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
