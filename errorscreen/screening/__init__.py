"""Screeners: rank the parameters by what they contribute to the error, and select the worst."""

from errorscreen.screening.base import BaseScreener
from errorscreen.screening.contribution import ContributionScreener, contribution_pipeline
from errorscreen.screening.random import RandomScreener
from errorscreen.screening.selection import RelativeThresholdSelector, TopKSelector
from errorscreen.screening.sensitivity import SensitivityScreener

__all__ = [
    "BaseScreener",
    "ContributionScreener",
    "RandomScreener",
    "RelativeThresholdSelector",
    "SensitivityScreener",
    "TopKSelector",
    "contribution_pipeline",
]
