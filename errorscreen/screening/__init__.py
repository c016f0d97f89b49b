"""Screeners: rank parameters by their contribution to the error and select the most suspicious."""

from errorscreen._runtime.registry import Registry
from errorscreen.screening.attribution import AttributionScreener
from errorscreen.screening.base import BaseScreener, ParameterRanking
from errorscreen.screening.contribution import ContributionScreener, contribution_pipeline
from errorscreen.screening.identifiability import IdentifiabilityScreener
from errorscreen.screening.network import NetworkScreener
from errorscreen.screening.random import RandomScreener
from errorscreen.screening.selection import RelativeThresholdSelector, TopKSelector
from errorscreen.screening.sensitivity import SensitivityScreener

#: Screeners that a case file can name.
SCREENERS: Registry[type[BaseScreener]] = Registry(
    "screener",
    "errorscreen.screeners",
    BaseScreener,
    {
        "cnn": NetworkScreener,
        "sensitivity": SensitivityScreener,
        "identifiability": IdentifiabilityScreener,
        "attribution": AttributionScreener,
        "random": RandomScreener,
    },
    classes=True,
)

__all__ = [
    "SCREENERS",
    "AttributionScreener",
    "BaseScreener",
    "ContributionScreener",
    "IdentifiabilityScreener",
    "NetworkScreener",
    "ParameterRanking",
    "RandomScreener",
    "RelativeThresholdSelector",
    "SensitivityScreener",
    "TopKSelector",
    "contribution_pipeline",
]
