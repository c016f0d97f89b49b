r"""GENTPJ1, machine whose mutual reactances all saturate, by the air-gap flux and the current (WECC type J).

Saturation divides every reactance but the leakage, in place of a term that is added to the field current:

.. math::

    u &= |V + (R_a + jX_l) I| + K_{is}|I|,\quad S = B([u - A]^+)^2/u,\quad
    S_d = 1 + S,\quad S_q = 1 + S\,X_q/X_d                                                             & (J1)\\
    X''_{ds} &= X_l + (X''_d - X_l)/S_d,\quad X''_{qs} = X_l + (X''_q - X_l)/S_q                          & (J2)\\
    V_d &= E''_d + X''_{qs} I_q - R_a I_d,\quad V_q = E''_q - X''_{ds} I_d - R_a I_q                         & (J3)\\
    X_{ad}I_{fd} &= S_d\Big(E'_q + \frac{X_d - X'_d}{X'_d - X''_d}(E'_q - E''_q)\Big),\quad
    T'_{d0}\,\dot E'_q = E_{fd} - X_{ad}I_{fd}                                                      & (J4)\\
    T''_{d0}\,\dot E''_q &= S_d (E'_q - E''_q) - (X'_d - X''_d) I_d                                       & (J5)\\
    T'_{q0}\,\dot E'_d &= -S_q\Big(E'_d + \frac{X_q - X'_q}{X'_q - X''_q}(E'_d - E''_d)\Big)                & (J6)\\
    T''_{q0}\,\dot E''_d &= S_q (E'_d - E''_d) + (X'_q - X''_q) I_q                                       & (J7)

E''_d and E''_q stand as ψ''_q and ψ''_d of the other machines. The saturation depends on the current and the current on
the saturation; the loop is solved by three steps of Steffensen's method, which lands on the solution to rounding in
usual conditions. Without transient winding in the q axis (T'qo = 0), (J6) at rest gives E'_d. K_is = 0 is GENTPF.

(PSS/E model library, GENTPJ1; J. Undrill, *The Gentpj Model*, WECC, 2007, updated 2012; the quadratic saturation is
that of the other machines of PSS/E.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import select, sincos
from errorscreen.models.blocks import longer, quadratic_saturation
from errorscreen.models.machines.stator import PORTS, in_rotor_frame, machine_saturation, phasors, swing
from errorscreen.models.part import Part, Start, Values, record

FIELDS = record(
    """
    Tpdo = T'do   | s  | 6.0  | 3 .. 12      | > 0  | d-axis transient open-circuit time constant
    Tppdo = T''do | s  | 0.04 | 0.02 .. 0.1  | > 0  | d-axis subtransient open-circuit time constant
    Tpqo = T'qo   | s  | 0.8  | 0.3 .. 3 unless 0 | >= 0 | q-axis transient open-circuit time constant; 0: no winding
    Tppqo = T''qo | s  | 0.06 | 0.02 .. 0.2  | > 0  | q-axis subtransient open-circuit time constant
    H             | s  | 4.0  | 1.5 .. 9     | > 0  | inertia constant in MWs/MVA
    D             | pu | 0.0  | 0 .. 4       | >= 0 | damping, power per speed deviation
    Xd            | pu | 1.8  | 0.6 .. 2.6   | > 0  | d-axis synchronous reactance
    Xq            | pu | 1.7  | 0.4 .. 2.5   | > 0  | q-axis synchronous reactance
    Xpd = X'd     | pu | 0.3  | 0.15 .. 0.55 | > 0  | d-axis transient reactance
    Xpq = X'q     | pu | 0.5  | 0.25 .. 1.0  | > 0  | q-axis transient reactance
    Xppd = X''d   | pu | 0.22 | 0.12 .. 0.4  | > 0  | d-axis subtransient reactance
    Xppq = X''q   | pu | 0.22 | 0.12 .. 0.4  | > 0  | q-axis subtransient reactance
    Xl            | pu | 0.15 | -            | >= 0 | leakage reactance
    S10 = S(1.0)  | -  | 0.1  | 0 .. 0.3 unless 0 | >= 0 | saturation at flux 1.0
    S12 = S(1.2)  | -  | 0.4  | 0 .. 1.2 unless 0 | >= 0 | saturation at flux 1.2
    Kis           | pu | 0.0  | 0 .. 0.2 unless 0 | >= 0 | share of the current in what saturates
    """
)


@register_jitable
def _currents(
    S: Any, psi2d: Any, psi2q: Any, Vd: Any, Vq: Any, Ra: Any, Xd: Any, Xq: Any, Xppd: Any, Xppq: Any, Xl: Any
) -> Any:  # fmt: skip
    """Currents for a given saturation: (J3), solved."""
    Xds, Xqs = Xl + (Xppd - Xl) / (1.0 + S), Xl + (Xppq - Xl) / (1.0 + S * Xq / Xd)
    det = Ra * Ra + Xds * Xqs
    return (Ra * (psi2q - Vd) + Xqs * (psi2d - Vq)) / det, (Ra * (psi2d - Vq) - Xds * (psi2q - Vd)) / det


@register_jitable
def _saturation(
    Id: Any, Iq: Any, Vd: Any, Vq: Any, Ra: Any, Xl: Any, Kis: Any, satA: Any, satB: Any
) -> Any:  # fmt: skip
    """Saturation of voltage and current, (J1)."""
    d, q = Vd + Ra * Id - Xl * Iq, Vq + Ra * Iq + Xl * Id
    u = np.sqrt(d * d + q * q) + Kis * np.sqrt(Id * Id + Iq * Iq)
    return quadratic_saturation(u, satA, satB) / select(u < 1e-6, 1e-6, u)


@register_jitable
def _improved(
    S: Any, psi2d: Any, psi2q: Any, Vd: Any, Vq: Any, Ra: Any, Xd: Any, Xq: Any, Xppd: Any, Xppq: Any, Xl: Any,
    Kis: Any, satA: Any, satB: Any,
) -> Any:  # fmt: skip
    """One step of Steffensen's method towards the saturation that its own currents give."""
    Id, Iq = _currents(S, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl)
    first = _saturation(Id, Iq, Vd, Vq, Ra, Xl, Kis, satA, satB)
    Id, Iq = _currents(first, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl)
    second = _saturation(Id, Iq, Vd, Vq, Ra, Xl, Kis, satA, satB)
    curvature = second - 2.0 * first + S
    small = np.abs(curvature) < 1e-14
    step = (second - first) * (second - first) / select(small, 1.0, curvature)
    found = second - select(small, 0.0, step)
    return select(found < 0.0, second, found)


