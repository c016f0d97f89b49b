"""The three devices written a second time, independently: scalar, with branches, for an adaptive solver.

Only the textbook equations are shared with the package, not its code: complex phasors instead of the closed-form
stator, ``math`` and ``if`` instead of the vector functions. In a grid the power is that of the network's solution and
given with the slope.
"""

import cmath
import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator


def limited(x, low, high):
    return min(max(x, low), high)


def leak(x, low, high, T):
    return (x - limited(x, low, high)) / T


class Machine:
    def __init__(self, p, V, P, Q):
        self.p = p
        current = ((P + 1j * Q) / V).conjugate()
        self.delta0 = cmath.phase(V + (p["Ra"] + 1j * p["Xq"]) * current)
        idq = current * cmath.exp(1j * (math.pi / 2 - self.delta0))
        vdq = V * cmath.exp(1j * (math.pi / 2 - self.delta0))
        self.ed0 = (p["Xq"] - p["Xq1"]) * idq.imag
        self.eq0 = vdq.imag + p["Ra"] * idq.imag + p["Xd1"] * idq.real
        self.efd = self.eq0 + (p["Xd"] - p["Xd1"]) * idq.real
        self.pm = P + p["Ra"] * abs(current) ** 2  # power balance instead of the air-gap formula

    def start(self):
        return [self.delta0, 1.0, self.eq0, self.ed0]

    def currents(self, x, voltage):
        p = self.p
        delta, _, eq, ed = x
        vdq = voltage * cmath.exp(1j * (math.pi / 2 - delta))
        matrix = np.array([[p["Ra"], -p["Xq1"]], [p["Xd1"], p["Ra"]]])
        return np.linalg.solve(matrix, [ed - vdq.real, eq - vdq.imag]), vdq

    def power(self, x, voltage):
        (i_d, i_q), vdq = self.currents(x, voltage)
        s = vdq * complex(i_d, i_q).conjugate()
        return s.real, s.imag

    def slope(self, x, voltage, power=None):
        p = self.p
        (i_d, i_q), _ = self.currents(x, voltage)
        electrical = (power or self.power(x, voltage))[0] + p["Ra"] * (i_d**2 + i_q**2)
        return [
            2 * math.pi * p["f0"] * (x[1] - 1),
            (self.pm - electrical - p["D"] * (x[1] - 1)) / p["Tj"],
            (self.efd - x[2] - (p["Xd"] - p["Xd1"]) * i_d) / p["Td10"],
            (-x[3] + (p["Xq"] - p["Xq1"]) * i_q) / p["Tq10"],
        ]


class PV:
    def __init__(self, p, V, P, Q):
        self.p, self.P0, self.Q0, self.Ip0, self.Iq0, self.V0 = p, P, Q, P / V, Q / V, V

    def start(self):
        return [self.V0, self.Q0, 1.0, self.Ip0, self.Iq0, self.Ip0, self.Iq0]

    def power(self, x, voltage):
        return abs(voltage) * x[5], abs(voltage) * x[6]

    def slope(self, x, voltage, power=None):
        p, V = self.p, abs(voltage)
        vf, qf, energy, xdc, xq, ip, iq = x
        active, reactive = power or (V * ip, V * iq)
        depth = limited((p["V_LV"] - vf) / p["dV_LV"], 0, 1)
        w = 3 * depth**2 - 2 * depth**3
        vdc = math.sqrt(energy)
        curvature = p["kpv"] if vdc > 1 else 1.0
        array = self.P0 * max(0.0, 1 - curvature * (vdc - 1) ** 2)
        normal_p = p["KPdc"] * (vdc - 1) + limited(xdc, 0, p["Imax"])
        normal_q = p["KPQ"] * (self.Q0 - qf) + limited(xq, -p["Imax"], p["Imax"])
        low_p = p["K1_Ip_LV"] * vf + p["K2_Ip_LV"] * self.Ip0 + p["Ipset_LV"]
        low_q = (
            p["K1_Iq_LV"] * (p["V_LV"] - vf) + p["K2_Iq_LV"] * self.Iq0 + p["KQ_LV"] * self.Q0 / max(vf, 0.05)
        )
        want_q = limited(normal_q + w * (low_q - normal_q), -p["Imax"], p["Imax"])
        want_p = limited(normal_p + w * (low_p - normal_p), 0, math.sqrt(p["Imax"] ** 2 - want_q**2))
        return [
            (V - vf) / p["Tm"],
            (reactive - qf) / p["Tq"],
            2 * (array - active) / p["Cdc"],
            (1 - w) * p["KIdc"] * (vdc - 1) - leak(xdc, 0, p["Imax"], p["Taw"]),
            (1 - w) * p["KIQ"] * (self.Q0 - qf) - leak(xq, -p["Imax"], p["Imax"], p["Taw"]),
            min((want_p - ip) / p["Tg"], p["RIp"]),
            limited((want_q - iq) / p["Tg"], -p["RIq"], p["RIq"]),
        ]


