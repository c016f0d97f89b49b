"""Turbines with their governors, one file a model."""

from errorscreen.models.governors.tgov1 import TGOV1

GOVERNORS = (TGOV1,)
