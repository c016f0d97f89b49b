r"""Integrates a user's model with generic effects by the Runge-Kutta method of order four.

The user's functions are called through pointers, so this module is compiled once for all models and effects: an effect
is a row of a table (`ode_effects.ROW`). A call through a pointer takes longer than most right-hand sides, so each call
serves several simulations (`LANES`), which advance together.

The functions are ordinary Python, and run as such for models that numba cannot compile.
"""

from __future__ import annotations

import inspect
import math
import sys
from functools import lru_cache
from typing import Any

import numpy as np
from numba import types
from numba.extending import register_jitable
from numpy.typing import NDArray

from errorscreen.effects.generic import base, terms, transforms
from errorscreen.effects.generic.base import PLACES
from errorscreen.engine.codegen import fingerprint_of, load_generated
from errorscreen.simulators.ode import effects as ode_effects
from errorscreen.simulators.ode.effects import DELAY, EQUATION, INPUT, MEMORIES, OUTPUT, SIGNAL, apply_effects

#: simulations that advance together
LANES = 16

_MATRIX, _CUBE, _TABLE = types.float64[:, ::1], types.float64[:, :, ::1], types.int64[:, ::1]
#: of the user's functions, see `user_functions.parallel_map`: time; states, inputs, parameters and results, a row for
#: each simulation; number of the model's own states; first result, and number of results; simulations
USER = types.void(
    types.float64, _MATRIX, _MATRIX, _MATRIX, _MATRIX, types.int64, types.int64, types.int64, types.int64
)
_FUNCTION = types.FunctionType(USER)


@register_jitable(forceinline=True)
def _drive(
    law: Any, t: Any, tau: Any, h: Any, k: Any, begin: Any, from_step: Any, stage: Any, x: Any, inputs: Any,
    n_signals: Any, n_states: Any, p: Any, table: Any, owns: Any, q: Any, lane0: Any, lanes: Any, memory: Any,
    history: Any, u: Any, dx: Any, active: Any,
) -> Any:  # fmt: skip
    """Inputs and internal signals with their effects."""
    n = inputs.shape[2]
    for j in range(lanes):
        for m in range(n):
            u[j, m] = inputs[from_step, stage, m]
    if active[INPUT]:
        apply_effects(
            INPUT, u, 0, x, u, t, tau, h, k, begin, n_states, table, owns, q, lane0, lanes, memory, history, dx,
        )  # fmt: skip
    if n_signals > 0:
        law(t, x, u, p, u, n_states, n, n_signals, lanes)
        if active[SIGNAL]:
            apply_effects(
                SIGNAL, u, n, x, u, t, tau, h, k, begin, n_states, table, owns, q, lane0, lanes, memory, history, dx,
            )  # fmt: skip


@register_jitable(forceinline=True)
def _evaluate(
    rhs: Any, law: Any, t: Any, tau: Any, h: Any, k: Any, stage: Any, x: Any, inputs: Any, n_signals: Any,
    n_states: Any, p: Any, table: Any, owns: Any, q: Any, lane0: Any, lanes: Any, memory: Any, history: Any, u: Any,
    dx: Any, active: Any,
) -> Any:  # fmt: skip
    """Derivatives at the beginning of step k (stage 0), in its middle (1) or at its end (2), with all effects."""
    if stage == 0 and (active[INPUT] or active[SIGNAL]):
        # bring the memories up to the instant just before: an input that is held jumps here
        before, end = (k - 1, 2) if k > 0 else (0, 0)
        _drive(
            law, t, h, h, k, True, before, end, x, inputs, n_signals, n_states, p, table, owns, q, lane0, lanes,
            memory, history, u, dx, active,
        )  # fmt: skip
    _drive(
        law, t, tau, h, k, False, k, stage, x, inputs, n_signals, n_states, p, table, owns, q, lane0, lanes, memory,
        history, u, dx, active,
    )  # fmt: skip
    for j in range(lanes):
        for m in range(n_states, dx.shape[1]):
            dx[j, m] = 0.0
    rhs(t, x, u, p, dx, n_states, 0, n_states, lanes)
    if active[EQUATION]:
        apply_effects(
            EQUATION, dx, 0, x, u, t, tau, h, k, False, n_states, table, owns, q, lane0, lanes, memory, history, dx,
        )  # fmt: skip


@register_jitable(forceinline=True)
def _record(
    readout: Any, t: Any, h: Any, x: Any, u: Any, p: Any, n_states: Any, table: Any, owns: Any, q: Any, lane0: Any,
    lanes: Any, memory: Any, history: Any, g: Any, y: Any, active: Any, alive: Any, out: Any, sample: Any,
) -> Any:  # fmt: skip
    """Outputs at a recorded instant, h seconds after the one before."""
    readout(t, x, u, p, y, n_states, 0, y.shape[1], lanes)
    if active[OUTPUT]:
        apply_effects(
            OUTPUT, y, 0, x, u, t, h, h, sample, True, n_states, table, owns, q, lane0, lanes, memory, history, g,
        )  # fmt: skip
    for j in range(lanes):
        if alive[j]:
            for m in range(y.shape[1]):
                out[lane0 + j, m, sample] = y[j, m]


@register_jitable(forceinline=True)
def _begin(
    x0: Any, q: Any, table: Any, lane0: Any, lanes: Any, x: Any, f: Any, active: Any, alive: Any
) -> Any:
    """Set initial states, and mark the kinds of places at which effects act."""
    for place in range(active.shape[0]):
        active[place] = False
    for j in range(lanes):
        alive[j] = True
        for m in range(x.shape[1]):
            x[j, m] = x0[lane0 + j, m]
            f[j, m] = 0.0
        for r in range(table.shape[0]):
            if q[lane0 + j, table[r, 6]] != 0.0:
                active[table[r, 1]] = True


