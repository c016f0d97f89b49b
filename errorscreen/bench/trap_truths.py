"""True responses of the traps: small systems with one hidden mechanism, in its hard form, written out by themselves.

They share no equation with the library: friction really sticks, limits and timers really switch, memories live on the
fine grid of the truth. The methods are Heun's and Euler's with a fiftieth of the sampling interval, exact to about 57
dB: enough under noise of 40 dB, not under one of 60.
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
    """Velocity of a mass with viscous, Coulomb and Stribeck friction that really sticks.

    Parameters
    ----------
    u : ndarray of shape (L,)
        Force, held between samples.
    dt : float
        Seconds between samples.
    b, c : float
        Gain and viscous friction.
    F, r, s : float
        Friction in motion, by how much more it is at rest, and where it has fallen to a third.
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
    """Position of an oscillator behind an actuator with one fault.

    Parameters
    ----------
    u : ndarray of shape (L,)
        Command, linear between samples.
    dt, b, c, k : float
        Seconds between samples; gain, damping and stiffness of the oscillator.
    kind : int
        0 none, 1 dead band, 2 backlash, 3 saturation, 4 rate limit, 5 delay, 6 lag.
    a, low, high : float
        Half width and centre of a dead band, half width of a play, seconds for one unit, delay, time constant; limits
        of a saturation.
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
    """Level of the lower of two tanks, the upper of which runs over.

    Parameters
    ----------
    u : ndarray of shape (L,)
        Flow into the upper tank, held between samples.
    dt, a, b : float
        Seconds between samples, and the outlets (Torricelli).
    kind : int
        0 none, 1 overflow of the upper tank, 2 the lower level's sensor saturates at `brim`.
    brim : float
        Height of the brim: what comes in at that level leaves at once.
    share : float
        Of what spills, arrives in the lower tank.
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
    """Level of a leaking store whose supply is cut by a relay.

    Parameters
    ----------
    u : ndarray of shape (L,)
        Supply, held between samples.
    dt, a, b : float
        Seconds between samples, gain, and leakage.
    kind : int
        0 none, 1 the relay watches the level, 2 the supply.
    share, threshold, timer : float
        What it takes away, above which value, and after how many seconds.
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
