r"""WTTQA1, WTPTA1, WTARA1 and WTDTA1: torque, pitch, aerodynamics and drive train of a wind turbine (WECC WTGTRQ_A,
WTGPT_A, WTGAR_A, WTGT_A).

Torque control, with the speed :math:`f` of a table of four points, constant beyond its ends:

.. math::

    T_p\,\dot P_f &= P - P_f,\quad T_{wref}\,\dot\omega_{ref} = f(P_f) - \omega_{ref}                    & (1)\\
    e &= (P_{ref} - P_f)/\omega_g\ \text{if Tflag, else}\ \omega_g - \omega_{ref},\quad
    P_{set} = \omega_g\,\Big[\Big(K_{pp} + \frac{K_{ip}}{s}\Big) e\Big]_{Temin}^{Temax}                 & (2)

Pitch control:

.. math::

    \theta_w &= \Big[\Big(K_{pw} + \frac{K_{iw}}{s}\Big)
        \big(\omega_t - \omega_{ref} + K_{cc}(P_{ord} - P_{ref})\big)\Big]_{\theta min}^{\theta max},\quad
    \theta_c = \Big[\Big(K_{pc} + \frac{K_{ic}}{s}\Big)(P_{ord} - P_{ref})\Big]_{\theta min}^{\theta max}  & (3)\\
    T_p\,\dot\theta &= \theta_w + \theta_c - \theta,\quad
    R_{\theta min} \le \dot\theta \le R_{\theta max},\quad \theta_{min} \le \theta \le \theta_{max}      & (4)

Aerodynamics and drive train:

.. math::

    P_m &= P_{m0} - K_a\,\theta\,(\theta - \theta_0)                                                  & (5)\\
    2H_t\,\dot\omega_t &= P_m/\omega_t - T_s - D_s(\omega_t - \omega_g),\quad
    \dot T_s = K_s(\omega_t - \omega_g)                                                                & (6)\\
    2H_g\,\dot\omega_g &= T_s + D_s(\omega_t - \omega_g) - P/\omega_g - D(\omega_g - \omega_0)           & (7)\\
    H_t &= H_{tfrac} H,\quad H_g = H - H_t,\quad K_s = 2 H_t H_g\,(2\pi f_1)^2 / H                       & (8)

With Htfrac = 0 or 1 there is one mass H of one speed. :math:`\omega_0` is the speed at the start: that of (1), and 1
without torque control. :math:`P_{ref}` comes from the control of the plant and is the power at the start without one.
The integral of (2) holds during a dip of the electrical control. At the start the pitch is Theta0 and all of it stands
in :math:`\theta_w`.

Powers of the torque control are in per unit of the turbine's rating TRATE in MW, or of the machine's base where that is
0 (`errorscreen.models.rating`): with :math:`\rho` for TRATE over the machine's base, :math:`P/\rho` and
:math:`P_{ref}/\rho` stand for P and :math:`P_{ref}` in (1) and (2), and :math:`\rho P_{set}` is the order.

(WECC, *Second Generation of Wind Turbine Models*, 2014; WECC, *Wind Plant Dynamic Modeling Guidelines*; PSS/E model
library, WTTQA1, WTPTA1, WTARA1 and WTDTA1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import lag, limited_pi, longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record
from errorscreen.models.rating import rating
from errorscreen.models.renewables.reec import four_points

_TWO_PI = 6.283185307179586
#: speeds that divide are at least this
_SLOWEST = 0.01


@stage("Pset", "wref", "integral", "d_Pf", "d_xw")
def torque_control(
    Pref: Any, P: Any, wg: Any, Pf: Any, xw: Any, xT: Any, lowT: Any, highT: Any, rated: Any, Tflag: Any, Kpp: Any,
    Kip: Any, Tp: Any, Twref: Any, p1: Any, spd1: Any, p2: Any, spd2: Any, p3: Any, spd3: Any, p4: Any, spd4: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Order of power for the electrical control, and reference of speed, (1), (2)."""
    Pm, d_Pf = lag(Pf, P / rated, Tp, shortest)
    wref, d_xw = lag(xw, four_points(Pm, p1, spd1, p2, spd2, p3, spd3, p4, spd4), Twref, shortest)
    error = select(Tflag == 1.0, (Pref / rated - Pm) / clip(wg, _SLOWEST, 10.0), wg - wref)
    torque, integral = limited_pi(xT, error, Kpp, Kip, lowT, highT)
    return rated * (torque * wg), wref, integral, d_Pf, d_xw


@stage("d_xT")
def torque_integral(integral: Any, dip: Any) -> Any:
    """Integral of (2), which holds during a dip."""
    return (select(dip > 0.0, 0.0, integral),)


