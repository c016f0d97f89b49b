r"""Magnetic saturation of a machine whose model is linear.

The quadratic saturation function of the PSS/E and PSLF machine models (GENSAL form) on the transient voltage behind
X'd, in deviations from the equilibrium:

.. math::

    S(E) &= A\,\big([E - E_1]^+\big)^2                                                    & (B1)\\
    T'_{d0}\,\dot E'_q &= E_{fd} - \big(S(E'_q) - S(E'_{q0})\big) - E'_q - (X_d - X'_d) I_d   & (B2)

A machine of a standard model has its own equations of saturation. A record with S(1.0) = 0 switches them off; there the
effect gives both constants, before the start:

.. math:: S(1.2) = a,\quad S(1.0) = k\,a                                                    \qquad (B3)
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, nothing, strength, value
from errorscreen.engine.vmath import clip


def saturation(value: Any, Eq1: Any, S0: Any, A: Any, E1: Any) -> Any:
    """Field voltage less the share of saturation beyond the equilibrium, (B1), (B2)."""
    over = clip(Eq1 - E1, 0.0, 1e9)
    return (value - (A * over * over - S0),)


def _start(values: Values, h: float) -> Values:
    return {"S0": values["A"] * np.clip(values["Eq1"] - values["E1"], 0.0, None) ** 2}


def saturation_constants(a: Any, k: Any) -> Any:
    """S(1.0) and S(1.2), (B3)."""
    return k * a, a


SATURATION = Effect(
    name="saturation",
    title="Magnetic saturation",
    port="Efd",
    devices=("synchronous_machine",),
    equations=saturation,
    parameters=(
        strength("A", 3.0, 12.0, "1/pu", "saturation", "A", "curvature of the saturation; 0: linear"),
        value("E1", 0.8, 0.6, 1.1, "pu", "saturation", "E_1", "voltage at which saturation begins"),
    ),
    derived=("S0",),
    initialise=_start,
    formula="Efd = Efd* − A ([E'q − E1]⁺)² + A ([E'q0 − E1]⁺)²",
    description="Iron saturates: the higher the flux, the more field current it takes. A linear model returns too "
    "slowly from high voltage and settles at another reactive power.",
    source="Kundur, Power System Stability and Control, 1994, section 3.8.2; PSLF GENSAL",
    confused_with=("a smaller T'd0", "another Xd"),
)
UNIT_SATURATION = replace(
    SATURATION,
    told="The file of {unit} has no saturation; its machine saturates",
    port="S10",
    beside=("S12",),
    kind="constants",
    devices=("without saturation",),
    equations=saturation_constants,
    parameters=(
        strength("a", 0.4, 1.5, "", "saturation", "S(1.2)", "saturation at flux 1.2; 0: linear"),
        value("k", 0.25, 0.02, 0.6, "", "saturation", "k", "S(1.0) as a share of it"),
    ),
    derived=(),
    initialise=nothing,
    formula="S(1.2) = a, S(1.0) = k a",
    description="Iron saturates: the higher the flux, the more field current it takes. The record has S(1.0) = 0, "
    "which switches saturation off.",
    source="PSS/E model library, saturation of GENROU, GENROE, GENSAL, GENSAE and GENTPJ1",
    confused_with=("a smaller Xd and Xq", "a smaller T'd0"),
)
