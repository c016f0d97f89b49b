r"""Round-rotor machines GENROU and GENROE: a field and a damper winding in the d axis, two dampers in the q axis.

.. math::

    \psi''_d &= \frac{X'' - X_l}{X'_d - X_l} E'_q + \frac{X'_d - X''}{X'_d - X_l}\psi_{kd},\quad
    \psi''_q = \frac{X'' - X_l}{X'_q - X_l} E'_d + \frac{X'_q - X''}{X'_q - X_l}\psi_{kq}         & (R4)\\
    X_{ad}I_{fd} &= E'_q + (X_d - X'_d)\Big(I_d + \frac{X'_d - X''}{(X'_d - X_l)^2} e_d\Big) + S\psi''_d,\quad
    e_d = E'_q - \psi_{kd} - (X'_d - X_l) I_d                                               & (R5)\\
    T'_{d0}\,\dot E'_q &= E_{fd} - X_{ad}I_{fd},\quad T''_{d0}\,\dot\psi_{kd} = e_d              & (R6)\\
    T'_{q0}\,\dot E'_d &= -E'_d + (X_q - X'_q)\Big(I_q - \frac{X'_q - X''}{(X'_q - X_l)^2} e_q\Big)
        - S\psi''_q\frac{X_q - X_l}{X_d - X_l}                                            & (R7)\\
    T''_{q0}\,\dot\psi_{kq} &= e_q,\quad e_q = E'_d - \psi_{kq} + (X'_q - X_l) I_q               & (R8)

with :math:`S(|\psi''|)` quadratic in GENROU, :math:`S(u) = B([u - A]^+)^2/u`, and a power in GENROE,
:math:`S(u) = S_{1.0}\,u^{\ln(S_{1.2}/S_{1.0})/\ln 1.2}`, both through S(1.0) and S(1.2).
S(1.0) = 0 means no saturation, whatever S(1.2) is: so PSS/E runs a record with 0 and 1
(`errorscreen.bench.reference_models`).

(PSS/E model library, GENROU and GENROE; Milano, *Power System Modelling and Scripting*, 2010, section 15.1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import power, select
from errorscreen.models.blocks import longer, quadratic_saturation
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
    Tpqo = T'qo   | s  | 0.8  | 0.3 .. 3     | > 0  | q-axis transient open-circuit time constant
    Tppqo = T''qo | s  | 0.06 | 0.02 .. 0.2  | > 0  | q-axis subtransient open-circuit time constant
    H             | s  | 4.0  | 1.5 .. 9     | > 0  | inertia constant in MWs/MVA
    D             | pu | 0.0  | 0 .. 4       | >= 0 | damping, power per speed deviation
    Xd            | pu | 1.8  | 0.9 .. 2.6   | > 0  | d-axis synchronous reactance
    Xq            | pu | 1.7  | 0.8 .. 2.5   | > 0  | q-axis synchronous reactance
    Xpd = X'd     | pu | 0.3  | 0.15 .. 0.55 | > 0  | d-axis transient reactance
    Xpq = X'q     | pu | 0.5  | 0.25 .. 1.0  | > 0  | q-axis transient reactance
    Xpp = X''d    | pu | 0.22 | 0.12 .. 0.4  | > 0  | subtransient reactance of both axes
    Xl            | pu | 0.15 | -            | >= 0 | leakage reactance
    S10 = S(1.0)  | -  | 0.1  | 0.01 .. 0.3 unless 0 | >= 0 | saturation at flux 1.0
    S12 = S(1.2)  | -  | 0.4  | 0.03 .. 1.2 unless 0 | >= 0 | saturation at flux 1.2
    """
)


@stage("psi2d", "psi2q")
def subtransient(Eq1: Any, Ed1: Any, psikd: Any, psikq: Any, Xpd: Any, Xpq: Any, Xpp: Any, Xl: Any) -> Any:
    """Subtransient flux linkages, (R4)."""
    d, q = (Xpp - Xl) / (Xpd - Xl), (Xpp - Xl) / (Xpq - Xl)
    return d * Eq1 + (1.0 - d) * psikd, q * Ed1 + (1.0 - q) * psikq


@stage("S")
def quadratic(psi2d: Any, psi2q: Any, satA: Any, satB: Any) -> Any:
    """Saturation of GENROU."""
    psi = np.sqrt(psi2d * psi2d + psi2q * psi2q)
    return (quadratic_saturation(psi, satA, satB) / select(psi < 1e-6, 1e-6, psi),)


@stage("S")
def exponential(psi2d: Any, psi2q: Any, satA: Any, satB: Any) -> Any:
    """Saturation of GENROE: ``satA`` is the exponent, ``satB`` S(1.0)."""
    return (satB * power(np.sqrt(psi2d * psi2d + psi2q * psi2q), satA),)


@stage("If", "e_d")
def field_current(
    Eq1: Any, psikd: Any, psi2d: Any, Id: Any, S: Any, Xd: Any, Xpd: Any, Xpp: Any, Xl: Any
) -> Any:
    """Field current X_ad I_fd, equal to the field voltage at rest, (R5)."""
    e_d = Eq1 - psikd - (Xpd - Xl) * Id
    k = (Xpd - Xpp) / ((Xpd - Xl) * (Xpd - Xl))
    return Eq1 + (Xd - Xpd) * (Id + k * e_d) + S * psi2d, e_d


