r"""IEEEST, stabiliser with one input and a filter of order four.

.. math::

    F(s) &= \frac{1 + A_5 s + A_6 s^2}{(1 + A_1 s + A_2 s^2)(1 + A_3 s + A_4 s^2)}                  & (1)\\
    y &= F(s)\,\frac{1 + sT_1}{1 + sT_2}\,\frac{1 + sT_3}{1 + sT_4}\,K_S\frac{sT_5}{1 + sT_6}\,u     & (2)\\
    V_s &= [y]_{LSMIN}^{LSMAX}\ \text{if}\ V_{CL} \le V \le V_{CU},\ \text{else}\ 0                     & (3)

The input u is one of `errorscreen.models.stabilisers.inputs`. Each quadratic of (1) has the order of its last constant
that is not zero, and with :math:`w = u/(1 + A_1 s + A_2 s^2)`, :math:`v = w/(1 + A_3 s + A_4 s^2)` the output of the
filter is :math:`v + A_5\dot v + A_6\ddot v`. T5 = 0 stands for a numerator of one in the washout, and VCU = 0 or
VCL = 0 for no limit of the voltage.

(PSS/E model library, IEEEST.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, lead_lag, longer
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Part, Start, Values, record
from errorscreen.models.stabilisers.inputs import CODES, at_start, chosen, cut_out

FIELDS = record(
    f"""
    IC    | code | 1    | -           | {CODES} | input signal
    IB    | bus  | 0    | -           | any     | remote bus; the own terminal is used
    A1    | s    | 0    | -           | >= 0    | filter, denominator, first quadratic
    A2    | s^2  | 0    | -           | >= 0    | filter, denominator, first quadratic
    A3    | s    | 0    | -           | >= 0    | filter, denominator, second quadratic
    A4    | s^2  | 0    | -           | >= 0    | filter, denominator, second quadratic
    A5    | s    | 0    | -           | any     | filter, numerator
    A6    | s^2  | 0    | -           | any     | filter, numerator
    T1    | s    | 0.2  | 0.02 .. 1 unless 0 | >= 0    | lead of the first lead-lag
    T2    | s    | 0.02 | 0.01 .. 0.5 unless 0 | >= 0    | lag of the first lead-lag
    T3    | s    | 0.2  | 0.02 .. 1 unless 0 | >= 0    | lead of the second lead-lag
    T4    | s    | 0.02 | 0.01 .. 0.5 unless 0 | >= 0    | lag of the second lead-lag
    T5    | s    | 10   | - unless 0  | >= 0    | numerator of the washout; 0: one
    T6    | s    | 10   | -           | >= 0    | denominator of the washout
    KS    | pu   | 10   | -50 .. 50   | any     | gain
    LSMAX | pu   | 0.1  | limit       | >= 0    | upper limit of the output
    LSMIN | pu   | -0.1 | limit       | <= 0    | lower limit of the output
    VCU   | pu   | 0    | - unless 0  | >= 0    | voltage above which the output is zero; 0: none
    VCL   | pu   | 0    | - unless 0  | >= 0    | voltage below which the output is zero; 0: none
    """
)


@register_jitable
def quadratic_lag(x: Any, dx: Any, u: Any, A1: Any, A2: Any, shortest: Any) -> Any:
    """Lag of order two, :math:`y = u/(1 + sA_1 + s^2A_2)`: y, its derivatives as far as u alone gives them, and
    those of the states. The order is lower where a time constant is too short.
    """
    second = shortest * longer(A1, shortest) < A2
    first = shortest < A1
    T, T2 = longer(A1, shortest), select(second, A2, shortest * shortest)
    slope = (u - x) / T
    y = select(second | first, x, u)
    dy = select(second, dx, select(first, slope, 0.0 * x))
    ddy = select(second, (u - x - A1 * dx) / T2, 0.0 * x)
    return y, dy, ddy, select(second, dx, slope), select(second, ddy, -dx / T)


@stage("u", "filter_out", "d_xr", "d_xi", "d_w", "d_dw", "d_v", "d_dv")
def filter_stage(
    Vr: Any, Vi: Any, V: Any, omega: Any, P: Any, Pm: Any, xr: Any, xi: Any, w: Any, dw: Any, v: Any, dv: Any, IC: Any,
    A1: Any, A2: Any, A3: Any, A4: Any, A5: Any, A6: Any, f0: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Input and its filter, (1)."""
    df, dV, d_xr, d_xi = measured_voltage(xr, xi, Vr, Vi, f0, shortest)
    u = chosen(IC, omega, df, P, Pm, V, dV)
    W, dW, ddW, d_w, d_dw = quadratic_lag(w, dw, u, A1, A2, shortest)
    Y, dY, ddY, d_v, d_dv = quadratic_lag(v, dv, W, A3, A4, shortest)
    second = shortest * longer(A3, shortest) < A4
    first = shortest < A3
    dY = select(second | first, dY, dW)
    ddY = select(second, ddY, select(first, (dW - dY) / longer(A3, shortest), ddW))
    return u, Y + A5 * dY + A6 * ddY, d_xr, d_xi, d_w, d_dw, d_v, d_dv


@stage("lead1_out", "lead2_out", "Vs", "d_x1", "d_x2", "d_x3")
def output(
    filter_out: Any, V: Any, x1: Any, x2: Any, x3: Any, T1: Any, T2: Any, T3: Any, T4: Any, T5: Any, T6: Any, KS: Any,
    LSMAX: Any, LSMIN: Any, VCU: Any, VCL: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Lead-lags, washout and limits, (2), (3)."""
    y1, d_x1 = lead_lag(x1, filter_out, T1, T2, shortest)
    y2, d_x2 = lead_lag(x2, y1, T3, T4, shortest)
    passed, d_x3 = lag(x3, y2, T6, shortest)
    y = KS * select(T5 == 0.0, passed, T5 * d_x3)
    return y1, y2, cut_out(clip(y, LSMIN, LSMAX), V, VCL, VCU), d_x1, d_x2, d_x3


def start(v: Values) -> Start:
    """Equilibrium: all filters hold the input."""
    u = at_start(v["IC"], v)
    rest = np.zeros_like(u)
    states = {"xr": v["Vr"], "xi": v["Vi"], "w": u, "dw": rest, "v": u, "dv": rest, "x1": u, "x2": u, "x3": u}
    return Start(states, {})


IEEEST = Part(
    name="IEEEST",
    slot="stabiliser",
    title="Stabiliser with a filter of order four",
    fields=FIELDS,
    stages=(filter_stage, output),
    ports=("Vs",),
    states=("xr", "xi", "w", "dw", "v", "dv", "x1", "x2", "x3"),
    start=start,
    rules=(
        "A5 needs A1 or A2 or A3 or A4",
        "A6 needs A2 or A4 or A1 * A3",
        "T1 needs T2",
        "T3 needs T4",
        "T5 needs T6",
    ),
    formula="Vs = [KS F(s) (1 + s T1) (1 + s T3) / ((1 + s T2) (1 + s T4)) s T5 / (1 + s T6) u] within LSMIN, LSMAX",
    source="PSS/E model library, IEEEST",
    checked="OpenIPSL (one machine)",
)
