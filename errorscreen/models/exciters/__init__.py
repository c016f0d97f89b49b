"""Excitation systems, one file a model."""

from errorscreen.models.exciters.sexs import SEXS

EXCITERS = (SEXS,)
