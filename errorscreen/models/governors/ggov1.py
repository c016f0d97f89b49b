r"""GGOV1, general governor and turbine: gas turbines, combined cycles, diesel engines and simple steam turbines.

A PID governor, a load limiter and an acceleration control each ask for a stroke; the valve gets the lowest:

.. math::

    e &= [P_{ref} + m - \Delta\omega - R f]\ \text{behind the dead band DB, in}\ \text{MINERR .. MAXERR}       & (1)\\
    y_n &= K_{PGOV} e + z_n + d,\quad d = \frac{s K_{DGOV}}{1 + s T_{DGOV}} e,\quad
    \dot z_n = \frac{K_{IGOV}}{K_{PGOV}} (y - d - z_n)                                           & (2)\\
    y_t &= \min(1, K_{PLOAD}\varepsilon + z_t),\quad
    \varepsilon = \frac{L_{DREF}}{K_{TURB}} + W_{FNL} - \tau,\quad
    \dot z_t = \frac{K_{ILOAD}}{K_{PLOAD}} (y - z_t)                                            & (3)\\
    y_a &= z_a + K_A \Delta t\,(A_{SET} - a),\quad a = \frac{s}{1 + s T_A}\omega,\quad
    \Delta t\,\dot z_a = y - z_a                                                              & (4)\\
    y &= \min(y_n, y_t, y_a),\quad V_{MIN} \le y \le V_{MAX}                                       & (5)\\
    \dot v &= (y - v)/T_{ACT},\quad R_{CLOSE} \le \dot v \le R_{OPEN},\quad
    w = v\,\omega\ \text{with FLAG = 1},\ \text{else}\ v                                            & (6)\\
    P_m &= \frac{1 + s T_C}{1 + s T_B}\,e^{-s T_{ENG}} K_{TURB} (w - W_{FNL}) - [D_M]^+ \Delta\omega        & (7)\\
    \tau &= \frac{1}{1 + s T_{FLOAD}}\,\frac{1 + s T_{SA}}{1 + s T_{SB}}\,w\,\omega^{[D_M]^-}             & (8)\\
    \dot m &= K_{IMW} (P_{set} - P_f),\ |m| \le 1.1 R,\quad (1 + s T_{PELEC}) P_f = P                    & (9)

The droop f is P_f with RSELECT = 1, the stroke v with -1, the request y with -2, and 0 without droop; the loop that -2
closes is solved.

What the sources leave open, and what this model does:

- The integrators in (2) and (3) follow the stroke that the valve gets. While a controller has the lowest request this
  is its integral :math:`K_I e`, and otherwise it does not wind up. With a proportional gain of zero, or one that gives
  a reset time below the step, they are plain integrators that stop at the limits.
- PSS/E puts the step of its simulation into (4). With the shortest time constant of the step as :math:`\Delta t` the
  request rises by at most :math:`K_A (A_{SET} - a)` in a second, whatever the step is. K_A = 0 switches it off.
- The delay TENG is a Padé approximation of second order.
- D_M > 0 counts from nominal speed, so that LDREF is a power at nominal speed.
- RUP and RDOWN limit changes of LDREF, which is constant here.
- Powers of the record are in per unit of the turbine's rating TRATE in MW, or of the machine's base where that is 0
  (`errorscreen.models.rating`): with :math:`\rho` for TRATE over the machine's base, :math:`P/\rho` stands for P in
  (9), and :math:`\rho P_m` is what drives the machine.

(PSS/E model library, GGOV1; IEEE PES-TR1, *Dynamic Models for Turbine-Governors in Power System Studies*, 2013, section
3.1.2.3.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, power, select
from errorscreen.models.blocks import dead_band, lag, lead_lag, longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record
from errorscreen.models.rating import rating

FIELDS = record(
    """
    RSELECT | code | 1   | -  | -2, -1, 0, 1 | droop by 1: power, -1: valve stroke, -2: governor output; 0: none
    FLAG    | code | 0    | -           | 0, 1 | 1: fuel flow proportional to the speed
    R       | pu   | 0.04 | 0.02 .. 0.1 | >= 0 | permanent droop
    TPELEC  | s    | 1.0  | -           | >= 0 | time constant of the measured power
    MAXERR  | pu   | 0.05 | limit       | >= 0 | upper limit of the speed error
    MINERR  | pu   | -0.05 | limit      | <= 0 | lower limit of the speed error
    KPGOV   | pu   | 10.0 | 2 .. 30     | >= 0 | proportional gain of the governor
    KIGOV   | pu/s | 2.0  | 0.2 .. 10   | >= 0 | integral gain of the governor
    KDGOV   | pu s | 0.0  | -           | >= 0 | derivative gain of the governor
    TDGOV   | s    | 1.0  | -           | >= 0 | lag of the derivative
    VMAX    | pu   | 1.0  | limit       | any  | upper limit of the valve
    VMIN    | pu   | 0.15 | limit       | any  | lower limit of the valve
    TACT    | s    | 0.5  | 0.1 .. 1    | >= 0 | time constant of the actuator
    KTURB   | pu   | 1.5  | -           | > 0  | gain of the turbine
    WFNL    | pu   | 0.2  | -           | any  | fuel flow at no load
    TB      | s    | 0.1  | 0.05 .. 1   | >= 0 | lag of the turbine
    TC      | s    | 0.0  | -           | >= 0 | lead of the turbine
    TENG    | s    | 0.0  | -           | >= 0 | transport delay of an engine
    TFLOAD  | s    | 3.0  | -           | >= 0 | time constant of the load limiter
    KPLOAD  | pu   | 2.0  | -           | >= 0 | proportional gain of the load limiter
    KILOAD  | pu/s | 0.67 | -           | >= 0 | integral gain of the load limiter
    LDREF   | pu   | 1.0  | limit       | any  | power that the load limiter allows
    DM      | pu   | 0.0  | -           | any  | damping of the turbine; < 0: exponent of the speed at the load limit
    ROPEN   | pu/s | 0.1  | limit       | > 0  | limit of the opening rate
    RCLOSE  | pu/s | -0.1 | limit       | <= 0 | limit of the closing rate, negative
    KIMW    | pu/s | 0.0  | -           | >= 0 | gain of the power controller
    ASET    | pu/s | 0.01 | -           | >= 0 | acceleration that the control allows
    KA      | pu   | 10.0 | -           | >= 0 | gain of the acceleration control
    TA      | s    | 0.1  | -           | >= 0 | lag of the acceleration control
    TRATE   | MW   | 0.0  | - unless 0  | >= 0 | rating of the turbine, base of its powers; 0: the machine's base
    DB      | pu   | 0.0  | -           | >= 0 | half width of the dead band of the speed error
    TSA     | s    | 4.0  | -           | >= 0 | lead of the temperature's measurement
    TSB     | s    | 5.0  | -           | >= 0 | lag of the temperature's measurement
    RUP     | pu/s | 99.0 | -           | any  | rate of load limit increase; the limit is constant here
    RDOWN   | pu/s | -99.0 | -          | any  | rate of load limit decrease; the limit is constant here
    """
)


@register_jitable
def _lower(a: Any, b: Any) -> Any:
    return select(a < b, a, b)


@register_jitable
def _integral(
    z: Any, error: Any, follow: Any, KP: Any, KI: Any, lower: Any, upper: Any, shortest: Any
) -> Any:  # fmt: skip
    """Derivative of the integrator of a controller, beside others, as in (2) and (3)."""
    resets = KI * shortest < KP
    plain = hold_at_limits(z, KI * error, lower, upper)
    return select(resets, KI / select(resets, KP, 1.0) * (follow - z), plain)


@stage("Pf", "d_pf", "d_m")
def measured_power(
    P: Any, pf: Any, m: Any, R: Any, TPELEC: Any, KIMW: Any, Pset: Any, rated: Any, shortest: Any
) -> Any:  # fmt: skip
    """Measured power and the power controller, (9)."""
    Pf, d_pf = lag(pf, P / rated, TPELEC, shortest)
    return Pf, d_pf, hold_at_limits(m, KIMW * (Pset - Pf), -1.1 * R, 1.1 * R)


@stage("tau", "d_ts", "d_tx", "fuel")
def temperature(
    omega: Any, v: Any, ts: Any, tx: Any, FLAG: Any, DM: Any, TFLOAD: Any, TSA: Any, TSB: Any, shortest: Any
) -> Any:  # fmt: skip
    """Fuel flow and the measured exhaust temperature, (6) and (8)."""
    fuel = v * select(FLAG == 1.0, omega, 1.0)
    led, d_ts = lead_lag(ts, fuel * power(omega, select(DM < 0.0, DM, 0.0)), TSA, TSB, shortest)
    return tx, d_ts, (led - tx) / longer(TFLOAD, shortest), fuel


@stage("y", "d_zn", "d_xd", "d_zt", "d_za", "d_xa")
def controllers(
    omega: Any, Pf: Any, m: Any, tau: Any, v: Any, zn: Any, xd: Any, zt: Any, za: Any, xa: Any, Pref: Any, load: Any,
    top: Any, low: Any, high: Any, RSELECT: Any, R: Any, MAXERR: Any, MINERR: Any, KPGOV: Any, KIGOV: Any, KDGOV: Any,
    TDGOV: Any, KPLOAD: Any, KILOAD: Any, ASET: Any, KA: Any, TA: Any, DB: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Stroke that the valve gets, and the states of the three controllers, (1) to (5)."""
    speed = omega - 1.0
    lead = KDGOV / longer(TDGOV, shortest)
    rest = zn - lead * xd
    loop = RSELECT == -2.0
    f = select(RSELECT == 1.0, Pf, select(RSELECT == -1.0, v, select(loop, rest, 0.0)))
    slope = 1.0 + select(loop, R * (KPGOV + lead), 0.0)
    # with RSELECT = -2 the request falls with the droop of its own stroke: a straight line between the limits of e
    e = clip(dead_band(Pref + m - speed - R * f, DB) / slope, MINERR, MAXERR)
    governor = rest + (KPGOV + lead) * e
    error = load - tau
    limiter = _lower(top, KPLOAD * error + zt)
    d_xa = (speed - xa) / longer(TA, shortest)
    acceleration = select(KA > 0.0, za + KA * shortest * (ASET - d_xa), 1e9)
    y = clip(_lower(governor, _lower(limiter, acceleration)), low, high)
    # the same stroke is the lowest request if another controller makes it, but then the droop is that of this stroke
    e = select(loop, clip(dead_band(Pref + m - speed - R * y, DB), MINERR, MAXERR), e)
    d = lead * (e - xd)
    return (
        y,
        _integral(zn, e, y - d, KPGOV, KIGOV, low, high, shortest),
        (e - xd) / longer(TDGOV, shortest),
        _integral(zt, error, y, KPLOAD, KILOAD, low, top, shortest),
        (y - za) / shortest,
        d_xa,
    )


