r"""ST2CUT, stabiliser with two inputs and a cut-out.

.. math::

    y &= \Big(\frac{K_1}{1 + sT_1} u_1 + \frac{K_2}{1 + sT_2} u_2\Big)\frac{sT_3}{1 + sT_4}\,
        \frac{1 + sT_5}{1 + sT_6}\,\frac{1 + sT_7}{1 + sT_8}\,\frac{1 + sT_9}{1 + sT_{10}}              & (1)\\
    V_s &= [y]_{LSMIN}^{LSMAX}\ \text{if}\ V_0 + V_{CL} \le V \le V_0 + V_{CU},\ \text{else}\ 0         & (2)

with the inputs of `errorscreen.models.stabilisers.inputs` and the voltage :math:`V_0` of the start. T3 = 0 stands for
a numerator of one in the washout, and VCU = 0 or VCL = 0 for no limit of the voltage.

(PSS/E model library, ST2CUT.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, lead_lag
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Part, Start, Values, record
from errorscreen.models.stabilisers.inputs import CODES, at_start, chosen, cut_out

FIELDS = record(
    f"""
    IC1   | code | 1    | - | {CODES} | first input signal
    IB1   | bus  | 0    | - | any     | remote bus of the first input; the own terminal is used
    IC2   | code | 0    | - | {CODES} | second input signal
    IB2   | bus  | 0    | - | any     | remote bus of the second input; the own terminal is used
    K1    | pu   | 10   | 1 .. 50 unless 0    | any  | gain of the first input
    K2    | pu   | 0    | 1 .. 50 unless 0    | any  | gain of the second input
    T1    | s    | 0.01 | -                   | >= 0 | lag of the first input
    T2    | s    | 0.01 | -                   | >= 0 | lag of the second input
    T3    | s    | 10   | - unless 0          | >= 0 | numerator of the washout; 0: one
    T4    | s    | 10   | -                   | >= 0 | denominator of the washout
    T5    | s    | 0.2  | 0.02 .. 1 unless 0  | >= 0 | lead of the first lead-lag
    T6    | s    | 0.02 | -                   | >= 0 | lag of the first lead-lag
    T7    | s    | 0.2  | 0.02 .. 1 unless 0  | >= 0 | lead of the second lead-lag
    T8    | s    | 0.02 | -                   | >= 0 | lag of the second lead-lag
    T9    | s    | 0    | 0.02 .. 1 unless 0  | >= 0 | lead of the third lead-lag
    T10   | s    | 0    | -                   | >= 0 | lag of the third lead-lag
    LSMAX | pu   | 0.1  | limit               | >= 0 | upper limit of the output
    LSMIN | pu   | -0.1 | limit               | <= 0 | lower limit of the output
    VCU   | pu   | 0    | - unless 0          | >= 0 | rise of the voltage above which the output is zero; 0: none
    VCL   | pu   | 0    | - unless 0          | <= 0 | fall of the voltage below which the output is zero; 0: none
    """
)


@stage("y", "d_xr", "d_xi", "d_x1", "d_x2", "d_x3")
def transducers(
    Vr: Any, Vi: Any, V: Any, omega: Any, P: Any, Pm: Any, xr: Any, xi: Any, x1: Any, x2: Any, x3: Any, IC1: Any,
    IC2: Any, K1: Any, K2: Any, T1: Any, T2: Any, T3: Any, T4: Any, f0: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Sum of the inputs and washout, (1)."""
    df, dV, d_xr, d_xi = measured_voltage(xr, xi, Vr, Vi, f0, shortest)
    first, d_x1 = lag(x1, K1 * chosen(IC1, omega, df, P, Pm, V, dV), T1, shortest)
    second, d_x2 = lag(x2, K2 * chosen(IC2, omega, df, P, Pm, V, dV), T2, shortest)
    passed, d_x3 = lag(x3, first + second, T4, shortest)
    return select(T3 == 0.0, passed, T3 * d_x3), d_xr, d_xi, d_x1, d_x2, d_x3


@stage("Vs", "d_x4", "d_x5", "d_x6")
def output(
    y: Any, V: Any, V0: Any, x4: Any, x5: Any, x6: Any, T5: Any, T6: Any, T7: Any, T8: Any, T9: Any, T10: Any,
    LSMAX: Any, LSMIN: Any, VCU: Any, VCL: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Lead-lags and limits, (1), (2)."""
    y4, d_x4 = lead_lag(x4, y, T5, T6, shortest)
    y5, d_x5 = lead_lag(x5, y4, T7, T8, shortest)
    y6, d_x6 = lead_lag(x6, y5, T9, T10, shortest)
    return cut_out(clip(y6, LSMIN, LSMAX), V - V0, VCL, VCU), d_x4, d_x5, d_x6


def start(v: Values) -> Start:
    """Equilibrium: the washout holds the sum of the inputs."""
    first, second = v["K1"] * at_start(v["IC1"], v), v["K2"] * at_start(v["IC2"], v)
    y = np.where(v["T3"] == 0, first + second, 0.0)
    states = {"xr": v["Vr"], "xi": v["Vi"], "x1": first, "x2": second, "x3": first + second}
    return Start({**states, "x4": y, "x5": y, "x6": y}, {"V0": v["V"]})


ST2CUT = Part(
    name="ST2CUT",
    slot="stabiliser",
    title="Stabiliser with two inputs and a cut-out",
    fields=FIELDS,
    stages=(transducers, output),
    ports=("Vs",),
    states=("xr", "xi", "x1", "x2", "x3", "x4", "x5", "x6"),
    setpoints=("V0",),
    start=start,
    rules=("T3 needs T4", "T5 needs T6", "T7 needs T8", "T9 needs T10"),
    formula="(1), (2)",
    source="PSS/E model library, ST2CUT",
)
