"""Ranking by the part of each sensitivity that other parameters do not explain."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import qr

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch
from errorscreen.exceptions import check_real
from errorscreen.screening.base import BaseScreener
from errorscreen.simulators.base import Simulator


class IdentifiabilityScreener(BaseScreener):
    r"""Rank parameters by sensitivity and identifiability together; the recorded values do not matter.

    A column of the sensitivity matrix is the change of the response, in multiples of the measurement noise, for a
    relative change of one parameter at the nominal values. A QR factorisation with column pivoting takes the largest
    column first, and then always the one with the largest part orthogonal to all columns taken before. A parameter
    whose effect resembles that of stronger ones comes late, however sensitive the response is to it. It costs 2m + 1
    simulations for each recording.

    Parameters
    ----------
    simulator : Simulator
    step : float, default 1e-4
        Step of the central differences in multiples of each parameter's scale.

    Attributes
    ----------
    contributions_, names_, ranking_, ranked_names_
        See `BaseScreener`; the contribution is the length of the orthogonal part of a parameter's column,
        :math:`|R_{ii}|`.
    n_simulations_ : int

    References
    ----------
    K. Z. Yao, B. M. Shaw, B. Kou, K. B. McAuley, D. W. Bacon: Modeling ethylene/butene copolymerization with
    multi-site catalysts: parameter estimability and experimental design. Polymer Reaction Engineering 11 (2003) 563.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(random_state=0)
    >>> screener = IdentifiabilityScreener(PlantSimulator("synchronous_machine", recording)).fit(recording)
    >>> len(screener.select(3))
    3
    """

    def __init__(self, simulator: Simulator, *, step: float = 1e-4) -> None:
        self.simulator = simulator
        self.step = step

    def fit(self, X: Any, y: None = None) -> IdentifiabilityScreener:
        """Rank the parameters for the events, the gaps and the noise of recordings; see `BaseScreener.fit`."""
        problem = FitProblem(self.simulator, X)
        step = check_real(self.step, "step", low=0.0, above=True)
        m = len(problem.names)
        # prior and tolerance only matter to a search that takes steps
        search = BoundedSearch(
            lambda u: problem.residuals(problem.values(u)),
            *problem.scaled_bounds,
            prior=1.0,
            tol=1.0,
            step=step,
        )
        search.begin(np.zeros((1, m)))
        if not search.tracks:
            raise problem.no_success()
        search.differentiate(search.tracks)
        assert search.tracks[0].jacobian is not None
        R, order = qr(search.tracks[0].jacobian, mode="r", pivoting=True)
        contributions = np.zeros(m)
        diagonal = np.abs(np.diag(R[:m]))
        contributions[order[: len(diagonal)]] = diagonal
        self._store(contributions, problem.names, problem.n_simulations, problem.n_failed)
        return self