class DFIG:
    def __init__(self, p, V, P, Q):
        self.p, self.V0, self.P0, self.Q0 = p, V, P, Q

    def start(self):
        p, V = self.p, self.V0
        e = V + self.Q0 * p["Xpp"] / V
        return [0.0, V, 0.0, self.Q0, V, e, e, self.P0 / p["wr0"], self.P0, 0.0, self.P0 / V, p["wr0"]]

    def power(self, x, voltage):
        V = abs(voltage)
        return V * x[10], V * (x[6] - V) / self.p["Xpp"]

    def slope(self, x, voltage, power=None):
        p, V = self.p, abs(voltage)
        theta, vf, ff, xv, vref, ecmd, epp, xT, pord, xw, ip, wr = x
        P, Q = power or self.power(x, voltage)
        d_theta = p["KPLL"] * math.sin(cmath.phase(voltage) - theta)
        df = d_theta / (2 * math.pi * p["f0"])
        qcmd = limited(p["KPV"] * (self.V0 - vf) + limited(xv, p["Qmin"], p["Qmax"]), p["Qmin"], p["Qmax"])
        low, high = V - p["Xpp"] * p["Iqmax"], V + p["Xpp"] * p["Iqmax"]
        torque = limited(p["KPT"] * (wr - p["wr0"]) + limited(xT, 0, p["Tmax"]), 0, p["Tmax"])
        u = max(0.0, -ff - p["dbwi"]) - max(0.0, ff - p["dbwih"])
        boost = limited(p["KWI"] * (u - xw), p["Pwimin"], p["Pwimax"])
        factor = 1 - (1 - p["apcFd"]) * limited((ff - p["fc"]) / (p["fd"] - p["fc"]), 0, 1)
        ceiling = p["Ipmax"] * limited((vf - p["zerox"]) / (p["brkpt"] - p["zerox"]), 0, 1)
        want = limited((factor * pord + boost) / max(V, 0.05), 0, ceiling)
        voltage_error = limited(vref, p["Vmin"], p["Vmax"]) - V - p["Xc"] * (Q - self.Q0)
        return [
            d_theta,
            (V - vf) / p["TR"],
            (df - ff) / p["TLPwi"],
            p["KIV"] * (self.V0 - vf) - leak(xv, p["Qmin"], p["Qmax"], p["Taw"]),
            p["KQI"] * (qcmd - Q) - leak(vref, p["Vmin"], p["Vmax"], p["Taw"]),
            p["KVI"] * voltage_error - leak(ecmd, low, high, p["Taw"]),
            (limited(ecmd, low, high) - epp) / p["TCO"],
            p["KIT"] * (wr - p["wr0"]) - leak(xT, 0, p["Tmax"], p["Taw"]),
            (wr * torque - pord) / p["TPC"],
            (u - xw) / p["Twowi"],
            min((want - ip) / p["TCO"], p["RIP"]),
            (self.P0 - P) / (wr * p["Tjw"]),
        ]


DEVICES = {"synchronous_machine": Machine, "pv_plant": PV, "dfig_plant": DFIG}


def trajectory(name, parameters, event):
    """P and Q, shape (2, L), by an implicit adaptive method, restarted at every sample of the voltage."""
    device = DEVICES[name](parameters, event.initial["V"], event.initial["P"], event.initial["Q"])

    magnitude, angle = (PchipInterpolator(event.time, event.signals[name]) for name in ("V", "angle"))

    def voltage(t):
        return float(magnitude(t)) * cmath.exp(1j * float(angle(t)))

    x, powers = np.array(device.start(), dtype=float), []
    for start, stop in zip(event.time[:-1], event.time[1:], strict=True):
        powers.append(device.power(x, voltage(start)))
        solution = solve_ivp(
            lambda t, y: device.slope(y, voltage(t)), (start, stop), x, method="LSODA", rtol=1e-9, atol=1e-11
        )
        x = solution.y[:, -1]
    powers.append(device.power(x, voltage(event.time[-1])))
    return np.array(powers).T
