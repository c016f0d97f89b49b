"""Contract checks for simulators, effects, screeners and calibrators, also for a user's own.

Each check raises `AssertionError` with what is wrong and what to mend. They compare results, so they need a simulator
that runs in reasonable time, and a recording (or observation) it can be compared with.
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


def check_simulator(simulator: Simulator, n: int = 5, random_state: int = 0) -> None:
    """Check that a simulator keeps the contract that screening and calibration rely on.

    Parameters
    ----------
    simulator : Simulator
    n : int
        Number of random parameter vectors to try.
    random_state : int

    Raises
    ------
    AssertionError
        With what to mend.

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
    space = simulator.parameters
    _require(
        isinstance(space, ParameterSpace) and len(space),
        f"{name}.parameters must be a non-empty ParameterSpace",
    )
    _require(
        len(simulator.units) == len(simulator.channels) > 0,
        f"{name}.units must name one unit for each channel",
    )
    low, high = space.bounds.T
    theta = np.random.default_rng(random_state).uniform(low, high, (n, len(space)))
    theta[0] = space.nominal
    before = theta.copy()
    responses = simulator.simulate(theta)
    _require(np.array_equal(theta, before), f"{name}.simulate must not change theta")
    shape = (n, len(simulator.channels), len(simulator.event.time))
    _require(
        responses.values.shape == shape, f"responses have shape {responses.values.shape}, expected {shape}"
    )
    _require(responses.values.dtype == np.float64, "responses must be float64")
    _require(responses.channels == simulator.channels, "responses.channels must be the simulator's channels")
    _require(np.array_equal(responses.time, simulator.event.time), "responses.time must be event.time")
    _require(responses.ok[0], f"the nominal parameters must simulate: {responses.failures()}")
    finite = np.isfinite(responses.values).all(axis=(1, 2))
    _require(
        np.array_equal(finite, responses.ok), "rows must be finite where the status is OK, and only there"
    )
    _require(np.isnan(responses.values[~responses.ok]).all(), "failed rows must be NaN throughout")

    def same(a: Any, b: Any, message: str) -> None:
        _require(np.array_equal(a, b, equal_nan=True), message)

    same(simulator.simulate(theta).values, responses.values, "the same call twice must give the same result")
    same(
        simulator.simulate(theta[::-1]).values,
        responses.values[::-1],
        "a row's result must not depend on its neighbours",
    )
    same(
        simulator.simulate(theta[1]).values[0],
        responses.values[1],
        "one vector (m,) must give the same as a row of a batch",
    )
    same(copy.deepcopy(simulator).simulate(theta).values, responses.values, "a copy must simulate the same")
    for bad in (theta[:, 1:], np.where(np.arange(len(space)) == 0, np.nan, theta)):
        try:
            simulator.simulate(bad)
        except InputError:
            continue
        raise AssertionError(
            "simulate must raise InputError for a wrong number of columns and for NaN (use validate)"
        )


