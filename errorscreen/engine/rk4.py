r"""Fixed-step Runge-Kutta method of order four, for a block of simulations in one flat buffer.

.. math:: x_{k+1} = x_k + \tfrac{h}{6}(f_1 + 2 f_2 + 2 f_3 + f_4)

(Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, table II.1.2.)

A quantity is a row of the buffer, a simulation a lane (column): ``b[row * lanes + lane]``. The generated module calls
these functions between evaluations of the model; only ``spans`` of states, rows [first, last), with ``active`` set are
advanced.
"""

from __future__ import annotations

import numpy as np

from errorscreen.engine.wiring import inlined


@inlined
def load(b, values, block, lanes, first_row):
    """Copy per-simulation values (n, rows) of a block into the buffer; the last one fills spare lanes."""
    n, rows = values.shape
    for k in range(lanes):
        i = min(block * lanes + k, n - 1)
        for r in range(rows):
            b[(first_row + r) * lanes + k] = values[i, r]


@inlined
def mark(on, constants, columns, block, lanes):
    """Set ``on[c]`` where the c-th of some columns of the constants is nonzero in any simulation of a block."""
    first, last = block * lanes, min((block + 1) * lanes, constants.shape[0])
    for c in range(columns.size):
        on[c] = False
        for i in range(first, last):
            on[c] |= constants[i, columns[c]] != 0.0


@inlined
def place(b, tables, segment, block, lanes, first_row, step):
    """Copy the tables (m, rows) that hold in a step into the buffer, for each simulation its own where they change."""
    for k in range(lanes):
        i = min(block * lanes + k, segment.shape[0] - 1)
        if step == 0 or segment[i, step] != segment[i, step - 1]:
            for r in range(tables.shape[1]):
                b[(first_row + r) * lanes + k] = tables[segment[i, step], r]


@inlined
def store(out, b, block, lanes, rows, column):
    """Copy recorded rows of a block to ``out[simulation, row, column]``."""
    n = out.shape[0]
    for k in range(min(lanes, n - block * lanes)):
        for r in range(rows.size):
            out[block * lanes + k, r, column] = b[rows[r] * lanes + k]


@inlined
def predict(b, spans, active, lanes, shift, h, weight, first):
    """After an evaluation: add ``weight * f`` to the sum and set the state to ``x_k + h * f``.

    `shift` is the number of rows between states, derivatives, start values and sums, which lie in this
    order; `first` is True at the first stage of a step, where the start value is remembered.
    """
    # unsigned: a check whether an index is negative would keep these loops from becoming vector instructions
    size = np.uint64(shift * lanes)
    for s in range(spans.shape[0]):
        if active[s]:
            for i in range(np.uint64(spans[s, 0] * lanes), np.uint64(spans[s, 1] * lanes)):
                f = b[i + size]
                if first:
                    b[i + size + size] = b[i]
                    b[i + size + size + size] = f
                else:
                    b[i + size + size + size] += weight * f
                b[i] = b[i + size + size] + h * f


@inlined
def correct(b, spans, active, lanes, shift, h):
    """After the fourth evaluation: the new state."""
    size = np.uint64(shift * lanes)
    for s in range(spans.shape[0]):
        if active[s]:
            for i in range(np.uint64(spans[s, 0] * lanes), np.uint64(spans[s, 1] * lanes)):
                b[i] = b[i + size + size] + h / 6.0 * (b[i + size + size + size] + b[i + size])
