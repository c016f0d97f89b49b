r"""REECA1 and REECB1, electrical controls of a converter (WECC REEC_A, REEC_B).

With :math:`V_f` and :math:`P_f` behind the filters Trv and Tp, and the dip :math:`d = 1` while :math:`V < V_{dip}` or
:math:`V > V_{up}`:

.. math::

    I_{qv} &= \big[K_{qv}\,\mathrm{db}(V_{ref0} - V_f)\big]_{Iql1}^{Iqh1}                                  & (1)\\
    Q_{ref} &= P_f\tan\varphi_0\ \text{if PFFLAG, else}\ Q_{ext}                                    & (2)\\
    V_{set} &= \Big[\mathrm{PI}_Q\big([Q_{ref}]_{Qmin}^{Qmax} - Q\big)\ \text{if VFLAG, else}\
        Q_{ref} + V_{ref1}\Big]_{Vmin}^{Vmax}                                                        & (3)\\
    I_{qb} &= \mathrm{PI}_V(V_{set} - V_f)\ \text{if QFLAG, else}\ \frac{Q_{ref}/V_f}{1 + sT_{iq}}      & (4)\\
    I_{q,cmd} &= [I_{qb} + I_{q,inj}]_{\pm I_{qmax}}                                                   & (5)\\
    T_{pord}\,\dot P_{ord} &= P_{set}\,(\omega_g\ \text{if PFLAG}) - P_{ord},\quad
        dP_{min} \le \dot P_{ord} \le dP_{max},\quad P_{min} \le P_{ord} \le P_{max}                  & (6)\\
    I_{p,cmd} &= [P_{ord}/V_f]_0^{I_{pmax}}                                                           & (7)

During a dip the integrals of (3), the lag of (4) and (6) hold. REECB1 injects :math:`I_{q,inj} = I_{qv}` always; REECA1
during a dip, and for the time :math:`|T_{hld}|` behind it :math:`I_{qfrz}` if :math:`T_{hld} > 0`, or still
:math:`I_{qv}` if :math:`T_{hld} < 0`. For Thld2 behind a dip REECA1 holds its limit of the active current.

The limits of the currents share :math:`I_{max}`: the current that is not first (PQFLAG) has what the first leaves,
:math:`\sqrt{I_{max}^2 - I^2}`. In REECA1 each is also below a table of four points over :math:`V_f`. A
table ends at the first point whose voltage is not above that of the point before, and one that is all zero is none.

:math:`P_{set}` is the reference of the plant, or the order of a torque control
(`errorscreen.models.renewables.wind_turbine`). Vref0 = 0 is the voltage at the start. A remote bus is not used.

(WECC, *Solar Photovoltaic Power Plant Modeling and Validation Guideline*, 2019; PSS/E model library, REECA1 and
REECB1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import lag, limited_pi, longer
from errorscreen.models.part import Conflict, Limit, Part, Start, Values, holding, record

_FLAGS = """\
    REMBUS | bus  | 0 | - | any  | remote bus; the own terminal is used
    PFFLAG | code | 0 | - | 0, 1 | 1: power factor, 0: reactive power
    VFLAG  | code | 1 | - | 0, 1 | 1: control of reactive power, 0: of voltage
    QFLAG  | code | 0 | - | 0, 1 | 1: inner control of voltage
"""
_PFLAG = """\
    PFLAG  | code | 0 | - | 0, 1 | 1: order of power times speed
"""
_DIP = """\
    PQFLAG | code | 0     | -            | 0, 1 | first: 1 active, 0 reactive current
    Vdip   | pu   | 0.85  | -            | any  | voltage below which there is a dip
    Vup    | pu   | 1.2   | -            | any  | voltage above which there is a dip
    Trv    | s    | 0.02  | -            | >= 0 | filter of the voltage
    dbd1   | pu   | -0.05 | -            | <= 0 | lower edge of the dead band
    dbd2   | pu   | 0.05  | -            | >= 0 | upper edge of the dead band
    Kqv    | pu   | 2     | 0.5 .. 10 unless 0 | >= 0 | reactive current per voltage beyond the dead band
    Iqh1   | pu   | 1.1   | limit        | any  | upper limit of that current
    Iql1   | pu   | -1.1  | limit        | any  | lower limit of that current
    Vref0  | pu   | 0     | - unless 0   | >= 0 | reference of the voltage; 0: that of the start
