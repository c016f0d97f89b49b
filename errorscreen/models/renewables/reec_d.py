r"""REECD1, electrical control of a converter with tables of ten points, compensated voltage, storage and blocking (WECC
REEC_D).

The equations (1) to (7) of `errorscreen.models.renewables.reec` with

.. math::

    V_c &= |V - (R_c + jX_c) I|\ \text{if VCMPFLAG, else}\ V + K_c Q,\quad T_{r1}\,\dot V_{cf} = V_c - V_{cf},\quad
    I_{qb} = \mathrm{PI}_V(V_{set} - V_{cf})\ \text{if QFLAG}                                             & (1)\\
    I_{q,cmd} &= [I_{qb} + I_{qv}]_{\pm I_{qmax}},\quad I_{p,cmd} = [P_{ord}/V_f]_{-K_e I_{pmax}}^{I_{pmax}}   & (2)

The current of the voltage, :math:`I_{qv}`, is injected always. For the time :math:`|T_{hld}|` behind a dip the command
of the reactive current is Iqfrz if :math:`T_{hld} > 0`, or stays what it was at the end of the dip if
:math:`T_{hld} < 0`; for Thld2 that of the active current stays. Both commands are zero while the voltage behind its
filter is below Vblkl or above Vblkh, and for Tblkdelay more; Vblkh = 0 blocks nothing.

The order of this record is known from one source only, and not confirmed by a file; that Thld keeps the sign it has in
REEC_A, and Vblkh = 0, are our reading. The branch of :math:`R_c + jX_c` carries the current of the terminal.

(EPRI, *Model User Guide for Generic Renewable Energy Systems*, 3002027129, 2023; PSS/E model library, REECD1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, limited_pi
from errorscreen.models.part import Limit, Part, Start, Values, record
from errorscreen.models.renewables.reec import (
    NONE,
    PORTS,
    REECA1,
    RULES,
    SETPOINTS,
    STATES,
    in_dip,
    measurement,
    next_point,
    power_order,
    starting,
)
from errorscreen.models.renewables.repc_a import regulated

_FLAG = """
    VCMPFLAG | code | 0 | - | 0, 1 | 1: drop over an impedance, 0: droop
"""
_TABLES = "".join(
    f"    V{axis}{k} | pu | {voltage} | - | any | voltage of point {k}, limit of {name} current\n"
    f"    I{axis}{k} | pu | {current} | - | any | current of point {k}, limit of {name} current\n"
    for axis, name in (("q", "reactive"), ("p", "active"))
    for k, (voltage, current) in enumerate(
        ((0.0, 1.2), (0.5, 1.2), (0.9, 1.2), (1.2, 1.2), *6 * ((0.0, 0.0),)), 1
    )
)
_MORE = """
    Rc        | pu | 0    | -                    | any    | resistance of the drop
    Xc        | pu | 0    | -                    | any    | reactance of the drop
    Tr1       | s  | 0.02 | -                    | >= 0   | filter of the voltage that is controlled
    Kc        | pu | 0    | 0.01 .. 0.2 unless 0 | any    | droop, voltage per reactive power
    Ke        | -  | 0    | -                    | 0 .. 1 | share of the limit for negative active current
    Vblkl     | pu | 0    | -                    | any    | voltage below which the converter blocks
    Vblkh     | pu | 0    | -                    | any    | voltage above which the converter blocks; 0: never
    Tblkdelay | s  | 0.04 | -                    | >= 0   | time for which it stays blocked
