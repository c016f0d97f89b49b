"""What a simulation gets wrong, whether its parameters can explain it, and what it lacks."""

from errorscreen.discovery.diagnose import diagnose
from errorscreen.discovery.diagnosis import Diagnosis, HypothesisFit
from errorscreen.discovery.finder import CauseFinder
from errorscreen.discovery.first_look import Contribution, FirstLook, effect_dataset
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.fits.noise import noise_limit
from errorscreen.discovery.judge.acting import Acting
from errorscreen.discovery.judge.errors import ChannelFit, ModelFit, StageError, channel_fits, stage_errors
from errorscreen.discovery.judge.gain import EventGain, Gain, measure_gain
from errorscreen.discovery.judge.ranking import Cause, NamedEffect
from errorscreen.discovery.judge.residual_test import Cell, ResidualTest, residual_test
from errorscreen.discovery.judge.separation import Group, Separation, StateDifference
from errorscreen.discovery.judge.verdict import Verdict, held_out_limit, judge
from errorscreen.discovery.unknown_input.locations import InputLocation, rank_input_locations

__all__ = [
    "Acting",
    "Cause",
    "CauseFinder",
    "Cell",
    "ChannelFit",
    "Contribution",
    "Diagnosis",
    "EventGain",
    "FirstLook",
    "Gain",
    "Group",
    "Hypothesis",
    "HypothesisFit",
    "InputLocation",
    "ModelFit",
    "NamedEffect",
    "ResidualTest",
    "Separation",
    "StageError",
    "StateDifference",
    "Verdict",
    "channel_fits",
    "diagnose",
    "effect_dataset",
    "held_out_limit",
    "judge",
    "measure_gain",
    "noise_limit",
    "rank_input_locations",
    "residual_test",
    "stage_errors",
]
