r"""Power system stabiliser: a signal of speed that acts on the field voltage.

Washout and one lead-lag as in the single-input stabiliser PSS1A (IEEE Std 421.5-2016), with the gain of
the exciter included, because the machine may have none:

.. math::

    T_W\,\dot w &= (\omega - 1) - w,\quad y_w = (\omega - 1) - w                            & (S1)\\
    T_2\,\dot x &= y_w - x,\quad y = x + (T_1/T_2)(y_w - x)                                & (S2)\\
    \Delta E_{fd} &= [K y]_{-E_S}^{E_S},\quad E_S = 2\ \text{pu}                            & (S3)

A unit with an exciter takes the signal at its summing point instead, limited to ± 0.1 pu.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from errorscreen.effects.base import Effect, strength, value
from errorscreen.engine.vmath import clip

_E_S, _V_S = 2.0, 0.1


def stabiliser(value: Any, omega: Any, w: Any, x: Any, K: Any, TW: Any, T1_T2: Any, T2: Any) -> Any:
    """Field voltage and derivatives of washout and lead-lag, (S1) to (S3)."""
    yw = (omega - 1.0) - w
    y = x + T1_T2 * (yw - x)
    return value + clip(K * y, -_E_S, _E_S), yw / TW, (yw - x) / T2


def stabiliser_input(value: Any, omega: Any, w: Any, x: Any, K: Any, TW: Any, T1_T2: Any, T2: Any) -> Any:
    """Signal at the summing point of the exciter, and derivatives of washout and lead-lag."""
    yw = (omega - 1.0) - w
    y = x + T1_T2 * (yw - x)
    return value + clip(K * y, -_V_S, _V_S), yw / TW, (yw - x) / T2


STABILISER = Effect(
    name="stabiliser",
    title="Power system stabiliser",
    port="Efd",
    devices=("synchronous_machine", "without exciter and stabiliser"),
    equations=stabiliser,
    parameters=(
        strength("K", 60.0, 300.0, "pu", "stabiliser", "K", "field voltage per speed deviation; 0: none"),
        value("TW", 5.0, 1.0, 15.0, "s", "stabiliser", "T_W", "washout"),
        value("T1_T2", 4.0, 1.0, 12.0, "", "stabiliser", "T_1/T_2", "lead over lag"),
        value("T2", 0.05, 0.02, 0.2, "s", "stabiliser", "T_2", "lag time constant"),
    ),
    states=("w", "x"),
    formula="Efd = Efd* + K · (1 + s T1) / (1 + s T2) · s TW / (1 + s TW) · (ω − 1), limited to ± 2 pu",
    description="The stabiliser modulates the field voltage with the speed, so that swings of active power die out "
    "faster, and the reactive power swings along. A model without it swings too long.",
    source="IEEE Std 421.5-2016, type PSS1A",
    confused_with=("a larger damping coefficient D", "a governor", "an exciter"),
)
STABILISER_INPUT = replace(
    STABILISER,
    port="Vs",
    devices=("exciter without stabiliser",),
    equations=stabiliser_input,
    parameters=(
        strength("K", 10.0, 50.0, "pu", "stabiliser", "K", "signal per speed deviation; 0: none"),
        *STABILISER.parameters[1:],
    ),
    formula="Vs = K · (1 + s T1) / (1 + s T2) · s TW / (1 + s TW) · (ω − 1), limited to ± 0.1 pu",
)
