"""Contract checks for simulators, effects, screeners and calibrators, also for those of other packages.

Each check raises `AssertionError`, which says what to mend. The checks simulate and fit several times, so give them a
simulator and a recording that do not take long.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from sklearn.base import clone

from errorscreen.data.observations import Observation
from errorscreen.effects.base import Effect
from errorscreen.exceptions import InputError
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators.base import Simulator


def _require(condition: Any, message: str) -> None:
    if not condition:
        raise AssertionError(message)


def _require_equal(a: Any, b: Any, message: str) -> None:
    _require(np.array_equal(a, b, equal_nan=True), message)


def check_simulator(simulator: Simulator, n: int = 5, random_state: int = 0) -> None:
    """Check what screening and calibration rely on.

    Parameters
    ----------
    simulator : Simulator
    n : int
        Number of random parameter vectors.
    random_state : int

    Raises
    ------
    AssertionError
        If the simulator breaks the contract.

    Examples
    --------
    >>> import numpy as np
    >>> from errorscreen.events import Playback
    >>> from errorscreen.simulators import PlantSimulator
    >>> time = np.arange(0, 1, 0.02)
    >>> event = Playback(time, "dip", 0.5, {"V": 1 - 0.2 * (time > 0.5)}, {"V": 1.0, "P": 0.6, "Q": 0.1})
    >>> check_simulator(PlantSimulator("pv_plant", event))
    """
    name = type(simulator).__name__
    _require(
        isinstance(simulator, Simulator), f"{name} must be a subclass of errorscreen.simulators.Simulator"
    )
    space, channels = simulator.parameters, simulator.channels
    some = isinstance(space, ParameterSpace) and len(space)
    _require(some, f"{name}.parameters must be a non-empty ParameterSpace")
    _require(len(simulator.units) == len(channels) > 0, f"{name}.units must name one unit for each channel")
    low, high = space.bounds.T
    theta = np.random.default_rng(random_state).uniform(low, high, (n, len(space)))
    theta[0] = space.nominal
    before = theta.copy()
    found = simulator.simulate(theta)
    values = found.values
    _require_equal(theta, before, f"{name}.simulate must not change theta")
    shape = (n, len(channels), len(simulator.event.time))
    _require(values.shape == shape, f"responses have shape {values.shape}, expected {shape}")
    _require(values.dtype == np.float64, "responses must be float64")
    _require(found.channels == channels, "responses.channels must be the simulator's channels")
    _require_equal(found.time, simulator.event.time, "responses.time must be event.time")
    _require(found.ok[0], f"the nominal parameters must simulate: {found.failures()}")
    finite = np.isfinite(values).all(axis=(1, 2))
    _require_equal(finite, found.ok, "rows must be finite where the status is OK, and only there")
    _require(np.isnan(values[~found.ok]).all(), "failed rows must be NaN throughout")
    for rows, again, message in (
        (theta, values, "the same call twice must give the same result"),
        (theta[::-1], values[::-1], "a row's result must not depend on its neighbours"),
        (theta[1], values[1:2], "one vector (m,) must give the same as a row of a batch"),
    ):
        _require_equal(simulator.simulate(rows).values, again, message)
    _require_equal(copy.deepcopy(simulator).simulate(theta).values, values, "a copy must simulate the same")
    for bad in (theta[:, 1:], np.where(np.arange(len(space)) == 0, np.nan, theta)):
        try:
            simulator.simulate(bad)
        except InputError:
            continue
        raise AssertionError(
            "simulate must raise InputError for a wrong number of columns and for NaN (use validate)"
        )


def check_effect(simulator: Simulator, effect: Effect | str, n: int = 6, random_state: int = 0) -> None:
    """Check what the search for causes relies on.

    Parameters
    ----------
    simulator : Simulator
        A simulator that offers the effect.
    effect : Effect or str
        The effect or its name.
    n : int
        Number of random parameter vectors.
    random_state : int

    Raises
    ------
    AssertionError
        If the effect breaks the contract.

    Examples
    --------
    >>> import numpy as np
    >>> from errorscreen.events import Playback
    >>> from errorscreen.simulators import PlantSimulator
    >>> time = np.arange(0, 2, 0.02)
    >>> event = Playback(time, "dip", 0.5, {"V": 1 - 0.2 * (time > 0.5)}, {"V": 1.0, "P": 0.6, "Q": 0.1})
    >>> check_effect(PlantSimulator("pv_plant", event), "lag_P")
    """
    name = effect if isinstance(effect, str) else effect.name
    where = f"effect {name!r}"
    offered = [e for e in simulator.effects if e.name == name]
    _require(len(offered) == 1, f"{where} must be offered by the simulator exactly once (simulator.effects)")
    effect = offered[0]
    for field in ("title", "description", "source"):
        _require(getattr(effect, field), f"{where} must have a {field}: reports show it")
    holds_zero = effect.strength.lower <= 0.0 <= effect.strength.upper
    _require(holds_zero, f"{where}: the bounds of its strength {effect.strength.name!r} must hold 0")
    extended = simulator.extend(effect)
    k, names = len(simulator.parameters), tuple(effect.local(p.name) for p in effect.parameters)
    at_end = extended.parameters.names[k:] == names
    _require(at_end, f"{where}: extend must add its parameters behind those of the model, the strength first")
    _require(extended.extensions[-1:] == (effect,), f"{where}: extend must list it in extensions")
    _require(len(simulator.parameters) == k, f"{where}: extend must not change the simulator")
    low, high = extended.parameters.bounds.T
    theta = np.random.default_rng(random_state).uniform(low, high, (n, len(low)))
    theta[:, :k] = simulator.parameters.nominal
    theta[0] = extended.parameters.nominal
    off = theta.copy()
    off[:, k] = 0.0
    plain = simulator.simulate(off[:, :k]).values
    _require_equal(
        extended.simulate(off).values,
        plain,
        f"{where}: at strength 0 responses must be those of the model without it, bit for bit, for all values of its "
        "other parameters",
    )
    mixed = extended.simulate(np.concatenate([off, theta])).values
    alone = "a simulation must not depend on its neighbours"
    _require_equal(mixed[:n], plain, f"{where}: at strength 0 {alone}")
    alive = np.isfinite(mixed[n:]).all(axis=(1, 2)).any()
    _require(alive, f"{where}: no simulation with it ended well: choose other nominal values and bounds")
    _require_equal(mixed[n:][::-1], extended.simulate(theta[::-1]).values, f"{where}: {alone}")


def check_screener(screener: Any, recording: Any) -> None:
    """Check the parameters, fitted attributes and repeatability of a screener with a simulator.

    Parameters
    ----------
    screener : BaseScreener
        With a fixed `random_state` where it has one.
    recording : Observation, or anything ``simulator.observe`` takes

    Raises
    ------
    AssertionError
        If the screener breaks the contract.
    """
    _check_parameters(screener)
    names = screener.simulator.parameters.names
    m = len(names)
    fitted = _fit(screener, recording)
    found, order = fitted.contributions_, fitted.ranking_
    _require(found.shape == (m,), "contributions_ must have one value for each parameter")
    _require(np.all(found >= 0), "contributions_ must not be negative, equation (15)")
    _require(sorted(order) == list(range(m)), "ranking_ must be a permutation of the parameters")
    _require(np.all(np.diff(found[order]) <= 0), "ranking_ must run from the largest contribution")
    _require(fitted.ranked_names_ == tuple(names[j] for j in order), "ranked_names_ must follow ranking_")
    _require(fitted.select(1) == fitted.ranked_names_[:1], "select(k) must give the first k names")
    again = _fit(clone(screener), recording).contributions_
    _require(np.array_equal(again, found), "the same seed must give the same result")


def check_calibrator(calibrator: Any, recording: Any) -> None:
    """Check the parameters, fitted attributes and repeatability of a calibrator.

    Parameters
    ----------
    calibrator : BaseCalibrator
        With a fixed `random_state`.
    recording : Observation, or anything ``simulator.observe`` takes

    Raises
    ------
    AssertionError
        If the calibrator breaks the contract.
    """
    from errorscreen.calibration.problem import FitProblem

    _check_parameters(calibrator)
    simulator: Simulator = calibrator.simulator
    space = simulator.parameters
    fitted = _fit(calibrator, recording)
    theta, names = fitted.theta_, fitted.names_
    _require(simulator.parameters == space, "fit must not change the simulator; the result is simulator_")
    low, high = space.bounds.T
    _require(theta.shape == (len(space),), "theta_ must have one value for each parameter")
    _require(np.all((theta >= low) & (theta <= high)), "theta_ must respect the bounds")
    fixed = [j for j, name in enumerate(space.names) if name not in names]
    _require(np.array_equal(theta[fixed], space.nominal[fixed]), "other parameters must stay nominal")
    values = [fitted.values_[name] for name in names]
    agree = np.array_equal(values, theta[[space.index(name) for name in names]])
    _require(agree, "values_ must agree with theta_")
    observation = recording if isinstance(recording, Observation) else simulator.observe(recording)
    expected = simulator.simulate(theta, observation.event).values[0]
    same = np.array_equal(fitted.predict(observation), expected)
    _require(same, "predict must be the simulation at theta_")
    nominal = clone(calibrator).set_params(simulator=simulator)
    problem = FitProblem(nominal.simulator, observation, nominal.names)
    nominal._store(problem, space.subset(names).nominal)
    better = fitted.score(observation) >= nominal.score(observation) - 1e-9
    _require(better, "the fit must not be worse than no fit")
    again = _fit(clone(calibrator), recording).theta_
    _require(np.array_equal(again, theta), "the same seed must give the same result")


def _fit(estimator: Any, recording: Any) -> Any:
    fitted = estimator.fit(recording)
    _require(fitted is estimator, "fit must return self")
    return fitted


def _check_parameters(estimator: Any) -> None:
    """Check parameters, clone and repr as scikit-learn wants them; fit validates."""
    twin = clone(estimator)
    for name, value in estimator.get_params(deep=False).items():
        _require(getattr(estimator, name) is value, f"__init__ must only store {name}")
        _require(type(getattr(twin, name)) is type(value), f"clone must keep the type of {name}")
    fitted = [a for a in vars(twin) if a.endswith("_") and not a.startswith("_")]
    _require(not fitted, "nothing is fitted before fit")
    _require(type(estimator).__name__ in repr(estimator), "repr must name the class")
    try:
        estimator.set_params(no_such_parameter=1)
    except ValueError:
        return
    raise AssertionError("set_params must refuse an unknown name")
