"""Parameters of a model, declared beside the equation that uses them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import LONGEST, shortened
from errorscreen.exceptions import InputError, unknown_name

if TYPE_CHECKING:
    import pandas as pd

_Array = NDArray[np.float64]
#: Values that a parameter can have physically; empty for any number.
DOMAINS = ("", ">= 0", "> 0", "<= 0")


@dataclass(frozen=True)
class Parameter:
    """One candidate parameter of a model.

    Parameters
    ----------
    name : str
        Identifier, unique in its `ParameterSpace`, for example ``"Xd1"``.
    nominal : float
        Value before calibration, in `unit`.
    lower, upper : float
        Allowed range in `unit`, with the nominal value in it.
    unit : str, default ""
        ``"pu"``, ``"s"``, ``""`` for a pure number.
    device : str, default ""
        Device the parameter belongs to.
    symbol : str, default ""
        Spelling of the literature, for example ``"X'd"``; the name where empty.
    description : str, default ""
        Meaning in one line.
    scale : float, optional
        Denominator of the relative deviation, equation (12); ``abs(nominal)`` where not given. It is needed where
        the nominal value is zero.
    domain : {"", ">= 0", "> 0", "<= 0"}
        Any number, a gain, a time constant, reactance or limit, or a lower limit that is not positive.

    Raises
    ------
    InputError
        If a value is not finite or outside of the domain, the range is empty or excludes the nominal value, or the
        scale is missing.

    Examples
    --------
    >>> Parameter("Xd", 0.95, 0.6, 1.3, unit="pu").scale
    0.95
    """

    name: str
    nominal: float
    lower: float
    upper: float
    unit: str = ""
    device: str = ""
    symbol: str = ""
    description: str = ""
    scale: float | None = None
    domain: str = ""

    def __post_init__(self) -> None:
        where = f"parameter {self.name!r}"
        if self.domain not in DOMAINS:
            raise unknown_name(self.domain, DOMAINS, kind="domain", where=where)
        for field in ("nominal", "lower", "upper"):
            value = float(getattr(self, field))
            if not np.isfinite(value):
                raise InputError(f"{field} is {value}", where=where, allowed="a finite number")
            object.__setattr__(self, field, value)
            if not {"": True, ">= 0": value >= 0, "> 0": value > 0, "<= 0": value <= 0}[self.domain]:
                allowed, remedy = f"a number {self.domain}", "Correct the value, or narrow the bounds"
                raise InputError(f"{field} is {value:g}", where=where, allowed=allowed, remedy=remedy)
        limits = f"the range [{self.lower:g}, {self.upper:g}]"
        if not self.lower < self.upper:
            raise InputError(f"{limits} is empty", where=where, allowed="lower < upper")
        if not self.lower <= self.nominal <= self.upper:
            raise InputError(
                f"{limits} excludes the nominal value {self.nominal:g}",
                where=where,
                allowed="lower <= nominal <= upper",
                remedy="Widen the range or change the nominal value",
            )
        scale = abs(self.nominal) if self.scale is None else float(self.scale)
        if not (np.isfinite(scale) and scale > 0):
            values = f"the nominal value is {self.nominal:g} and the scale is {scale:g}"
            raise InputError(
                f"{values}, so a relative deviation is undefined",
                where=where,
                allowed="a nominal value other than 0, or a positive scale",
                remedy="Give scale=, the size of a change that matters",
            )
        object.__setattr__(self, "scale", scale)
        if not self.symbol:
            object.__setattr__(self, "symbol", self.name)


class ParameterSpace:
    """An ordered, immutable set of parameters.

    Parameters
    ----------
    parameters : iterable of Parameter
        Names must be unique.

    Attributes
    ----------
    names : tuple of str
    nominal, scales : ndarray of shape (m,)
    bounds : ndarray of shape (m, 2)

    Examples
    --------
    >>> space = ParameterSpace([Parameter("a", 1, 0, 2), Parameter("b", 10, 5, 20)])
    >>> space.bounds
    array([[ 0.,  2.],
           [ 5., 20.]])
    >>> space.subset(["b"]).names
    ('b',)
    """

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        self._parameters = tuple(parameters)
        names = [p.name for p in self._parameters]
        self._index = {name: i for i, name in enumerate(names)}
        for name in names:
            if names.count(name) > 1:
                problem = f"parameter {name!r} is declared {names.count(name)} times"
                raise InputError(problem, allowed="unique names")

    def __len__(self) -> int:
        return len(self._parameters)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._parameters)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __getitem__(self, key: str | int) -> Parameter:
        return self._parameters[self.index(key) if isinstance(key, str) else key]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ParameterSpace) and self._parameters == other._parameters

    def __hash__(self) -> int:
        return hash(self._parameters)

    def __repr__(self) -> str:
        return shortened(f"ParameterSpace({', '.join(self.names)}", LONGEST - 1) + ")"

    def _repr_html_(self) -> str:
        return str(self.to_frame().to_html())

    @property
    def names(self) -> tuple[str, ...]:
        """Names in order."""
        return tuple(self._index)

    @property
    def nominal(self) -> _Array:
        """Nominal values, shape (m,)."""
        return np.array([p.nominal for p in self], dtype=float)

    @property
    def scales(self) -> _Array:
        """Denominators of relative deviations, shape (m,)."""
        return np.array([p.scale for p in self], dtype=float)

    @property
    def bounds(self) -> _Array:
        """Lower and upper bounds, shape (m, 2)."""
        return np.array([(p.lower, p.upper) for p in self], dtype=float).reshape(len(self), 2)

    def index(self, name: str) -> int:
        """Position of a parameter; an unknown name raises `InputError` with the nearest matches."""
        if name not in self._index:
            raise unknown_name(name, self.names, kind="parameter")
        return self._index[name]

    def subset(self, names: Iterable[str]) -> ParameterSpace:
        """Return the named parameters, in the order given."""
        return ParameterSpace(self[name] for name in names)

    def replace(self, changes: Mapping[str, Mapping[str, float]]) -> ParameterSpace:
        """Return a space in which some fields of some parameters are changed.

        A scale that is the size of the nominal value follows it.

        Examples
        --------
        >>> space = ParameterSpace([Parameter("a", 1, 0, 2)])
        >>> space.replace({"a": {"upper": 5.0}})["a"].upper
        5.0
        """
        for name in changes:
            self.index(name)
        out = []
        for p in self:
            change = dict(changes.get(p.name, {}))
            if "nominal" in change and "scale" not in change and p.scale == abs(p.nominal):
                change["scale"] = None  # type: ignore[assignment]  # that of the new nominal value
            out.append(replace(p, **change) if change else p)  # type: ignore[arg-type]
        return ParameterSpace(out)

    def extend(self, parameters: Iterable[Parameter]) -> ParameterSpace:
        """Return a space with more parameters at the end."""
        return ParameterSpace([*self, *parameters])

    def validate(self, theta: ArrayLike) -> _Array:
        """Return `theta` as float64 of shape (n, m); a single vector becomes one row.

        Values outside the bounds are allowed, because bounds belong to the search and not to the simulation.

        Raises
        ------
        InputError
            If the number of columns is not m or a value is not finite.
        """
        # contiguous: NumPy's vector loops may round views with other strides differently
        values = np.ascontiguousarray(np.atleast_2d(np.asarray(theta, dtype=float)))
        if values.ndim != 2 or values.shape[1] != len(self):
            allowed = f"(n, {len(self)}) or ({len(self)},)"
            raise InputError(f"theta has shape {np.shape(theta)}", allowed=allowed)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            row, column = bad[0]
            problem = f"theta[{row}, {column}] ({self.names[column]}) is {values[row, column]}"
            raise InputError(problem, allowed="finite numbers")
        return values

    def embed(self, values: ArrayLike, names: Iterable[str]) -> _Array:
        """Return full vectors in which the named parameters have `values` and the others are nominal.

        Parameters
        ----------
        values : array-like of shape (n, k) or (k,)
        names : iterable of k str

        Returns
        -------
        ndarray of shape (n, m)

        Examples
        --------
        >>> space = ParameterSpace([Parameter("a", 1, 0, 2), Parameter("b", 10, 5, 20)])
        >>> space.embed([12.0], ["b"])
        array([[ 1., 12.]])
        """
        values = np.atleast_2d(np.asarray(values, dtype=float))
        full = np.tile(self.nominal, (len(values), 1))
        full[:, [self.index(name) for name in names]] = values
        return full

    def deviation(self, theta: ArrayLike) -> _Array:
        r"""Relative deviation, equation (12): :math:`r_j = |(\theta_j - \theta_{j,0}) / \theta_{j,0}|`.

        Returns
        -------
        ndarray of shape (n, m)
        """
        return np.abs(self.validate(theta) - self.nominal) / self.scales

    def to_frame(self) -> pd.DataFrame:
        """Table of all parameters, one row each, indexed by name."""
        import pandas as pd

        columns = ["device", "symbol", "unit", "nominal", "lower", "upper", "scale", "description"]
        rows = [[getattr(p, c) for c in columns] for p in self]
        return pd.DataFrame(rows, columns=columns, index=pd.Index(self.names, name="name"))


def distinct_rows(theta: _Array) -> tuple[_Array, NDArray[np.int64]]:
    """Return the different rows of `theta` (n, m) in order of appearance, and for each row (n,) its number there.

    Same as ``np.unique`` with an axis, but faster: a search asks thousands of times.
    """
    first: dict[bytes, int] = {}
    number = [first.setdefault(row.tobytes(), k) for k, row in enumerate(theta)]
    found, which = np.unique(np.array(number, dtype=np.int64), return_inverse=True)
    return theta[found], which
