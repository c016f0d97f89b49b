r"""Latent input: an unknown signal added at a port, for errors that no effect explains.

Piecewise linear between knots :math:`t_i`, zero before the event and after the last knot, and one pulse:

.. math:: u = u^* + \sum_i a_i\,\Lambda_i(t) + p\,\Lambda\Big(\frac{(t - t_e)/W - c}{w}\Big), \quad
    \Lambda(x) = \max(0, 1 - |x|)                                                               \qquad (I1)

with hat functions :math:`\Lambda_i`. The knots lie closer together just after the event than later:
:math:`s(t) = \sqrt{(t - t_e)/W}\,N` maps time after the event to the number of a knot, so that a window of W seconds
after the event at :math:`t_e` holds N of them. The pulse, at a share c of the window and with a half width w that is no
larger, resolves details finer than the knots (`errorscreen.discovery.unknown_input.fine_detail`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values
from errorscreen.engine.vmath import clip
from errorscreen.parameters import Parameter

#: number N of knots
KNOTS = 32
#: parameters of the pulse: its height, and place and half width as shares of the window
PULSE = ("pulse", "centre", "width")
#: length of the window on the clock whose square root is s(t)
_WINDOW = float(KNOTS**2)


def latent(
    value: Any, t: Any, te: Any, rate: Any, on: Any, pulse: Any, centre: Any, width: Any,
    a0: Any, a1: Any, a2: Any, a3: Any, a4: Any, a5: Any, a6: Any, a7: Any,
    a8: Any, a9: Any, a10: Any, a11: Any, a12: Any, a13: Any, a14: Any, a15: Any,
    a16: Any, a17: Any, a18: Any, a19: Any, a20: Any, a21: Any, a22: Any, a23: Any,
    a24: Any, a25: Any, a26: Any, a27: Any, a28: Any, a29: Any, a30: Any, a31: Any,
) -> Any:  # fmt: skip
    """Quantity with the added signal, and the clock, (I1)."""
    past = clip((t - te) * rate, 0.0, 1e9)
    s = np.sqrt(past)
    u = (
        a0 * clip(1.0 - np.abs(s - 1.0), 0.0, 1.0) + a1 * clip(1.0 - np.abs(s - 2.0), 0.0, 1.0)
        + a2 * clip(1.0 - np.abs(s - 3.0), 0.0, 1.0) + a3 * clip(1.0 - np.abs(s - 4.0), 0.0, 1.0)
        + a4 * clip(1.0 - np.abs(s - 5.0), 0.0, 1.0) + a5 * clip(1.0 - np.abs(s - 6.0), 0.0, 1.0)
        + a6 * clip(1.0 - np.abs(s - 7.0), 0.0, 1.0) + a7 * clip(1.0 - np.abs(s - 8.0), 0.0, 1.0)
        + a8 * clip(1.0 - np.abs(s - 9.0), 0.0, 1.0) + a9 * clip(1.0 - np.abs(s - 10.0), 0.0, 1.0)
        + a10 * clip(1.0 - np.abs(s - 11.0), 0.0, 1.0) + a11 * clip(1.0 - np.abs(s - 12.0), 0.0, 1.0)
        + a12 * clip(1.0 - np.abs(s - 13.0), 0.0, 1.0) + a13 * clip(1.0 - np.abs(s - 14.0), 0.0, 1.0)
        + a14 * clip(1.0 - np.abs(s - 15.0), 0.0, 1.0) + a15 * clip(1.0 - np.abs(s - 16.0), 0.0, 1.0)
        + a16 * clip(1.0 - np.abs(s - 17.0), 0.0, 1.0) + a17 * clip(1.0 - np.abs(s - 18.0), 0.0, 1.0)
        + a18 * clip(1.0 - np.abs(s - 19.0), 0.0, 1.0) + a19 * clip(1.0 - np.abs(s - 20.0), 0.0, 1.0)
        + a20 * clip(1.0 - np.abs(s - 21.0), 0.0, 1.0) + a21 * clip(1.0 - np.abs(s - 22.0), 0.0, 1.0)
        + a22 * clip(1.0 - np.abs(s - 23.0), 0.0, 1.0) + a23 * clip(1.0 - np.abs(s - 24.0), 0.0, 1.0)
        + a24 * clip(1.0 - np.abs(s - 25.0), 0.0, 1.0) + a25 * clip(1.0 - np.abs(s - 26.0), 0.0, 1.0)
        + a26 * clip(1.0 - np.abs(s - 27.0), 0.0, 1.0) + a27 * clip(1.0 - np.abs(s - 28.0), 0.0, 1.0)
        + a28 * clip(1.0 - np.abs(s - 29.0), 0.0, 1.0) + a29 * clip(1.0 - np.abs(s - 30.0), 0.0, 1.0)
        + a30 * clip(1.0 - np.abs(s - 31.0), 0.0, 1.0) + a31 * clip(1.0 - np.abs(s - 32.0), 0.0, 1.0)
        + pulse * clip(1.0 - np.abs(past / _WINDOW - centre) / width, 0.0, 1.0)
    )  # fmt: skip
    return value + on * u, 1.0 + 0.0 * t


def _start(values: Values, h: float) -> Values:
    one = np.ones_like(values["on"])
    return {"te": values["t_event"] * one, "rate": KNOTS**2 / (values["t_stop"] - values["t_event"]) * one}


def latent_input(port: str, size: float, unit: str = "pu", devices: tuple[str, ...] = ()) -> Effect:
    """Unknown signal at a port.

    Parameters
    ----------
    port : str
    size : float
        Largest value of the signal.
    unit : str
        Of the port.
    devices : tuple of str
        Devices that have the port.

    Examples
    --------
    >>> latent_input("Pm", 0.5).name
    'latent_Pm'
    """
    of = f"latent input at {port}"
    knots = tuple(
        Parameter(f"a{i}", 0.0, -size, size, unit, of, f"a_{i}", f"value at knot {i + 1}", scale=size)
        for i in range(KNOTS)
    )
    return Effect(
        name=f"latent_{port}",
        title=f"Unknown signal at {port}",
        port=port,
        equations=latent,
        parameters=(
            Parameter("on", 1.0, 0.0, 1.0, "", of, "on", "0: none"),
            Parameter("pulse", 0.0, -size, size, unit, of, "p", "height of the pulse", scale=size),
            Parameter("centre", 0.0, 0.0, 1.0, "", of, "c", "its centre, a share of the window", scale=1.0),
            Parameter("width", 1.0, 1e-6, 1.0, "", of, "w", "half width, a share of the window", scale=1.0),
            *knots,
        ),
        states=("t",),
        derived=("te", "rate"),
        initialise=_start,
        kind="latent",
        devices=devices,
        description="A signal of free shape, which shows the place of an error that no effect explains.",
        source="definition, (I1)",
        confused_with=("any effect at the same port",),
    )
