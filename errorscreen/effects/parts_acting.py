r"""Parts of the user's model that do not act as the model says: out of service, blocked, with a wrong sign.

A share a of what the part adds is taken away from its output u, which rests at u0:

.. math:: u = u^* - a\,(u^* - u_0)                                                            \qquad (A1)

so that a = 1 is a part that does not act, and a = 2 one that acts in the wrong direction.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, strength


def signal_share(value: Any, a: Any) -> Any:
    """Signal of a stabiliser or a limiter, which is zero at rest, (A1)."""
    return (value - a * value,)


def regulator_share(value: Any, Efd0: Any, a: Any) -> Any:
    """Field voltage, (A1)."""
    return (value - a * (value - Efd0),)


def governor_share(value: Any, Pm0: Any, a: Any) -> Any:
    """Mechanical power, (A1)."""
    return (value - a * (value - Pm0),)


STABILISER_ACTING = Effect(
    name="stabiliser_acting",
    title="The stabiliser does not act",
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
    title="The under-excitation limiter does not act",
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
    title="The voltage regulator does not act",
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
    title="The governor does not act",
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
