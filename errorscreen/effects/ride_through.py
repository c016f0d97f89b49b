r"""Momentary cessation and trips: beyond a voltage threshold, and after a timer, a plant stops, waits, and ramps back.

.. math::

    m &= [1 \pm (V_{th} - V)/\Delta V]_0^1,\quad \dot\tau = m - (1 - m)\,\tau/T_r             & (R1)\\
    \dot c &= \big[[(\tau - T_{th})/T_s]_0^1 + c/T_s\big]_0^1                                    & (R2)\\
    \rho &= 1 - [c/T_s]_0^1 + r_0\,[(c - T_c)/T_s]_0^1 + (1 - r_0)\,[(c - T_c)/T_{ramp}]_0^1     & (R3)\\
    r &= 1 - s\,(1 - \rho)                                                                  & (R4)

with + where a low voltage stops the plant, and − where a high one does. τ counts the time beyond the threshold (it is
reset within T_r = 10 ms once the voltage is back), c the time since the stop, r multiplies the current commands; a
share :math:`r_0` of them is back at once, the rest in a ramp. It stops once in an event. The transitions over
:math:`\Delta V` = 0.005 pu inside of the threshold and :math:`T_s` = 5 ms, but at least two steps of the integration,
instead of jumps, let responses follow threshold and timer smoothly. Beyond the threshold the clock runs at its full
rate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import clip

_T_RESET, _T_SMOOTH, _V_SMOOTH = 0.01, 0.005, 0.005


def _start(v: Values, h: float) -> Values:
    """Duration of the transitions that the integration can follow."""
    return {"Ts": np.full_like(v["Tth"], max(_T_SMOOTH, 2.0 * h))}


@register_jitable
def _released(
    value: Any, beyond: Any, timer: Any, c: Any, s: Any, Tth: Any, Tc: Any, r0: Any, Tramp: Any, Ts: Any
) -> Any:
    """Value times the release, and derivatives of the clocks, (R2) to (R4)."""
    back = r0 * clip((c - Tc) / Ts, 0.0, 1.0) + (1.0 - r0) * clip((c - Tc) / Tramp, 0.0, 1.0)
    stopped = clip(c / Ts, 0.0, 1.0) - back
    started = clip((timer - Tth) / Ts, 0.0, 1.0)
    return (
        value * (1.0 - s * stopped),
        beyond - (1.0 - beyond) * timer / _T_RESET,
        clip(started + c / Ts, 0.0, 1.0),
    )


def cessation(
    value: Any, V: Any, timer: Any, c: Any, s: Any, Vth: Any, Tth: Any, Tc: Any, r0: Any, Tramp: Any, Ts: Any
) -> Any:
    """Share of the current that is released, and derivatives of the clocks, (R1) to (R4), at low voltage."""
    below = clip(1.0 + (Vth - V) / _V_SMOOTH, 0.0, 1.0)
    return _released(value, below, timer, c, s, Tth, Tc, r0, Tramp, Ts)


def high_voltage_trip(
    value: Any, V: Any, timer: Any, c: Any, s: Any, Vth: Any, Tth: Any, Tc: Any, r0: Any, Tramp: Any, Ts: Any
) -> Any:
    """Share of the current that is released, and derivatives of the clocks, (R1) to (R4), at high voltage."""
    above = clip(1.0 - (Vth - V) / _V_SMOOTH, 0.0, 1.0)
    return _released(value, above, timer, c, s, Tth, Tc, r0, Tramp, Ts)


def _cessation(
    name: str,
    title: str,
    ranges: dict[str, tuple[float, float, float]],
    text: str,
    confused: tuple[str, ...],
    devices: tuple[str, ...],
    *,
    high: bool = False,
) -> Effect:
    """Effect with (typical, lower, upper) of its threshold and of each duration."""
    of, beyond = "ride-through", "above" if high else "below"
    return Effect(
        name=name,
        title=title,
        port="release",
        devices=devices,
        equations=high_voltage_trip if high else cessation,
        parameters=(
            strength("s", 1.0, 1.0, "", of, "s", "share of the current that stops; 0: none"),
            value("Vth", *ranges["Vth"], "pu", of, "V_th", f"voltage {beyond} which the timer runs"),
            value("Tth", *ranges["Tth"], "s", of, "T_th", f"time {beyond} the threshold until it stops"),
            value("Tc", *ranges["Tc"], "s", of, "T_c", "duration of the cessation"),
            value("r0", 0.0, 0.0, 0.8, "", of, "r_0", "share of it that is back at once"),
            value("Tramp", *ranges["Tramp"], "s", of, "T_ramp", "duration of the ramp back"),
        ),
        states=("timer", "c"),
        derived=("Ts",),
        initialise=_start,
        formula=f"I = I* (1 − s) from Tth after V {'>' if high else '<'} Vth, for Tc, then r0 of it at once, the rest "
        "over Tramp",
        description=text,
        source="IEEE Std 1547-2018, section 6.4; NERC, 900 MW Fault Induced Solar PV Resource Interruption, 2018",
        confused_with=confused,
        minima=8,
        smallest={"r0": 0.01},
    )


RIDE_THROUGH = _cessation(
    "cessation",
    "Momentary cessation with timer and ramp",
    {"Vth": (0.7, 0.2, 0.98), "Tth": (0.03, 0.0, 0.3), "Tc": (0.3, 0.0, 2.0), "Tramp": (0.5, 0.05, 4.0)},
    "The inverters stop injecting when the voltage has been low for a set time, wait, and ramp back. The model rides "
    "through: it misses the hole in active and reactive power and the slow return.",
    (
        "a ride-through trip",
        "a lower ramp limit after the fault",
        "priority for reactive current",
        "a current limit",
    ),
    ("dfig_plant", "pv_plant"),
)
RIDE_THROUGH_TRIP = _cessation(
    "trip",
    "Ride-through trip with timer, waiting time and ramp",
    {"Vth": (0.7, 0.2, 0.98), "Tth": (2.0, 0.3, 40.0), "Tc": (30.0, 2.0, 400.0), "Tramp": (10.0, 0.5, 60.0)},
    "The voltage stays below a threshold for longer than the ride-through curve allows: the plant trips, waits until "
    "it may connect again, and ramps up. Only long recordings show it.",
    ("momentary cessation", "a lower ramp limit after the fault", "a disconnection by other protection"),
    ("pv_plant",),
)
HIGH_VOLTAGE_TRIP = _cessation(
    "trip_high",
    "Trip at high voltage with timer, waiting time and ramp",
    {"Vth": (1.1, 1.02, 1.3), "Tth": (1.0, 0.02, 40.0), "Tc": (10.0, 0.2, 400.0), "Tramp": (5.0, 0.05, 60.0)},
    "The voltage stays above a threshold for longer than the ride-through curve allows: the plant trips, waits until "
    "it may connect again, and ramps up. The model has no limit upwards.",
    ("a volt-var or volt-watt droop", "a disconnection by other protection"),
    ("pv_plant",),
    high=True,
)
