r"""Photovoltaic plant with low-voltage ride-through, 17 candidate parameters.

Structure after GB/T 32892-2016 (model of photovoltaic power systems for power-system studies: dc side, outer
loops, ride-through control, current regulator) and the converter of the WECC generic model REGC_A (WECC Solar Plant
Dynamic Modeling Guidelines, 2014). Reactive power is positive when generated. In playback of the recorded
voltage the phase-locked loop is ideal, so only the magnitude matters; in a simulated grid, and behind the impedance of
one, the current (PV12) lies along the angle of a loop (T2), and power follows from current and voltage.

.. math::

    P &= V I_p,\quad Q = V I_q                                                          & (PV1)\\
    T_m \dot V_f &= V - V_f,\quad T_q \dot Q_f = Q - Q_f                                 & (PV2)\\
    w &= \mathrm{step}\big((V_{LV} - V_f)/\Delta V_{LV}\big) \in [0, 1]                    & (PV3)\\
    P_{pv} &= P_0\,[1 - k(v_{dc} - 1)^2]^+,\quad v_{dc} = \sqrt{W},\quad
    k = k_{pv}\ \text{if}\ v_{dc} > 1\ \text{else}\ 1                                       & (PV4)\\
    C_{dc}\dot W/2 &= P_{pv} - P                                                         & (PV5)\\
    I_p^n &= f K_{Pdc}(v_{dc} - 1) + x_{dc},\quad \dot x_{dc} = (1 - w)f K_{Idc}(v_{dc} - 1),\quad
    f = [1 - (1 - r)/\Delta r]_0^1                                                       & (PV6)\\
    I_q^n &= K_{PQ}(r Q_{ref} - Q_f) + x_q,\quad \dot x_q = (1 - w) K_{IQ}(r Q_{ref} - Q_f)    & (PV7)\\
    I_p^{LV} &= K_{1,Ip} V_f + K_{2,Ip} I_{p0} + I_{p,set}                                & (PV8)\\
    I_q^{LV} &= K_{1,Iq}(V_{LV} - V_f) + K_{2,Iq} I_{q0} + K_{Q,LV} Q_0/V_f           & (PV9)\\
    I_q^{*} &= [(1-w) I_q^n + w I_q^{LV}]_{\pm I_{max}},\quad
    I_p^{*} = [(1-w) I_p^n + w I_p^{LV}]_0^{\sqrt{I_{max}^2 - I_q^{*2}}}                    & (PV10)\\
    \dot I_p &= \min\big((I_p^* - I_p)/T_g,\ R_{Ip}\big),\quad
    \dot I_q = \big[(I_q^* - I_q)/T_g\big]_{\pm R_{Iq}}                                     & (PV11)\\
    C &= (I_p - jI_q)\,e^{j\vartheta}                                                    & (PV12)

Both commands of (PV10) are multiplied by a release r, which is 1; effects change r and the priority of the limit. While
more than :math:`\Delta r` = 0.05 is blocked, the control of the dc voltage rests: it would raise the current up to its
limit, although the array is held off its point of maximum power on purpose. So the current returns with the release to
its old value. The reference of (PV7) follows the release too: nothing winds up there either.

(PV3) is a cubic transition over the band :math:`\Delta V_{LV}` below the threshold instead of a hard switch, so that
the response is differentiable in all parameters. In (PV4) the power falls steeply towards the array's open-circuit
voltage and slowly below the voltage of maximum power, where the array's current is nearly constant. Integrators do not
wind up: beyond their limits they decay with the time constant `Taw`. In (PV9) the term with
:math:`K_{Q,LV}` keeps a share of the pre-fault reactive power at constant power.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import back_calculate, clip, select, sincos, smooth_step
from errorscreen.models.device import Constant, Device, GridInterface, Values, relative_parameters
from errorscreen.models.grid_terminal import phase_locked_loop, terminal_power

#: below this voltage the divisions by V stop; a converter at a dead terminal injects its limits anyway
_V_MIN = 0.05
#: share of the current that may be blocked before the control of the dc voltage rests
_BLOCKED = 0.05


@stage("V", "P", "Q")
def terminal(Ip: Any, Iq: Any, Vr: Any, Vi: Any) -> Any:
    """Voltage magnitude and injected power, (PV1)."""
    V = np.sqrt(Vr * Vr + Vi * Vi)
    return V, V * Ip, V * Iq


@stage("Cr", "Ci")
def grid_source(Ip: Any, Iq: Any, theta: Any) -> Any:
    """Injected current in the frame of the grid, (PV12)."""
    s, c = sincos(theta)
    return Ip * c + Iq * s, Ip * s - Iq * c


@stage("Qref")
def reference(Q0: Any) -> Any:
    """Reference of the reactive power, its value before the event; a port for other controls."""
    return (Q0,)


@stage("d_Vf", "d_Qf", "w")
def measurement(V: Any, Q: Any, Vf: Any, Qf: Any, Tm: Any, Tq: Any, V_LV: Any, dV_LV: Any) -> Any:
    """Measurement filters and weight of the ride-through mode, (PV2), (PV3)."""
    return (V - Vf) / Tm, (Q - Qf) / Tq, smooth_step((V_LV - Vf) / dV_LV)


@stage("vdc", "d_W")
def dc_link(W: Any, P: Any, P0: Any, kpv: Any, Cdc: Any) -> Any:
    """Array characteristic near the point of maximum power and energy of the dc link, (PV4), (PV5)."""
    vdc = np.sqrt(clip(W, 0.01, 100.0))
    k = select(vdc > 1.0, kpv, 1.0)
    Ppv = P0 * clip(1.0 - k * (vdc - 1.0) * (vdc - 1.0), 0.0, 1.0)  # (PV4)
    return vdc, 2.0 * (Ppv - P) / Cdc  # (PV5)


@stage("priority", "release")
def conditions(Imax: Any) -> Any:
    """Reactive current first, and nothing blocked; effects act on them."""
    return 0.0 * Imax, 0.0 * Imax + 1.0


@stage("Ip_n", "d_xdc", "Iq_n", "d_xq")
def outer_loops(
    vdc: Any, Qf: Any, w: Any, release: Any, xdc: Any, xq: Any, Qref: Any,
    KPdc: Any, KIdc: Any, KPQ: Any, KIQ: Any, Imax: Any, Taw: Any,
) -> Any:  # fmt: skip
    """Control of dc voltage and reactive power, frozen during ride-through, (PV6), (PV7)."""
    free = clip(1.0 - (1.0 - release) / _BLOCKED, 0.0, 1.0)
    Ip_n = free * KPdc * (vdc - 1.0) + clip(xdc, 0.0, Imax)
    lacking = release * Qref - Qf
    Iq_n = KPQ * lacking + clip(xq, -Imax, Imax)
    d_xdc = back_calculate(xdc, (1.0 - w) * free * KIdc * (vdc - 1.0), 0.0, Imax, Taw)
    d_xq = back_calculate(xq, (1.0 - w) * KIQ * lacking, -Imax, Imax, Taw)
    return Ip_n, d_xdc, Iq_n, d_xq


@stage("Ip_LV", "Iq_LV")
def ride_through(
    Vf: Any, Ip0: Any, Iq0: Any, Q0: Any, V_LV: Any, Ipset_LV: Any,
    K1_Ip_LV: Any, K2_Ip_LV: Any, K1_Iq_LV: Any, K2_Iq_LV: Any, KQ_LV: Any,
) -> Any:  # fmt: skip
    """Currents during low voltage, (PV8), (PV9)."""
    Ip_LV = K1_Ip_LV * Vf + K2_Ip_LV * Ip0 + Ipset_LV
    Iq_LV = K1_Iq_LV * (V_LV - Vf) + K2_Iq_LV * Iq0 + KQ_LV * Q0 / clip(Vf, _V_MIN, 10.0)
    return Ip_LV, Iq_LV


@stage("Ip_cmd", "Iq_cmd")
def current_limit(
    w: Any, Ip_n: Any, Iq_n: Any, Ip_LV: Any, Iq_LV: Any, Imax: Any, priority: Any, release: Any
) -> Any:
    """Choice of mode and current limit, (PV10); its two forms by priority."""
    Ip_u, Iq_u = (1.0 - w) * Ip_n + w * Ip_LV, (1.0 - w) * Iq_n + w * Iq_LV
    Iq_first = clip(Iq_u, -Imax, Imax)
    Ip_left = clip(Ip_u, 0.0, np.sqrt(clip(Imax * Imax - Iq_first * Iq_first, 0.0, Imax * Imax)))
    Ip_first = clip(Ip_u, 0.0, Imax)
    left = np.sqrt(clip(Imax * Imax - Ip_first * Ip_first, 0.0, Imax * Imax))
    Ip_cmd = (1.0 - priority) * Ip_left + priority * Ip_first
    Iq_cmd = (1.0 - priority) * Iq_first + priority * clip(Iq_u, -left, left)
    return release * Ip_cmd, release * Iq_cmd


@stage("d_Ip", "d_Iq")
def current_regulator(Ip: Any, Iq: Any, Ip_cmd: Any, Iq_cmd: Any, Tg: Any, RIp: Any, RIq: Any) -> Any:
    """Current regulator with limited rise, (PV11)."""
    d_Ip = (Ip_cmd - Ip) / Tg
    return select(d_Ip > RIp, RIp, d_Ip), clip((Iq_cmd - Iq) / Tg, -RIq, RIq)


def initialise(v: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
    """Equilibrium at V, P, Q: all derivatives zero with the dc link at rated voltage."""
    Ip0, Iq0 = v["P"] / v["V"], v["Q"] / v["V"]
    one = np.ones_like(Ip0)
    states = {
        "Vf": v["V"] * one, "Qf": v["Q"] * one, "W": one, "xdc": Ip0, "xq": Iq0, "Ip": Ip0, "Iq": Iq0,
    }  # fmt: skip
    setpoints = {"P0": v["P"] * one, "Q0": v["Q"] * one, "Ip0": Ip0, "Iq0": Iq0}
    feasible = (Ip0 >= 0) & (Ip0**2 + Iq0**2 <= v["Imax"] ** 2) & (v["V"] >= v["V_LV"])
    return states, setpoints, feasible


PV_PLANT = Device(
    name="pv_plant",
    title="Photovoltaic plant with low-voltage ride-through",
    candidates=relative_parameters(
        "pv_plant",
        """
        Tg       | T_g       | s    | 0.02 | > 0  | time constant of the current regulator
        Tm       | T_m       | s    | 0.02 | > 0  | time constant of the voltage measurement
        Tq       | T_q       | s    | 0.05 | > 0  | time constant of the reactive-power measurement
        Cdc      | C_dc      | s    | 0.10 | > 0  | dc-link time constant, twice the stored energy over rated power
        kpv      | k_pv      |      | 16   | >= 0 | curvature of the array's power over dc voltage
        KPdc     | K_Pdc     | pu   | 4.0  | >= 0 | proportional gain of the dc-voltage control
        KIdc     | K_Idc     | pu/s | 10   | >= 0 | integral gain of the dc-voltage control
        KPQ      | K_PQ      | pu   | 0.3  | >= 0 | proportional gain of the reactive-power control
        KIQ      | K_IQ      | pu/s | 8.0  | >= 0 | integral gain of the reactive-power control
        KQ_LV    | K_Q,LV    |      | 0.30 | >= 0 | reactive coefficient in low-voltage ride-through: share of Q kept
        K1_Iq_LV | K_1,Iq    |      | 2.0  | >= 0 | reactive current per voltage dip in ride-through
        K2_Iq_LV | K_2,Iq    |      | 0.5  | >= 0 | share of the pre-fault reactive current in ride-through
        K1_Ip_LV | K_1,Ip    |      | 0.6  | >= 0 | active current per voltage in ride-through
        K2_Ip_LV | K_2,Ip    |      | 0.3  | >= 0 | share of the pre-fault active current in ride-through
        Imax     | I_max     | pu   | 1.1  | > 0  | converter current limit
        RIp      | R_Ip      | pu/s | 3.0  | > 0  | upper limit of the rise of active current
        RIq      | R_Iq      | pu/s | 8.0  | > 0  | limit of the rate of reactive current
        """,
    ),
    constants=(
        Constant("V_LV", 0.9, "pu", "voltage below which ride-through begins"),
        Constant("dV_LV", 0.02, "pu", "band over which ride-through takes over"),
        Constant("Taw", 0.02, "s", "time constant of the anti-windup"),
        Constant("Ipset_LV", 0.0, "pu", "fixed part of the active current in ride-through"),
    ),
    states=("Vf", "Qf", "W", "xdc", "xq", "Ip", "Iq"),
    setpoints=("P0", "Q0", "Ip0", "Iq0"),
    stages=(
        terminal,
        reference,
        measurement,
        dc_link,
        conditions,
        outer_loops,
        ride_through,
        current_limit,
        current_regulator,
    ),
    initialise=initialise,
    ports={
        "Qref": "reference of the reactive power in pu",
        "Ip_cmd": "active-current command in pu",
        "Iq_cmd": "reactive-current command in pu",
        "w": "weight of the ride-through mode, 0 to 1",
        "priority": "priority of the current limit, 0: reactive, 1: active current first",
        "release": "share of the commands that is released, 0 to 1",
    },
    needs_angle=False,
    source="GB/T 32892-2016; WECC Solar Plant Dynamic Modeling Guidelines, 2014 (REGC_A)",
    grid=GridInterface(
        "current",
        source=(grid_source,),
        terminal=(terminal_power, phase_locked_loop),
        states=(("theta", "angle"),),
        constants=(
            Constant("f0", 60.0, "Hz", "nominal frequency"),
            Constant("KPLL", 30.0, "1/s", "gain of the phase-locked loop"),
        ),
    ),
)
