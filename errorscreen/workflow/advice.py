"""Advice on what to check and what to record next, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from errorscreen._runtime.display import listed
from errorscreen.discovery import Cause, Diagnosis, Gain, Group
from errorscreen.discovery.conclusions import LITTLE, other_locations, placebo_text
from errorscreen.simulators import Simulator
from errorscreen.workflow.study import Study

#: fewer held-out recordings say little about others
_FEW = 3
#: key of a case file that lists recordings to fit together
_TOGETHER = "list it under [[together]] in the case file"


def advice(diagnosis: Diagnosis, study: Study, hints: Sequence[str] = ()) -> list[str]:
    """Advice that follows from a diagnosis, after `hints` (see `doubts`): a wrong unit can look like any cause.
    Typical values come last: where parameters suffice, they have been replaced by fitted ones.
    """
    kind, first = diagnosis.final.kind, diagnosis.causes[0]
    out = [*hints, *_at_bounds(diagnosis), *(_apart(group) for group in diagnosis.groups)]
    if kind == "nearest":
        out.append(
            f"The form of the mechanism is not that of the library ({diagnosis.named.title}): state the unit's own "
            "equations as an effect, and fit it in its place."
        )
    if kind == "unknown":
        out += _to_locate(diagnosis, study)
    elif kind == "effect" and first.event:
        out.append(
            f"{first.title}: this is about one recording alone. Look up what happened then, and how it was noted; "
            "other events can neither confirm nor refute it."
        )
    elif kind in ("effect", "measurement", "nearest"):
        out += _to_confirm(diagnosis.gain)
    elif kind == "parameters" and diagnosis.confirmed is not None:
        out += (
            []
            if hints
            else ["Take over the calibrated values: recordings that were not fitted bear them out."]
        )
    elif diagnosis.confirmed is None:
        whole = "these values hold" if kind == "parameters" else "the model as it is holds"
        out.append(
            f"Record another event of the same unit and hold it out: only that shows whether {whole} there too."
        )
    return [*out, *study.notes, *filter(None, [study.typical])]


def _at_bounds(diagnosis: Diagnosis) -> Iterator[str]:
    """Fitted parameters that end at a bound: a damping, or several, often make up for a part that is missing."""
    ended = {p.name: p.value for p in diagnosis.calibration.parameters if p.at_bound}
    dampings = {name for name in ended if name.rpartition(".")[2] == "D"}
    # a resistance may well be zero
    names = [name for name, value in ended.items() if value or name in dampings]
    if diagnosis.final.kind not in ("unknown", "parameters") or not (dampings or len(names) > 1):
        return
    yield (
        f"{listed(names)} {'ends' if len(names) == 1 else 'end'} at a bound. First allow a wider range, by relative in "
        "[device] or in [device.parameters]. A value that stays at its bound is a sign that the model lacks a part, "
        "for example a governor, a stabiliser or a damper winding."
    )


def _to_confirm(gain: Gain | None) -> Iterator[str]:
    """Recordings that would confirm the named effects."""
    if gain is None:
        yield "Record another event of the same unit: only that can confirm the named cause."
    elif placebo_text(gain):
        yield (
            "On the held-out recordings a wrong effect gains as much: record an event of another kind, depth or "
            f"duration, and fit one of them together with this one ({_TOGETHER})."
        )
    elif len(gain.events) < _FEW:
        yield (
            f"Fewer than {_FEW} recordings were held out, which says little about other events: record some of the "
            "same unit, of another kind, depth or duration."
        )


def _apart(group: Group) -> str:
    """Recordings that would tell explanations, or locations, apart."""
    names = f"{', '.join(group.names[:-1])} and {group.names[-1]}"
    if group.separating:
        best = group.separating[0]
        text = (
            f"{names} differ most in {best.channel} of an event like {best.event!r}, by {best.distance:.0f} standard "
            f"deviations in all: fit that recording together with this one ({_TOGETHER})."
        )
    else:
        text = (
            f"This recording cannot tell {names} apart: record an event of another depth or duration and fit it "
            f"together with this one ({_TOGETHER})."
        )
    inside = [f"{s.state} of the {s.device or 'model'} (by {s.share:.0%} of its range)" for s in group.states]
    if inside:
        text += f" Inside, they differ most in {', '.join(inside)}: record a signal that shows it."
    return text


def _to_locate(diagnosis: Diagnosis, study: Study) -> Iterator[str]:
    """Recordings that would show an unknown cause."""
    simulator, locations = study.simulator, diagnosis.input_locations
    whole = len(simulator.effects_named(None))
    tried = len(simulator.effects_named(study.discovery.effects)) if study.discovery.enabled else 0
    if tried < whole and not diagnosis.refuted:
        yield f"{whole - tried} of {whole} effects of the library were not tried: search with all of them."
    if locations:
        first = locations[0]
        if max(one.explained for one in locations) < LITTLE:
            yield (
                f"No input at a single port explains half of the error that parameters leave; the likeliest is "
                f"{first.place} of the {first.device}. First check time stamps and filters of the recorded channels "
                "against each other."
            )
        else:
            port = _ports(simulator, first.device).get(first.place)
            named = "" if port is None else f"the {port.removesuffix(' in pu')}, and "
            alike = other_locations(locations)
            also = f" (or at {alike})" if alike else ""
            yield (
                f"Something unknown enters at {first.place} of the {first.device}{also}: record {named}signals that "
                "act on it."
            )
    withdrawn: list[Cause] = [cause for cause in diagnosis.causes if cause.withdrawn]
    if withdrawn:
        yield (
            f"{withdrawn[0].title} was withdrawn, because held-out recordings do not confirm it: fit one of them "
            f"together with this one ({_TOGETHER}), so that the cause has to explain both."
        )
    elif diagnosis.refuted:
        yield (
            "The error does not show in the fitted recordings: fit a held-out recording together with this one "
            f"({_TOGETHER})."
        )
    elif diagnosis.causes[0].kind != "unknown":
        yield "Give the noise of the channels, or choose a window in which nothing else moves before the event."
    elif not locations:
        yield (
            "No port is known at which something enters: record more quantities inside the unit, and another event of "
            f"it to fit together with this one ({_TOGETHER})."
        )


def _ports(simulator: Simulator, device: str) -> Mapping[str, str]:
    """Ports of a device in words, if it describes them."""
    under_test = (*getattr(simulator, "units_under_test", ()), *getattr(simulator, "loads_under_test", ()))
    devices = {item.model.name: item.model for item in under_test}
    found = devices.get(device, getattr(simulator, "device", None))
    return {} if found is None else found.ports
