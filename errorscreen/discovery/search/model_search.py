"""Hypotheses fitted in competition: which effects are tried, how far each fit goes, and what each of them leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from zlib import crc32

import numpy as np

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import attempted
from errorscreen.discovery.fits.hypotheses import Hypothesis, JointFit, linearised
from errorscreen.discovery.search.growing_fits import Growth, begun, fit_growing_parts
from errorscreen.discovery.search.joint_fits import anew, promised
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.search.refinement import NAMED, PART, WORTH, Refinement
from errorscreen.discovery.starts.signatures import SignatureSearch
from errorscreen.effects.base import Effect

#: fits with one effect more that are led further
_BEAM = 2
#: effects with the best signatures, for each that is fitted to the end, whose joint fit begins; beside another effect
#: that explains most of it, signatures say more
_TRIED, _TRIED_BESIDE = 2, 1
#: where nothing leaves less than this share of what parameters leave, all effects are fitted from nominal parameters
_NEARLY = 0.02
#: what noise alone leaves with at least this probability is clearly noise; else the search goes on
_CLEARLY_NOISE = 0.2
#: times that what would be named, but for the rest, is fitted from everywhere
_TIMES = 3
#: fits that reach the end of a race, for each that is fitted to the end elsewhere
_ARRIVE = 0.5
#: what leaves less than this share of what parameters leave is fitted from everywhere, too, so many of these at most
_RIVAL, _RIVALS = 0.003, 3
#: most pairs that are all tried
_MOST_PAIRS = 300


class ModelSearch(Refinement):
    """Fitted hypotheses about some recordings, and how they come about.

    Parameters
    ----------
    base : Hypothesis
        Without effects.
    max_effects, n_fits, n_draws, significance
        See `CauseFinder`.
    seed : int
    tell : callable
        Takes lines of text.
    journal : Journal, optional
        Of the parts that are finished.

    Attributes
    ----------
    hypotheses, residual_tests, scores, measured
        See `CandidateSet` and `Refinement`.
    signatures : dict of str to float
        Objective that each effect promised.
    n_simulations : int
    """

    def __init__(
        self,
        base: Hypothesis,
        *,
        max_effects: int,
        n_fits: int,
        n_draws: int,
        significance: float,
        seed: int,
        tell: Callable[[str], None],
        journal: Journal | None = None,
    ) -> None:
        super().__init__(base, significance, seed, tell, journal)
        self.max_effects, self.n_fits, self.n_draws = max_effects, n_fits, n_draws
        self.signatures: dict[str, float] = {}

    def run(self, candidates: Sequence[Effect]) -> None:
        """Try effects beside the parameters, and pairs of them as long as nothing is adequate."""
        self._select(candidates)
        self._exchange(candidates)
        self._spread()
        self._insist()
        self._eliminate()
        self._finish()
        base = self.base
        self.rest()
        self._compare_parts(again=self.base is not base)
        self._settle()
        self._finish()

    def _select(self, candidates: Sequence[Effect]) -> None:
        """Add one effect after another to what is best, as long as nothing is adequate."""
        base = self.base
        for size in range(1, self.max_effects + 1):
            searches = self._add(base, candidates)
            if size == 1 and not self._settled and not self.explained(1, _NEARLY):
                self.tell(f"joint fits of all {len(searches)} from the nominal parameters")
                self._compete(_problems(base, searches), partial(self._fits_anew, searches))
                self._lead(self.beside(base))
            self.n_simulations += sum(search.problem.n_simulations for search in searches)
            if size == 1 and not self.adequate and self.with_effects(1):
                # pairs are dearer, and make up for a wrong minimum
                self._everywhere(self.beside(base)[0])
            best = self.nearest(size)
            if self.adequate or best is None or (size > 1 and not self.explained(size, PART)):
                break
            base = best

    def _race(self, sets: Mapping[tuple[Effect, ...], Hypothesis]) -> None:
        """Let fits of some sets of effects grow with the recordings, each from a fit of some of them, or of none."""
        bases: dict[frozenset[Effect], Hypothesis] = {}
        problems: dict[tuple[Effect, ...], FitProblem] = {}
        for effects, base in sets.items():
            if frozenset(effects) not in bases:
                bases[frozenset(effects)] = base
                simulator = base.simulator
                for effect in effects[len(base.effects) :]:
                    simulator = simulator.extend(effect)
                problems[effects] = FitProblem(simulator, list(base.observations))
        beside = " and beside ".join(dict.fromkeys(base.name for base in bases.values()))
        self.tell(f"{len(problems)} growing fits beside {beside}")

        def begin(effects: tuple[Effect, ...], n: int) -> Growth:
            base = bases[frozenset(effects)]
            seed = self._seed(base, effects[-1], 2, n)
            return begun(base, effects, problems[effects], n, seed, self.rough_step)

        fits = [partial(begin, effects) for effects in problems]
        arrive = max(1, round(_ARRIVE * self.n_fits))
        threads = self.simulator.threads
        self._compete(
            problems, lambda: fit_growing_parts(fits, arrive, self.tell, threads, self._may_leave_noise)
        )
        size = len(next(iter(problems)))
        self._lead(sorted(self.with_effects(size), key=lambda h: h.objective))
        self.n_simulations += sum(problem.n_simulations for problem in problems.values())

    @property
    def _settled(self) -> bool:
        """Whether parameters suffice, or what leaves only noise does so clearly.

        What only just passes may imitate an effect whose signature promised little.
        """
        clear = (self.residual_tests[h.name].p_value > _CLEARLY_NOISE for h in self.adequate)
        return self.is_adequate(self.base) or any(clear)

    def _add(self, base: Hypothesis, candidates: Sequence[Effect]) -> list[SignatureSearch]:
        """Fit one effect more, of those that promise most; the searches for signatures."""
        others = [effect for effect in candidates if effect not in base.effects]
        self.tell(f"signatures of {len(others)} effects beside {base.name}")
        wanted = (_TRIED_BESIDE if base.effects else _TRIED) * self.n_fits
        searches = self._signatures(base, others)
        self.tell(f"joint fits of {min(wanted, len(searches))} of them")
        best = searches[:wanted]
        self._compete(_problems(base, best), partial(self._promised_fits, base, best))
        self._lead(self.beside(base))
        return searches

    def _exchange(self, candidates: Sequence[Effect]) -> None:
        """Try all others in place of each effect of what comes nearest to noise, and beside what may be right alone.

        Forward selection may have begun with an effect that imitates another one: a long ramp looks like a cessation.
        And a signature beside the right one may promise little: that and the parameters have made up for the second.
        Where neither of two promises anything without the other, all pairs are tried, unless they are too many.
        """
        best = self.nearest(self.most_effects)
        if self.adequate or best is None or len(best.effects) < 2:
            return
        if not self.explained(len(best.effects), PART):
            # hardly one of them is right: nothing says where to begin
            pairs = list(combinations(candidates, 2))
            if len(pairs) <= _MOST_PAIRS:
                self._race(dict.fromkeys(pairs, self.base))
            return
        sets = [tuple(e for e in best.effects if e is not dropped) for dropped in best.effects]
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
            self._race({(*b.effects, e): b for b in bases for e in candidates if e not in b.effects})

    def _signatures(self, base: Hypothesis, effects: Sequence[Effect]) -> list[SignatureSearch]:
        """Searches for signatures at the fitted values, without effects also at the nominal ones; the best first."""
        simulator, observations = base.simulator, base.observations
        points = [(base.u, base.jacobian)]
        # with an effect the nominal values of its parameters mean nothing; a fit that leaves only noise is not stuck
        if not base.effects and not self.is_adequate(base):
            problem = FitProblem(simulator, list(observations))
            nominal = np.zeros(len(base.u))
            points.append((nominal, linearised(problem, nominal)[1]))
            self.n_simulations += problem.n_simulations
        searches = [
            SignatureSearch(
                simulator,
                observations,
                effect,
                points,
                self.n_draws,
                self._seed(base, effect),
                self.rough_step,
            )
            for effect in effects
        ]
        searches = self._journal.raced(searches, self.n_fits, simulator.threads)
        if not base.effects:
            self.signatures |= {s.effect.name: s.objective for s in searches if np.isfinite(s.objective)}
        return searches

    def _compete(
        self, problems: Mapping[tuple[Effect, ...], FitProblem], fits: Callable[[], Sequence[JointFit]]
    ) -> None:
        """Make fits of some problems, of which each has other effects."""

        def fitted() -> list[Hypothesis]:
            ended = attempted([fit.hypothesis for fit in fits()], self.simulator.threads)
            return [hypothesis for hypothesis in ended if hypothesis is not None]

        self._take(problems, fitted)

    def _lead(self, hypotheses: Sequence[Hypothesis]) -> None:
        """Lead the first of some hypotheses as far as they go."""
        led = self._escape(hypotheses[:_BEAM])
        if led and not self.adequate:
            self._polish(min(led, key=lambda h: h.objective))

    def _promised_fits(self, base: Hypothesis, searches: Sequence[SignatureSearch]) -> Sequence[JointFit]:
        threshold = base.objective - WORTH if self.is_adequate(base) else np.inf
        known = {frozenset(e.name for e in h.effects) for h in self.hypotheses}
        return promised(base, searches, self.n_fits, known, threshold)

    def _fits_anew(self, searches: Sequence[SignatureSearch]) -> Sequence[JointFit]:
        seeds = [self._seed(self.base, s.effect, 1) for s in searches]
        return anew(searches, self.n_fits, seeds, self.simulator.threads)

    def _seed(self, base: Hypothesis, effect: Effect, *use: int) -> np.random.SeedSequence:
        """Of what is drawn for one effect, by its name: what else a library holds does not matter."""
        return np.random.SeedSequence(
            self.seed, spawn_key=(crc32(effect.name.encode()), len(base.effects), *use)
        )

    def _spread(self) -> None:
        """Where nothing is adequate: fit what comes nearest to noise from everywhere, also each effect of it alone.

        A fit in a local minimum looks exactly like something that no one knows.
        """
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

    def _insist(self) -> None:
        """Fit what comes nearest to noise from everywhere again, where it leaves little enough to be named.

        The more effects with thresholds and timers there are, the fewer of the starts come to the lowest minimum; of
        those without, starts that differ come to the same one.
        """
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
            self._everywhere(nearest, times)

    def _eliminate(self) -> None:
        """Fit the best adequate hypothesis without each of its effects.

        Forward selection may have started wrongly; and a fit without effects that was stuck in a local minimum looks
        exactly like a missing effect, so it is tried again from where the effect has led.
        """
        if not self.adequate:
            return
        best = self.adequate[0]
        for dropped in best.effects:
            effects = tuple(e for e in best.effects if e is not dropped)
            self._refit(effects, best, [best], everywhere=bool(effects))

    def _compare_parts(self, again: bool) -> None:
        """Lead single effects of what may be named to where nothing leads lower, if they leave little.

        Two effects must not be named because one of them alone was stuck. If asked for, they are fitted again, from
        where parameters alone have come to rest.
        """
        best = max(self.adequate or self.hypotheses, key=lambda h: self.scores[h.name])
        if not best.effects:
            return
        sets = [best.effects]
        if len(best.effects) > 1:
            sets += [tuple(e for e in best.effects if e is not dropped) for dropped in best.effects]
        for effects in sets:
            fitted = self.fit_of(effects) or self._refit(effects, best, [best, self.base], everywhere=False)
            if fitted is not None and again:
                fitted = self._from_rest(fitted, best)
            if fitted is not None and len(effects) < len(best.effects) and self.leaves_less(fitted, NAMED):
                self._rest(fitted, best)

    def _from_rest(self, hypothesis: Hypothesis, best: Hypothesis) -> Hypothesis:
        """Fit a hypothesis from where parameters alone have come to rest, with effects off and as in another fit."""
        names = hypothesis.names
        off = self.base.deviations(names)
        on = np.where(np.isin(names, self.base.names), off, best.deviations(names))
        problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), names)
        better = self._better(hypothesis, problem, lambda: [off, on])
        self.n_simulations += problem.n_simulations
        return better or hypothesis


def _problems(base: Hypothesis, searches: Sequence[SignatureSearch]) -> dict[tuple[Effect, ...], FitProblem]:
    return {(*base.effects, search.effect): search.problem for search in searches}
