"""Results of calibrations: fitted values with their intervals, as they stand in ``result.json``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.typed import Real
from errorscreen.parameters import Parameter, ParameterSpace


@dataclass(frozen=True)
class Estimate:
    """Fitted value of one parameter.

    Parameters
    ----------
    name, symbol, unit, description : str
        As its `Parameter` says.
    nominal, lower, upper, scale : float
        Nominal value, bounds, and the size that counts as large.
    value : float
        Fitted value.
    low, high : float
        Ends of the interval; NaN without one.
    at_bound : bool
        Whether the value lies at a bound.
    identifiable : bool or None
        Whether the recordings determine the value; None if that was not computed.
    truth : float
        True value, where the recording was simulated; else NaN.
    """

    name: str
    value: Real
    low: Real = float("nan")
    high: Real = float("nan")
    at_bound: bool = False
    identifiable: bool | None = None
    truth: Real = float("nan")
    nominal: Real = float("nan")
    lower: Real = float("nan")
    upper: Real = float("nan")
    scale: Real = float("nan")
    symbol: str = ""
    unit: str = ""
    description: str = ""

    @classmethod
    def of(
        cls,
        parameter: Parameter,
        value: float,
        low: float = float("nan"),
        high: float = float("nan"),
        *,
        identifiable: bool | None = None,
        truth: float = float("nan"),
    ) -> Estimate:
        """Estimate of a parameter. A value at a bound has an interval only if its ends differ.

        Examples
        --------
        >>> from errorscreen.parameters import Parameter
        >>> Estimate.of(Parameter("D", 1.0, 0.0, 2.0), 2.0, 2.0, 2.0).at_bound
        True
        """
        p, margin = parameter, 1e-6 * (parameter.upper - parameter.lower)
        at_bound = not p.lower + margin < value < p.upper - margin
        if at_bound and not low < high:
            low = high = float("nan")
        scale = float("nan") if p.scale is None else float(p.scale)
        return cls(
            p.name, float(value), float(low), float(high), at_bound, identifiable, truth,
            p.nominal, p.lower, p.upper, scale, p.symbol, p.unit, p.description,
        )  # fmt: skip

    @property
    def moved(self) -> bool:
        """Whether the interval excludes the nominal value."""
        return self.nominal < self.low or self.nominal > self.high


@dataclass(frozen=True)
class Calibration:
    """Result of one calibrator.

    Parameters
    ----------
    method : str
        Name of the calibrator.
    selection : str
        ``"all"``, or the screener whose selection was calibrated.
    parameters : tuple of Estimate
        Those that were calibrated; the others stay nominal.
    groups : tuple of tuple of str
        Parameters that the recordings determine only together.
    level : float
        Probability of the intervals; NaN without any.
    converged : bool or None
        Whether the fit ended at a minimum; None if the method has no such test.
    chi2_per_sample : float
        χ²/N of the fit; NaN if the method has another objective.
    n_simulations, n_failed : int
    seconds : float
    """

    method: str
    selection: str
    parameters: tuple[Estimate, ...]
    groups: tuple[tuple[str, ...], ...] = ()
    level: Real = float("nan")
    converged: bool | None = None
    chi2_per_sample: Real = float("nan")
    n_simulations: int = 0
    n_failed: int = 0
    seconds: Real = float("nan")

    @classmethod
    def of(
        cls, calibrator: Any, method: str, selection: str = "all", seconds: float = float("nan")
    ) -> Calibration:
        """Result of a fitted calibrator, with intervals if it has them."""
        space = calibrator.simulator.parameters.subset(calibrator.names_)
        values = calibrator.values_.values()
        if hasattr(calibrator, "intervals_"):
            rows = zip(space, values, calibrator.intervals_, calibrator.identifiable_, strict=True)
            estimates = [Estimate.of(p, v, *ends, identifiable=bool(known)) for p, v, ends, known in rows]
        else:
            estimates = [Estimate.of(p, v) for p, v in zip(space, values, strict=True)]
        return cls(
            method,
            selection,
            tuple(estimates),
            tuple(getattr(calibrator, "groups_", ())),
            calibrator.level if hasattr(calibrator, "intervals_") else float("nan"),
            getattr(calibrator, "converged_", None),
            getattr(calibrator, "chi2_per_sample_", float("nan")),
            calibrator.n_simulations_,
            calibrator.n_failed_,
            seconds,
        )

    @property
    def label(self) -> str:
        """For tables and legends."""
        return f"{self.method} on {self.selection}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the calibrated parameters."""
        return tuple(p.name for p in self.parameters)

    def theta(self, space: ParameterSpace) -> NDArray[np.float64]:
        """Values (m,) of all parameters of a model; those that were not calibrated are nominal."""
        theta = space.nominal.copy()
        theta[[space.index(name) for name in self.names]] = [p.value for p in self.parameters]
        return theta
