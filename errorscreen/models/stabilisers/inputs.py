r"""Input signals of stabilisers by their codes in PSS/E records.

=====  ==================================================================================
code   signal
=====  ==================================================================================
0      none
1      deviation of the speed, :math:`\omega - 1`
2      deviation of the frequency at the terminal
3      electrical power in pu of the machine
4      accelerating power, :math:`P_m - P`, in pu of the machine
5      magnitude of the terminal voltage
6      derivative of the magnitude
=====  ==================================================================================

Frequency and derivative are those of `errorscreen.models.measured_voltage`. A record may name a remote bus; the signals
here are always those of the own terminal.
"""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from errorscreen.engine.vmath import select
from errorscreen.models.part import Values

#: codes that a record may hold
CODES = "0, 1, 2, 3, 4, 5, 6"


@register_jitable
def chosen(code: Any, omega: Any, df: Any, P: Any, Pm: Any, V: Any, dV: Any) -> Any:
    """Signal of a code.

    Examples
    --------
    >>> [round(float(chosen(code, 1.01, 0.02, 0.8, 0.9, 1.0, 0.3)), 12) for code in range(7)]
    [0.0, 0.01, 0.02, 0.8, 0.1, 1.0, 0.3]
    """
    late = select(code == 4.0, Pm - P, select(code == 5.0, V, select(code == 6.0, dV, 0.0 * V)))
    return select(code == 1.0, omega - 1.0, select(code == 2.0, df, select(code == 3.0, P, late)))


@register_jitable
def cut_out(signal: Any, V: Any, lower: Any, upper: Any) -> Any:
    """Zero while the voltage is outside the band between two limits, each without effect where it is zero.

    Examples
    --------
    >>> [float(cut_out(0.1, V, 0.7, 1.2)) for V in (0.6, 1.0, 1.3)], float(cut_out(0.1, 0.6, 0.0, 1.2))
    ([0.0, 0.1, 0.0], 0.1)
    """
    outside = ((upper < V) & (upper != 0.0)) | ((lower > V) & (lower != 0.0))
    return select(outside, 0.0 * signal, signal)


def at_start(code: Any, v: Values) -> Any:
    """Signal of a code at the start."""
    return chosen(code, v["omega"], 0.0, v["P"], v["Pm0"], v["V"], 0.0)
