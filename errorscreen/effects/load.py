r"""Loads other than constant impedances: dependence on voltage and frequency, and motors.

In per unit of the load's apparent power, with the quantities of `errorscreen.models.loads.load`:

.. math::

    \Delta P &= P_0 (r/\rho)^2 s\,\big(c\rho + 1 - c - \rho^2\big)                            & (Z1)\\
    \Delta P &= P_0 r^2 k F                                                                & (Z2)\\
    M &= m^*\Big(I - \frac{W}{Z(\sigma_0)}\Big),\quad I = \frac{W - E'}{R_s + jX'}             & (Z3)\\
    \dot E' &= -j\Omega\sigma E' - \big(E' - j(X_0 - X') I\big)/T'_0                           & (Z4)\\
    2H\dot\sigma &= \tau_0\Big(c + (1 - c)\frac{(1-\sigma)^2}{(1-\sigma_0)^2}\Big)
    - \Re(E' I^*)                                                                             & (Z5)

(Z1) a share s at constant current (c = 1) to constant power (c = 0), the same for reactive power; (Z2) frequency
dependence; (Z3) to (Z5) induction motors of third order (F. Milano, *Power System Modelling and Scripting*, 2010,
section 15.2), which draw the share m of the active power before the event at the slip :math:`\sigma_0`, with data of
small industrial motors (IEEE Task Force, IEEE Trans. Power Syst. 10, 1995). Below -1 and above 1 the slip is held.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import hold_at_limits

_RS, _XS, _XM, _RR, _XR = 0.031, 0.1, 3.2, 0.018, 0.18
#: at which the motor takes 0.6 of its rating at rated voltage, the load factor of the source
_SLIP = 0.012
_X0 = _XS + _XM
_X1 = _XS + _XR * _XM / (_XR + _XM)
#: per unit of the nominal angular frequency
_T0 = (_XR + _XM) / _RR
_Z1 = _RS * _RS + _X1 * _X1


def static_active(value: Any, r: Any, rho: Any, P0: Any, s: Any, c: Any) -> Any:
    """Active power beyond the constant impedance, (Z1)."""
    q = r / rho
    return (value + s * P0 * q * q * (c * rho + 1.0 - c - rho * rho),)


def static_reactive(value: Any, r: Any, rho: Any, Q0: Any, s: Any, c: Any) -> Any:
    """Reactive power beyond the constant impedance, (Z1)."""
    q = r / rho
    return (value + s * Q0 * q * q * (c * rho + 1.0 - c - rho * rho),)


def frequency(value: Any, r: Any, F: Any, P0: Any, k: Any) -> Any:
    """Active power that follows the frequency, (Z2)."""
    return (value + P0 * r * r * k * F,)


def motor(
    value: Any, Mi: Any, Wr: Any, Wi: Any, f0: Any, Er: Any, Ei: Any, slip: Any, share: Any, gr: Any, gi: Any,
    torque: Any, H: Any, c: Any,
) -> Any:  # fmt: skip
    """Current beyond the impedance before the event, and derivatives of flux and slip, (Z3) to (Z5)."""
    ur, ui = Wr - Er, Wi - Ei
    Ir, Ii = (_RS * ur + _X1 * ui) / _Z1, (_RS * ui - _X1 * ur) / _Z1
    omega = 6.283185307179586 * f0
    d_Er = omega * slip * Ei - omega / _T0 * (Er + (_X0 - _X1) * Ii)
    d_Ei = -omega * slip * Er - omega / _T0 * (Ei - (_X0 - _X1) * Ir)
    speed = (1.0 - slip) / (1.0 - _SLIP)
    d_slip = (torque * (c + (1.0 - c) * speed * speed) - (Er * Ir + Ei * Ii)) / (2.0 * H)
    return (
        value + share * (Ir - (gr * Wr - gi * Wi)),
        Mi + share * (Ii - (gr * Wi + gi * Wr)),
        d_Er,
        d_Ei,
        hold_at_limits(slip, d_slip, -1.0, 1.0),
    )


def _start(values: Values, h: float) -> Values:
    rotor = _RR / _SLIP + 1j * _XR
    Y = 1 / (_RS + 1j * _XS + 1j * _XM * rotor / (1j * _XM + rotor))
    W = values["Wr"] + 1j * values["Wi"]
    current = Y * W
    E = W - (_RS + 1j * _X1) * current
    return {
        "share": values["m"] * values["P0"] / (np.abs(W) ** 2 * Y.real),
        "gr": Y.real + 0.0 * values["m"],
        "gi": Y.imag + 0.0 * values["m"],
        "torque": (E * current.conj()).real,
        "Er": E.real,
        "Ei": E.imag,
        "slip": _SLIP + 0.0 * values["m"],
    }


def _static(part: str, port: str, equations: Any) -> Effect:
    return Effect(
        f"static_{part}", f"Voltage dependence of the {part} load", port, equations,
        (
            strength("s", 0.5, 1.5, "", "load", "s", "share that is no constant impedance; 0: none", -0.5),
            value("c", 1.0, 0.0, 1.0, "", "load", "c", "1: constant current, 0: constant power"),
        ),
        devices=("load",),
        formula=f"Δ{port[1]} = {port[1]}0 (r/ρ)² s (c ρ + 1 − c − ρ²)",
        description=f"The {part} power of the load falls less with the voltage than that of a constant impedance: "
        "lower voltages after a fault and in stationary states near it.",
        source="IEEE Task Force on Load Representation, IEEE Trans. Power Syst. 8(2), 1993, and 10(3), 1995",
        confused_with=("motors", "another load level", "voltage support of a plant nearby"),
    )  # fmt: skip


STATIC_ACTIVE = _static("active", "dP", static_active)
STATIC_REACTIVE = _static("reactive", "dQ", static_reactive)
FREQUENCY_DEPENDENCE = Effect(
    "frequency_dependence", "Frequency dependence of the load", "dP", frequency,
    (strength("k", 1.5, 5.0, "pu/pu", "load", "k", "active power for each frequency; 0: none"),),
    devices=("load",),
    formula="ΔP = P0 r² k F",
    description="Fans and pumps take less power at lower frequency, which damps swings and settles the frequency "
    "higher.",
    source="Kundur, Power System Stability and Control, 1994, section 7.1.1",
    confused_with=("damping of machines", "a governor"),
)  # fmt: skip
MOTOR_LOAD = Effect(
    "motor", "Induction motors in the load", "Mr", motor,
    (
        strength("m", 0.3, 0.9, "", "motors", "m", "share of the active power that motors draw; 0: none"),
        value("H", 0.7, 0.2, 2.0, "s", "motors", "H", "inertia constant of motors and driven machines"),
        value("c", 1.0, 0.0, 1.0, "", "motors", "c", "share of the torque that does not depend on speed"),
    ),
    ("Er", "Ei", "slip"), ("share", "gr", "gi", "torque"), _start,
    beside=("Mi",),
    devices=("load",),
    formula="M = m* (I − W/Z0), I = (W − E')/(Rs + jX'), 2H dσ/dt = τ(σ) − Re(E' I*)",
    description="Motors slow down during a fault and draw several times their current after it: the voltage recovers "
    "late or not at all, with far more reactive power than any static load.",
    source="Milano, Power System Modelling and Scripting, 2010, section 15.2; IEEE Trans. Power Syst. 10(3), 1995",
    confused_with=("a static load of constant power", "missing voltage support"),
)  # fmt: skip
