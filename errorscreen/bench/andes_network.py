"""A unit and its grid in ANDES: truths that another program makes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

F_NOMINAL, BASE = 60.0, 100.0
#: columns of a simulation
COLUMNS = ("time", "V", "angle", "P", "Q")
#: instant of a fault in s, between two samples of 120 a second, and the integration step
FAULT, STEP = 1.0 + 1 / 240, 1 / 480

#: records by the names that errorscreen gives the constants. HYGOV of ANDES leaves the factor r Tr out: it is 1 here.
RECORDS: dict[str, dict[str, float]] = {
    "GENROU": {
        "Tpdo": 6.5, "Tppdo": 0.035, "Tpqo": 0.6, "Tppqo": 0.06, "H": 4.0, "D": 0.75, "Xd": 1.8, "Xq": 1.7, "Xpd": 0.3,
        "Xpq": 0.55, "Xpp": 0.25, "Xl": 0.15, "S10": 0.1, "S12": 0.4,
    },
    "SEXS": {"TA_TB": 0.1, "TB": 10.0, "K": 100.0, "TE": 0.1, "EMIN": 0.0, "EMAX": 5.0},
    "ESST4B": {
        "TR": 0.02, "KPR": 3.0, "KIR": 3.0, "VRMAX": 3.0, "VRMIN": -3.0, "TA": 0.01, "KPM": 1.0, "KIM": 0.0,
        "VMMAX": 3.0, "VMMIN": -3.0, "KG": 0.0, "KP": 6.7, "KI": 0.0, "VBMAX": 8.4, "KC": 0.1, "XL": 0.0, "THETAP": 0.0,
    },
    "TGOV1": {"R": 0.05, "T1": 0.3, "VMAX": 1.2, "VMIN": 0.0, "T2": 2.0, "T3": 7.0, "Dt": 0.0},
    "HYGOV": {
        "R": 0.05, "r": 0.4, "Tr": 2.5, "Tf": 0.05, "Tg": 0.3, "VELM": 0.5, "GMAX": 1.0, "GMIN": 0.0, "TW": 1.2,
        "At": 1.2, "Dturb": 0.0, "qNL": 0.08,
    },
    "IEEEG1": {
        "JBUS": 0, "M": 0, "K": 20.0, "T1": 0.15, "T2": 0.0, "T3": 0.2, "UO": 0.3, "UC": -0.5, "PMAX": 1.0, "PMIN": 0.0,
        "T4": 0.3, "K1": 0.3, "K2": 0.0, "T5": 7.0, "K3": 0.4, "K4": 0.0, "T6": 0.4, "K5": 0.3, "K6": 0.0, "T7": 0.05,
        "K7": 0.0, "K8": 0.0,
    },
    "IEEEST": {
        "IC": 1, "IB": 0, "A1": 0.02, "A2": 0.0004, "A3": 0.0, "A4": 0.0, "A5": 0.0, "A6": 0.0, "T1": 0.15, "T2": 0.03,
        "T3": 0.15, "T4": 0.03, "T5": 10.0, "T6": 10.0, "KS": 10.0, "LSMAX": 0.1, "LSMIN": -0.1, "VCU": 0.0, "VCL": 0.0,
    },
}  # fmt: skip
#: names in ANDES where they differ; None: not there
_RENAMED: dict[str, dict[str, str | None]] = {
    "GENROU": {
        "Tpdo": "Td10", "Tppdo": "Td20", "Tpqo": "Tq10", "Tppqo": "Tq20", "H": None, "Xd": "xd", "Xq": "xq",
        "Xpd": "xd1", "Xpq": "xq1", "Xpp": "xd2", "Xl": "xl",
    },
    "SEXS": {"TA_TB": "TATB"},
    "HYGOV": {"TW": "Tw", "Dturb": "Dt"},
    "IEEEG1": {"JBUS": None, "M": None},
    "IEEEST": {"IC": "MODE", "IB": None},
}  # fmt: skip

Records = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class GridEvent:
    """A three-phase fault at the high side, and the loss of a generator when it is cleared.

    Parameters
    ----------
    reactance : float
        Of the fault in pu.
    duration : float
        Of the fault in s.
    lost : float
        Power of the lost generator in pu of `BASE`; 0: none is lost.
    name : str
    """

    reactance: float
    duration: float
    lost: float = 0.0
    name: str = "fault"


def simulate_unit(
    records: Records,
    event: GridEvent,
    *,
    power: float = 0.75,
    voltage: float = 1.02,
    source: float = 20.0,
    end: float = 12.0,
    step: float = STEP,
) -> NDArray[np.float64]:
    """Terminal of a unit behind a transformer and a line to a source, at each step; two equal stamps are a jump.

    Parameters
    ----------
    records : mapping of str to mapping of str to float
        Constants of each model by the names of errorscreen, on `BASE`; GENROU is the machine.
    event : GridEvent
    power, voltage : float
        Active power and voltage before the event in pu.
    source : float
        Rating of the source in multiples of `BASE`.
    end, step : float
        End of the simulation and its step in s.

    Returns
    -------
    ndarray of shape (L, 5)
        Columns as `COLUMNS`, powers in pu of `BASE`, angle in rad.

    Raises
    ------
    ImportError
        If ANDES is not installed.
    """
    import andes

    andes.config_logger(40)
    system: Any = andes.System(no_output=True, default_config=True)
    system.config.freq = F_NOMINAL
    for bus, kV in ((1, 20.0), (2, 230.0), (3, 230.0), (4, 230.0)):
        system.add("Bus", {"idx": bus, "Vn": kV})
    line = {"b": 0.0, "Sn": BASE, "Vn2": 230.0}
    system.add("Line", {"idx": "transformer", "bus1": 1, "bus2": 2, "r": 0.0, "x": 0.12, "Vn1": 20.0, **line})
    system.add("Line", {"idx": "line", "bus1": 2, "bus2": 3, "r": 0.01, "x": 0.25, "Vn1": 230.0, **line})
    system.add("Slack", {"idx": "slack", "bus": 3, "v0": 1.0, "Vn": 230.0, "Sn": source * BASE})
    system.add("PV", {"idx": "set", "bus": 1, "p0": power, "v0": voltage, "Vn": 20.0, "Sn": BASE})
    rated = {"fn": F_NOMINAL, "Vn": 230.0, "Sn": source * BASE}
    system.add(
        "GENCLS", {"idx": "source", "bus": 3, "gen": "slack", "M": 10.0, "D": 0.0, "xd1": 0.2, **rated}
    )
    system.add("Line", {"idx": "other line", "bus1": 3, "bus2": 4, "r": 0.0, "x": 0.1, "Vn1": 230.0, **line})
    clearing = FAULT + event.duration
    if event.lost:
        system.add("PQ", {"idx": "load", "bus": 3, "p0": 1.0, "q0": 0.0, "Vn": 230.0})
        system.add("PV", {"idx": "set lost", "bus": 4, "p0": event.lost, "v0": 1.0, "Vn": 230.0, "Sn": BASE})
        of_lost = {"gen": "set lost", "M": 4.0, "D": 0.0, "xd1": 0.3, **rated, "Sn": event.lost * BASE}
        system.add("GENCLS", {"idx": "lost", "bus": 4, **of_lost})
        system.add("Toggle", {"idx": "trip", "model": "GENCLS", "dev": "lost", "t": clearing})
    exciter = next((model for model in records if model in ("SEXS", "ESST4B")), "")
    for model, record in records.items():
        system.add(model, {"idx": model, **_named(model, record, power, exciter)})
    system.add(
        "Fault", {"idx": "fault", "bus": 2, "tf": FAULT, "tc": clearing, "xf": event.reactance, "rf": 0.0}
    )
    system.setup()
    system.PFlow.run()
    config = system.TDS.config
    config.tf, config.tstep, config.fixt, config.shrinkt, config.no_tqdm = end, step, 1, 0, 1
    config.criteria = 0  # the generator that is lost turns on alone
    system.TDS.run()
    time, y = np.array(system.dae.ts.t), system.dae.ts.y
    of = (system.Bus.v.a[0], system.Bus.a.a[0], system.GENROU.Pe.a[0], system.GENROU.Qe.a[0])
    for instant in (FAULT, clearing):  # an event acts within the 0.1 ms behind its instant
        row = int(np.abs(time - instant).argmin())
        time[row : row + 2] = 0.5 * (time[row] + time[row + 1])
    return np.column_stack([time, y[:, of]])


def _named(model: str, record: Mapping[str, float], power: float, exciter: str) -> dict[str, Any]:
    """A record with the names of ANDES."""
    renamed = _RENAMED.get(model, {})
    named: dict[Any, Any] = {renamed.get(name, name): value for name, value in record.items()}
    named.pop(None, None)
    if model == "GENROU":
        # ANDES takes the mechanical power as a torque, which damps less
        named |= {"M": 2 * record["H"], "D": record["D"] + power, "xq2": record["Xpp"]}
        return named | {"bus": 1, "gen": "set", "fn": F_NOMINAL, "Vn": 20.0, "Sn": BASE}
    return named | ({"avr": exciter} if model == "IEEEST" else {"syn": "GENROU"})
