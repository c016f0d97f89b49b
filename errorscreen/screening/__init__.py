"""Screeners: rank the parameters by what they contribute to the error, and select the worst."""

from errorscreen.screening.attribution import AttributionScreener
from errorscreen.screening.base import BaseScreener, ParameterRanking
from errorscreen.screening.contribution import ContributionScreener, contribution_pipeline
from errorscreen.screening.identifiability import IdentifiabilityScreener
from errorscreen.screening.random import RandomScreener
from errorscreen.screening.selection import RelativeThresholdSelector, TopKSelector
from errorscreen.screening.sensitivity import SensitivityScreener

__all__ = [
    "AttributionScreener",
    "BaseScreener",
    "ContributionScreener",
    "IdentifiabilityScreener",
    "ParameterRanking",
    "RandomScreener",
    "RelativeThresholdSelector",
    "SensitivityScreener",
    "TopKSelector",
    "contribution_pipeline",
]
