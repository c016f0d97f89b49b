r"""Excitation system SEXS: voltage control of a machine whose model has a constant field voltage.

The simplified excitation system SEXS of the PSS/E model library (T_A/T_B, T_B, K, T_E, limits), in deviations from
the equilibrium:

.. math::

    e &= V_0 - V                                                             & (X1)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_A/T_B)(e - x)                        & (X2)\\
    T_E\,\dot E &= K y - E,\quad E_{min} \le E_{fd0} + E \le E_{max}             & (X3)\\
    E_{fd} &= E_{fd0} + E                                                      & (X4)

The limits, 0 and 5 pu, belong to a typical static exciter. Of a unit from a model file the upper one is a parameter,
and the lag may be so long that it stands for the integral of a regulator.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, nothing, strength, value
from errorscreen.engine.vmath import clip, hold_at_limits

_E_MIN, _E_MAX = 0.0, 5.0


def sexs(value: Any, V: Any, V0: Any, Efd0: Any, x: Any, E: Any, K: Any, TA_TB: Any, TB: Any, TE: Any) -> Any:
    """Field voltage and derivatives of lead-lag and exciter, (X1) to (X4)."""
    e = V0 - V
    y = x + TA_TB * (e - x)
    # the limits hold the equilibrium, so that K = 0 is an identity at any loading
    low = clip(_E_MIN - Efd0, -1e9, 0.0)
    high = clip(_E_MAX - Efd0, 0.0, 1e9)
    return value + clip(E, low, high), (e - x) / TB, hold_at_limits(E, (K * y - E) / TE, low, high)


def ceiling(
    value: Any, Vc: Any, Vs: Any, Vc0: Any, Efd0: Any, x: Any, E: Any, K: Any, TA_TB: Any, TB: Any, TE: Any, Emax: Any
) -> Any:  # fmt: skip
    """Field voltage and derivatives of lead-lag and exciter, (X1) to (X4), with a ceiling of its own, behind the
    compensator and the stabiliser of the unit.
    """
    e = Vc0 + Vs - Vc
    y = x + TA_TB * (e - x)
    low, high = clip(_E_MIN - Efd0, -1e9, 0.0), clip(Emax - Efd0, 0.0, 1e9)
    return value + clip(E, low, high), (e - x) / TB, hold_at_limits(E, (K * y - E) / TE, low, high)


def _start(values: Values, h: float) -> Values:
    return {"V0": values["V"] * np.ones_like(values["K"])}


def sexs_record(values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Record SEXS with these equations."""
    own = {name: values[name] for name in ("TA_TB", "TB", "K", "TE")}
    return "SEXS", {**own, "EMIN": _E_MIN, "EMAX": values["Emax"]}


EXCITER = Effect(
    name="exciter",
    title="Excitation system (SEXS)",
    port="Efd",
    devices=("synchronous_machine",),
    equations=sexs,
    parameters=(
        strength("K", 100.0, 400.0, "pu", "exciter", "K", "gain; 0 leaves the field voltage constant"),
        value("TA_TB", 0.1, 0.02, 1.0, "", "exciter", "T_A/T_B", "transient gain reduction"),
        value("TB", 10.0, 1.0, 20.0, "s", "exciter", "T_B", "lag time constant"),
        value("TE", 0.1, 0.02, 1.5, "s", "exciter", "T_E", "exciter time constant"),
    ),
    states=("x", "E"),
    derived=("V0",),
    initialise=_start,
    formula="Efd = Efd0 + [K / (1 + s TE) · (1 + s (TA_TB) TB) / (1 + s TB) · (V0 − V)], 0 ≤ Efd ≤ 5 pu",
    description="The voltage regulator raises the field voltage when the terminal voltage falls. A model with constant "
    "field voltage misses the slow rise of reactive power after a dip and part of the damping.",
    source="PSS/E model library, SEXS",
    confused_with=("a larger or smaller T'd0", "a field-current limiter", "a power system stabiliser"),
)
UNIT_EXCITER = replace(
    EXCITER,
    title="Excitation system (SEXS, or one with an integral)",
    told="The file of {unit} has no exciter; one acted",
    devices=("without exciter",),
    equations=ceiling,
    derived=(),
    initialise=nothing,
    record=sexs_record,
    parameters=(
        EXCITER.parameters[0],
        value("TA_TB", 0.1, 0.005, 1.0, "", "exciter", "T_A/T_B", "transient gain reduction"),
        value("TB", 10.0, 1.0, 80.0, "s", "exciter", "T_B", "lag time constant"),
        EXCITER.parameters[3],
        value("Emax", 5.0, 2.0, 12.0, "pu", "exciter", "E_max", "ceiling of the field voltage"),
    ),
    formula="Efd = Efd0 + [K / (1 + s TE) · (1 + s (TA_TB) TB) / (1 + s TB) · (Vc0 + Vs − Vc)], 0 ≤ Efd ≤ Emax",
)
