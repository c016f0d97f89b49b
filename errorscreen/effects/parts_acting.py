r"""Parts of the user's model that do not act as the model says: out of service, blocked, with a wrong sign.

A share a of what the part adds is taken away from its output u, which rests at u0:

.. math:: u = u^* - a\,(u^* - u_0)                                                            \qquad (A1)

so that a = 1 is a part that does not act, and a = 2 one that acts in the wrong direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from errorscreen.effects.base import Effect, strength

#: shares so near to 1 or 2 are told as that
_NEARLY = 0.05


def signal_share(value: Any, a: Any) -> Any:
    """Signal of a stabiliser or a limiter, which is zero at rest, (A1)."""
    return (value - a * value,)


def regulator_share(value: Any, Efd0: Any, a: Any) -> Any:
    """Field voltage, (A1)."""
    return (value - a * (value - Efd0),)


def governor_share(value: Any, Pm0: Any, a: Any) -> Any:
    """Mechanical power, (A1)."""
    return (value - a * (value - Pm0),)


def share_in_words(title: str, values: Mapping[str, tuple[float, float, float]]) -> str:
    """Title for a share: out of service, with the wrong sign, or with a part of the action.

    Examples
    --------
    >>> share_in_words("The stabiliser did not act", {"a": (1.98, 1.9, 2.05)})
    'The stabiliser acted with the wrong sign'
    >>> share_in_words("The governor did not act", {"a": (0.4, 0.35, 0.45)})
    'The governor acted with 0.6 of its action'
    """
    a, low, high = values["a"]
    if low <= 1.0 <= high or abs(a - 1.0) < _NEARLY:
        return title
    wrong = low <= 2.0 <= high or abs(a - 2.0) < _NEARLY
    did = "acted with the wrong sign" if wrong else f"acted with {1.0 - a:.2g} of its action"
    return title.replace("did not act", did)


STABILISER_ACTING = Effect(
    name="stabiliser_acting",
    title="The stabiliser did not act",
    told="The stabiliser {stabiliser} of {unit} did not act",
    reading=share_in_words,
    usual=1.0,
    port="Vs",
    devices=("with stabiliser",),
    equations=signal_share,
    parameters=(
        strength(
            "a", 1.0, 2.5, "", "stabiliser", "a", "1: out of service, 2: wrong sign, 0: as the model says"
        ),
    ),
    formula="Vs = (1 − a) Vs*",
    description="The stabiliser of the model was out of service (a = 1), or its input has the wrong sign (a = 2).",
    source="IEEE Std 421.5-2016, power system stabilisers",
    confused_with=("another gain of the stabiliser", "a larger damping coefficient D"),
)
UNDER_EXCITATION_ACTING = Effect(
    name="under_excitation_acting",
    title="The under-excitation limiter did not act",
    told="The under-excitation limiter {under_excitation} of {unit} did not act",
    reading=share_in_words,
    usual=1.0,
    port="VUEL",
    devices=("with under_excitation",),
    equations=signal_share,
    parameters=(
        strength(
            "a", 1.0, 1.5, "", "under-excitation limiter", "a", "1: out of service, 0: as the model says"
        ),
    ),
    formula="VUEL = (1 − a) VUEL*",
    description="The under-excitation limiter of the model was out of service (a = 1): the machine consumed more "
    "reactive power than its model allows.",
    source="IEEE Std 421.5-2016, underexcitation limiters",
    confused_with=("another limit of the limiter", "another gain of the regulator"),
)
REGULATOR_ACTING = Effect(
    name="regulator_acting",
    title="The voltage regulator did not act",
    told="The voltage regulator {exciter} of {unit} did not act",
    reading=share_in_words,
    usual=1.0,
    port="Efd",
    devices=("with exciter",),
    equations=regulator_share,
    parameters=(strength("a", 1.0, 1.5, "", "exciter", "a", "1: manual control, 0: as the model says"),),
    formula="Efd = Efd* − a (Efd* − Efd0)",
    description="The excitation was in manual control (a = 1): the field voltage stayed where it was.",
    source="IEEE Std 421.5-2016, modes of control",
    confused_with=("another gain of the regulator", "a limiter of the excitation"),
)
GOVERNOR_ACTING = Effect(
    name="governor_acting",
    title="The governor did not act",
    told="The governor {governor} of {unit} did not act",
    reading=share_in_words,
    usual=1.0,
    port="Pm",
    devices=("with governor",),
    equations=governor_share,
    parameters=(strength("a", 1.0, 1.5, "", "governor", "a", "1: blocked, 0: as the model says"),),
    formula="Pm = Pm* − a (Pm* − Pm0)",
    description="The governor was blocked (a = 1), or the unit ran at its load limit: the mechanical power stayed "
    "where it was.",
    source="IEEE Std 1207, modes of control; NERC MOD-027, base-loaded units",
    confused_with=("a larger droop", "a wide dead band"),
)
