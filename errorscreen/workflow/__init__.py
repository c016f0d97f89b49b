"""The main job, end to end."""

from errorscreen.workflow.study import Calibrated, Outcome, Study, run_study

__all__ = ["Calibrated", "Outcome", "Study", "run_study"]