def start_torque(v: Values) -> Start:
    """Equilibrium at the power of the start: its speed, and the torque that the electrical control needs."""
    rated = rating(v)
    P = v["P"] / rated + 0.0 * v["p1"]
    w = four_points(P, *(v[f"{quantity}{k}"] for k in range(1, 5) for quantity in ("p", "spd")))
    torque = v["Pref0"] / rated / (w * np.where(v["by_speed"] == 1, w, 1.0))
    lowT, highT = holding(torque, v["Temin"], v["Temax"])
    return Start(
        {"Pf": P, "xw": w, "xT": torque},
        {"wg0": w, "lowT": lowT, "highT": highT, "rated": rated + 0.0 * P},
        (Limit("torque", torque, v["Temin"], v["Temax"], ("Temin", "Temax")),),
    )


WTTQA1 = Part(
    name="WTTQA1",
    slot="torque_control",
    title="Torque control of a wind turbine",
    fields=record(
        """
        Tflag | code | 0    | -          | 0, 1 | 1: error of power, 0: of speed
        Kpp   | pu   | 3    | 1 .. 10 unless 0    | >= 0 | torque control, proportional
        Kip   | pu/s | 0.6  | 0.1 .. 5 unless 0   | >= 0 | torque control, integral
        Tp    | s    | 0.05 | 0.01 .. 0.5 unless 0 | >= 0 | filter of the power
        Twref | s    | 30   | 5 .. 60 unless 0    | >= 0 | lag of the reference of speed
        Temax | pu   | 1.2  | limit      | any  | upper limit of the torque
        Temin | pu   | 0    | limit      | any  | lower limit of the torque
        p1    | pu   | 0.2  | -          | any  | power of point 1
        spd1  | pu   | 0.69 | -          | > 0  | speed of point 1
        p2    | pu   | 0.4  | -          | any  | power of point 2
        spd2  | pu   | 0.78 | -          | > 0  | speed of point 2
        p3    | pu   | 0.6  | -          | any  | power of point 3
        spd3  | pu   | 0.98 | -          | > 0  | speed of point 3
        p4    | pu   | 0.74 | -          | any  | power of point 4
        spd4  | pu   | 1.2  | -          | > 0  | speed of point 4
        TRATE | MW   | 0    | - unless 0 | >= 0 | rating of the turbine, base of its powers; 0: the machine's base
        """
    ),
    stages=(torque_control,),
    closing=(torque_integral,),
    ports=("Pset", "wref", "wg0"),
    states=("Pf", "xw", "xT"),
    setpoints=("wg0", "lowT", "highT", "rated"),
    start=start_torque,
    rules=("Temin < Temax", "p1 <= p2 <= p3 <= p4"),
    formula="(1), (2)",
    source="WECC WTGTRQ_A; PSS/E model library, WTTQA1",
    aliases=("WTTQAU1",),
)


@stage("theta")
def pitch_angle(xt: Any, lowA: Any, highA: Any) -> Any:
    """Angle of the blades."""
    return (clip(xt, lowA, highA),)


