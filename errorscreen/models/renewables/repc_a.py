r"""REPCA1, control of a plant (WECC REPC_A).

.. math::

    y &= |V - (R_c + jX_c) I|\ \text{or}\ V + K_c Q\ \text{if RefFlag},\ \text{else}\ Q,\quad
    T_{fltr}\,\dot y_f = y - y_f                                                                    & (1)\\
    e &= \big[\mathrm{db}(y_{ref} - y_f)\big]_{emin}^{emax},\quad
    Q_{ext} = \frac{1 + sT_{ft}}{1 + sT_{fv}}\,\Big[\Big(K_p + \frac{K_i}{s}\Big) e\Big]_{Qmin}^{Qmax}     & (2)\\
    p &= [D_{dn} u]^- + [D_{up} u]^+,\quad u = \mathrm{db}(f_{ref} - \Delta f)                            & (3)\\
    P_{ref} &= \frac{1}{1 + sT_g}\Big[\Big(K_{pg} + \frac{K_{ig}}{s}\Big)
        \big[P_{plant} - P_f + p\big]_{femin}^{femax}\Big]_{Pmin}^{Pmax},\quad T_p\,\dot P_f = P - P_f  & (4)

VCFlag = 1 stands for the drop over :math:`R_c + jX_c`, 0 for the droop :math:`K_c`. The integral of (2) holds while
:math:`V < V_{frz}`. With Fflag = 0 the reference of power is constant. The branch that a record names is taken to carry
the current of the terminal, and the regulated bus is the terminal; the frequency is that of
`errorscreen.models.measured_voltage`.

(WECC, *Solar Photovoltaic Power Plant Modeling and Validation Guideline*, 2019; PSS/E model library, REPCA1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, lead_lag, limited_pi
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Conflict, Limit, Part, Start, Values, holding, record
from errorscreen.models.renewables.reec import dead_band_between

FIELDS = record(
    """
    REMBUS  | bus  | 0     | -    | any  | regulated bus; the own terminal is used
    FromBus | bus  | 0     | -    | any  | branch, from; the own terminal is used
    ToBus   | bus  | 0     | -    | any  | branch, to
    CKTID   | id   | 1     | -    | any  | branch, circuit
    VCFlag  | code | 0     | -    | 0, 1 | 1: drop over an impedance, 0: droop
    RefFlag | code | 1     | -    | 0, 1 | 1: control of voltage, 0: of reactive power
    Fflag   | code | 0     | -    | 0, 1 | 1: control of frequency and power
    Tfltr   | s    | 0.02  | 0.01 .. 0.2 unless 0 | >= 0 | filter of voltage or reactive power
    Kp      | pu   | 1     | 0.1 .. 20 unless 0   | >= 0 | control of voltage or reactive power, proportional
    Ki      | pu/s | 5     | 0.1 .. 20 unless 0   | >= 0 | control of voltage or reactive power, integral
    Tft     | s    | 0     | -    | >= 0 | lead of the reactive output
    Tfv     | s    | 0.1   | 0.02 .. 0.5 unless 0 | >= 0 | lag of the reactive output
    Vfrz    | pu   | 0     | -    | any  | voltage below which the integral holds
    Rc      | pu   | 0     | -    | any  | resistance of the drop
    Xc      | pu   | 0     | -    | any  | reactance of the drop
    Kc      | pu   | 0     | 0.01 .. 0.2 unless 0 | any  | droop, voltage per reactive power
    emax    | pu   | 0.1   | limit | >= 0 | upper limit of the error
    emin    | pu   | -0.1  | limit | <= 0 | lower limit of the error
    dbd1    | pu   | -0.01 | -    | <= 0 | lower edge of the dead band
    dbd2    | pu   | 0.01  | -    | >= 0 | upper edge of the dead band
    Qmax    | pu   | 0.44  | limit | any  | upper limit of the reactive output
    Qmin    | pu   | -0.44 | limit | any  | lower limit of the reactive output
    Kpg     | pu   | 1     | 0.05 .. 5 unless 0   | >= 0 | control of power, proportional
    Kig     | pu/s | 0.5   | 0.05 .. 5 unless 0   | >= 0 | control of power, integral
    Tp      | s    | 0.25  | -    | >= 0 | filter of the power
    fdbd1   | pu   | -6e-4 | -    | <= 0 | lower edge of the dead band of frequency
    fdbd2   | pu   | 6e-4  | -    | >= 0 | upper edge of the dead band of frequency
    femax   | pu   | 99    | limit | >= 0 | upper limit of the error of power
    femin   | pu   | -99   | limit | <= 0 | lower limit of the error of power
    Pmax    | pu   | 1     | limit | any  | upper limit of the reference of power
    Pmin    | pu   | 0     | limit | any  | lower limit of the reference of power
    Tg      | s    | 0.1   | 0.02 .. 1 unless 0   | >= 0 | lag of the reference of power
    Ddn     | pu   | 20    | 5 .. 50 unless 0     | >= 0 | power per frequency above the nominal one
    Dup     | pu   | 0     | 5 .. 50 unless 0     | >= 0 | power per frequency below the nominal one
    """
)


@register_jitable
def regulated(V: Any, P: Any, Q: Any, VCFlag: Any, RefFlag: Any, Rc: Any, Xc: Any, Kc: Any) -> Any:
    """Quantity that is controlled, (1)."""
    size = clip(V, 0.01, 10.0)
    along, across = V - (Rc * P + Xc * Q) / size, (Xc * P - Rc * Q) / size
    voltage = select(VCFlag == 1.0, np.sqrt(along * along + across * across), V + Kc * Q)
    return select(RefFlag == 1.0, voltage, Q)


@stage("Qext", "d_yf", "d_xq", "d_xl")
def reactive(
    V: Any, P: Any, Q: Any, yf: Any, xq: Any, xl: Any, yref: Any, lowQ: Any, highQ: Any, VCFlag: Any, RefFlag: Any,
    Tfltr: Any, Kp: Any, Ki: Any, Tft: Any, Tfv: Any, Vfrz: Any, Rc: Any, Xc: Any, Kc: Any, emax: Any, emin: Any,
    dbd1: Any, dbd2: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Control of voltage or reactive power, (1), (2)."""
    y, d_yf = lag(yf, regulated(V, P, Q, VCFlag, RefFlag, Rc, Xc, Kc), Tfltr, shortest)
    error = clip(dead_band_between(yref - y, dbd1, dbd2), emin, emax)
    order, d_xq = limited_pi(xq, error, Kp, Ki, lowQ, highQ)
    Qext, d_xl = lead_lag(xl, order, Tft, Tfv, shortest)
    return Qext, d_yf, select(Vfrz > V, 0.0, d_xq), d_xl


