"""What to check and what to measure next, in sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from errorscreen.data.observations import Observation
from errorscreen.discovery import Cause, CauseFinder, Gain, Group
from errorscreen.discovery.conclusions import LITTLE, other_places, placebo_text
from errorscreen.events import Playback
from errorscreen.simulators import Simulator

#: assumptions about a recording that doubt its unit, base or sign
_DOUBT = re.compile(r"before the event is .*: check ")
#: fewer held-out recordings say little about others
_FEW = 3
#: where a case file lists what the search fits together
_TOGETHER = "list it under [[together]] in the case file"


def doubts(observations: Sequence[Observation]) -> list[str]:
    """What was doubtful about units, bases and signs of the recordings of a plant.

    A grid has lines, of which no power is implausible.

    Parameters
    ----------
    observations : sequence of Observation
    """
    found = []
    for observation in observations:
        if not isinstance(observation.event, Playback):
            continue
        for sentence in observation.assumptions:
            if _DOUBT.search(sentence):
                found.append(f"{observation.event.name}: {sentence}")
    return found


def advice(
    finder: CauseFinder,
    gain: Gain | None,
    hints: Sequence[str] = (),
    *,
    refuted: bool = False,
    confirmed: bool = False,
) -> list[str]:
    """What to check and what to measure next, in sentences.

    Parameters
    ----------
    finder : CauseFinder
        Fitted, and confirmed where there are held-out recordings.
    gain : Gain or None
        None where nothing was held out, or nothing was named.
    hints : sequence of str
        See `doubts`. They come first whatever the verdict is: parameters and effects can make up for a wrong unit.
    refuted : bool
        Whether recordings that were held out contradict what was found.
    confirmed : bool
        Whether there are such recordings.
    """
    kind, first = finder.verdict_.kind, finder.causes_[0]
    out = [*hints, *(_apart(group) for group in finder.groups_)]
    if kind == "unknown":
        out += _to_locate(finder, refuted)
    elif first.event and kind == "effect":
        out.append(_about_the_event(first))
    elif kind in ("effect", "measurement"):
        out += _to_confirm(gain)
    elif not confirmed:
        out.append(
            "Record another event of the same unit and hold it out: only that shows whether "
            + ("these values hold" if kind == "parameters" else "the model as it is holds")
            + " beyond what was fitted."
        )
    return out


def _to_confirm(gain: Gain | None) -> Iterator[str]:
    """What would confirm what was named."""
    if gain is None:
        yield "Record another event of the same unit: only that can confirm what was named."
    elif placebo_text(gain):
        yield (
            "What was held out gains as much from a wrong effect: record an event of another kind, depth or duration, "
            f"and fit one of them together with this one ({_TOGETHER})."
        )
    elif len(gain.events) < _FEW:
        yield (
            f"Fewer than {_FEW} recordings were held out, which says little about other events: record some of the "
            "same unit, of another kind, depth or duration."
        )


def _apart(group: Group) -> str:
    """How to tell explanations, or places, apart."""
    names = f"{', '.join(group.names[:-1])} and {group.names[-1]}"
    if group.separating:
        event, channel, distance = group.separating[0]
        text = (
            f"{names} differ most in {channel} of an event like {event!r}, by {distance:.0f} standard deviations in "
            f"all: fit that recording together with this one ({_TOGETHER})."
        )
    else:
        text = (
            f"{names} cannot be told apart by this recording: record an event of another depth or duration and fit "
            f"it together with this one ({_TOGETHER})."
        )
    inside = [
        f"{state} of the {device or 'model'} (by {share:.0%} of its range)"
        for device, state, share in group.states
    ]
    return (
        f"{text} Inside, they differ most in {', '.join(inside)}: record what shows that." if inside else text
    )


def _about_the_event(cause: Cause) -> str:
    return (
        f"{cause.title}: this is about one recording alone. Look up what happened then, and what was noted of it; "
        "other events can neither confirm nor refute it."
    )


def _to_locate(finder: CauseFinder, refuted: bool) -> Iterator[str]:
    """Where something enters, and what would show what it is."""
    whole = len(finder.simulator.effects_named(None))
    tried = len(finder.simulator.effects_named(finder.effects))
    if tried < whole and not refuted:
        yield f"{whole - tried} of {whole} effects of the library were not tried: search with all of them."
    for place in finder.input_locations_[:1]:
        what = _ports(finder.simulator, place.device).get(place.place)
        named = "" if what is None else f"the {what.removesuffix(' in pu')}, and "
        if max(other.explained for other in finder.input_locations_) < LITTLE:
            yield (
                f"No signal at a single port explains even half of what parameters leave, the likeliest at "
                f"{place.place} of the {place.device}: check time stamps and filters of the recorded channels against "
                "each other first."
            )
            continue
        alike = other_places(finder.input_locations_)
        also = f" (or at {alike})" if alike else ""
        yield (
            f"Something unknown enters at {place.place} of the {place.device}{also}: record {named}whatever acts on it."
        )
    withdrawn = [cause for cause in finder.causes_ if cause.withdrawn]
    if withdrawn:
        yield (
            f"{withdrawn[0].title} was withdrawn, because recordings that were held out do not confirm it: fit one of "
            f"them together with this one ({_TOGETHER}), so that what is named has to explain both."
        )
    elif refuted:
        yield (
            "What is wrong does not show in what was fitted: fit a recording that was held out together with this one "
            f"({_TOGETHER})."
        )
    elif finder.causes_[0].kind != "unknown":
        yield "Give the noise of the channels, or choose a window in which nothing else moves before the event."
    elif not finder.input_locations_:
        yield (
            "No place is known at which something enters: record more quantities inside the unit, and another event "
            f"of it to fit together with this one ({_TOGETHER})."
        )


def _ports(simulator: Simulator, device: str) -> Mapping[str, str]:
    """Ports of a device and what they are, as far as that is described."""
    under_test = (*getattr(simulator, "units_under_test", ()), *getattr(simulator, "loads_under_test", ()))
    devices = {item.model.name: item.model for item in under_test}
    found = devices.get(device, getattr(simulator, "device", None))
    return {} if found is None else found.ports
