"""Units in the small networks of the shared records, integrated without the compiled engine.

The recorded voltages are 5 to 20 ms apart, too far for what happens just after a fault; in its network a unit makes its
own voltage.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from errorscreen.models.unit import SHORTEST, unit
from errorscreen.models.unit_start import UnitStart

from .imposed import needs, records, rms, table


class Smib:
    """One machine against a source behind j0.2, two lines, a load with constant current; a fault on one line."""

    f_nominal, until, switches = 50.0, 4.0, (2.0, 2.15)

    def __init__(self):
        line, half = 0.001 + 0.2j, 0.0005 + 0.1j
        self.line = line
        self.source = 1.0 + 0.2j * np.conj(0.1001711 + 0.08006544j)
        behind = 1 / (1 / line + 1 / line)
        sound = self.source, 0.2j + behind
        Y3 = 1 / 0.2j + 1 / half  # at bus 3, with the end of the faulted line at zero
        E3 = self.source / 0.2j / Y3
        Z = 1 / (1 / (line + 1 / Y3) + 1 / half)
        faulted = E3 / (line + 1 / Y3) * Z, Z
        self.seen = sound, faulted, sound
        self.V2 = self.source

    def voltage(self, E, X, part):
        source, Z = self.seen[part]
        through, V2 = self.line + 1j * X, self.V2
        for _ in range(8):
            V = abs(V2)
            k = 1.0 if V >= 0.5 else 1.502 * 1.769 * V**0.769 * np.exp(-1.502 * V**1.769)
            load = np.conj((0.5 * k * V / 0.9919935 + 0.1j * (V / 0.9919935) ** 2) / V2)
            V2 = (source / Z + E / through - load) / (1 / Z + 1 / through)
        self.V2 = V2
        return E - 1j * X * (E - V2) / through


class ThreeBus:
    """PSS/E: a fixed voltage at bus 101, the machine at 102 and a load at 103; line 101-102 trips at 1 s."""

    f_nominal, until, switches = 60.0, 10.0, (1.0,)
    V, angle = 1.02, np.deg2rad(-0.944)

    def __init__(self):
        y = 1 / (0.01 + 0.12j)
        V3 = 0.99341 * np.exp(-1j * np.deg2rad(8.7697))
        load = np.conj((2.5 + 0.3j) / V3) / V3
        to_load = 1 / (1 / y + 1 / (y + load))
        through = y / (2 * y + load) * y
        self.seen = (y + to_load, 1.05 * (y + through)), (to_load, 1.05 * through)
        V2 = self.V * np.exp(1j * self.angle)
        self.power = V2 * np.conj(self.seen[0][0] * V2 - self.seen[0][1])

    def voltage(self, E, X, part):
        Y, current = self.seen[part]
        return (current + E / (1j * X)) / (Y + 1 / (1j * X))


def simulate(device, network, start, names, step, power=None):
    """Times and quantities of a unit in a network; rows before and after each switching."""
    if power is not None:
        machine, *others = device.initialise.parts

        def given(values):
            found = machine.start(values)
            return found._replace(setpoints={**found.setpoints, "Pm0": np.array(power)})

        device = replace(device, initialise=UnitStart((replace(machine, start=given), *others)))
    values = {p.name: np.array(p.nominal) for p in device.candidates}
    values |= {name: np.array(value) for name, value in device.constant_values(None).items()}
    values |= {"f0": network.f_nominal, "shortest": SHORTEST * step}
    values |= {name: np.array(value) for name, value in start.items()}
    states, setpoints, fits = device.initialise(values)
    assert fits
    values |= {name: float(value) for name, value in (states | setpoints).items()}
    X = float(values[next(name for name in values if name.endswith(".Xpp"))])
    source = device.stages[0]

    def slope(x, part):
        values.update(zip(device.states, x, strict=True))
        values.update(zip(source.writes, source.function(*(values[n] for n in source.reads)), strict=True))
        E = (values["psi2q"] + 1j * values["psi2d"]) * np.exp(1j * (values["delta"] - np.pi / 2))
        V = network.voltage(E, X, part)
        values["Vr"], values["Vi"] = V.real, V.imag
        for call in device.stages:
            values.update(zip(call.writes, call.function(*(values[n] for n in call.reads)), strict=True))
        return np.array([values[f"d_{name}"] for name in device.states], dtype=float)

    x = np.array([values[name] for name in device.states], dtype=float)
    rows, times = [], []
    ends = [0.0, *network.switches, network.until]
    for part, (first, last) in enumerate(pairwise(ends)):
        steps = round((last - first) / step)
        for number in range(steps + 1):
            k1 = slope(x, part)
            times.append(first + number * step)
            rows.append([float(values[name]) for name in names])
            if number < steps:
                k2 = slope(x + 0.5 * step * k1, part)
                k3 = slope(x + 0.5 * step * k2, part)
                k4 = slope(x + step * k3, part)
                x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(times), dict(zip(names, np.array(rows).T, strict=True))


def beside(record, time, columns, times, found):
    """Root mean square of the differences from a record, by column, on the rows away from switchings."""
    switches = times[np.flatnonzero(np.diff(times) == 0)]
    inside = (time <= times[-1]) & np.all([np.abs(time - t) > 1e-3 for t in switches], axis=0)
    keep = np.concatenate([[True], np.diff(times) > 0])
    return {
        column: rms(np.interp(time[inside], times[keep], found[name][keep]) - record[column][inside])
        for column, name in columns.items()
    }


def smib(case, columns, step=0.002):
    """Deviations of a unit from an OpenIPSL record in its network."""
    folder = needs(f"openipsl_smib/{case}")
    record, device = table(folder / "trajectory.csv"), unit(records(folder / "unit.dyr", 1))
    start = {"V": "V_pu", "angle": "V_angle_rad", "P": "P_pu", "Q": "Q_pu"}
    start = {name: record[column][0] for name, column in start.items()}
    record["omega"] = record["speed_dev_pu"] + 1.0
    power = record["PMECH_pu"][0]
    found = simulate(device, Smib(), start, [*columns.values()], step, power)
    return beside(record, record["time_s"], columns, *found)


def three_bus(case, file, columns, step=0.005):
    """Deviations of a unit from a PSS/E record in its network."""
    folder = needs("psse_three_bus")
    record, device, network = table(folder / case), unit(records(folder / "inputs" / file, 102)), ThreeBus()
    start = {"V": network.V, "angle": network.angle, "P": network.power.real, "Q": network.power.imag}
    record["delta"] = np.deg2rad(record["delta_deg"])
    record["omega"] = record.get("dw_pu", 0.0) + 1.0
    found = simulate(device, network, start, [*columns.values()], step)
    return beside(record, record["time"], columns, *found)
