"""Figures of responses, rankings and calibrated parameters.

No function touches the state of pyplot, so figures can be made anywhere: in threads, on servers, in reports.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.data.panels import (
    COLOURS,
    PALE,
    figure_of,
    mark_event,
    plot_curves,
    tidy,
    top_legend,
    with_unit,
)
from errorscreen.exceptions import InputError
from errorscreen.simulators.base import Simulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_responses(
    observation: Observation, responses: Mapping[str, ArrayLike], *, window: tuple[float, float] | None = None
) -> Figure:
    """Measured against simulated channels, one panel each, with the event marked.

    Parameters
    ----------
    observation : Observation
        Measured channels (R, L) on their time axis.
    responses : mapping of str to array-like of shape (R, L)
        Simulations by label, for example ``{"before": ..., "after": ...}``.
    window : (float, float), optional
        Instants in seconds between which is plotted; all where not given.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If a response has another shape than the measurement, or nothing was measured.

    Examples
    --------
    >>> from errorscreen.events import Event
    >>> time = np.linspace(0, 2, 50)
    >>> measured = np.where(time < 1, 1.0, 0.8)[None]
    >>> seen = Observation(Event(time, start=1.0), measured, np.array([0.01]), ("P",), ("pu",))
    >>> figure = plot_responses(seen, {"before": measured + 0.1})
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['P in pu']
    """
    return observation.plot(responses, window=window)


def plot_comparison(observations: Sequence[Observation], simulators: Mapping[str, Simulator]) -> Figure:
    """Measured against simulated channels, one column of panels for each recording.

    Parameters
    ----------
    observations : sequence of Observation
    simulators : mapping of str to Simulator
        Simulators by label, each at its nominal parameters, for example ``{"before": ..., "after": ...}``. They
        simulate the events of the recordings.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If nothing was measured, or a simulator has other channels than the recordings.
    SimulationError
        If a simulation fails.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> plant = PlantSimulator("synchronous_machine", demo_recordings(0)[0])
    >>> figure = plot_comparison([plant.observe(demo_recordings(0)[0])], {"before": plant})
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['P in pu', 'Q in pu']
    """
    measured = np.any([observation.mask.any(axis=1) for observation in observations], axis=0)
    columns = [
        o.curves({label: s.baseline(o.event) for label, s in simulators.items()}, measured)
        for o in observations
    ]
    return plot_curves(observations[0].labels(measured), columns)


def plot_bars(values: Mapping[str, float], label: str, *, selected: Collection[str] | None = None) -> Figure:
    """One bar for each name, from the largest value to the smallest.

    Parameters
    ----------
    values : mapping of str to float
        For example contributions of parameters or probabilities of causes.
    label : str
        Label of the axis of the values.
    selected : collection of str, optional
        Names whose bars are dark; all where not given.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If there is no value.

    Examples
    --------
    >>> figure = plot_bars({"D": 1.0, "Xd": 2.0}, "contribution")
    >>> [text.get_text() for text in figure.axes[0].get_yticklabels()]
    ['Xd', 'D']
    """
    if not values:
        raise InputError("there is no value", where="plot_bars", allowed="at least one")
    names = sorted(values, key=lambda name: -values[name])
    figure = figure_of(6.0, 1.0 + 0.26 * len(names))
    axes = figure.subplots()
    _draw_bars(axes, names, [values[name] for name in names], selected, COLOURS[1])
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel(label)
    return figure


def plot_rankings(
    contributions: Mapping[str, Mapping[str, float]],
    *,
    selected: Mapping[str, Collection[str]] | None = None,
) -> Figure:
    """Contributions of all parameters by several screeners, side by side.

    Each panel is relative to its own largest contribution, because contributions of different screeners have
    different units. Parameters stand in the order of the first screener.

    Parameters
    ----------
    contributions : mapping of str to mapping of str to float
        Contribution of each parameter by screener.
    selected : mapping of str to collection of str, optional
        Parameters that each screener selected; the others are drawn pale.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If there is no screener, or screeners rank different parameters.

    Examples
    --------
    >>> figure = plot_rankings({"cnn": {"Xd": 2.0, "D": 1.0}, "random": {"D": 0.3, "Xd": 0.1}})
    >>> [axes.get_title() for axes in figure.axes]
    ['cnn', 'random']
    """
    if not contributions:
        raise InputError("there is no screener", where="plot_rankings", allowed="at least one")
    first = next(iter(contributions.values()))
    names = sorted(first, key=lambda name: -first[name])
    for label, values in contributions.items():
        if set(values) != set(names):
            raise InputError(
                f"screener {label!r} ranks other parameters: {', '.join(values)}",
                where="plot_rankings",
                allowed=", ".join(names),
            )
    figure = figure_of(1.6 + 2.6 * len(contributions), 1.0 + 0.26 * len(names))
    panels = figure.subplots(1, len(contributions), sharey=True, squeeze=False)[0]
    for k, (axes, (label, values)) in enumerate(zip(panels, contributions.items(), strict=True)):
        largest = max(abs(v) for v in values.values()) or 1.0
        chosen = None if selected is None else selected.get(label)
        colour = COLOURS[(k + 1) % len(COLOURS)]
        _draw_bars(axes, names, [values[name] / largest for name in names], chosen, colour)
        axes.set_title(label, fontsize=10)
        axes.set_xlim(0, 1.02)
    panels[0].set_yticks(range(len(names)), names)
    panels[0].invert_yaxis()
    figure.supxlabel("contribution relative to the largest", fontsize=10)
    return figure


def plot_intervals(
    names: Sequence[str],
    nominal: ArrayLike,
    bounds: ArrayLike,
    values: ArrayLike,
    intervals: ArrayLike,
    *,
    identifiable: ArrayLike | None = None,
    scales: ArrayLike | None = None,
) -> Figure:
    """Calibrated parameters with their intervals, relative to nominal and within their bounds.

    Parameters
    ----------
    names : sequence of k str
    nominal, values : array-like of shape (k,)
    bounds, intervals : array-like of shape (k, 2)
        Lower and upper ends.
    identifiable : array-like of shape (k,), optional
        False where the recording does not determine the value; drawn hollow.
    scales : array-like of shape (k,), optional
        What a deviation is measured against; the size of the nominal value where not given.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If shapes do not fit, or a scale is not positive.

    Examples
    --------
    >>> figure = plot_intervals(["Xd"], [1.0], [[0.7, 1.3]], [1.1], [[1.0, 1.2]])
    >>> figure.axes[0].get_xlabel()
    'deviation from nominal in %'
    """
    k = len(names)
    centre = shaped(nominal, (k,), "nominal")
    size = np.abs(centre) if scales is None else shaped(scales, (k,), "scales")
    if not np.all(size > 0):
        raise InputError("a scale is not positive", where="plot_intervals", remedy="Give scales")
    known = np.ones(k, dtype=bool) if identifiable is None else np.asarray(identifiable, dtype=bool)
    limit, span, value = (
        100 * (shaped(a, s, w) - centre[:, None] if len(s) == 2 else shaped(a, s, w) - centre)
        for a, s, w in (
            (bounds, (k, 2), "bounds"),
            (intervals, (k, 2), "intervals"),
            (values, (k,), "values"),
        )
    )
    limit, span, value = limit / size[:, None], span / size[:, None], value / size
    figure = figure_of(7.5, 1.2 + 0.3 * k)
    axes = figure.subplots()
    rows = np.arange(k)
    axes.barh(rows, limit[:, 1] - limit[:, 0], left=limit[:, 0], height=0.62, color="#eef1f4", label="bounds")
    axes.hlines(rows, span[:, 0], span[:, 1], color=COLOURS[1], lw=2.2, label="interval")
    for mask, face, label in ((known, COLOURS[1], "value"), (~known, "white", "value, not identifiable")):
        if mask.any():
            axes.plot(
                value[mask], rows[mask], "o", ms=6, mfc=face, mec=COLOURS[1], label=label, ls="none", zorder=3
            )
    axes.axvline(0, color="#333333", lw=0.8, ls=":")
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xlabel("deviation from nominal in %")
    tidy(axes)
    top_legend(figure, axes)
    return figure


def plot_waveform(
    time: ArrayLike, signal: ArrayLike, name: str, *, unit: str = "pu", event_time: float | None = None
) -> Figure:
    """One signal over time.

    Parameters
    ----------
    time, signal : array-like of shape (L,)
        Seconds, and values in `unit`.
    name, unit : str
        For the axis.
    event_time : float, optional
        Marked where given.

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> plot_waveform([0.0, 1.0], [0.0, 0.2], "Pm").axes[0].get_ylabel()
    'Pm in pu'
    """
    figure = figure_of(7.0, 2.6)
    axes = figure.subplots()
    axes.plot(np.asarray(time, dtype=float), np.asarray(signal, dtype=float), color=COLOURS[1])
    axes.set_xlabel("time in s")
    axes.set_ylabel(with_unit(name, unit))
    if event_time is not None:
        mark_event(axes, event_time)
    tidy(axes)
    return figure


def shaped(values: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Return an array of the wanted shape, or raise `InputError`."""
    array = np.asarray(values, dtype=float)
    if array.shape != shape:
        raise InputError(f"{what} has shape {array.shape}", allowed=f"{shape}")
    return array


def _draw_bars(
    axes: Axes, names: Sequence[str], values: Sequence[float], selected: Collection[str] | None, colour: str
) -> None:
    shown = names if selected is None else selected
    axes.barh(range(len(names)), values, color=[colour if name in shown else PALE for name in names])
    tidy(axes)
