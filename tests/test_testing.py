import copy
from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration import MAPCalibrator, PSOCalibrator
from errorscreen.data.recordings import Recording
from errorscreen.screening import RandomScreener, SensitivityScreener
from errorscreen.simulators import PlantSimulator, Simulator
from errorscreen.testing import check_calibrator, check_effect, check_screener, check_simulator
from tests.plants import DEVICE_NAMES, dip, plant


@pytest.fixture(scope="module")
def observed():
    """A dip recorded at a machine whose parameters are not the nominal ones."""
    event = dip(stop=2.5)
    truth = plant("synchronous_machine", event, step=5e-4)
    theta = truth.parameters.nominal * np.array([1.1, 0.9, 0.9, 1.1, 1.2, 0.85, 1.15, 0.8])
    P, Q = truth.simulate(theta).values[0]
    rng = np.random.default_rng(11)
    values = {"V": event.signals["V"], "angle": event.signals["angle"]}
    values |= {"P": P + 1e-3 * rng.standard_normal(P.shape), "Q": Q + 1e-3 * rng.standard_normal(P.shape)}
    recording = Recording.from_arrays(event.time, values, base_mva=100, f_nominal=60, event_time=1.0)
    simulator = PlantSimulator("synchronous_machine", recording)
    return simulator, simulator.observe(recording)


@pytest.mark.parametrize("device", DEVICE_NAMES)
@pytest.mark.parametrize("effects", [(), ("lag_P", "lag_Q")])
def test_plants_keep_the_contract(device, effects):
    simulator = plant(device)
    for effect in effects:
        simulator = simulator.extend(effect)
    check_simulator(simulator)


def test_the_machine_with_exciter_keeps_the_contract():
    check_simulator(plant("synchronous_machine").extend("exciter"))


@pytest.mark.parametrize("screener", [RandomScreener, SensitivityScreener])
def test_screeners_keep_the_contract(screener, observed):
    simulator, observation = observed
    options = {"random_state": 0} if screener is RandomScreener else {}
    check_screener(screener(simulator, **options), observation)


@pytest.mark.parametrize("names", [None, ("Tj", "Xd1")])
def test_map_calibrator_keeps_the_contract(names, observed):
    simulator, observation = observed
    check_calibrator(
        MAPCalibrator(simulator, names, n_starts=2, library_size=64, random_state=0), observation
    )


@pytest.mark.parametrize("names", [None, ("Tj", "Xd1")])
def test_pso_calibrator_keeps_the_contract(names, observed):
    simulator, observation = observed
    check_calibrator(
        PSOCalibrator(simulator, names, n_particles=8, n_iterations=5, random_state=0), observation
    )


class Broken(Simulator):
    """A plant with one fault, to see that the check finds it."""

    def __init__(self, fault):
        self._plant = plant("pv_plant", dip(stop=1.5))
        self.parameters, self.channels, self.units = (
            self._plant.parameters,
            self._plant.channels,
            self._plant.units,
        )
        self.event, self.fault, self.calls = self._plant.event, fault, 0

    def observe(self, recording):
        return self._plant.observe(recording)

    def simulate(self, theta, event=None):
        if self.fault == "no validation":
            theta = np.nan_to_num(np.atleast_2d(theta), nan=1.0)
            theta = np.pad(theta, ((0, 0), (0, len(self.parameters) - theta.shape[1])), constant_values=1.0)
        responses = self._plant.simulate(theta, event)
        self.calls += 1
        if self.fault == "state":
            responses.values[:] += 1e-6 * self.calls
        if self.fault == "neighbours":
            responses.values[:] += 1e-6 * np.arange(len(responses.values))[:, None, None]
        if self.fault == "nan":
            responses.values[-1, 0, 3] = np.nan
        return responses


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("state", "same call twice"),
        ("neighbours", "depend on its neighbours"),
        ("nan", "finite where the status is OK"),
        ("no validation", "must raise InputError"),
    ],
)
def test_faults_are_found(fault, message):
    with pytest.raises(AssertionError, match=message):
        check_simulator(Broken(fault))


PLANTS = {name: plant(name) for name in DEVICE_NAMES}


@pytest.mark.parametrize(
    ("device", "effect"), [(name, e.name) for name, built in PLANTS.items() for e in built.effects]
)
def test_effects_of_plants_keep_the_contract(device, effect):
    check_effect(PLANTS[device], effect)


def faulty(**changes):
    """A plant that offers one effect of the measurement, with a fault."""
    simulator = PLANTS["pv_plant"]
    good = next(e for e in simulator.effects if e.name == "lag_P")
    changed = copy.copy(simulator)
    changed.effects = tuple(replace(e, **changes) if e is good else e for e in simulator.effects)
    return changed


def shifts_the_start(value, T):
    return 1.0001 * value


def looks_around(values, h, T):
    return values + 1e-9 * np.arange(len(values))[:, None]


def breaks(values, h, T):
    return np.where(T[:, None] > 0, np.nan, values)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recorded": shifts_the_start}, "at strength 0 responses must be those of the model without it"),
        ({"equations": looks_around}, "must not depend on its neighbours"),
        ({"equations": breaks}, "no simulation with it ended well"),
        ({"description": ""}, "must have a description"),
        ({"source": ""}, "must have a source"),
    ],
)
def test_faults_of_effects_are_found(changes, message):
    with pytest.raises(AssertionError, match=message):
        check_effect(faulty(**changes), "lag_P")


def test_an_effect_that_is_not_offered_is_named():
    with pytest.raises(AssertionError, match="'governor' must be offered"):
        check_effect(PLANTS["pv_plant"], "governor")