"""
_HOLD = """\
    Iqfrz  | pu   | 0     | -            | any  | reactive current that is held behind a dip
    Thld   | s    | 0     | -            | any  | time for which injection is held
    Thld2  | s    | 0     | -            | >= 0 | time for which the limit of active current is held
"""
_CONTROL = """\
    Tp     | s    | 0.05  | -            | >= 0 | filter of the power
    Qmax   | pu   | 0.44  | limit        | any  | upper limit of reactive power
    Qmin   | pu   | -0.44 | limit        | any  | lower limit of reactive power
    Vmax   | pu   | 1.1   | limit        | any  | upper limit of the voltage reference
    Vmin   | pu   | 0.9   | limit        | any  | lower limit of the voltage reference
    Kqp    | pu   | 0     | 0.01 .. 5 unless 0 | >= 0 | control of reactive power, proportional
    Kqi    | pu/s | 0.1   | 0.01 .. 10 unless 0 | >= 0 | control of reactive power, integral
    Kvp    | pu   | 1     | 0.1 .. 20 unless 0 | >= 0 | control of voltage, proportional
    Kvi    | pu/s | 40    | 1 .. 200 unless 0 | >= 0 | control of voltage, integral
"""
_BIAS = """\
    Vref1  | pu   | 0     | -            | any  | bias of the voltage reference
"""
_ORDER = """\
    Tiq    | s    | 0.02  | 0.01 .. 0.2 unless 0 | >= 0 | lag of the reactive current
    dPmax  | pu/s | 99    | limit        | > 0  | upper rate of power
    dPmin  | pu/s | -99   | limit        | any  | lower rate of power
    Pmax   | pu   | 1     | limit        | any  | upper limit of power
    Pmin   | pu   | 0     | limit        | any  | lower limit of power
    Imax   | pu   | 1.1   | 1 .. 1.5     | > 0  | limit of the current
    Tpord  | s    | 0.02  | 0.01 .. 1 unless 0 | >= 0 | lag of the power order
"""
_TABLES = "".join(
    f"    V{axis}{k} | pu | {voltage} | - | any | voltage of point {k}, limit of {name} current\n"
    f"    I{axis}{k} | pu | {current} | - | any | current of point {k}, limit of {name} current\n"
    for axis, name in (("q", "reactive"), ("p", "active"))
    for k, (voltage, current) in enumerate(((0.0, 1.2), (0.5, 1.2), (0.9, 1.2), (1.2, 1.2)), 1)
)
#: stands for no limit; the voltage that divides is at least `_V_MIN`
NONE, _V_MIN = 1e6, 0.01


@register_jitable
def dead_band_between(x: Any, lower: Any, upper: Any) -> Any:
    """Dead band without a step at its edges.

    Examples
    --------
    >>> [round(float(dead_band_between(x, -0.1, 0.2)), 12) for x in (-0.3, 0.1, 0.3)]
    [-0.2, 0.0, 0.1]
    """
    return x - clip(x, lower, upper)


@register_jitable
def next_point(y: Any, more: Any, x: Any, x1: Any, y1: Any, x2: Any, y2: Any) -> Any:
    """Line to the next point of a table, and whether the table goes on."""
    more = more & (x2 > x1)
    share = clip((x - x1) / select(x2 > x1, x2 - x1, 1.0), 0.0, 1.0)
    return select(more & (x > x1), y1 + share * (y2 - y1), y), more


@register_jitable
def four_points(x: Any, x1: Any, y1: Any, x2: Any, y2: Any, x3: Any, y3: Any, x4: Any, y4: Any) -> Any:
    """Table of up to four points, constant beyond its ends.

    Examples
    --------
    >>> [round(float(four_points(x, 0.0, 1.0, 0.5, 1.0, 1.0, 2.0, 0.0, 0.0)), 12) for x in (-1.0, 0.75, 3.0)]
    [1.0, 1.5, 2.0]
    >>> float(four_points(0.7, *8 * [0.0])) == NONE
    True
    """
    y, more = next_point(y1, x2 > x1, x, x1, y1, x2, y2)
    y, more = next_point(y, more, x, x2, y2, x3, y3)
    y, more = next_point(y, more, x, x3, y3, x4, y4)
    none = (x1 == 0.0) & (x2 == 0.0) & (y1 == 0.0) & (y2 == 0.0)
    return select(none, NONE, y)


@register_jitable
def injection(Vm: Any, Vref: Any, dbd1: Any, dbd2: Any, Kqv: Any, Iqh1: Any, Iql1: Any) -> Any:
    """Reactive current of a voltage beyond the dead band, (1)."""
    return clip(Kqv * dead_band_between(Vref - Vm, dbd1, dbd2), Iql1, Iqh1)


@stage("Vm", "Pm", "dip", "Iqv", "d_Vf", "d_Pf")
def measurement(
    V: Any, P: Any, Vf: Any, Pf: Any, Vref: Any, Vdip: Any, Vup: Any, Trv: Any, Tp: Any, dbd1: Any, dbd2: Any, Kqv: Any,
    Iqh1: Any, Iql1: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Filters, dip, and injection of a dip, (1)."""
    Vm, d_Vf = lag(Vf, V, Trv, shortest)
    Pm, d_Pf = lag(Pf, P, Tp, shortest)
    dip = select((Vdip > V) | (Vup < V), 0.0 * V + 1.0, 0.0 * V)
    return clip(Vm, _V_MIN, 10.0), Pm, dip, injection(Vm, Vref, dbd1, dbd2, Kqv, Iqh1, Iql1), d_Vf, d_Pf


