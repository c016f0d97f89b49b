"""Panels and tables of channels, and the style that all figures share; nothing touches the state of pyplot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import aligned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours that colour-blind readers can tell apart (Okabe and Ito); measured values are a wide grey line.
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")
MEASURED, PALE, GRID = "#8d99a3", "#c3cdd5", "#dddddd"


def figure_of(width: float, height: float) -> Figure:
    """Return an empty figure; its size is in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def with_unit(name: str, unit: str) -> str:
    """Return the label of an axis."""
    return f"{name} in {unit}" if unit else name


def mark_event(axes: Axes, start: float) -> None:
    """Draw a dotted line at the start of an event."""
    axes.axvline(start, color="#999999", lw=1.0, ls=":")


def tidy(axes: Axes) -> None:
    """Give the axes a pale grid and no frame."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)


def top_legend(figure: Figure, axes: Axes) -> None:
    """Explain the curves of one panel above all panels."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False)


def channel_table(channels: Iterable[tuple[str, str, NDArray[np.float64], float]]) -> str:
    """Write one line for each channel: name, unit, range of values (L,), noise and number of readings."""
    rows: list[tuple[Any, ...]] = [("channel", "unit", "lowest", "highest", "noise", "readings")]
    for name, unit, values, noise in channels:
        known = values[np.isfinite(values)]
        ends = (float(known.min()), float(known.max())) if len(known) else ("", "")
        rows.append((name, unit, *ends, float(noise), len(known)))
    return aligned(rows)


@dataclass(frozen=True)
class Curves:
    """Channels of one recording: measured (n, L) and simulated ones (n, L) by label, over time (L,) in seconds."""

    time: NDArray[np.float64]
    measured: NDArray[np.float64]
    start: float
    simulated: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    title: str = ""


def plot_curves(
    labels: Sequence[str], recordings: Sequence[Curves], window: tuple[float, float] | None = None
) -> Figure:
    """Draw one row of panels for each of n channels and one column for each recording.

    Parameters
    ----------
    labels : sequence of n str
        Labels of the vertical axes.
    recordings : sequence of Curves
    window : (float, float), optional
        First and last instant in seconds; the whole time axis where not given.
    """
    figure = figure_of(max(9.5, 4.6 * len(recordings)), 0.7 + 2.2 * len(labels))
    panels = figure.subplots(len(labels), len(recordings), sharex="col", squeeze=False)
    for column, curves in zip(panels.T, recordings, strict=True):
        for r, axes in enumerate(column):
            axes.plot(curves.time, curves.measured[r], color=MEASURED, lw=3.2, label="measured")
            for k, (label, values) in enumerate(curves.simulated.items()):
                style = {"color": COLOURS[k % len(COLOURS)], "ls": "-" if k else "--"}
                axes.plot(curves.time, values[r], lw=1.2, label=label, **style)
            mark_event(axes, curves.start)
            tidy(axes)
        if len(recordings) > 1:
            column[0].set_title(curves.title, fontsize=10)
        column[-1].set_xlabel("time in s")
        column[-1].set_xlim(*(window or curves.time[[0, -1]]))
    for axes, label in zip(panels[:, 0], labels, strict=True):
        axes.set_ylabel(label)
    top_legend(figure, panels[0, 0])
    return figure
