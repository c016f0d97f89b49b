"""Figures of recordings, errors, rankings and calibrations; every function returns a matplotlib `Figure`.

No function touches the state of pyplot, so figures can be made anywhere: in threads, on servers, in reports.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.exceptions import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

#: Part of an error image: channel, start and stop in seconds, band in hertz.
Outlined = tuple[str, tuple[float, float], tuple[float, float]]
#: Colours that stay apart for colour-blind readers (Okabe and Ito); measured values are a wide grey line.
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")
MEASURED, PALE, GRID = "#8d99a3", "#c3cdd5", "#dddddd"
OUTLINE = "#ff4040"
#: Decibels below the largest energy that an error image shows.
DYNAMIC_RANGE = 40.0


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
    rows = np.flatnonzero(observation.mask.any(axis=1))
    if not len(rows):
        raise InputError("no channel was measured", where="plot_responses", allowed="at least one value")
    figure = figure_of(9.5, 0.7 + 2.2 * len(rows))
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, r in zip(panels, rows, strict=True):
        axes.plot(observation.time, observation.values[r], color=MEASURED, lw=3.2, label="measured")
        for k, (label, values) in enumerate(responses.items()):
            values = _shaped(values, observation.values.shape, f"response {label!r}")
            style = {"color": COLOURS[k % len(COLOURS)], "lw": 1.2, "ls": "--" if k == 0 else "-"}
            axes.plot(observation.time, values[r], label=label, **style)
        mark_event(axes, observation.event.start)
        axes.set_ylabel(with_unit(observation.channels[r], observation.units[r]))
        tidy(axes)
    panels[-1].set_xlabel("time in s")
    panels[-1].set_xlim(*(window or (observation.time[0], observation.time[-1])))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False)
    return figure


def plot_error_images(
    energies: Mapping[str, ArrayLike],
    frequencies: ArrayLike,
    times: ArrayLike,
    channels: Sequence[str],
    *,
    event_time: float | None = None,
    cone: ArrayLike | None = None,
    outlined: Mapping[str, Sequence[Outlined]] | None = None,
) -> Figure:
    """Wavelet energy of response errors over time and frequency, one row for each channel.

    Colours give decibels below the largest energy of the channel in all images of its row, so that images beside
    each other can be compared.

    Parameters
    ----------
    energies : mapping of str to array-like of shape (R, H, W)
        Energies |W|² (not their logarithm) by label, for example before and after calibration.
    frequencies : array-like of shape (H,)
        Hertz, increasing, logarithmically spaced.
    times : array-like of shape (W,)
        Seconds, increasing.
    channels : sequence of R str
    event_time : float, optional
        Seconds; marked by a line.
    cone : array-like of shape (H,), optional
        Seconds from either end of the record within which a row is marked by that end; veiled.
    outlined : mapping of str to sequence of (str, (float, float), (float, float)), optional
        Where the error of an image is more than noise: channel, start and stop in seconds, band in hertz; drawn as far
        as it lies in the image.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If shapes do not fit, or something is outlined in an image or channel that there is not.

    Examples
    --------
    >>> figure = plot_error_images({"before": np.ones((1, 3, 5))}, [1, 2, 4], np.arange(5.0), ["P"])
    >>> figure.axes[0].get_yscale()
    'log'
    """
    f, t = np.asarray(frequencies, dtype=float), np.asarray(times, dtype=float)
    shape = (len(channels), len(f), len(t))
    images = {label: _shaped(e, shape, f"energy {label!r}") for label, e in energies.items()}
    outlines = _by_panel(outlined or {}, images, channels)
    figure = figure_of(1.3 + 4.1 * len(images), 0.7 + 2.4 * len(channels))
    grid = figure.subplots(len(channels), len(images), sharex=True, sharey=True, squeeze=False)
    for r, channel in enumerate(channels):
        largest = max(float(np.nanmax(image[r])) for image in images.values()) or 1.0
        for axes, (label, image) in zip(grid[r], images.items(), strict=True):
            mesh = _draw_energy(axes, t, f, image[r] / largest)
            if cone is not None:
                _shade_cone(axes, t, f, np.asarray(cone, dtype=float))
            if event_time is not None:
                axes.axvline(event_time, color="white", lw=1.2, ls="--")
            _outline(axes, outlines.get((label, channel), []))
            axes.set_title(f"{channel}, {label}", fontsize=10)
            axes.tick_params(labelsize=9)
        grid[r][0].set_ylabel("frequency in Hz")
        figure.colorbar(mesh, ax=list(grid[r]), label="energy in dB", pad=0.02)
    for axes in grid[-1]:
        axes.set_xlabel("time in s")
    drawn = [patch for axes in grid.flat for patch in axes.patches]
    if drawn:
        figure.legend(drawn[:1], ["more than noise"], loc="outside upper center", frameon=False, fontsize=9)
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
        chosen = names if selected is None else selected.get(label, names)
        colour = COLOURS[(k + 1) % len(COLOURS)]
        axes.barh(
            range(len(names)),
            [values[name] / largest for name in names],
            color=[colour if name in chosen else PALE for name in names],
        )
        axes.set_title(label, fontsize=10)
        axes.set_xlim(0, 1.02)
        tidy(axes)
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
    centre = _shaped(nominal, (k,), "nominal")
    size = np.abs(centre) if scales is None else _shaped(scales, (k,), "scales")
    if not np.all(size > 0):
        raise InputError("a scale is not positive", where="plot_intervals", remedy="Give scales")
    known = np.ones(k, dtype=bool) if identifiable is None else np.asarray(identifiable, dtype=bool)
    limit, span, value = (
        100 * (_shaped(a, s, w) - centre[:, None] if len(s) == 2 else _shaped(a, s, w) - centre)
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
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False)
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


def figure_of(width: float, height: float) -> Figure:
    """Empty figure of a size in inches, without pyplot."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _shaped(values: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=float)
    if array.shape != shape:
        raise InputError(f"{what} has shape {array.shape}", allowed=f"{shape}")
    return array


