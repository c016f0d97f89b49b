r"""REGCB1, converter as a source of voltage (WECC REGC_B).

.. math::

    T_{fltr}\,\dot V_f &= V - V_f,\quad T_g\,\dot I_q = I_{q,cmd} - I_q,\quad
    \dot I_q \le I_{qrmax}\ \text{if}\ Q_0 > 0,\ \dot I_q \ge I_{qrmin}\ \text{if}\ Q_0 < 0           & (1)\\
    T_g\,\dot I_p &= I_{p,cmd} - I_p,\quad \dot I_p \le R_{rpwr}\ \text{or}\
    \tfrac{d}{dt}(I_p V_f) \le R_{rpwr}                                                             & (2)\\
    E^* &= V_f + jX_{source}\,(i_p - j i_q),\quad T_e\,\dot E = E^* - E                                & (3)\\
    P + jQ &= V\Big(\frac{E - V}{jX_{source}}\Big)^*                                                & (4)

in the frame of the terminal voltage. RateFlag = 1 limits the rate of the power, 0 that of the current. :math:`i_p` and
:math:`i_q` are both currents within :math:`I_{max}`, the active one first with PQFlag = 1. The reactance is that of
the generator in the file of the network (``Xsource``); its resistance is left out.

(WECC, *REGC_B* specification, 2019; PSS/E model library, REGCB1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record
from errorscreen.models.renewables.behind import along_terminal, voltage_behind

FIELDS = record(
    """
    RateFlag | code | 0    | -           | 0, 1 | rate of recovery: 1 of the power, 0 of the current
    PQFlag   | code | 1    | -           | 0, 1 | first: 1 active, 0 reactive current
    Tg       | s    | 0.02 | 0.01 .. 0.1 | >= 0 | lag of the converter
    Tfltr    | s    | 0.02 | -           | >= 0 | filter of the voltage
    Iqrmax   | pu/s | 999  | limit       | any  | upper rate of reactive current
    Iqrmin   | pu/s | -999 | limit       | any  | lower rate of reactive current
    Rrpwr    | pu/s | 10   | 0.5 .. 20   | > 0  | rate at which active current or power returns
    Te       | s    | 0.02 | -           | >= 0 | lag of the voltage source
    Imax     | pu   | 1.2  | 1 .. 1.5    | > 0  | limit of the current
    """
)


@stage("V", "P", "Q", "Vm", "d_Vf")
def terminal(Vr: Any, Vi: Any, Ed: Any, Eq: Any, Vf: Any, Xsource: Any, Tfltr: Any, shortest: Any) -> Any:
    """Terminal voltage and power of the source behind its reactance, (1), (4)."""
    V = np.sqrt(Vr * Vr + Vi * Vi)
    Vm, d_Vf = lag(Vf, V, Tfltr, shortest)
    return V, V * Eq / Xsource, V * (Ed - V) / Xsource, Vm, d_Vf


@stage("Ir", "Ii")
def behind(Er: Any, Ei: Any, R_grid: Any, X_grid: Any, Ed: Any, Eq: Any, Xsource: Any) -> Any:
    """Current behind an impedance: that of (4) is a straight line in V, (Z3)."""
    E = np.sqrt(Er * Er + Ei * Ei)
    V = voltage_behind(E, R_grid, X_grid, Eq / Xsource, 0.0, Ed / Xsource, -1.0 / Xsource)
    return along_terminal(Er, Ei, V, Eq / Xsource, (Ed - V) / Xsource, R_grid, X_grid)


@stage("d_Ip", "d_Iq", "d_Ed", "d_Eq")
def regulator(
    Ipcmd: Any, Iqcmd: Any, Ip: Any, Iq: Any, Ed: Any, Eq: Any, Vm: Any, Qgen0: Any, highI: Any, RateFlag: Any,
    PQFlag: Any, Tg: Any, Iqrmax: Any, Iqrmin: Any, Rrpwr: Any, Te: Any, Xsource: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Currents within their limits, and the voltage that drives them, (1) to (3)."""
    T, Tv = longer(Tg, shortest), longer(Te, shortest)
    highest = select(RateFlag == 1.0, Rrpwr / clip(Vm, 0.01, 10.0), Rrpwr)
    d_Ip, d_Iq = (Ipcmd - Ip) / T, (Iqcmd - Iq) / T
    d_Ip = select(d_Ip > highest, highest, d_Ip)
    d_Iq = select((Qgen0 > 0.0) & (d_Iq > Iqrmax), Iqrmax, d_Iq)
    d_Iq = select((Qgen0 < 0.0) & (d_Iq < Iqrmin), Iqrmin, d_Iq)
    square, active = highI * highI, PQFlag == 1.0
    first = clip(select(active, Ip, Iq), -highI, highI)
    left = np.sqrt(clip(square - first * first, 0.0, square))
    second = clip(select(active, Iq, Ip), -left, left)
    ip, iq = select(active, first, second), select(active, second, first)
    return d_Ip, d_Iq, (Vm + Xsource * iq - Ed) / Tv, (Xsource * ip - Eq) / Tv


def start(v: Values) -> Start:
    """Equilibrium at V, P and Q."""
    V, X = v["V"], v["Xsource"]
    Ip, Iq = v["P"] / V, v["Q"] / V
    current = np.hypot(Ip, Iq)
    _, highI = holding(current * (1 + 1e-9), 0.0, v["Imax"])
    return Start(
        {"Ip": Ip, "Iq": Iq, "Vf": V, "Ed": V + X * Iq, "Eq": X * Ip},
        {"Ip0": Ip, "Iq0": Iq, "Qgen0": v["Q"], "highI": highI},
        (Limit("current", current, 0.0, v["Imax"], ("", "Imax")),),
    )


REGCB1 = Part(
    name="REGCB1",
    slot="converter",
    title="Converter as a source of voltage",
    fields=FIELDS,
    stages=(terminal,),
    closing=(regulator,),
    ports=("V", "P", "Q", "Ip0", "Iq0"),
    states=("Ip", "Iq", "Vf", "Ed", "Eq"),
    setpoints=("Ip0", "Iq0", "Qgen0", "highI"),
    start=start,
    formula="(1) to (4)",
    source="WECC REGC_B; PSS/E model library, REGCB1",
    aliases=("REGCBU1",),
    behind=behind,
)
