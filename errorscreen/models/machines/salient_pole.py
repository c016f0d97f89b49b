r"""Salient-pole machines GENSAL and GENSAE: a field and a damper winding in the d axis, one damper in the q axis.

With the stator and the swing equation of `errorscreen.models.machines.stator`:

.. math::

    \psi''_d &= \frac{X'' - X_l}{X'_d - X_l} E'_q + \frac{X'_d - X''}{X'_d - X_l}\psi_{kd}              & (S1)\\
    X_{ad}I_{fd} &= E'_q + (X_d - X'_d)\Big(I_d + \frac{X'_d - X''}{(X'_d - X_l)^2} e_d\Big) + s_d,\quad
    e_d = E'_q - \psi_{kd} - (X'_d - X_l) I_d                                               & (S2)\\
    T'_{d0}\,\dot E'_q &= E_{fd} - X_{ad}I_{fd},\quad T''_{d0}\,\dot\psi_{kd} = e_d              & (S3)\\
    T''_{q0}\,\dot\psi''_q &= (X_q - X'') I_q - \psi''_q - s_q                                 & (S4)

GENSAL saturates in the d axis alone, by its transient voltage and the quadratic :math:`S(u) = B([u - A]^+)^2/u`; GENSAE
saturates in both axes, by the subtransient flux and a power:

.. math::

    s_d &= S(E'_q)\,E'_q,\quad s_q = 0                                                       & (S5)\\
    s_d &= S(|\psi''|)\,\psi''_d,\quad s_q = S(|\psi''|)\,\psi''_q\frac{X_q - X_l}{X_d - X_l},\quad
    S(u) = S_{1.0}\,u^{\ln(S_{1.2}/S_{1.0})/\ln 1.2}                                          & (S6)

(PSS/E model library, GENSAL and GENSAE; Kundur, *Power System Stability and Control*, 1994, section 3.8.)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from errorscreen.engine.stages import Equations, stage
from errorscreen.models.blocks import longer, quadratic_saturation
from errorscreen.models.machines.round_rotor import exponential, exponential_constants
from errorscreen.models.machines.stator import (
    PORTS,
    in_rotor_frame,
    machine_saturation,
    phasors,
    stator,
    swing,
)
from errorscreen.models.part import Part, Start, Values, record

FIELDS = record(
    """
    Tpdo = T'do   | s  | 6.0  | 3 .. 12      | > 0  | d-axis transient open-circuit time constant
    Tppdo = T''do | s  | 0.04 | 0.02 .. 0.1  | > 0  | d-axis subtransient open-circuit time constant
    Tppqo = T''qo | s  | 0.06 | 0.02 .. 0.2  | > 0  | q-axis subtransient open-circuit time constant
    H             | s  | 4.0  | 1.5 .. 9     | > 0  | inertia constant in MWs/MVA
    D             | pu | 0.0  | 0 .. 4       | >= 0 | damping, power per speed deviation
    Xd            | pu | 1.1  | 0.6 .. 1.9   | > 0  | d-axis synchronous reactance
    Xq            | pu | 0.7  | 0.4 .. 1.8   | > 0  | q-axis synchronous reactance
    Xpd = X'd     | pu | 0.3  | 0.2 .. 0.5   | > 0  | d-axis transient reactance
    Xpp = X''d    | pu | 0.22 | 0.14 .. 0.35 | > 0  | subtransient reactance of both axes
    Xl            | pu | 0.15 | -            | >= 0 | leakage reactance
    S10 = S(1.0)  | -  | 0.1  | 0 .. 0.3 unless 0 | >= 0 | saturation at flux 1.0
    S12 = S(1.2)  | -  | 0.4  | 0 .. 1.2 unless 0 | >= 0 | saturation at flux 1.2
    """
)


@stage("psi2d")
def subtransient(Eq1: Any, psikd: Any, Xpd: Any, Xpp: Any, Xl: Any) -> Any:
    """Subtransient flux linkage of the d axis, (S1); that of the q axis is a state."""
    d = (Xpp - Xl) / (Xpd - Xl)
    return (d * Eq1 + (1.0 - d) * psikd,)


@stage("s_d", "s_q")
def saturation_of_one_axis(Eq1: Any, satA: Any, satB: Any) -> Any:
    """Saturation of GENSAL, (S5)."""
    return quadratic_saturation(Eq1, satA, satB), 0.0 * Eq1


@stage("s_d", "s_q")
def saturation_of_both_axes(psi2d: Any, psi2q: Any, S: Any, Xd: Any, Xq: Any, Xl: Any) -> Any:
    """Saturation of GENSAE, (S6)."""
    return S * psi2d, S * psi2q * (Xq - Xl) / (Xd - Xl)


@stage("If", "e_d")
def field_current(Eq1: Any, psikd: Any, Id: Any, s_d: Any, Xd: Any, Xpd: Any, Xpp: Any, Xl: Any) -> Any:
    """Field current X_ad I_fd, equal to the field voltage at rest, (S2)."""
    e_d = Eq1 - psikd - (Xpd - Xl) * Id
    k = (Xpd - Xpp) / ((Xpd - Xl) * (Xpd - Xl))
    return Eq1 + (Xd - Xpd) * (Id + k * e_d) + s_d, e_d


@stage("d_Eq1", "d_psikd", "d_psi2q")
def rotor(
    Efd: Any, If: Any, e_d: Any, psi2q: Any, Iq: Any, s_q: Any, Tpdo: Any, Tppdo: Any, Tppqo: Any, Xq: Any, Xpd: Any,
    Xpp: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Windings of the rotor, (S3) and (S4); the subtransient ones last ``shortest`` at least with a shorted stator."""
    return (
        (Efd - If) / Tpdo,
        e_d / longer(Tppdo, shortest * Xpd / Xpp),
        ((Xq - Xpp) * Iq - psi2q - s_q) / longer(Tppqo, shortest * Xq / Xpp),
    )