@stage("Vd", "Vq", "Id", "Iq", "P", "Q", "V", "It", "Te", "S")
def stator(
    delta: Any, psi2d: Any, psi2q: Any, Vr: Any, Vi: Any, Ra: Any, Xd: Any, Xq: Any, Xppd: Any, Xppq: Any, Xl: Any,
    Kis: Any, satA: Any, satB: Any,
) -> Any:  # fmt: skip
    """Terminal voltage in the rotor frame, saturation, currents, power and torque: (J1) to (J3)."""
    s, c = sincos(delta)
    Vd = Vr * s - Vi * c
    Vq = Vr * c + Vi * s
    S = _improved(0.0 * delta, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl, Kis, satA, satB)
    S = _improved(S, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl, Kis, satA, satB)
    S = _improved(S, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl, Kis, satA, satB)
    Id, Iq = _currents(S, psi2d, psi2q, Vd, Vq, Ra, Xd, Xq, Xppd, Xppq, Xl)
    P = Vd * Id + Vq * Iq
    squared = Id * Id + Iq * Iq
    return (
        Vd,
        Vq,
        Id,
        Iq,
        P,
        Vq * Id - Vd * Iq,
        np.sqrt(Vr * Vr + Vi * Vi),
        np.sqrt(squared),
        P + Ra * squared,
        S,
    )


@stage("If")
def field_current(Eq1: Any, psi2d: Any, S: Any, Xd: Any, Xpd: Any, Xppd: Any) -> Any:
    """Field current X_ad I_fd, equal to the field voltage at rest, (J4)."""
    return ((1.0 + S) * (Eq1 + (Xd - Xpd) / (Xpd - Xppd) * (Eq1 - psi2d)),)