@stage("Iqinj", "table_q", "table_p", "held", "d_clock", "d_clock2")
def dip_logic(
    dip: Any, Iqv: Any, Vm: Any, clock: Any, clock2: Any, more_q: Any, more_p: Any, Iqfrz: Any, Thld: Any, Thld2: Any,
    Vq1: Any, Iq1: Any, Vq2: Any, Iq2: Any, Vq3: Any, Iq3: Any, Vq4: Any, Iq4: Any,
    Vp1: Any, Ip1: Any, Vp2: Any, Ip2: Any, Vp3: Any, Ip3: Any, Vp4: Any, Ip4: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Injection, tables, and the clocks that run down behind a dip, of REECA1."""
    time = select(Thld < 0.0, -Thld, Thld)
    behind = select(clock > 0.0, select(Thld < 0.0, Iqv, Iqfrz), 0.0 * Iqv)
    d_clock = select(dip > 0.0, (time - clock) / shortest, select(clock > 0.0, -1.0, 0.0))
    d_clock2 = select(dip > 0.0, (Thld2 - clock2) / shortest, select(clock2 > 0.0, -1.0, 0.0))
    return (
        select(dip > 0.0, Iqv, behind),
        more_q + four_points(Vm, Vq1, Iq1, Vq2, Iq2, Vq3, Iq3, Vq4, Iq4),
        more_p + four_points(Vm, Vp1, Ip1, Vp2, Ip2, Vp3, Ip3, Vp4, Ip4),
        select((dip == 0.0) & (clock2 > 0.0), 0.0 * dip + 1.0, 0.0 * dip),
        d_clock,
        d_clock2,
    )


@stage("Iqinj", "table_q", "table_p", "held", "ceiling")
def no_dip_logic(Iqv: Any) -> Any:
    """Injection of REECB1, which has no tables and holds nothing."""
    none = 0.0 * Iqv
    return Iqv, none + NONE, none + NONE, none, none


@stage("d_Pord")
def power_order(
    Pset: Any, wg: Any, dip: Any, Pord: Any, lowP: Any, highP: Any, PFLAG: Any, Tpord: Any, dPmax: Any, dPmin: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Order of power, (6)."""
    wanted = Pset * select(PFLAG == 1.0, wg, 0.0 * wg + 1.0)
    rate = clip((wanted - Pord) / longer(Tpord, shortest), dPmin, dPmax)
    return (select(dip > 0.0, 0.0, hold_at_limits(Pord, rate, lowP, highP)),)


@stage("Ipcmd", "Iqcmd", "Ipmax", "Iqmax", "d_xq", "d_xv", "d_xi")
def currents(
    Qext: Any, Q: Any, Vm: Any, Pm: Any, dip: Any, Iqinj: Any, table_q: Any, table_p: Any, held: Any, ceiling: Any,
    Pord: Any, xq: Any, xv: Any, xi: Any, tangent: Any, lowQ: Any, highQ: Any, lowV: Any, highV: Any, highI: Any,
    PFFLAG: Any, VFLAG: Any, QFLAG: Any, PQFLAG: Any, Kqp: Any, Kqi: Any, Kvp: Any, Kvi: Any, Vref1: Any, Tiq: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Commands of the currents with their limits, (2) to (5), (7)."""
    square = highI * highI
    wanted = Pord / Vm
    free = select(table_p < highI, table_p, highI)
    first = clip(wanted, 0.0, select(held > 0.0, ceiling, free))  # the active current where it is first
    left = np.sqrt(clip(square - first * first, 0.0, square))
    Iqmax = select(PQFLAG == 1.0, left, highI)
    Iqmax = select(table_q < Iqmax, table_q, Iqmax)
    Qref = select(PFFLAG == 1.0, tangent * Pm, Qext)
    through, d_xq = limited_pi(xq, clip(Qref, lowQ, highQ) - Q, Kqp, Kqi, lowV, highV)
    Vset = select(VFLAG == 1.0, through, clip(Qref + Vref1, lowV, highV))
    controlled, d_xv = limited_pi(xv, Vset - Vm, Kvp, Kvi, -Iqmax, Iqmax)
    direct, d_xi = lag(xi, Qref / Vm, Tiq, shortest)
    Iqcmd = clip(select(QFLAG == 1.0, controlled, direct) + Iqinj, -Iqmax, Iqmax)
    left = np.sqrt(clip(square - Iqcmd * Iqcmd, 0.0, square))
    Ipmax = select(PQFLAG == 1.0, free, select(table_p < left, table_p, left))
    Ipcmd = clip(wanted, 0.0, select(held > 0.0, ceiling, Ipmax))
    runs = (QFLAG == 1.0) & (dip == 0.0)  # what is not used rests
    return (
        Ipcmd,
        Iqcmd,
        Ipmax,
        Iqmax,
        select(runs & (VFLAG == 1.0), d_xq, 0.0),
        select(runs, d_xv, 0.0),
        select((QFLAG == 0.0) & (dip == 0.0), d_xi, 0.0),
    )


@stage("d_ceiling")
def memory(dip: Any, Ipmax: Any, ceiling: Any, shortest: Any) -> Any:
    """Limit of the active current during a dip, to be held behind it."""
    return (select(dip > 0.0, (Ipmax - ceiling) / shortest, 0.0),)


def starting(
    v: Values, controlled: Any, Vref1: Any, always: bool
) -> tuple[Values, Values, tuple[Limit, ...]]:
    """Equilibrium at the currents of the converter and the voltage that QFLAG controls."""
    V, Ip, Iq = v["V"], v["Ip0"], v["Iq0"]
    Vref = np.where(v["Vref0"] == 0, V, v["Vref0"])
    Iqv = injection(V, Vref, v["dbd1"], v["dbd2"], v["Kqv"], v["Iqh1"], v["Iql1"])
    injected = Iqv if always else np.where((v["Vdip"] > V) | (v["Vup"] < V), Iqv, 0.0)
    base, Pord = Iq - injected, Ip * V
    inner = v["QFLAG"] == 1
    outer = inner & (v["VFLAG"] == 1)
    Qref = np.where(outer, v["Q"], np.where(inner, controlled - Vref1, base * V))
    size = np.abs(v["P"]) > 1e-6
    tangent = np.where(size, Qref / np.where(size, v["P"], 1.0), 0.0)
    lowQ, highQ = holding(Qref, v["Qmin"], v["Qmax"])
    lowV, highV = holding(controlled, v["Vmin"], v["Vmax"])
    lowP, highP = holding(Pord, v["Pmin"], v["Pmax"])
    current = np.hypot(Ip, Iq)
    states = {"Vf": V, "Pf": v["P"], "xq": controlled, "xv": base, "xi": base, "Pord": Pord}
    setpoints = {
        "Vref": Vref, "tangent": tangent, "lowQ": lowQ, "highQ": highQ, "lowV": lowV, "highV": highV, "lowP": lowP,
        "highP": highP, "highI": np.maximum(current * (1 + 1e-9), v["Imax"]), "Pref0": Pord, "Qext0": Qref,
        "by_voltage": np.where(inner & ~outer & (v["PFFLAG"] == 0), 1.0, 0.0) + 0.0 * V,
    }  # fmt: skip
    limits = (
        Limit("power", Pord, v["Pmin"], v["Pmax"], ("Pmin", "Pmax")),
        Limit("current", current, 0.0, v["Imax"], ("", "Imax")),
        Limit("reactive power", np.where(outer, Qref, v["Qmin"]), v["Qmin"], v["Qmax"], ("Qmin", "Qmax")),
        Limit("voltage", np.where(inner, controlled, v["Vmin"]), v["Vmin"], v["Vmax"], ("Vmin", "Vmax")),
    )
    return states, setpoints, limits


def in_dip(v: Values) -> Conflict:
    """Start in a dip, whose control would be held from the beginning."""
    return Conflict(
        (v["Vdip"] > v["V"]) | (v["Vup"] < v["V"]),
        "V before the event is {V:.4g} pu, outside of Vdip = {Vdip:.4g} to Vup = {Vup:.4g}: the unit would start in a "
        "dip, with its control held. Check Vdip and Vup, and the base of V",
        {name: v[name] for name in ("V", "Vdip", "Vup")},
    )


def _points(v: Values, axis: str) -> Any:
    return four_points(v["V"], *(v[f"{quantity}{axis}{k}"] for k in range(1, 5) for quantity in "VI"))


def start_a(v: Values) -> Start:
    """Equilibrium of REECA1."""
    states, setpoints, limits = starting(v, v["V"], v["Vref1"], always=False)
    Iq, Ip = np.abs(v["Iq0"]), v["Ip0"]
    table_q, table_p = _points(v, "q"), _points(v, "p")
    more = {"more_q": np.maximum(Iq - table_q, 0.0), "more_p": np.maximum(Ip - table_p, 0.0)}
    zero = np.zeros_like(Ip)
    states |= {"clock": zero, "clock2": zero, "ceiling": Ip}
    limits += (
        Limit("reactive current", Iq, 0.0, table_q, ("", "Iq")),
        Limit("active current", Ip, -NONE, table_p, ("", "Ip")),
    )
    return Start(states, {**setpoints, **more, "by_speed": v["PFLAG"]}, limits, (in_dip(v),))


def start_b(v: Values) -> Start:
    """Equilibrium of REECB1, whose reference of voltage has no bias, and whose order of power no speed."""
    states, setpoints, limits = starting(v, v["V"], 0.0, always=True)
    none = np.zeros_like(v["V"])
    return Start(states, {**setpoints, "Vref1": none, "PFLAG": none, "by_speed": none}, limits, (in_dip(v),))


STATES = ("Vf", "Pf", "xq", "xv", "xi", "Pord")
SETPOINTS = (
    "Vref", "tangent", "lowQ", "highQ", "lowV", "highV", "lowP", "highP", "highI", "Pref0", "Qext0", "by_speed",
    "by_voltage",
)  # fmt: skip
PORTS = ("Ipcmd", "Iqcmd", "Pref0", "Qext0", "Pord", "dip", "by_speed", "by_voltage")
RULES = ("Vdip < Vup", "Qmin <= Qmax", "Vmin <= Vmax", "Pmin <= Pmax", "Iql1 <= Iqh1", "dPmin < dPmax")

REECA1 = Part(
    name="REECA1",
    slot="electrical_control",
    title="Electrical control with tables of current limits",
    fields=record(_FLAGS + _PFLAG + _DIP + _HOLD + _CONTROL + _BIAS + _ORDER + _TABLES),
    stages=(measurement, dip_logic, power_order, currents, memory),
    ports=PORTS,
    states=(*STATES, "clock", "clock2", "ceiling"),
    setpoints=(*SETPOINTS, "more_q", "more_p"),
    start=start_a,
    rules=RULES,
    formula="(1) to (7)",
    source="WECC REEC_A; PSS/E model library, REECA1",
    aliases=("REECAU1",),
)
REECB1 = Part(
    name="REECB1",
    slot="electrical_control",
    title="Electrical control of a photovoltaic plant",
    fields=record(_FLAGS + _DIP + _CONTROL + _ORDER),
    stages=(measurement, no_dip_logic, power_order, currents),
    ports=PORTS,
    states=STATES,
    setpoints=(*SETPOINTS, "Vref1", "PFLAG"),
    start=start_b,
    rules=RULES,
    formula="(1) to (7)",
    source="WECC REEC_B; PSS/E model library, REECB1",
    checked="PSS/E (three buses)",
    aliases=("REECBU1",),
)
