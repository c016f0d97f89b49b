"""Screeners: rank the parameters by what they contribute to the error, and select the worst."""

from errorscreen._runtime.registry import Registry
from errorscreen.screening.attribution import AttributionScreener
from errorscreen.screening.base import BaseScreener
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
    "RandomScreener",
    "RelativeThresholdSelector",
    "SensitivityScreener",
    "TopKSelector",
    "contribution_pipeline",
]
