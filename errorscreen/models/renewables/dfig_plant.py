r"""DFIG wind plant with voltage control, virtual inertia and active-power control, 15 candidate parameters.

A reduced form of the type-3 model of Miller, Sanchez-Gasca, Price, Delmerico, "Dynamic modeling of GE 1.5 and 3.6
MW wind turbine-generators for stability simulations", IEEE PES General Meeting 2003, and of Clark, Miller,
Sanchez-Gasca, *Modeling of GE Wind Turbine-Generators for Grid Studies*, version 4.5, 2010: generator and converter
(E'' behind X''), electrical control, torque control, WindINERTIA and the frequency curve of active-power control.
One rotating mass; the pitch is fixed, so the aerodynamic power is constant over the seconds that are studied.

.. math::

    P &= V I_p,\quad Q = V (E'' - V) / X''                                            & (W1)\\
    \dot\vartheta &= K_{PLL}\,V_q/V,\quad \Delta f = \dot\vartheta / (2\pi f_0)          & (W2)\\
    T_R \dot V_f &= V - V_f,\quad T_{LP} \dot f_f = \Delta f - f_f                       & (W3)\\
    Q_c &= [K_{PV} (V_{rf} - V_f) + x_v]_{Q_{min}}^{Q_{max}},\quad \dot x_v = K_{IV}(V_{rf} - V_f) & (W4)\\
    \dot V_{ref} &= K_{QI}(Q_c - Q)                                                   & (W5)\\
    \dot E_c &= K_{VI}\,(V_{ref} - V - X_c (Q - Q_0)),\quad
    T_{CO}\dot E'' = [E_c]_{V \pm X'' I_{q,max}} - E''                                  & (W6)\\
    T_e &= K_{PT}(\omega_r - \omega_{ref}) + x_T,\quad \dot x_T = K_{IT}(\omega_r - \omega_{ref}),\quad
    T_{PC}\dot P_{ord} = \omega_r T_e - P_{ord}                                        & (W7)\\
    u &= [-f_f - d]^+ - [f_f - d_h]^+,\quad T_{WO}\dot x_w = u - x_w,\quad
    P_{wi} = [K_{WI}(u - x_w)]_{P_{wi,min}}^{P_{wi,max}}                                  & (W8)\\
    a &= 1 - (1 - p_{Fd})\,[(f_f - f_c)/(f_d - f_c)]_0^1                                & (W9)\\
    I_p^* &= [(a P_{ord} + P_{wi})/V]_0^{I_{p,max}\,\ell(V_f)},\quad
    \dot I_p = \min\big((I_p^* - I_p)/T_{CO},\ R_{IP}\big)                              & (W10)\\
    T_{jw}\,\dot\omega_r &= (P_0 - P)/\omega_r                                         & (W11)\\
    I &= C - V/(jX''),\quad C = \big(I_p + E''/(jX'')\big)\,e^{j\vartheta}                & (W12)

(W12) takes the place of (W1) in a simulated grid and behind the impedance of one: current and voltage source lie along
the frame of the phase-locked loop, so that (W1) holds once that has settled. :math:`\ell` in (W10) is the low-voltage
power logic: 0 below `zerox`, 1 above `brkpt`, linear between. The reactive droop :math:`X_c` in (W6), as Kc of the
generic plant controller REPC_A, gives the two integrators (W5), (W6) their damping when the terminal voltage is
imposed, as it is in playback. Integrators do not wind up: beyond their limits they decay with the time constant `Taw`.
Some typical values are ours, because playback of seconds asks for others than the cited reports: those have KPV 18 and
KIV 5, a slower frequency filter (1 s) and a wider dead band.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import back_calculate, clip, select, sincos
from errorscreen.models.device import Constant, Device, GridInterface, Values, relative_parameters
from errorscreen.models.grid_terminal import phase_locked_loop, terminal_power

_V_MIN = 0.05  # the divisions by V stop here


@stage("V", "P", "Q", "df", "d_theta")
def terminal(Epp: Any, Ip: Any, theta: Any, Vr: Any, Vi: Any, Xpp: Any, KPLL: Any, f0: Any) -> Any:
    """Injected power and measured frequency, (W1), (W2)."""
    V = np.sqrt(Vr * Vr + Vi * Vi)
    s, c = sincos(theta)
    d_theta = KPLL * (Vi * c - Vr * s) / clip(V, _V_MIN, 10.0)  # (W2)
    return V, V * Ip, V * (Epp - V) / Xpp, d_theta / (6.283185307179586 * f0), d_theta


@stage("Cr", "Ci")
def grid_source(Epp: Any, Ip: Any, theta: Any, Xpp: Any) -> Any:
    """Current beside the reactance X'', (W12)."""
    s, c = sincos(theta)
    return Ip * c + Epp * s / Xpp, Ip * s - Epp * c / Xpp


@stage("d_Vf", "d_ff")
def measurement(V: Any, df: Any, Vf: Any, ff: Any, TR: Any, TLPwi: Any) -> Any:
    """Filters of voltage and frequency, (W3)."""
    return (V - Vf) / TR, (df - ff) / TLPwi


@stage("Qcmd", "d_xv")
def voltage_regulator(Vf: Any, xv: Any, Vrf: Any, KPV: Any, KIV: Any, Qmin: Any, Qmax: Any, Taw: Any) -> Any:
    """Reactive-power command of the plant's voltage regulator, (W4)."""
    error = Vrf - Vf
    Qcmd = clip(KPV * error + clip(xv, Qmin, Qmax), Qmin, Qmax)
    return Qcmd, back_calculate(xv, KIV * error, Qmin, Qmax, Taw)


