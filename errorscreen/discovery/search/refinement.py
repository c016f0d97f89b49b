"""Hypotheses led to their minima: a fit on its way there, or in a local one, looks like a missing effect."""

from __future__ import annotations

import contextlib
import logging
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
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.search.partwise_fits import CHECKED, PartwiseFit, start_partwise
from errorscreen.discovery.search.plan import Ledger, check_plan
from errorscreen.discovery.starts.restarts import (
    fit_from_starts,
    move_off_edge,
    restart_from_neighbours,
    scan_effect_parameters,
    search_all_ranges,
)
from errorscreen.discovery.starts.signatures import projected
from errorscreen.effects.base import Effect
from errorscreen.exceptions import SimulationError
from errorscreen.simulators.base import Simulator

_log = logging.getLogger(__name__)

#: least decrease of the objective for which a fit replaces another one, or an effect joins adequate parameters
WORTH = 4.0
#: the excess is χ² beyond noise: largest share of the base fit's excess at which a fit is continued
PART = 0.5
#: largest share of the base fit's excess at which effects can be named
NAMED = 0.1
#: starts of a scan that are fitted, and times that a fit is led out of a local minimum
_SCANNED, _ESCAPES = 2, 3
#: most parameters of a model with its effects for a search of all their ranges
_FEW = 8
#: refinement of the step: largest χ²/N at which it is tried, its factor, and the largest share of the excess to keep
_NEAR, _FINER, _LEFT = 50.0, 4, 0.5
#: restarts of a stalled fit from its neighbours, and the least decrease that counts, as a share of its excess
_RESTARTS, _LOWER = 16, 1e-3
#: largest excess of a partwise fit of several effects that goes on: for each value of the part, or as a share of the
#: base fit's excess there (ten times the limit for naming two effects whose form differs from the library's)
_HARDLY, _TRACE = 1.0, 0.03
#: starts all over the ranges, without effects or for each effect
_STARTS = 16

_Array = NDArray[np.float64]
#: proposes starts (s, k) for the fit of a problem
_Proposal = Callable[[FitProblem], Sequence[_Array] | _Array]


