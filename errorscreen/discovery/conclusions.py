"""What follows from fitted hypotheses: sentences of the verdict, and a placebo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from errorscreen.discovery.fits.hypotheses import CORNER, Hypothesis
from errorscreen.discovery.judge.gain import Gain
from errorscreen.discovery.judge.ranking import Cause
from errorscreen.discovery.judge.residual_test import ResidualTest
from errorscreen.discovery.unknown_input.locations import InputLocation
from errorscreen.effects.base import Effect
from errorscreen.simulators.base import Simulator

#: an effect of which a placebo is made must be less probable than this
_PLACEBO = 0.05
#: a place whose signal explains less than this share of what parameters leave is a weak hint
LITTLE = 0.5
#: explanations at least so many times as probable as the first cannot be told from it
ALIKE = 1 / 20
#: names of effects that are told in a sentence, at most
_TOLD = 6


def placebo(
    hypotheses: Sequence[Hypothesis], chosen: Hypothesis, causes: Sequence[Cause]
) -> Hypothesis | None:
    """Fitted hypothesis with wrong effects that has the most parameters, up to those of what was chosen.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
    chosen : Hypothesis
    causes : sequence of Cause
        What they consider possible is no placebo.

    Returns
    -------
    Hypothesis or None
        The most evident of those with as many parameters; None where nothing wrong was fitted, or nothing was chosen.
    """
    used = {e.name for e in chosen.effects}
    used |= {name for c in causes if c.probability > _PLACEBO for name in c.name.split(" + ")}
    wrong = [h for h in hypotheses if h.effects and used.isdisjoint(e.name for e in h.effects)]
    if not chosen.effects or not wrong:
        return None
    own = freedom(chosen.effects)
    # what acts in the fitted recordings only would not show on others
    acting = [h for h in wrong if not any(e.event_specific for e in h.effects)] or wrong
    return max(acting, key=lambda h: (min(freedom(h.effects), own), h.evidence))


def freedom(effects: Sequence[Effect]) -> int:
    """Number of parameters of some effects."""
    return sum(len(effect.parameters) for effect in effects)


def named_text(cause: Cause, chosen: Hypothesis, base: Hypothesis, alike: Sequence[str]) -> str:
    """Reasons for a verdict that names something.

    Parameters
    ----------
    cause : Cause
    chosen, base : Hypothesis
        With it, and with parameters alone.
    alike : sequence of str
        What these recordings cannot tell it from.
    """
    at = "" if cause.place in cause.title else f" (at {cause.place})"
    text = (
        f"{cause.title}{at} explains what parameters cannot, with probability {probable(cause.probability)}."
    )
    if cause.event:
        text += " It belongs to what happened during this recording, and not to the model."
    if not cause.exact:
        text += (
            f" It leaves {100 * (1.0 - cause.explained):.2g} % of what parameters leave, which is more than noise: its "
            "form is not exactly the library's, and values are those that come nearest."
        )
    text += f" χ²/N is {base.chi2_per_sample:.3g} with parameters alone, "
    text += f"{chosen.chi2_per_sample:.3g} with what was chosen."
    if not chosen.at_rest:
        text += (
            " Its fit did not end at a minimum, because limiters or jumps are in the way, so that other values may "
            "leave less."
        )
    return text + alike_text(alike) + _cornered(base)


def probable(probability: float) -> str:
    """Probability with two digits, never rounded to certainty.

    Examples
    --------
    >>> probable(0.964), probable(0.998), probable(0.001)
    ('0.96', '> 0.99', '< 0.01')
    """
    if 0.995 <= probability < 1.0:
        return "> 0.99"
    return "< 0.01" if 0.0 < probability < 0.005 else f"{probability:.2f}"


def placebo_text(gain: Gain) -> str:
    """Remark where a wrong effect gains as much as what was named, as far as the interval tells; empty if not."""
    if gain.placebo is None or gain.placebo < gain.interval[0]:
        return ""
    return (
        f" A wrong effect gains {gain.placebo:.2f} of the squared error on recordings that were not fitted, what was "
        f"named {gain.gain:.2f} [{gain.interval[0]:.2f}, {gain.interval[1]:.2f}]: these do not tell one from the other."
    )


def alike_text(names: Sequence[str]) -> str:
    """What recordings cannot tell an explanation from, in words; empty if there is nothing."""
    return f" These recordings cannot tell it from: {', '.join(names)}." if names else ""


def unknown_text(
    tried: Sequence[str],
    whole: bool,
    base: Hypothesis,
    closest: Hypothesis,
) -> str:
    """Reasons for the verdict "unknown".

    Parameters
    ----------
    tried : sequence of str
        Names of the effects.
    whole : bool
        Whether these are all of the library.
    base, closest : Hypothesis
        With parameters alone, and what is most evident of all that was fitted.
    """
    leaves = f"χ²/N {base.chi2_per_sample:.3g}"
    if not base.at_rest:
        return (
            f"The search without effects has not come to an end: so far parameters alone leave {leaves}, and other "
            "values of them may leave less. So it cannot be told whether anything is missing. Allow more starts, or "
            "narrow the bounds."
        )
    if not tried:
        text = f"Parameters alone leave more than noise, {leaves}; no effect was tried."
    else:
        names = ", ".join(tried[:_TOLD]) + (" and others" if len(tried) > _TOLD else "")
        which = "any effect of the library" if whole else f"any of the effects that were tried ({names})"
        text = f"Neither parameters nor {which} leave only noise: parameters alone leave {leaves}"
        if closest.effects:
            text += f", the closest, {closest.name}, {closest.chi2_per_sample:.3g}"
        text += "."
    return text + _cornered(base)


def conspicuous_text(remainder: ResidualTest, significance: float) -> str:
    """What to say of parameters that are kept although one cell of the errors is more than noise."""
    if remainder.p_value > significance:
        return ""
    worst = remainder.significant[0] if remainder.significant else max(remainder.cells, key=lambda c: c.ratio)
    return (
        f" Most conspicuous is {worst.channel} of {worst.recording}, {worst.stage}: {worst.ratio:.2g} times the energy "
        f"of noise (noise alone: p = {remainder.p_value:.2g}); no effect explains that better."
    )


def _cornered(base: Hypothesis) -> str:
    """Remark where parameters alone have come to rest at no smooth minimum."""
    if base.state != CORNER:
        return ""
    return (
        " The search without effects ended where limiters begin to act, not at a smooth minimum; no start around it "
        "led lower by a thousandth of what is left."
    )


def place_text(places: Sequence[InputLocation], simulator: Simulator) -> str:
    """Where something unknown enters, as far as the simulator has places for it."""
    if places:
        first = places[0]
        text = (
            f"A signal that enters at {first.name} would explain it best, "
            f"{_percent(first.explained)} of what parameters leave ({first.text})."
        )
        alike = other_places(places)
        if alike:
            text += f" These recordings do not tell it from a signal at {alike}."
        if max(place.explained for place in places) < LITTLE:
            text += " That is little: time stamps and filters of what was recorded may be wrong instead."
        return text
    if not any(effect.kind == "latent" for effect in simulator.effects):
        return "The simulator has no ports: what it lacks inside could neither be tried nor located."
    return "An unknown signal explains it at none of the simulator's ports."


def alike_places(places: Sequence[InputLocation]) -> list[InputLocation]:
    """The first place and those that cannot be told from it."""
    return [place for place in places if place.probability >= ALIKE * places[0].probability]


def other_places(places: Sequence[InputLocation]) -> str:
    """Places that cannot be told from the first, in words; empty if there is none."""
    return ", or at ".join(place.name for place in alike_places(places)[1 : _TOLD + 1])


def _percent(share: float) -> str:
    """Share in per cent, never rounded up to all of it."""
    return f"{np.floor(1000.0 * share) / 10.0:.3g} %"


def withdrawn_text(cause: Cause, gain: Gain) -> str:
    """Why what was named is withdrawn."""
    failed = [event.recording for event in gain.events if not np.isfinite(event.extended)]
    if failed:
        judged = f"with it the model cannot be simulated on recordings that were not: {', '.join(failed)}"
    else:
        low, high = gain.interval
        other = "" if gain.placebo is None else f", a placebo {gain.placebo:.2f}"
        judged = (
            f"gains nothing on recordings that were not: {gain.gain:.2f} [{low:.2f}, {high:.2f}] of the squared "
            f"error{other}"
        )
    return f"{cause.title} explains what was fitted but {judged}. The extension is withdrawn."


def withdrawn(causes: Sequence[Cause]) -> list[Cause]:
    """Causes after the first has been refuted: what was its probability is that of something unknown."""
    first, others = causes[0], [c for c in causes[1:] if c.kind != "unknown"]
    unknown = next(c for c in causes if c.kind == "unknown")
    unknown = replace(unknown, probability=unknown.probability + first.probability)
    return [unknown, replace(first, probability=0.0, withdrawn=True), *others]
