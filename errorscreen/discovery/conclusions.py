"""Sentences of the verdict, and the placebo that a gain is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from errorscreen.discovery.fits.hypotheses import CORNER, Hypothesis
from errorscreen.discovery.judge.gain import Gain
from errorscreen.discovery.judge.ranking import Cause, NamedEffect, certainty
from errorscreen.discovery.judge.residual_test import ResidualTest
from errorscreen.discovery.unknown_input.locations import InputLocation
from errorscreen.effects.base import Effect
from errorscreen.simulators.base import Simulator

#: a placebo is made of effects that are less probable than this
_PLACEBO = 0.05
#: a location whose signal explains less than this share of the error is a weak hint
LITTLE = 0.5
#: least share of the error that parameters leave, and of the squared error of recordings that were not fitted, that a
#: mechanism explains which is told as the nearest one
NEAR = 0.5
#: explanations at least so many times as probable as the first are named with it
ALIKE = 1 / 20
#: most names in a sentence, and most recordings for which the time is told at which an effect acts
_TOLD, _EVENTS = 6, 3


def placebo(
    hypotheses: Sequence[Hypothesis], chosen: Hypothesis, causes: Sequence[Cause]
) -> Hypothesis | None:
    """The most evident fitted hypothesis with wrong effects and, if there is one, as many parameters as the chosen one.
    None if there is none, or the chosen one has no effect. Effects of probable causes are no placebo.
    """
    used = {e.name for e in chosen.effects}
    used |= {e.name for c in causes if c.probability > _PLACEBO for e in c.effects}
    wrong = [h for h in hypotheses if h.effects and used.isdisjoint(e.name for e in h.effects)]
    if not chosen.effects or not wrong:
        return None
    own = freedom(chosen.effects)
    # an effect of the fitted recordings alone would not show on others
    acting = [h for h in wrong if not any(e.event_specific for e in h.effects)] or wrong
    return max(acting, key=lambda h: (min(freedom(h.effects), own), h.evidence))


def freedom(effects: Sequence[Effect]) -> int:
    """Number of parameters of some effects that a fit moves."""
    return sum(len(effect.fitted) for effect in effects)


def named_text(cause: Cause, chosen: Hypothesis, base: Hypothesis, alike: Sequence[str]) -> str:
    """Reasons for a verdict that names an effect or a measurement fault, where `base` has parameters alone."""
    at = "" if cause.place in cause.title else f" (at {cause.place})"
    likely = probable(cause.probability)
    text = f"{cause.title}{at}: this explains the error that parameters leave (probability {likely})."
    text += acting_text(cause.effects)
    if cause.event:
        text += " It belongs to this recording, not to the model."
    if not cause.exact:
        text += (
            f" It leaves {100 * (1.0 - cause.explained):.2g} % of the error that parameters leave, more than noise: "
            + (
                "its form differs from the library's, and its values are the nearest ones."
                if cause.parameters
                else "something else differs as well."
            )
        )
    text += (
        f" χ²/N is {base.chi2_per_sample:.3g} with parameters alone and {chosen.chi2_per_sample:.3g} with it."
    )
    if certainty(base) < 1.0:
        text += f" Only {len(base.residuals)} readings were compared: many forms can explain so few."
    if not chosen.at_rest:
        text += (
            " Its fit did not end at a minimum, because of limiters or jumps: other values may fit better."
        )
    return text + alike_text(alike) + _cornered(base)


def nearest(causes: Sequence[Cause]) -> Cause | None:
    """The likeliest mechanism beside an unknown cause that explains at least half of what parameters leave.

    None if there is none. Faults of the measurement and events of one recording are no mechanisms of the model, and one
    whose strength ends at a bound would go beyond what makes sense.
    """
    mechanisms = (c for c in causes if c.kind == "effect" and not c.event and c.explained >= NEAR)
    # the first parameter is the strength, unless the effect is a switch
    return next((c for c in mechanisms if not any(p.at_bound for p in c.parameters[:1])), None)


def nearest_text(cause: Cause, gain: Gain, twins: Sequence[str]) -> str:
    """Reasons for a verdict that tells a mechanism as the nearest one."""
    low, high = gain.interval
    return (
        f"The nearest mechanism is: {cause.title}. On recordings that were not fitted it removes "
        f"{100 * gain.gain:.0f} % [{100 * low:.0f}, {100 * high:.0f}] of the squared error that parameters leave. It "
        f"leaves {100 * (1.0 - cause.explained):.2g} % of the error of the fitted ones, more than noise: its form "
        "differs from the library's, and its values are the nearest ones." + alike_text(twins)
    )


def acting_text(effects: Sequence[NamedEffect]) -> str:
    """From when to when effects act, in words; empty where nobody can tell."""
    text = ""
    for effect in effects:
        subject = "it" if len(effects) == 1 else effect.original
        for one in [one for one in effect.acts if one.text][:_EVENTS]:
            sentence = f"{subject} {one.text}."
            if len(effect.acts) > 1:
                sentence = f"in {one.recording} {sentence}"
            text += f" {sentence[0].upper()}{sentence[1:]}"
    return text


def probable(probability: float) -> str:
    """Probability with two digits, never rounded to certainty."""
    if 0.995 <= probability < 1.0:
        return "> 0.99"
    return "< 0.01" if 0.0 < probability < 0.005 else f"{probability:.2f}"


def placebo_text(gain: Gain) -> str:
    """Remark if a wrong effect gains as much as the named one within the interval; empty if not."""
    if gain.placebo is None or gain.placebo < gain.interval[0]:
        return ""
    return (
        f" On held-out recordings a wrong effect removes {gain.placebo:.2f} of the squared error and the named one "
        f"{gain.gain:.2f} [{gain.interval[0]:.2f}, {gain.interval[1]:.2f}]: these recordings cannot tell them apart."
    )


def alike_text(names: Sequence[str]) -> str:
    """Names of explanations that recordings cannot tell from the first, in words; empty if there is none."""
    return f" These recordings cannot tell it from: {', '.join(names)}." if names else ""


def unknown_text(
    tried: Sequence[str],
    whole: bool,
    base: Hypothesis,
    test: ResidualTest,
    closest: Hypothesis,
    near: Cause | None = None,
) -> str:
    """Reasons for the verdict "unknown": the tried effects, the fit of the parameters alone (`base`) and the test of
    its residuals, the most evident fit, and the nearest mechanism.
    """
    leaves = f"χ²/N {base.chi2_per_sample:.3g}"
    if not base.at_rest:
        return (
            f"The fit of the parameters did not end at a minimum: it leaves {leaves}, and other values may leave less. "
            "So nobody can tell whether the model lacks anything. Allow more starts, or narrow the bounds."
        )
    if not tried:
        text = f"Parameters alone leave more than noise, {leaves}; no effect was tried."
    else:
        names = ", ".join(tried[:_TOLD]) + (" and others" if len(tried) > _TOLD else "")
        which = "any effect of the library" if whole else f"any of the effects that were tried ({names})"
        text = f"Neither parameters nor {which} leave only noise: parameters alone leave {leaves}"
        if closest.effects:
            text += f", and the nearest effect, {closest.name}, leaves {closest.chi2_per_sample:.3g}"
        text += "."
    text += (
        f" What parameters leave is most conspicuous in {_cell_text(test)}. If the model may be wrong by that much, "
        "state it (`simulation.model_error`)."
    )
    if near is not None:
        text += (
            f" The nearest mechanism is: {near.title}. It leaves {100 * (1.0 - near.explained):.2g} % of the error "
            "that parameters leave; recordings that were not fitted tell whether it is of this kind."
        )
    return text + _cornered(base)


def conspicuous_text(test: ResidualTest, significance: float) -> str:
    """Remark on parameters that are kept although one cell of the error exceeds noise; empty if none does."""
    if test.p_value > significance:
        return ""
    return (
        f" The most conspicuous cell is {_cell_text(test)} (noise alone: p = {test.p_value:.2g}). No effect explains "
        "it better."
    )


def _cell_text(test: ResidualTest) -> str:
    """The most conspicuous cell of an error in words."""
    worst = test.significant[0] if test.significant else max(test.cells, key=lambda c: c.ratio)
    low, high = worst.band
    band = f"{low:.2g} to {high:.2g} Hz" if np.isfinite(high) else f"above {low:.2g} Hz"
    return f"{worst.channel} of {worst.recording}, {worst.stage}, {band}: {worst.ratio:.2g} times the energy of noise"


def _cornered(base: Hypothesis) -> str:
    """Remark if the fit of the parameters ended at no smooth minimum."""
    if base.state != CORNER:
        return ""
    return (
        " The fit of the parameters ended where limiters begin to act, not at a smooth minimum. No start around it "
        "lowered the rest by enough to matter."
    )


def location_text(locations: Sequence[InputLocation], simulator: Simulator) -> str:
    """Where an unknown input enters, as far as the simulator has ports for it."""
    if locations:
        first = locations[0]
        percent = np.floor(1000.0 * first.explained) / 10.0  # never rounded up to all of it
        text = (
            f"Something unknown enters at {first.name}: {first.text}. It explains {percent:.3g} % of the error that "
            "parameters leave."
        )
        alike = other_locations(locations)
        if alike:
            text += f" These recordings cannot tell it from an input at {alike}."
        if max(location.explained for location in locations) < LITTLE:
            text += " That is little: time stamps and filters of the recording may be wrong instead."
        return text
    if not any(effect.kind == "latent" for effect in simulator.effects):
        return "The simulator has no ports, so nobody can tell where anything enters."
    return "An unknown input explains it at none of the simulator's ports."


def alike_locations(locations: Sequence[InputLocation]) -> list[InputLocation]:
    """The first location and those that the recordings cannot tell from it."""
    return [one for one in locations if one.probability >= ALIKE * locations[0].probability]


def other_locations(locations: Sequence[InputLocation]) -> str:
    """Locations that cannot be told from the first, in words; empty if there is none."""
    return ", or at ".join(one.name for one in alike_locations(locations)[1 : _TOLD + 1])


def withdrawn_text(cause: Cause, gain: Gain) -> str:
    """Why the named effects are withdrawn."""
    failed = [event.recording for event in gain.events if not np.isfinite(event.extended)]
    if failed:
        judged = f"the model with it cannot be simulated on held-out ones: {', '.join(failed)}"
    else:
        low, high = gain.interval
        other = "" if gain.placebo is None else f", a placebo {gain.placebo:.2f}"
        judged = f"gains nothing on held-out ones: {gain.gain:.2f} [{low:.2f}, {high:.2f}] of the squared error{other}"
    return f"{cause.title} explains the fitted recordings, but {judged}. The extension is withdrawn."


def withdrawn(causes: Sequence[Cause]) -> list[Cause]:
    """Causes after the first has been refuted: its probability goes to "unknown"."""
    first, others = causes[0], [c for c in causes[1:] if c.kind != "unknown"]
    unknown = next(c for c in causes if c.kind == "unknown")
    unknown = replace(unknown, probability=unknown.probability + first.probability)
    return [unknown, replace(first, probability=0.0, withdrawn=True), *others]
