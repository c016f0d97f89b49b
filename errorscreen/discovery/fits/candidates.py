"""Effects that a search tries, of all that a simulator has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from errorscreen.data.observations import Observation
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator


def candidates(
    simulator: Simulator, observations: Sequence[Observation], names: Iterable[str] | None = None
) -> list[Effect]:
    """Effects to try, of these names or all; an event-specific one once for each recording, told apart by event names.
    An error of the event's record may also be common to several recordings: a relay that is always late.
    """
    events = {o.event.name: o.event for o in observations}
    found: list[Effect] = []
    for effect in simulator.effects_named(names):
        if not effect.event_specific or effect.recording:
            found.append(effect)
            continue
        happened = [name for name, event in events.items() if _applies(effect, event)]
        if len(events) == 1:
            found += [effect.during(name, rename=False) for name in happened]
            continue
        found += [effect.during(name) for name in happened]
        if effect.kind == "event" and len(happened) > 1:
            found.append(effect)
    return simulator.addable(found, asked=names is not None)


def _applies(effect: Effect, event: Event) -> bool:
    """Whether an effect can change an event: a fault duration does not apply to a load step."""
    if effect.kind != "event":
        return True
    return effect.equations(event, *(p.nominal for p in effect.parameters)) is not event
