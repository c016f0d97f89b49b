"""Devices, each in its own file with its equations and their sources, and the parts of a grid."""

from errorscreen.power.device import Constant, Device, GridInterface
from errorscreen.power.dfig_plant import DFIG_PLANT
from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt
from errorscreen.power.load import LOAD
from errorscreen.power.network import Network
from errorscreen.power.pv_plant import PV_PLANT
from errorscreen.power.synchronous_machine import SYNCHRONOUS_MACHINE
from errorscreen.power.two_axis_fixed import FixedMachine

#: every plant by name
DEVICES = {device.name: device for device in (SYNCHRONOUS_MACHINE, DFIG_PLANT, PV_PLANT)}

__all__ = [
    "DEVICES",
    "DFIG_PLANT",
    "LOAD",
    "PV_PLANT",
    "SYNCHRONOUS_MACHINE",
    "Branch",
    "Bus",
    "Constant",
    "Device",
    "FixedMachine",
    "Generator",
    "GridInterface",
    "Load",
    "Network",
    "Shunt",
]
