"""Interpreter of the table of generic effects in a user's model: action and memory of each row.

Memories (lag, delay, rate limit, backlash, timers) are updated at the beginning of each step with the values just
before. Inside the step they are read only, except by a relay that drops out, so all four stages see the same model.
"""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable

from errorscreen.effects.generic import terms, transforms
from errorscreen.effects.generic.base import NUMBERS, PLACES
from errorscreen.effects.latent_input import KNOTS, PULSE

#: columns of the table: template, place, and the numbers of the target, of the signal that is read (-1: the quantity
#: itself; states, then inputs, then internal signals), of the state that receives a spill (-1: none), of the effect's
#: own state (-1: none), and of its first parameter
ROW = ("template", "place", "target", "reads", "into", "state", "first")
#: constants of each row: size of the signal; begin of the event and rate of the clock, for unknown signals; whether the
#: quantity is a held input
ROW_CONSTANTS = ("size", "begin", "rate", "held")
#: memory of a row: output and input (of a relay: whether it has dropped out) at the beginning of the step, timer,
#: distance from a threshold
MEMORIES = 4

EQUATION, INPUT, SIGNAL, OUTPUT = (PLACES.index(name) for name in ("equation", "input", "signal", "output"))
VISCOUS, QUADRATIC, CUBIC, DRAG = NUMBERS["viscous"], NUMBERS["quadratic"], NUMBERS["cubic"], NUMBERS["drag"]
MAGNETIC, COULOMB, STRIBECK, OFFSET = (
    NUMBERS[name] for name in ("magnetic_saturation", "coulomb", "stribeck", "offset")
)
FORCING, HYSTERESIS, OVERFLOW = NUMBERS["forcing"], NUMBERS["hysteresis"], NUMBERS["overflow"]
DEAD_BAND, SATURATION, RATE_LIMIT = NUMBERS["dead_band"], NUMBERS["saturation"], NUMBERS["rate_limit"]
LAG, DELAY, BACKLASH = NUMBERS["lag"], NUMBERS["delay"], NUMBERS["backlash"]
RELAY_ABOVE, LATENT = NUMBERS["relay_above"], NUMBERS["latent"]


@register_jitable(forceinline=True)
def _hats(t: Any, begin: Any, rate: Any, q: Any, i: Any, first: Any) -> Any:
    """Unknown signal, (I1), with its pulse from `first` on, and its knots after that."""
    past = max((t - begin) * rate, 0.0)
    distance = abs(past / KNOTS**2 - q[i, first + 1])
    pulse = q[i, first] * max(1.0 - distance / q[i, first + 2], 0.0)
    s = math.sqrt(past)
    j = int(s)
    if j > KNOTS:
        return pulse
    knots = first + len(PULSE)
    left = q[i, knots + j - 1] if j >= 1 else 0.0
    right = q[i, knots + j] if j < KNOTS else 0.0
    return pulse + left + (s - j) * (right - left)


@register_jitable(forceinline=True)
def _act(
    r: Any, table: Any, owns: Any, q: Any, i: Any, v: Any, s: Any, t: Any, tau: Any, h: Any, k: Any, begin: Any,
    memory: Any, history: Any, z: Any,
) -> Any:  # fmt: skip
    """Quantity v after effect r, tau seconds after step k began; `begin`: update the memory."""
    kind, first = table[r, 0], table[r, 6]
    a, own = q[i, first], table[r, 1] == EQUATION and table[r, 3] == table[r, 2]
    if kind == VISCOUS:
        return terms.viscous(v, s, a)
    if kind == QUADRATIC:
        return terms.quadratic(v, s, a)
    if kind == CUBIC:
        return terms.cubic(v, s, a)
    if kind == DRAG:
        return terms.drag(v, s, a)
    if kind == MAGNETIC:
        return terms.magnetic_saturation(v, s, a, q[i, first + 1])
    if kind == COULOMB:
        return terms.coulomb(v, s, a, owns[r, 0], h, own)
    if kind == STRIBECK:
        return terms.stribeck(v, s, a, q[i, first + 1], q[i, first + 2], owns[r, 0], h, own)
    if kind == OFFSET:
        return terms.offset(v, a)
    if kind == FORCING:
        return terms.forcing(v, t, a, q[i, first + 1], q[i, first + 2])
    if kind == HYSTERESIS:
        return terms.hysteresis(v, z, a)
    if kind == OVERFLOW:
        return v - terms.spill(v, s, a, q[i, first + 1], h)
    if kind == DEAD_BAND:
        return transforms.dead_band(v, a, q[i, first + 1])
    if kind == SATURATION:
        return transforms.saturation(v, a, q[i, first + 1], q[i, first + 2])
    if kind == LATENT:
        return v + a * _hats(t, owns[r, 1], owns[r, 2], q, i, first + 1)
    return _remembered(r, table, owns, q, i, v, s, tau, h, k, begin, memory, history)


