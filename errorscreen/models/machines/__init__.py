"""Machines, one file a family."""

from errorscreen.models.machines.classical import GENCLS
from errorscreen.models.machines.round_rotor import GENROE, GENROU
from errorscreen.models.machines.salient_pole import GENSAE, GENSAL
from errorscreen.models.machines.saturated_mutual import GENTPJ1

MACHINES = (GENROU, GENROE, GENSAL, GENSAE, GENTPJ1, GENCLS)
