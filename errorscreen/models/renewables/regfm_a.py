r"""REGFMA1, grid-forming converter with droop (WECC REGFM_A1).

With P, Q and V behind the filters TPf, TQf and TVf, :math:`[\cdot]^-` and :math:`[\cdot]^+` the negative and the
positive part:

.. math::

    \dot\delta &= 2\pi f_0\,\Big(m_p(P_{ref} - P_f) + \Big[k_{ppmax} u_1 + \frac{k_{ipmax}}{s} u_1\Big]^-
        + \Big[k_{ppmax} u_2 + \frac{k_{ipmax}}{s} u_2\Big]^+\Big),\quad
    u_1 = P_{max} - P_f,\ u_2 = P_{min} - P_f                                                          & (1)\\
    V^* &= V_{set} + q - m_q(Q_f - Q_0)
        + \Big[k_{pqmax} w_1 + \frac{k_{iqmax}}{s} w_1\Big]^- + \Big[k_{pqmax} w_2 + \frac{k_{iqmax}}{s} w_2\Big]^+,
    \quad w_1 = Q_{max} - Q_f,\ w_2 = Q_{min} - Q_f                                                     & (2)\\
    E &= \Big[\Big(k_{pv} + \frac{k_{iv}}{s}\Big)(V^* - V_f)\ \text{if VFlag, else}\ V^*\Big]_{Emin}^{Emax} & (3)\\
    I &= \frac{E\,e^{j\delta} - V}{jX_{source}},\quad |I| \le I_{max},\quad P + jQ = V I^*                & (4)

Beyond :math:`I_{max}` the current keeps its angle. The integrals of (1) and (2) stay on their side of zero, that of (3)
between Emin and Emax. :math:`q` is how far the reactive reference of a plant has moved since the start, a voltage with
QVFlag = 1 and times :math:`m_q` with QVFlag = 0; the meaning of that flag is our reading. A filter lasts at least
``shortest``. The reactance is that of the generator in the file of the network (``Xsource``); its resistance is left
out.

Behind an impedance R + jX from the voltage :math:`V'`, the limit of the current is a larger reactance, because both
voltage drops are in quadrature to the current:

.. math::

    I &= \frac{E\,e^{j\delta} - V'}{R + jX_I},\quad X_I = X + X_{source},\quad
    X_I = \sqrt{|E\,e^{j\delta} - V'|^2/I_{max}^2 - R^2}\ \text{where}\ |I| > I_{max}                    & (5)

(W. Du, *Model Specification of Droop-Controlled, Grid-Forming Inverters (REGFM_A1)*, PNNL-35110, 2023; PSS/E model
library, REGFMA1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select, sincos
from errorscreen.models.blocks import longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    VFlag  | code | 1    | -                   | 0, 1 | 1: control of the terminal voltage, 0: of the internal one
    QVFlag | code | 1    | -                   | 0, 1 | signal of a plant: 1 voltage, 0 reactive power
    TPf    | s    | 0.02 | 0.005 .. 0.1 unless 0 | >= 0 | filter of the active power
    TQf    | s    | 0.02 | 0.005 .. 0.1 unless 0 | >= 0 | filter of the reactive power
    TVf    | s    | 0.02 | -                   | >= 0 | filter of the voltage
    Imax   | pu   | 2    | 1 .. 3              | > 0  | limit of the current
    Emax   | pu   | 1.15 | limit               | any  | upper limit of the internal voltage
    Emin   | pu   | 0    | limit               | any  | lower limit of the internal voltage
    Pmax   | pu   | 1    | limit               | any  | upper limit of the active power
    Pmin   | pu   | 0    | limit               | any  | lower limit of the active power
    Qmax   | pu   | 0.44 | limit               | any  | upper limit of the reactive power
    Qmin   | pu   | -0.44 | limit              | any  | lower limit of the reactive power
    mp     | pu   | 0.01 | 0.005 .. 0.05       | >= 0 | droop of the frequency
    mq     | pu   | 0.05 | 0.01 .. 0.2         | >= 0 | droop of the voltage
    kppmax | pu   | 0.01 | -                   | >= 0 | limit of active power, proportional
    kipmax | pu/s | 0.1  | -                   | >= 0 | limit of active power, integral
    kpqmax | pu   | 3    | -                   | >= 0 | limit of reactive power, proportional
    kiqmax | pu/s | 20   | -                   | >= 0 | limit of reactive power, integral
    kpv    | pu   | 0    | 0.1 .. 5 unless 0   | >= 0 | control of voltage, proportional
    kiv    | pu/s | 5.86 | 1 .. 20 unless 0    | >= 0 | control of voltage, integral
    """
)
#: stands for no limit
_NONE = 1e6


