r"""DERA1, aggregate of distributed resources (WECC DER_A).

With V, P and the frequency deviation behind the filters Trv, Tp and Trf:

.. math::

    I_{qv} &= \big[K_{qv}\,\mathrm{db}(V_{ref0} - V_f)\big]_{Iql}^{Iqh},\quad
    I_q^* = \Big[\frac{Q_{ref}/V_f}{1 + sT_{iq}} + I_{qv}\Big]_{\pm I_{qmax}},\quad
    Q_{ref} = P_f\tan\varphi_0\ \text{if PfFlag, else}\ Q_{ext}                                        & (1)\\
    P^* &= \Big[\Big(K_{pg} + \frac{K_{ig}}{s}\Big)\big[P_{ref} - P_f + [D_{dn} u]^- + [D_{up} u]^+\big]_{femin}^{femax}
        \Big]_{Pmin}^{Pmax}\ \text{if FreqFlag, else}\ P_{ref},\quad u = \mathrm{db}(-\Delta f_f)         & (2)\\
    T_{pord}\,\dot P_{ord} &= P^* - P_{ord},\quad dP_{min} \le \dot P_{ord} \le dP_{max},\quad
    P_{min} \le P_{ord} \le P_{max},\quad I_p^* = [P_{ord}/V_f]_{Ipmin}^{Ipmax}                         & (3)\\
    T_g\,\dot I_p &= m I_p^* - I_p,\quad \dot I_p \le r_{rpwr},\quad T_g\,\dot I_q = m I_q^* - I_q,\quad
    P = V I_p,\quad Q = V I_q                                                                          & (4)\\
    T_v\,\dot m &= m_l m_h m_f - m                                                                     & (5)\\
    m_l &= \frac{(V_n - V_{l0}) + V_{rfrac}(V_x - V_n)}{V_{l1} - V_{l0}},\quad V_x = [V_f]_{Vl0}^{Vl1},\quad
    V_n = \min(V_{min}, V_x)                                                                           & (6)

The limits of the currents share Imax, the active current first with PQFlag = 1; Ipmin is 0 with GenFlag = 1 and -Ipmax
for storage. :math:`V_{min}` is the lowest voltage since the voltage has been below Vl1 for the time tvl1, and Vl1
before: of what that took out, the share Vrfrac returns. Below Vl0 for the time tvl0 nothing remains. :math:`m_h` is the
same for high voltage. :math:`m_f` becomes 0 for good with the frequency below fl for tfl or above fh for tfh, while the
voltage is at least Vpr. VtripFlag and FtripFlag switch these on; a pair of voltages in the wrong order has no trip.
The place of the multiplier m before the lag Tg, and that of the limits of rate at the lag Tpord, are our reading of the
specification. Vref0 = 0 is the voltage at the start. The source impedance of that specification is not in the record.

(P. Pourbeik, *Proposal for DER_A Model*, WECC REMTF, 2019; EPRI, *The New Aggregated Distributed Energy Resources
(der_a) Model for Transmission Planning Studies*, 2019; PSS/E model library, DERA1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import lag, limited_pi, longer
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Limit, Part, Start, Values, holding, record
from errorscreen.models.renewables.behind import along_terminal, voltage_behind
from errorscreen.models.renewables.reec import dead_band_between, injection

FIELDS = record(
    """
    PfFlag    | code | 1     | -                    | 0, 1 | 1: power factor, 0: reactive power
    FreqFlag  | code | 0     | -                    | 0, 1 | 1: control of frequency
    PQFlag    | code | 0     | -                    | 0, 1 | first: 1 active, 0 reactive current
    GenFlag   | code | 1     | -                    | 0, 1 | 1: generation, 0: storage
    VtripFlag | code | 1     | -                    | 0, 1 | 1: trip by voltage
    FtripFlag | code | 1     | -                    | 0, 1 | 1: trip by frequency
    Trv       | s    | 0.02  | -                    | >= 0 | filter of the voltage
    Trf       | s    | 0.02  | -                    | >= 0 | filter of the frequency
    dbd1      | pu   | -0.05 | -                    | <= 0 | lower edge of the dead band of voltage
    dbd2      | pu   | 0.05  | -                    | >= 0 | upper edge of the dead band of voltage
    Kqv       | pu   | 5     | 1 .. 10 unless 0     | >= 0 | reactive current per voltage beyond the dead band
    Vref0     | pu   | 0     | - unless 0           | >= 0 | reference of the voltage; 0: that of the start
    Tp        | s    | 0.02  | -                    | >= 0 | filter of the power
    Tiq       | s    | 0.02  | 0.01 .. 0.2 unless 0 | >= 0 | lag of the reactive current
    Ddn       | pu   | 20    | 5 .. 50 unless 0     | >= 0 | power per frequency above the nominal one
    Dup       | pu   | 0     | 5 .. 50 unless 0     | >= 0 | power per frequency below the nominal one
    fdbd1     | pu   | -6e-4 | -                    | <= 0 | lower edge of the dead band of frequency
    fdbd2     | pu   | 6e-4  | -                    | >= 0 | upper edge of the dead band of frequency
    femax     | pu   | 99    | limit                | >= 0 | upper limit of the error of power
    femin     | pu   | -99   | limit                | <= 0 | lower limit of the error of power
    Pmax      | pu   | 1.1   | limit                | any  | upper limit of power
    Pmin      | pu   | 0     | limit                | any  | lower limit of power
    dPmax     | pu/s | 99    | limit                | > 0  | upper rate of power
    dPmin     | pu/s | -99   | limit                | any  | lower rate of power
    Tpord     | s    | 0.02  | 0.01 .. 5 unless 0   | >= 0 | lag of the power order
    Kpg       | pu   | 0.1   | -                    | >= 0 | control of power, proportional
    Kig       | pu/s | 10    | -                    | >= 0 | control of power, integral
    Imax      | pu   | 1.2   | 1 .. 1.5             | > 0  | limit of the current
    Vl0       | pu   | 0.44  | -                    | any  | low voltage at which all is out
    Vl1       | pu   | 0.49  | -                    | any  | low voltage at which the trip begins
    Vh0       | pu   | 1.2   | -                    | any  | high voltage at which all is out
    Vh1       | pu   | 1.15  | -                    | any  | high voltage at which the trip begins
    tvl0      | s    | 0.16  | -                    | >= 0 | time below Vl0
    tvl1      | s    | 0.16  | -                    | >= 0 | time below Vl1
    tvh0      | s    | 0.16  | -                    | >= 0 | time above Vh0
    tvh1      | s    | 0.16  | -                    | >= 0 | time above Vh1
    Vrfrac    | -    | 0.7   | -                    | 0 .. 1 | share that returns
    fl        | Hz   | 56.5  | -                    | any  | low frequency that trips
    fh        | Hz   | 62    | -                    | any  | high frequency that trips
    tfl       | s    | 0.16  | -                    | >= 0 | time below fl
    tfh       | s    | 0.16  | -                    | >= 0 | time above fh
    Tg        | s    | 0.02  | 0.01 .. 0.1          | >= 0 | lag of the converter
    rrpwr     | pu/s | 2     | 0.1 .. 20            | > 0  | rate at which active current returns
    Tv        | s    | 0.02  | -                    | >= 0 | lag of the trip
    Vpr       | pu   | 0.8   | -                    | any  | voltage below which the frequency does not trip
    Iqh       | pu   | 1     | limit                | any  | upper limit of the current by voltage
    Iql       | pu   | -1    | limit                | any  | lower limit of the current by voltage
    """
)
_V_MIN = 0.01


@register_jitable
def clock(x: Any, beyond: Any, T: Any, shortest: Any) -> Any:
    """Time for which a threshold has been passed, kept for good once it reaches T: whether it has, and derivative.

    Examples
    --------
    >>> [bool(clock(x, True, 0.1, 0.001)[0]) for x in (0.05, 0.1)], float(clock(0.05, False, 0.1, 0.001)[1])
    ([False, True], -50.0)
    """
    over = x >= longer(T, shortest)
    return over, select(over, 0.0, select(beyond, 1.0, -x / shortest))


@register_jitable
def remaining(Vx: Any, extreme: Any, all_out: Any, begin: Any, Vrfrac: Any) -> Any:
    """Share that is left between the voltages where a trip begins and where all is out, (6), of positive order.

    Examples
    --------
    >>> [round(float(remaining(V, 0.45, 0.4, 0.5, 0.5)), 12) for V in (0.42, 0.5)]
    [0.2, 0.75]
    """
    apart = begin > all_out
    width = select(apart, begin - all_out, 1.0)
    inside = clip(Vx, all_out, begin)
    lowest = select(extreme < inside, clip(extreme, all_out, begin), inside)
    return select(apart, (lowest - all_out + Vrfrac * (inside - lowest)) / width, 1.0)


@stage("V", "P", "Q", "Vm", "d_Vf")
def terminal(Vr: Any, Vi: Any, Ip: Any, Iq: Any, Vf: Any, Trv: Any, shortest: Any) -> Any:
    """Terminal voltage and injected power, (4)."""
    V = np.sqrt(Vr * Vr + Vi * Vi)
    Vm, d_Vf = lag(Vf, V, Trv, shortest)
    return V, V * Ip, V * Iq, clip(Vm, _V_MIN, 10.0), d_Vf


@stage("Ir", "Ii")
def behind(Er: Any, Ei: Any, R_grid: Any, X_grid: Any, Ip: Any, Iq: Any) -> Any:
    """Current behind an impedance: of (4), it does not depend on the terminal voltage but for its direction."""
    V = voltage_behind(np.sqrt(Er * Er + Ei * Ei), R_grid, X_grid, Ip, 0.0, Iq, 0.0)
    return along_terminal(Er, Ei, V, Ip, Iq, R_grid, X_grid)


@stage("df", "d_xr", "d_xi", "d_ff")
def frequency(Vr: Any, Vi: Any, xr: Any, xi: Any, ff: Any, Trf: Any, f0: Any, shortest: Any) -> Any:
    """Frequency deviation behind its filter."""
    measured, _, d_xr, d_xi = measured_voltage(xr, xi, Vr, Vi, f0, shortest)
    df, d_ff = lag(ff, measured, Trf, shortest)
    return df, d_xr, d_xi, d_ff


@stage("left", "d_m", "d_Vmin", "d_Vmax", "d_c1", "d_c2", "d_c3", "d_c4", "d_c5", "d_c6")
def trips(
    Vm: Any, df: Any, m: Any, Vmin: Any, Vmax: Any, c1: Any, c2: Any, c3: Any, c4: Any, c5: Any, c6: Any,
    VtripFlag: Any, FtripFlag: Any, Vl0: Any, Vl1: Any, Vh0: Any, Vh1: Any, tvl0: Any, tvl1: Any, tvh0: Any, tvh1: Any,
    Vrfrac: Any, fl: Any, fh: Any, tfl: Any, tfh: Any, Vpr: Any, Tv: Any, f0: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Share that is left by the trips, (5), (6)."""
    low, high = Vl1 > Vl0, Vh0 > Vh1
    out_low, d_c1 = clock(c1, (Vm < Vl0) & low, tvl0, shortest)
    out_high, d_c3 = clock(c3, (Vm > Vh0) & high, tvh0, shortest)
    by_low = remaining(Vm, Vmin, Vl0, Vl1, Vrfrac)
    by_high = remaining(-Vm, -Vmax, -Vh0, -Vh1, Vrfrac)
    by_voltage = select(out_low | out_high, 0.0, by_low * by_high)
    # these two run on, so that the extreme voltage is that since the time has passed
    for_low, _ = clock(c2, Vm < Vl1, tvl1, shortest)
    for_high, _ = clock(c4, Vm > Vh1, tvh1, shortest)
    d_c2 = select(Vm < Vl1, select(for_low, 0.0, 1.0), -c2 / shortest)
    d_c4 = select(Vm > Vh1, select(for_high, 0.0, 1.0), -c4 / shortest)
    d_Vmin = select(for_low & (Vm < Vmin), (Vm - Vmin) / shortest, 0.0)
    d_Vmax = select(for_high & (Vm > Vmax), (Vm - Vmax) / shortest, 0.0)
    f, seen = f0 * (1.0 + df), Vm >= Vpr
    slow, d_c5 = clock(c5, (f < fl) & seen, tfl, shortest)
    fast, d_c6 = clock(c6, (f > fh) & seen, tfh, shortest)
    by_frequency = select(slow | fast, 0.0, 1.0 + 0.0 * df)
    share = select(VtripFlag == 1.0, by_voltage, 1.0) * select(FtripFlag == 1.0, by_frequency, 1.0)
    left, d_m = lag(m, share, Tv, shortest)
    return left, d_m, d_Vmin, d_Vmax, d_c1, d_c2, d_c3, d_c4, d_c5, d_c6


