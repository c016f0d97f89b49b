"""Images of the wavelet energy of response errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.panels import figure_of
from errorscreen.exceptions import InputError
from errorscreen.plotting.charts import shaped

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

#: Part of an error image: channel, start and stop in seconds, band in hertz.
Outlined = tuple[str, tuple[float, float], tuple[float, float]]
OUTLINE = "#ff4040"
#: An error image shows energies down to this many decibels below the largest.
DYNAMIC_RANGE = 40.0


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
    images = {label: shaped(e, shape, f"energy {label!r}") for label, e in energies.items()}
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
