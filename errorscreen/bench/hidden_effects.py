r"""Effects of hidden truths alone: other forms of effects of the library, and effects outside of the library.

No fitted model holds these equations. An effect in another form is named rightly by the library's name:

.. math::

    e &= V_0 - V,\quad E_{fd} = E_{fd0} + \big[K(e + K_I\textstyle\int e\,dt)\big]_{low}^{high}\ \text{lagged} & (H1)\\
    e &= -(\omega - 1)\ \text{if}\ |\omega - 1| > d\ \text{else}\ 0                                             & (H2)\\
    S(E) &= A\,E^{n} - A\,E_0^{n}                                                                            & (H3)\\
    \big(1 + \tfrac{T}{3}\tfrac{d}{dt}\big)^3 y &= u                                                            & (H4)

an exciter with a PI regulator, a governor whose dead band has a step at its edge, a saturation by a power of the
voltage, and three equal lags in series. Outside of the library:

.. math::

    P_m &= P_{m0} - A V^2\ \text{while}\ \omega > 1 + d                                                      & (H5)\\
    u &= u^* + A\,s\big((t - t_1)/T\big)\,\big(1 - s((t - t_2)/T)\big)                          & (H6)\\
    u &= u^* + A\,(V_0 - V)\,|V_0 - V|                                                                       & (H7)

a braking resistor, a quantity switched on and off with smooth steps s (fast valving, a cloud, a capacitor bank), and a
reaction to the square of the voltage.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import clip, hold_at_limits, select, smooth_step

_E_MIN, _E_MAX = 0.0, 5.0


def pi_exciter(value: Any, V: Any, V0: Any, Efd0: Any, x: Any, E: Any, K: Any, KI: Any, TE: Any) -> Any:
    """Exciter with a PI regulator, (H1)."""
    e = V0 - V
    low, high = clip(_E_MIN - Efd0, -1e9, 0.0), clip(_E_MAX - Efd0, 0.0, 1e9)
    y = clip(K * e + x, low, high)
    return value + E, hold_at_limits(x, KI * K * e, low, high), (y - E) / TE


def stepped_governor(
    value: Any, omega: Any, Pm0: Any, g: Any, x: Any, K: Any, db: Any, T1: Any, T3: Any
) -> Any:
    """Governor whose dead band has a step at its edge, (H2)."""
    speed = omega - 1.0
    e = select(np.abs(speed) > db, -speed, 0.0)
    low, high = clip(-Pm0, -1e9, 0.0), clip(1.2 - Pm0, 0.0, 1e9)
    gate = clip(g, low, high)
    return value + 0.3 * gate + 0.7 * x, hold_at_limits(g, (K * e - g) / T1, low, high), (gate - x) / T3


def power_saturation(value: Any, Eq1: Any, S0: Any, A: Any) -> Any:
    """Saturation by a power of the voltage, (H3)."""
    E2 = Eq1 * Eq1
    return (value - (A * E2 * E2 * E2 - S0),)


def three_lags(value: Any, x: Any, y: Any, z: Any, T: Any) -> Any:
    """Three equal lags in series, (H4)."""
    rate = 3.0 / (T + 1e-9)
    return select(T > 0.0, z, value), rate * (value - x), rate * (x - y), rate * (y - z)


def brake(value: Any, omega: Any, V: Any, A: Any, d: Any) -> Any:
    """Braking resistor, (H5)."""
    return (value - A * V * V * smooth_step((omega - 1.0 - d) / 0.0005),)


def switched(value: Any, t: Any, A: Any, t1: Any, t2: Any, T: Any) -> Any:
    """Quantity switched on and off, (H6)."""
    on = smooth_step((t - t1) / T) * (1.0 - smooth_step((t - t2) / T))
    return value + A * on, 1.0 + 0.0 * t


def square_voltage(value: Any, V: Any, V0: Any, A: Any) -> Any:
    """Reaction to the square of the voltage, (H7)."""
    return (value + A * (V0 - V) * np.abs(V0 - V),)


def _start_V(values: Values, h: float) -> Values:
    return {"V0": values["V"] * np.ones_like(values["A" if "A" in values else "K"])}


def _start_saturation(values: Values, h: float) -> Values:
    return {"S0": values["A"] * values["Eq1"] ** 6}


def _v(name: str, low: float, high: float) -> Any:
    return value(name, 0.5 * (low + high), low, high, "", "hidden", name, "")


def _s(name: str, high: float) -> Any:
    return strength(name, 0.5 * high, high, "", "hidden", name, "")


def _switched(name: str, title: str, port: str, size: float) -> Effect:
    parameters = (_s("A", size), _v("t1", 1.2, 2.0), _v("t2", 2.2, 4.5), _v("T", 0.02, 0.5))
    return Effect(name, title, port, switched, parameters, states=("t",))


def _three_lags(kind: str, port: str, level: Callable[[Values], Any]) -> Effect:
    def start(values: Values, h: float) -> Values:
        x = level(values) * np.ones_like(values["T"])
        return {"x": x, "y": x, "z": x}

    name, states = f"three_lags_{kind}", ("x", "y", "z")
    return Effect(name, "Three lags", port, three_lags, (_s("T", 0.3),), states=states, initialise=start)


#: by device: effects in another form, each with the library's name
OTHER_FORMS: dict[str, tuple[tuple[Effect, str], ...]] = {
    "synchronous_machine": (
        (Effect("pi_exciter", "PI exciter", "Efd", pi_exciter,
                (_s("K", 60.0), _v("KI", 0.05, 1.0), _v("TE", 0.02, 0.3)),
                states=("x", "E"), derived=("V0",), initialise=_start_V), "exciter"),
        (Effect("stepped_governor", "Governor, dead band with step", "Pm", stepped_governor,
                (_s("K", 40.0), _v("db", 0.0, 0.002), _v("T1", 0.1, 0.8), _v("T3", 1.0, 10.0)),
                states=("g", "x")), "governor"),
        (Effect("power_saturation", "Saturation by a power", "Efd", power_saturation, (_s("A", 0.4),),
                derived=("S0",), initialise=_start_saturation), "saturation"),
    ),
    "dfig_plant": (
        (_three_lags("active", "Ip_cmd", lambda v: v["P"] / v["V"]), "lag_active"),
        (_three_lags("reactive", "Qcmd", lambda v: v["Q"]), "lag_reactive"),
    ),
    "pv_plant": (
        (_three_lags("active", "Ip_cmd", lambda v: v["P"] / v["V"]), "lag_active"),
        (_three_lags("reactive", "Iq_cmd", lambda v: v["Q"] / v["V"]), "lag_reactive"),
    ),
}  # fmt: skip

#: by device: effects outside of the library
OUTSIDE: dict[str, tuple[Effect, ...]] = {
    "synchronous_machine": (
        Effect("brake", "Braking resistor", "Pm", brake, (_s("A", 0.5), _v("d", 0.0005, 0.004))),
        _switched("valving", "Fast valving", "Pm", 0.4),
        _switched("forcing", "Field forcing", "Efd", 2.0),
    ),
    "dfig_plant": (
        _switched("gust", "Power step", "Ip_cmd", 0.3),
        _switched("capacitor", "Capacitor bank", "Qcmd", 0.3),
    ),
    "pv_plant": (
        _switched("cloud", "Power step", "Ip_cmd", 0.3),
        _switched("capacitor", "Capacitor bank", "Iq_cmd", 0.3),
        Effect("square_voltage", "Reaction to the square of the voltage", "Iq_cmd", square_voltage, (_s("A", 20.0),),
               derived=("V0",), initialise=_start_V),
    ),
}  # fmt: skip
