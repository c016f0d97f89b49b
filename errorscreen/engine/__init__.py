"""Compiled integration of many parameter sets at once."""

from errorscreen.engine.kernels import Engine, ReferenceEngine, new_engine
from errorscreen.engine.stages import Call, Equations, Model, reads_of, stage, writes_of

__all__ = [
    "Call",
    "Engine",
    "Equations",
    "Model",
    "ReferenceEngine",
    "new_engine",
    "reads_of",
    "stage",
    "writes_of",
]