@stage("d_xs", "d_xc", "d_xt")
def pitch_control(
    wt: Any, wref: Any, Pord: Any, Pref: Any, xs: Any, xc: Any, xt: Any, lowA: Any, highA: Any, Kiw: Any, Kpw: Any,
    Kic: Any, Kpc: Any, Kcc: Any, Tp: Any, RThetamax: Any, RThetamin: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Control of speed and power by the pitch, (3), (4)."""
    excess = Pord - Pref
    by_speed, d_xs = limited_pi(xs, wt - wref + Kcc * excess, Kpw, Kiw, lowA, highA)
    by_power, d_xc = limited_pi(xc, excess, Kpc, Kic, lowA, highA)
    rate = clip((by_speed + by_power - xt) / longer(Tp, shortest), RThetamin, RThetamax)
    inside = clip(xt, lowA, highA)
    return d_xs, d_xc, hold_at_limits(xt, rate, lowA, highA) + (inside - xt) / shortest


def start_pitch(v: Values) -> Start:
    """Equilibrium at the angle of the aerodynamics."""
    theta, zero = v["theta0"] + 0.0 * v["Tp"], 0.0 * v["Tp"]
    low, high = holding(theta, v["Thetamin"], v["Thetamax"])
    low, high = holding(zero, low, high)
    return Start(
        {"xs": theta, "xc": zero, "xt": theta},
        {"lowA": low, "highA": high},
        (Limit("pitch", theta, v["Thetamin"], v["Thetamax"], ("Thetamin", "Thetamax")),),
    )


WTPTA1 = Part(
    name="WTPTA1",
    slot="pitch_control",
    title="Pitch control of a wind turbine",
    fields=record(
        """
        Kiw       | deg/s | 25  | 5 .. 100 unless 0  | >= 0 | control of speed, integral, per pu
        Kpw       | deg   | 150 | 20 .. 300 unless 0 | >= 0 | control of speed, proportional, per pu
        Kic       | deg/s | 30  | 5 .. 100 unless 0  | >= 0 | control of power, integral, per pu
        Kpc       | deg   | 3   | 0.5 .. 20 unless 0 | >= 0 | control of power, proportional, per pu
        Kcc       | pu    | 0   | -                  | any  | power in the control of speed
        Tp        | s     | 0.3 | 0.05 .. 1 unless 0 | >= 0 | lag of the blades
        Thetamax  | deg   | 27  | limit              | any  | upper limit of the angle
        Thetamin  | deg   | 0   | limit              | any  | lower limit of the angle
        RThetamax | deg/s | 10  | limit              | > 0  | upper rate of the angle
        RThetamin | deg/s | -10 | limit              | any  | lower rate of the angle
        """
    ),
    stages=(pitch_angle,),
    closing=(pitch_control,),
    ports=("theta",),
    states=("xs", "xc", "xt"),
    setpoints=("lowA", "highA"),
    start=start_pitch,
    rules=("Thetamin < Thetamax", "RThetamin < RThetamax"),
    formula="(3), (4)",
    source="WECC WTGPT_A; PSS/E model library, WTPTA1",
    aliases=("WTPTAU1",),
)


@stage("Pm")
def aerodynamics(theta: Any, Pm0: Any, Ka: Any, Theta0: Any) -> Any:
    """Mechanical power, (5)."""
    return (Pm0 - Ka * theta * (theta - Theta0),)


def start_aerodynamics(v: Values) -> Start:
    """Mechanical power is the electrical one, at the angle of the record."""
    return Start({}, {"Pm0": v["P"], "theta0": v["Theta0"]})


WTARA1 = Part(
    name="WTARA1",
    slot="aerodynamics",
    title="Aerodynamics of a wind turbine",
    fields=record(
        """
        Ka     | pu/deg | 0.007 | 0.003 .. 0.02 unless 0 | >= 0 | power per angle and its deviation
        Theta0 | deg    | 0     | -                      | any  | angle of the blades at the start
        """
    ),
    stages=(aerodynamics,),
    ports=("Pm", "theta0"),
    setpoints=("Pm0", "theta0"),
    start=start_aerodynamics,
    formula="(5)",
    source="WECC WTGAR_A; PSS/E model library, WTARA1",
    aliases=("WTARAU1",),
)


@stage("d_wt", "d_wg", "d_Ts")
def drive_train(
    Pm: Any,
    P: Any,
    wt: Any,
    wg: Any,
    Ts: Any,
    wg0: Any,
    H: Any,
    DAMP: Any,
    Htfrac: Any,
    Freq1: Any,
    Dshaft: Any,
) -> Any:
    """Two masses and the shaft between them, or one mass, (6) to (8)."""
    two = (Htfrac > 0.0) & (Htfrac < 1.0)
    share = select(two, Htfrac, 0.5)
    Ht, Hg = share * H, (1.0 - share) * H
    mode = _TWO_PI * Freq1
    shaft = Ts + Dshaft * (wt - wg)
    driving, braking = Pm / clip(wt, _SLOWEST, 10.0), P / clip(wg, _SLOWEST, 10.0) + DAMP * (wg - wg0)
    together = (driving - braking) / (2.0 * H)
    return (
        select(two, (driving - shaft) / (2.0 * Ht), together),
        select(two, (shaft - braking) / (2.0 * Hg), together),
        select(two, 2.0 * Ht * Hg * mode * mode / H * (wt - wg), 0.0),
    )


def start_drive_train(v: Values) -> Start:
    """Equilibrium at the speed of the torque control."""
    return Start({"wt": v["wg0"], "wg": v["wg0"], "Ts": v["P"] / v["wg0"]}, {})


WTDTA1 = Part(
    name="WTDTA1",
    slot="drive_train",
    title="Drive train of a wind turbine",
    fields=record(
        """
        H      | s  | 4.94  | 2 .. 8             | > 0  | inertia of turbine and generator
        DAMP   | pu | 0     | -                  | >= 0 | torque of the generator per deviation of its speed
        Htfrac | pu | 0.875 | - unless 0         | 0 .. 1 | share of the turbine in the inertia; 0: one mass
        Freq1  | Hz | 1.8   | 0.5 .. 4 unless 0  | >= 0 | first mode of the shaft
        Dshaft | pu | 1.5   | 0.3 .. 5 unless 0  | >= 0 | damping of the shaft
        """
    ),
    stages=(),
    closing=(drive_train,),
    ports=("wt", "wg"),
    states=("wt", "wg", "Ts"),
    start=start_drive_train,
    formula="(6) to (8)",
    source="WECC WTGT_A; PSS/E model library, WTDTA1",
    aliases=("WTDTAU1",),
)
