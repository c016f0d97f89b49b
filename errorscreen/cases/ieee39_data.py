"""The New England 39-bus system as plain tables, in per unit of 100 MVA, 60 Hz.

Source: T. Athay, R. Podmore, S. Virmani, "A Practical Method for the Direct Analysis of Transient Stability", IEEE
Trans. PAS-98, 1979, 573-584; M. A. Pai, *Energy Function Analysis for Power System Stability*, Kluwer, 1989. The
numbers are those that the IEEE PES Task Force on Benchmark Systems for Stability Controls uses (I. Hiskens, "New
England Reduced Model (39-bus system): MATLAB study report", 2013), where the load flow is printed too.

MATPOWER's ``case39`` goes back to an older report (Bills et al., EEI RP90-1, 1970) and differs in some numbers: loads
at the buses 1 and 9, larger loads at 8, 12 and 20, voltages of five generators, charging of line 25-26. PSS/E files
that circulate, and the case that comes with ANDES, are other variants with the same topology.
"""

from __future__ import annotations

from errorscreen.power.elements import Branch, Bus, Generator, Load
from errorscreen.power.network import Network

BASE_MVA = 100.0
FREQUENCY = 60.0
#: unit 2; unit 1 at bus 39 stands for the rest of the interconnection
SLACK = 31

#: from bus, to bus, r, x, b, ratio at the from bus
BRANCHES = (
    (1, 2, 0.0035, 0.0411, 0.6987, 1.0), (1, 39, 0.0010, 0.0250, 0.7500, 1.0),
    (2, 3, 0.0013, 0.0151, 0.2572, 1.0), (2, 25, 0.0070, 0.0086, 0.1460, 1.0),
    (3, 4, 0.0013, 0.0213, 0.2214, 1.0), (3, 18, 0.0011, 0.0133, 0.2138, 1.0),
    (4, 5, 0.0008, 0.0128, 0.1342, 1.0), (4, 14, 0.0008, 0.0129, 0.1382, 1.0),
    (5, 6, 0.0002, 0.0026, 0.0434, 1.0), (5, 8, 0.0008, 0.0112, 0.1476, 1.0),
    (6, 7, 0.0006, 0.0092, 0.1130, 1.0), (6, 11, 0.0007, 0.0082, 0.1389, 1.0),
    (7, 8, 0.0004, 0.0046, 0.0780, 1.0), (8, 9, 0.0023, 0.0363, 0.3804, 1.0),
    (9, 39, 0.0010, 0.0250, 1.2000, 1.0), (10, 11, 0.0004, 0.0043, 0.0729, 1.0),
    (10, 13, 0.0004, 0.0043, 0.0729, 1.0), (13, 14, 0.0009, 0.0101, 0.1723, 1.0),
    (14, 15, 0.0018, 0.0217, 0.3660, 1.0), (15, 16, 0.0009, 0.0094, 0.1710, 1.0),
    (16, 17, 0.0007, 0.0089, 0.1342, 1.0), (16, 19, 0.0016, 0.0195, 0.3040, 1.0),
    (16, 21, 0.0008, 0.0135, 0.2548, 1.0), (16, 24, 0.0003, 0.0059, 0.0680, 1.0),
    (17, 18, 0.0007, 0.0082, 0.1319, 1.0), (17, 27, 0.0013, 0.0173, 0.3216, 1.0),
    (21, 22, 0.0008, 0.0140, 0.2565, 1.0), (22, 23, 0.0006, 0.0096, 0.1846, 1.0),
    (23, 24, 0.0022, 0.0350, 0.3610, 1.0), (25, 26, 0.0032, 0.0323, 0.5130, 1.0),
    (26, 27, 0.0014, 0.0147, 0.2396, 1.0), (26, 28, 0.0043, 0.0474, 0.7802, 1.0),
    (26, 29, 0.0057, 0.0625, 1.0290, 1.0), (28, 29, 0.0014, 0.0151, 0.2490, 1.0),
    (12, 11, 0.0016, 0.0435, 0.0000, 1.006), (12, 13, 0.0016, 0.0435, 0.0000, 1.006),
    (6, 31, 0.0000, 0.0250, 0.0000, 1.070), (10, 32, 0.0000, 0.0200, 0.0000, 1.070),
    (19, 33, 0.0007, 0.0142, 0.0000, 1.070), (20, 34, 0.0009, 0.0180, 0.0000, 1.009),
    (22, 35, 0.0000, 0.0143, 0.0000, 1.025), (23, 36, 0.0005, 0.0272, 0.0000, 1.000),
    (25, 37, 0.0006, 0.0232, 0.0000, 1.025), (2, 30, 0.0000, 0.0181, 0.0000, 1.025),
    (29, 38, 0.0008, 0.0156, 0.0000, 1.025), (19, 20, 0.0007, 0.0138, 0.0000, 1.060),
)  # fmt: skip

