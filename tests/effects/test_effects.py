"""One property test for the whole library: strength 0 is an exact identity."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from errorscreen.effects import EFFECTS, EXCITER, effects_of
from errorscreen.effects.ride_through import RIDE_THROUGH, RIDE_THROUGH_TRIP
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES, LOAD
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import CONVERTER_PORTS, MACHINE_PORTS
from tests.models.reference import Machine
from tests.plants import DEVICE_NAMES, dip, flat, plant, random_rows

PAIRS = [(device, effect.name) for device in DEVICE_NAMES for effect in plant(device).effects]
#: they act by themselves, or on the record as a whole
RESTLESS = ("oscillation", "latent", "scale", "offset")


@pytest.mark.parametrize(("device", "effect"), PAIRS)
def test_strength_zero_is_an_exact_identity(device, effect):
    """Bit for bit, alone and beside simulations that use the effect, whatever its other parameters are.

    In the reference engine as well: it gives the same bits for rows with and without the effect.
    """
    # a volts-per-hertz limiter acts at high voltage
    event = dip(stop=1.6, depth=-0.2 if effect in ("volts_per_hertz", "trip_high") else 0.55)
    base = plant(device, event, step=0.005)  # the reference engine takes its time for each step
    extended = base.extend(effect)
    theta = random_rows(extended, 33, seed=7)
    theta[::3, len(base.parameters)] = 0.0  # every third one is off
    plain = base.simulate(theta[:, : len(base.parameters)]).values
    mixed = extended.simulate(theta).values
    alone = extended.simulate(theta[::3]).values
    assert np.array_equal(mixed[::3], plain[::3], equal_nan=True)
    assert np.array_equal(alone, plain[::3], equal_nan=True)
    on = np.setdiff1d(np.arange(33), np.arange(0, 33, 3))
    # a limiter rests where its limit is not reached
    if effect not in ("trip", "trip_high"):  # which take longer than this record
        assert np.nanmax(np.abs(mixed[on] - plain[on])) > 1e-3
    reference = plant(device, event, engine="numpy", step=0.005).extend(effect)
    assert np.array_equal(mixed, reference.simulate(theta).values, equal_nan=True)


@pytest.mark.parametrize(("device", "effect"), [pair for pair in PAIRS if not pair[1].startswith(RESTLESS)])
def test_effects_leave_the_equilibrium_alone(device, effect):
    extended = plant(device, flat()).extend(effect)
    values = extended.simulate(random_rows(extended, 20)).require_ok().values
    assert np.abs(values - np.array([0.7, 0.15])[:, None]).max() < 1e-9


def test_extended_simulator_is_just_a_simulator():
    base = plant("synchronous_machine")
    both = base.extend("exciter", K={"nominal": 50.0}).extend("lag_Q")
    assert both.parameters.names[-5:] == ("exciter.K", "exciter.TA_TB", "exciter.TB", "exciter.TE", "lag_Q.T")
    assert both.parameters["exciter.K"].nominal == 50.0
    assert len(base.parameters) == 8
    assert [e.name for e in both.extensions] == ["exciter", "lag_Q"]
    with pytest.raises(InputError, match="has been added before"):
        both.extend("exciter")
    with pytest.raises(InputError, match=r"unknown effect 'exiter' \(did you mean 'exciter'"):
        base.extend("exiter")


@pytest.mark.parametrize("T", [0.001, 0.05, 0.4])
def test_lag_is_exact_for_a_piecewise_linear_signal(T):
    """Against an adaptive solution of T y' = u - y, driven by the simulated P itself."""
    event = dip(stop=2.0, dt=0.0025)  # one step per sample: P is known where the lag sees it
    base = plant("synchronous_machine", event)
    P = base.simulate(base.parameters.nominal).values[0, 0]
    extended = base.extend("lag_P")
    found = extended.simulate([*base.parameters.nominal, T]).values[0]
    y = [P[0]]
    for k in range(len(P) - 1):
        t0, slope = event.time[k], (P[k + 1] - P[k]) / event.dt
        solution = solve_ivp(
            lambda t, y, k=k, t0=t0, slope=slope: (P[k] + slope * (t - t0) - y) / T,
            (t0, event.time[k + 1]), [y[-1]], rtol=1e-10, atol=1e-12, method="LSODA",
        )  # fmt: skip
        y.append(solution.y[0, -1])
    assert np.abs(found[0] - y).max() < 1e-7
    assert np.array_equal(found[1], base.simulate(base.parameters.nominal).values[0, 1])  # Q is not touched


