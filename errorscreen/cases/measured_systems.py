"""Public recordings of small systems with incomplete models: an electronic oscillator and falling balls.

The files are not part of this package. `silverbox` is the benchmark of Wigren and Schoukens (*Three free data sets for
development and benchmarking in nonlinear system identification*, European Control Conference 2013), the balls are those
of de Silva, Higdon, Brunton and Kutz (*Discovery of physics from data*, Frontiers in Artificial Intelligence 3, 2020).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

#: noise in volts (residual of a good model) and in metres (position in a video)
SILVERBOX_NOISE, BALL_NOISE = 5e-4, 0.1
#: 1/s²: a resonance at 68 Hz
_STIFFNESS = (2 * np.pi * 68.0) ** 2
#: integration steps between two samples of the oscillator, nine samples for each period
_STEPS = 4
#: resistances that can act on a ball in the air: gravity is known, and there is no dry friction
RESISTANCES = ("viscous", "drag", "quadratic", "cubic")


def oscillator(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    r"""Linear oscillator, :math:`\ddot y = b u - d \dot y - k y`."""
    dx[0] = x[1]
    dx[1] = p[0] * u[0] - p[1] * x[1] - p[2] * x[0]


def fall(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    r"""Free fall, :math:`\ddot h = -g`."""
    dx[0] = x[1]
    dx[1] = -p[0]


def read_silverbox(
    path: str | Path, first: int = 0, last: int | None = None, *,
    noise: float = SILVERBOX_NOISE, name: str = "silverbox",
) -> Recording:  # fmt: skip
    """Read samples `first` to `last` of the oscillator's record.

    Parameters
    ----------
    path : str or Path
        CSV with the columns ``time_s``, ``u_V``, ``y_V``.
    first, last : int, optional
        As in a slice.
    noise : float
        Standard deviation of y in volts.
    name : str

    Raises
    ------
    InputError
        If a column is missing or fewer than 100 samples are left.
    """
    table = _table(path, ("time_s", "u_V", "y_V"))
    time, u, y = (values[first:last] for values in table.values())
    if len(time) < 100:
        raise InputError(f"{len(time)} samples are left", where=str(path), allowed="at least 100")
    signals, units = {"u": u, "y": y}, {"u": "V", "y": "V"}
    return Recording.from_signals(time - time[0], signals, name=name, units=units, noise={"y": noise})


def silverbox(recording: Recording, **options: Any) -> ODESimulator:
    """Linear model of the electronic oscillator.

    Parameters
    ----------
    recording : Recording
    **options
        Of `ODESimulator`.
    """
    k = _STIFFNESS
    return ODESimulator(
        oscillator,
        {"y": "V", "v": "V/s"},
        [
            Parameter("b", k, 0.3 * k, 3.0 * k, "1/s²", description="gain"),
            Parameter("d", 40.0, 5.0, 200.0, "1/s", description="damping"),
            Parameter("k", k, 0.3 * k, 3.0 * k, "1/s²", description="stiffness"),
        ],
        recording,
        inputs={"u": "V"},
        outputs=["y"],
        initial={"y": "measured", "v": Parameter("v", 0.01, -100.0, 100.0, "V/s")},
        step=float(np.median(np.diff(recording.time))) / _STEPS,
        interpolation="bandlimited",
        **options,
    )


def read_falling_ball(path: str | Path, ball: str, drop: int, *, noise: float = BALL_NOISE) -> Recording:
    """Read one drop of one ball.

    Parameters
    ----------
    path : str or Path
        CSV with the columns ``ball``, ``drop``, ``time``, ``height_m``.
    ball : str
    drop : int
    noise : float
        Of the height in metres.

    Raises
    ------
    InputError
        If a column is missing, or there is no such ball or drop.
    """
    table = _table(path, ("ball", "drop", "time", "height_m"))
    rows = (table["ball"] == ball) & (table["drop"] == drop)
    if not rows.any():
        found = sorted({f"{b}, drop {d}" for b, d in zip(table["ball"], table["drop"], strict=True)})
        raise InputError(f"there is no {ball!r}, drop {drop}", where=str(path), allowed="; ".join(found))
    return Recording.from_signals(
        table["time"][rows].astype(float), {"height": table["height_m"][rows].astype(float)},
        name=f"{ball}, drop {drop}", units={"height": "m"}, noise={"height": noise},
    )  # fmt: skip


def falling_ball(recording: Recording, **options: Any) -> ODESimulator:
    """Free fall under known gravity, from about 47 m and nearly from rest.

    The hand lets go within 0.15 s of the first picture, so the velocity then is known to 1.5 m/s.

    Parameters
    ----------
    recording : Recording
    **options
        Of `ODESimulator`, for example other `templates` than `RESISTANCES`.
    """
    height = float(recording.channel("height").values[0])
    initial = {
        "height": Parameter("height", height, height - 3.0, height + 3.0, "m"),
        "velocity": Parameter("velocity", 0.0, -1.5, 1.5, "m/s", scale=1.0),
    }
    options = {"templates": RESISTANCES, "constants": {"g": 9.80665}, "initial": initial, **options}
    return ODESimulator(
        fall, {"height": "m", "velocity": "m/s"}, [], recording, outputs=["height"], **options
    )


def _table(path: str | Path, columns: tuple[str, ...]) -> dict[str, Any]:
    """Columns of a CSV file as arrays."""
    import pandas as pd

    if not Path(path).is_file():
        raise InputError("the file does not exist", where=str(path))
    frame = pd.read_csv(path)
    missing = ", ".join(name for name in columns if name not in frame)
    if missing:
        raise InputError(f"the column {missing} is missing", where=str(path), allowed=", ".join(columns))
    return {name: frame[name].to_numpy() for name in columns}
