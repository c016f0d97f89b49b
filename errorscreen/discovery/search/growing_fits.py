r"""Fits to an ever longer part of the recordings, from starts all over the ranges.

What follows an event at once has few local minima, and what comes later is known well enough when it is reached: an
oscillation that is fitted from its first swing on cannot be fitted half a period off. But what only shows later, when a
plant takes up its power again, is not known at all by then, and a fit leaves it at the prior's value. So before each
longer part, starts scatter around what has been reached, as far as the part before leaves them free,

.. math:: u' \sim N\big(u,\ w^2 (J^T J + I/s^2)^{-1}\big)                                                   \qquad (D6)

and the best of each that fits the longer part joins. This is a particle filter for parameters that do not change
(N. Chopin, "A sequential particle filter method for static models", *Biometrika* 89(3), 2002), with Gauss-Newton steps
in place of its random ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen._runtime.threads import parallel_map
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import attempted, race
from errorscreen.discovery.fits.hypotheses import Hypothesis, JointFit
from errorscreen.discovery.fits.rough_step import good_enough
from errorscreen.discovery.starts.restarts import halved
from errorscreen.discovery.starts.signatures import SPREADS, objectives, spread_over
from errorscreen.effects.base import Effect
from errorscreen.parameters import Parameter, ParameterSpace

#: parts of the recordings, as shares of what follows the event, which share of the starts goes on to each, and for how
#: many iterations
_PARTS = (
    (0.1, 1.0, 3), (0.15, 0.75, 2), (0.2, 0.75, 2), (0.25, 0.625, 3), (0.33, 0.625, 3),
    (0.4, 0.5, 3), (0.5, 0.5, 3), (0.6, 0.375, 3), (0.7, 0.375, 3), (0.85, 0.375, 3),
)  # fmt: skip
#: points that scatter around each start, and the widths w of (D6) among them
_SCATTERED, _WIDTHS = 64, (0.5, 1.0, 3.0)
#: simulations with all parameters drawn together, for each start
_DRAWN = 64
#: starts of each fit in the first round of a race, and in the second one
_STARTS, _MORE_STARTS = 3, 16
#: parts after which it is asked what is hopeless
JUDGED = (3, 5, 7, 9, len(_PARTS))
#: rounds of a race: after which part how many go on for each that is fitted to the end
_FIRST, _SECOND = ((1, 8), (3, 2)), tuple((parts, 1) for parts in JUDGED)

_Array = NDArray[np.float64]


class Growth:
    """Fit of some effects to an ever longer part of the recordings, which can be stopped and gone on with.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the problem's simulator.
    problem : FitProblem
    starts : array-like of shape (s, k)
        Deviations from the nominal values in multiples of the scales.
    random_state : None, int, SeedSequence, Generator or RandomState
        Of what scatters around them.
    step : float, optional
        See `rough_step`.

    Attributes
    ----------
    reached : ndarray of shape (r, k)
        Where those have got to that fit the part best, the best first.
    objective : float
        Lowest objective on that part.
    part : FitProblem
        The one to that part; all of it before the first.
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
        self._asked = True  # whether the step is good enough for what was reached

    @property
    def step(self) -> float | None:
        """Step of the simulations; None as soon as it is not good enough with the effects."""
        if not self._asked:  # only of what goes on: most fits of a race end with their first part
            self._asked = True
            part = self.problem.until(_PARTS[self._number - 1][0])
            self._step = good_enough(part, self.reached[0], self._step)
        return self._step

    def run(self, parts: int = len(_PARTS)) -> Growth:
        """Go on to so many parts in all.

        Raises
        ------
        SimulationError
            If no start can be simulated.
        """
        for share, kept, iterations in _PARTS[self._number : parts]:
            self.part = part = (self._rough if self.step else self.problem).until(share)
            starts = self.reached if self._fit is None else self._scattered(self._fit, part)
            kept_ = max(1, round(kept * self._size))
            self._fit = JointFit(self.effects, part, starts, central=False).keep(kept_).run(iterations)
            self.reached, self.objective = self._fit.reached, self._fit.objective
            self._number, self._asked = self._number + 1, False
        return self

    def _scattered(self, fit: JointFit, part: FitProblem) -> _Array:
        """What a fit has reached, and the best of (D6) around each of these on a longer part."""
        clouds = fit.scattered(np.resize(_WIDTHS, _SCATTERED), self._rng)
        objective = np.nan_to_num(objectives(part, np.concatenate(clouds)), nan=np.inf)
        best = objective.reshape(clouds.shape[:2]).argmin(axis=1)
        return np.concatenate([fit.reached, clouds[np.arange(len(clouds)), best]])


