"""Optimisers and calibrators: find the parameter values that reproduce the recordings."""

from errorscreen._runtime.registry import Registry
from errorscreen.calibration.base import BaseCalibrator
from errorscreen.calibration.fewest import fewest_parameters
from errorscreen.calibration.map import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.pso import PSOCalibrator
from errorscreen.calibration.search import BoundedSearch
from errorscreen.calibration.swarm import ParticleSwarm

#: Calibrators that a case file can name.
CALIBRATORS: Registry[type[BaseCalibrator]] = Registry(
    "calibrator",
    "errorscreen.calibrators",
    BaseCalibrator,
    {"map": MAPCalibrator, "pso": PSOCalibrator},
    classes=True,
)

__all__ = [
    "CALIBRATORS",
    "BaseCalibrator",
    "BoundedSearch",
    "FitProblem",
    "MAPCalibrator",
    "PSOCalibrator",
    "ParticleSwarm",
    "fewest_parameters",
]
