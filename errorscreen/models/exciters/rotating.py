r"""Rotating exciter of the DC types, used by IEEET1, ESDC1A, ESDC2A and EXPIC1.

.. math::

    T_E\,\dot E_{fd} &= V_R - K_E E_{fd} - S_E(E_{fd})E_{fd},\quad S_E(u)\,u = B([u - A]^+)^2\ \text{through}\ E_1, E_2

A :math:`V_{R,MAX}` of zero is computed: :math:`(S_E(E_2) + \max(K_E, 0))E_2`, and :math:`V_{R,MIN}` is its negative.
A :math:`K_E` of zero is computed such that the regulator starts at a tenth of its limit:
:math:`K_E = V_{R,MAX}/(10 E_{fd}) - S_E(E_{fd})` (PSS/E model library, DC exciters).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from errorscreen.models.blocks import longer, quadratic_constants, quadratic_saturation
from errorscreen.models.part import Values


@register_jitable
def rotating(E: Any, VR: Any, KE: Any, TE: Any, satA: Any, satB: Any, shortest: Any) -> Any:
    """Derivative of the field voltage.

    Examples
    --------
    >>> float(rotating(2.0, 3.0, 1.0, 0.5, 9.0, 0.0, 0.001))
    2.0
    """
    return (VR - KE * E - quadratic_saturation(E, satA, satB)) / longer(TE, shortest)


class Computed(NamedTuple):
    """Constants of a rotating exciter with the computed ones filled in, and its input VR at the start."""

    KE: Any
    VRMIN: Any
    VRMAX: Any
    satA: Any
    satB: Any
    VR: Any


def computed(v: Values) -> Computed:
    """Constants that a record leaves to be computed.

    Examples
    --------
    >>> v = {"Efd0": 2.0, "KE": 0.0, "VRMAX": 0.0, "VRMIN": -1.0, "E1": 3.0, "S1": 0.1, "E2": 4.0, "S2": 0.5}
    >>> found = computed({name: np.array(value) for name, value in v.items()})
    >>> float(found.VRMAX), float(found.VRMIN), round(float(found.VR), 12)
    (2.0, -2.0, 0.2)
    """
    E = v["Efd0"]
    satA, satB = quadratic_constants(v["E1"], v["S1"], v["E2"], v["S2"])
    saturation = quadratic_saturation(E, satA, satB)
    ceiling = (v["S2"] + np.maximum(v["KE"], 0.0)) * v["E2"]
    automatic = v["VRMAX"] == 0
    VRMAX, VRMIN = np.where(automatic, ceiling, v["VRMAX"]), np.where(automatic, -ceiling, v["VRMIN"])
    rest = (VRMAX / 10.0 - saturation) / np.where(E == 0, 1.0, E)
    KE = np.where(v["KE"] == 0, rest, v["KE"])
    return Computed(KE, VRMIN, VRMAX, satA, satB, KE * E + saturation)
