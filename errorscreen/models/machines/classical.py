r"""GENCLS, classical machine: a constant voltage behind a reactance.

With :math:`\psi''_d := E`, :math:`\psi''_q := 0` and :math:`X'' := X_{source}` in the stator and the swing equation of
`errorscreen.models.machines.stator`; field voltage and field current keep the value E, so that exciters do not act.

The record holds the inertia and the damping alone. The reactance is the source reactance of the network's file (ZX of
the RAW file), as the armature resistance is its source resistance. With H = 0 the record is an infinite source of the
network and not a unit.

(PSS/E model library, GENCLS; Kundur, *Power System Stability and Control*, 1994, section 13.3.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.models.machines.stator import PORTS, in_rotor_frame, phasors, stator, swing
from errorscreen.models.part import Part, Start, Values, record

FIELDS = record(
    """
    H | s  | 4.0 | 1.5 .. 9 | > 0  | inertia constant in MWs/MVA; a record with 0 is a voltage source, not a unit
    D | pu | 0.0 | 0 .. 4   | >= 0 | damping, power per speed deviation
    """
)


@stage("If")
def field_current(Eq1: Any) -> Any:
    """Field current that belongs to the constant voltage."""
    return (Eq1,)


def start(v: Values) -> Start:
    """Equilibrium: the voltage behind the reactance, whose angle is that of the rotor."""
    voltage, current = phasors(v)
    behind = voltage + (v["Ra"] + 1j * v["Xsource"]) * current
    delta = np.angle(behind)
    _, Iq = in_rotor_frame(current, delta)
    E = np.abs(behind)
    return Start(
        {"delta": delta, "omega": np.ones_like(delta)},
        {"Eq1": E, "psi2d": E, "psi2q": 0.0 * E, "Xpp": v["Xsource"], "Efd0": E, "Pm0": E * Iq},
    )


GENCLS = Part(
    name="GENCLS",
    slot="machine",
    title="Classical machine",
    fields=FIELDS,
    stages=(field_current, stator),
    ports=PORTS,
    states=("delta", "omega"),
    setpoints=("Eq1", "psi2d", "psi2q", "Xpp", "Efd0", "Pm0"),
    start=start,
    closing=(swing,),
    formula="(R1) to (R3) with ψ''d = E constant, ψ''q = 0",
    source="PSS/E model library, GENCLS",
)
