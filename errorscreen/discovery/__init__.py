"""What a simulation gets wrong, and whether its parameters can explain it."""

from errorscreen.discovery.diagnosis import (
    ChannelFit,
    StageError,
    Verdict,
    channel_fits,
    judge,
    noise_limit,
    stage_errors,
)

__all__ = ["ChannelFit", "StageError", "Verdict", "channel_fits", "judge", "noise_limit", "stage_errors"]
