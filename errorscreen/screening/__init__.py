"""Screeners: rank parameters by their contribution to the error and select the most suspicious."""

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
