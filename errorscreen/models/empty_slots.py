"""Empty slots of a unit: parts that keep constant what a model of the file would move."""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage, writes_of
from errorscreen.models.limiters.none import NO_OVER_EXCITATION, NO_UNDER_EXCITATION
from errorscreen.models.part import Part, Start, Values


@stage("Vc")
def no_compensation(V: Any) -> Any:
    """Voltage that an exciter controls, of a unit without load compensation."""
    return (V,)


@stage("Vs")
def no_stabiliser(omega: Any) -> Any:
    """Signal of a stabiliser that is not there."""
    return (0.0 * omega,)


@stage("Efd")
def constant_field(Efd0: Any) -> Any:
    """Field voltage of a unit without exciter."""
    return (Efd0,)


def controlled_voltage(v: Values) -> Start:
    """Voltage before the event that an exciter would control, of a unit without one."""
    return Start({}, {"Vc0": v["Vc"]})


@stage("Pm")
def constant_power(Pm0: Any) -> Any:
    """Mechanical power of a unit without governor."""
    return (Pm0,)


@stage("Pref", "Qext")
def constant_references(Pref0: Any, Qext0: Any) -> Any:
    """References of a converter unit without control of the plant."""
    return Pref0, Qext0


@stage("Pset", "wref")
def no_torque_control(Pref: Any, wg0: Any) -> Any:
    """Order of power and reference of speed of a converter unit without torque control."""
    return Pref, wg0


def unit_speed(v: Values) -> Start:
    """Speed at the start of a converter unit without torque control."""
    return Start({}, {"wg0": 0.0 * v["V"] + 1.0})


@stage("theta")
def constant_pitch(theta0: Any) -> Any:
    """Pitch of a converter unit without its control."""
    return (theta0,)


@stage("Pm")
def constant_wind(Pm0: Any) -> Any:
    """Mechanical power of a converter unit without aerodynamics."""
    return (Pm0,)


def power_of_wind(v: Values) -> Start:
    """Mechanical power at the start of a converter unit without aerodynamics."""
    return Start({}, {"Pm0": v["P"], "theta0": 0.0 * v["V"]})


@stage("wt", "wg")
def constant_speed(wg0: Any) -> Any:
    """Speeds of a converter unit without drive train."""
    return wg0, wg0


@stage("Ipcmd", "Iqcmd", "Pord", "dip")
def constant_currents(Ip0: Any, Iq0: Any, Pref0: Any) -> Any:
    """Commands of a converter unit without electrical control, and what a wind turbine asks of it."""
    return Ip0, Iq0, Pref0, 0.0 * Ip0


def powers(v: Values) -> Start:
    """References of a converter unit without electrical control: the powers of the start."""
    return Start({}, {"Pref0": v["P"], "Qext0": v["Q"], "by_speed": 0.0 * v["P"], "by_voltage": 0.0 * v["P"]})


def _null(name: str, slot: str, title: str, function: Any) -> Part:
    return Part(name, slot, title, (), (function,), writes_of(function))


#: what stands in an empty slot
NULL_PARTS = {
    part.slot: part
    for part in (
        _null("no compensation", "compensator", "no load compensation", no_compensation),
        _null("no stabiliser", "stabiliser", "no stabiliser", no_stabiliser),
        NO_OVER_EXCITATION,
        NO_UNDER_EXCITATION,
        Part(
            "constant field", "exciter", "constant field voltage", (), (constant_field,),
            ports=("Efd", "Vc0"), setpoints=("Vc0",), start=controlled_voltage,
        ),
        _null("constant power", "governor", "constant mechanical power", constant_power),
        _null("constant references", "plant_control", "constant references", constant_references),
        _null("constant speed", "drive_train", "constant speed", constant_speed),
        _null("constant pitch", "pitch_control", "constant pitch", constant_pitch),
        Part(
            "constant wind", "aerodynamics", "constant wind", (), (constant_wind,),
            ports=("Pm", "Pm0", "theta0"), setpoints=("Pm0", "theta0"), start=power_of_wind,
        ),
        Part(
            "no torque control", "torque_control", "no torque control", (), (no_torque_control,),
            ports=("Pset", "wref", "wg0"), setpoints=("wg0",), start=unit_speed,
        ),
        Part(
            "constant currents", "electrical_control", "constant currents", (), (constant_currents,),
            ports=("Ipcmd", "Iqcmd", "Pord", "dip", "Pref0", "Qext0", "by_speed", "by_voltage"),
            setpoints=("Pref0", "Qext0", "by_speed", "by_voltage"), start=powers,
        ),
    )
}  # fmt: skip