@register_jitable
def one_sided(x: Any, u: Any, KP: Any, KI: Any, lower: Any, upper: Any) -> Any:
    """Proportional and integral block whose output and whose integral x are limited: output and derivative.

    Examples
    --------
    >>> [float(value) for value in one_sided(-0.2, 0.1, 1.0, 3.0, -1.0, 0.0)]
    [-0.1, 0.30000000000000004]
    >>> [float(value) for value in one_sided(0.0, 0.1, 1.0, 3.0, -1.0, 0.0)]
    [0.0, 0.0]
    """
    return clip(x + KP * u, lower, upper), hold_at_limits(x, KI * u, lower, upper)


@register_jitable
def inner_voltage(
    Qf: Any, Vf: Any, xv: Any, xu: Any, xl: Any, Vset: Any, Q0: Any, lowE: Any, highE: Any, lowQ: Any, highQ: Any,
    Qmove: Any, VFlag: Any, mq: Any, kpqmax: Any, kiqmax: Any, kpv: Any, kiv: Any,
) -> Any:  # fmt: skip
    """Internal voltage and the derivatives of its controls, (2), (3)."""
    above, d_xu = one_sided(xu, highQ - Qf, kpqmax, kiqmax, -_NONE, 0.0)
    below, d_xl = one_sided(xl, lowQ - Qf, kpqmax, kiqmax, 0.0, _NONE)
    wanted = Vset + Qmove - mq * (Qf - Q0) + above + below
    controlled, d_xv = one_sided(xv, wanted - Vf, kpv, kiv, lowE, highE)
    inner = VFlag == 1.0
    return select(inner, controlled, clip(wanted, lowE, highE)), select(inner, d_xv, 0.0), d_xu, d_xl


@stage("V", "P", "Q", "E", "d_xv", "d_xu", "d_xl")
def terminal(
    Vr: Any, Vi: Any, delta: Any, Qf: Any, Vf: Any, xv: Any, xu: Any, xl: Any, Vset: Any, Q0: Any, lowE: Any,
    highE: Any, lowQ: Any, highQ: Any, highI: Any, Qmove: Any, VFlag: Any, mq: Any, kpqmax: Any, kiqmax: Any, kpv: Any,
    kiv: Any, Xsource: Any,
) -> Any:  # fmt: skip
    """Internal voltage, and the power that it drives through the reactance, (2) to (4)."""
    E, d_xv, d_xu, d_xl = inner_voltage(
        Qf, Vf, xv, xu, xl, Vset, Q0, lowE, highE, lowQ, highQ, Qmove, VFlag, mq, kpqmax, kiqmax, kpv, kiv
    )
    s, c = sincos(delta)
    Ir, Ii = (E * s - Vi) / Xsource, (Vr - E * c) / Xsource
    size = np.sqrt(Ir * Ir + Ii * Ii)
    share = select(size > highI, highI / clip(size, 1e-6, _NONE), 1.0)
    P, Q = share * (Vr * Ir + Vi * Ii), share * (Vi * Ir - Vr * Ii)
    return np.sqrt(Vr * Vr + Vi * Vi), P, Q, E, d_xv, d_xu, d_xl


@stage("Ir", "Ii")
def behind(
    Er: Any, Ei: Any, R_grid: Any, X_grid: Any, delta: Any, Qf: Any, Vf: Any, xv: Any, xu: Any, xl: Any, Vset: Any,
    Q0: Any, lowE: Any, highE: Any, lowQ: Any, highQ: Any, highI: Any, Qmove: Any, VFlag: Any, mq: Any, kpqmax: Any,
    kiqmax: Any, kpv: Any, kiv: Any, Xsource: Any,
) -> Any:  # fmt: skip
    """Current behind an impedance, (4), (5)."""
    E, _v, _u, _l = inner_voltage(
        Qf, Vf, xv, xu, xl, Vset, Q0, lowE, highE, lowQ, highQ, Qmove, VFlag, mq, kpqmax, kiqmax, kpv, kiv
    )
    s, c = sincos(delta)
    Dr, Di = E * c - Er, E * s - Ei
    X = Xsource + X_grid
    apart, free = Dr * Dr + Di * Di, R_grid * R_grid + X * X
    beyond = apart > highI * highI * free
    drop = R_grid * highI
    rest = np.sqrt(clip(apart - drop * drop, 0.0, _NONE))  # (X I + Xsource rho) at the limit
    X = select(beyond, rest / highI, X)
    square = R_grid * R_grid + X * X
    return (R_grid * Dr + X * Di) / square, (R_grid * Di - X * Dr) / square


