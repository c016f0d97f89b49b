"""A recording on the channels and time grid of one simulator, with its uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed, listed, span
from errorscreen.data.channels import summary_of
from errorscreen.data.panels import Curves, plot_curves, with_unit
from errorscreen.data.slow_errors import slow_modes
from errorscreen.events import Event
from errorscreen.exceptions import InputError, check_real, unknown_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: values of one slow error that are prepared at once
_AT_ONCE = 2**13


@dataclass(frozen=True)
class Observation(Displayed):
    """A recording on the channels and time grid of one simulator.

    Parameters
    ----------
    event : Event
        Input of the simulator; ``event.time`` is the time axis (L,).
    values : ndarray of shape (R, L)
        Measured channels; NaN where nothing was measured.
    noise : ndarray of shape (R,)
        Standard deviation of the measurement noise of each channel, in the channel's unit; positive.
    channels : tuple of str
    units : tuple of str
    assumptions : tuple of str
        Sentences on assumptions about the data, for the report.
    extra : ndarray of shape (R, L), optional
        Further standard deviation of single samples, for example because an injected signal is not known between
        its samples; 0 where not given.
    level_std : ndarray of shape (R,), optional
        Standard error of the level before the event, from which a simulation starts; 0 where not given.
    modes : ndarray of shape (K, R, L), optional
        Slow errors that the dynamics of the model make of the noise of injected signals: each mode times an
        independent standard normal number adds to the errors. None where not given.
    propagated : ndarray of shape (R,), optional
        Energy of the propagated noise of injected signals in squared deviations, in the model that gave `noise`,
        `extra` and `modes`; see `Simulator.propagated_noise`. None where nothing is injected.
    model_error : mapping of str to float
        Standard deviation of a slow error of the model that its user allows, by channel; see `with_model_error`.
    model_error_time : float
        Its time in seconds.
    """

    event: Event
    values: NDArray[np.float64]
    noise: NDArray[np.float64]
    channels: tuple[str, ...]
    units: tuple[str, ...]
    assumptions: tuple[str, ...] = ()
    extra: NDArray[np.float64] | None = None
    level_std: NDArray[np.float64] | None = None
    modes: NDArray[np.floating[Any]] | None = None
    propagated: NDArray[np.float64] | None = None
    model_error: Mapping[str, float] = field(default_factory=dict)
    model_error_time: float = 1.0

    @cached_property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviation of each sample, shape (R, L)."""
        extra = np.zeros(self.values.shape) if self.extra is None else self.extra
        return np.hypot(np.asarray(self.noise, dtype=float)[:, None], extra)

    def deviations(self, responses: ArrayLike) -> NDArray[np.float64]:
        r"""Simulated minus measured values in multiples of their uncertainty.

        A simulation starts from the mean of the quiet part, which is known to `level_std`, so all samples after the
        start of the event share an unknown offset; `modes` and the model error are unknown slow errors. The errors e
        are multiplied by the inverse square root of their covariance
        :math:`\Sigma = \mathrm{diag}(\sigma^2) + B B^T` with the offsets and modes as columns of B. In closed form

        .. math:: z = \frac{e}{\sigma} - U \Big(I - (I + S^2)^{-1/2}\Big) U^T \frac{e}{\sigma},
           \quad \frac{B}{\sigma} = U S V^T

        The sum of squares of z is χ², for a right simulation about the number of measured values.

        Parameters
        ----------
        responses : array-like of shape (..., R, L)

        Returns
        -------
        ndarray of shape (..., R, L)
            NaN where nothing was measured.

        Examples
        --------
        >>> event = Event(np.arange(4.0), start=2.0)
        >>> values, noise, level = np.zeros((1, 4)), np.ones(1), np.array([1.0])
        >>> seen = Observation(event, values, noise, ("P",), ("pu",), level_std=level)
        >>> seen.deviations([[0.0, 0.0, 1.0, 1.0]]).round(3)
        array([[0.   , 0.   , 0.577, 0.577]])
        """
        z = np.asarray(responses, dtype=float) - self.values
        z /= self.sigma
        U, shrink = self._shared
        if not len(shrink):
            return z
        # a failed simulation stays NaN, a gap must not spread
        known = z if self.mask.all() else np.where(self.mask, z, 0.0)
        along = known.reshape(*z.shape[:-2], -1) @ U
        z -= ((along * shrink) @ U.T).reshape(z.shape)
        return z

    @cached_property
    def _shared(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Orthonormal directions (R L, K) of errors that samples share, and the shrinkage along each of them (K,)."""
        stds = np.zeros(0) if self.level_std is None else np.asarray(self.level_std, dtype=float)
        offsets = np.zeros((len(stds), *self.values.shape))
        for r, std in enumerate(stds):
            offsets[r, r, self.time >= self.event.start - 1e-9] = std
        rows: list[NDArray[np.floating[Any]]] = [] if self.modes is None else [np.asarray(self.modes)]
        rows += [offsets[stds > 0], *self._allowed_error]
        count, size = sum(map(len, rows)), self.values.size
        rows = [r.reshape(len(r), size) for r in rows]
        if not count:
            return np.zeros((size, 0)), np.zeros(0)
        inverse = np.where(self.mask, 1.0 / self.sigma, 0.0).ravel()

        def scaled(first: int) -> NDArray[np.float64]:
            part = slice(first, first + _AT_ONCE)
            return np.concatenate([r[:, part] for r in rows]).T * inverse[part, None]

        # K is small beside R L, so that this is faster than an svd. Of a minute at 1 kHz, B would be the largest array
        # beside U: it is built in parts, twice
        starts, gram = range(0, size, _AT_ONCE), np.zeros((count, count))
        for B in map(scaled, starts):
            gram += B.T @ B
        squares, V = np.linalg.eigh(gram)
        known = squares > 1e-12 * squares[-1]
        squares, V = squares[known], V[:, known]
        U = np.empty((size, len(squares)))
        for first in starts:
            U[first : first + _AT_ONCE] = scaled(first) @ (V / np.sqrt(squares))
        return U, 1.0 - 1.0 / np.sqrt(1.0 + squares)

    @property
    def _allowed_error(self) -> Iterator[NDArray[np.float64]]:
        """Modes (K, R, L) of the model error of each channel."""
        for r, name in enumerate(self.channels):
            if self.model_error.get(name, 0.0) > 0.0:
                courses = slow_modes(self.time, self.event.start, self.model_error_time)
                modes = np.zeros((len(courses), *self.values.shape))
                modes[:, r] = self.model_error[name] * courses
                yield modes

    def with_model_error(self, std: Mapping[str, float], time: float = 1.0) -> Observation:
        r"""Return the observation for a model that is allowed a slow error.

        No model is exact. An error that its user knows and accepts, for example of a winding that is left out, counts
        as uncertainty after the start of the event, with the covariance (M1) of `slow_errors.slow_modes`: its
        standard deviation is stated, and it changes within `time`. What is larger or faster still counts as an error.
        The price is that causes of that size and speed are not found.

        Parameters
        ----------
        std : mapping of str to float
            Standard deviation by channel, in the channel's unit; channels that are left out have no model error.
        time : float
            T in seconds: after T the correlation is 0.61, after 2 T 0.14.

        Raises
        ------
        InputError
            If a channel is unknown, a number is out of range, or the record is longer than 225 T.

        Examples
        --------
        >>> event = Event(np.linspace(0.0, 5.0, 501), start=1.0)
        >>> error = 0.01 * (event.time >= 1.0) * np.sin(event.time)
        >>> seen = Observation(event, np.zeros((1, 501)), np.array([1e-3]), ("P",), ("pu",))
        >>> allowed = seen.with_model_error({"P": 0.01}, time=0.5)
        >>> [round(float((one.deviations(error) ** 2).mean()), 2) for one in (seen, allowed)]
        [47.33, 0.01]
        """
        for name, value in std.items():
            if name not in self.channels:
                raise unknown_name(name, self.channels, kind="channel", where="model_error")
            check_real(value, f"model_error.{name}", low=0.0)
        check_real(time, "the time of the model error", low=0.0, above=True)
        slow_modes(self.time, self.event.start, time)  # a time that is too short is told now, not in a fit
        told = [
            f"A slow error of the model counts as uncertainty: {name} {value:g} {unit}, within {time:g} s."
            for name, unit in zip(self.channels, self.units, strict=True)
            if (value := std.get(name, 0.0)) > 0.0
        ]
        return replace(
            self, model_error=dict(std), model_error_time=float(time), assumptions=(*self.assumptions, *told)
        )

    def first(self, samples: int) -> Observation:
        """Return the observation at the first instants of the time axis, each time the same object.

        A search fits many models to the same part, and they share the prepared arrays of that object.

        Parameters
        ----------
        samples : int
            From 2 to L.

        Examples
        --------
        >>> event = Event(np.arange(4.0), start=1.0)
        >>> seen = Observation(event, np.array([[0.0, 0.1, 0.3, 0.2]]), np.ones(1), ("P",), ("pu",))
        >>> seen.first(3).values
        array([[0. , 0.1, 0.3]])
        """
        if samples not in self._first:
            part = replace(
                self,
                event=self.event.first(samples),
                values=self.values[:, :samples],
                extra=None if self.extra is None else self.extra[:, :samples],
                modes=None if self.modes is None else np.asarray(self.modes)[..., :samples],
                propagated=None,  # known for the whole only
            )
            self._first.setdefault(samples, part)  # another thread may have been first
        return self._first[samples]

    @cached_property
    def _first(self) -> dict[int, Observation]:
        return {}

    def _facts(self) -> dict[str, Any]:
        return {
            "event": f"{self.event.name} ({type(self.event).__name__})",
            "channels": listed(self.channels),
            "time": span(self.time),
            "start": f"{self.event.start:g} s",
            "readings": f"{self.mask.sum()} of {self.mask.size}",
        }

    def summary(self) -> str:
        """Say what was observed and what was assumed about it."""
        channels = zip(self.channels, self.units, self.values, self.noise, strict=True)
        return summary_of(f"Observation of {self.event.name}", self._facts(), channels, self.assumptions)

    def to_frame(self) -> pd.DataFrame:
        """Table of the measured channels, indexed by time in seconds."""
        import pandas as pd

        return pd.DataFrame(self.values.T, pd.Index(self.time, name="time"), list(self.channels))

    def plot(
        self, responses: Mapping[str, ArrayLike] | None = None, *, window: tuple[float, float] | None = None
    ) -> Figure:
        """Draw the measured channels and simulations of them, see `errorscreen.plotting.plot_responses`."""
        measured = np.asarray(self.mask.any(axis=1))
        return plot_curves(self.labels(measured), [self.curves(responses or {}, measured)], window)

    def labels(self, rows: NDArray[np.bool_]) -> list[str]:
        """Return the axis labels of some channels, which a mask (R,) selects."""
        return [with_unit(self.channels[r], self.units[r]) for r in np.flatnonzero(rows)]

    def curves(self, responses: Mapping[str, ArrayLike], rows: NDArray[np.bool_]) -> Curves:
        """Curves of some channels, which a mask (R,) selects, and of responses (R, L), for a figure."""
        if not rows.any():
            raise InputError("no channel was measured", where=self.event.name, allowed="at least one value")
        simulated = {label: np.asarray(values, dtype=float) for label, values in responses.items()}
        for label, values in simulated.items():
            if values.shape != self.values.shape:
                problem = f"response {label!r} has shape {values.shape}"
                raise InputError(problem, allowed=f"{self.values.shape}")
        simulated = {label: values[rows] for label, values in simulated.items()}
        return Curves(self.time, self.values[rows], self.event.start, simulated, self.event.name)

    @property
    def time(self) -> NDArray[np.float64]:
        """Time axis in seconds, shape (L,)."""
        return self.event.time

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """True where a value was measured, shape (R, L)."""
        return np.isfinite(self.values)
