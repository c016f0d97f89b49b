r"""Unit whose power is imposed: the recorded P and Q drive it, and the voltage at the recorded point follows.

A machine with :math:`X''_d = X''_q = X''` is a voltage :math:`E'' = (\psi''_q + j\psi''_d)\,e^{j(\delta - \pi/2)}`
behind :math:`R_a + jX''`. With the connection to the recorded point (`errorscreen.simulators.plant.connection`), Z is
the whole impedance between E'' and the voltage V' of the point behind the ideal transformer, :math:`u = |V'|^2`:

.. math::

    V' &= E'' - Z I,\quad Z = R_a + jX'' + R + jX                                                & (Z1)\\
    V' I^* &= s_0 + s_1 u,\quad s_0 = e^{j\psi}\big(P + jQ + P_{aux} + jQ_{aux}\big),\quad
    s_1 = e^{j\psi} t^2 (G - jB)                                                              & (Z2)\\
    E'' V'^* &= \alpha u + \beta,\quad \alpha = 1 + Z s_1^*,\quad \beta = Z s_0^*                      & (Z3)\\
    |\alpha|^2 u^2 - 2hu + |\beta|^2 &= 0,\quad h = \tfrac12|E''|^2 - \mathrm{Re}(\alpha\beta^*)       & (Z4)\\
    u &= \frac{h + \sqrt{h^2 - |\alpha\beta|^2}}{|\alpha|^2},\quad
    V' = \frac{(\alpha u + \beta)^* E''}{|E''|^2}                                              & (Z5)

(Z2) is (C2) of the connection, solved for the power of the unit; (Z3) is (Z1) times :math:`V'^*`; its square is (Z4),
and of its two solutions the one with the higher voltage counts: without a load it is E''. Where the root is imaginary,
no voltage carries this power through Z, and the simulation fails.

The frequency at the recorded point is that of V' behind the filter of `errorscreen.models.measured_voltage`:

.. math:: |V| = t\sqrt u,\quad f = f_{pre} + f_0\,\Delta f                                         \qquad (Z6)

with the mean frequency :math:`f_{pre}` before the event, at which the unit rests.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects import Effect, measurement_effects
from errorscreen.engine.stages import Call, reads_of, stage
from errorscreen.engine.vmath import select, sincos
from errorscreen.exceptions import InputError
from errorscreen.models.device import Constant, Device
from errorscreen.models.measured_voltage import measured_voltage
from errorscreen.models.part import Part, Start, Values
from errorscreen.models.unit_start import UnitStart
from errorscreen.simulators.plant.connection import Connection


@stage("Vr", "Vi", "Er", "Ei")
def terminal_voltage(
    psi2d: Any, psi2q: Any, delta: Any, P_in: Any, Q_in: Any, Ra: Any, Xpp: Any, R_grid: Any, X_grid: Any, tap: Any,
    B_point: Any, P_aux: Any, Q_aux: Any, G_point: Any, turn_c: Any, turn_s: Any,
) -> Any:  # fmt: skip
    """Voltage of the terminal, and that of the point behind the transformer, (Z1) to (Z5)."""
    s, c = sincos(delta)
    er, ei = psi2q * s + psi2d * c, psi2d * s - psi2q * c
    square = er * er + ei * ei
    R, X = Ra + R_grid, Xpp + X_grid
    p, q = P_in + P_aux, Q_in + Q_aux
    p, q = p * turn_c - q * turn_s, q * turn_c + p * turn_s
    g, b = tap * tap * G_point, -tap * tap * B_point
    g, b = g * turn_c - b * turn_s, b * turn_c + g * turn_s
    ar, ai = 1.0 + R * g + X * b, X * g - R * b
    br, bi = R * p + X * q, X * p - R * q
    aa, bb = ar * ar + ai * ai, br * br + bi * bi
    h = 0.5 * square - (ar * br + ai * bi)
    root = h * h - aa * bb
    # also where the higher solution is negative; not a number from there on
    carried = (root >= 0.0) & (h > 0.0)
    u = (h + np.sqrt(select(carried, root, 0.0))) / aa
    wr, wi = (ar * u + br) / square, -(ai * u + bi) / square
    Er, Ei = wr * er - wi * ei, wr * ei + wi * er
    Er = select(carried, Er, np.nan)
    # the share of Z within the machine is that of the voltage across it
    dr, di = er - Er, ei - Ei
    zz = R * R + X * X
    kr, ki = (Ra * R + Xpp * X) / zz, (Xpp * R - Ra * X) / zz
    return er - (kr * dr - ki * di), ei - (kr * di + ki * dr), Er, Ei


@stage("df_point", "d_zr", "d_zi")
def frequency(zr: Any, zi: Any, Er: Any, Ei: Any, f0: Any, shortest: Any) -> Any:
    """Deviation of the frequency at the recorded point in pu, (Z6)."""
    df, _, d_zr, d_zi = measured_voltage(zr, zi, Er, Ei, f0, shortest)
    return df, d_zr, d_zi


@stage("V_point", "f_point")
def recorded_voltage(Er: Any, Ei: Any, df_point: Any, tap: Any, f0: Any, f_start: Any) -> Any:
    """Magnitude in pu and frequency in Hz of the voltage at the recorded point, (Z6)."""
    return tap * np.sqrt(Er * Er + Ei * Ei), f_start + f0 * df_point


def start(v: Values) -> Start:
    """Voltage of the point at the start, from the operating point of the terminal, (Z1)."""
    voltage = v["V"] * np.exp(1j * v["angle"])
    point = voltage - (v["R_grid"] + 1j * v["X_grid"]) * np.conj((v["P"] + 1j * v["Q"]) / voltage)
    return Start({"zr": point.real, "zi": point.imag}, {})


_POINT = Part(
    name="point",
    slot="point",
    title="voltage at the recorded point",
    fields=(),
    stages=(terminal_voltage, frequency),
    ports=("Vr", "Vi", "Er", "Ei", "df_point"),
    states=("zr", "zi"),
    start=start,
)


def with_imposed_power(device: Device, connection: Connection | None = None) -> Device:
    """Device that recorded power drives, whose outputs are V in pu and f in Hz at the recorded point.

    Parameters
    ----------
    device : Device
        A unit of standard models whose machine has the same subtransient reactance in both axes.
    connection : Connection, optional
        Between the terminal and the recorded point; none where not given.

    Raises
    ------
    InputError
        If the device is not such a unit.

    Examples
    --------
    >>> from errorscreen.models.standard import PARTS
    >>> from errorscreen.models.unit import Record, unit
    >>> device = with_imposed_power(unit([Record(PARTS["GENROU"], {})]))
    >>> device.inputs, device.outputs
    (('P_in', 'Q_in'), ('V', 'f'))
    """
    names = {} if device.grid is None else device.grid.names
    initialise = device.initialise
    if not names or names["Xd1"] != names["Xq1"] or not isinstance(initialise, UnitStart):
        raise InputError(
            f"P and Q cannot be imposed on {device.name}, which is no voltage behind one reactance",
            where="PlantSimulator, imposed",
            allowed="a unit from a DYR file with GENROU, GENROE, GENSAL, GENSAE or GENCLS",
            remedy="Impose the voltage. GENTPJ1 and the two-axis machine have another reactance in each axis, a "
            "converter is a source of current",
        )
    own = {"psi2d": names["Eq1"], "psi2q": names["Ed1"], "Xpp": names["Xd1"]}
    reads = tuple(own.get(name, name) for name in reads_of(terminal_voltage))
    first, *others = device.stages
    between = (connection or Connection()).constants
    return replace(
        device,
        stages=(
            first,
            Call(terminal_voltage, reads, terminal_voltage.writes),  # type: ignore[attr-defined]
            *others,
            _POINT.call(frequency),
        ),
        states=(*device.states, *map(_POINT.qualified, _POINT.states)),
        constants=(
            *device.constants,
            *(Constant(name, value) for name, value in between.items() if name in reads),
        ),
        initialise=UnitStart((*initialise.parts, _POINT)),
        needs_angle=False,
        imposed=("P_in", "Q_in"),
        outputs=("V", "f"),
    )


def unsolved(out: NDArray[np.float64], time: NDArray[np.float64]) -> str:
    """Sentence on the first simulation (n, R, L) that ends because (Z4) has no solution; empty without any.

    Examples
    --------
    >>> unsolved(np.array([[[1.0, 1.0]], [[1.0, np.nan]]]), np.array([0.0, 0.5]))
    'from 0.5 s on, no voltage carries the imposed P and Q through the reactance of the machine'
    """
    lost: NDArray[np.bool_] = np.isnan(out).max(axis=1)
    if not lost.any():
        return ""
    first = time[lost[lost.any(axis=1)][0].argmax()]
    return f"from {first:g} s on, no voltage carries the imposed P and Q through the reactance of the machine"


def effects_of_voltage() -> tuple[Effect, ...]:
    """Faults of the measurement of V and f.

    A meter that counts periods has no scale error, and an offset of f moves the frequency at which the unit rests as
    well, so that it does not show.
    """
    of_f = (effect for effect in measurement_effects(["f"], "Hz") if effect.recorded is None)
    return (*measurement_effects(["V"]), *of_f)
