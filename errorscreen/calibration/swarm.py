"""Particle swarm with inertia weight; it never calls what it optimises."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.sampling import generator
from errorscreen.exceptions import InputError, check_real


class ParticleSwarm:
    r"""Global-best particle swarm by ask and tell.

    In units of the range of each parameter,

    .. math::
        v \leftarrow w v + c_1 r_1 (p - x) + c_2 r_2 (g - x), \qquad x \leftarrow x + v

    with the particle's own best position p, the swarm's g, and uniform random numbers r₁, r₂ for each particle and
    parameter (Shi and Eberhart 1998). A particle that would leave the bounds is put on the bound and loses that
    component of its velocity (Robinson and Rahmat-Samii 2004). Velocities start at 0 (Engelbrecht 2012).

    Parameters
    ----------
    start : array-like of shape (n, k)
        First positions, one row for each particle, inside the bounds.
    bounds : array-like of shape (k, 2)
    inertia : float, default 0.7298
        w, in [0, 1).
    cognitive, social : float, default 1.4962
        Learning factors c₁ and c₂, nonnegative. The defaults are the constriction of Clerc and Kennedy (2002).
    max_velocity : float, default 0.5
        Largest step in one parameter, as a share of its range.
    random_state : None, int, SeedSequence, Generator or RandomState

    Attributes
    ----------
    best_position : ndarray of shape (k,)
        Best position so far, at first the start of the first particle.
    best_value : float
        Its value; inf before an evaluation succeeded.

    Raises
    ------
    InputError
        If an argument cannot be used.

    Examples
    --------
    >>> swarm = ParticleSwarm([[0.0, 3.0], [4.0, 0.0], [2.0, 2.0]], [[-5, 5], [-5, 5]], random_state=0)
    >>> for _ in range(60):
    ...     swarm.tell([((x - 1) ** 2).sum() for x in swarm.ask()])
    >>> swarm.best_position.round(2)
    array([1., 1.])
    """

    def __init__(
        self,
        start: ArrayLike,
        bounds: ArrayLike,
        *,
        inertia: float = 0.7298,
        cognitive: float = 1.4962,
        social: float = 1.4962,
        max_velocity: float = 0.5,
        random_state: Any = None,
    ) -> None:
        self._lower, self._upper = np.asarray(bounds, dtype=float).T
        start = np.asarray(start, dtype=float)
        if start.ndim != 2 or start.shape[1:] != self._lower.shape or not len(start):
            raise InputError(
                f"the start positions have shape {start.shape}", allowed=f"(n, {len(self._lower)}), n >= 1"
            )
        if not np.all((start >= self._lower) & (start <= self._upper)):
            raise InputError("a start position is not inside the bounds", where="ParticleSwarm")
        self.inertia = check_real(inertia, "inertia", low=0.0, high=1.0)
        self.cognitive = check_real(cognitive, "cognitive", low=0.0)
        self.social = check_real(social, "social", low=0.0)
        self.max_velocity = check_real(max_velocity, "max_velocity", low=0.0, above=True)
        self._rng = generator(random_state)
        self._x = (start - self._lower) / (self._upper - self._lower)
        self._v = np.zeros_like(self._x)
        self._p = self._x.copy()
        self._p_values = np.full(len(start), np.inf)

    def ask(self) -> NDArray[np.float64]:
        """Positions to evaluate, shape (n, k)."""
        return self._scaled(self._x)

    def tell(self, values: ArrayLike) -> None:
        """Take the values of the positions last asked for, and move.

        Parameters
        ----------
        values : array-like of shape (n,)
            To be minimised; NaN or inf for an evaluation that failed, which is then never a best position.

        Raises
        ------
        InputError
            If there is not one value for each particle.
        """
        values = np.asarray(values, dtype=float)
        if values.shape != self._p_values.shape:
            raise InputError(f"values have shape {values.shape}", allowed=f"{self._p_values.shape}")
        better = values < self._p_values  # never true for NaN
        self._p[better] = self._x[better]
        self._p_values[better] = values[better]

        own, swarm = self._rng.random((2, *self._x.shape))
        best = self._p[np.argmin(self._p_values)]
        pull = self.cognitive * own * (self._p - self._x) + self.social * swarm * (best - self._x)
        self._v = np.clip(self.inertia * self._v + pull, -self.max_velocity, self.max_velocity)
        target = self._x + self._v
        self._x = np.clip(target, 0.0, 1.0)
        self._v[self._x != target] = 0.0

    @property
    def best_position(self) -> NDArray[np.float64]:
        """Best position so far, shape (k,)."""
        return self._scaled(self._p[np.argmin(self._p_values)])

    @property
    def best_value(self) -> float:
        """Value of the best position; inf before an evaluation succeeded."""
        return float(self._p_values.min())

    def _scaled(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.clip(self._lower + x * (self._upper - self._lower), self._lower, self._upper)
