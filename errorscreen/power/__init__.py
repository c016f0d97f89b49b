"""Devices: each in its own file, with its equations and their sources."""

from errorscreen.power.device import Constant, Device, GridInterface
from errorscreen.power.dfig_plant import DFIG_PLANT
from errorscreen.power.load import LOAD
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
    "Constant",
    "Device",
    "FixedMachine",
    "GridInterface",
]
