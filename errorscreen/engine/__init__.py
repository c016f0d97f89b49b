"""Compiled integration of many parameter sets at once."""

from errorscreen.engine.kernels import Engine, ReferenceEngine
from errorscreen.engine.stages import Call, Equations, Model, reads_of, stage, writes_of

__all__ = ["Call", "Engine", "Equations", "Model", "ReferenceEngine", "reads_of", "stage", "writes_of"]
