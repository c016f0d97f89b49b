"""What a simulation gets wrong, whether its parameters can explain it, and what it lacks."""

from errorscreen.discovery.diagnosis import (
    ChannelFit,
    StageError,
    channel_fits,
    stage_errors,
)
from errorscreen.discovery.finder import CauseFinder
from errorscreen.discovery.first_look import FirstLook, effect_dataset
from errorscreen.discovery.gain import EventGain, Gain, measure_gain
from errorscreen.discovery.hypotheses import Hypothesis
from errorscreen.discovery.latent import Place, rank_places
from errorscreen.discovery.noise import noise_limit
from errorscreen.discovery.quick import Diagnosis, diagnose
from errorscreen.discovery.ranking import Cause
from errorscreen.discovery.remainder import Cell, Remainder, remainder_test
from errorscreen.discovery.separation import Group
from errorscreen.discovery.verdict import Verdict, held_out_limit, judge

__all__ = [
    "Cause",
    "CauseFinder",
    "Cell",
    "ChannelFit",
    "Diagnosis",
    "EventGain",
    "FirstLook",
    "Gain",
    "Group",
    "Hypothesis",
    "Place",
    "Remainder",
    "StageError",
    "Verdict",
    "channel_fits",
    "diagnose",
    "effect_dataset",
    "held_out_limit",
    "judge",
    "measure_gain",
    "noise_limit",
    "rank_places",
    "remainder_test",
    "stage_errors",
]
