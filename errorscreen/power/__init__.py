"""The grid: its parts, load flow, and reduction to the terminals of plants."""

from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt
from errorscreen.power.network import Network

__all__ = ["Branch", "Bus", "Generator", "Load", "Network", "Shunt"]