class Refinement(CandidateSet):
    """Fitted hypotheses, each of which can be improved; `measured` has the noise that was estimated without effects."""

    def __init__(
        self,
        base: Hypothesis,
        significance: float,
        seed: int,
        journal: Journal | None,
        plan: Sequence[str] | None = None,
    ) -> None:
        super().__init__(significance, seed)
        self.plan, self.ledger = check_plan(plan), Ledger()
        self._journal = Journal() if journal is None else journal
        self.simulator, self.measured = base.simulator, base.observations
        self.n_simulations = 0
        self.base_improved = False
        self._restarted: Counter[str] = Counter()  # how often each has been fitted from all over the ranges
        self._no_escape: set[float] = set()  # objectives of fits with no start that leads lower
        self._no_finer: set[float] = set()  # objectives of fits that were tried with a finer step
        problem = FitProblem(base.simulator, base.observations, base.names)
        self.rough_step = rough_step(problem, base.u, seed)
        self.n_simulations += problem.n_simulations
        self.keep(base, self.test(base))
        self._refine_step(base)

    def _leave_local_minima(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Lead hypotheses out of local minima in parallel, unless they are known to have no way out."""
        if "leave local minima" not in self.plan:
            return list(hypotheses)
        with self.ledger.entry("leave local minima", self):
            return self._led(hypotheses)

    def _led(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        new = [h for h in hypotheses if h.objective not in self._no_escape]
        problems = {h.effects: _problem_of(h) for h in new}
        calls = [partial(self._lower_minimum, h, problems[h.effects]) for h in new]
        self._keep_better(
            problems, lambda: [h for h in parallel_map(calls, self.simulator.threads) if h is not None]
        )
        self.n_simulations += sum(problem.n_simulations for problem in problems.values())
        led = [self.fit_of(h.effects) or h for h in hypotheses]
        # a fit that was led lower may have another way out
        self._no_escape |= {h.objective for h in hypotheses} & {h.objective for h in led}
        return led

    def _lower_minimum(self, hypothesis: Hypothesis, problem: FitProblem) -> Hypothesis | None:
        """Fit from scanned starts as long as they lead lower; with few parameters also search all ranges."""
        best, adequate = hypothesis, self.is_adequate(hypothesis)
        step = None if adequate else good_enough(problem, hypothesis.u, self.rough_step)
        for _ in range(_ESCAPES):
            better = (
                None if adequate else _lower(best, problem, partial(self._scanned, best, step), step=step)
            )
            if better is None:
                break
            best, adequate = better, self.passes(self.test(better))
        if not adequate and _has_many_minima(hypothesis) and len(problem.names) <= _FEW:
            best = _lower(best, problem, lambda p: [search_all_ranges(p, self.seed)]) or best
        return None if best is hypothesis else best

    def _scanned(self, hypothesis: Hypothesis, step: float | None, problem: FitProblem) -> list[_Array]:
        return scan_effect_parameters(hypothesis, problem, self.seed, step)[:_SCANNED]

    def _keep_better(
        self, problems: Mapping[tuple[Effect, ...], FitProblem], fit: Callable[[], Sequence[Hypothesis]]
    ) -> None:
        """Keep fits of problems with different effects where they are new or lower."""
        pairs = [(h, self.fit_of(h.effects)) for h in self._journal.all_fitted(problems, fit)]
        pairs = [(h, old) for h, old in pairs if old is None or h.objective < old.objective - WORTH]
        tests = parallel_map([partial(self.test, h) for h, _ in pairs], self.simulator.threads)
        for (hypothesis, old), test in zip(pairs, tests, strict=True):
            self.keep(hypothesis, test, old)

    def _complete_fits(self) -> None:
        """Continue the fits that a verdict rests on to their end."""
        for hypothesis in map(self.nearest, range(self.most_effects + 1)):
            if hypothesis is not None and not hypothesis.ended:
                self._try_starts(hypothesis, partial(_own_point, hypothesis), worth=0.0)

    def improve_base(self) -> None:
        """Restart the fit without effects until nothing leads lower, because missing effects are judged against it."""
        base = self.base
        self._restart_from_neighbours(base)
        self.base_improved = self.base is not base
        if self.base_improved:
            self._refine_step(self.base)

    @property
    def _parameters_suffice(self) -> bool:
        """Whether parameters alone are adequate, and nothing is more evident."""
        return self.is_adequate(self.base) and self.scores[self.base.name] >= max(self.scores.values())

    @property
    def _lead(self) -> float:
        """How far parameters alone would have to come down to reach effects that leave only noise; 0 without any."""
        best = min((h.objective for h in self.adequate if h.effects), default=np.inf)
        return max(0.0, self.base.objective - best)

    def _restart_from_neighbours(self, hypothesis: Hypothesis, rival: Hypothesis | None = None) -> None:
        """Restart a stalled fit until nothing leads lower, or it gains too little to reach a rival.

        What parameters alone gain does not count if all restarts together would not reach effects that leave only
        noise.
        """
        for number in range(_RESTARTS):
            if hypothesis.at_rest or (not hypothesis.effects and self._parameters_suffice):
                return
            _log.info("starts around %s", hypothesis.name)
            problem = _problem_of(hypothesis)
            least = max(WORTH, _LOWER * self.residual_tests[hypothesis.name].excess)
            if not hypothesis.effects:
                least = max(least, self._lead / _RESTARTS)
            seed = np.random.SeedSequence(self.seed, spawn_key=(number,))
            fit = partial(restart_from_neighbours, hypothesis, problem, least, seed)
            led = self._journal.fitted(hypothesis.effects, problem, fit)
            self.n_simulations += problem.n_simulations
            if led is None:
                return
            self.keep(led, self.test(led), hypothesis)
            gained, hypothesis = hypothesis.objective - led.objective, led
            if rival is not None and led.objective - rival.objective > HOPE * max(gained, 1.0):
                return

    def _refine_values(self) -> None:
        """Lead the result out of local minima if an effect has many: its values count, not only its name. Then complete
        the fits again.
        """
        self._refine_likeliest()
        self._complete_fits()

    def _refine_likeliest(self) -> None:
        found = max(
            (h for h in self.adequate or self.hypotheses if h.effects),
            key=lambda h: self.scores[h.name],
            default=None,
        )
        if found is None or not _has_many_minima(found):
            return
        whole, left = (self.residual_tests[h.name].excess for h in (self.base, found))
        if not self.is_adequate(found) and left > NAMED * whole:
            return
        off = partial(move_off_edge, found, random_state=self.seed)
        found = self._try_starts(found, lambda problem: off(problem)[:_SCANNED]) or found
        self._try_starts(found, partial(self._scanned, found, None))

    def _try_starts(
        self, hypothesis: Hypothesis, starts: _Proposal, worth: float = WORTH, step: float | None = None
    ) -> Hypothesis | None:
        """Fit a hypothesis from other starts, and keep the fit if it is lower; else return None."""
        problem = _problem_of(hypothesis)
        fit = partial(_lower, hypothesis, problem, starts, worth, step)
        better = self._journal.fitted(hypothesis.effects, problem, fit)
        self.n_simulations += problem.n_simulations
        if better is not None:
            self.keep(better, self.test(better), hypothesis)
        return better

    def _refine_step(self, hypothesis: Hypothesis) -> Hypothesis:
        """Fit a hypothesis near noise again with a finer step and its own noise, which may explain the rest.
        If it becomes adequate, all others near noise are treated alike, so that evidences stay comparable.
        """
        tried = hypothesis.objective in self._no_finer or "finer step" not in self.plan
        if tried or self.is_adequate(hypothesis) or hypothesis.chi2_per_sample > _NEAR:
            return hypothesis
        with self.ledger.entry("finer step", self):
            return self._with_finer_step(hypothesis)

    def _with_finer_step(self, hypothesis: Hypothesis) -> Hypothesis:
        self._no_finer.add(hypothesis.objective)
        reference = self.simulator.refined(_FINER)
        fine = hypothesis.simulator.with_step_of(reference)
        # first with the noise of the coarse step: it costs a fraction, and is enough to drop most
        for simulator in (hypothesis.simulator, fine):
            observations = own_noise(hypothesis, simulator, self.measured)
            if self._share_left(hypothesis, FitProblem(fine, observations, hypothesis.names)) > _LEFT:
                return hypothesis
        finer = self._fit_effects(hypothesis.effects, observations, reference, [hypothesis])
        if finer is None:
            return hypothesis
        test = self.test(finer)
        if not self.passes(test):
            return hypothesis
        self.keep(finer, test, hypothesis)
        for other in list(self.hypotheses):
            if other is not finer and other.chi2_per_sample < _NEAR:
                better = self._fit_effects(other.effects, observations, reference, [other])
                if better is not None:
                    self.keep(better, self.test(better), other)
        return finer

    def _share_left(self, hypothesis: Hypothesis, problem: FitProblem) -> float:
        """Share of its excess that a hypothesis would keep in a finer problem, by (D2)."""
        columns = np.arange(len(hypothesis.u))
        objective = projected(problem, hypothesis.u[None], hypothesis.jacobian, columns)[0][0]
        self.n_simulations += problem.n_simulations
        n = len(hypothesis.residuals)
        return float((objective - n) / max(hypothesis.objective - n, 1.0))

    def _refit(
        self, effects: Sequence[Effect], like: Hypothesis, near: Sequence[Hypothesis], *, everywhere: bool
    ) -> Hypothesis | None:
        """Fit effects with step and noise of `like`, from the ends of `near` and, if `everywhere`, all ranges."""
        before = self.fit_of(effects)
        starts = [*near, *([before] if before else [])]
        fitted = self._fit_effects(effects, like.observations, like.simulator, starts)
        if fitted is None:
            return None
        self.keep(fitted, self.test(fitted), before)
        hopeless = bool(effects) and fitted.chi2 > PART * self.base.chi2
        # if one of the most effects is idle, partwise fits have tried all others in its place
        hopeless |= len(effects) == self.most_effects and not self.adds(fitted)
        if everywhere and not hopeless and not self.is_adequate(fitted):
            return self._restart_everywhere(fitted)
        return fitted

    def _restart_everywhere(self, hypothesis: Hypothesis, times: int = 1) -> Hypothesis:
        """Fit a hypothesis from all over the ranges, at most so many times in all; keep the best."""
        number = self._restarted[hypothesis.name]
        if number >= times:
            return hypothesis
        self._restarted[hypothesis.name] += 1
        _log.info("other starts of %s", hypothesis.name)
        n = _STARTS * max(1, len(hypothesis.effects))
        seed = np.random.SeedSequence(self.seed, spawn_key=(number,))
        problem = _problem_of(hypothesis)
        step = good_enough(problem, hypothesis.u, self.rough_step)
        self.n_simulations += problem.n_simulations

        def starts(problem: FitProblem) -> _Array:
            fit = start_partwise(hypothesis, hypothesis.effects, problem, n, seed, step)
            checked = CHECKED if len(hypothesis.effects) > 1 else ()
            hopeful = all(self._may_leave_noise(fit.run(parts)) for parts in checked)
            return fit.run().reached if hopeful else fit.reached[:0]

        better = self._try_starts(hypothesis, starts, step=step)
        return self._refine_step(self._leave_local_minima([better or hypothesis])[0])

    def _may_leave_noise(self, fit: PartwiseFit) -> bool:
        """Whether the excess of a partwise fit is small: the right effects fit each part once they are found."""
        part = fit.part
        alone = FitProblem(self.base.simulator, part.observations, self.base.names).with_step(self.rough_step)
        whole = float(alone.chi_square(alone.values(self.base.u))[0])
        fit.problem.n_simulations += alone.n_simulations  # the journal keeps those of a problem
        left, whole = fit.objective - part.n_values, whole - part.n_values
        return left <= max(_HARDLY * part.n_values, _TRACE * whole)

    def _fit_effects(
        self,
        effects: Sequence[Effect],
        observations: Sequence[Observation],
        reference: Simulator,
        starts: Sequence[Hypothesis],
    ) -> Hypothesis | None:
        """Fit of some effects from the ends of other fits, with the step of a reference; None if that fails."""
        simulator = self.simulator.with_step_of(reference)
        for effect in effects:
            simulator = simulator.extend(effect)
        problem = FitProblem(simulator, observations)
        points = [h.deviations(problem.names) for h in starts]
        found = self._journal.fitted(effects, problem, lambda: fit_hypothesis(effects, problem, points))
        self.n_simulations += problem.n_simulations
        return found


def _problem_of(hypothesis: Hypothesis) -> FitProblem:
    return FitProblem(hypothesis.simulator, hypothesis.observations, hypothesis.names)


def _own_point(hypothesis: Hypothesis, problem: FitProblem) -> _Array:
    return hypothesis.u[None]


def _has_many_minima(hypothesis: Hypothesis) -> bool:
    return any(effect.minima > 1 for effect in hypothesis.effects)


def _lower(
    hypothesis: Hypothesis,
    problem: FitProblem,
    starts: _Proposal,
    worth: float = WORTH,
    step: float | None = None,
) -> Hypothesis | None:
    """Fit of a hypothesis from other starts; None if it is not lower."""
    with contextlib.suppress(SimulationError):
        points = starts(problem)
        return fit_from_starts(hypothesis, problem, points, worth, step) if len(points) else None
    return None
