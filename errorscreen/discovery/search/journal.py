"""Finished parts of a search in a folder, so that an interrupted search continues where it stopped."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.store import Store
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import Hypothesis, hypothesis_at, name_of
from errorscreen.discovery.starts.signatures import SignatureSearch, successive_halving
from errorscreen.effects.base import Effect
from errorscreen.exceptions import SimulationError

#: arrays that are stored of one part
Part = dict[str, NDArray[np.generic]]


class Journal:
    """Results of the parts of a search, in the order of its calls; without a store nothing is kept.
    The same search makes the same calls, so a stored part is read instead of computed. Of a fit only the point is
    stored.
    """

    def __init__(self, store: Store | None = None) -> None:
        self._store = store
        self._number = 0

    def part(self, compute: Callable[[], Part]) -> Part:
        """Result of the next part of the search, computed or read."""
        number, self._number = self._number, self._number + 1
        if self._store is None:
            return compute()
        return self._store.get(f"part-{number:06d}", lambda: (compute(), {}))[0]

    def fitted(
        self, effects: Sequence[Effect], problem: FitProblem, fit: Callable[[], Hypothesis | None]
    ) -> Hypothesis | None:
        """Fit of some effects; None if it failed. The simulations of a stored fit count, too."""
        before = problem.n_simulations
        found: Hypothesis | None = None  # of this call: needs no linearisation

        def compute() -> Part:
            nonlocal found
            with contextlib.suppress(SimulationError):
                found = fit()
            point = {} if found is None else packed(found)
            return {"count": np.array(problem.n_simulations - before), **point}

        part = self.part(compute)
        if found is None and "u" in part:
            found = unpacked(effects, problem, part)
        problem.n_simulations = before + int(part["count"])
        return found

    def all_fitted(
        self, problems: Mapping[tuple[Effect, ...], FitProblem], fit: Callable[[], Sequence[Hypothesis]]
    ) -> list[Hypothesis]:
        """Fits of some of several problems, which are given by their effects."""
        found: list[Hypothesis] = []

        def compute() -> Part:
            found.extend(fit())
            part: Part = {"fits": np.array([h.name for h in found])}
            part["counts"] = np.array([problem.n_simulations for problem in problems.values()])
            for number, hypothesis in enumerate(found):
                part |= {f"{number}.{key}": value for key, value in packed(hypothesis).items()}
            return part

        part = self.part(compute)
        if not found:
            by_name = {name_of(effects): effects for effects in problems}
            for number, name in enumerate(part["fits"]):
                effects = by_name[str(name)]
                found.append(unpacked(effects, problems[effects], _own(part, number)))
        for problem, count in zip(problems.values(), part["counts"], strict=True):
            problem.n_simulations = int(count)
        return found

    def ranked(
        self, searches: Sequence[SignatureSearch], n_fits: int, threads: int = 1
    ) -> list[SignatureSearch]:
        """Searches for signatures after `successive_halving`."""
        ranked: list[SignatureSearch] = []

        def compute() -> Part:
            ranked.extend(successive_halving(searches, n_fits, threads))
            part: Part = {"order": np.array([list(searches).index(s) for s in ranked], dtype=int)}
            for number, search in enumerate(searches):
                part |= {f"{number}.{key}": value for key, value in search.packed().items()}
            return part

        part = self.part(compute)
        if ranked:
            return ranked
        for number, search in enumerate(searches):
            search.restore(_own(part, number))
        return [searches[int(number)] for number in part["order"]]


def _own(part: Part, number: int) -> Part:
    """Arrays of one fit or search of a part."""
    start = f"{number}."
    return {key.removeprefix(start): value for key, value in part.items() if key.startswith(start)}


def packed(hypothesis: Hypothesis) -> Part:
    """Point of a fit and its state."""
    return {
        "u": hypothesis.u,
        "slope": hypothesis.slope,
        "objective": np.array(hypothesis.objective),
        "state": np.array(hypothesis.state),
    }


def unpacked(effects: Sequence[Effect], problem: FitProblem, part: Part) -> Hypothesis:
    """Hypothesis at a stored point."""
    objective, state = float(part["objective"]), str(part["state"])
    return hypothesis_at(effects, problem, part["u"], part["slope"], objective, state)
