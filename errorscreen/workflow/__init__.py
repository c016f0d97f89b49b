"""The main job, end to end."""

from errorscreen.workflow.output import build_result, write_outputs
from errorscreen.workflow.study import Calibrated, Outcome, Study, run_study

__all__ = ["Calibrated", "Outcome", "Study", "build_result", "run_study", "write_outputs"]