def begun(
    base: Hypothesis,
    effects: Sequence[Effect],
    problem: FitProblem,
    n: int,
    random_state: Any = 0,
    step: float | None = None,
) -> Growth:
    """Fit from starts all over the ranges, not yet run.

    So that the parameters of effects are tried all over their ranges, and not only where the model's own happen to fit,
    simulations are drawn around some values of these, and the best around each is a start. Half of the values of an
    effect that has been fitted scatter around these, and all where another effect joins: what is strong is often known
    before the rest fits.

    Parameters
    ----------
    base : Hypothesis
        Fitted, with all or some of the effects, or none.
    effects : sequence of Effect
        Those of the problem's simulator.
    problem : FitProblem
    n : int
        Starts.
    random_state : None, int, SeedSequence, Generator or RandomState
    step : float, optional
        See `rough_step`.
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
    return Growth(effects, problem, u[np.arange(n), objective.argmin(axis=1)], rng, step)


def fit_growing_parts(
    fits: Iterable[Callable[[int], Growth]],
    n: int,
    tell: Callable[[str], None],
    threads: int = 1,
    hopeful: Callable[[Growth], bool] | None = None,
) -> Sequence[JointFit]:
    """Let fits grow side by side, and fit those that get furthest to all of the recordings.

    All begin with few starts, and those that lead begin once more with many.

    Parameters
    ----------
    fits : iterable of callable
        Begin one with so many starts.
    n : int
        How many are fitted to the end.
    tell : callable
        Takes lines of text.
    threads : int
        Of which each has one fit at a time.
    hopeful : callable, optional
        Whether it is worth going on with one that leads; asked after the parts `JUDGED`.
    """
    begin = list(fits)
    grown: list[Growth] = []
    for number, cuts in ((_STARTS, _FIRST), (_MORE_STARTS, _SECOND)):
        grown = parallel_map([partial(fit, number) for fit in begin], threads)
        for parts, kept in cuts:
            well = attempted([partial(growth.run, parts) for growth in grown], threads)
            running = [(fit, one) for fit, one in zip(begin, well, strict=True) if one is not None]
            running = sorted(running, key=lambda pair: pair[1].objective)[: kept * n]
            if hopeful is not None and parts in JUDGED:
                running = [(fit, one) for fit, one in running if hopeful(one)]
            begin, grown = [fit for fit, _ in running], [one for _, one in running]
            tell(f"{len(grown)} of {len(well)} go on from {_PARTS[parts - 1][0]:.0%} of the recordings")
            if not grown:
                return []
    ended = [partial(halved, one.effects, one.problem, one.reached, one.step) for one in grown]
    return race(attempted(ended, threads), threads)


def _values(
    effect: Effect,
    problem: FitProblem,
    own: NDArray[np.int64],
    fitted: _Array,
    near: NDArray[np.bool_],
    rng: np.random.Generator,
) -> _Array:
    """Values (n, d) of an effect's parameters, some near those fitted (k,) and the others over their ranges."""
    lower, upper = problem.scaled_bounds[:, own]
    values = np.zeros((len(near), len(own)))
    spread = np.resize(SPREADS, near.sum())[:, None] * (upper - lower)
    values[near] = fitted[own] + spread * rng.standard_normal(spread.shape)
    if not near.all() and len(own):
        unit = ParameterSpace(Parameter(name, 0.5, 0.0, 1.0) for name in np.array(problem.names)[own])
        shares = latin_hypercube(unit, int((~near).sum()), rng)
        values[~near] = spread_over(problem.space.subset(unit.names), 0, shares, [effect])
    return np.clip(values, lower, upper)