@stage("Pm", "d_Pf", "d_xp", "d_xo")
def power_order(
    P: Any, Pref: Any, df: Any, Pf: Any, xp: Any, xo: Any, lowP: Any, highP: Any, FreqFlag: Any, Tp: Any, Ddn: Any,
    Dup: Any, fdbd1: Any, fdbd2: Any, femax: Any, femin: Any, dPmax: Any, dPmin: Any, Tpord: Any, Kpg: Any, Kig: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Order of power xo, (2), (3)."""
    Pm, d_Pf = lag(Pf, P, Tp, shortest)
    u = dead_band_between(-df, fdbd1, fdbd2)
    lacking = clip(Pref - Pm + select(u < 0.0, Ddn * u, Dup * u), femin, femax)
    controlled, d_xp = limited_pi(xp, lacking, Kpg, Kig, lowP, highP)
    on = FreqFlag == 1.0
    rate = clip((select(on, controlled, Pref) - xo) / longer(Tpord, shortest), dPmin, dPmax)
    inside = clip(xo, lowP, highP)
    return Pm, d_Pf, select(on, d_xp, 0.0), hold_at_limits(xo, rate, lowP, highP) + (inside - xo) / shortest


@stage("d_Ip", "d_Iq", "d_xq")
def currents(
    Vm: Any, Pm: Any, Qext: Any, left: Any, Ip: Any, Iq: Any, xq: Any, xo: Any, Vref: Any, tangent: Any, more: Any,
    lowP: Any, highP: Any, highI: Any, PfFlag: Any, PQFlag: Any, GenFlag: Any, dbd1: Any, dbd2: Any, Kqv: Any,
    Iqh: Any, Iql: Any, Tiq: Any, Tg: Any, rrpwr: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Currents within their limits, times what the trips leave, (1), (3), (4)."""
    direct, d_xq = lag(xq, select(PfFlag == 1.0, tangent * Pm, Qext + more) / Vm, Tiq, shortest)
    reactive = direct + injection(Vm, Vref, dbd1, dbd2, Kqv, Iqh, Iql)
    active, square, first = clip(xo, lowP, highP) / Vm, highI * highI, PQFlag == 1.0
    lowest = select(GenFlag == 1.0, 0.0, -1.0)
    leading = select(first, clip(active, lowest * highI, highI), clip(reactive, -highI, highI))
    room = np.sqrt(clip(square - leading * leading, 0.0, square))
    active = select(first, leading, clip(active, lowest * room, room))
    reactive = select(first, clip(reactive, -room, room), leading)
    T = longer(Tg, shortest)
    d_Ip = (left * active - Ip) / T
    return select(d_Ip > rrpwr, rrpwr, d_Ip), (left * reactive - Iq) / T, d_xq


def start(v: Values) -> Start:
    """Equilibrium at V, P and Q, with nothing tripped."""
    V, P, Q = v["V"], v["P"], v["Q"]
    zero, one = 0.0 * V + 0.0 * v["Tg"], 1.0 + 0.0 * V + 0.0 * v["Tg"]
    Ip, Iq = P / V, Q / V
    Vref = np.where(v["Vref0"] == 0, V, v["Vref0"])
    base = Iq - injection(V, Vref, v["dbd1"], v["dbd2"], v["Kqv"], v["Iqh"], v["Iql"])
    size = np.abs(P) > 1e-6
    lowP, highP = holding(P, v["Pmin"], v["Pmax"])
    current = np.hypot(Ip, Iq)
    trips = v["VtripFlag"] == 1
    lower = np.where(trips & (v["Vl1"] > v["Vl0"]), v["Vl1"], -1e6)
    upper = np.where(trips & (v["Vh0"] > v["Vh1"]), v["Vh1"], 1e6)
    slowest, fastest = (
        np.where(v["FtripFlag"] == 1, v[name], end) for name, end in (("fl", -1e6), ("fh", 1e6))
    )
    return Start(
        {
            "Ip": Ip, "Iq": Iq, "Vf": V, "Pf": P, "xq": base, "xp": P, "xo": P, "xr": v["Vr"], "xi": v["Vi"],
            "ff": zero, "m": one, "Vmin": v["Vl1"] * one, "Vmax": v["Vh1"] * one,
            "c1": zero, "c2": zero, "c3": zero, "c4": zero, "c5": zero, "c6": zero,
        },
        {
            "Ip0": Ip, "Iq0": Iq, "Vref": Vref, "tangent": np.where(size, base * V / np.where(size, P, 1.0), 0.0),
            "more": base * V - Q, "lowP": lowP, "highP": highP, "highI": np.maximum(current * (1 + 1e-9), v["Imax"]),
        },
        (
            Limit("power", P, v["Pmin"], v["Pmax"], ("Pmin", "Pmax")),
            Limit("current", current, 0.0, v["Imax"], ("", "Imax")),
            Limit("voltage", V, lower, upper, ("Vl1", "Vh1")),
            Limit("frequency", v["f0"] + zero, slowest, fastest, ("fl", "fh")),
        ),
    )  # fmt: skip


DERA1 = Part(
    name="DERA1",
    slot="converter",
    title="Aggregate of distributed resources",
    fields=FIELDS,
    stages=(terminal,),
    closing=(frequency, trips, power_order, currents),
    ports=("V", "P", "Q", "Ip0", "Iq0"),
    states=(
        "Ip", "Iq", "Vf", "Pf", "xq", "xp", "xo", "xr", "xi", "ff", "m", "Vmin", "Vmax",
        "c1", "c2", "c3", "c4", "c5", "c6",
    ),
    setpoints=("Ip0", "Iq0", "Vref", "tangent", "more", "lowP", "highP", "highI"),
    start=start,
    rules=("Pmin <= Pmax", "Iql <= Iqh", "dPmin < dPmax"),
    formula="(1) to (6)",
    source="WECC DER_A; PSS/E model library, DERA1",
    aliases=("DERAU1",),
    behind=behind,
)  # fmt: skip
