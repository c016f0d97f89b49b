"""Models that turn parameters and an event into responses."""

from errorscreen.simulators.base import Responses, Simulator, Status
from errorscreen.simulators.callable import CallableSimulator
from errorscreen.simulators.grid_unit import LoadUnderTest, Unit
from errorscreen.simulators.ode import ODESimulator
from errorscreen.simulators.plant import PlantSimulator
from errorscreen.simulators.power_system import PowerSystemSimulator

__all__ = [
    "CallableSimulator",
    "LoadUnderTest",
    "ODESimulator",
    "PlantSimulator",
    "PowerSystemSimulator",
    "Responses",
    "Simulator",
    "Status",
    "Unit",
]
