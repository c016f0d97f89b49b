"""Models of devices, each in its own file with its equations and their sources."""

from errorscreen._runtime.registry import Registry
from errorscreen.models.device import Constant, Device, GridInterface
from errorscreen.models.loads.load import LOAD
from errorscreen.models.machines.fixed import FixedMachine
from errorscreen.models.machines.two_axis import SYNCHRONOUS_MACHINE
from errorscreen.models.renewables.dfig_plant import DFIG_PLANT
from errorscreen.models.renewables.pv_plant import PV_PLANT

#: Devices that a plant can be, in playback or in a grid.
DEVICES: Registry[Device] = Registry(
    "device",
    "errorscreen.devices",
    Device,
    {
        "synchronous_machine": SYNCHRONOUS_MACHINE,
        "dfig_plant": DFIG_PLANT,
        "pv_plant": PV_PLANT,
    },
)

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
