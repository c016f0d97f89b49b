r"""Forced oscillation: a source inside the plant that swings whatever the grid does.

.. math:: u = u^* + A \sin\big(2\pi f (t - t_0)\big)\ \text{for}\ t \ge t_0                     \qquad (F1)

with t counted from the beginning of the record. With a negative :math:`t_0` it swings from the beginning.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, strength, value
from errorscreen.engine.vmath import select, sincos


def oscillation(value: Any, t: Any, A: Any, f: Any, t0: Any) -> Any:
    """Disturbed quantity, and the clock, (F1)."""
    s, _ = sincos(6.283185307179586 * f * (t - t0))
    return select(t >= t0, value + A * s, value), 1.0 + 0.0 * t


def forced_oscillation(port: str, *devices: str) -> Effect:
    """Forced oscillation at a port of some devices, for example at ``"Pm"`` of ``"synchronous_machine"``.

    Examples
    --------
    >>> forced_oscillation("Pm").name
    'oscillation'
    """
    return Effect(
        name="oscillation",
        title="Forced oscillation",
        port=port,
        equations=oscillation,
        parameters=(
            strength("A", 0.02, 0.2, "pu", "forced oscillation", "A", "amplitude; 0: none"),
            value("f", 1.0, 0.1, 3.0, "Hz", "forced oscillation", "f", "frequency"),
            value("t0", 0.0, -2.0, 5.0, "s", "forced oscillation", "t_0", "start, from that of the record"),
        ),
        states=("t",),
        formula="u = u* + A sin(2π f (t − t0)), t ≥ t0",
        description="Something inside the plant (a valve, a control loop at its limit) swings by itself; the "
        "recording swings before the event already or does not settle after it, at a frequency that no mode has.",
        source="NERC, Forced Oscillation Monitoring & Mitigation, 2017",
        confused_with=("a badly damped mode", "a governor"),
        minima=8,
        event_specific=True,
        devices=devices,
    )
