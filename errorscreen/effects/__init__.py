"""Mechanisms that a model may lack."""

from errorscreen.effects.base import KINDS, Effect
from errorscreen.effects.control_lag import ACTIVE_CURRENT_LAG, REACTIVE_CURRENT_LAG, REACTIVE_POWER_LAG
from errorscreen.effects.current_priority import CURRENT_PRIORITY
from errorscreen.effects.event_effects import FAULT_DURATION, FAULT_IMPEDANCE, branch_trip
from errorscreen.effects.excitation_limiters import (
    FIELD_CURRENT_LIMITER,
    STATOR_CURRENT_LIMITER,
    UNDER_EXCITATION_LIMITER,
    VOLTS_PER_HERTZ_LIMITER,
)
from errorscreen.effects.exciter import EXCITER
from errorscreen.effects.forced_oscillation import forced_oscillation
from errorscreen.effects.governor import GOVERNOR
from errorscreen.effects.latent_input import latent_input
from errorscreen.effects.load import FREQUENCY_DEPENDENCE, MOTOR_LOAD, STATIC_ACTIVE, STATIC_REACTIVE
from errorscreen.effects.measurement import common_skew, measurement_effects
from errorscreen.effects.phase_locked_loop import PHASE_LOCKED_LOOP
from errorscreen.effects.ramp_limit import RAMP_LIMIT
from errorscreen.effects.ride_through import HIGH_VOLTAGE_TRIP, RIDE_THROUGH, RIDE_THROUGH_TRIP
from errorscreen.effects.saturation import SATURATION
from errorscreen.effects.stabiliser import STABILISER
from errorscreen.effects.volt_var import VOLT_VAR

#: effects that are compiled into each device, by name of the device; those on one port act in this order, and the draws
#: of a search go by it too. An unknown signal has its place at ports that add a quantity of their own: what enters
#: before a port that has one, as at df and Pwi of the wind plant, is a signal there too
LIBRARY: dict[str, tuple[Effect, ...]] = {
    "synchronous_machine": (
        EXCITER,
        STABILISER,
        SATURATION,
        FIELD_CURRENT_LIMITER,
        STATOR_CURRENT_LIMITER,
        UNDER_EXCITATION_LIMITER,
        VOLTS_PER_HERTZ_LIMITER,
        GOVERNOR,
        forced_oscillation("Pm"),
        latent_input("Efd", 4.0),
        latent_input("Pm", 1.0),
    ),
    "dfig_plant": (
        ACTIVE_CURRENT_LAG,
        REACTIVE_POWER_LAG,
        RIDE_THROUGH,
        RAMP_LIMIT,
        PHASE_LOCKED_LOOP,
        forced_oscillation("Pwi"),
        latent_input("Ip_cmd", 1.0),
        latent_input("Qcmd", 1.0),
    ),
    "pv_plant": (
        ACTIVE_CURRENT_LAG,
        REACTIVE_CURRENT_LAG,
        CURRENT_PRIORITY,
        VOLT_VAR,
        RIDE_THROUGH,
        RIDE_THROUGH_TRIP,
        HIGH_VOLTAGE_TRIP,
        RAMP_LIMIT,
        forced_oscillation("Ip_cmd"),
        latent_input("Ip_cmd", 1.0),
        latent_input("Iq_cmd", 1.0),
        latent_input("Qref", 1.0),
    ),
    "load": (
        STATIC_ACTIVE,
        STATIC_REACTIVE,
        FREQUENCY_DEPENDENCE,
        MOTOR_LOAD,
        latent_input("dP", 0.5),
        latent_input("dQ", 0.5),
    ),
}

__all__ = [
    "ACTIVE_CURRENT_LAG",
    "CURRENT_PRIORITY",
    "EXCITER",
    "FAULT_DURATION",
    "FAULT_IMPEDANCE",
    "FIELD_CURRENT_LIMITER",
    "FREQUENCY_DEPENDENCE",
    "GOVERNOR",
    "HIGH_VOLTAGE_TRIP",
    "KINDS",
    "LIBRARY",
    "MOTOR_LOAD",
    "PHASE_LOCKED_LOOP",
    "RAMP_LIMIT",
    "REACTIVE_CURRENT_LAG",
    "REACTIVE_POWER_LAG",
    "RIDE_THROUGH",
    "RIDE_THROUGH_TRIP",
    "SATURATION",
    "STABILISER",
    "STATIC_ACTIVE",
    "STATIC_REACTIVE",
    "STATOR_CURRENT_LIMITER",
    "UNDER_EXCITATION_LIMITER",
    "VOLTS_PER_HERTZ_LIMITER",
    "VOLT_VAR",
    "Effect",
    "branch_trip",
    "common_skew",
    "forced_oscillation",
    "latent_input",
    "measurement_effects",
]