@register_jitable(forceinline=True)
def _remembered(
    r: Any, table: Any, owns: Any, q: Any, i: Any, v: Any, s: Any, tau: Any, h: Any, k: Any, begin: Any,
    memory: Any, history: Any,
) -> Any:  # fmt: skip
    """Quantity v after an effect with a memory; before the record nothing moved."""
    kind, first = table[r, 0], table[r, 6]
    a = q[i, first]
    start = begin and k == 0
    after = tau == 0.0 and not begin  # just behind the beginning, where an input that is held has jumped
    if start:
        memory[r, 0], memory[r, 1], memory[r, 2], memory[r, 3] = v, v, 0.0, 0.0
        if kind >= RELAY_ABOVE:
            memory[r, 1] = 0.0
    if kind == DELAY:
        if begin:
            history[r, k] = v
        return transforms.delay(v, a, h, k, 0.0 if begin else tau, history, r, owns[r, 3] > 0.0, after)
    if kind >= RELAY_ABOVE:
        distance = s - q[i, first + 1] if kind == RELAY_ABOVE else q[i, first + 1] - s
        # one instant inside is enough to drop out, also within a step: memory[r, 1] notes it
        before, timer = memory[r, 3], memory[r, 2]
        if memory[r, 1] > 0.0:
            before, timer = -abs(distance), 0.0  # half a step ago, on average
        timer = 0.0 if start else transforms.time_beyond(distance, before, timer, tau)
        if begin or after:
            memory[r, 1], memory[r, 2], memory[r, 3] = 0.0, timer, distance
        elif distance <= 0.0 and memory[r, 3] > 0.0:
            memory[r, 1] = 1.0
        elif memory[r, 1] > 0.0:
            timer = 0.0
        return transforms.relay(v, timer, a, q[i, first + 2], h)
    if kind == RATE_LIMIT:
        w = v if start else transforms.rate_limit(v, memory[r, 0], tau, a)
    elif kind == LAG:
        w = v if start else transforms.lag(v, memory[r, 0], memory[r, 1], tau, a)
    else:
        w = transforms.backlash(v, memory[r, 0], a)
    if begin:
        memory[r, 0] = w
    if begin or after:
        memory[r, 1] = v
    return w


@register_jitable(forceinline=True)
def apply_effects(
    place: Any, values: Any, offset: Any, x: Any, u: Any, t: Any, tau: Any, h: Any, k: Any, begin: Any,
    n_states: Any, table: Any, owns: Any, q: Any, lane0: Any, lanes: Any, memory: Any, history: Any, dx: Any,
) -> Any:  # fmt: skip
    """Apply the effects at one kind of place to its values (from `offset` on), one after the other."""
    for r in range(table.shape[0]):
        if table[r, 1] != place:
            continue
        first, target, reads, own = table[r, 6], offset + table[r, 2], table[r, 3], table[r, 5]
        for j in range(lanes):
            i = lane0 + j
            if q[i, first] == 0.0:  # at strength 0 nothing is done at all
                continue
            v = values[j, target]
            s = v
            if reads >= n_states:
                s = u[j, reads - n_states]
            elif reads >= 0:
                s = x[j, reads]
            z = 0.0
            if own >= 0:
                z = x[j, own]
                dx[j, own] = terms.hysteresis_slope(s, z, q[i, first + 1])
            values[j, target] = _act(
                r, table, owns, q, i, v, s, t, tau, h, k, begin, memory[j], history[j], z
            )
            if table[r, 4] >= 0:
                dx[j, table[r, 4]] += q[i, first + 2] * terms.spill(v, s, q[i, first], q[i, first + 1], h)
