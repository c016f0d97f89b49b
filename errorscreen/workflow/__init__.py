"""The main job, end to end."""

from errorscreen.workflow.outcome import Outcome
from errorscreen.workflow.output import write_outputs
from errorscreen.workflow.run import run_study
from errorscreen.workflow.study import Study

__all__ = ["Outcome", "Study", "run_study", "write_outputs"]