"""
FIELDS = (*REECA1.fields[1:6], *record(_FLAG), *REECA1.fields[6:35], *record(_TABLES), *record(_MORE))


@register_jitable
def ten_points(
    x: Any, x1: Any, y1: Any, x2: Any, y2: Any, x3: Any, y3: Any, x4: Any, y4: Any, x5: Any, y5: Any, x6: Any, y6:
    Any, x7: Any, y7: Any, x8: Any, y8: Any, x9: Any, y9: Any, x10: Any, y10: Any,
) -> Any:  # fmt: skip
    """Table of up to ten points, constant beyond its ends.

    Examples
    --------
    >>> float(ten_points(0.75, 0.5, 1.0, 1.0, 2.0, *16 * [0.0]))
    1.5
    """
    y, more = next_point(y1, x2 > x1, x, x1, y1, x2, y2)
    y, more = next_point(y, more, x, x2, y2, x3, y3)
    y, more = next_point(y, more, x, x3, y3, x4, y4)
    y, more = next_point(y, more, x, x4, y4, x5, y5)
    y, more = next_point(y, more, x, x5, y5, x6, y6)
    y, more = next_point(y, more, x, x6, y6, x7, y7)
    y, more = next_point(y, more, x, x7, y7, x8, y8)
    y, more = next_point(y, more, x, x8, y8, x9, y9)
    y, more = next_point(y, more, x, x9, y9, x10, y10)
    none = (x1 == 0.0) & (x2 == 0.0) & (y1 == 0.0) & (y2 == 0.0)
    return select(none, NONE, y)


@stage("table_q", "table_p")
def tables(
    Vm: Any, more_q: Any, more_p: Any, Vq1: Any, Iq1: Any, Vq2: Any, Iq2: Any, Vq3: Any, Iq3: Any, Vq4: Any, Iq4:
    Any, Vq5: Any, Iq5: Any, Vq6: Any, Iq6: Any, Vq7: Any, Iq7: Any, Vq8: Any, Iq8: Any, Vq9: Any, Iq9: Any, Vq10:
    Any, Iq10: Any, Vp1: Any, Ip1: Any, Vp2: Any, Ip2: Any, Vp3: Any, Ip3: Any, Vp4: Any, Ip4: Any, Vp5: Any, Ip5:
    Any, Vp6: Any, Ip6: Any, Vp7: Any, Ip7: Any, Vp8: Any, Ip8: Any, Vp9: Any, Ip9: Any, Vp10: Any, Ip10: Any,
) -> Any:  # fmt: skip
    """Limits of the currents over the voltage."""
    return (
        more_q
        + ten_points(
            Vm, Vq1, Iq1, Vq2, Iq2, Vq3, Iq3, Vq4, Iq4, Vq5, Iq5, Vq6, Iq6, Vq7, Iq7, Vq8, Iq8, Vq9, Iq9,
            Vq10, Iq10,
        ),
        more_p
        + ten_points(
            Vm, Vp1, Ip1, Vp2, Ip2, Vp3, Ip3, Vp4, Ip4, Vp5, Ip5, Vp6, Ip6, Vp7, Ip7, Vp8, Ip8, Vp9, Ip9,
            Vp10, Ip10,
        ),
    )  # fmt: skip


@stage("Vc", "blocked", "holds_q", "holds_p", "d_Vx", "d_clock", "d_clock2", "d_clock3")
def logic(
    V: Any, P: Any, Q: Any, Vm: Any, dip: Any, Vx: Any, clock: Any, clock2: Any, clock3: Any, VCMPFLAG: Any,
    Thld: Any, Thld2: Any, Rc: Any, Xc: Any, Tr1: Any, Kc: Any, Vblkl: Any, Vblkh: Any, Tblkdelay: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Voltage that is controlled, (1), blocking, and the clocks that run down behind a dip and a block."""
    Vc, d_Vx = lag(Vx, regulated(V, P, Q, VCMPFLAG, 1.0, Rc, Xc, Kc), Tr1, shortest)
    time = select(Thld < 0.0, -Thld, Thld)
    outside = (Vblkh > 0.0) & ((Vm < Vblkl) | (Vm > Vblkh))
    none = 0.0 * dip
    return (
        Vc,
        select(outside | (clock3 > 0.0), none + 1.0, none),
        select((dip == 0.0) & (clock > 0.0), none + 1.0, none),
        select((dip == 0.0) & (clock2 > 0.0), none + 1.0, none),
        d_Vx,
        select(dip > 0.0, (time - clock) / shortest, select(clock > 0.0, -1.0, 0.0)),
        select(dip > 0.0, (Thld2 - clock2) / shortest, select(clock2 > 0.0, -1.0, 0.0)),
        select(outside, (Tblkdelay - clock3) / shortest, select(clock3 > 0.0, -1.0, 0.0)),
    )


