"""Finished parts of a search in a folder, so that an interrupted search goes on where it stopped."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.store import Store
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import Hypothesis, name_of, reached
from errorscreen.discovery.starts.signatures import SignatureSearch, raced
from errorscreen.effects.base import Effect
from errorscreen.exceptions import SimulationError

#: what is stored of one part
Part = dict[str, NDArray[np.generic]]


class Journal:
    """What the parts of a search have found, in the order of its calls.

    The same search makes the same calls in the same order, so a part that is stored is read instead of computed. Of a
    fit only the point is stored: what belongs to it follows from one linearisation.

    Parameters
    ----------
    store : Store, optional
        Nothing is kept where it is not given.
    """

    def __init__(self, store: Store | None = None) -> None:
        self._store = store
        self._number = 0

    def part(self, compute: Callable[[], Part]) -> Part:
        """What the next part of the search finds, or has found before."""
        number, self._number = self._number, self._number + 1
        if self._store is None:
            return compute()
        return self._store.get(f"part-{number:06d}", lambda: (compute(), {}))[0]

    def fitted(
        self, effects: Sequence[Effect], problem: FitProblem, fit: Callable[[], Hypothesis | None]
    ) -> Hypothesis | None:
        """Fit of some effects to a problem; None where it has failed, or has led nowhere.

        Parameters
        ----------
        effects : sequence of Effect
        problem : FitProblem
            Its simulations are counted as if the fit were made now.
        fit : callable
            May raise `SimulationError`.
        """
        before = problem.n_simulations
        found: Hypothesis | None = None  # of this call, which need not be linearised again

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
        self,
        problems: Mapping[tuple[Effect, ...], FitProblem],
        fit: Callable[[], Sequence[Hypothesis]],
    ) -> list[Hypothesis]:
        """Fits of some of several problems.

        Parameters
        ----------
        problems : mapping of tuple of Effect to FitProblem
            By the effects of each.
        fit : callable
        """
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
                own = {key: part[f"{number}.{key}"] for key in ("u", "slope", "objective", "state")}
                found.append(unpacked(effects, problems[effects], own))
        for problem, count in zip(problems.values(), part["counts"], strict=True):
            problem.n_simulations = int(count)
        return found

    def raced(
        self, searches: Sequence[SignatureSearch], n_fits: int, threads: int = 1
    ) -> list[SignatureSearch]:
        """Searches for signatures after their race, see `errorscreen.discovery.starts.signatures.raced`."""
        ranked: list[SignatureSearch] = []

        def compute() -> Part:
            ranked.extend(raced(searches, n_fits, threads))
            part: Part = {"order": np.array([list(searches).index(s) for s in ranked], dtype=int)}
            for number, search in enumerate(searches):
                part |= {f"{number}.{key}": value for key, value in search.packed().items()}
            return part

        part = self.part(compute)
        if ranked:
            return ranked
        for number, search in enumerate(searches):
            own = f"{number}."
            search.restore({k.removeprefix(own): v for k, v in part.items() if k.startswith(own)})
        return [searches[int(number)] for number in part["order"]]


def packed(hypothesis: Hypothesis) -> Part:
    """Point that a fit has reached, and what its search knows of it."""
    return {
        "u": hypothesis.u,
        "slope": hypothesis.slope,
        "objective": np.array(hypothesis.objective),
        "state": np.array(hypothesis.state),
    }


def unpacked(effects: Sequence[Effect], problem: FitProblem, part: Part) -> Hypothesis:
    """Hypothesis at a stored point."""
    return reached(effects, problem, part["u"], part["slope"], float(part["objective"]), str(part["state"]))
