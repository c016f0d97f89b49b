"""Validation by rule: errors in windows of a recording, figures of steps and oscillations, and limits for them."""

from errorscreen.validation.limits import PROFILES, Limits, Profile, WindowLimits
from errorscreen.validation.low_pass import low_pass
from errorscreen.validation.measures import (
    StepFigures,
    WindowErrors,
    recovery_time,
    step_figures,
    window_errors,
)
from errorscreen.validation.oscillation import oscillation
from errorscreen.validation.validate import Criterion, Validation, validate
from errorscreen.validation.windows import Window, windows

__all__ = [
    "PROFILES", "Criterion", "Limits", "Profile", "StepFigures", "Validation", "Window", "WindowErrors", "WindowLimits",
    "low_pass", "oscillation", "recovery_time", "step_figures", "validate", "window_errors", "windows",
]  # fmt: skip
