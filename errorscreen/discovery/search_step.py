"""Integration step of the search for causes, longer than that of the reported simulations."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from errorscreen.data.observations import Observation
from errorscreen.exceptions import InputError
from errorscreen.simulators import PowerSystemSimulator
from errorscreen.simulators.base import Simulator

#: a grid is searched with twice its step, up to this one in s, for which the rates of found causes are known
GRID_STEP = 0.005


def search_simulator(
    simulator: Simulator, step: float | None, observations: Sequence[Observation]
) -> Simulator:
    """Return the simulator with the step of the search: a given one in s, else for a grid twice its own, up to 5 ms.

    A grid keeps its own if its event lies between two of these steps. Most fits do not come near enough to noise for
    the error of the integration to count, and those that do are repeated with a quarter of the step. `InputError` if
    the given step cannot be used.
    """
    own: float | None = getattr(simulator, "step", None)
    if step is not None:
        if own is None:
            raise InputError(
                "the simulator has no step", where="discovery.step", remedy="Leave discovery.step out"
            )
        try:
            return _simulating(simulator.with_step(step), observations)
        except InputError as error:
            where = f"{error.where}, discovery.step"
            raise InputError(error.what, where=where, allowed=error.allowed, remedy=error.remedy) from error
    if isinstance(simulator, PowerSystemSimulator) and simulator.step < GRID_STEP:
        with contextlib.suppress(InputError):
            return _simulating(simulator.with_step(min(2 * simulator.step, GRID_STEP)), observations)
    return simulator


def _simulating(simulator: Simulator, observations: Sequence[Observation]) -> Simulator:
    """The same, after it has shown that no event of some observations falls between its steps."""
    for observation in observations:
        simulator.simulate(simulator.parameters.nominal, observation.event)
    return simulator
