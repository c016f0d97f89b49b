"""A random ranking, which every other ranking has to beat."""

from __future__ import annotations

from typing import Any

from errorscreen._runtime.sampling import generator
from errorscreen.screening.base import BaseScreener
from errorscreen.simulators.base import Simulator


class RandomScreener(BaseScreener):
    """Rank parameters at random.

    Parameters
    ----------
    simulator : Simulator
        Its parameters are ranked; it is not run.
    random_state : None, int, SeedSequence, Generator or RandomState

    Attributes
    ----------
    contributions_, names_, ranking_, ranked_names_
        See `BaseScreener`; the contributions are uniform random numbers in [0, 1).
    """

    def __init__(self, simulator: Simulator, *, random_state: Any = None) -> None:
        self.simulator = simulator
        self.random_state = random_state

    def fit(self, X: Any = None, y: None = None) -> RandomScreener:
        """Draw a ranking; X and y are not used."""
        names = self.simulator.parameters.names
        self._store(generator(self.random_state).random(len(names)), names)
        return self