def _starting(v: Values, Xqs: Any, satA: Any, satB: Any, saturation: Callable[[Any, Any], Any]) -> Start:
    """Equilibrium with the q-axis reactance that saturation leaves; ``saturation`` gives s_d of E'q and ψ''d."""
    voltage, current = phasors(v)
    delta = np.angle(voltage + (v["Ra"] + 1j * Xqs) * current)
    Id, Iq = in_rotor_frame(current, delta)
    psi2q, psi2d = in_rotor_frame(voltage + (v["Ra"] + 1j * v["Xpp"]) * current, delta)
    Eq1 = psi2d + (v["Xpd"] - v["Xpp"]) * Id
    states = {
        "delta": delta,
        "omega": np.ones_like(delta),
        "Eq1": Eq1,
        "psikd": Eq1 - (v["Xpd"] - v["Xl"]) * Id,
        "psi2q": psi2q,
    }
    Efd0 = Eq1 + (v["Xd"] - v["Xpd"]) * Id + saturation(Eq1, psi2d)
    return Start(states, {"Efd0": Efd0, "Pm0": psi2d * Iq + psi2q * Id, "satA": satA, "satB": satB})


def start_quadratic(v: Values) -> Start:
    """Equilibrium of GENSAL, whose q axis does not saturate."""
    satA, satB = machine_saturation(v["S10"], v["S12"])
    return _starting(v, v["Xq"], satA, satB, lambda Eq1, psi2d: quadratic_saturation(Eq1, satA, satB))


def start_exponential(v: Values) -> Start:
    r"""Equilibrium of GENSAE: ψ'' follows from the terminal, so S does, and with it the q axis.

    From (S4) at rest, :math:`V_d + R_a I_d = X_{qs} I_q` with :math:`X_{qs} = X'' + (X_q - X'')/(1 + S\kappa)` and
    :math:`\kappa = (X_q - X_l)/(X_d - X_l)`.
    """
    voltage, current = phasors(v)
    satA, satB = exponential_constants(v)
    (S,) = exponential(np.abs(voltage + (v["Ra"] + 1j * v["Xpp"]) * current), 0.0, satA, satB)
    share = S * (v["Xq"] - v["Xl"]) / (v["Xd"] - v["Xl"])
    Xqs = v["Xpp"] + (v["Xq"] - v["Xpp"]) / (1.0 + share)
    return _starting(v, Xqs, satA, satB, lambda Eq1, psi2d: S * psi2d)


def _machine(
    name: str,
    title: str,
    saturation: tuple[Equations, ...],
    start: Callable[[Values], Start],
    formula: str,
    rules: tuple[str, ...],
    checked: str,
) -> Part:
    return Part(
        name=name,
        slot="machine",
        title=title,
        fields=FIELDS,
        stages=(subtransient, stator, *saturation, field_current),
        ports=PORTS,
        states=("delta", "omega", "Eq1", "psikd", "psi2q"),
        setpoints=("Efd0", "Pm0", "satA", "satB"),
        start=start,
        closing=(swing, rotor),
        rules=("Xl < Xpp <= Xpd <= Xd", "Xpp <= Xq", "S10 <= S12", *rules),
        formula=formula,
        source=f"PSS/E model library, {name}",
        checked=checked,
    )


GENSAL = _machine(
    "GENSAL",
    "Salient-pole machine, quadratic saturation",
    (saturation_of_one_axis,),
    start_quadratic,
    "(S1) to (S5)",
    (),
    "OpenIPSL (one machine), PSS/E (three buses)",
)
GENSAE = _machine(
    "GENSAE",
    "Salient-pole machine, exponential saturation",
    (exponential, saturation_of_both_axes),
    start_exponential,
    "(S1) to (S4), (S6)",
    ("S12 needs S10",),
    "",
)