@stage("d_Vref", "d_Ecmd", "d_Epp")
def reactive_control(
    V: Any, Q: Any, Qcmd: Any, Vref: Any, Ecmd: Any, Epp: Any, Q0: Any,
    KQI: Any, KVI: Any, TCO: Any, Xpp: Any, Xc: Any, Vmin: Any, Vmax: Any, Iqmax: Any, Taw: Any,
) -> Any:  # fmt: skip
    """Reactive-power loop, terminal-voltage loop and converter, (W5), (W6)."""
    d_Vref = back_calculate(Vref, KQI * (Qcmd - Q), Vmin, Vmax, Taw)  # (W5)
    low, high = V - Xpp * Iqmax, V + Xpp * Iqmax
    error = clip(Vref, Vmin, Vmax) - V - Xc * (Q - Q0)
    d_Ecmd = back_calculate(Ecmd, KVI * error, low, high, Taw)  # (W6)
    return d_Vref, d_Ecmd, (clip(Ecmd, low, high) - Epp) / TCO


@stage("d_xT", "d_Pord")
def torque_control(
    wr: Any, xT: Any, Pord: Any, wref: Any, KPT: Any, KIT: Any, TPC: Any, Tmax: Any, Taw: Any
) -> Any:
    """Speed controller and power order, (W7)."""
    error = wr - wref
    torque = clip(KPT * error + clip(xT, 0.0, Tmax), 0.0, Tmax)
    return back_calculate(xT, KIT * error, 0.0, Tmax, Taw), (wr * torque - Pord) / TPC


@stage("Pwi", "d_xw")
def virtual_inertia(
    ff: Any, xw: Any, KWI: Any, Twowi: Any, dbwi: Any, dbwih: Any, Pwimin: Any, Pwimax: Any
) -> Any:
    """Response to low and, where it is enabled, to high frequency with washout, (W8)."""
    u = select(ff < -dbwi, -ff - dbwi, select(ff > dbwih, dbwih - ff, 0.0))
    return clip(KWI * (u - xw), Pwimin, Pwimax), (u - xw) / Twowi


@stage("apc")
def active_power_control(ff: Any, apcFd: Any, fc: Any, fd: Any) -> Any:
    """Reduction of power at high frequency, (W9)."""
    return (1.0 - (1.0 - apcFd) * clip((ff - fc) / (fd - fc), 0.0, 1.0),)


@stage("release")
def conditions(Ipmax: Any) -> Any:
    """Nothing is blocked; effects act on it."""
    return (0.0 * Ipmax + 1.0,)


@stage("Ip_cmd")
def active_current(
    V: Any, Vf: Any, Pord: Any, apc: Any, Pwi: Any, release: Any, Ipmax: Any, zerox: Any, brkpt: Any
) -> Any:
    """Active-current command with low-voltage power logic, first part of (W10), times the release, which is 1."""
    limit = Ipmax * clip((Vf - zerox) / (brkpt - zerox), 0.0, 1.0)
    return (release * clip((apc * Pord + Pwi) / clip(V, _V_MIN, 10.0), 0.0, limit),)


@stage("d_Ip", "d_wr")
def converter_and_rotor(P: Any, Ip: Any, Ip_cmd: Any, wr: Any, P0: Any, TCO: Any, RIP: Any, Tjw: Any) -> Any:
    """Active current with limited rise and rotor, second part of (W10), (W11)."""
    d_Ip = (Ip_cmd - Ip) / TCO
    return select(d_Ip > RIP, RIP, d_Ip), (P0 - P) / (wr * Tjw)


