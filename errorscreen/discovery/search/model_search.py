"""Search for the effects that a model lacks: which are tried, in what order, and how far each fit goes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from zlib import crc32

import numpy as np

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import try_all
from errorscreen.discovery.fits.hypotheses import Hypothesis, JointFit, linearised
from errorscreen.discovery.search.joint_fits import fits_from_nominal, fits_from_signatures
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.search.partwise_fits import PartwiseFit, fit_growing_parts, start_partwise
from errorscreen.discovery.search.refinement import NAMED, PART, WORTH, Refinement
from errorscreen.discovery.starts.signatures import SignatureSearch
from errorscreen.effects.base import Effect

_log = logging.getLogger(__name__)

#: best fits with one effect more that are improved
_BEAM = 2
#: joint fits that begin from signatures, for each that is fitted to the end: of single effects, and beside another one
_TRIED, _TRIED_BESIDE = 2, 1
#: unless a fit has less than this share of the base fit's excess, all effects are fitted from nominal parameters
_NEARLY = 0.02
#: least probability of noise at which a fit is clearly adequate; below it the search goes on
_CLEARLY_NOISE = 0.2
#: most times that the nearest fit is restarted from all over the ranges
_TIMES = 3
#: partwise fits that reach the end, for each joint fit that does
_ARRIVE = 0.5
#: other fits below this share of the excess that are restarted from all over the ranges, and how many
_RIVAL, _RIVALS = 0.003, 3
#: most pairs that are all tried
_MOST_PAIRS = 300


class ModelSearch(Refinement):
    """Forward and backward search for effects beside the parameters; options as of `CauseFinder`."""

    def __init__(
        self,
        base: Hypothesis,
        *,
        max_effects: int,
        n_fits: int,
        n_draws: int,
        significance: float,
        seed: int,
        journal: Journal | None = None,
        plan: Sequence[str] | None = None,
    ) -> None:
        super().__init__(base, significance, seed, journal, plan)
        self.max_effects, self.n_fits, self.n_draws = max_effects, n_fits, n_draws
        self.signatures: dict[str, float] = {}

    def run(self, candidates: Sequence[Effect]) -> None:
        """Try effects beside the parameters, and sets of them as long as nothing is adequate: the steps of the plan."""
        steps: dict[str, Callable[[], None]] = {
            "add effects": lambda: self._add_effects(candidates),
            "exchange effects": lambda: self._exchange_effects(candidates),
            "restart nearest": self._restart_nearest,
            "restart again": self._restart_again,
            "drop effects": self._drop_effects,
            "complete fits": self._complete_fits,
            "improve base": self.improve_base,
            "improve parts": self._improve_parts,
            "refine values": self._refine_values,
        }
        for name in self.plan:
            if name in steps:
                with self.ledger.entry(name, self):
                    steps[name]()

    def _add_effects(self, candidates: Sequence[Effect]) -> None:
        """Forward selection: add one effect after another to the best fit, as long as nothing is adequate."""
        base = self.base
        for size in range(1, self.max_effects + 1):
            searches = self._add_one(base, candidates)
            nominal = size == 1 and "fits from nominal values" in self.plan
            if nominal and not self._clearly_adequate and not self.explained(1, _NEARLY):
                with self.ledger.entry("fits from nominal values", self):
                    self._fit_from_nominal(base, searches)
            alone = size == 1 and "restart before pairs" in self.plan
            if alone and not self.adequate and self.with_effects(1):
                with self.ledger.entry("restart before pairs", self):
                    # pairs cost more, and make up for a wrong minimum
                    self._restart_everywhere(self.beside(base)[0])
            best = self.nearest(size)
            if self.adequate or best is None or (size > 1 and not self.explained(size, PART)):
                break
            base = best

    def _fit_from_nominal(self, base: Hypothesis, searches: Sequence[SignatureSearch]) -> None:
        """Fit all effects from the nominal parameters."""
        _log.info("joint fits of all %d from the nominal parameters", len(searches))
        before = _simulated(searches)
        seeds = [self._seed(base, search.effect, 1) for search in searches]
        fits = partial(fits_from_nominal, searches, self.n_fits, seeds, self.simulator.threads)
        self._fit_sets(_problems(base, searches), fits)
        self.n_simulations += _simulated(searches) - before
        self._improve_best(self.beside(base))

    @property
    def _clearly_adequate(self) -> bool:
        """Whether parameters suffice, or a fit passes by a margin: one that just passes may be an imitation."""
        clear = (self.residual_tests[h.name].p_value > _CLEARLY_NOISE for h in self.adequate)
        return self.is_adequate(self.base) or any(clear)

    def _add_one(self, base: Hypothesis, candidates: Sequence[Effect]) -> list[SignatureSearch]:
        """Fit the effects with the best signatures beside a hypothesis; return all searches for signatures."""
        others = [effect for effect in candidates if effect not in base.effects]
        _log.info("signatures of %d effects beside %s", len(others), base.name)
        wanted = (_TRIED_BESIDE if base.effects else _TRIED) * self.n_fits
        searches = self._signatures(base, others)
        _log.info("joint fits of %d of them", min(wanted, len(searches)))
        best = searches[:wanted]
        threshold = base.objective - WORTH if self.is_adequate(base) else np.inf
        known = {frozenset(e.name for e in h.effects) for h in self.hypotheses}
        fits = partial(fits_from_signatures, base, best, self.n_fits, known, threshold)
        self._fit_sets(_problems(base, best), fits)
        self.n_simulations += _simulated(searches)
        self._improve_best(self.beside(base))
        return searches

    def _signatures(self, base: Hypothesis, effects: Sequence[Effect]) -> list[SignatureSearch]:
        """Searches for signatures at the fitted values, without effects also at the nominal ones; the best first."""
        observations = base.observations
        points = [(base.u, base.jacobian)]
        # with an effect the nominal parameters mean nothing; an adequate fit is not stuck
        if not base.effects and not self.is_adequate(base):
            problem = FitProblem(base.simulator, observations)
            nominal = np.zeros(len(base.u))
            points.append((nominal, linearised(problem, nominal)[1]))
            self.n_simulations += problem.n_simulations
        new = partial(SignatureSearch, base.simulator, observations)
        searches = [
            new(effect, points, self.n_draws, self._seed(base, effect), self.rough_step) for effect in effects
        ]
        searches = self._journal.ranked(searches, self.n_fits, base.simulator.threads)
        if not base.effects:
            self.signatures |= {s.effect.name: s.objective for s in searches if np.isfinite(s.objective)}
        return searches

    def _seed(self, base: Hypothesis, effect: Effect, *use: int) -> np.random.SeedSequence:
        """Seed by the name of an effect, so that the rest of the library does not matter."""
        return np.random.SeedSequence(
            self.seed, spawn_key=(crc32(effect.name.encode()), len(base.effects), *use)
        )

    def _fit_sets(
        self, problems: Mapping[tuple[Effect, ...], FitProblem], fits: Callable[[], Sequence[JointFit]]
    ) -> None:
        """Keep the joint fits of problems with different effects."""

        def fitted() -> list[Hypothesis]:
            ended = try_all([fit.hypothesis for fit in fits()], self.simulator.threads)
            return [hypothesis for hypothesis in ended if hypothesis is not None]

        self._keep_better(problems, fitted)

    def _improve_best(self, hypotheses: Sequence[Hypothesis]) -> None:
        """Lead the first hypotheses out of local minima, and refine the step of the lowest."""
        led = self._leave_local_minima(hypotheses[:_BEAM])
        if led and not self.adequate:
            self._refine_step(min(led, key=lambda h: h.objective))

    def _exchange_effects(self, candidates: Sequence[Effect]) -> None:
        """Try all others in place of each effect of the nearest fit, and beside effects that may be right alone.
        Forward selection may have begun with an imitation, or overlooked the second effect. Where two effects promise
        nothing alone, all pairs are tried, unless they are too many.
        """
        best = self.nearest(self.most_effects)
        if self.adequate or best is None or len(best.effects) < 2:
            return
        if not self.explained(len(best.effects), PART):
            # hardly one of them is right: nothing to begin with
            pairs = list(combinations(candidates, 2))
            if len(pairs) <= _MOST_PAIRS:
                self._fit_partwise(dict.fromkeys(pairs, self.base))
            return
        sets = _without_each(best)
        fewer = [h for h in self.with_effects(len(best.effects) - 1) if self.leaves_less(h, PART)]
        sets += [h.effects for h in sorted(fewer, key=lambda h: h.objective)[:_BEAM]]
        if len(best.effects) == 2:
            first = min(self.signatures, key=self.signatures.__getitem__, default="")
            sets += [(effect,) for effect in candidates if effect.name == first]
        bases = []
        for kept in {frozenset(effects): effects for effects in sets}.values():
            base = self.fit_of(kept) or self._refit(kept, self.base, [best], everywhere=False)
            if base is not None:
                bases.append(base)
        if bases and not self.adequate:
            self._fit_partwise({(*b.effects, e): b for b in bases for e in candidates if e not in b.effects})

    def _fit_partwise(self, sets: Mapping[tuple[Effect, ...], Hypothesis]) -> None:
        """Fit sets of effects to growing parts of the recordings, each from a fit of some of them, or of none."""
        bases: dict[frozenset[Effect], Hypothesis] = {}
        problems: dict[tuple[Effect, ...], FitProblem] = {}
        for effects, base in sets.items():
            if frozenset(effects) not in bases:
                bases[frozenset(effects)] = base
                simulator = base.simulator
                for effect in effects[len(base.effects) :]:
                    simulator = simulator.extend(effect)
                problems[effects] = FitProblem(simulator, base.observations)
        beside = " and beside ".join(dict.fromkeys(base.name for base in bases.values()))
        _log.info("%d fits to growing parts of the recordings beside %s", len(problems), beside)

        def begin(effects: tuple[Effect, ...], n: int) -> PartwiseFit:
            base = bases[frozenset(effects)]
            seed = self._seed(base, effects[-1], 2, n)
            return start_partwise(base, effects, problems[effects], n, seed, self.rough_step)

        fits = [partial(begin, effects) for effects in problems]
        wanted = max(1, round(_ARRIVE * self.n_fits))
        threads = self.simulator.threads
        self._fit_sets(problems, lambda: fit_growing_parts(fits, wanted, threads, self._may_leave_noise))
        size = len(next(iter(problems)))
        self._improve_best(sorted(self.with_effects(size), key=lambda h: h.objective))
        self.n_simulations += sum(problem.n_simulations for problem in problems.values())

    def _restart_nearest(self) -> None:
        """Where nothing is adequate, restart the nearest fits and their effects: they may be in local minima."""
        sets: list[tuple[Effect, ...]] = []
        for number in range(self.max_effects + 1):
            nearest = self.nearest(number)
            if nearest is not None:
                sets += [(effect,) for effect in nearest.effects if number > 1]
                sets.append(nearest.effects)
        # a wrong pair may be nearest because the right one is stuck
        rivals = [h for h in self.with_effects(self.most_effects) if self.leaves_less(h, _RIVAL)]
        sets += [h.effects for h in sorted(rivals, key=lambda h: h.objective)[:_RIVALS]]
        for effects in dict.fromkeys(sets):
            if self.adequate:
                return
            part = [h for h in self.hypotheses if set(h.effects) < set(effects)]
            whole = [h for h in self.hypotheses if effects and set(h.effects) > set(effects)]
            near = [max(hs, key=lambda h: self.scores[h.name]) for hs in (part, whole) if hs]
            self._refit(effects, self.base, near, everywhere=True)

    def _restart_again(self) -> None:
        """Restart the nearest fit again if it has many minima and leaves little enough to be named."""
        for times in range(2, _TIMES + 1):
            nearest = self.nearest(self.most_effects)
            if (
                self.adequate
                or nearest is None
                or all(effect.minima == 1 for effect in nearest.effects)
                or not self.explained(self.most_effects, NAMED)
                or not self.adds(nearest)
            ):
                return
            self._restart_everywhere(nearest, times)

    def _drop_effects(self) -> None:
        """Fit the best adequate hypothesis without each of its effects: forward selection may have begun wrongly."""
        if self.adequate:
            best = self.adequate[0]
            for effects in _without_each(best):
                self._refit(effects, best, [best], everywhere=bool(effects))

    def _improve_parts(self) -> None:
        """Improve single effects of the likely result that leave little, so that no pair is named for a stuck one.
        They are fitted from the fit without effects first, if this is a new one.
        """
        best = max(self.adequate or self.hypotheses, key=lambda h: self.scores[h.name])
        if not best.effects:
            return
        for effects in [best.effects, *(_without_each(best) if len(best.effects) > 1 else [])]:
            fitted = self.fit_of(effects) or self._refit(effects, best, [best, self.base], everywhere=False)
            if fitted is not None and self.base_improved:
                fitted = self._fit_from_base(fitted, best)
            if fitted is not None and len(effects) < len(best.effects) and self.leaves_less(fitted, NAMED):
                self._restart_from_neighbours(fitted, best)

    def _fit_from_base(self, hypothesis: Hypothesis, best: Hypothesis) -> Hypothesis:
        """Fit a hypothesis from the parameters without effects, with effects off and as in another fit."""
        names = hypothesis.names
        off = self.base.deviations(names)
        on = np.where(np.isin(names, self.base.names), off, best.deviations(names))
        return self._try_starts(hypothesis, lambda _: [off, on]) or hypothesis


def _simulated(searches: Sequence[SignatureSearch]) -> int:
    return sum(search.problem.n_simulations for search in searches)


def _without_each(hypothesis: Hypothesis) -> list[tuple[Effect, ...]]:
    """Effects of a hypothesis without each of them."""
    return [tuple(e for e in hypothesis.effects if e is not dropped) for dropped in hypothesis.effects]


def _problems(base: Hypothesis, searches: Sequence[SignatureSearch]) -> dict[tuple[Effect, ...], FitProblem]:
    return {(*base.effects, search.effect): search.problem for search in searches}
