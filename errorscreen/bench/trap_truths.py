"""True responses of the traps: small systems with one hidden mechanism in its hard form.

They share no equation with the library: friction really sticks, limits and timers really switch. The methods are Heun's
and Euler's with a fiftieth of the sampling interval, exact to about 57 dB: enough under noise of 40 dB, not of 60.
Every function takes the input ``u`` (L,) and the seconds ``dt`` between its samples, then the parameters of the model,
then those of the mechanism.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

#: steps of the truth between two samples
FINE = 50

_Array = NDArray[np.float64]


@numba.njit(cache=True)
def mass(u: Any, dt: Any, b: Any, c: Any, F: Any, r: Any, s: Any) -> Any:
    """Velocity of a mass with gain `b`, viscous friction `c` and dry friction; the force is held between samples.

    `F` is the dry friction in motion, `F` (1 + `r`) that at rest; at the velocity `s` the excess has fallen to a third.
    """
    out, v, h = np.empty(u.size), 0.0, dt / FINE
    for k in range(u.size):
        out[k] = v
        for _ in range(FINE):
            if v == 0.0:
                push = b * u[k]
                rest = F * (1.0 + r)
                if abs(push) > rest:
                    v = h * (push - math.copysign(rest, push))
                continue
            friction = F * (1.0 + r * math.exp(-((v / s) ** 2)))
            slope = b * u[k] - c * v - math.copysign(friction, v)
            ahead = v + h * slope
            if ahead * v <= 0.0:  # it stops; whether it goes on is for the next step
                v = 0.0
                continue
            friction = F * (1.0 + r * math.exp(-((ahead / s) ** 2)))
            after = b * u[k] - c * ahead - math.copysign(friction, ahead)
            moved = v + 0.5 * h * (slope + after)
            v = 0.0 if moved * v <= 0.0 else moved
    return out


@numba.njit(cache=True)
def actuator(u: Any, dt: Any, b: Any, c: Any, k: Any, kind: Any, a: Any, low: Any, high: Any) -> Any:
    """Position of an oscillator (gain `b`, damping `c`, stiffness `k`) behind an actuator with one fault.

    The command is linear between samples. `kind`: 0 none, 1 dead band (half width `a`, centre `low`), 2 backlash (half
    width), 3 saturation (`low`, `high`), 4 rate limit (seconds for one unit), 5 delay (s), 6 lag (s).
    """
    out, h = np.empty(u.size), dt / FINE
    x, v, w = 0.0, 0.0, u[0]
    for n in range(u.size):
        out[n] = x
        for j in range(FINE):
            command = u[n] + (u[n + 1] - u[n]) * j / FINE if n + 1 < u.size else u[n]
            if kind == 1:
                around = command - low
                w = low + math.copysign(max(abs(around) - a, 0.0), around)
            elif kind == 2:
                if command - a > w:
                    w = command - a
                elif command + a < w:
                    w = command + a
            elif kind == 3:
                w = low if command < low else high if command > high else command
            elif kind == 4:
                change = command - w
                w += math.copysign(min(abs(change), h / a), change)
            elif kind == 5:
                position = max(n + j / FINE - a / dt, 0.0)
                i = min(int(position), u.size - 2)
                w = u[i] + (u[i + 1] - u[i]) * (position - i)
            elif kind == 6:
                w += (1.0 - math.exp(-h / a)) * (command - w)
            else:
                w = command
            f = b * w - c * v - k * x
            x1, v1 = x + h * v, v + h * f
            g = b * w - c * v1 - k * x1
            x, v = x + 0.5 * h * (v + v1), v + 0.5 * h * (f + g)
    return out


@numba.njit(cache=True)
def tanks(u: Any, dt: Any, a: Any, b: Any, kind: Any, brim: Any, share: Any) -> Any:
    """Level of the lower of two tanks with outlets `a` and `b` (Torricelli); the inflow is held between samples.

    `kind`: 0 none, 1 the upper tank overflows at once above `brim` and `share` of that arrives in the lower one, 2 the
    sensor of the lower level saturates at `brim`.
    """
    out, h = np.empty(u.size), dt / FINE
    upper, lower = 1.0, 1.0
    for k in range(u.size):
        out[k] = min(lower, brim) if kind == 2 else lower
        for _ in range(FINE):
            flow = a * math.sqrt(max(upper, 0.0))
            spilled = 0.0
            ahead = upper + h * (u[k] - flow)
            if kind == 1 and ahead > brim:
                spilled = (ahead - brim) / h
                ahead = brim
            lower = max(lower + h * (flow + share * spilled - b * math.sqrt(max(lower, 0.0))), 0.0)
            upper = max(ahead, 0.0)
    return out


@numba.njit(cache=True)
def relay(u: Any, dt: Any, a: Any, b: Any, kind: Any, share: Any, threshold: Any, timer: Any) -> Any:
    """Level of a store with gain `a` and leakage `b`; the supply is held between samples.

    `kind`: 0 none, 1 or 2 a relay that watches the level or the supply takes `share` of the supply away after `timer`
    seconds above `threshold`.
    """
    out, h = np.empty(u.size), dt / FINE
    x, beyond = 0.0, 0.0
    for k in range(u.size):
        out[k] = x
        for _ in range(FINE):
            outside = (kind == 1 and x > threshold) or (kind == 2 and u[k] > threshold)
            beyond = beyond + h if outside else 0.0
            supply = u[k] * (1.0 - share) if beyond >= timer and kind > 0 else u[k]
            slope = a * supply - b * x
            x += h * (slope - 0.5 * h * b * slope)
    return out