@register_jitable(forceinline=True)
def _ended(x0: Any, lane0: Any, lanes: Any, x: Any, alive: Any) -> Any:
    """Whether no simulation is finite any more; one that is not goes on from its initial state, unrecorded."""
    any_alive = False
    for j in range(lanes):
        total = 0.0
        for m in range(x.shape[1]):
            total += x[j, m]
        if not math.isfinite(total):
            alive[j] = False
            for m in range(x.shape[1]):
                x[j, m] = x0[lane0 + j, m]
        any_alive = any_alive or alive[j]
    return not any_alive


def integrate(
    rhs: Any, law: Any, readout: Any, x0: Any, parameters: Any, q: Any, inputs: Any, n_signals: Any, n_states: Any,
    table: Any, owns: Any, t0: Any, h: Any, every: Any, out: Any, states: Any, flat: Any, u: Any, y: Any,
    memory: Any, history: Any, active: Any, alive: Any, begin: Any, end: Any,
) -> Any:  # fmt: skip
    """Integrate simulations `begin` to `end` and write their outputs to `out` (n, R, K // every + 1).

    `x0` (n, states) has the states of effects behind the model's own, `inputs` (K + 1, 3, nu) the beginning, middle
    and end of each step. `table` and `owns` are those of `errorscreen.simulators.ode.effects`. The working memory
    comes from `room`: allocation here would need reference counts, which take most of the time.
    """
    steps, nx = inputs.shape[0], x0.shape[1]
    x, w, f, g = states[0], states[1], states[2], states[3]
    # the same memory in one dimension
    flat_x, flat_w, flat_f, flat_g = flat[0], flat[1], flat[2], flat[3]
    for lane0 in range(begin, end, LANES):
        lanes = min(LANES, end - lane0)
        p, count = parameters[lane0 : lane0 + lanes], lanes * nx
        _begin(x0, q, table, lane0, lanes, x, f, active, alive)
        for k in range(steps):
            t = t0 + k * h
            for stage in range(4):
                late = 0.5 * ((stage + 1) // 2)  # 0, 1/2, 1/2, 1 of the step
                if stage == 0:
                    for m in range(count):
                        flat_w[m] = flat_x[m]
                else:
                    for m in range(count):
                        flat_w[m] = flat_x[m] + late * h * flat_f[m]
                _evaluate(
                    rhs, law, t + late * h, late * h, h, k, (stage + 1) // 2, w, inputs, n_signals, n_states, p,
                    table, owns, q, lane0, lanes, memory, history, u, f, active,
                )  # fmt: skip
                if stage == 0:
                    if k % every == 0:
                        _record(
                            readout, t, every * h, x, u, p, n_states, table, owns, q, lane0, lanes, memory,
                            history, g, y, active, alive, out, k // every,
                        )  # fmt: skip
                    if k + 1 == steps:
                        break
                    for m in range(count):
                        flat_g[m] = flat_f[m]
                else:
                    weight = 2.0 if stage < 3 else 1.0
                    for m in range(count):
                        flat_g[m] += weight * flat_f[m]
            if k + 1 == steps:
                break
            for m in range(count):
                flat_x[m] += h / 6.0 * flat_g[m]
            if _ended(x0, lane0, lanes, x, alive):
                break


def room(
    n_states: int, n_inputs: int, n_outputs: int, table: NDArray[np.int64], steps: int, n: int
) -> tuple[NDArray[Any], ...]:
    """Working memory of `integrate` for one thread and n simulations, with states and signals of effects."""
    rows, lanes = max(len(table), 1), min(n, LANES)
    past = steps + 1 if (table[:, 0] == DELAY).any() else 1
    states = np.zeros((4, lanes, n_states))
    return (
        states,
        states.reshape(4, -1),
        np.zeros((lanes, n_inputs)),
        np.zeros((lanes, n_outputs)),
        np.zeros((lanes, rows, MEMORIES)),
        np.zeros((lanes, rows, past)),
        np.zeros(len(PLACES), dtype=np.bool_),
        np.zeros(lanes, dtype=np.bool_),
    )


#: of `integrate` with compiled functions of the user
SIGNATURE = types.void(
    _FUNCTION, _FUNCTION, _FUNCTION, _MATRIX, _MATRIX, _MATRIX, _CUBE, types.int64, types.int64, _TABLE, _MATRIX,
    types.float64, types.float64, types.int64, _CUBE, _CUBE, _MATRIX, _MATRIX, _MATRIX, _CUBE, _CUBE,
    types.boolean[::1], types.boolean[::1], types.int64, types.int64,
)  # fmt: skip

_TEMPLATE = '''\
"""Generated by errorscreen.simulators.ode.kernel: wiring only, so that numba finds machine code again."""

import numba
from numba.extending import register_jitable

from errorscreen.simulators.ode import kernel as ode_kernel

body = register_jitable(ode_kernel.integrate)


@numba.njit(ode_kernel.SIGNATURE, cache=True, nogil=True, error_model="numpy", _nrt=False)
def integrate({arguments}):
    body({arguments})
'''


@lru_cache
def compiled() -> Any:
    """`integrate` as machine code, without counting references; compiled at its first use on a machine."""
    text = _TEMPLATE.format(arguments=", ".join(inspect.signature(integrate).parameters))
    modules = (
        sys.modules[__name__],
        ode_effects,
        terms,
        transforms,
        base,
        sys.modules["errorscreen.effects.latent_input"],
    )
    name = f"ode_{fingerprint_of(modules, text)}"
    return load_generated(name, text).integrate
