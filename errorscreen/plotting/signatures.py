"""What an effect changes in the responses to some events, at rising strength."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from errorscreen.data.panels import COLOURS, figure_of, mark_event, tidy, top_legend, with_unit
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.exceptions import check_real
from errorscreen.simulators.base import Simulator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: a change below this is rounding
_NOTHING = 1e-9


def plot_signature(
    simulator: Simulator,
    effect: Effect | str,
    events: Sequence[Event] | None = None,
    *,
    strengths: Sequence[float] = (0.1, 0.3, 1.0),
) -> Figure:
    """Change of each channel by an effect, one row for each channel and one column for each event.

    Parameters
    ----------
    simulator : Simulator
        Without the effect, at its nominal parameters.
    effect : Effect or str
        One of ``simulator.effects``. Its other parameters are nominal.
    events : sequence of Event, optional
        The simulator's default event where not given.
    strengths : sequence of float
        In multiples of the largest strength, the upper bound; each 0 to 1.

    Returns
    -------
    matplotlib.figure.Figure
        A strength that cannot be simulated is left out.

    Raises
    ------
    InputError
        If the simulator has no such effect or a strength cannot be used.
    SimulationError
        If the simulator cannot be simulated without the effect.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> plant = PlantSimulator("synchronous_machine", demo_recordings(random_state=0)[0])
    >>> [axes.get_ylabel() for axes in plot_signature(plant, "exciter").axes]
    ['change of P in pu', 'change of Q in pu']
    """
    shares = [check_real(s, "strengths", low=0.0, high=1.0) for s in strengths]
    extended = simulator.extend(effect)
    strength = extended.extensions[-1].local(extended.extensions[-1].strength.name)
    values = np.array(shares) * extended.parameters[strength].upper
    rows = np.vstack([extended.parameters.embed([value], [strength]) for value in values])
    events = [simulator.event] if events is None else list(events)
    figure = figure_of(4.6 * max(1.6, len(events)), 0.9 + 1.7 * len(simulator.channels))
    panels = figure.subplots(len(simulator.channels), len(events), sharex="col", squeeze=False)
    for column, event in zip(panels.T, events, strict=True):
        before, after = simulator.baseline(event), extended.simulate(rows, event)
        for r, axes in enumerate(column):
            for k, (value, response) in enumerate(zip(values, after.values, strict=True)):
                if np.isfinite(response).all():
                    label = f"{strength} = {value:.3g}"
                    colour = COLOURS[k % len(COLOURS)]
                    axes.plot(after.time, response[r] - before[r], color=colour, lw=1.2, label=label)
            if np.abs(axes.dataLim.intervaly).max() < _NOTHING:
                axes.set_ylim(-1.0, 1.0)
            mark_event(axes, event.start)
            tidy(axes)
        column[0].set_title(event.name, fontsize=10)
        column[-1].set_xlabel("time in s")
    for axes, name, unit in zip(panels[:, 0], simulator.channels, simulator.units, strict=True):
        axes.set_ylabel(with_unit(f"change of {name}", unit))
    top_legend(figure, panels[0, 0])
    return figure
