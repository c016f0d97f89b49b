"""What every estimator that is fitted on recordings has in common."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.utils import estimator_checks

from errorscreen.calibration import MAPCalibrator, PSOCalibrator
from errorscreen.discovery import CauseFinder, FirstLook
from errorscreen.exceptions import InputError
from errorscreen.features.checks import StackTransformer
from errorscreen.screening import (
    AttributionScreener,
    BaseScreener,
    IdentifiabilityScreener,
    RandomScreener,
    SensitivityScreener,
)
from errorscreen.screening.selection import ContributionSelector
from errorscreen.testing import check_calibrator, check_screener, check_simulator
from tests.toys import linear, oscillator, product_oscillator, tone

SIMULATOR = oscillator()
RECORDING = SIMULATOR.record({"omega": 7.0, "gain": 1.2}, 0.02, seed=0)
CALIBRATORS = [
    PSOCalibrator(SIMULATOR, n_particles=5, n_iterations=4, random_state=0),
    MAPCalibrator(SIMULATOR, n_starts=2, library_size=16, random_state=0),
]
SCREENERS = [
    SensitivityScreener(SIMULATOR),
    RandomScreener(SIMULATOR, random_state=0),
    IdentifiabilityScreener(SIMULATOR),
    AttributionScreener(SIMULATOR, n_samples=4, random_state=0),
]
FINDERS = [
    CauseFinder(SIMULATOR, max_effects=0, n_starts=2, library_size=16, random_state=0),
    FirstLook(SIMULATOR, n_samples=20, random_state=0),
]
CHECKS = [
    estimator_checks.check_estimator_cloneable,
    estimator_checks.check_estimator_repr,
    estimator_checks.check_get_params_invariance,
    estimator_checks.check_set_params,
    estimator_checks.check_no_attributes_set_in_init,
    estimator_checks.check_parameters_default_constructible,
    estimator_checks.check_do_not_raise_errors_in_init_or_set_params,
    estimator_checks.check_estimator_tags_renamed,
    estimator_checks.check_valid_tag_types,
]


def name(value):
    return getattr(value, "__name__", type(value).__name__)


@pytest.mark.parametrize("estimator", CALIBRATORS + SCREENERS + FINDERS, ids=name)
@pytest.mark.filterwarnings("ignore:Can't test estimator")  # on tables, because X is a recording
def test_scikit_learn_checks(estimator):
    estimator_checks.check_estimator(estimator, on_skip=None)
    for check in CHECKS:
        check(type(estimator).__name__, clone(estimator))


@pytest.mark.parametrize("base", [BaseScreener, ContributionSelector, StackTransformer])
def test_base_classes_are_abstract(base):
    with pytest.raises(TypeError, match="abstract"):
        base()


@pytest.mark.parametrize("estimator", CALIBRATORS + SCREENERS + FINDERS[:1], ids=name)
def test_fit_returns_self_changes_no_parameter_and_repeats_itself(estimator):
    first, second = clone(estimator), clone(estimator)
    before = {key: value for key, value in first.get_params(deep=False).items() if key != "simulator"}
    assert first.fit(RECORDING) is first
    assert {k: v for k, v in first.get_params(deep=False).items() if k != "simulator"} == before
    second.fit(RECORDING).fit(RECORDING)
    for key, value in vars(first).items():
        if key.endswith("_") and isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(second, key), err_msg=key)


@pytest.mark.parametrize("estimator", CALIBRATORS, ids=name)
class TestCalibrators:
    def test_result_is_consistent(self, estimator):
        fitted = clone(estimator).set_params(names=["gain", "omega"]).fit(RECORDING)
        assert fitted.names_ == tuple(fitted.values_) == ("gain", "omega")
        nominal = SIMULATOR.parameters.nominal
        np.testing.assert_array_equal(fitted.theta_[[1, 3]], nominal[[1, 3]])
        assert [fitted.values_["omega"], fitted.values_["gain"]] == fitted.theta_[[0, 2]].tolist()
        np.testing.assert_array_equal(fitted.simulator_.parameters.nominal, fitted.theta_)
        np.testing.assert_array_equal(fitted.simulator_.parameters.bounds, SIMULATOR.parameters.bounds)
        np.testing.assert_array_equal(fitted.simulator_.parameters.scales, SIMULATOR.parameters.scales)
        np.testing.assert_array_equal(SIMULATOR.parameters.nominal, nominal)

    def test_prediction_and_score_belong_to_the_fitted_values(self, estimator):
        fitted = clone(estimator).fit(RECORDING)
        expected = SIMULATOR.simulate(fitted.theta_, RECORDING.event).values[0]
        for event in (None, RECORDING.event, RECORDING, RECORDING.values):
            np.testing.assert_array_equal(fitted.predict(event), expected)
        score = fitted.score(RECORDING)
        assert score < 0
        assert fitted.score([RECORDING, RECORDING]) == pytest.approx(2 * score)

    def test_it_never_ends_worse_than_it_began(self, estimator):
        before = clone(estimator).set_params(names=["idle"]).fit(RECORDING).score(RECORDING)
        assert clone(estimator).fit(RECORDING).score(RECORDING) > before

    def test_bounds_hold(self, estimator):
        simulator = oscillator()
        outside = simulator.record({"omega": 13.5}, 0.02, seed=0)
        seen = []
        response = simulator.response
        simulator.response = lambda p, event: seen.append(np.hstack(list(p.values()))) or response(p, event)
        estimator.__class__(simulator, random_state=0).fit(outside)
        rows = np.concatenate(seen)
        lower, upper = simulator.parameters.bounds.T
        assert np.all((rows >= lower) & (rows <= upper))

    def test_unfitted_is_said(self, estimator):
        with pytest.raises(NotFittedError):
            clone(estimator).predict()
        with pytest.raises(NotFittedError):
            clone(estimator).score(RECORDING)

    def test_wrong_input_is_named(self, estimator):
        for names, message in ((["omga"], "unknown parameter 'omga'"), ([], "empty")):
            with pytest.raises(InputError, match=message):
                clone(estimator).set_params(names=names).fit(RECORDING)
        with pytest.raises(InputError, match="list of recordings is empty"):
            clone(estimator).fit([])

    def test_failing_simulations_are_tolerated_and_counted(self, estimator):
        simulator = oscillator(fail_above=8.0)
        recording = simulator.record({"omega": 7.5}, 0.02, seed=0)
        fitted = estimator.__class__(simulator, random_state=0).fit(recording)
        assert fitted.values_["omega"] == pytest.approx(7.5, rel=0.02)
        assert 0 < fitted.n_failed_ < fitted.n_simulations_
        assert fitted.n_simulations_ <= simulator.rows

    def test_an_interrupt_keeps_the_best_so_far(self, estimator):
        simulator = oscillator()
        recording = simulator.record({"omega": 7.5}, 0.02, seed=0)
        response = simulator.response

        def stop(p, event):
            if simulator.calls > 5:
                raise KeyboardInterrupt
            return response(p, event)

        simulator.response = stop
        interrupted = estimator.__class__(simulator, random_state=0)
        with pytest.raises(KeyboardInterrupt):
            interrupted.fit(recording)
        assert 0 < interrupted.n_simulations_ < simulator.rows
        found = SIMULATOR.simulate(interrupted.theta_).values[0]
        before = SIMULATOR.baseline()
        assert np.sum((found - recording.values) ** 2) <= np.sum((before - recording.values) ** 2)


TOYS = [SIMULATOR, oscillator(fail_above=8.0), product_oscillator(), tone(), linear(np.eye(4))]


@pytest.mark.parametrize("toy", TOYS, ids=["oscillator", "failing", "product", "tone", "linear"])
def test_the_public_contract_checks_hold(toy):
    check_simulator(toy)
    first = toy.parameters[0]
    recording = toy.record({first.name: 1.15 * first.nominal}, 0.02, seed=0)
    for calibrator in CALIBRATORS:
        check_calibrator(calibrator.__class__(toy, random_state=0), recording)
    for screener in (SensitivityScreener(toy), RandomScreener(toy, random_state=0)):
        check_screener(screener, recording)
