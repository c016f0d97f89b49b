r"""Power system stabiliser: a signal of speed that acts on the field voltage.

Washout and one lead-lag as in the single-input stabiliser PSS1A (IEEE Std 421.5-2016), with the gain of
the exciter included, because the machine may have none:

.. math::

    T_W\,\dot w &= (\omega - 1) - w,\quad y_w = (\omega - 1) - w                            & (S1)\\
    T_2\,\dot x &= y_w - x,\quad y = x + (T_1/T_2)(y_w - x)                                & (S2)\\
    \Delta E_{fd} &= [K y]_{-E_S}^{E_S},\quad E_S = 2\ \text{pu}                            & (S3)

Of a unit from a model file the signal passes two equal lead-lags, as stabilisers of the field usually have them
(:math:`T_1 = T_3`, :math:`T_2 = T_4` in IEEEST and STAB1):

.. math::

    T_2\,\dot x &= y_w - x,\quad y_1 = x + (T_1/T_2)(y_w - x)                              & (S4)\\
    T_2\,\dot z &= y_1 - z,\quad y = z + (T_1/T_2)(y_1 - z)                                & (S5)

in place of (S2). With an exciter the signal acts at its summing point, and its limit is a parameter:

.. math:: \Delta V_s = [K y]_{-V_{max}}^{V_{max}}                                                   \qquad (S6)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numba.extending import register_jitable

from errorscreen.effects.base import Effect, strength, value
from errorscreen.engine.vmath import clip

_E_S = 2.0


def stabiliser(value: Any, omega: Any, w: Any, x: Any, K: Any, TW: Any, T1_T2: Any, T2: Any) -> Any:
    """Field voltage and derivatives of washout and lead-lag, (S1) to (S3)."""
    yw = (omega - 1.0) - w
    y = x + T1_T2 * (yw - x)
    return value + clip(K * y, -_E_S, _E_S), yw / TW, (yw - x) / T2


@register_jitable
def _two_stages(omega: Any, w: Any, x: Any, z: Any, TW: Any, T1_T2: Any, T2: Any) -> Any:
    """Signal before gain and limit, and derivatives of washout and both lead-lags, (S1), (S4), (S5)."""
    yw = (omega - 1.0) - w
    y1 = x + T1_T2 * (yw - x)
    return z + T1_T2 * (y1 - z), yw / TW, (yw - x) / T2, (y1 - z) / T2


def stabiliser_field(
    value: Any, omega: Any, w: Any, x: Any, z: Any, K: Any, TW: Any, T1_T2: Any, T2: Any
) -> Any:
    """Field voltage, (S3), and derivatives of washout and both lead-lags."""
    y, dw, dx, dz = _two_stages(omega, w, x, z, TW, T1_T2, T2)
    return value + clip(K * y, -_E_S, _E_S), dw, dx, dz


def stabiliser_input(
    value: Any, omega: Any, w: Any, x: Any, z: Any, K: Any, TW: Any, T1_T2: Any, T2: Any, Vmax: Any
) -> Any:
    """Signal at the summing point of the exciter, (S6), and derivatives of washout and both lead-lags."""
    y, dw, dx, dz = _two_stages(omega, w, x, z, TW, T1_T2, T2)
    return value + clip(K * y, -Vmax, Vmax), dw, dx, dz


def ieeest_record(values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Record IEEEST with these equations: input code 1, no filter, no limit of the voltage."""
    lead, lag = values["T1_T2"] * values["T2"], values["T2"]
    return "IEEEST", {
        **{"IC": 1.0, "IB": 0.0},
        **{f"A{k}": 0.0 for k in range(1, 7)},
        **{"T1": lead, "T2": lag, "T3": lead, "T4": lag, "T5": values["TW"], "T6": values["TW"]},
        **{"KS": values["K"], "LSMAX": values["Vmax"], "LSMIN": -values["Vmax"], "VCU": 0.0, "VCL": 0.0},
    }


STABILISER = Effect(
    name="stabiliser",
    title="Power system stabiliser",
    port="Efd",
    devices=("synchronous_machine",),
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
UNIT_STABILISER = replace(
    STABILISER,
    told="The file of {unit} has no stabiliser; one acted",
    devices=("without exciter and stabiliser",),
    equations=stabiliser_field,
    parameters=(
        *STABILISER.parameters[:2],
        value("T1_T2", 4.0, 1.0, 12.0, "", "stabiliser", "T_1/T_2", "lead over lag, of each of the two"),
        value("T2", 0.04, 0.01, 0.2, "s", "stabiliser", "T_2", "lag time constant, of each of the two"),
    ),
    states=("w", "x", "z"),
    formula="Efd = Efd* + K · ((1 + s T1) / (1 + s T2))² · s TW / (1 + s TW) · (ω − 1), limited to ± 2 pu",
    source="IEEE Std 421.5-2016, type PSS1A; PSS/E model library, IEEEST and STAB1",
)
STABILISER_INPUT = replace(
    UNIT_STABILISER,
    port="Vs",
    devices=("exciter without stabiliser",),
    equations=stabiliser_input,
    record=ieeest_record,
    parameters=(
        strength("K", 10.0, 50.0, "pu", "stabiliser", "K", "signal per speed deviation; 0: none"),
        *UNIT_STABILISER.parameters[1:],
        value("Vmax", 0.1, 0.02, 0.3, "pu", "stabiliser", "V_max", "limit of the signal"),
    ),
    formula="Vs = K · ((1 + s T1) / (1 + s T2))² · s TW / (1 + s TW) · (ω − 1), limited to ± Vmax",
)
