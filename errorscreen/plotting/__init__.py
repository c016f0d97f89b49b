"""Figures; every function returns a matplotlib `Figure` and leaves the state of pyplot alone."""

from errorscreen.plotting.charts import (
    plot_bars,
    plot_comparison,
    plot_intervals,
    plot_rankings,
    plot_responses,
    plot_waveform,
)
from errorscreen.plotting.error_images import plot_error_images
from errorscreen.plotting.signatures import plot_signature
from errorscreen.plotting.system_diagram import plot_system

__all__ = [
    "plot_bars",
    "plot_comparison",
    "plot_error_images",
    "plot_intervals",
    "plot_rankings",
    "plot_responses",
    "plot_signature",
    "plot_system",
    "plot_waveform",
]
