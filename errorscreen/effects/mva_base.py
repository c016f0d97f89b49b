r"""Power that was recorded in pu of another base than that of the unit.

.. math:: P = f\,P^*,\quad Q = f\,Q^*,\quad f = 1 + a                                           \qquad (N6)

with the power :math:`P^* + jQ^*` in pu of the unit's own base. A record in pu of the base S belongs to a unit of the
base :math:`f S`, or, if S is the sum of m equal units, to n = f m of them on line. It is one parameter where scale
errors of P and Q are two, so the evidence tells which.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from errorscreen.effects.base import CHANNEL, Effect, strength
from errorscreen.effects.measurement import scaled, true_of_scaled

#: most units of a plant that are told
_MOST = 6
#: numbers of units on line, and of those that count in the base
_UNITS = [(n, m) for m in range(1, _MOST + 1) for n in range(1, _MOST + 1) if n != m]


@dataclass(frozen=True)
class BaseInWords:
    """Title for a fitted factor.

    Parameters
    ----------
    base_mva : float
        Stated base of the record; 0 if it is unknown.

    Examples
    --------
    >>> BaseInWords(100.0)("", {"a": (-0.168, -0.175, -0.160)})
    'Another MVA base: 83.2 instead of 100 MVA, or 5 of 6 units on line'
    >>> BaseInWords(0.0)("", {"a": (0.31, 0.305, 0.315)})
    'Another MVA base: 1.31 times the stated one'
    """

    base_mva: float

    def __call__(self, title: str, values: Mapping[str, tuple[float, float, float]]) -> str:
        """Title for the factor and the ends of its interval."""
        factor, low, high = (1.0 + one for one in values["a"])
        known = self.base_mva > 0
        base = f"{factor * self.base_mva:.3g} instead of {self.base_mva:g} MVA"
        text = f"Another MVA base: {base if known else f'{factor:.3g} times the stated one'}"
        fitting = [(abs(n / m - factor), m, n) for n, m in _UNITS if low <= n / m <= high]
        if not fitting:
            return text
        _, m, n = min(fitting)
        units = f"{n} of {m} units on line" if n < m else f"{n} units on line instead of {m}"
        return f"{text}, or {units}"


def mva_base(base_mva: float = 0.0) -> Effect:
    """Another base of P and Q together, of a unit in playback.

    Parameters
    ----------
    base_mva : float
        Stated base of the record, for the title; 0 if it is unknown.

    Examples
    --------
    >>> mva_base().channels
    ('P', 'Q')
    """
    return Effect(
        "mva_base", "Another MVA base, or another number of units on line", f"{CHANNEL}P", scaled,
        (
            strength(
                "a", -0.2, 1.0, "", "base of the record", "a", "factor of P and Q less 1; 0: the stated base", -0.85
            ),
        ),
        beside=(f"{CHANNEL}Q",),
        recorded=true_of_scaled,
        kind="measurement",
        devices=("machine unit", "converter unit"),
        reading=BaseInWords(base_mva),
        formula="P = (1 + a) P*, Q = (1 + a) Q*",
        description="P and Q are recorded in pu of another base than that of the unit: its MBASE is another one, or "
        "not all units that count in the base were on line. Both are wrong by the same factor, also before the event.",
        source="PSS/E program manual, MBASE of a generator",
        confused_with=("scale errors of P and Q", "parameters that scale the whole response"),
    )  # fmt: skip
