"""Benchmarks of the command line."""

from errorscreen.bench.discovery import discovery_study
from errorscreen.bench.paper import paper_study
from errorscreen.bench.paper_draw import Effort
from errorscreen.bench.speed import measure_speed

__all__ = ["Effort", "discovery_study", "measure_speed", "paper_study"]
