r"""Limiters of the excitation: field current, stator current, under-excitation, volts per hertz.

Each limiter integrates the excess of its quantity over a limit and subtracts it from the field voltage, or adds it
(the summed-type limiters OEL, UEL and SCL of IEEE Std 421.5-2016, with integral action and without wind-up):

.. math::

    \dot x &= K\,(q - q_{max}),\quad 0 \le x \le x_{max}                                   & (L1)\\
    E_{fd} &= E_{fd0} + \Delta E_{fd} - s\,x                                                & (L2)

with

- field current: :math:`q = I_{fd} = E'_q + (X_d - X'_d) I_d`, s = 1;
- stator current: :math:`q = \sqrt{I_d^2 + I_q^2}`, s = 1 where reactive power is generated, −1 where it is consumed;
- under-excitation: :math:`q = -Q`, s = −1;
- volts per hertz: :math:`q = V/\omega`, s = 1.

A limit below the equilibrium is moved just above it, so that a strength of 0 is an identity at any loading.

In a unit of standard models with an exciter, the signal acts where limiters enter it, added to the error of voltage.
Over-excitation is (L1) with the field current :math:`X_{ad}I_{fd}` of the machine and :math:`V_{OEL} = -x`,
:math:`x_{max} = 0.3` pu. Under-excitation has a gain and a lag, as minimum excitation limiters have:

.. math:: T\,\dot x = K\,(Q_{min} - Q) - x,\quad 0 \le V_{UEL} = x \le x_{max}                  \qquad (L3)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.stages import Equations
from errorscreen.engine.vmath import clip, hold_at_limits
from errorscreen.parameters import Parameter

_X_MAX = 3.0
#: the same of a signal at the summing point of an exciter
_SIGNAL_MAX = 0.3
#: reactive power in pu within which the stator-current limiter reverses its direction
_Q_BAND = 0.05
_MARGIN = 1e-3


def field_current(value: Any, Eq1: Any, Id: Any, Xd: Any, Xd1: Any, limit: Any, x: Any, K: Any) -> Any:
    """Over-excitation limiter, (L1), (L2)."""
    excess = Eq1 + (Xd - Xd1) * Id - limit
    return value - x, hold_at_limits(x, K * excess, 0.0, _X_MAX)


def stator_current(value: Any, Id: Any, Iq: Any, Q: Any, limit: Any, x: Any, K: Any) -> Any:
    """Stator-current limiter, (L1), (L2)."""
    excess = np.sqrt(Id * Id + Iq * Iq) - limit
    return value - x * clip(Q / _Q_BAND, -1.0, 1.0), hold_at_limits(x, K * excess, 0.0, _X_MAX)


def under_excitation(value: Any, Q: Any, limit: Any, x: Any, K: Any) -> Any:
    """Under-excitation limiter, (L1), (L2)."""
    return value + x, hold_at_limits(x, K * (-Q - limit), 0.0, _X_MAX)


def over_excitation_signal(value: Any, If: Any, limit: Any, x: Any, K: Any) -> Any:
    """Over-excitation limiter of a unit with an exciter, (L1)."""
    return value - x, hold_at_limits(x, K * (If - limit), 0.0, _SIGNAL_MAX)


def under_excitation_signal(value: Any, Q: Any, limit: Any, x: Any, K: Any, T: Any, top: Any) -> Any:
    """Under-excitation limiter of a unit with an exciter, (L3)."""
    return value + clip(x, 0.0, top), hold_at_limits(x, (K * (-Q - limit) - x) / T, 0.0, top)


def volts_per_hertz(value: Any, V: Any, omega: Any, limit: Any, x: Any, K: Any) -> Any:
    """Volts-per-hertz limiter, (L1), (L2)."""
    return value - x, hold_at_limits(x, K * (V / omega - limit), 0.0, _X_MAX)


def _above(chosen: Any, now: Any) -> Values:
    """Limit that lies above the equilibrium."""
    return {"limit": np.maximum(chosen, now + _MARGIN)}


def _start_field(values: Values, h: float) -> Values:
    return _above(values["If_max"], values["Efd0"])


def _start_stator(values: Values, h: float) -> Values:
    return _above(values["I_max"], np.hypot(values["P"], values["Q"]) / values["V"])


def _start_under(values: Values, h: float) -> Values:
    return _above(-values["Q_min"], -values["Q"])


def _start_flux(values: Values, h: float) -> Values:
    return _above(values["VHz_max"], values["V"])


def _limiter(
    name: str, title: str, equations: Equations, start: Callable[[Values, float], Values],
    gain: tuple[float, float], limit: Parameter, formula: str, description: str, confused: tuple[str, ...],
) -> Effect:  # fmt: skip
    return Effect(
        name, title, "Efd", equations,
        (strength("K", *gain, "1/s", limit.device, "K", "integral gain; 0: none"), limit),
        ("x",), ("limit",), start,
        devices=("synchronous_machine",),
        formula=f"{formula}, x ≥ 0",
        description=description,
        source="after the summed-type limiters of IEEE Std 421.5-2016 (types OEL, UEL, SCL)",
        confused_with=confused,
    )  # fmt: skip


FIELD_CURRENT_LIMITER = _limiter(
    "field_limiter", "Field-current (over-excitation) limiter", field_current, _start_field, (3.0, 20.0),
    value("If_max", 2.5, 1.2, 4.0, "pu", "field-current limiter", "I_fd,max", "limit of the field current"),
    "Efd = Efd* − x, dx/dt = K (Ifd − If_max)",
    "Above its limit the field current is brought down: the machine gives less reactive power after a dip, or while "
    "the voltage stays low, than its model does.",
    ("a stator-current limiter", "a smaller exciter gain", "a larger Xd"),
)  # fmt: skip
STATOR_CURRENT_LIMITER = _limiter(
    "stator_limiter", "Stator-current limiter", stator_current, _start_stator, (3.0, 20.0),
    value("I_max", 1.1, 0.7, 2.5, "pu", "stator-current limiter", "I_max", "limit of the stator current"),
    "Efd = Efd* ∓ x, dx/dt = K (√(Id² + Iq²) − I_max)",
    "While the stator current exceeds its limit, the excitation is changed so that reactive current falls.",
    ("a field-current limiter", "a volts-per-hertz limiter"),
)  # fmt: skip
UNDER_EXCITATION_LIMITER = _limiter(
    "under_excitation", "Under-excitation limiter", under_excitation, _start_under, (5.0, 30.0),
    value("Q_min", -0.1, -0.6, 0.2, "pu", "under-excitation limiter", "Q_min", "least reactive power"),
    "Efd = Efd* + x, dx/dt = K (Q_min − Q)",
    "The machine may not consume more reactive power than the limit: the field voltage is raised when the voltage of "
    "the grid is high.",
    ("an exciter", "saturation"),
)  # fmt: skip
VOLTS_PER_HERTZ_LIMITER = _limiter(
    "volts_per_hertz", "Volts-per-hertz limiter", volts_per_hertz, _start_flux, (20.0, 100.0),
    value("VHz_max", 1.05, 1.0, 1.2, "pu", "volts-per-hertz limiter", "(V/f)_max", "limit of V over frequency"),
    "Efd = Efd* − x, dx/dt = K (V/ω − VHz_max)",
    "Above the limit of voltage over frequency the field voltage is lowered to protect the iron.",
    ("an exciter", "a field-current limiter"),
)  # fmt: skip

UNIT_FIELD_LIMITER = replace(
    FIELD_CURRENT_LIMITER,
    told="The file of {unit} has no over-excitation limiter; one acted",
    port="VOEL",
    devices=("exciter without over_excitation",),
    equations=over_excitation_signal,
    parameters=(
        strength("K", 0.05, 0.5, "1/s", "field-current limiter", "K", "integral gain; 0: none"),
        FIELD_CURRENT_LIMITER.parameters[1],
    ),
    formula="VOEL = −x, dx/dt = K (If − If_max), 0 ≤ x ≤ 0.3 pu",
)
UNIT_UNDER_EXCITATION_LIMITER = replace(
    UNDER_EXCITATION_LIMITER,
    told="The file of {unit} has no under-excitation limiter; one acted",
    port="VUEL",
    devices=("exciter without under_excitation",),
    equations=under_excitation_signal,
    parameters=(
        strength("K", 1.0, 10.0, "pu", "under-excitation limiter", "K", "gain; 0: none"),
        UNDER_EXCITATION_LIMITER.parameters[1],
        value("T", 0.5, 0.02, 3.0, "s", "under-excitation limiter", "T", "time constant"),
        value("top", 0.1, 0.01, 0.5, "pu", "under-excitation limiter", "x_max", "upper limit of the signal"),
    ),
    formula="VUEL = [K / (1 + s T) · (Q_min − Q)] within 0, x_max",
)
