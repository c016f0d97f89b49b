r"""Load at a bus of a grid, in deviation from a constant impedance.

The constant impedance is part of the grid. This device draws the rest, which is zero until an effect acts (voltage and
frequency dependence, motors). It is driven by the filtered phasor W of the terminal voltage, so that the
current follows from states and no algebraic loop arises. In per unit of the load's apparent power before the event,
power positive when drawn:

.. math::

    T\dot W &= V - W + j\Omega F\,T W,\quad \Omega = 2\pi f_0                                 & (L1)\\
    \Omega\,T_f\dot F &= \Im(W^* V)/(T |W|^2)                                                & (L2)\\
    r &= |W|/V_0,\quad \rho = [r]_{V_{min}}^{\infty}                                           & (L3)\\
    C &= -\frac{\Delta P - j\Delta Q}{|W|^2} W - M                                             & (L4)

with the frequency deviation F, which turns the filter so that W does not lag at another frequency, the relative
voltage r, below :math:`V_{min}` of which every static load is an impedance (IEEE Task Force, *Standard load models
for power flow and dynamic performance simulation*, IEEE Trans. Power Syst. 10, 1995), and ports :math:`\Delta P,
\Delta Q, M`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.device import Constant, Device, GridInterface, Values
from errorscreen.parameters import ParameterSpace

#: square of the voltage below which divisions by it stop
_W2_MIN = 1e-4


@stage("W2", "r", "rho")
def filtered_voltage(Wr: Any, Wi: Any, V0: Any, Vmin: Any) -> Any:
    """Square of the filtered voltage, and the relative one with its lower limit, (L3)."""
    W2 = clip(Wr * Wr + Wi * Wi, _W2_MIN, 1e9)
    r = np.sqrt(W2) / V0
    return W2, r, clip(r, Vmin, 1e9)


@stage("dP", "dQ", "Mr", "Mi")
def constant_impedance(Wr: Any) -> Any:
    """Nothing beyond the constant impedance; effects change it."""
    zero = 0.0 * Wr
    return zero, zero, zero, zero


@stage("Cr", "Ci")
def current(Wr: Any, Wi: Any, W2: Any, dP: Any, dQ: Any, Mr: Any, Mi: Any) -> Any:
    """Injected current, (L4)."""
    return -(dP * Wr + dQ * Wi) / W2 - Mr, -(dP * Wi - dQ * Wr) / W2 - Mi


@stage("d_Wr", "d_Wi", "d_F")
def filters(Vr: Any, Vi: Any, Wr: Any, Wi: Any, F: Any, W2: Any, T: Any, Tf: Any, f0: Any) -> Any:
    """Filters of the voltage and its frequency, (L1), (L2)."""
    omega = 6.283185307179586 * f0
    turning = (Wr * Vi - Wi * Vr) / (T * W2)
    return (Vr - Wr) / T - omega * F * Wi, (Vi - Wi) / T + omega * F * Wr, turning / (omega * Tf)


def initialise(v: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
    """Equilibrium at V, angle, P, Q: the filters at rest."""
    one = np.ones_like(v["V"])
    states = {"Wr": v["V"] * np.cos(v["angle"]), "Wi": v["V"] * np.sin(v["angle"]), "F": 0.0 * one}
    return states, {"P0": v["P"] * one, "Q0": v["Q"] * one, "V0": v["V"] * one}, v["V"] > 0.0


LOAD = Device(
    name="load",
    title="Load in deviation from a constant impedance",
    candidates=ParameterSpace(()),
    constants=(
        Constant("T", 0.01, "s", "time constant of the filtered voltage"),
        Constant("Tf", 0.05, "s", "time constant of the frequency's measurement"),
        Constant("Vmin", 0.7, "pu", "relative voltage below which static loads are impedances"),
    ),
    states=("Wr", "Wi", "F"),
    setpoints=("P0", "Q0", "V0"),
    stages=(filtered_voltage, constant_impedance, current, filters),
    initialise=initialise,
    ports={
        "dP": "active power beyond the constant impedance, in pu of the load's apparent power",
        "dQ": "reactive power beyond the constant impedance, in pu of the load's apparent power",
        "Mr": "real part of the current of motors beyond their impedance before the event, in pu",
        "Mi": "imaginary part of the same",
    },
    needs_angle=True,
    source="IEEE Task Force on Load Representation, IEEE Trans. Power Syst. 10(3), 1995",
    grid=GridInterface(
        "current",
        source=(filtered_voltage, constant_impedance, current),
        terminal=(filters,),
        constants=(Constant("f0", 60.0, "Hz", "nominal frequency"),),
    ),
)
