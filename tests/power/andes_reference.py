"""ANDES as an independent second opinion on load flow and admittance matrix; tests with it are skipped without it."""

import importlib.util
import os
import subprocess
import sys
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt
from errorscreen.power.network import Network

#: ANDES adds this to r and x of every branch in its equations, though not in its admittance matrix
EPSILON = 1e-8

andes = pytest.mark.skipif(
    importlib.util.find_spec("andes") is None,
    reason='ANDES is not installed: pip install "errorscreen[andes]"',
)


@cache
def prepare():
    """Let ANDES write the code that it generates at its first use, one process at a time.

    In a process of its own, because it generates on a pool of processes that it leaves open.
    """
    import fcntl

    import andes

    andes.config_logger(50, file=False, log_path="")  # without a path it makes a folder for its log
    folder = Path.home() / ".andes"
    folder.mkdir(exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        code = "import andes; andes.System(no_output=True, default_config=True)"
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    finally:
        os.close(lock)


def case(name):
    """Network of a case that comes with ANDES, and the voltages ANDES finds for it."""
    system = _load(name)
    _solve(system)
    line = system.Line
    network = Network(
        buses=tuple(
            Bus(int(i), kv=float(kv)) for i, kv in zip(system.Bus.idx.v, system.Bus.Vn.v, strict=True)
        ),
        branches=tuple(
            Branch(*(int(b) for b in ends), *(float(x) for x in numbers), circuit=str(k))
            for k, (ends, numbers) in enumerate(
                zip(
                    zip(line.bus1.v, line.bus2.v, strict=True),
                    zip(
                        line.r.v + EPSILON, line.x.v + EPSILON, line.b.v, line.tap.v, line.phi.v, strict=True
                    ),
                    strict=True,
                )
            )
        ),
        slack=int(system.Slack.bus.v[0]),
        loads=_rows(Load, system.PQ, "p0", "q0"),
        shunts=_rows(Shunt, system.Shunt, "g", "b"),
        generators=(*_rows(Generator, system.PV, "p0", "v0"), *_rows(Generator, system.Slack, "p0", "v0")),
    )
    V = system.Bus.v.v * np.exp(1j * system.Bus.a.v)
    return network, V * np.exp(-1j * np.angle(V[network.index(network.slack)]))


def solve(network):
    """Voltages and admittance matrix that ANDES finds for one of our networks."""
    import andes
    import kvxopt

    prepare()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system = andes.System(no_output=True, default_config=True)
        base = {"Sn": network.base_mva}
        for bus in network.buses:  # one nominal voltage everywhere, so that nothing is converted
            system.add("Bus", {"idx": bus.number, "Vn": 345.0})
        for g in network.generators:
            model = "Slack" if g.bus == network.slack else "PV"
            system.add(model, {"idx": f"g{g.bus}", "bus": g.bus, "p0": g.p, "v0": g.v, "Vn": 345.0, **base})
        for i, load in enumerate(network.loads):
            system.add("PQ", {"idx": f"l{i}", "bus": load.bus, "p0": load.p, "q0": load.q, "Vn": 345.0})
        for i, shunt in enumerate(network.shunts):
            system.add(
                "Shunt", {"idx": f"s{i}", "bus": shunt.bus, "g": shunt.g, "b": shunt.b, "Vn": 345.0, **base}
            )
        for i, b in enumerate(network.branches):
            ends = {"bus1": b.from_bus, "bus2": b.to_bus, "Vn1": 345.0, "Vn2": 345.0, "u": int(b.in_service)}
            values = {"r": b.r - EPSILON, "x": b.x - EPSILON, "b": b.b, "tap": b.tap, "phi": b.shift}
            system.add("Line", {"idx": f"b{i}", **ends, **values, **base})
        system.setup()
    _solve(system)
    system.Line.r.v += EPSILON
    system.Line.x.v += EPSILON
    return system.Bus.v.v * np.exp(1j * system.Bus.a.v), np.array(kvxopt.matrix(system.build_ybus()))


@cache
def _load(name):
    import andes

    prepare()
    with warnings.catch_warnings():  # its readers use what pandas has deprecated
        warnings.simplefilter("ignore")
        return andes.load(andes.get_case(name), setup=True, no_output=True, default_config=True)


def _solve(system):
    system.PFlow.config.tol = 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert system.PFlow.run()


def _rows(element, model, *names):
    columns = [getattr(model, name).v for name in names]
    return tuple(
        element(int(bus), *(float(v) for v in values))
        for bus, *values in zip(model.bus.v, *columns, strict=True)
    )
