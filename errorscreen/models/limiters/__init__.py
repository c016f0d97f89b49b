"""Limiters of the excitation, one file a model."""

from errorscreen.models.limiters.mnlex2 import MNLEX2
from errorscreen.models.part import Part

LIMITERS: tuple[Part, ...] = (MNLEX2,)
