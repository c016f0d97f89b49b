"""What a simulation gets wrong, and whether its parameters can explain it."""

from errorscreen.discovery.diagnosis import (
    ChannelFit,
    StageError,
    Verdict,
    channel_fits,
    held_out_limit,
    judge,
    noise_limit,
    stage_errors,
)

__all__ = [
    "ChannelFit",
    "StageError",
    "Verdict",
    "channel_fits",
    "held_out_limit",
    "judge",
    "noise_limit",
    "stage_errors",
]
