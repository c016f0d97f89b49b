"""Limits of a unit that act in a recording, or nearly: they are not fitted unless they are named.

A limit acts where its value matters. So the model is simulated with each limit moved up and down, in one batch: of a
limit that does not act, the move away from the signal changes nothing.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.observations import Observation
from errorscreen.models.device import Remark

#: a limit is moved by this part of its value, and a limit of zero by so many pu
MOVE, _FROM_ZERO = 0.2, 0.1


def limits_that_act(simulator: Any, observation: Observation) -> list[Remark]:
    """Sentences on the limits of a `PlantSimulator` that act in the simulation with nominal parameters, or nearly.

    A change of the response counts where it is larger than the noise of a channel.
    """
    names = simulator.device.limits
    if not names:
        return []
    rows = 1 + 2 * len(names)
    moved = copy.copy(simulator)
    constants: dict[str, Any] = {**simulator.constants}
    for k, name in enumerate(names):
        value = simulator.constants[name]
        constants[name] = np.full(rows, value)
        constants[name][1 + 2 * k : 3 + 2 * k] += np.array([1.0, -1.0]) * (MOVE * abs(value) or _FROM_ZERO)
    moved.constants = constants
    responses = moved.simulate(np.tile(simulator.parameters.nominal, (rows, 1)), observation.event)
    if not responses.ok[0]:
        return []
    # a unit that cannot start with a moved limit is at that limit
    change = np.nan_to_num(np.abs(responses.values - responses.values[0]), nan=np.inf)
    change = (change / observation.noise[:, None]).max(axis=1)
    notes, near = [], []
    for k, name in enumerate(names):
        up, down = change[1 + 2 * k], change[2 + 2 * k]
        acting = np.minimum(up, down) > 1
        if acting.any():
            notes.append(_told(name, simulator.constants[name], observation.time[acting]))
        elif max(up.max(), down.max()) > 1:
            near.append(name)
    if near:
        notes.append(
            f"{', '.join(near)} would act if moved by {100 * MOVE:g} %, and {'is' if len(near) == 1 else 'are'} not "
            "fitted."
        )
    return [*map(Remark, notes)]


def _told(name: str, value: float, when: NDArray[np.float64]) -> str:
    return (
        f"The limit {name} = {value:g} acts in the simulation of the model as it is: it changes the response by more "
        f"than noise from {when[0]:.4g} to {when[-1]:.4g} s. It is not fitted. If it may be wrong, name it among the "
        "parameters or candidates of the device: other parameters would make up for it."
    )
