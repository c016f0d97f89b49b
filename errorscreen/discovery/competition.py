"""Hypotheses fitted in competition: which effects are tried, how far each fit goes, and what each of them leaves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import Hypothesis, JointFit, fit_hypothesis, linearised
from errorscreen.discovery.journal import Journal
from errorscreen.discovery.restarts import elsewhere, escapes, followed, off_the_edge, searched
from errorscreen.discovery.signatures import SignatureSearch, projected
from errorscreen.discovery.standings import Standings
from errorscreen.discovery.waves import anew, promised
from errorscreen.effects.base import Effect
from errorscreen.observations import Observation
from errorscreen.simulators.base import Simulator

#: single effects to which a second one is added
_BEAM = 2
#: an effect that does not promise to lower the objective by this much is not fitted beside parameters that suffice
_WORTH = 4.0
#: effects with the best signatures, for each that is fitted to the end, whose joint fit begins; beside another effect
#: that explains most of it, signatures say more
_TRIED, _TRIED_BESIDE = 2, 1
#: ways out of a local minimum that are followed
_KEPT = 2
#: times that a fit is led out of a local minimum
_ESCAPES = 3
#: what leaves more than this share of what parameters leave is not worth it
_PART = 0.5
#: most parameters of a model with its effects, for a search of all their ranges
_FEW = 8
#: a fit whose χ²/N is at most this is tried with a step so many times smaller, and fitted with it if the linear model
#: promises to leave at most this share of what is beyond noise
_NEAR, _FINER, _LEFT = 50.0, 4, 0.5
#: where nothing leaves less than this share of what parameters leave, all effects are fitted from nominal parameters
_NEARLY = 0.02
#: what noise alone leaves with at least this probability is clearly noise; else the search goes on
_CLEARLY_NOISE = 0.2
#: what leaves more than this share of what parameters leave will not be named
_NAMED = 0.1
_Array = NDArray[np.float64]


class Competition(Standings):
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
    hypotheses, remainders, scores
        See `Standings`.
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
        super().__init__(significance, seed, tell)
        self.max_effects, self.n_fits, self.n_draws = max_effects, n_fits, n_draws
        self._journal = Journal() if journal is None else journal
        self.simulator = base.simulator
        self.signatures: dict[str, float] = {}
        self.n_simulations = 0
        self._spread_out: set[str] = set()
        self._extended: set[str] = set()  # what others have been tried beside
        self._led: set[float] = set()  # objectives of fits that have no way out
        self.keep(base, self.test(base))
        self._polish(base)

    def run(self, candidates: Sequence[Effect]) -> None:
        """Try effects beside the parameters, and pairs of them as long as nothing is adequate."""
        self._extend(self.base, candidates, 1)
        self._exchange(candidates)
        self._spread()
        self._eliminate()
        self._finish()
        self._settle()

    def _extend(self, base: Hypothesis, candidates: Sequence[Effect], depth: int) -> None:
        """Add one effect to a hypothesis, and another to the best of these where none is adequate."""
        searches = self._add(base, candidates)
        if depth == 1 and not self._settled and not self.explained(1, _NEARLY):
            self.tell(f"joint fits of all {len(searches)} from the nominal parameters")
            self._compete(base, searches, self._fits_anew)
        self.n_simulations += sum(search.problem.n_simulations for search in searches)
        if depth == 1 and not self.adequate and self.beside(base):
            self._everywhere(self.beside(base)[0])  # pairs are dearer, and make up for a wrong minimum
        if depth < self.max_effects and not self.adequate:
            for hypothesis in sorted(self.beside(base), key=lambda h: -h.evidence)[:_BEAM]:
                self._extend(hypothesis, candidates, depth + 1)
                if self.adequate or not self.explained(depth + 1, _PART):
                    break

    @property
    def _settled(self) -> bool:
        """Whether parameters suffice, or what leaves only noise does so clearly.

        What only just passes may imitate an effect whose signature promised little.
        """
        clear = (self.remainders[h.name].p_value > _CLEARLY_NOISE for h in self.adequate)
        return self.is_adequate(self.base) or any(clear)

    def _add(
        self, base: Hypothesis, candidates: Sequence[Effect], near: Hypothesis | None = None
    ) -> list[SignatureSearch]:
        """Fit one effect more, of those that promise most; the searches for signatures."""
        others = [effect for effect in candidates if effect not in base.effects]
        self.tell(f"signatures of {len(others)} effects beside {base.name}")
        self._extended.add(base.name)
        wanted = (_TRIED_BESIDE if base.effects else _TRIED) * self.n_fits
        searches = self._signatures(base, others, near)
        self.tell(f"joint fits of {min(wanted, len(searches))} of them")
        self._compete(base, searches[:wanted], self._promised_fits)
        return searches

    def _exchange(self, candidates: Sequence[Effect]) -> None:
        """Try others in place of each effect of what comes nearest to noise, where that explains most of it.

        Forward selection may have begun with an effect that imitates another one: a long ramp looks like a cessation.
        """
        best = self.nearest(self.max_effects)
        if best is None or len(best.effects) < 2 or not self.explained(len(best.effects), _NAMED):
            return
        for dropped in best.effects:
            if self.adequate:
                return
            kept = [effect for effect in best.effects if effect is not dropped]
            base = self.fit_of(kept) or self._refit(kept, self.base, [best], everywhere=False)
            if base is not None and base.name not in self._extended:
                searches = self._add(base, candidates, best)
                self.n_simulations += sum(search.problem.n_simulations for search in searches)

    def _signatures(
        self, base: Hypothesis, effects: Sequence[Effect], near: Hypothesis | None = None
    ) -> list[SignatureSearch]:
        """Searches for signatures at the fitted values, the most promising first.

        Without effects also at the nominal values, and else at those of another hypothesis that has more effects.
        """
        simulator, observations = base.simulator, base.observations
        points = [(base.u, base.jacobian)]
        other = None if near is None else near.deviations(base.names)
        # with an effect the nominal values of its parameters mean nothing; a fit that leaves only noise is not stuck
        if not base.effects and not self.is_adequate(base):
            other = np.zeros(len(base.u))
        if other is not None:
            problem = FitProblem(simulator, list(observations))
            points.append((other, linearised(problem, other)[1]))
            self.n_simulations += problem.n_simulations
        searches = [
            SignatureSearch(simulator, observations, effect, points, self.n_draws, self._seed(base, effect))
            for effect in effects
        ]
        searches = self._journal.raced(searches, self.n_fits)
        if not base.effects:
            self.signatures |= {s.effect.name: s.objective for s in searches if np.isfinite(s.objective)}
        return searches

    def _compete(
        self,
        base: Hypothesis,
        searches: Sequence[SignatureSearch],
        fits: Callable[[Hypothesis, Sequence[SignatureSearch]], Sequence[JointFit]],
    ) -> None:
        """Fit one effect more each, and lead the best of them as far as they go."""
        problems = {search.effect.name: search.problem for search in searches}
        for fitted in self._journal.all_fitted(
            base.effects, problems, lambda: [fit.hypothesis() for fit in fits(base, searches)]
        ):
            before = self.fit_of(fitted.effects)
            if before is None or fitted.objective < before.objective - _WORTH:
                self.keep(fitted, self.test(fitted), before)
        for hypothesis in self.beside(base)[:_BEAM]:
            if hypothesis.objective not in self._led:
                self._led.add(self._escape(hypothesis).objective)
        if not self.adequate and self.beside(base):
            self._polish(self.beside(base)[0])

    def _promised_fits(self, base: Hypothesis, searches: Sequence[SignatureSearch]) -> Sequence[JointFit]:
        threshold = base.objective - _WORTH if self.is_adequate(base) else np.inf
        known = {frozenset(e.name for e in h.effects) for h in self.hypotheses}
        return promised(base, searches, self.n_fits, known, threshold)

    def _fits_anew(self, base: Hypothesis, searches: Sequence[SignatureSearch]) -> Sequence[JointFit]:
        return anew(searches, self.n_fits, [self._seed(base, s.effect, 1) for s in searches])

    def _seed(self, base: Hypothesis, effect: Effect, *use: int) -> np.random.SeedSequence:
        """Of what is drawn for one effect, by its name: what else a library holds does not matter."""
        return np.random.SeedSequence(
            self.seed, spawn_key=(crc32(effect.name.encode()), len(base.effects), *use)
        )

    def _escape(self, hypothesis: Hypothesis) -> Hypothesis:
        """Follow ways out of a local minimum, as long as they lead lower; with few parameters, search everywhere."""
        problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
        for _ in range(_ESCAPES):
            if self.is_adequate(hypothesis):
                break
            better = self._better(hypothesis, problem, partial(self._ways_out, hypothesis, problem))
            if better is None:
                break
            hypothesis = better
        many = any(effect.minima > 1 for effect in hypothesis.effects)
        if many and len(problem.names) <= _FEW and not self.is_adequate(hypothesis):
            hypothesis = (
                self._better(hypothesis, problem, lambda: [searched(problem, self.seed)]) or hypothesis
            )
        self.n_simulations += problem.n_simulations
        return hypothesis

    def _ways_out(self, hypothesis: Hypothesis, problem: FitProblem) -> list[_Array]:
        return escapes(hypothesis, problem, self.seed)[:_KEPT]

    def _finish(self) -> None:
        """Lead what a verdict rests on to its minimum: a fit on its way there looks like something missing."""
        for hypothesis in map(self.nearest, range(self.max_effects + 1)):
            if hypothesis is not None and not hypothesis.ended:
                problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
                self._better(hypothesis, problem, partial(np.atleast_2d, hypothesis.u), worth=0.0)
                self.n_simulations += problem.n_simulations

    def _settle(self) -> None:
        """Lead what will be named out of local minima, if an effect has many: its values count, not only its name."""
        found = max(
            (h for h in self.adequate or self.hypotheses if h.effects),
            key=lambda h: self.scores[h.name],
            default=None,
        )
        if found is None or all(effect.minima == 1 for effect in found.effects):
            return
        whole, left = (self.remainders[h.name].excess for h in (self.base, found))
        if not self.is_adequate(found) and left > _NAMED * whole:
            return
        problem = FitProblem(found.simulator, list(found.observations), found.names)
        off = partial(off_the_edge, found, problem, self.seed)
        found = self._better(found, problem, lambda: off()[:_KEPT]) or found
        self._better(found, problem, partial(self._ways_out, found, problem))
        self.n_simulations += problem.n_simulations

    def _better(
        self,
        hypothesis: Hypothesis,
        problem: FitProblem,
        starts: Callable[[], Sequence[_Array] | _Array],
        worth: float = _WORTH,
    ) -> Hypothesis | None:
        """Fit a hypothesis from other starts, and take it in place of this one; None if that does not lead lower."""

        def fit() -> Hypothesis | None:
            points = starts()
            return followed(hypothesis, problem, points, worth) if len(points) else None

        better = self._journal.fitted(hypothesis.effects, problem, fit)
        if better is not None:
            self.keep(better, self.test(better), hypothesis)
        return better

    def _polish(self, hypothesis: Hypothesis) -> Hypothesis:
        """Fit a hypothesis that comes near to noise further, with a smaller step and the noise that belongs to it.

        What it leaves may be the error of the integration, or noise of the injected signals that passes through the
        model with its effects otherwise than through the nominal one. If that makes it adequate, all others that come
        near are treated in the same way, so that evidences stay comparable; if not, nothing changes.
        """
        if self.is_adequate(hypothesis) or hypothesis.chi2_per_sample > _NEAR:
            return hypothesis
        reference = self.simulator.refined(_FINER)
        fine = hypothesis.simulator.with_step_of(reference)
        before = fine.parameters.nominal  # noise was estimated without effects
        before[[fine.parameters.index(e.local(e.strength.name)) for e in hypothesis.effects]] = 0.0
        observations = [fine.quantified(o, hypothesis.theta, before) for o in hypothesis.observations]
        if self._promised(hypothesis, FitProblem(fine, observations, hypothesis.names)) > _LEFT:
            return hypothesis
        finer = self._refitted(hypothesis.effects, observations, reference, [hypothesis])
        if finer is None:
            return hypothesis
        remainder = self.test(finer)
        if not self.passes(remainder):
            return hypothesis
        self.keep(finer, remainder, hypothesis)
        for other in list(self.hypotheses):
            if other is not finer and other.chi2_per_sample < _NEAR:
                better = self._refitted(other.effects, observations, reference, [other])
                if better is not None:
                    self.keep(better, self.test(better), other)
        return finer

    def _promised(self, hypothesis: Hypothesis, problem: FitProblem) -> float:
        """Share of what a hypothesis leaves beyond noise that it would leave in a finer problem, by (D2)."""
        columns = np.arange(len(hypothesis.u))
        objective = projected(problem, hypothesis.u[None], hypothesis.jacobian, columns)[0][0]
        self.n_simulations += problem.n_simulations
        n = len(hypothesis.residuals)
        return float((objective - n) / max(hypothesis.objective - n, 1.0))

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
        for effects in dict.fromkeys(sets):
            if self.adequate:
                return
            part = [h for h in self.hypotheses if set(h.effects) < set(effects)]
            whole = [h for h in self.hypotheses if effects and set(h.effects) > set(effects)]
            near = [max(hs, key=lambda h: self.scores[h.name]) for hs in (part, whole) if hs]
            self._refit(effects, self.base, near, everywhere=True)

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

    def _refit(
        self, effects: Sequence[Effect], like: Hypothesis, near: Sequence[Hypothesis], *, everywhere: bool
    ) -> Hypothesis | None:
        """Fit some effects, with the step and noise of a hypothesis, from where those near it have ended.

        If asked for, also from all over the ranges.
        """
        before = self.fit_of(effects)
        starts = [*near, *([before] if before else [])]
        fitted = self._refitted(effects, like.observations, like.simulator, starts)
        if fitted is None:
            return None
        self.keep(fitted, self.test(fitted), before)
        hopeless = effects and fitted.chi2 > _PART * self.base.chi2
        if everywhere and not hopeless and not self.is_adequate(fitted):
            return self._everywhere(fitted)
        return fitted

    def _everywhere(self, hypothesis: Hypothesis) -> Hypothesis:
        """Fit a hypothesis from all over the ranges, once; what is best takes its place."""
        if hypothesis.name in self._spread_out:
            return hypothesis
        self._spread_out.add(hypothesis.name)
        self.tell(f"other starts of {hypothesis.name}")
        problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
        better = self._better(hypothesis, problem, lambda: elsewhere(hypothesis, problem, self.seed))
        self.n_simulations += problem.n_simulations
        return self._polish(self._escape(better or hypothesis))

    def _refitted(
        self,
        effects: Sequence[Effect],
        observations: Sequence[Observation],
        reference: Simulator,
        starts: Sequence[Hypothesis],
    ) -> Hypothesis | None:
        """Fit of some effects from where others ended, with the step of a reference; None if that fails."""
        simulator = self.simulator.with_step_of(reference)
        for effect in effects:
            simulator = simulator.extend(effect)
        problem = FitProblem(simulator, list(observations))
        points = [h.deviations(problem.names) for h in starts]
        found = self._journal.fitted(effects, problem, lambda: fit_hypothesis(effects, problem, points))
        self.n_simulations += problem.n_simulations
        return found
