"""Empty slots of limiters of the excitation."""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.models.limiters.gates import OPEN
from errorscreen.models.part import Part, Start, Values


@stage("VOEL")
def no_over_excitation(omega: Any) -> Any:
    """Signal of an over-excitation limiter that is not there."""
    return (0.0 * omega,)


@stage("VUEL")
def no_under_excitation(omega: Any) -> Any:
    """Signal of an under-excitation limiter that is not there."""
    return (0.0 * omega,)


def start_over(v: Values) -> Start:
    """Open gate of an exciter."""
    return Start({}, {"OELgate": 0.0 * v["V"] + OPEN})


def start_under(v: Values) -> Start:
    """Open gate of an exciter."""
    return Start({}, {"UELgate": 0.0 * v["V"] - OPEN})


NO_OVER_EXCITATION = Part(
    name="no over-excitation limiter",
    slot="over_excitation",
    title="no over-excitation limiter",
    fields=(),
    stages=(no_over_excitation,),
    ports=("VOEL", "OELgate"),
    setpoints=("OELgate",),
    start=start_over,
)
NO_UNDER_EXCITATION = Part(
    name="no under-excitation limiter",
    slot="under_excitation",
    title="no under-excitation limiter",
    fields=(),
    stages=(no_under_excitation,),
    ports=("VUEL", "UELgate"),
    setpoints=("UELgate",),
    start=start_under,
)
