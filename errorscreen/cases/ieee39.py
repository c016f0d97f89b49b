"""The modified New England 39-bus system of the paper's case study.

Three generators are replaced by plants under test, with the active power and the voltage of the original load flow, so
near to bus 2 that it feels them: the PV plant at bus 30, the DFIG plant at bus 37, and the synchronous machine at bus
38. They deliver 0.6, 0.7 and 0.8 of their ratings, which follow from that (`PLANTS`). The PV plant at bus 37 would have
no reactive power, and at bus 38 stay at the edge of ride-through for long.

The other seven units are two-axis machines without controllers (`errorscreen.models.FixedMachine`): the paper leaves
them unchanged. Their damping power per speed deviation is 0.2 of their starting time, about that of the machine under
test. Loads are constant impedances.

Without governors the fault leaves the whole grid above nominal frequency. The virtual inertia of the DFIG plant acts in
both directions, otherwise it would rest: ``dbwih`` and ``Pwimin`` are set. In the PV plant ride-through takes over
within a band of 0.1 instead of 0.02 pu, because that band sets how small a step must be.

Channels: U is the magnitude of the voltage at bus 2, P the active power that arrives there over the line from bus 25,
both in pu (100 MVA). The paper says "P at bus 2" and leaves open which; other choices are `channels`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.cases.ieee39_data import BASE_MVA, FREQUENCY, GENERATORS, MACHINES, ieee39_network
from errorscreen.events import BusFault, GridEvent, LineTrip, LoadStep
from errorscreen.models import FixedMachine
from errorscreen.simulators import PowerSystemSimulator, Unit

#: observed quantities: a bus for its voltage, or a pair for the power that arrives at the second
CHANNELS: dict[str, int | tuple[int, int]] = {"U": 2, "P": (25, 2)}
#: bus, device, active power before the event as a share of the rating, constants that differ from the device's own
PLANTS: tuple[tuple[int, str, float, dict[str, float]], ...] = (
    (38, "synchronous_machine", 0.8, {}),
    (37, "dfig_plant", 0.7, {"dbwih": 0.0005, "Pwimin": -0.1}),
    (30, "pv_plant", 0.6, {"dV_LV": 0.1}),
)
#: damping of the other machines over their starting time, in 1/s
_DAMPING = 0.2


def load_ieee39(**options: Any) -> PowerSystemSimulator:
    """Simulator of the case study: 40 parameters of three plants, U and P at bus 2.

    The default event is a three-phase fault at bus 3 from 1.0 to 1.1 s, 5 s in all, a sample every 10 ms.

    Parameters
    ----------
    **options
        Of `PowerSystemSimulator`: channels, loads, event, further, parameters, effects, step, n_threads, engine.

    Returns
    -------
    PowerSystemSimulator

    Examples
    --------
    >>> system = load_ieee39()
    >>> len(system.parameters), system.channels, system.event.name
    (40, ('U', 'P'), 'fault at bus 3')
    """
    power = {bus: p for _, bus, p, _ in GENERATORS}
    units = [
        Unit(bus, device, BASE_MVA * power[bus] / loading, constants)
        for bus, device, loading, constants in PLANTS
    ]
    replaced = {unit.bus for unit in units}
    machines = [
        FixedMachine(bus, H, Xd1, Xd, Xq, Td10, Tq10, D=_DAMPING * 2 * H)
        for _, bus, H, Xd, Xd1, Xq, _, Td10, Tq10, _ in MACHINES
        if bus not in replaced
    ]
    options = {"channels": CHANNELS, "event": ieee39_events()["fault at bus 3"], **options}
    return PowerSystemSimulator(ieee39_network(), units, machines, f0=FREQUENCY, **options)


def ieee39_events() -> dict[str, GridEvent]:
    """Events of the case study by name: the paper's fault first, then others to calibrate with or to judge on.

    Returns
    -------
    dict of str to GridEvent
        Faults at other buses, of other duration and impedance, a line trip, a load step and another load level.

    Examples
    --------
    >>> list(ieee39_events())[:3]
    ['fault at bus 3', 'fault at bus 3, 150 ms', 'fault at bus 3, impedance']
    """
    time, start = 0.01 * np.arange(501, dtype=float), 1.0
    events = (
        BusFault(time, "fault at bus 3", start, bus=3, duration=0.1),
        BusFault(time, "fault at bus 3, 150 ms", start, bus=3, duration=0.15),
        BusFault(time, "fault at bus 3, impedance", start, bus=3, duration=0.1, impedance=0.02j),
        BusFault(time, "fault at bus 16", start, bus=16, duration=0.1),
        BusFault(time, "fault at bus 26", start, bus=26, duration=0.1),
        BusFault(time, "fault at bus 4, 120 ms", start, bus=4, duration=0.12),
        BusFault(time, "fault at bus 3, low load", start, bus=3, duration=0.1, level=0.9),
        LineTrip(time, "line 2-3 out", start, ends=(2, 3)),
        LoadStep(time, "loads 3 and 4 up", start, factor=1.2, buses=(3, 4)),
    )
    return {event.name: event for event in events}
