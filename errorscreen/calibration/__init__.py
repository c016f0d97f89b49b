"""Optimisers and calibrators: find the parameter values that reproduce the recordings."""

from errorscreen.calibration.base import BaseCalibrator
from errorscreen.calibration.map import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.pso import PSOCalibrator
from errorscreen.calibration.search import BoundedSearch
from errorscreen.calibration.swarm import ParticleSwarm

__all__ = [
    "BaseCalibrator",
    "BoundedSearch",
    "FitProblem",
    "MAPCalibrator",
    "PSOCalibrator",
    "ParticleSwarm",
]
