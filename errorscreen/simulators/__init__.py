"""Models that turn parameters and an event into responses."""

from errorscreen.simulators.base import Responses, Simulator, Status
from errorscreen.simulators.plant import PlantSimulator

__all__ = ["PlantSimulator", "Responses", "Simulator", "Status"]
