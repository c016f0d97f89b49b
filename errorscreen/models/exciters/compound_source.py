r"""Rectifier fed by voltage and current of the terminal, used by ESST4B and EXPIC1.

.. math::

    V_E &= |\bar K_P\bar V + j(K_I + \bar K_P X_L)\bar I|,\quad \bar K_P = K_P e^{j\theta_P}\\
    V_B &= V_E\,F_{EX}(K_C X_{ad}I_{fd}/V_E)

Without :math:`K_P` and :math:`K_I`, :math:`V_B = 1` (PSS/E model library; IEEE Std 421.5-2016, annex D).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.vmath import select
from errorscreen.models.blocks import rectifier


@register_jitable
def compound_source(
    Vd: Any, Vq: Any, Id: Any, Iq: Any, If: Any, KPr: Any, KPi: Any, KI: Any, XL: Any, KC: Any
) -> Any:
    """Available voltage V_B; ``KPr`` and ``KPi`` are the parts of the phasor K_P.

    Examples
    --------
    >>> float(compound_source(0.6, 0.8, 0.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.1, 0.2))
    5.0
    >>> float(compound_source(0.0, 1.0, 1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.2, 0.2))
    7.0
    """
    real, imag = KI + KPr * XL, KPi * XL
    d = KPr * Vd - KPi * Vq - imag * Id - real * Iq
    q = KPr * Vq + KPi * Vd + real * Id - imag * Iq
    VE = np.sqrt(d * d + q * q)
    VB = VE * rectifier(KC * If / select(VE < 1e-6, 1e-6, VE))
    return select((KPr == 0.0) & (KPi == 0.0) & (KI == 0.0), 1.0, VB)
