"""Joint fits with one effect more: from the best signatures, or of all effects from the nominal parameters.

A signature overlooks an effect if parameters have made up for it or must move far; fits from nominal values cost more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial

import numpy as np

from errorscreen._runtime.threads import parallel_map
from errorscreen.discovery.fits.halving import fit_to_end, try_all
from errorscreen.discovery.fits.hypotheses import SLICE, Hypothesis, JointFit
from errorscreen.discovery.starts.signatures import SignatureSearch
from errorscreen.effects.base import Effect

#: starts from a signature, and starts that are kept after the first iterations
_STARTS, _KEPT = 3, 2
#: starts at the nominal parameters; iterations before some fits are dropped; effects that go on for each wanted one
_NOMINAL_STARTS, _FIRST, _HALFWAY = 4, 2, 3
#: simulations with all parameters drawn, for further starts of a single effect: at most, and for each parameter
_MATCHES, _MATCHES_EACH = 256, 32


def fits_from_signatures(
    base: Hypothesis,
    searches: Sequence[SignatureSearch],
    n_fits: int,
    known: Collection[frozenset[str]],
    threshold: float,
) -> Sequence[JointFit]:
    """Fit effects beside those of a hypothesis from their signatures; the best `n_fits` are fitted to the end.
    Effects that promise no objective below `threshold`, and `known` sets of names, are left out.
    """
    matches = 0 if base.effects else min(_MATCHES, _MATCHES_EACH * len(base.u))

    def begin(search: SignatureSearch, effects: tuple[Effect, ...]) -> JointFit:
        fit = JointFit(effects, search.problem, search.starts(matches), step=search.step)
        return fit.keep(_STARTS).run(SLICE).keep(_KEPT)

    calls = []
    for search in searches:
        effects = (*base.effects, search.effect)
        hopeless = search.objective > threshold or not np.isfinite(search.objective)
        if not (hopeless or frozenset(e.name for e in effects) in known):
            calls.append(partial(begin, search, effects))
    threads = base.simulator.threads
    return fit_to_end(_best(try_all(calls, threads), n_fits), threads)


def fits_from_nominal(
    searches: Sequence[SignatureSearch],
    n_fits: int,
    seeds: Sequence[np.random.SeedSequence],
    threads: int = 1,
) -> Sequence[JointFit]:
    """Fit single effects from the nominal parameters; the best `n_fits` are fitted to the end.
    Of an event-specific effect only the best recording goes on: it would crowd out all others.
    """

    def begin(search: SignatureSearch, seed: np.random.SeedSequence) -> JointFit:
        starts = search.nominal_starts(_NOMINAL_STARTS, seed)
        return JointFit([search.effect], search.problem, starts, step=search.step).run(_FIRST).keep(_KEPT)

    same: dict[str, list[JointFit]] = {}
    calls = [partial(begin, search, seed) for search, seed in zip(searches, seeds, strict=True)]
    for fit in try_all(calls, threads):
        if fit is not None:
            same.setdefault(fit.effects[0].original, []).append(fit)
    fits = _best([_best(recordings, 1)[0] for recordings in same.values()], _HALFWAY * n_fits)
    parallel_map([partial(fit.run, _FIRST) for fit in fits], threads)
    return fit_to_end(_best([fit.keep(1) for fit in fits], n_fits), threads)


def _best(fits: Collection[JointFit | None], n: int) -> list[JointFit]:
    return sorted((fit for fit in fits if fit is not None), key=lambda fit: fit.objective)[:n]
