"""Calibration by particle swarm, as in the paper."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen.calibration.base import BaseCalibrator, by_column
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.swarm import ParticleSwarm
from errorscreen.exceptions import check_integer, check_real
from errorscreen.simulators.base import Simulator


class PSOCalibrator(BaseCalibrator):
    """Minimise J, equation (24), over the selected parameters with a particle swarm.

    One particle starts at the nominal values, so the result is never worse than the nominal simulator; the others start
    at a Latin hypercube inside the bounds. Each iteration is one simulate call for each event.

    Parameters
    ----------
    simulator : Simulator
    names : iterable of str, optional
        Parameters to calibrate; the others stay nominal. All where not given.
    n_particles : int, default 30
    n_iterations : int, default 80
        Largest number of iterations.
    inertia, cognitive, social, max_velocity : float
        See `ParticleSwarm`.
    weights : array-like of shape (R,), optional
        λ of the channels; 1/R each where not given.
    patience : int, optional
        Stop after so many iterations without an improvement by more than `tol`; never where not given.
    tol : float, default 1e-4
        Improvement that counts, as a share of J.
    random_state : None, int, SeedSequence, Generator or RandomState
    progress : bool, default False
        Show a progress bar.

    Attributes
    ----------
    theta_, names_, values_, simulator_, observations_, n_simulations_, n_failed_
        See `BaseCalibrator`.
    objective_ : float
        J of the calibrated simulator on the fitted recordings.
    history_ : dict of str to ndarray of shape (iterations,)
        ``"objective"``: best J so far; ``"simulations"``: simulations so far; ``"failed"``: particles that
        failed in the iteration.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> fit = PSOCalibrator(plant, ["Xd1", "Tj"], n_iterations=20, random_state=0).fit(recording)
    >>> bool(fit.objective_ < fit.history_["objective"][0])
    True
    """

    case_keys = {
        "n_particles": "particles",
        "n_iterations": "iterations",
        **{name: name for name in ("inertia", "cognitive", "social")},
    }

    objective_: float

    def __init__(
        self,
        simulator: Simulator,
        names: Iterable[str] | None = None,
        *,
        n_particles: int = 30,
        n_iterations: int = 80,
        inertia: float = 0.7298,
        cognitive: float = 1.4962,
        social: float = 1.4962,
        max_velocity: float = 0.5,
        weights: ArrayLike | None = None,
        patience: int | None = None,
        tol: float = 1e-4,
        random_state: Any = None,
        progress: bool = False,
    ) -> None:
        self.simulator = simulator
        self.names = names
        self.n_particles = n_particles
        self.n_iterations = n_iterations
        self.inertia = inertia
        self.cognitive = cognitive
        self.social = social
        self.max_velocity = max_velocity
        self.weights = weights
        self.patience = patience
        self.tol = tol
        self.random_state = random_state
        self.progress = progress

    def fit(self, X: Any, y: None = None) -> PSOCalibrator:
        """Calibrate on one recording, or on several together.

        An interrupted fit (Ctrl-C) keeps the best values so far. See `BaseCalibrator.fit` for the arguments.

        Raises
        ------
        InputError
            If an argument or a recording cannot be used.
        SimulationError
            If no simulation ended well.
        """
        problem = FitProblem(self.simulator, X, self.names)
        n_iterations = check_integer(self.n_iterations, "n_iterations")
        patience = n_iterations if self.patience is None else check_integer(self.patience, "patience")
        tol = check_real(self.tol, "tol", low=0.0)
        swarm = self._swarm(problem)
        history: list[tuple[float, ...]] = []
        try:
            for _ in tqdm(range(n_iterations), desc="swarm", disable=not self.progress):
                losses = problem.objective(swarm.ask(), self.weights)
                swarm.tell(losses)
                history.append((swarm.best_value, problem.n_simulations, int(np.sum(~np.isfinite(losses)))))
                if len(history) > patience and history[-1 - patience][0] * (1 - tol) <= swarm.best_value:
                    break
        finally:
            if np.isfinite(swarm.best_value):
                self._store(problem, swarm.best_position)
                self.objective_ = swarm.best_value
                self.history_ = by_column(("objective", "simulations", "failed"), history)
        if not np.isfinite(swarm.best_value):
            raise problem.no_success()
        return self

    def _swarm(self, problem: FitProblem) -> ParticleSwarm:
        rng = generator(self.random_state)
        start = latin_hypercube(problem.space, check_integer(self.n_particles, "n_particles"), rng)
        start[0] = problem.space.nominal
        return ParticleSwarm(
            start,
            problem.space.bounds,
            inertia=self.inertia,
            cognitive=self.cognitive,
            social=self.social,
            max_velocity=self.max_velocity,
            random_state=rng,
        )

    def _facts(self) -> dict[str, Any]:
        return super()._facts() | ({"J": f"{self.objective_:.4g}"} if hasattr(self, "objective_") else {})

    def _score_weights(self) -> ArrayLike | None:
        return self.weights
