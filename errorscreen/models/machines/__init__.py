"""Machines, one file a model."""

from errorscreen.models.machines.round_rotor import GENROE, GENROU

MACHINES = (GENROU, GENROE)