@stage("Ipcmd", "Iqcmd", "d_xq", "d_xv", "d_xi", "d_keepq", "d_keepp")
def currents(
    Qext: Any, Q: Any, Vm: Any, Pm: Any, dip: Any, Iqv: Any, Vc: Any, blocked: Any, holds_q: Any, holds_p: Any,
    table_q: Any, table_p: Any, Pord: Any, xq: Any, xv: Any, xi: Any, keepq: Any, keepp: Any, tangent: Any, lowQ: Any,
    highQ: Any, lowV: Any, highV: Any, highI: Any, PFFLAG: Any, VFLAG: Any, QFLAG: Any, PQFLAG: Any, Kqp: Any, Kqi: Any,
    Kvp: Any, Kvi: Any, Vref1: Any, Tiq: Any, Iqfrz: Any, Thld: Any, Ke: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Commands of the currents with their limits, (2)."""
    square, first = highI * highI, PQFLAG == 1.0
    free = select(table_p < highI, table_p, highI)
    wanted = select(holds_p > 0.0, keepp, Pord / Vm)
    active = clip(wanted, -Ke * free, free)  # the active current where it is first
    left = np.sqrt(clip(square - active * active, 0.0, square))
    Iqmax = select(first, left, highI)
    Iqmax = select(table_q < Iqmax, table_q, Iqmax)
    Qref = select(PFFLAG == 1.0, tangent * Pm, Qext)
    through, d_xq = limited_pi(xq, clip(Qref, lowQ, highQ) - Q, Kqp, Kqi, lowV, highV)
    Vset = select(VFLAG == 1.0, through, clip(Qref + Vref1, lowV, highV))
    controlled, d_xv = limited_pi(xv, Vset - Vc, Kvp, Kvi, -Iqmax, Iqmax)
    direct, d_xi = lag(xi, Qref / Vm, Tiq, shortest)
    kept = select(Thld < 0.0, keepq, Iqfrz)
    reactive = clip(
        select(holds_q > 0.0, kept, select(QFLAG == 1.0, controlled, direct) + Iqv), -Iqmax, Iqmax
    )
    left = np.sqrt(clip(square - reactive * reactive, 0.0, square))
    Ipmax = select(first, free, select(table_p < left, table_p, left))
    runs = (QFLAG == 1.0) & (dip == 0.0)  # what is not used rests
    Ipcmd = select(blocked > 0.0, 0.0, clip(wanted, -Ke * Ipmax, Ipmax))
    Iqcmd = select(blocked > 0.0, 0.0, reactive)
    return (
        Ipcmd,
        Iqcmd,
        select(runs & (VFLAG == 1.0), d_xq, 0.0),
        select(runs, d_xv, 0.0),
        select((QFLAG == 0.0) & (dip == 0.0), d_xi, 0.0),
        select(dip > 0.0, (Iqcmd - keepq) / shortest, 0.0),
        select(dip > 0.0, (Ipcmd - keepp) / shortest, 0.0),
    )


def _points(v: Values, axis: str) -> Any:
    return ten_points(v["V"], *(v[f"{quantity}{axis}{k}"] for k in range(1, 11) for quantity in "VI"))


def start(v: Values) -> Start:
    """Equilibrium with nothing blocked."""
    controlled = regulated(v["V"], v["P"], v["Q"], v["VCMPFLAG"], 1.0, v["Rc"], v["Xc"], v["Kc"])
    states, setpoints, limits = starting(v, controlled, v["Vref1"], always=True)
    Iq, Ip = v["Iq0"], v["Ip0"]
    table_q, table_p = _points(v, "q"), _points(v, "p")
    states |= {"Vx": controlled, "keepq": Iq, "keepp": Ip}
    states |= dict.fromkeys(("clock", "clock2", "clock3"), 0.0 * Ip)
    setpoints |= {
        "more_q": np.maximum(np.abs(Iq) - table_q, 0.0),
        "more_p": np.maximum(np.abs(Ip) - table_p, 0.0),
        "by_speed": v["PFLAG"],
    }
    blocks = v["Vblkh"] > 0
    limits += (
        Limit("reactive current", np.abs(Iq), 0.0, table_q, ("", "Iq")),
        Limit("active current", Ip, -v["Ke"] * table_p, table_p, ("Ke", "Ip")),
        Limit(
            "voltage", v["V"], np.where(blocks, v["Vblkl"], -NONE), np.where(blocks, v["Vblkh"], NONE),
            ("Vblkl", "Vblkh"),
        ),
    )  # fmt: skip
    return Start(states, setpoints, limits, (in_dip(v),))


REECD1 = Part(
    name="REECD1",
    slot="electrical_control",
    title="Electrical control with compensated voltage, storage and blocking",
    fields=FIELDS,
    stages=(measurement, tables, logic, power_order, currents),
    ports=PORTS,
    states=(*STATES, "Vx", "clock", "clock2", "clock3", "keepq", "keepp"),
    setpoints=(*SETPOINTS, "more_q", "more_p"),
    start=start,
    rules=RULES,
    formula="(1), (2); (1) to (7) of REECA1",
    source="WECC REEC_D; PSS/E model library, REECD1",
    aliases=("REECDU1",),
)
