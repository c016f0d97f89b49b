"""Linearisation of a model: state matrix and eigenvalues at an operating point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.engine.kernels import ReferenceEngine
from errorscreen.engine.stages import Model


def state_matrix(
    model: Model, x0: ArrayLike, constants: ArrayLike, u: ArrayLike, tables: ArrayLike = ()
) -> NDArray[np.float64]:
    r"""Jacobian :math:`\partial\dot x / \partial x` by central differences.

    Parameters
    ----------
    model : Model
    x0 : array-like of shape (n_states,)
    constants : array-like of shape (n_constants,)
    u : array-like of shape (n_inputs,)
    tables : array-like of shape (n_tables,)

    Returns
    -------
    ndarray of shape (n_states, n_states)
        Rows and columns in the order of ``model.states``; zero for the states of effects that are off.

    Examples
    --------
    >>> from errorscreen.engine import Call
    >>> from errorscreen.engine.examples import decay
    >>> model = Model("decay", ("u",), ("x",), ("T",), (Call(decay, ("x", "u", "T"), ("d_x",)),), ("x",))
    >>> round(float(state_matrix(model, [1.0], [0.5], [0.0])[0, 0]), 6)
    -2.0
    """
    x0 = np.asarray(x0, dtype=float)
    step = 1e-6 * np.maximum(1.0, np.abs(x0))
    points = np.concatenate([x0 + np.diag(step), x0 - np.diag(step)])
    slopes = ReferenceEngine(model).derivatives(
        points,
        np.tile(np.asarray(constants, dtype=float), (len(points), 1)),
        np.asarray(u, dtype=float),
        np.asarray(tables, dtype=float),
    )
    forward, backward = np.split(slopes, 2)
    return (forward - backward).T / (2 * step)
