r"""Rating of a turbine as the base of the powers in its record.

.. math::

    \rho = T_{RATE} / M_{BASE},\quad \rho = 1\ \text{where}\ T_{RATE} = 0                                & (1)

Powers of the record are in pu of TRATE in MW, those of the unit in pu of its base MBASE in MVA. The base is that of the
recording.

(PSS/E model library, GGOV1 and WTTQA1.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.models.part import Values


def rating(v: Values) -> Any:
    """Rating of the turbine over the base of the machine, (1).

    Examples
    --------
    >>> import numpy as np
    >>> float(rating({"TRATE": np.array(60.0), "MBASE": np.array(100.0)})), rating({"TRATE": np.array(0.0)})
    (0.6, 1.0)
    """
    return v["TRATE"] / v["MBASE"] if "MBASE" in v else 1.0
