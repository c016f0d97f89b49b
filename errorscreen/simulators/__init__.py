"""Models that turn parameters and an event into responses."""

from errorscreen.simulators.base import Responses, Simulator, Status
from errorscreen.simulators.external.callable import CallableSimulator
from errorscreen.simulators.grid.simulator import PowerSystemSimulator
from errorscreen.simulators.grid.unit import LoadUnderTest, Unit
from errorscreen.simulators.ode.simulator import ODESimulator
from errorscreen.simulators.plant.connection import Connection
from errorscreen.simulators.plant.simulator import PlantSimulator

__all__ = [
    "CallableSimulator",
    "Connection",
    "LoadUnderTest",
    "ODESimulator",
    "PlantSimulator",
    "PowerSystemSimulator",
    "Responses",
    "Simulator",
    "Status",
    "Unit",
]