def test_exciter_supports_the_voltage_as_its_equations_say():
    """SEXS written independently, driven by the terminal voltage; the machine's field voltage follows from Q."""
    event = dip(stop=3.0, swing=0.0, duration=1.0, depth=0.1)
    base = plant("synchronous_machine", event, step=5e-4)
    extended = base.extend("exciter")
    theta = [*base.parameters.nominal, 80.0, 0.2, 5.0, 0.05]
    K, TA_TB, TB, TE = theta[-4:]
    found = extended.simulate(theta).values[0]

    p = dict(zip(base.parameters.names, base.parameters.nominal, strict=True)) | base.constants
    machine = Machine(p, 1.0, 0.7, 0.15)
    low, high = -machine.efd, 5.0 - machine.efd

    voltage = PchipInterpolator(event.time, event.signals["V"])

    def slope(t, x):
        V = float(voltage(t))
        lead, E = x[4:]
        machine.efd = efd0 + min(max(E, low), high)
        output = lead + TA_TB * (1.0 - V - lead)
        dE = (K * output - E) / TE
        held = (high <= E and dE > 0) or (low >= E and dE < 0)
        return [*machine.slope(x[:4], complex(V)), (1.0 - V - lead) / TB, 0.0 if held else dE]

    efd0 = machine.efd
    solution = solve_ivp(
        slope, (0, event.time[-1]), [*machine.start(), 0.0, 0.0], t_eval=event.time, max_step=2e-3, rtol=1e-8
    )
    expected = np.array([
        machine.power(x[:4], complex(V)) for x, V in zip(solution.y.T, event.signals["V"], strict=True)
    ]).T  # fmt: skip
    plain = base.simulate(base.parameters.nominal).values[0]
    assert np.abs(plain - found).max() > 0.1
    assert np.abs(found - expected).max() < 1e-3


def test_library_is_documented():
    for device in DEVICE_NAMES:
        for effect in plant(device).effects:
            assert effect.strength.lower <= 0.0 < effect.strength.upper
            assert effect.description
            assert effect.source
            assert effect.confused_with


def test_a_trip_and_a_cessation_name_each_other():
    """Their equations are the same, only the durations differ."""
    assert "a ride-through trip" in RIDE_THROUGH.confused_with
    assert "momentary cessation" in RIDE_THROUGH_TRIP.confused_with


def test_an_effect_on_a_port_that_a_device_lacks_is_refused():
    with pytest.raises(
        InputError, match=r"effect 'exciter' on device 'pv_plant': unknown port 'Efd'.*Ip_cmd"
    ):
        plant("pv_plant", effects=(EXCITER,))


def test_every_effect_belongs_to_a_device_that_has_its_ports():
    ports = {device.name: device.ports for device in (*DEVICES.values(), LOAD)}
    of_units = {**MACHINE_PORTS, **CONVERTER_PORTS}
    constants = {field.name for part in PARTS.values() for field in part.fields}
    for name, effect in EFFECTS.items():
        assert effect.devices, name
        for device in effect.devices:
            # what is no device is a tag of units of standard models
            known = constants if effect.kind == "constants" else ports.get(device, of_units)
            assert {effect.port, *effect.beside} <= set(known)
            assert effect in effects_of(device)


def test_two_effects_of_a_device_with_the_same_name_are_refused(monkeypatch):
    monkeypatch.setitem(EFFECTS._items, "another", replace(EXCITER, title="Another exciter"))
    with pytest.raises(InputError, match="device 'synchronous_machine': 2 effects have the name 'exciter'"):
        effects_of("synchronous_machine")
