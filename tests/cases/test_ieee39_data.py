"""The tables against solutions that others have printed."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.cases.ieee39_data import BRANCHES, GENERATORS, LOADS, MACHINES, ieee39_network
from errorscreen.power.elements import Load
from errorscreen.power.load_flow import solve_load_flow

#: voltage and angle in degrees at the buses 1 to 39, as the Task Force's report prints them (Hiskens 2013, section 2)
PRINTED = """
1.0474 -8.44  1.0487 -5.75  1.0302 -8.60  1.0039 -9.61  1.0053 -8.61  1.0077 -7.95  0.9970 -10.12 0.9960 -10.62
1.0282 -10.32 1.0172 -5.43  1.0127 -6.28  1.0002 -6.24  1.0143 -6.10  1.0117 -7.66  1.0154 -7.74  1.0318 -6.19
1.0336 -7.30  1.0309 -8.22  1.0499 -1.02  0.9912 -2.01  1.0318 -3.78  1.0498 0.67   1.0448 0.47   1.0373 -6.07
1.0576 -4.36  1.0521 -5.53  1.0377 -7.50  1.0501 -2.01  1.0499 0.74   1.0475 -3.33  0.9820 0.00   0.9831 2.57
0.9972 4.19   1.0123 3.17   1.0493 5.63   1.0635 8.32   1.0278 2.42   1.0265 7.81   1.0300 -10.05
"""
#: the solution that MATPOWER's case39 carries, for the data of 1970
MATPOWER = """
1.0393836 -13.536602 1.0484941 -9.7852666 1.0307077 -12.276384 1.00446 -12.626734 1.0060063 -11.192339
1.0082256 -10.40833 0.99839728 -12.755626 0.99787232 -13.335844 1.038332 -14.178442 1.0178431 -8.170875
1.0133858 -8.9369663 1.000815 -8.9988236 1.014923 -8.9299272 1.012319 -10.715295 1.0161854 -11.345399
1.0325203 -10.033348 1.0342365 -11.116436 1.0315726 -11.986168 1.0501068 -5.4100729 0.99101054 -6.8211783
1.0323192 -7.6287461 1.0501427 -3.1831199 1.0451451 -3.3812763 1.038001 -9.9137585 1.0576827 -8.3692354
1.0525613 -9.4387696 1.0383449 -11.362152 1.0503737 -5.9283592 1.0501149 -3.1698741 1.0499 -7.3704746
0.982 0 0.9841 -0.1884374 0.9972 -0.19317445 1.0123 -1.631119 1.0494 1.7765069 1.0636 4.4684374
1.0275 -1.5828988 1.0265 3.8928177 1.03 -14.535256
"""


def table(text):
    return np.array(text.split(), dtype=float).reshape(39, 2)


def test_size():
    network = ieee39_network()
    assert (len(network.buses), len(network.branches), len(network.loads)) == (39, 46, 19)
    assert len(network.generators) == len(MACHINES) == 10
    assert sum(tap != 1 for *_, tap in BRANCHES) == 11  # the twelfth transformer, 23-36, has the ratio 1
    assert network.demand().sum() == pytest.approx(60.971 + 14.089j)
    assert {row[:2] for row in GENERATORS} == {row[:2] for row in MACHINES}


def test_printed_solution():
    flow = solve_load_flow(ieee39_network())
    magnitude, angle = table(PRINTED).T
    assert np.abs(flow.magnitude - magnitude).max() <= 0.5e-4
    assert np.abs(np.degrees(flow.angle) - angle).max() <= 0.5e-2


def test_solution_of_the_data_of_1970():
    """The same grid with the numbers in which MATPOWER's case39 differs has MATPOWER's solution, to its digits."""
    network = ieee39_network()
    loads = {bus: (p, q) for bus, p, q in LOADS}
    loads |= {1: (0.976, 0.442), 8: (5.22, 1.766), 9: (0.065, -0.666), 12: (0.0853, 0.88), 20: (6.8, 1.03)}
    held = {30: 1.0499, 32: 0.9841, 35: 1.0494, 36: 1.0636, 37: 1.0275}
    network = replace(
        network,
        branches=tuple(replace(b, b=0.531) if b.ends == (25, 26) else b for b in network.branches),
        loads=tuple(Load(bus, p, q) for bus, (p, q) in loads.items()),
        generators=tuple(replace(g, v=held.get(g.bus, g.v)) for g in network.generators),
    )
    flow = solve_load_flow(network)
    magnitude, angle = table(MATPOWER).T
    assert np.abs(flow.magnitude - magnitude).max() < 1e-7
    assert np.abs(np.degrees(flow.angle) - angle).max() < 1e-6
    assert flow.generation[31] == pytest.approx(6.77871 + 2.21574j, abs=1e-5)


def test_machines_are_physical():
    for _unit, _bus, H, Xd, Xd1, Xq, Xq1, Td10, Tq10, Xl in MACHINES:
        assert Xl < Xd1 < Xd
        assert Xl < Xq <= Xd
        assert H > 20
        assert Td10 > Tq10
        assert Tq10 == 0 or Xl < Xq1 < Xq
