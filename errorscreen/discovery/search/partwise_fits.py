r"""Fits to an ever longer part of the recordings, from starts all over the ranges.

The first part after an event has few local minima. Before each longer part, starts scatter around the current ones as
far as the shorter part leaves them free,

.. math:: u' \sim N\big(u,\ w^2 (J^T J + I/s^2)^{-1}\big)                                                   \qquad (D6)

and the best of each on the longer part joins: a particle filter for parameters that do not change (N. Chopin, "A
sequential particle filter method for static models", *Biometrika* 89(3), 2002) with Gauss-Newton steps.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen._runtime.threads import parallel_map
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import fit_to_end, try_all
from errorscreen.discovery.fits.hypotheses import Hypothesis, JointFit
from errorscreen.discovery.fits.rough_step import good_enough
from errorscreen.discovery.starts.restarts import fit_with_halving
from errorscreen.discovery.starts.signatures import SPREADS, objectives, spread_over
from errorscreen.effects.base import Effect
from errorscreen.parameters import Parameter, ParameterSpace

_log = logging.getLogger(__name__)

#: parts of the recordings as shares of the time after the event; share of the starts that goes on to each; iterations
_PARTS = (
    (0.1, 1.0, 3), (0.15, 0.75, 2), (0.2, 0.75, 2), (0.25, 0.625, 3), (0.33, 0.625, 3),
    (0.4, 0.5, 3), (0.5, 0.5, 3), (0.6, 0.375, 3), (0.7, 0.375, 3), (0.85, 0.375, 3),
)  # fmt: skip
#: points that scatter around each start, and the widths w of (D6) among them
_SCATTERED, _WIDTHS = 64, (0.5, 1.0, 3.0)
#: simulations with all parameters drawn together, for each start
_DRAWN = 64
#: numbers of parts after which hopeless fits are dropped
CHECKED = (3, 5, 7, 9, len(_PARTS))
#: rounds of successive halving: starts of each fit, and after which part how many fits go on for each wanted one
_ROUNDS = ((3, ((1, 8), (3, 2))), (16, tuple((parts, 1) for parts in CHECKED)))

_Array = NDArray[np.float64]


class PartwiseFit:
    """Fit of some effects to an ever longer part of the recordings that can be stopped and continued.
    `starts` (s, k) and `reached` (r, k), the best first, are in multiples of the scales; `part` is the problem of the
    current part, `objective` the lowest on it; for `step` see `rough_step`.
    """

    def __init__(
        self,
        effects: Sequence[Effect],
        problem: FitProblem,
        starts: ArrayLike,
        random_state: Any = 0,
        step: float | None = None,
    ) -> None:
        self.effects, self.problem, self.part = tuple(effects), problem, problem
        self.reached = np.atleast_2d(np.asarray(starts, dtype=float))
        self.objective = np.inf
        self._size, self._rng = len(self.reached), generator(random_state)
        self._fit: JointFit | None = None
        self._number, self._step, self._rough = 0, step, problem.with_step(step)
        self._checked = True  # whether the step is good enough at `reached`

    @property
    def step(self) -> float | None:
        """Integration step; None as soon as it is not good enough with the effects."""
        if not self._checked:  # late, because most fits end with their first part
            self._checked = True
            part = self.problem.until(_PARTS[self._number - 1][0])
            self._step = good_enough(part, self.reached[0], self._step)
        return self._step

    def run(self, parts: int = len(_PARTS)) -> PartwiseFit:
        """Continue until so many parts have been fitted; `SimulationError` if no start can be simulated."""
        for share, kept, iterations in _PARTS[self._number : parts]:
            self.part = part = (self._rough if self.step else self.problem).until(share)
            starts = self.reached if self._fit is None else self._scattered(self._fit, part)
            n = max(1, round(kept * self._size))
            self._fit = JointFit(self.effects, part, starts, central=False).keep(n).run(iterations)
            self.reached, self.objective = self._fit.reached, self._fit.objective
            self._number, self._checked = self._number + 1, False
        return self

    def _scattered(self, fit: JointFit, part: FitProblem) -> _Array:
        """Points of a fit, and the best of (D6) around each of them on a longer part."""
        clouds = fit.scattered(np.resize(_WIDTHS, _SCATTERED), self._rng)
        objective = np.nan_to_num(objectives(part, np.concatenate(clouds)), nan=np.inf)
        best = objective.reshape(clouds.shape[:2]).argmin(axis=1)
        return np.concatenate([fit.reached, clouds[np.arange(len(clouds)), best]])


def start_partwise(
    base: Hypothesis,
    effects: Sequence[Effect],
    problem: FitProblem,
    n: int,
    random_state: Any = 0,
    step: float | None = None,
) -> PartwiseFit:
    """Partwise fit, not yet run, from the best draw around each of n values of the effects' parameters.
    Half of the values of an effect that `base` holds scatter around the fitted ones; all of them where another effect
    joins, because a strong effect is often known before the others fit.
    """
    rng = generator(random_state)
    u = problem.drawn(n * _DRAWN, rng).reshape(n, _DRAWN, -1)
    fitted = base.deviations(problem.names)
    for number, effect in enumerate(effects):
        own = np.flatnonzero(np.isin(problem.names, [effect.local(p.name) for p in effect.parameters]))
        near = np.full(n, effect in base.effects)
        if len(effects) == len(base.effects):  # of two effects every combination
            near &= (np.arange(n) >> number) % 2 == 0
        u[:, :, own] = _values(effect, problem, own, fitted, near, rng)[:, None]
    part = problem.with_step(step).until(_PARTS[0][0])
    objective = np.nan_to_num(objectives(part, u.reshape(n * _DRAWN, -1)), nan=np.inf).reshape(n, _DRAWN)
    return PartwiseFit(effects, problem, u[np.arange(n), objective.argmin(axis=1)], rng, step)


def fit_growing_parts(
    fits: Iterable[Callable[[int], PartwiseFit]],
    n: int,
    threads: int = 1,
    hopeful: Callable[[PartwiseFit], bool] | None = None,
) -> Sequence[JointFit]:
    """Run partwise fits by successive halving, and fit the best n to the whole recordings.
    Each of `fits` takes a number of starts: few at first, many for the best. After the parts `CHECKED`, `hopeful` tells
    which go on.
    """
    begin = list(fits)
    running: list[PartwiseFit] = []
    for starts, cuts in _ROUNDS:
        running = parallel_map([partial(fit, starts) for fit in begin], threads)
        for parts, kept in cuts:
            tried = try_all([partial(fit.run, parts) for fit in running], threads)
            pairs = [(fit, one) for fit, one in zip(begin, tried, strict=True) if one is not None]
            pairs = sorted(pairs, key=lambda pair: pair[1].objective)[: kept * n]
            if hopeful is not None and parts in CHECKED:
                pairs = [(fit, one) for fit, one in pairs if hopeful(one)]
            begin, running = [fit for fit, _ in pairs], [one for _, one in pairs]
            share = _PARTS[parts - 1][0]
            _log.info("%d of %d go on from %.0f%% of the recordings", len(pairs), len(tried), 100 * share)
            if not pairs:
                return []
    last = [partial(fit_with_halving, one.effects, one.problem, one.reached, one.step) for one in running]
    return fit_to_end(try_all(last, threads), threads)


def _values(
    effect: Effect,
    problem: FitProblem,
    own: NDArray[np.int64],
    fitted: _Array,
    near: NDArray[np.bool_],
    rng: np.random.Generator,
) -> _Array:
    """Values (n, d) of an effect's parameters: some near the fitted ones (k,), the others over their ranges."""
    lower, upper = problem.scaled_bounds[:, own]
    values = np.zeros((len(near), len(own)))
    spread = np.resize(SPREADS, near.sum())[:, None] * (upper - lower)
    values[near] = fitted[own] + spread * rng.standard_normal(spread.shape)
    if not near.all() and len(own):
        unit = ParameterSpace(Parameter(name, 0.5, 0.0, 1.0) for name in np.array(problem.names)[own])
        shares = latin_hypercube(unit, int((~near).sum()), rng)
        values[~near] = spread_over(problem.space.subset(unit.names), 0, shares, [effect])
    return np.clip(values, lower, upper)
