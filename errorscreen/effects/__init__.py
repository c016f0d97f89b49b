"""Mechanisms that a model may lack."""

from errorscreen.effects.base import Effect
from errorscreen.effects.exciter import EXCITER
from errorscreen.effects.measurement_lag import measurement_lag

_LAGS = (measurement_lag("P"), measurement_lag("Q"))

#: effects that are compiled into each device, by name of the device
LIBRARY: dict[str, tuple[Effect, ...]] = {
    "synchronous_machine": (EXCITER, *_LAGS),
    "dfig_plant": _LAGS,
    "pv_plant": _LAGS,
}

__all__ = ["EXCITER", "LIBRARY", "Effect", "measurement_lag"]
