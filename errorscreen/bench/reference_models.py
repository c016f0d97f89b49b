"""Standard models beside trajectories of other programs, driven by the voltage that those recorded.

The voltage is a curve through the rows of each part of the run (before, during and after a fault), so that its jumps
stay jumps. Each part of the run starts from the states in which the one before it ended.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from errorscreen.engine.kernels import new_engine
from errorscreen.models.device import Device
from errorscreen.models.part import Part, Start, Values
from errorscreen.models.unit import SHORTEST
from errorscreen.models.unit_start import UnitStart
from errorscreen.simulators import assembly

#: stamps nearer than this (s) are one instant, at which a change of the voltage by more than this (pu) is a jump
_SAME, _JUMP = 1e-6, 1e-4
#: rows after a jump that show its decay, and the least and greatest time constant in distances of rows
_FIRST_ROWS, _DECAY = 10, (0.2, 8.0)


def between_rows(time: NDArray[np.float64], phasor: NDArray[Any], at: NDArray[np.float64]) -> NDArray[Any]:
    r"""Voltage at instants between the rows of a part of a run.

    Behind a jump the subtransient windings of a machine let the voltage decay within some 20 ms, the distance of
    rows in many references. So the curve is a decay besides a cubic spline, :math:`c\,e^{-(t - t_0)/T} + s(t)`, with
    the c and T that leave the least fourth divided differences among the first rows: a cubic has none.

    Parameters
    ----------
    time : ndarray of shape (L,)
        In seconds, increasing.
    phasor : ndarray of shape (L,)
        Complex voltage in pu.
    at : ndarray of shape (K,)
        In seconds.

    Returns
    -------
    ndarray of shape (K,)

    Examples
    --------
    >>> time, at = 0.02 * np.arange(10), 0.01 + 0.02 * np.arange(9)
    >>> voltage = lambda t: 1.0 + 0.1 * t - (0.2 + 0.3j) * np.exp(-t / 0.015)
    >>> bool(abs(CubicSpline(time, voltage(time))(at) - voltage(at)).max() > 5e-3)
    True
    >>> bool(abs(between_rows(time, voltage(time), at) - voltage(at)).max() < 1e-3)
    True
    """
    t, v = np.asarray(time, dtype=float), np.asarray(phasor)
    first = slice(0, _FIRST_ROWS)
    if len(t) < _FIRST_ROWS // 2 + 2:
        return np.asarray(CubicSpline(t, v)(at))
    bent, distance = _fourth_differences(t[first], v[first]), float(np.median(np.diff(t[first])))

    def decay(T: float) -> tuple[float, complex]:
        shape = _fourth_differences(t[first], np.exp(-(t[first] - t[0]) / T))
        c = np.vdot(shape, bent) / np.vdot(shape, shape)
        return float(np.linalg.norm(bent - c * shape)), c

    T = min(distance * np.geomspace(*_DECAY, 80), key=lambda T: decay(T)[0])
    _, c = decay(T)
    spline = CubicSpline(t, v - c * np.exp(-(t - t[0]) / T))
    return np.asarray(c * np.exp(-(at - t[0]) / T) + spline(at))


def _fourth_differences(time: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Fourth divided differences, times 4!."""
    for order in range(1, 5):
        values = order * np.diff(values) / (time[order:] - time[:-order])
    return values


@dataclass(frozen=True)
class _Given:
    """Start of a machine with another mechanical power: references start with a small mismatch of power."""

    part: Part
    power: float

    def __call__(self, values: Values) -> Start:
        start = self.part.start(values)
        return start._replace(setpoints={**start.setpoints, "Pm0": start.setpoints["Pm0"] * 0.0 + self.power})


def play(
    device: Device,
    time: NDArray[np.float64],
    V: NDArray[np.float64],
    angle: NDArray[np.float64],
    start: Mapping[str, float],
    record: Sequence[str],
    *,
    f_nominal: float,
    step: float = 0.0005,
    constants: Mapping[str, float] | None = None,
    power: float | None = None,
    inputs: Mapping[str, NDArray[np.float64]] | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Quantities of a unit while a recorded voltage is imposed on its terminal.

    Parameters
    ----------
    device : Device
        A unit of standard models.
    time : ndarray of shape (L,)
        In seconds. Two equal stamps whose voltages differ are the values just before and after a jump.
    V, angle : ndarray of shape (L,)
        Terminal voltage in pu and its angle in rad.
    start : mapping of str to float
        ``"P"`` and ``"Q"`` at the start, in pu of the unit.
    record : sequence of str
        Names of quantities.
    f_nominal, step : float
        In Hz and seconds; the step divides the parts between jumps.
    constants : mapping of str to float, optional
        Constants and candidates other than the device's.
    power : float, optional
        Mechanical power at the start; that at rest where not given.
    inputs : mapping of str to ndarray of shape (L,), optional
        Recorded quantities that drive the device (`Device.driven`), in pu.

    Returns
    -------
    dict of str to ndarray of shape (L,)
    """
    time = np.asarray(time, dtype=float)
    if power is not None:
        assert isinstance(device.initialise, UnitStart)
        machine, *others = device.initialise.parts
        device = replace(
            device, initialise=UnitStart((replace(machine, start=_Given(machine, power)), *others))
        )
    engine = new_engine("compiled", assembly.assemble(device, ()), None)
    one = np.ones(1)
    values = {p.name: p.nominal * one for p in device.candidates}
    values |= {name: value * one for name, value in device.constant_values(constants).items()}
    values |= {
        "f0": f_nominal * one,
        "shortest": SHORTEST * step * one,
        "V": V[0] * one,
        "angle": angle[0] * one,
    }
    values |= {name: value * one for name, value in start.items()}
    states, setpoints, _ = device.initialise(values)
    values |= states | setpoints
    x, fixed, _ = assembly.starting(engine.model, values, np.array([True]), 1)
    phasor = V * np.exp(1j * angle)
    recorded = [np.asarray(inputs[name], dtype=float) for name in device.driven] if inputs else []
    together = np.diff(time) < _SAME
    jumps = [0, *(np.flatnonzero(together & (np.abs(np.diff(phasor)) > _JUMP)) + 1), len(time)]
    out = {name: np.empty(len(time)) for name in record}
    for first, last in pairwise(jumps):
        rows = slice(first, last)
        steps = max(1, round((time[last - 1] - time[first]) / step))
        half = time[first] + np.arange(2 * steps + 1) * 0.5 * (time[last - 1] - time[first]) / steps
        distinct = np.concatenate([[True], ~together[first : last - 1]])
        voltage = between_rows(time[rows][distinct], phasor[rows][distinct], half)
        between = [PchipInterpolator(time[rows][distinct], row[rows][distinct])(half) for row in recorded]
        deviations = [course - row[0] for course, row in zip(between, recorded, strict=True)]
        u = np.column_stack([voltage.real, voltage.imag, *deviations])
        found = engine.integrate(
            x, fixed, u, h=2 * (half[1] - half[0]), record=[*record, *engine.model.states]
        )[0]
        for name, row in zip(record, found, strict=False):
            out[name][rows] = np.interp(time[rows], half[::2], row)
        x = found[len(record) :, -1][None]
    return out
