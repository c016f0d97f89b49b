"""Mechanisms that any model can lack: a template, the quantity it acts on, and the signal it depends on."""

from errorscreen.effects.generic.base import TEMPLATES, GenericEffect
from errorscreen.effects.generic.library import generic_effects
from errorscreen.effects.generic.scales import Anatomy

__all__ = ["TEMPLATES", "Anatomy", "GenericEffect", "generic_effects"]