def initialise(v: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
    """Equilibrium at V, P, Q, angle and the rotor speed `wr0`: all derivatives zero."""
    one = np.ones_like(v["Xpp"])
    V, P, Q = v["V"] * one, v["P"] * one, v["Q"] * one
    Epp = V + Q * v["Xpp"] / V
    zero = 0.0 * one
    states = {
        "theta": v["angle"] * one, "Vf": V, "ff": zero, "xv": Q, "Vref": V, "Ecmd": Epp, "Epp": Epp,
        "xT": P / v["wr0"], "Pord": P, "xw": zero, "Ip": P / V, "wr": v["wr0"] * one,
    }  # fmt: skip
    setpoints = {"P0": P, "Q0": Q, "Vrf": V, "wref": v["wr0"] * one}
    ceiling = v["Ipmax"] * np.clip((V - v["zerox"]) / (v["brkpt"] - v["zerox"]), 0, 1)
    feasible = (
        (P >= 0) & (ceiling >= P / V) & (P / v["wr0"] <= v["Tmax"])
        & (v["Qmin"] <= Q) & (v["Qmax"] >= Q) & (np.abs(Q / V) <= v["Iqmax"])
        & (v["Vmin"] <= V) & (v["Vmax"] >= V)
    )  # fmt: skip
    return states, setpoints, feasible


DFIG_PLANT = Device(
    name="dfig_plant",
    title="DFIG wind plant with voltage control, virtual inertia and active-power control",
    candidates=relative_parameters(
        "dfig_plant",
        """
        KWI   | K_WI  | pu   | 10   | >= 0 | virtual inertia gain, power per frequency deviation
        TLPwi | T_LP  | s    | 0.2  | > 0  | low-pass of the frequency used by virtual inertia and power control
        TCO   | T_CO  | s    | 0.02 | > 0  | converter time constant
        Xpp   | X''   | pu   | 0.80 | > 0  | equivalent reactance
        KPV   | K_PV  | pu   | 2.5  | >= 0 | proportional gain of the voltage regulator
        KIV   | K_IV  | pu/s | 2.0  | >= 0 | integral gain of the voltage regulator
        KQI   | K_QI  | 1/s  | 0.2  | >= 0 | gain of the reactive-power loop, voltage per reactive power
        KVI   | K_VI  | 1/s  | 40   | >= 0 | gain of the terminal-voltage loop
        Tjw   | T_jw  | s    | 9.0  | > 0  | mechanical starting time of rotor and turbine, twice the inertia constant
        KPT   | K_PT  | pu   | 3.0  | >= 0 | proportional gain of the torque control
        KIT   | K_IT  | pu/s | 0.6  | >= 0 | integral gain of the torque control
        TPC   | T_PC  | s    | 0.05 | > 0  | time constant of the power order
        TR    | T_R   | s    | 0.02 | > 0  | time constant of the voltage measurement
        apcFd | p_Fd  | pu   | 0.4  | >= 0 | power setting at point d of the frequency control curve
        RIP   | R_IP  | pu/s | 5.0  | > 0  | upper limit of the rise of active current
        """,
    ),
    constants=(
        Constant("f0", 60.0, "Hz", "nominal frequency"),
        Constant("KPLL", 30.0, "1/s", "gain of the phase-locked loop"),
        Constant("Qmin", -0.436, "pu", "lower limit of the reactive-power command"),
        Constant("Qmax", 0.436, "pu", "upper limit of the reactive-power command"),
        Constant("Vmin", 0.85, "pu", "lower limit of the voltage reference"),
        Constant("Vmax", 1.15, "pu", "upper limit of the voltage reference"),
        Constant("Iqmax", 1.0, "pu", "limit of the reactive current"),
        Constant("Ipmax", 1.22, "pu", "limit of the active current"),
        Constant("Xc", 0.1, "pu", "reactive droop of the voltage control"),
        Constant("zerox", 0.4, "pu", "voltage below which no active current flows"),
        Constant("brkpt", 0.9, "pu", "voltage above which the active current is not reduced"),
        Constant("Twowi", 5.5, "s", "washout of the virtual inertia"),
        Constant("dbwi", 0.0005, "pu", "dead band of the virtual inertia"),
        Constant("dbwih", 1.0, "pu", "dead band towards high frequency; 1: acts at low frequency only"),
        Constant("Pwimin", 0.0, "pu", "lower limit of the virtual inertia"),
        Constant("Pwimax", 0.1, "pu", "limit of the virtual inertia"),
        Constant("fc", 0.001, "pu", "frequency deviation at point c, where power begins to fall"),
        Constant("fd", 0.02, "pu", "frequency deviation at point d"),
        Constant("Taw", 0.02, "s", "time constant of the anti-windup"),
        Constant("Tmax", 1.2, "pu", "limit of the torque"),
        Constant("wr0", 1.2, "pu", "rotor speed before the event"),
    ),
    states=("theta", "Vf", "ff", "xv", "Vref", "Ecmd", "Epp", "xT", "Pord", "xw", "Ip", "wr"),
    setpoints=("P0", "Q0", "Vrf", "wref"),
    stages=(
        terminal,
        measurement,
        voltage_regulator,
        reactive_control,
        torque_control,
        virtual_inertia,
        active_power_control,
        conditions,
        active_current,
        converter_and_rotor,
    ),
    initialise=initialise,
    ports={
        "d_theta": "angular speed of the phase-locked loop against the nominal frequency in rad/s",
        "df": "frequency deviation that the phase-locked loop measures in pu",
        "Qcmd": "reactive-power command in pu",
        "Ip_cmd": "active-current command in pu",
        "Pwi": "power of the virtual inertia in pu",
        "release": "share of the active current that is released, 0 to 1",
    },
    needs_angle=True,
    source="Clark, Miller, Sanchez-Gasca, Modeling of GE Wind Turbine-Generators for Grid Studies, v4.5, 2010",
    grid=GridInterface("norton", source=(grid_source,), terminal=(terminal_power, phase_locked_loop)),
)
