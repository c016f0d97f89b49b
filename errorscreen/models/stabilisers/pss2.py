r"""PSS2A and PSS2B, stabilisers with two inputs: the integral of accelerating power.

.. math::

    y_1 &= \frac{sT_{W1}}{1 + sT_{W1}}\,\frac{sT_{W2}}{1 + sT_{W2}}\,\frac{1}{1 + sT_6}\,u_1           & (1)\\
    y_2 &= \frac{sT_{W3}}{1 + sT_{W3}}\,\frac{sT_{W4}}{1 + sT_{W4}}\,\frac{K_{S2}}{1 + sT_7}\,u_2      & (2)\\
    y &= \Big(\frac{1 + sT_8}{(1 + sT_9)^M}\Big)^N (y_1 + K_{S3} y_2) - y_2                           & (3)\\
    V_s &= \Big[K_{S1}\frac{1 + sT_1}{1 + sT_2}\,\frac{1 + sT_3}{1 + sT_4}\,
        \frac{1 + sT_{10}}{1 + sT_{11}}\,y\Big]_{VSTMIN}^{VSTMAX}                                      & (4)

The inputs are those of `errorscreen.models.stabilisers.inputs`. A washout without a time constant passes its input on,
and N = 0 is a ramp-tracking filter that passes. The lead-lag of T10 and T11 and the limits of the two inputs
are those of PSS2B. The ramp-tracking filter has eight lags, so that :math:`M N \le 8`.

(IEEE Std 421.5-2016, type PSS2C without its additions; PSS/E model library, PSS2A and PSS2B.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, lead_lag, washout
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Part, Start, Values, record
from errorscreen.models.stabilisers.inputs import CODES, at_start, chosen

_HEAD = f"""\
    IC1 | code | 1    | - | {CODES}          | first input signal
    IB1 | bus  | 0    | - | any              | remote bus of the first input; the own terminal is used
    IC2 | code | 3    | - | {CODES}          | second input signal
    IB2 | bus  | 0    | - | any              | remote bus of the second input; the own terminal is used
    M   | code | 5    | - | 0, 1, 2, 3, 4, 5 | ramp-tracking filter, lags for each lead
    N   | code | 1    | - | 0, 1, 2, 3, 4    | ramp-tracking filter, leads; 0: none
    TW1 | s    | 10   | 1 .. 20 unless 0     | >= 0 | first washout of the first input; 0: none
    TW2 | s    | 10   | 1 .. 20 unless 0     | >= 0 | second washout of the first input; 0: none
    T6  | s    | 0    | -                    | >= 0 | lag of the first input
    TW3 | s    | 10   | 1 .. 20 unless 0     | >= 0 | first washout of the second input; 0: none
    TW4 | s    | 0    | - unless 0           | >= 0 | second washout of the second input; 0: none
    T7  | s    | 10   | 1 .. 20 unless 0     | >= 0 | lag of the second input
    KS2 | pu   | 1    | 0.05 .. 2            | any  | gain of the second input
    KS3 | pu   | 1    | -                    | any  | share of the second input before the ramp-tracking filter
    T8  | s    | 0.5  | -                    | >= 0 | lead of the ramp-tracking filter
    T9  | s    | 0.1  | -                    | >= 0 | lag of the ramp-tracking filter
    KS1 | pu   | 10   | 1 .. 40              | any  | gain
    T1  | s    | 0.15 | 0.05 .. 0.5 unless 0 | >= 0 | lead of the first lead-lag
    T2  | s    | 0.03 | -                    | >= 0 | lag of the first lead-lag
    T3  | s    | 0.15 | 0.05 .. 0.5 unless 0 | >= 0 | lead of the second lead-lag
    T4  | s    | 0.03 | -                    | >= 0 | lag of the second lead-lag
