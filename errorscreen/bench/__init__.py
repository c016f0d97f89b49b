"""Benchmarks of the command line."""

from errorscreen.bench.speed import measure_speed

__all__ = ["measure_speed"]
