"""Joint fits with one effect more: first from what signatures promise, then of all effects from nominal parameters.

A signature is linear in the parameters. Where these have made up for much of an effect, or would have to move far
beside it, it overlooks the effect; some iterations of a joint fit from the nominal values do not, but cost more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial

import numpy as np

from errorscreen._runtime.threads import parallel_map
from errorscreen.discovery.fits.halving import attempted, race
from errorscreen.discovery.fits.hypotheses import SLICE, Hypothesis, JointFit
from errorscreen.discovery.starts.signatures import SignatureSearch
from errorscreen.effects.base import Effect

#: starts that are followed from what a signature promises, and those that are kept after the first iterations
_BEGUN, _KEPT = 3, 2
#: values of an effect's own parameters from which fits begin beside nominal ones, iterations after which some of them
#: are dropped, and effects that go on then for each that is fitted to the end
_SCATTERED, _FIRST, _HALFWAY = 4, 2, 3
#: simulations of all parameters together, from which further starts of a single effect are taken: at most, and for each
#: parameter of the model
_MATCHES, _MATCHES_EACH = 256, 32


def promised(
    base: Hypothesis,
    searches: Sequence[SignatureSearch],
    n_fits: int,
    known: Collection[frozenset[str]],
    threshold: float,
) -> Sequence[JointFit]:
    """Fit effects for a few iterations from their signatures, and those that get furthest to the end.

    Parameters
    ----------
    base : Hypothesis
        To which the effects are added.
    searches : sequence of SignatureSearch
        Of these effects.
    n_fits : int
        How many are fitted to the end.
    known : collection of frozenset of str
        Names of effects that have been fitted together.
    threshold : float
        Effects that promise no lower objective are left out.
    """
    matches = 0 if base.effects else min(_MATCHES, _MATCHES_EACH * len(base.u))
    calls = []
    for search in searches:
        effects = (*base.effects, search.effect)
        hopeless = search.objective > threshold or not np.isfinite(search.objective)
        if not (hopeless or frozenset(e.name for e in effects) in known):
            calls.append(partial(_promised, search, effects, matches))
    threads = base.simulator.threads
    return race(_furthest(attempted(calls, threads), n_fits), threads)


def _promised(search: SignatureSearch, effects: tuple[Effect, ...], matches: int) -> JointFit:
    fit = JointFit(effects, search.problem, search.starts(matches), step=search.step)
    return fit.keep(_BEGUN).run(SLICE).keep(_KEPT)


def anew(
    searches: Sequence[SignatureSearch],
    n_fits: int,
    seeds: Sequence[np.random.SeedSequence],
    threads: int = 1,
) -> Sequence[JointFit]:
    """Fit single effects for a few iterations from the nominal parameters, and those that get furthest to the end.

    Of an effect that may act in each of several recordings, only the best goes on: it would crowd out all others.

    Parameters
    ----------
    searches : sequence of SignatureSearch
        Of these effects, beside parameters alone.
    n_fits : int
        How many are fitted to the end.
    seeds : sequence of SeedSequence
        One for each search.
    threads : int
        Of which each has one fit at a time.
    """
    begun: dict[str, list[JointFit]] = {}
    calls = [partial(_anew, search, seed) for search, seed in zip(searches, seeds, strict=True)]
    for fit in attempted(calls, threads):
        if fit is not None:
            begun.setdefault(fit.effects[0].original, []).append(fit)
    fits = _furthest([_furthest(same, 1)[0] for same in begun.values()], _HALFWAY * n_fits)
    parallel_map([partial(fit.run, _FIRST) for fit in fits], threads)
    return race(_furthest([fit.keep(1) for fit in fits], n_fits), threads)


def _anew(search: SignatureSearch, seed: np.random.SeedSequence) -> JointFit:
    starts = search.scattered(_SCATTERED, seed)
    return JointFit([search.effect], search.problem, starts, step=search.step).run(_FIRST).keep(_KEPT)


def _furthest(fits: Collection[JointFit | None], n: int) -> list[JointFit]:
    return sorted((fit for fit in fits if fit is not None), key=lambda fit: fit.objective)[:n]