def with_unit(name: str, unit: str) -> str:
    """Label of an axis."""
    return f"{name} in {unit}" if unit else name


def mark_event(axes: Axes, start: float) -> None:
    """Dotted line at the instant of an event."""
    axes.axvline(start, color="#999999", lw=1.0, ls=":")


def _draw_energy(
    axes: Axes, times: NDArray[Any], frequencies: NDArray[Any], energy: NDArray[Any]
) -> QuadMesh:
    """One image of energies (H, W) relative to the largest."""
    level = 10 * np.log10(np.maximum(energy, 10 ** (-DYNAMIC_RANGE / 10)))
    mesh = axes.pcolormesh(
        times,
        frequencies,
        level,
        cmap="viridis",
        vmin=-DYNAMIC_RANGE,
        vmax=0,
        shading="nearest",
        rasterized=True,
    )
    axes.set_yscale("log")
    axes.set_ylim(frequencies[0], frequencies[-1])
    return mesh


def _by_panel(
    outlined: Mapping[str, Sequence[Outlined]], labels: Collection[str], channels: Sequence[str]
) -> dict[tuple[str, str], list[Outlined]]:
    """What is outlined in each image, by its label and channel."""
    panels: dict[tuple[str, str], list[Outlined]] = {}
    for label, cells in outlined.items():
        for cell in cells:
            if label not in labels or cell[0] not in channels:
                raise InputError(
                    f"there is no image {label!r} of a channel {cell[0]!r}",
                    where="plot_error_images, outlined",
                    allowed=f"images {', '.join(labels)}; channels {', '.join(channels)}",
                )
            panels.setdefault((label, cell[0]), []).append(cell)
    return panels


def _outline(axes: Axes, cells: Sequence[Outlined]) -> None:
    """Edges of cells as far as they lie in the axes, each apart from those beside it."""
    from matplotlib.patches import Rectangle

    (first, last), (lowest, highest) = axes.get_xlim(), axes.get_ylim()
    for _, (start, stop), (low, high) in cells:
        start, stop, low, high = max(start, first), min(stop, last), max(low, lowest), min(high, highest)
        if start < stop and low < high:
            left, right = _inset(start, stop, 0.004 * (last - first))
            span = _inset(np.log(low), np.log(high), 0.008 * np.log(highest / lowest))
            bottom, top = np.exp(span)
            sides = (right - left, top - bottom)
            axes.add_patch(Rectangle((left, bottom), *sides, fill=False, edgecolor=OUTLINE, lw=1.2))


def _inset(low: float, high: float, gap: float) -> tuple[float, float]:
    """Range without a gap at both ends, which leaves most of a short one."""
    gap = min(gap, 0.2 * (high - low))
    return low + gap, high - gap


def _shade_cone(axes: Axes, times: NDArray[Any], frequencies: NDArray[Any], cone: NDArray[Any]) -> None:
    """Pale veil over what the ends of the record mark."""
    reach = np.minimum(cone, 0.5 * (times[-1] - times[0]))
    for end, inner in ((times[0], times[0] + reach), (times[-1], times[-1] - reach)):
        axes.fill_betweenx(frequencies, end, inner, facecolor="white", alpha=0.35, edgecolor="none")


def tidy(axes: Axes) -> None:
    """Pale grid, no frame."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
