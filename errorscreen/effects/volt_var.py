r"""Volt-var droop with a dead band: reactive current against the deviation of voltage outside of ride-through.

.. math::

    e &= \mathrm{db}(V_0 - V),\quad \mathrm{db}(x) = x - [x]_{-d}^{d}                        & (V1)\\
    T\,\dot y &= K e - y,\quad I_q = I_q^* + y                                               & (V2)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import clip


def volt_var(value: Any, V: Any, V0: Any, y: Any, K: Any, db: Any, T: Any) -> Any:
    """Reactive-current command and derivative of the lag, (V1), (V2)."""
    deviation = V0 - V
    return value + y, (K * (deviation - clip(deviation, -db, db)) - y) / T


def _start(values: Values, h: float) -> Values:
    return {"V0": values["V"] * np.ones_like(values["K"])}


VOLT_VAR = Effect(
    name="volt_var",
    title="Volt-var droop with dead band",
    port="Iq_cmd",
    equations=volt_var,
    parameters=(
        strength("K", 4.0, 25.0, "pu", "volt-var control", "K", "reactive current per voltage; 0: none"),
        value("db", 0.01, 0.0, 0.08, "pu", "volt-var control", "d", "half width of the dead band of voltage"),
        value("T", 0.2, 0.02, 8.0, "s", "volt-var control", "T", "time constant"),
    ),
    states=("y",),
    derived=("V0",),
    initialise=_start,
    description="Outside of ride-through the plant supports the voltage with a droop, beyond a dead band. A model that "
    "keeps its reactive power constant misses the reactive power that follows every change of voltage.",
    source="IEEE Std 1547-2018, section 5.3.3",
    confused_with=("other gains of the reactive-power control", "the wrong mode of the plant controller"),
)