#: bus, P, Q
LOADS = (
    (3, 3.220, 0.024), (4, 5.000, 1.840), (7, 2.338, 0.840), (8, 5.220, 1.760),
    (12, 0.075, 0.880), (15, 3.200, 1.530), (16, 3.290, 0.323), (18, 1.580, 0.300),
    (20, 6.280, 1.030), (21, 2.740, 1.150), (23, 2.475, 0.846), (24, 3.086, -0.922),
    (25, 2.240, 0.472), (26, 1.390, 0.170), (27, 2.810, 0.755), (28, 2.060, 0.276),
    (29, 2.835, 0.269), (31, 0.092, 0.046), (39, 11.040, 2.500),
)  # fmt: skip

#: unit, bus, P, voltage; P at the slack bus is what the load flow gives
GENERATORS = (
    (1, 39, 10.00, 1.0300), (2, 31, 5.21, 0.9820),
    (3, 32, 6.50, 0.9831), (4, 33, 6.32, 0.9972),
    (5, 34, 5.08, 1.0123), (6, 35, 6.50, 1.0493),
    (7, 36, 5.60, 1.0635), (8, 37, 5.40, 1.0278),
    (9, 38, 8.30, 1.0265), (10, 30, 2.50, 1.0475),
)  # fmt: skip

#: unit, bus, H in s, Xd, X'd, Xq, X'q, T'd0 in s, T'q0 in s, Xl; reactances and H on 100 MVA, Ra = 0. Unit 10 is a
#: hydro unit: T'q0 = 0 says that it has no transient winding in the q axis, so its X'q means nothing
MACHINES = (
    (1, 39, 500.0, 0.0200, 0.0060, 0.0190, 0.0080, 7.00, 0.70, 0.0030),
    (2, 31, 30.3, 0.2950, 0.0697, 0.2820, 0.1700, 6.56, 1.50, 0.0350),
    (3, 32, 35.8, 0.2495, 0.0531, 0.2370, 0.0876, 5.70, 1.50, 0.0304),
    (4, 33, 28.6, 0.2620, 0.0436, 0.2580, 0.1660, 5.69, 1.50, 0.0295),
    (5, 34, 26.0, 0.6700, 0.1320, 0.6200, 0.1660, 5.40, 0.44, 0.0540),
    (6, 35, 34.8, 0.2540, 0.0500, 0.2410, 0.0814, 7.30, 0.40, 0.0224),
    (7, 36, 26.4, 0.2950, 0.0490, 0.2920, 0.1860, 5.66, 1.50, 0.0322),
    (8, 37, 24.3, 0.2900, 0.0570, 0.2800, 0.0911, 6.70, 0.41, 0.0280),
    (9, 38, 34.5, 0.2106, 0.0570, 0.2050, 0.0587, 4.79, 1.96, 0.0298),
    (10, 30, 42.0, 0.1000, 0.0310, 0.0690, 0.0080, 10.20, 0.00, 0.0125),
)

#: place of each bus in a diagram, x to the right and y upwards, in any unit
POSITIONS = {
    1: (0.0, 7.4), 2: (2.0, 8.0), 3: (2.0, 6.6), 4: (2.0, 4.8), 5: (2.0, 3.6), 6: (3.2, 2.6), 7: (2.0, 1.8),
    8: (1.0, 2.6), 9: (0.0, 3.6), 10: (5.6, 1.6), 11: (4.4, 2.4), 12: (5.6, 3.0), 13: (6.8, 2.4), 14: (4.2, 4.8),
    15: (6.0, 4.8), 16: (7.4, 5.6), 17: (5.4, 6.6), 18: (3.8, 6.6), 19: (8.0, 4.0), 20: (9.2, 2.9), 21: (8.8, 5.0),
    22: (10.6, 4.2), 23: (11.8, 5.2), 24: (9.6, 6.2), 25: (4.0, 8.4), 26: (6.4, 8.4), 27: (7.2, 7.2),
    28: (8.6, 7.8), 29: (10.6, 8.4), 30: (2.0, 9.4), 31: (3.9, 1.2), 32: (5.6, 0.4), 33: (8.0, 2.6),
    34: (9.2, 1.5), 35: (10.6, 2.8), 36: (11.8, 3.8), 37: (4.6, 9.4), 38: (11.2, 9.4), 39: (0.0, 5.6),
}  # fmt: skip


def ieee39_network() -> Network:
    """Grid of the New England system, ready for a load flow.

    Returns
    -------
    Network
        39 buses, 46 branches, 19 loads, 10 generators.

    Examples
    --------
    >>> from errorscreen.power.load_flow import solve_load_flow
    >>> flow = solve_load_flow(ieee39_network())
    >>> round(float(flow.magnitude[2]), 4), round(flow.generation[31].real, 3)
    (1.0302, 5.208)
    """
    return Network(
        buses=tuple(Bus(number, kv=345.0) for number in range(1, 40)),
        branches=tuple(Branch(a, b, r, x, charging, tap) for a, b, r, x, charging, tap in BRANCHES),
        slack=SLACK,
        loads=tuple(Load(bus, p, q) for bus, p, q in LOADS),
        generators=tuple(Generator(bus, p, v, name=f"unit {unit}") for unit, bus, p, v in GENERATORS),
        base_mva=BASE_MVA,
    )