@stage("d_Eq1", "d_psikd", "d_Ed1", "d_psikq")
def rotor(
    Efd: Any, If: Any, e_d: Any, Ed1: Any, psikq: Any, psi2q: Any, Iq: Any, S: Any, Tpdo: Any, Tppdo: Any, Tpqo: Any,
    Tppqo: Any, Xd: Any, Xq: Any, Xpd: Any, Xpq: Any, Xpp: Any, Xl: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Windings of the rotor, (R6) to (R8); subtransient ones of at least ``shortest`` with a shorted stator."""
    e_q = Ed1 - psikq + (Xpq - Xl) * Iq
    k = (Xpq - Xpp) / ((Xpq - Xl) * (Xpq - Xl))
    d_Ed1 = (-Ed1 + (Xq - Xpq) * (Iq - k * e_q) - S * psi2q * (Xq - Xl) / (Xd - Xl)) / Tpqo
    return (
        (Efd - If) / Tpdo,
        e_d / longer(Tppdo, shortest * Xpd / Xpp),
        d_Ed1,
        e_q / longer(Tppqo, shortest * Xpq / Xpp),
    )


def _quadratic(v: Values) -> tuple[Any, Any]:
    return machine_saturation(v["S10"], v["S12"])


def exponential_constants(v: Values) -> tuple[Any, Any]:
    """Exponent and S(1.0) of the saturation by a power; none where S(1.0) or S(1.2) is zero."""
    saturates = (v["S10"] > 0) & (v["S12"] > 0)
    ratio = np.where(saturates, v["S12"], 1.0) / np.where(saturates, v["S10"], 1.0)
    return np.log(ratio) / np.log(1.2), np.where(saturates, v["S10"], 0.0)


def _starting(v: Values, constants: Any, saturation: Any) -> Start:
    r"""Equilibrium: ψ'' follows from the terminal, so S does; with it X_q is smaller, and the q axis is known.

    From (R7), (R8) at rest and (R1), :math:`V_d + R_a I_d = X_{qs} I_q` with
    :math:`X_{qs} = (X_q + S\kappa X'')/(1 + S\kappa)` and :math:`\kappa = (X_q - X_l)/(X_d - X_l)`.
    """
    voltage, current = phasors(v)
    behind = voltage + (v["Ra"] + 1j * v["Xpp"]) * current
    satA, satB = constants(v)
    (S,) = saturation(np.abs(behind), 0.0, satA, satB)
    share = S * (v["Xq"] - v["Xl"]) / (v["Xd"] - v["Xl"])
    Xqs = (v["Xq"] + share * v["Xpp"]) / (1.0 + share)
    delta = np.angle(voltage + (v["Ra"] + 1j * Xqs) * current)
    Id, Iq = in_rotor_frame(current, delta)
    psi2q, psi2d = in_rotor_frame(behind, delta)
    Ed1 = psi2q - (v["Xpq"] - v["Xpp"]) * Iq
    Eq1 = psi2d + (v["Xpd"] - v["Xpp"]) * Id
    Efd0 = Eq1 + (v["Xd"] - v["Xpd"]) * Id + S * psi2d
    states = {
        "delta": delta,
        "omega": np.ones_like(delta),
        "Eq1": Eq1,
        "psikd": Eq1 - (v["Xpd"] - v["Xl"]) * Id,
        "Ed1": Ed1,
        "psikq": Ed1 + (v["Xpq"] - v["Xl"]) * Iq,
    }
    return Start(states, {"Efd0": Efd0, "Pm0": psi2d * Iq + psi2q * Id, "satA": satA, "satB": satB})


def start_quadratic(v: Values) -> Start:
    """Equilibrium of GENROU."""
    return _starting(v, _quadratic, quadratic)


def start_exponential(v: Values) -> Start:
    """Equilibrium of GENROE."""
    return _starting(v, exponential_constants, exponential)


def _machine(name: str, title: str, saturation: Any, start: Any, rules: tuple[str, ...] = ()) -> Part:
    return Part(
        name=name,
        slot="machine",
        title=title,
        fields=FIELDS,
        stages=(subtransient, stator, saturation, field_current),
        ports=PORTS,
        states=("delta", "omega", "Eq1", "psikd", "Ed1", "psikq"),
        setpoints=("Efd0", "Pm0", "satA", "satB"),
        start=start,
        closing=(swing, rotor),
        rules=("Xl < Xpp <= Xpd <= Xd", "Xpp <= Xpq <= Xq", "S10 <= S12", *rules),
        formula="(R1) to (R8)",
        source=f"PSS/E model library, {name}",
        checked="OpenIPSL (one machine), PSS/E (three buses)"
        if name == "GENROU"
        else "OpenIPSL (one machine)",
    )


GENROU = _machine("GENROU", "Round-rotor machine, quadratic saturation", quadratic, start_quadratic)
GENROE = _machine(
    "GENROE",
    "Round-rotor machine, exponential saturation",
    exponential,
    start_exponential,
    ("S12 needs S10",),
)
