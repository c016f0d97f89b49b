"""Mechanisms that a model may lack."""

from collections import Counter

from errorscreen._runtime.registry import Registry
from errorscreen.effects.base import KINDS, Effect
from errorscreen.effects.control_lag import ACTIVE_CURRENT_LAG, REACTIVE_CURRENT_LAG, REACTIVE_POWER_LAG
from errorscreen.effects.current_priority import CURRENT_PRIORITY
from errorscreen.effects.event_effects import FAULT_DURATION, FAULT_IMPEDANCE, branch_trip
from errorscreen.effects.excitation_limiters import (
    FIELD_CURRENT_LIMITER,
    STATOR_CURRENT_LIMITER,
    UNDER_EXCITATION_LIMITER,
    UNIT_FIELD_LIMITER,
    UNIT_UNDER_EXCITATION_LIMITER,
    VOLTS_PER_HERTZ_LIMITER,
)
from errorscreen.effects.exciter import EXCITER, UNIT_EXCITER
from errorscreen.effects.forced_oscillation import forced_oscillation
from errorscreen.effects.gas_governor import GAS_GOVERNOR
from errorscreen.effects.governor import GOVERNOR, STEAM_GOVERNOR
from errorscreen.effects.governor_dead_band import GOVERNOR_DEAD_BAND
from errorscreen.effects.hydro_governor import HYDRO_GOVERNOR
from errorscreen.effects.latent_input import latent_input
from errorscreen.effects.load import FREQUENCY_DEPENDENCE, MOTOR_LOAD, STATIC_ACTIVE, STATIC_REACTIVE
from errorscreen.effects.measurement import common_skew, measurement_effects
from errorscreen.effects.mva_base import mva_base
from errorscreen.effects.parts_acting import (
    GOVERNOR_ACTING,
    REGULATOR_ACTING,
    STABILISER_ACTING,
    UNDER_EXCITATION_ACTING,
)
from errorscreen.effects.phase_locked_loop import PHASE_LOCKED_LOOP
from errorscreen.effects.ramp_limit import RAMP_LIMIT
from errorscreen.effects.ride_through import HIGH_VOLTAGE_TRIP, RIDE_THROUGH, RIDE_THROUGH_TRIP
from errorscreen.effects.saturation import SATURATION, UNIT_SATURATION
from errorscreen.effects.stabiliser import STABILISER, STABILISER_INPUT, UNIT_STABILISER
from errorscreen.effects.volt_var import VOLT_VAR
from errorscreen.exceptions import InputError

#: Effects of the library. Effects at one port act in this order. `latent_*` exist only for ports that add a quantity of
#: their own: a signal at df of the wind plant, say, would show at the next of these ports.
EFFECTS: Registry[Effect] = Registry(
    "effect",
    "errorscreen.effects",
    Effect,
    {
        "exciter": EXCITER,
        "unit_exciter": UNIT_EXCITER,
        "stabiliser": STABILISER,
        "unit_stabiliser": UNIT_STABILISER,
        "stabiliser_input": STABILISER_INPUT,
        "stabiliser_acting": STABILISER_ACTING,
        "under_excitation_acting": UNDER_EXCITATION_ACTING,
        "regulator_acting": REGULATOR_ACTING,
        "saturation": SATURATION,
        "unit_saturation": UNIT_SATURATION,
        "field_limiter": FIELD_CURRENT_LIMITER,
        "unit_field_limiter": UNIT_FIELD_LIMITER,
        "stator_limiter": STATOR_CURRENT_LIMITER,
        "under_excitation": UNDER_EXCITATION_LIMITER,
        "unit_under_excitation": UNIT_UNDER_EXCITATION_LIMITER,
        "volts_per_hertz": VOLTS_PER_HERTZ_LIMITER,
        "governor": GOVERNOR,
        "hydro_governor": HYDRO_GOVERNOR,
        "steam_governor": STEAM_GOVERNOR,
        "gas_governor": GAS_GOVERNOR,
        "governor_acting": GOVERNOR_ACTING,
        "governor_dead_band": GOVERNOR_DEAD_BAND,
        "lag_active": ACTIVE_CURRENT_LAG,
        "lag_reactive_power": REACTIVE_POWER_LAG,
        "lag_reactive_current": REACTIVE_CURRENT_LAG,
        "priority": CURRENT_PRIORITY,
        "volt_var": VOLT_VAR,
        "cessation": RIDE_THROUGH,
        "trip": RIDE_THROUGH_TRIP,
        "trip_high": HIGH_VOLTAGE_TRIP,
        "ramp": RAMP_LIMIT,
        "pll": PHASE_LOCKED_LOOP,
        "static_active": STATIC_ACTIVE,
        "static_reactive": STATIC_REACTIVE,
        "frequency_dependence": FREQUENCY_DEPENDENCE,
        "motor": MOTOR_LOAD,
        "oscillation_Pm": forced_oscillation("Pm", "synchronous_machine", "computed Pm"),
        "oscillation_Pwi": forced_oscillation("Pwi", "dfig_plant"),
        "oscillation_Ip_cmd": forced_oscillation("Ip_cmd", "pv_plant"),
        "latent_Efd": latent_input("Efd", 4.0, devices=("synchronous_machine", "computed Efd")),
        "latent_Pm": latent_input("Pm", 1.0, devices=("synchronous_machine", "computed Pm")),
        "latent_Ip_cmd": latent_input("Ip_cmd", 1.0, devices=("dfig_plant", "pv_plant")),
        "latent_Qcmd": latent_input("Qcmd", 1.0, devices=("dfig_plant",)),
        "latent_Iq_cmd": latent_input("Iq_cmd", 1.0, devices=("pv_plant",)),
        "latent_Qref": latent_input("Qref", 1.0, devices=("pv_plant",)),
        "latent_Ipcmd": latent_input("Ipcmd", 1.0, devices=("converter unit",)),
        "latent_Iqcmd": latent_input("Iqcmd", 1.0, devices=("converter unit",)),
        "latent_dP": latent_input("dP", 0.5, devices=("load",)),
        "latent_dQ": latent_input("dQ", 0.5, devices=("load",)),
    },
)


def effects_of(device: str, *tags: str) -> tuple[Effect, ...]:
    """Effects that are compiled into the models of a device, in the order in which they act.

    Parameters
    ----------
    device : str
        Name of the device.
    *tags : str
        What else effects may ask for, see `errorscreen.models.device.Device.tags`.

    Raises
    ------
    InputError
        If two of its effects have the same name.

    Examples
    --------
    >>> [effect.name for effect in effects_of("load")][:3]
    ['static_active', 'static_reactive', 'frequency_dependence']
    """
    known = (EFFECTS.usable(name) for name in EFFECTS)
    found = tuple(effect for effect in known if effect is not None and {device, *tags} & {*effect.devices})
    for name, count in Counter(effect.name for effect in found).items():
        if count > 1:
            raise InputError(
                f"{count} effects have the name {name!r}",
                where=f"device {device!r}",
                allowed="a name of its own for each effect of a device",
            )
    return found


__all__ = [
    "EFFECTS",
    "FAULT_DURATION",
    "FAULT_IMPEDANCE",
    "KINDS",
    "Effect",
    "branch_trip",
    "common_skew",
    "effects_of",
    "forced_oscillation",
    "latent_input",
    "measurement_effects",
    "mva_base",
]
