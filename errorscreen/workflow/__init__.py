"""The main job, end to end."""

from errorscreen.workflow.output import build_result, write_outputs
from errorscreen.workflow.run import run_study
from errorscreen.workflow.study import Calibrated, Outcome, Study

__all__ = ["Calibrated", "Outcome", "Study", "build_result", "run_study", "write_outputs"]
