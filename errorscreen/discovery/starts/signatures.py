"""Signatures: the objective that an effect promises before it is fitted."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen._runtime.threads import parallel_map
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import PRIOR
from errorscreen.discovery.fits.rough_step import good_enough
from errorscreen.effects.base import Effect
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators.base import Simulator

#: spreads of the draws of later rounds in shares of the ranges, and the best draws that they scatter around
SPREADS, _ELITE = (0.1, 0.03, 0.01), 8
#: successive halving: effects that go on to rounds 2, 3 and 4, for each that is fitted to the end
_HALVING = (4, 2, 1)
#: keys of a stored draw
_KEPT = ("objective", "shares", "steps")
#: rounds of draws
ROUNDS = 1 + len(SPREADS)
#: draws of an effect with d parameters: so many times d², at most `n_draws`
_DRAWS_PER_SQUARE = 12
#: share of its range at which the linear model of a strength is taken
_PROBED = 1e-6
#: a parameter whose bounds have at least this ratio is drawn in the logarithm
WIDE = 10.0

_Array = NDArray[np.float64]


class SignatureSearch:
    r"""Scores an effect by variable projection: its own parameters are drawn, all others follow from the linear model.

    For each draw p the model is simulated at some points u of the other parameters, with sensitivities J there, and

    .. math:: \min_\delta |z(u, p) + J\delta|^2 + |u + \delta|^2/s^2
       = |z|^2 + |u|^2/s^2 - g^T (J^T J + I/s^2)^{-1} g,\quad g = J^T z + u/s^2                     \qquad (D2)

    is the objective that the joint fit can be expected to reach (Golub and Pereyra, Inverse Problems 19, 2003). Later
    rounds draw around the best so far, over ever smaller parts of the ranges. A lone strength also comes from the
    linear model, because a small one would hardly be drawn. `points` are pairs of u (k,) and J (N, k). `step` (see
    `rough_step`) becomes None after the first round if it is not good enough with the effect; `problem` is the extended
    one.
    """

    def __init__(
        self,
        simulator: Simulator,
        observations: Sequence[Observation],
        effect: Effect,
        points: Sequence[tuple[_Array, _Array]],
        n_draws: int,
        random_state: Any,
        step: float | None = None,
    ) -> None:
        self.effect, self._points = effect, points
        self.problem = FitProblem(simulator.extend(effect), observations)
        self._take_step(step)
        self._k = len(simulator.movable)
        d = len(self.problem.space) - self._k
        self._unit = ParameterSpace(Parameter(f"p{i}", 0.5, 0.0, 1.0) for i in range(d))
        self._rng = generator(random_state)
        # one or two parameters need fewer; a switch is on, and has none
        self._n_draws = min(n_draws, max(1, _DRAWS_PER_SQUARE * d**2))

    def _take_step(self, step: float | None) -> None:
        """Start again with this step."""
        self.step, self._rough = step, self.problem.with_step(step)
        #: at each point the best so far: objective, shares of the ranges, steps of the other parameters
        self._best: list[list[tuple[float, _Array, _Array]]] = [[] for _ in self._points]
        self._round = 0

    @property
    def objective(self) -> float:
        """Lowest objective of the linear model; infinite where no draw could be simulated."""
        return min((best[0][0] for best in self._best if best), default=np.inf)

    def run(self, rounds: int = ROUNDS) -> SignatureSearch:
        """Continue until so many rounds have been drawn."""
        while self._round < rounds:
            for (u, J), best in zip(self._points, self._best, strict=True):
                shares = self._drawn(best)
                if self._round == 0 and shares.shape[1] == 1 and not self.effect.smallest:
                    shares = np.vstack([shares, self._estimated(u, J)])
                draws = spread_over(self.problem.space, self._k, shares, [self.effect])
                rows = np.hstack([np.tile(u, (len(draws), 1)), draws])
                objective, steps = projected(self._rough, rows, J, np.arange(self._k))
                best += [(float(o), x, step) for o, x, step in zip(objective, shares, steps, strict=True)]
                best.sort(key=lambda item: item[0])
                del best[_ELITE:]
            self._round += 1
            first = self._round == 1 and self.step is not None and np.isfinite(self.objective)
            if first and good_enough(self.problem, self.starts()[0], self.step) is None:
                self._take_step(None)
        return self

    def _drawn(self, best: Sequence[tuple[float, _Array, _Array]]) -> _Array:
        if not best:
            return self._shares(self._n_draws * self.effect.minima, self._rng)
        parents = np.array([x for _, x, _ in best])[self._rng.integers(len(best), size=self._n_draws)]
        spread = SPREADS[self._round - 1]
        return np.asarray(np.clip(parents + spread * self._rng.standard_normal(parents.shape), 0.0, 1.0))

    def _shares(self, n: int, random_state: Any) -> _Array:
        """Shares (n, d) of the ranges; of a switch there is one row without any."""
        return latin_hypercube(self._unit, n, random_state) if len(self._unit) else np.zeros((1, 0))

    def _estimated(self, u: _Array, J: _Array) -> _Array:
        """Shares (n, 1) of the range of a strength by the linear model, on each side of 0."""
        space, own = self.problem.space, self._k
        lower, upper = space.bounds[own]
        ends = np.array([end for end in (lower, upper) if end != 0.0])
        rows = np.tile(np.append(u, 0.0), (1 + len(ends), 1))
        rows[:, own] = (np.append(0.0, _PROBED * ends) - space.nominal[own]) / space.scales[own]
        off, *on = self._rough.residuals(self._rough.values(rows))
        found = []
        for end, row, z in zip(ends, rows[1:], on, strict=True):
            slope = (z - off) / (row[own] - rows[0, own])
            if np.isfinite(slope).all():
                A = np.column_stack([J, slope])
                step = _minimum(A, A.T @ off + rows[0] / PRIOR**2)[own]
                share = step * space.scales[own] / end
                if share > _PROBED:
                    found.append([(min(share, 1.0) * end - lower) / (upper - lower)])
        return np.reshape(found, (-1, 1))

    def starts(self, n_matches: int = 0) -> _Array:
        """Starts (s, k) of joint fits, for a finite objective, and the best two of `n_matches` fully drawn ones."""
        found: list[tuple[float, _Array]] = []
        for (u, _), best in zip(self._points, self._best, strict=True):
            lowest, x, step = best[0]
            if np.isfinite(lowest):
                own = spread_over(self.problem.space, self._k, x[None], [self.effect])[0]
                found += [(lowest, np.concatenate([u + step, own])), (lowest, np.concatenate([u, own]))]
        starts = np.array([start for _, start in sorted(found, key=lambda item: item[0])])
        if not n_matches:
            return starts
        drawn = self._rough.drawn(n_matches, self._rng)
        drawn[:, self._k :] = starts[self._rng.integers(len(starts), size=n_matches), self._k :]
        best_two = np.argsort(objectives(self._rough, drawn), kind="stable")[:2]  # NaN comes last
        return np.vstack([starts, drawn[best_two]])

    def nominal_starts(self, n: int, random_state: Any) -> _Array:
        """Starts (n, k + d) at the nominal parameters: the most promising draw of the effect, and others at random."""
        shares = self._shares(n, generator(random_state))
        known = [best[0] for best in self._best if best]
        if known:
            shares[0] = min(known, key=lambda item: item[0])[1]
        own = spread_over(self.problem.space, self._k, shares, [self.effect])
        return np.hstack([np.zeros((len(own), self._k)), own])

    def packed(self) -> dict[str, NDArray[np.generic]]:
        """State from which another search of the same effect can continue."""
        state = json.dumps(self._rng.bit_generator.state).encode()
        seeds: Any = self._rng.bit_generator.seed_seq  # a Latin hypercube draws from a child of it
        out: dict[str, NDArray[np.generic]] = {
            "rng": np.frombuffer(state, dtype=np.uint8),
            "children": np.array(seeds.n_children_spawned),
            "count": np.array(self.problem.n_simulations),
            "round": np.array(self._round),
            "exact": np.array(self.step is None),
        }
        for number, best in enumerate(self._best):
            for key, values in zip(_KEPT, zip(*best, strict=True), strict=True):
                out[f"{key}{number}"] = np.array(values)
        return out

    def restore(self, part: Mapping[str, NDArray[Any]]) -> SignatureSearch:
        """Take over the state of `packed`."""
        self._take_step(None if part["exact"] else self.step)
        self._rng.bit_generator.state = json.loads(part["rng"].tobytes())
        seeds: Any = self._rng.bit_generator.seed_seq
        seeds.spawn(int(part["children"]) - seeds.n_children_spawned)
        self.problem.n_simulations, self._round = int(part["count"]), int(part["round"])
        self._best = [
            [(float(o), x, s) for o, x, s in zip(*(part[f"{key}{number}"] for key in _KEPT), strict=True)]
            for number in range(len(self._best))
        ]
        return self


def successive_halving(
    searches: Sequence[SignatureSearch], n_fits: int, threads: int = 1
) -> list[SignatureSearch]:
    """Run searches, of which fewer and fewer go on to the next round; return all, the most promising first."""
    ranked, kept = list(searches), len(searches)
    for rounds, share in enumerate((*_HALVING, 0), start=1):
        parallel_map([partial(one.run, rounds) for one in ranked[:kept]], threads)
        ranked.sort(key=lambda s: s.objective)
        kept = share * n_fits
    return ranked


def projected(
    problem: FitProblem, rows: _Array, J: _Array, columns: NDArray[np.int64]
) -> tuple[_Array, _Array]:
    """Objectives (n,) of (D2) at rows (n, k), inf where a simulation fails, and the steps of the columns to them."""
    parts = [_projected(problem, some, J, columns) for some in problem.portions(rows)]
    objectives, steps = zip(*parts, strict=True)
    return np.concatenate(objectives), np.concatenate(steps)


def _projected(
    problem: FitProblem, rows: _Array, J: _Array, columns: NDArray[np.int64]
) -> tuple[_Array, _Array]:
    z = problem.residuals(problem.values(rows))
    failed = np.isnan(z).any(axis=1)
    z[failed] = 0.0
    g = z @ J + rows[:, columns] / PRIOR**2
    steps = _minimum(J, g.T).T
    objective = (z**2).sum(axis=1) + ((rows / PRIOR) ** 2).sum(axis=1) + (g * steps).sum(axis=1)
    objective[failed] = np.inf
    return objective, steps


def _minimum(J: _Array, slope: _Array) -> _Array:
    """Step (k,) or steps (k, n) to the minimum of (D2), for half the gradient of its objective."""
    return np.asarray(-cho_solve(cho_factor(J.T @ J + np.eye(J.shape[1]) / PRIOR**2), slope))


def spread_over(space: ParameterSpace, first: int, shares: _Array, effects: Sequence[Effect] = ()) -> _Array:
    """Deviations (n, d) of the parameters from number `first` on, at shares (n, d) of their ranges.
    Ranges over more than a decade are divided in the logarithm. A range that begins at 0, or is symmetrical, begins at
    `Effect.smallest` where given.
    """
    lower, upper = space.bounds[first:].T
    least = {effect.local(name): value for effect in effects for name, value in effect.smallest.items()}
    small = np.array([least.get(name, 0.0) for name in space.names[first:]])
    signed = (small > 0) & (lower < 0)
    sign = np.where(signed & (shares < 0.5), -1.0, 1.0)
    shares = np.where(signed, np.abs(2.0 * shares - 1.0), shares)
    lower = np.where(small > 0, small, lower)
    values = lower + (upper - lower) * shares
    wide = (lower > 0) & (upper > WIDE * lower)
    values[:, wide] = lower[wide] * (upper[wide] / lower[wide]) ** shares[:, wide]
    return np.asarray((sign * values - space.nominal[first:]) / space.scales[first:])


def objectives(problem: FitProblem, u: _Array) -> _Array:
    """χ² with the prior's term at rows (n, k); NaN where the simulation fails."""
    return np.asarray(problem.chi_square(problem.values(u)) + ((u / PRIOR) ** 2).sum(axis=1))