@stage("d_Eq1", "d_psi2d", "d_Ed1", "d_psi2q")
def rotor(
    Efd: Any, If: Any, Eq1: Any, psi2d: Any, Ed1: Any, psi2q: Any, Id: Any, Iq: Any, S: Any, Tpdo: Any, Tppdo: Any,
    Tpqo: Any, Tppqo: Any, Xd: Any, Xq: Any, Xpd: Any, Xpq: Any, Xppd: Any, Xppq: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Windings of the rotor, (J4) to (J7); the subtransient ones last ``shortest`` at least with a shorted stator."""
    Sd, Sq = 1.0 + S, 1.0 + S * Xq / Xd
    at_rest = (Xq - Xpq) / (Xq - Xppq) * psi2q
    winding = Tpqo >= shortest
    E = select(winding, Ed1, at_rest)
    d_Ed1 = -Sq * (E + (Xq - Xpq) / (Xpq - Xppq) * (E - psi2q)) / longer(Tpqo, shortest)
    return (
        (Efd - If) / Tpdo,
        (Sd * (Eq1 - psi2d) - (Xpd - Xppd) * Id) / longer(Tppdo, shortest * Xpd / Xppd),
        select(winding, d_Ed1, (at_rest - Ed1) / shortest),
        (Sq * (E - psi2q) + (Xpq - Xppq) * Iq) / longer(Tppqo, shortest * Xpq / Xppq),
    )


def start(v: Values) -> Start:
    r"""Equilibrium: the saturation follows from the terminal, and :math:`V_d + R_a I_d = X_{qs} I_q`.

    From (J6), (J7) at rest, :math:`X_{qs} = X_l + (X_q - X_l)/S_q`.
    """
    voltage, current = phasors(v)
    satA, satB = machine_saturation(v["S10"], v["S12"])
    u = np.abs(voltage + (v["Ra"] + 1j * v["Xl"]) * current) + v["Kis"] * np.abs(current)
    S = quadratic_saturation(u, satA, satB) / np.maximum(u, 1e-6)
    Sd, Sq = 1.0 + S, 1.0 + S * v["Xq"] / v["Xd"]
    Xqs = v["Xl"] + (v["Xq"] - v["Xl"]) / Sq
    delta = np.angle(voltage + (v["Ra"] + 1j * Xqs) * current)
    Id, Iq = in_rotor_frame(current, delta)
    Vd, Vq = in_rotor_frame(voltage, delta)
    psi2d = Vq + v["Ra"] * Iq + (v["Xl"] + (v["Xppd"] - v["Xl"]) / Sd) * Id
    psi2q = Vd + v["Ra"] * Id - (v["Xl"] + (v["Xppq"] - v["Xl"]) / Sq) * Iq
    Eq1 = psi2d + (v["Xpd"] - v["Xppd"]) * Id / Sd
    states = {
        "delta": delta,
        "omega": np.ones_like(delta),
        "Eq1": Eq1,
        "psi2d": psi2d,
        "Ed1": psi2q - (v["Xpq"] - v["Xppq"]) * Iq / Sq,
        "psi2q": psi2q,
    }
    Efd0 = Sd * (Eq1 + (v["Xd"] - v["Xpd"]) * Id / Sd)
    Pm0 = Vd * Id + Vq * Iq + v["Ra"] * (Id * Id + Iq * Iq)
    return Start(states, {"Efd0": Efd0, "Pm0": Pm0, "satA": satA, "satB": satB})


GENTPJ1 = Part(
    name="GENTPJ1",
    slot="machine",
    title="Machine with saturation of all mutual reactances",
    fields=FIELDS,
    stages=(stator, field_current),
    ports=PORTS,
    states=("delta", "omega", "Eq1", "psi2d", "Ed1", "psi2q"),
    setpoints=("Efd0", "Pm0", "satA", "satB"),
    start=start,
    closing=(swing, rotor),
    rules=("Xl < Xppd < Xpd <= Xd", "Xl < Xppq < Xpq <= Xq", "S10 <= S12"),
    formula="(J1) to (J7)",
    source="PSS/E model library, GENTPJ1; Undrill, WECC 2012",
    aliases=("GENTPJ",),
)