@stage("d_delta", "d_Pf", "d_Qf", "d_Vf", "d_xh", "d_xm", "d_Qmove")
def droop(
    V: Any, P: Any, Q: Any, Pref: Any, Qext: Any, Pf: Any, Qf: Any, Vf: Any, xh: Any, xm: Any, Qmove: Any, Q0: Any,
    lowP: Any, highP: Any, QVFlag: Any, TPf: Any, TQf: Any, TVf: Any, mp: Any, mq: Any, kppmax: Any, kipmax: Any,
    f0: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Angle and filters, (1); the signal of a plant arrives within ``shortest``."""
    above, d_xh = one_sided(xh, highP - Pf, kppmax, kipmax, -_NONE, 0.0)
    below, d_xm = one_sided(xm, lowP - Pf, kppmax, kipmax, 0.0, _NONE)
    moved = select(QVFlag == 1.0, 1.0, mq) * (Qext - Q0)
    return (
        6.283185307179586 * f0 * (mp * (Pref - Pf) + above + below),
        (P - Pf) / longer(TPf, shortest),
        (Q - Qf) / longer(TQf, shortest),
        (V - Vf) / longer(TVf, shortest),
        d_xh,
        d_xm,
        (moved - Qmove) / shortest,
    )


def start(v: Values) -> Start:
    """Equilibrium at V, P and Q."""
    V, P, Q = v["V"], v["P"], v["Q"]
    current = np.conj((P + 1j * Q) / (v["Vr"] + 1j * v["Vi"]))
    source = v["Vr"] + 1j * v["Vi"] + 1j * v["Xsource"] * current
    E, zero = np.abs(source), 0.0 * V
    lowE, highE = holding(E, v["Emin"], v["Emax"])
    lowP, highP = holding(P, v["Pmin"], v["Pmax"])
    lowQ, highQ = holding(Q, v["Qmin"], v["Qmax"])
    size = np.abs(current)
    return Start(
        {
            "delta": np.angle(source), "Pf": P, "Qf": Q, "Vf": V, "xv": E, "xh": zero, "xm": zero, "xu": zero,
            "xl": zero, "Qmove": zero,
        },
        {
            "Ip0": P / V, "Iq0": Q / V, "Q0": Q, "Vset": np.where(v["VFlag"] == 1, V, E), "lowE": lowE, "highE": highE,
            "lowP": lowP, "highP": highP, "lowQ": lowQ, "highQ": highQ,
            "highI": np.maximum(size * (1 + 1e-9), v["Imax"]),
        },
        (
            Limit("internal voltage", E, v["Emin"], v["Emax"], ("Emin", "Emax")),
            Limit("active power", P, v["Pmin"], v["Pmax"], ("Pmin", "Pmax")),
            Limit("reactive power", Q, v["Qmin"], v["Qmax"], ("Qmin", "Qmax")),
            Limit("current", size, 0.0, v["Imax"], ("", "Imax")),
        ),
    )  # fmt: skip


REGFMA1 = Part(
    name="REGFMA1",
    slot="converter",
    title="Grid-forming converter with droop",
    fields=FIELDS,
    stages=(terminal,),
    closing=(droop,),
    ports=("V", "P", "Q", "Ip0", "Iq0"),
    states=("delta", "Pf", "Qf", "Vf", "xv", "xh", "xm", "xu", "xl", "Qmove"),
    setpoints=("Ip0", "Iq0", "Q0", "Vset", "lowE", "highE", "lowP", "highP", "lowQ", "highQ", "highI"),
    start=start,
    rules=("Emin < Emax", "Pmin <= Pmax", "Qmin <= Qmax"),
    formula="(1) to (4)",
    source="WECC REGFM_A1; PSS/E model library, REGFMA1",
    behind=behind,
)
