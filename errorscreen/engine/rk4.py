r"""Fixed-step Runge-Kutta method of order four, for a block of simulations in one flat buffer.

.. math:: x_{k+1} = x_k + \tfrac{h}{6}(f_1 + 2 f_2 + 2 f_3 + f_4)

(Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, table II.1.2.)

A quantity is a row of the buffer, a simulation a lane (column): ``b[row * lanes + lane]``. The generated
module calls these functions between evaluations of the model; ``spans`` are ranges of rows [first, last)
of the states, of which only those with ``active`` set are advanced.
"""

from __future__ import annotations

import numba


@numba.njit(error_model="numpy", forceinline=True)
def load(b, values, block, lanes, first_row):
    """Copy per-simulation values (n, rows) of a block into the buffer; the last one fills spare lanes."""
    n, rows = values.shape
    for k in range(lanes):
        i = min(block * lanes + k, n - 1)
        for r in range(rows):
            b[(first_row + r) * lanes + k] = values[i, r]


@numba.njit(error_model="numpy", forceinline=True)
def store(out, b, block, lanes, rows, column):
    """Copy recorded rows of a block to ``out[simulation, row, column]``."""
    n = out.shape[0]
    for k in range(min(lanes, n - block * lanes)):
        for r in range(rows.size):
            out[block * lanes + k, r, column] = b[rows[r] * lanes + k]


@numba.njit(error_model="numpy", forceinline=True)
def predict(b, spans, active, lanes, shift, h, weight, first):
    """After an evaluation: add ``weight * f`` to the sum and set the state to ``x_k + h * f``.

    `shift` is the number of rows between states, derivatives, start values and sums, which lie in this
    order; `first` is True at the first stage of a step, where the start value is remembered.
    """
    size = shift * lanes
    for s in range(spans.shape[0]):
        if active[s]:
            for i in range(spans[s, 0] * lanes, spans[s, 1] * lanes):
                f = b[i + size]
                if first:
                    b[i + 2 * size] = b[i]
                    b[i + 3 * size] = f
                else:
                    b[i + 3 * size] += weight * f
                b[i] = b[i + 2 * size] + h * f


@numba.njit(error_model="numpy", forceinline=True)
def correct(b, spans, active, lanes, shift, h):
    """After the fourth evaluation: the new state."""
    size = shift * lanes
    for s in range(spans.shape[0]):
        if active[s]:
            for i in range(spans[s, 0] * lanes, spans[s, 1] * lanes):
                b[i] = b[i + 2 * size] + h / 6.0 * (b[i + 3 * size] + b[i + size])
