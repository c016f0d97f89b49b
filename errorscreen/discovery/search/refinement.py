"""Hypotheses led to their minima: a fit on its way there, or in a local one, looks like something missing."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.threads import parallel_map
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import HOPE, Hypothesis, fit_hypothesis
from errorscreen.discovery.fits.rough_step import good_enough, rough_step
from errorscreen.discovery.judge.candidate_set import CandidateSet
from errorscreen.discovery.judge.own_noise import own_noise
from errorscreen.discovery.search.growing_fits import JUDGED, Growth, begun
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.starts.restarts import escapes, followed, off_the_edge, rested, searched
from errorscreen.discovery.starts.signatures import projected
from errorscreen.effects.base import Effect
from errorscreen.exceptions import SimulationError
from errorscreen.simulators.base import Simulator

#: an effect that does not promise to lower the objective by this much is not fitted beside parameters that suffice, and
#: a fit that is not lower by it does not take the place of another one
WORTH = 4.0
#: what leaves more than this share of what parameters leave is not worth it
PART = 0.5
#: what leaves more than this share of what parameters leave will not be named
NAMED = 0.1
#: ways out of a local minimum that are followed
_KEPT = 2
#: times that a fit is led out of a local minimum
_ESCAPES = 3
#: most parameters of a model with its effects, for a search of all their ranges
_FEW = 8
#: a fit whose χ²/N is at most this is tried with a step so many times smaller, and fitted with it if the linear model
#: promises to leave at most this share of what is beyond noise
_NEAR, _FINER, _LEFT = 50.0, 4, 0.5
#: times that a fit is led on where it stalls, and the least share of what it leaves beyond noise that counts as lower
_RESTS, _LOWER = 16, 1e-3
#: what a fit of several effects may leave of a part of the recordings beyond noise if it goes on: in multiples of
#: noise, or as a share of what parameters leave of it; ten times what of two is named in another form than theirs
_HARDLY, _TRACE = 1.0, 0.03
#: starts all over the ranges, for a model without effects or with one, and for each effect of one that has more
_STARTS = 16

_Array = NDArray[np.float64]


class Refinement(CandidateSet):
    """Fitted hypotheses, each of which can be led further.

    Parameters
    ----------
    base : Hypothesis
        Without effects.
    significance, seed, tell
        See `CandidateSet`.
    journal : Journal, optional
        Of the parts that are finished.

    Attributes
    ----------
    hypotheses, residual_tests, scores
        See `CandidateSet`.
    measured : tuple of Observation
        With the noise that was estimated without effects.
    rough_step : float or None
        For what is only ranked, see `errorscreen.discovery.fits.rough_step`.
    n_simulations : int
    """

    def __init__(
        self,
        base: Hypothesis,
        significance: float,
        seed: int,
        tell: Callable[[str], None],
        journal: Journal | None,
    ) -> None:
        super().__init__(significance, seed, tell)
        self._journal = Journal() if journal is None else journal
        self.simulator, self.measured = base.simulator, base.observations
        self.n_simulations = 0
        self._spread_out: Counter[str] = Counter()  # how often each has been fitted from everywhere
        self._led: set[float] = set()  # objectives of fits that have no way out
        self._coarse: set[float] = set()  # objectives of fits that a finer step makes no better
        problem = FitProblem(base.simulator, list(base.observations), base.names)
        self.rough_step = rough_step(problem, base.u, seed)
        self.n_simulations += problem.n_simulations
        self.keep(base, self.test(base))
        self._polish(base)

    def _escape(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Lead some hypotheses out of local minima, side by side, unless they are known to have no way out."""
        new = [h for h in hypotheses if h.objective not in self._led]
        problems = {h.effects: FitProblem(h.simulator, list(h.observations), h.names) for h in new}
        ways = [partial(self._way_out, h, problems[h.effects]) for h in new]
        self._take(problems, lambda: [h for h in parallel_map(ways, self.simulator.threads) if h is not None])
        self.n_simulations += sum(problem.n_simulations for problem in problems.values())
        led = [self.fit_of(h.effects) or h for h in hypotheses]
        # what has been led lower may have another way out
        self._led |= {h.objective for h in hypotheses} & {h.objective for h in led}
        return led

    def _way_out(self, hypothesis: Hypothesis, problem: FitProblem) -> Hypothesis | None:
        """Follow ways out of a local minimum, as long as they lead lower; with few parameters, search everywhere."""
        best, adequate = hypothesis, self.is_adequate(hypothesis)
        step = None if adequate else good_enough(problem, hypothesis.u, self.rough_step)
        for _ in range(_ESCAPES):
            ways = partial(self._ways_out, best, problem, step)
            better = None if adequate else _lower(best, problem, ways, step=step)
            if better is None:
                break
            best, adequate = better, self.passes(self.test(better))
        many = any(effect.minima > 1 for effect in hypothesis.effects)
        if many and len(problem.names) <= _FEW and not adequate:
            best = _lower(best, problem, lambda: [searched(problem, self.seed)]) or best
        return None if best is hypothesis else best

    def _ways_out(
        self, hypothesis: Hypothesis, problem: FitProblem, step: float | None = None
    ) -> list[_Array]:
        return escapes(hypothesis, problem, self.seed, step)[:_KEPT]

    def _take(
        self, problems: Mapping[tuple[Effect, ...], FitProblem], fit: Callable[[], Sequence[Hypothesis]]
    ) -> None:
        """Keep fits of some problems, of which each has other effects, where they are new or lower."""
        befores = [
            (fitted, self.fit_of(fitted.effects)) for fitted in self._journal.all_fitted(problems, fit)
        ]
        taken = [(h, old) for h, old in befores if old is None or h.objective < old.objective - WORTH]
        residual_tests = parallel_map([partial(self.test, h) for h, _ in taken], self.simulator.threads)
        for (fitted, before), remainder in zip(taken, residual_tests, strict=True):
            self.keep(fitted, remainder, before)

    def _finish(self) -> None:
        """Lead what a verdict rests on to its end: a fit on its way there looks like something missing."""
        for hypothesis in map(self.nearest, range(self.most_effects + 1)):
            if hypothesis is not None and not hypothesis.ended:
                problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
                self._better(hypothesis, problem, partial(np.atleast_2d, hypothesis.u), worth=0.0)
                self.n_simulations += problem.n_simulations

    def rest(self) -> None:
        """Lead the fit without effects to where nothing leads lower, unless it leaves only noise and is most evident.

        A search that stalls has come to no minimum as far as it knows, and that it leaves too much is what a missing
        effect is told from.
        """
        base = self.base
        self._rest(base)
        if self.base is not base:
            self._polish(self.base)

    @property
    def _needs_nothing(self) -> bool:
        """Whether parameters alone leave only noise, and nothing is more evident."""
        return self.is_adequate(self.base) and self.scores[self.base.name] >= max(self.scores.values())

    def _rest(self, hypothesis: Hypothesis, rival: Hypothesis | None = None) -> None:
        """Lead a fit to where nothing leads lower; not further if that brings it hardly nearer to another one."""
        for number in range(_RESTS):
            if hypothesis.at_rest or (not hypothesis.effects and self._needs_nothing):
                return
            self.tell(f"starts around {hypothesis.name}")
            problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
            least = max(WORTH, _LOWER * self.residual_tests[hypothesis.name].excess)
            seed = np.random.SeedSequence(self.seed, spawn_key=(number,))
            led = self._journal.fitted(
                hypothesis.effects, problem, partial(rested, hypothesis, problem, least, seed)
            )
            self.n_simulations += problem.n_simulations
            if led is None:
                return
            self.keep(led, self.test(led), hypothesis)
            gained, hypothesis = hypothesis.objective - led.objective, led
            if rival is not None and led.objective - rival.objective > HOPE * max(gained, 1.0):
                return

    def _settle(self) -> None:
        """Lead what will be named out of local minima, if an effect has many: its values count, not only its name."""
        found = max(
            (h for h in self.adequate or self.hypotheses if h.effects),
            key=lambda h: self.scores[h.name],
            default=None,
        )
        if found is None or all(effect.minima == 1 for effect in found.effects):
            return
        whole, left = (self.residual_tests[h.name].excess for h in (self.base, found))
        if not self.is_adequate(found) and left > NAMED * whole:
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
        worth: float = WORTH,
        step: float | None = None,
    ) -> Hypothesis | None:
        """Fit a hypothesis from other starts, and take it in place of this one; None if that does not lead lower."""
        fit = partial(_lower, hypothesis, problem, starts, worth, step)
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
        tried = hypothesis.objective in self._coarse
        if tried or self.is_adequate(hypothesis) or hypothesis.chi2_per_sample > _NEAR:
            return hypothesis
        self._coarse.add(hypothesis.objective)
        reference = self.simulator.refined(_FINER)
        fine = hypothesis.simulator.with_step_of(reference)
        # the noise by the coarse step first: it costs a fraction, and most promise too little with it
        for simulator in (hypothesis.simulator, fine):
            observations = own_noise(hypothesis, simulator, self.measured)
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
        hopeless = bool(effects) and fitted.chi2 > PART * self.base.chi2
        # where one of the most effects is idle, a race has tried all others beside the rest before
        hopeless |= len(effects) == self.most_effects and not self.adds(fitted)
        if everywhere and not hopeless and not self.is_adequate(fitted):
            return self._everywhere(fitted)
        return fitted

    def _everywhere(self, hypothesis: Hypothesis, times: int = 1) -> Hypothesis:
        """Fit a hypothesis from all over the ranges, up to so many times in all; what is best takes its place."""
        number = self._spread_out[hypothesis.name]
        if number >= times:
            return hypothesis
        self._spread_out[hypothesis.name] += 1
        self.tell(f"other starts of {hypothesis.name}")
        problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
        n = _STARTS * max(1, len(hypothesis.effects))
        seed = np.random.SeedSequence(self.seed, spawn_key=(number,))
        step = good_enough(problem, hypothesis.u, self.rough_step)

        def starts() -> _Array:
            growth = begun(hypothesis, hypothesis.effects, problem, n, seed, step)
            asked = JUDGED if len(hypothesis.effects) > 1 else ()
            hopeful = all(self._may_leave_noise(growth.run(parts)) for parts in asked)
            return growth.run().reached if hopeful else growth.reached[:0]

        better = self._better(hypothesis, problem, starts, step=step)
        self.n_simulations += problem.n_simulations
        return self._polish(self._escape([better or hypothesis])[0])

    def _may_leave_noise(self, growth: Growth) -> bool:
        """Whether a growing fit leaves hardly more than noise of its part, or next to nothing of what parameters leave.

        What is right fits a part of the recordings once it has been found, and is named only if it fits all of them.
        """
        part = growth.part
        alone = FitProblem(self.base.simulator, part.observations, self.base.names).with_step(self.rough_step)
        whole = float(alone.chi_square(alone.values(self.base.u))[0])
        growth.problem.n_simulations += alone.n_simulations  # those of a problem are in the journal
        left, whole = growth.objective - part.n_values, whole - part.n_values
        return left <= max(_HARDLY * part.n_values, _TRACE * whole)

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


def _lower(
    hypothesis: Hypothesis,
    problem: FitProblem,
    starts: Callable[[], Sequence[_Array] | _Array],
    worth: float = WORTH,
    step: float | None = None,
) -> Hypothesis | None:
    """Fit of a hypothesis from other starts; None if that does not lead lower."""
    with contextlib.suppress(SimulationError):
        points = starts()
        return followed(hypothesis, problem, points, worth, step) if len(points) else None
    return None
