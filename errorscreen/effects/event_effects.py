r"""Event effects: the event in the grid differed from its record.

.. math::

    t_{clear} &= t_{clear}^* + d                                                            & (E1)\\
    Z_f &= Z_f^* + j x                                                                      & (E2)\\
    Y_{branch} &= (1 - s)\,Y_{branch}^*\ \text{once the fault is cleared}                     & (E3)

Another duration (E1) or impedance (E2) of a fault, and a branch that opens when the fault is cleared (E3), wholly for
s = 1.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from errorscreen.effects.base import Effect, strength
from errorscreen.events import BusFault

#: shortest fault in seconds
_SHORTEST = 0.005


def longer(event: Any, d: float) -> Any:
    """Fault that lasts d seconds longer, (E1); other events stay as they are."""
    if not isinstance(event, BusFault):
        return event
    return replace(event, duration=max(min(_SHORTEST, event.duration), event.duration + d))


def with_reactance(event: Any, x: float) -> Any:
    """Fault over an additional reactance in pu, (E2); other events stay as they are."""
    if not isinstance(event, BusFault):
        return event
    return replace(event, impedance=event.impedance + 1j * x)


def with_trip(event: Any, s: float, ends: tuple[int, int], circuit: str | None = None) -> Any:
    """Fault whose clearing also opens the share s of a branch, (E3); other events stay as they are."""
    if not isinstance(event, BusFault) or event.bus not in ends:
        return event
    return replace(event, opened=(*event.opened, (*ends, float(s), circuit)))


FAULT_DURATION = Effect(
    "fault_duration", "Fault of another duration", "event", longer,
    (strength("d", 0.02, 0.1, "s", "event", "d", "additional duration; 0: as recorded", -0.05),), kind="event",
    event_specific=True,
    formula="clearing time = recorded + d",
    description="Protection cleared the fault later or earlier than the event list says: all channels are wrong from "
    "the recorded clearing on.",
    source="definition, (E1)",
    confused_with=("another fault impedance", "a branch opened with the fault"),
)  # fmt: skip
FAULT_IMPEDANCE = Effect(
    "fault_impedance", "Fault with an impedance", "event", with_reactance,
    (strength("x", 0.01, 0.1, "pu", "event", "x", "additional reactance; 0: as recorded"),), kind="event",
    event_specific=True,
    formula="Zf = Zf* + j x",
    description="The fault was not bolted: the dip is less deep than in the simulation.",
    source="definition, (E2)",
    confused_with=("a fault of another duration", "a fault further away"),
)  # fmt: skip


def branch_trip(ends: tuple[int, int], circuit: str | None = None) -> Effect:
    """Branch that is opened when a fault at one of its ends is cleared.

    Parameters
    ----------
    ends : (int, int)
        Its buses.
    circuit : str, optional
        Needed where there are several.

    Examples
    --------
    >>> branch_trip((3, 4)).name, branch_trip((3, 4), "2").name
    ('trip_3_4', 'trip_3_4_2')
    """
    names = [str(name) for name in (*ends, circuit) if name is not None]
    return Effect(
        "_".join(["trip", *names]), f"Branch {'-'.join(names)} opened with the fault", "event",
        partial(with_trip, ends=ends, circuit=circuit),
        (strength("s", 1.0, 1.0, "", "event", "s", "share of the branch that is opened; 0: none"),), kind="event",
        event_specific=True,
        formula="Y = (1 − s) Y* from clearing on",
        description="Protection cleared the fault by opening a branch, which the simulation leaves in service: another "
        "steady state and another swing.",
        source="definition, (E3)",
        confused_with=("another load", "a fault of another duration"),
    )  # fmt: skip
