"""Benchmarks of the command line."""

from errorscreen.bench.ablation import ablation_study
from errorscreen.bench.discovery import discovery_study
from errorscreen.bench.paper import effort_of, paper_study
from errorscreen.bench.paper_draw import Effort
from errorscreen.bench.speed import measure_speed

__all__ = ["Effort", "ablation_study", "discovery_study", "effort_of", "measure_speed", "paper_study"]