"""
_THIRD = """\
    T10    | s  | 0  | - | >= 0 | lead of the third lead-lag
    T11    | s  | 0  | - | >= 0 | lag of the third lead-lag
    VS1MAX | pu | 2  | limit | any  | upper limit of the first input
    VS1MIN | pu | -2 | limit | any  | lower limit of the first input
    VS2MAX | pu | 2  | limit | any  | upper limit of the second input
    VS2MIN | pu | -2 | limit | any  | lower limit of the second input
"""
_TAIL = """\
    VSTMAX | pu | 0.1  | limit | >= 0 | upper limit of the output
    VSTMIN | pu | -0.1 | limit | <= 0 | lower limit of the output
"""
#: states of the ramp-tracking filter
_LAGS = tuple(f"r{k}" for k in range(1, 9))


@stage("u1", "u2", "d_xr", "d_xi")
def inputs(
    Vr: Any, Vi: Any, V: Any, omega: Any, P: Any, Pm: Any, xr: Any, xi: Any, IC1: Any, IC2: Any, f0: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Both inputs."""
    df, dV, d_xr, d_xi = measured_voltage(xr, xi, Vr, Vi, f0, shortest)
    return chosen(IC1, omega, df, P, Pm, V, dV), chosen(IC2, omega, df, P, Pm, V, dV), d_xr, d_xi


@stage("u1", "u2")
def limited_inputs(u1: Any, u2: Any, VS1MIN: Any, VS1MAX: Any, VS2MIN: Any, VS2MAX: Any) -> Any:
    """Limits of PSS2B."""
    return clip(u1, VS1MIN, VS1MAX), clip(u2, VS2MIN, VS2MAX)


