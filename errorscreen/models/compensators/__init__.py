"""Load compensation of excitation systems."""

from errorscreen.models.compensators.load_compensation import COMP, IEEEVC

COMPENSATORS = (COMP, IEEEVC)
