r"""IEEEVC and COMP, load compensation: the voltage at a point inside the machine or in the grid is controlled.

.. math::

    V_c &= |\underline V + (R_C + jX_C)\underline I|\quad\text{(IEEEVC)}        & (1)\\
    V_c &= |\underline V - jX_e\underline I|\quad\text{(COMP)}                  & (2)

with the current out of the machine: a positive :math:`X_C` is a droop that shares reactive power between machines on
one bus; a negative one, or a positive :math:`X_e`, compensates the drop of a transformer or line. The transducer is
part of the exciter.

(IEEE Std 421.5-2016, section 4; PSS/E model library, IEEEVC and COMP.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.models.part import Part, record


@register_jitable
def behind(Vd: Any, Vq: Any, Id: Any, Iq: Any, R: Any, X: Any) -> Any:
    """Magnitude of the voltage plus the drop of a current in an impedance, with the q axis as imaginary one.

    Examples
    --------
    >>> round(float(behind(0.6, 0.8, 0.5, 0.5, 0.0, 0.2)), 12)
    1.029563014099
    """
    d = Vd + R * Id - X * Iq
    q = Vq + R * Iq + X * Id
    return np.sqrt(d * d + q * q)


@stage("Vc")
def ieeevc(Vd: Any, Vq: Any, Id: Any, Iq: Any, RC: Any, XC: Any) -> Any:
    """Compensated voltage, (1)."""
    return (behind(Vd, Vq, Id, Iq, RC, XC),)


@stage("Vc")
def comp(Vd: Any, Vq: Any, Id: Any, Iq: Any, Xe: Any) -> Any:
    """Compensated voltage, (2)."""
    return (behind(Vd, Vq, Id, Iq, 0.0, -Xe),)


IEEEVC = Part(
    name="IEEEVC",
    slot="compensator",
    title="Load compensation (IEEE)",
    fields=record(
        """
        RC | pu | 0    | -           | any | resistance of the compensation
        XC | pu | 0.05 | -0.2 .. 0.2 | any | reactance of the compensation
        """
    ),
    stages=(ieeevc,),
    ports=("Vc",),
    formula="Vc = |V + (RC + j XC) I|",
    source="PSS/E model library, IEEEVC",
)
COMP = Part(
    name="COMP",
    slot="compensator",
    title="Load compensation by a reactance",
    fields=record(
        """
        Xe | pu | 0.05 | -0.2 .. 0.2 | any | reactance of the compensation
        """
    ),
    stages=(comp,),
    ports=("Vc",),
    formula="Vc = |V − j Xe I|",
    source="PSS/E model library, COMP",
)