@stage("Pm", "d_v", "d_dp", "d_dq", "d_xt")
def turbine(
    omega: Any, y: Any, v: Any, fuel: Any, dp: Any, dq: Any, xt: Any, TACT: Any, ROPEN: Any, RCLOSE: Any, KTURB: Any,
    WFNL: Any, TB: Any, TC: Any, TENG: Any, DM: Any, rated: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Actuator, transport delay and turbine, (6) and (7).

    The delay is (1 - T s / 2 + T² s² / 12) / (1 + T s / 2 + T² s² / 12), of at least two shortest time constants.
    """
    d_v = clip((y - v) / longer(TACT, shortest), RCLOSE, ROPEN)
    given = KTURB * (fuel - WFNL)
    T = longer(TENG, 2.0 * shortest)
    late = select(2.0 * shortest > TENG, given, given - 12.0 * dp)
    turned, d_xt = lead_lag(xt, late, TC, TB, shortest)
    Pm = turned - select(DM > 0.0, DM, 0.0) * (omega - 1.0)
    return rated * Pm, d_v, (given - 6.0 * dp - 12.0 * dq) / T, dp / T, d_xt


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0 with the governor in control."""
    rated = rating(v)
    power, measured, zero = v["Pm0"] / rated, v["P"] / rated, 0.0 * v["Pm0"]
    stroke = power / v["KTURB"] + v["WFNL"]
    low, high = holding(stroke, v["VMIN"], v["VMAX"])
    top = np.maximum(1.0, stroke)
    # a load limiter that cannot follow the stroke rests at its upper end, unless the load is at its limit
    follows = (v["KPLOAD"] > v["KILOAD"] * v["shortest"]) & (v["KILOAD"] > 0)
    at_limit = (power >= v["LDREF"]) & (v["KILOAD"] > 0)
    select_one = [v["RSELECT"] == 1.0, v["RSELECT"] == 0.0]
    return Start(
        {
            "pf": measured, "m": zero, "zn": stroke, "xd": zero, "zt": np.where(follows | at_limit, stroke, top),
            "za": stroke, "xa": zero, "v": stroke, "ts": stroke, "tx": stroke,
            "dp": zero, "dq": power / 12.0, "xt": power,
        },
        {
            "Pref": v["R"] * np.select(select_one, [measured, zero], stroke),
            "Pset": measured,
            "load": np.maximum(v["LDREF"], power) / v["KTURB"] + v["WFNL"],
            "top": top,
            "low": low,
            "high": high,
            "rated": rated + zero,
        },
        (
            Limit("valve", stroke, v["VMIN"], v["VMAX"], ("VMIN", "VMAX")),
            Limit("load", power, -np.inf, v["LDREF"], ("", "LDREF")),
        ),
    )  # fmt: skip


GGOV1 = Part(
    name="GGOV1",
    slot="governor",
    title="General governor and turbine",
    fields=FIELDS,
    stages=(measured_power, temperature, controllers, turbine),
    ports=("Pm",),
    states=("pf", "m", "zn", "xd", "zt", "za", "xa", "v", "ts", "tx", "dp", "dq", "xt"),
    setpoints=("Pref", "Pset", "load", "top", "low", "high", "rated"),
    start=start,
    rules=("VMIN < VMAX", "TC needs TB", "TSA needs TSB", "KDGOV needs TDGOV", "RCLOSE < ROPEN"),
    formula="y = min(PID of the speed error, PI of the load limit, acceleration control); "
    "Pm = (1 + s TC) / (1 + s TB) · e^(−s TENG) · KTURB (v − WFNL), v = y behind the actuator",
    source="PSS/E model library, GGOV1; IEEE PES-TR1, 2013",
    gate="v",
)