@stage("y1", "y2", "d_w1", "d_w2", "d_w3", "d_w4", "d_x6", "d_x7")
def transducers(
    u1: Any, u2: Any, w1: Any, w2: Any, w3: Any, w4: Any, x6: Any, x7: Any, TW1: Any, TW2: Any, T6: Any, TW3: Any,
    TW4: Any, T7: Any, KS2: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Washouts and lags of the inputs, (1), (2)."""
    first, d_w1 = washout(w1, u1, TW1, shortest)
    second, d_w2 = washout(w2, first, TW2, shortest)
    y1, d_x6 = lag(x6, second, T6, shortest)
    third, d_w3 = washout(w3, u2, TW3, shortest)
    fourth, d_w4 = washout(w4, third, TW4, shortest)
    y2, d_x7 = lag(x7, fourth, T7, shortest)
    return y1, KS2 * y2, d_w1, d_w2, d_w3, d_w4, d_x6, d_x7


@register_jitable
def _element(x: Any, u: Any, k: Any, M: Any, N: Any, T8: Any, T9: Any, shortest: Any) -> Any:
    """Lag k of the ramp-tracking filter, with a lead where k is not above N; their order does not matter."""
    y, dx = lead_lag(x, u, select(k > N, 0.0, T8), T9, shortest)
    return select(k > M * N, u, y), dx


@stage("ramp", *(f"d_{name}" for name in _LAGS))
def ramp_tracking(
    y1: Any, y2: Any, r1: Any, r2: Any, r3: Any, r4: Any, r5: Any, r6: Any, r7: Any, r8: Any, M: Any, N: Any, KS3: Any,
    T8: Any, T9: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Ramp-tracking filter, (3)."""
    a, d_r1 = _element(r1, y1 + KS3 * y2, 1.0, M, N, T8, T9, shortest)
    b, d_r2 = _element(r2, a, 2.0, M, N, T8, T9, shortest)
    c, d_r3 = _element(r3, b, 3.0, M, N, T8, T9, shortest)
    d, d_r4 = _element(r4, c, 4.0, M, N, T8, T9, shortest)
    e, d_r5 = _element(r5, d, 5.0, M, N, T8, T9, shortest)
    f, d_r6 = _element(r6, e, 6.0, M, N, T8, T9, shortest)
    g, d_r7 = _element(r7, f, 7.0, M, N, T8, T9, shortest)
    h, d_r8 = _element(r8, g, 8.0, M, N, T8, T9, shortest)
    return h - y2, d_r1, d_r2, d_r3, d_r4, d_r5, d_r6, d_r7, d_r8


@stage("lead", "d_x1", "d_x2")
def lead_lags(
    ramp: Any, x1: Any, x2: Any, KS1: Any, T1: Any, T2: Any, T3: Any, T4: Any, shortest: Any
) -> Any:
    """Gain and two lead-lags, (4)."""
    first, d_x1 = lead_lag(x1, KS1 * ramp, T1, T2, shortest)
    second, d_x2 = lead_lag(x2, first, T3, T4, shortest)
    return second, d_x1, d_x2


@stage("lead", "d_x3")
def third_lead_lag(lead: Any, x3: Any, T10: Any, T11: Any, shortest: Any) -> Any:
    """Third lead-lag of PSS2B, (4)."""
    return lead_lag(x3, lead, T10, T11, shortest)


@stage("Vs")
def output(lead: Any, VSTMAX: Any, VSTMIN: Any) -> Any:
    """Limited output, (4)."""
    return (clip(lead, VSTMIN, VSTMAX),)


def _starting(v: Values, u1: Any, u2: Any) -> tuple[Values, Any]:
    """States at rest but those of the third lead-lag, and the signal at the end."""

    def washed(T: Any, u: Any) -> Any:
        return np.where(v["shortest"] > T, u, 0.0)

    first, third = washed(v["TW1"], u1), washed(v["TW3"], u2)
    second, fourth = washed(v["TW2"], first), washed(v["TW4"], third)
    total = second + v["KS3"] * v["KS2"] * fourth
    y = v["KS1"] * (total - v["KS2"] * fourth)
    states = {
        "xr": v["Vr"], "xi": v["Vi"], "w1": u1, "w2": first, "w3": u2, "w4": third, "x6": second, "x7": fourth,
        **dict.fromkeys(_LAGS, total), "x1": y, "x2": y,
    }  # fmt: skip
    return states, y


def start_2a(v: Values) -> Start:
    """Equilibrium of PSS2A."""
    return Start(_starting(v, at_start(v["IC1"], v), at_start(v["IC2"], v))[0], {})


def start_2b(v: Values) -> Start:
    """Equilibrium of PSS2B."""
    u1, u2 = (
        np.clip(at_start(v[f"IC{k}"], v), v[f"VS{k}MIN"], np.maximum(v[f"VS{k}MIN"], v[f"VS{k}MAX"]))
        for k in (1, 2)
    )
    states, y = _starting(v, u1, u2)
    return Start({**states, "x3": y}, {})


_STATES = ("xr", "xi", "w1", "w2", "w3", "w4", "x6", "x7", *_LAGS, "x1", "x2")
_RULES = ("M * N <= 8", "N needs M", "N needs T9", "T1 needs T2", "T3 needs T4")

PSS2A = Part(
    name="PSS2A",
    slot="stabiliser",
    title="Stabiliser with two inputs",
    fields=record(_HEAD + _TAIL),
    stages=(inputs, transducers, ramp_tracking, lead_lags, output),
    ports=("Vs",),
    states=_STATES,
    start=start_2a,
    rules=_RULES,
    formula="(1) to (4)",
    source="IEEE Std 421.5-2016, type PSS2C; PSS/E model library, PSS2A",
    checked="Dynawo (one value of its data is not that of its record)",
)
PSS2B = Part(
    name="PSS2B",
    slot="stabiliser",
    title="Stabiliser with two inputs, three lead-lags",
    fields=record(_HEAD + _THIRD + _TAIL),
    stages=(inputs, limited_inputs, transducers, ramp_tracking, lead_lags, third_lead_lag, output),
    ports=("Vs",),
    states=(*_STATES, "x3"),
    start=start_2b,
    rules=(*_RULES, "T10 needs T11", "VS1MIN <= VS1MAX", "VS2MIN <= VS2MAX"),
    formula="(1) to (4)",
    source="IEEE Std 421.5-2016, type PSS2C; PSS/E model library, PSS2B",
)
