"""Simulated response errors with the contribution of each parameter: the training set of rankers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed, listed, span
from errorscreen._runtime.persistence import load_arrays, save_arrays
from errorscreen.exceptions import InputError
from errorscreen.simulators.base import Responses, Status

FORMAT, VERSION = "errorscreen-dataset", 1
_ARRAYS = ("theta", "responses", "contributions", "baseline", "status", "time")


@dataclass(frozen=True, eq=False, repr=False)
class ErrorDataset(Displayed):
    """Samples of a simulator with their responses and labels.

    Parameters
    ----------
    theta : ndarray of shape (n, m)
        Parameters of each sample, in their units.
    responses : ndarray of shape (n, R, L)
        Simulated channels; NaN in failed rows.
    contributions : ndarray of shape (n, m)
        Labels c, equations (14) and (15); nonnegative, NaN in failed rows.
    baseline : ndarray of shape (R, L)
        y₀, the response at the nominal parameters.
    status : ndarray of shape (n,), int
        `Status` of each sample: of its own simulation, or of the first of its perturbed simulations that failed.
    names : tuple of m str
        Parameters.
    channels : tuple of R str
    time : ndarray of shape (L,)
        Seconds.
    event : str
        Name of the event.
    metadata : mapping
        How it was made; JSON values.

    Raises
    ------
    InputError
        If the shapes do not fit together.

    Examples
    --------
    >>> data = ErrorDataset(
    ...     theta=np.ones((3, 2)), responses=np.full((3, 1, 4), 2.0), contributions=np.zeros((3, 2)),
    ...     baseline=np.zeros((1, 4)), status=np.array([0, 1, 0]), names=("a", "b"), channels=("P",),
    ...     time=np.arange(4.0), event="fault",
    ... )
    >>> data
    ErrorDataset(samples: 3 (1 failed), parameters: a, b, channels: P, time: 4 samples from 0 to 3 s, event: fault)
    >>> data.valid().errors.shape
    (2, 1, 4)
    """

    theta: NDArray[np.float64]
    responses: NDArray[np.float64]
    contributions: NDArray[np.float64]
    baseline: NDArray[np.float64]
    status: NDArray[np.int64]
    names: tuple[str, ...]
    channels: tuple[str, ...]
    time: NDArray[np.float64]
    event: str
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, m, R, L = len(self.status), len(self.names), len(self.channels), len(self.time)
        shapes = ((n, m), (n, R, L), (n, m), (R, L), (n,), (L,))
        for name, shape in zip(_ARRAYS, shapes, strict=True):
            if np.shape(getattr(self, name)) != shape:
                raise InputError(
                    f"{name} has shape {np.shape(getattr(self, name))}",
                    where="ErrorDataset",
                    allowed=f"{shape}, for {n} samples, {m} parameters, {R} channels and {L} instants",
                )

    def __len__(self) -> int:
        return len(self.status)

    def _facts(self) -> dict[str, Any]:
        return {
            "samples": f"{len(self)} ({self.n_failed} failed)",
            "parameters": listed(self.names),
            "channels": listed(self.channels),
            "time": span(self.time),
            "event": self.event,
        }

    @property
    def errors(self) -> NDArray[np.float64]:
        """Response errors, equations (2)–(4): e = y − y₀, shape (n, R, L)."""
        return self.responses - self.baseline

    @property
    def ok(self) -> NDArray[np.bool_]:
        """True for samples whose simulations all ended well, shape (n,)."""
        return self.status == Status.OK

    @property
    def n_failed(self) -> int:
        """Number of samples that cannot be used."""
        return int(np.sum(~self.ok))

    def failures(self) -> str:
        """Count failed samples with their remedy; empty if there are none."""
        return Responses(self.responses, self.status, self.time, self.channels).failures()

    def take(self, rows: ArrayLike) -> ErrorDataset:
        """Return the samples with these indices, or where a boolean array is true."""
        rows = np.asarray(rows)
        per_sample = ("theta", "responses", "contributions", "status")
        return replace(self, **{name: getattr(self, name)[rows] for name in per_sample})

    def valid(self) -> ErrorDataset:
        """Return the samples that did not fail."""
        return self.take(self.ok) if self.n_failed else self

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the dataset to one ``.npz`` file, completely or not at all; `InputError` if that is impossible."""
        return save_arrays(
            path,
            format=FORMAT,
            version=VERSION,
            arrays={name: getattr(self, name) for name in _ARRAYS},
            meta={
                "names": self.names,
                "channels": self.channels,
                "event": self.event,
                "metadata": self.metadata,
            },
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ErrorDataset:
        """Read a file of `save`; `InputError` if it is missing, damaged, or of another format or version."""
        arrays, meta = load_arrays(path, format=FORMAT, version=VERSION)
        return cls(
            **arrays,
            names=tuple(meta["names"]),
            channels=tuple(meta["channels"]),
            event=meta["event"],
            metadata=meta["metadata"],
        )