def check_effect(simulator: Simulator, effect: Effect | str, n: int = 6, random_state: int = 0) -> None:
    """Check that an effect keeps the contract that discovery relies on.

    Parameters
    ----------
    simulator : Simulator
        That offers the effect.
    effect : Effect or str
        Or its name.
    n : int
        Number of random parameter vectors to try.
    random_state : int

    Raises
    ------
    AssertionError
        With what to mend.

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
    found = [e for e in simulator.effects if e.name == name]
    _require(len(found) == 1, f"{where} must be offered by the simulator exactly once (simulator.effects)")
    effect = found[0]
    for field in ("title", "description", "source"):
        _require(getattr(effect, field), f"{where} must have a {field}: reports show it")
    first = effect.strength
    _require(
        first.lower <= 0.0 <= first.upper,
        f"{where}: the bounds of its strength {first.name!r} must hold 0, where it is the identity",
    )
    extended = simulator.extend(effect)
    k = len(simulator.parameters)
    _require(
        extended.parameters.names[k:] == tuple(effect.local(p.name) for p in effect.parameters),
        f"{where}: extend must add its parameters behind those of the model, the strength first",
    )
    _require(extended.extensions[-1:] == (effect,), f"{where}: extend must list it in extensions")
    _require(len(simulator.parameters) == k, f"{where}: extend must not change the simulator")
    rng = np.random.default_rng(random_state)
    low, high = extended.parameters.bounds.T
    theta = rng.uniform(low, high, (n, len(low)))
    theta[:, :k] = simulator.parameters.nominal
    theta[0] = extended.parameters.nominal
    off = theta.copy()
    off[:, k] = 0.0
    plain = simulator.simulate(off[:, :k]).values
    _require(
        np.array_equal(extended.simulate(off).values, plain, equal_nan=True),
        f"{where}: at strength 0 responses must be those of the model without it, bit for bit, whatever its other "
        "parameters are",
    )
    mixed = extended.simulate(np.concatenate([off, theta])).values
    _require(
        np.array_equal(mixed[:n], plain, equal_nan=True),
        f"{where}: at strength 0 a simulation must not depend on its neighbours",
    )
    alive = np.isfinite(mixed[n:]).all(axis=(1, 2))
    _require(
        alive.any(), f"{where}: no simulation with it ended well: choose other nominal values and bounds"
    )
    _require(
        np.array_equal(mixed[n:][::-1], extended.simulate(theta[::-1]).values, equal_nan=True),
        f"{where}: a simulation must not depend on its neighbours",
    )


def check_screener(screener: Any, recording: Any) -> None:
    """Check the parameters, the fitted attributes and the determinism of a simulator-backed screener.

    Parameters
    ----------
    screener : BaseScreener
        With a fixed `random_state` where it has one.
    recording : Observation, or anything ``simulator.observe`` takes

    Raises
    ------
    AssertionError
        With what to mend.
    """
    _check_parameters(screener)
    space = screener.simulator.parameters
    fitted = _fit(screener, recording)
    m = len(space)
    _require(fitted.contributions_.shape == (m,), "contributions_ must have one value for each parameter")
    _require(np.all(fitted.contributions_ >= 0), "contributions_ must not be negative, equation (15)")
    _require(sorted(fitted.ranking_) == list(range(m)), "ranking_ must be a permutation of the parameters")
    _require(
        np.all(np.diff(fitted.contributions_[fitted.ranking_]) <= 0),
        "ranking_ must run from the largest contribution",
    )
    _require(
        fitted.ranked_names_ == tuple(space.names[j] for j in fitted.ranking_),
        "ranked_names_ must follow ranking_",
    )
    _require(fitted.select(1) == fitted.ranked_names_[:1], "select(k) must give the k first names")
    again = _fit(clone(screener), recording)
    _require(
        np.array_equal(again.contributions_, fitted.contributions_), "the same seed must give the same result"
    )


def check_calibrator(calibrator: Any, recording: Any) -> None:
    """Check the parameters, the fitted attributes and the determinism of a calibrator.

    Parameters
    ----------
    calibrator : BaseCalibrator
        With a fixed `random_state`.
    recording : Observation, or anything ``simulator.observe`` takes

    Raises
    ------
    AssertionError
        With what to mend.
    """
    _check_parameters(calibrator)
    simulator: Simulator = calibrator.simulator
    before = simulator.parameters
    fitted = _fit(calibrator, recording)
    space = simulator.parameters
    _require(space == before, "fit must not change the simulator; the result is simulator_")
    low, high = space.bounds.T
    _require(fitted.theta_.shape == (len(space),), "theta_ must have one value for each parameter")
    _require(np.all((fitted.theta_ >= low) & (fitted.theta_ <= high)), "theta_ must respect the bounds")
    fixed = [j for j, name in enumerate(space.names) if name not in fitted.names_]
    _require(
        np.array_equal(fitted.theta_[fixed], space.nominal[fixed]), "what is not calibrated must stay nominal"
    )
    values = [fitted.values_[name] for name in fitted.names_]
    _require(
        np.array_equal(values, fitted.theta_[[space.index(n) for n in fitted.names_]]),
        "values_ must agree with theta_",
    )
    observation = recording if isinstance(recording, Observation) else simulator.observe(recording)
    expected = simulator.simulate(fitted.theta_, observation.event).values[0]
    _require(
        np.array_equal(fitted.predict(observation), expected), "predict must be the simulation at theta_"
    )
    nominal = clone(calibrator).set_params(simulator=simulator)
    nominal._store(_problem(nominal, observation), space.subset(fitted.names_).nominal)
    _require(
        fitted.score(observation) >= nominal.score(observation) - 1e-9,
        "the fit must not be worse than no fit",
    )
    again = _fit(clone(calibrator), recording)
    _require(np.array_equal(again.theta_, fitted.theta_), "the same seed must give the same result")


def _problem(calibrator: Any, observation: Observation) -> Any:
    from errorscreen.calibration.problem import FitProblem

    return FitProblem(calibrator.simulator, observation, calibrator.names)


def _fit(estimator: Any, recording: Any) -> Any:
    fitted = estimator.fit(recording)
    _require(fitted is estimator, "fit must return self")
    return fitted


def _check_parameters(estimator: Any) -> None:
    """Parameters, clone and repr as scikit-learn wants them; validation belongs into fit."""
    parameters = estimator.get_params(deep=False)
    twin = clone(estimator)
    for name, value in parameters.items():
        _require(getattr(estimator, name) is value, f"__init__ must only store {name}")
        other = twin.get_params(deep=False)[name]
        _require(type(other) is type(value), f"clone must keep the type of {name}")
    _require(
        not [a for a in vars(twin) if a.endswith("_") and not a.startswith("_")],
        "nothing is fitted before fit",
    )
    _require(type(estimator).__name__ in repr(estimator), "repr must name the class")
    try:
        estimator.set_params(no_such_parameter=1)
    except ValueError:
        pass
    else:
        raise AssertionError("set_params must refuse an unknown name")