@stage("Pref", "d_xr", "d_xi", "d_Pf", "d_xp", "d_xg")
def active(
    Vr: Any, Vi: Any, P: Any, xr: Any, xi: Any, Pf: Any, xp: Any, xg: Any, Pref0: Any, Pplant: Any, fref: Any,
    lowP: Any, highP: Any, Fflag: Any, Kpg: Any, Kig: Any, Tp: Any, fdbd1: Any, fdbd2: Any, femax: Any, femin: Any,
    Tg: Any, Ddn: Any, Dup: Any, f0: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Control of frequency and power, (3), (4)."""
    df, _, d_xr, d_xi = measured_voltage(xr, xi, Vr, Vi, f0, shortest)
    Pm, d_Pf = lag(Pf, P, Tp, shortest)
    u = dead_band_between(fref - df, fdbd1, fdbd2)
    droop = select(u < 0.0, Ddn * u, Dup * u)
    order, d_xp = limited_pi(xp, clip(Pplant - Pm + droop, femin, femax), Kpg, Kig, lowP, highP)
    y, d_xg = lag(xg, order, Tg, shortest)
    on = Fflag == 1.0
    return select(on, y, Pref0), d_xr, d_xi, d_Pf, select(on, d_xp, 0.0), select(on, d_xg, 0.0)


def start(v: Values) -> Start:
    """Equilibrium at the references of the electrical control."""
    Q, P = v["Qext0"], v["Pref0"]
    y = regulated(v["V"], v["P"], v["Q"], v["VCFlag"], v["RefFlag"], v["Rc"], v["Xc"], v["Kc"])
    lowQ, highQ = holding(Q, v["Qmin"], v["Qmax"])
    lowP, highP = holding(P, v["Pmin"], v["Pmax"])
    return Start(
        {"yf": y, "xq": Q, "xl": Q, "xr": v["Vr"], "xi": v["Vi"], "Pf": v["P"], "xp": P, "xg": P},
        {
            "yref": y,
            "Pplant": v["P"],
            "fref": 0.0 * v["P"],
            "lowQ": lowQ,
            "highQ": highQ,
            "lowP": lowP,
            "highP": highP,
        },
        (
            Limit("reactive order", Q, v["Qmin"], v["Qmax"], ("Qmin", "Qmax")),
            Limit("power", np.where(v["Fflag"] == 1, P, v["Pmin"]), v["Pmin"], v["Pmax"], ("Pmin", "Pmax")),
        ),
        (
            Conflict(
                (v["RefFlag"] == 0) & (v["by_voltage"] == 1),
                "RefFlag = 0 orders reactive power, which the electrical control takes as a voltage with QFLAG = 1 and "
                "VFLAG = 0. Fitting sets are RefFlag = 1, or VFLAG = 1, or QFLAG = 0",
                {},
            ),
        ),
    )


REPCA1 = Part(
    name="REPCA1",
    slot="plant_control",
    title="Control of a plant",
    fields=FIELDS,
    stages=(reactive, active),
    ports=("Qext", "Pref"),
    states=("yf", "xq", "xl", "xr", "xi", "Pf", "xp", "xg"),
    setpoints=("yref", "Pplant", "fref", "lowQ", "highQ", "lowP", "highP"),
    start=start,
    rules=("Qmin <= Qmax", "Pmin <= Pmax", "Tft needs Tfv"),
    formula="(1) to (4)",
    source="WECC REPC_A; PSS/E model library, REPCA1",
    checked="PSS/E (three buses)",
    aliases=("REPCAU1",),
)
