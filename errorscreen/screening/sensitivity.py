"""The usual ranking: by local relative sensitivity at the nominal parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from errorscreen.learning.generation import local_sensitivity
from errorscreen.screening.base import BaseScreener
from errorscreen.simulators.base import Responses, Simulator
from errorscreen.simulators.observations import as_observations


class SensitivityScreener(BaseScreener):
    """Rank parameters by how strongly they move the response; the recorded values do not matter.

    The baseline of the paper (its section 4): S of equation (13) at the nominal parameters. A recording only gives
    the event and the measured instants; S is averaged over several. It costs m + 1 simulations for each recording.

    Parameters
    ----------
    simulator : Simulator
    relative : bool, default True
        Sensitivity to a relative change of the parameter; otherwise to a change by one unit, so that the ranking
        depends on the units.
    step : float, default 1e-3
        Step in multiples of the parameter's scale.
    weights : array-like of shape (R,), optional
        λ of the channels; 1/R each where not given.

    Attributes
    ----------
    contributions_, names_, ranking_, ranked_names_
        See `BaseScreener`; the contributions are the sensitivities.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        relative: bool = True,
        step: float = 1e-3,
        weights: ArrayLike | None = None,
    ) -> None:
        self.simulator = simulator
        self.relative = relative
        self.step = step
        self.weights = weights

    def fit(self, X: Any, y: None = None) -> SensitivityScreener:
        """Rank the parameters for the events of recordings; see `BaseScreener.fit`."""
        sensitivities = []
        for observation in as_observations(self.simulator, X):
            found = local_sensitivity(
                self.simulator,
                self.simulator.parameters.nominal,
                observation.event,
                relative=self.relative,
                step=self.step,
                weights=self.weights,
                mask=observation.mask,
            )
            responses = Responses(found.responses, found.status, observation.time, self.simulator.channels)
            responses.require_ok("a simulation at or next to the nominal parameters")
            sensitivities.append(found.values[0])
        names = self.simulator.parameters.names
        self._store(np.mean(sensitivities, axis=0), names, len(sensitivities) * (len(names) + 1))
        return self
