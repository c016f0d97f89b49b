import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import norm

from errorscreen.calibration import MAPCalibrator
from errorscreen.exceptions import DataWarning, InputError, SimulationError
from tests.toys import TIME, Pulse, linear, oscillator, product_oscillator, tone

SIMULATOR = oscillator()
TRUTH = {"omega": 8.0, "zeta": 0.06, "gain": 1.4}
SHORT = Pulse(TIME, name="short", start=0.5, duration=0.2)
RECORDINGS = [SIMULATOR.record(TRUTH, 0.01, seed=0), SIMULATOR.record(TRUTH, 0.02, seed=1, event=SHORT)]
COLUMNS = np.linalg.qr(np.random.default_rng(0).standard_normal((400, 3)))[0] * 20.0


def test_a_linear_fit_is_the_closed_form():
    simulator = linear(COLUMNS)
    recording = simulator.record({"p0": 1.4, "p2": 0.2}, 0.5, seed=0)
    fitted = MAPCalibrator(simulator, prior_scale=0.2, n_starts=1, tol=1e-10).fit(recording)
    A, y = COLUMNS / 0.5, recording.values[0] / 0.5
    covariance = np.linalg.inv(A.T @ A + np.eye(3) / 0.2**2)
    expected = 1 + covariance @ A.T @ (y - A @ np.ones(3))
    np.testing.assert_allclose(fitted.theta_, expected, rtol=1e-6)
    np.testing.assert_allclose(
        fitted.covariance_, covariance * (fitted.covariance_[0, 0] / covariance[0, 0]), rtol=1e-4, atol=1e-12
    )
    half = norm.ppf(0.95) * np.sqrt(np.diag(fitted.covariance_))
    np.testing.assert_allclose(
        fitted.intervals_, np.stack([expected - half, expected + half], axis=1), rtol=1e-6
    )
    assert fitted.chi2_ == pytest.approx(np.sum((A @ fitted.theta_ - y) ** 2))
    assert fitted.chi2_per_sample_ == pytest.approx(fitted.chi2_ / 400)
    assert fitted.converged_


def test_without_prior_and_bounds_it_is_scipys_least_squares():
    names = ["omega", "zeta", "gain"]
    fitted = MAPCalibrator(SIMULATOR, names, prior_scale=1e5, n_starts=1, tol=1e-10).fit(RECORDINGS)

    def residuals(values):
        theta = SIMULATOR.parameters.embed(values, names)
        return np.concatenate(
            [
                ((SIMULATOR.simulate(theta, o.event).values[0] - o.values) / o.noise[:, None]).ravel()
                for o in RECORDINGS
            ]
        )

    expected = least_squares(residuals, [6.0, 0.1, 1.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(list(fitted.values_.values()), expected.x, rtol=1e-6)
    assert fitted.chi2_ == pytest.approx(2 * expected.cost)


def test_values_do_not_depend_on_what_was_not_measured():
    gap = SIMULATOR.record(TRUTH, 0.01, seed=0)
    gap.values[:, 60:90] = np.nan
    cut = SIMULATOR.record(TRUTH, 0.01, seed=0)
    cut.values[:, 60:90] = 1e9
    cut.values[:, 60:90] = np.nan
    one, other = (MAPCalibrator(SIMULATOR, random_state=0).fit(r) for r in (gap, cut))
    np.testing.assert_array_equal(one.theta_, other.theta_)
    assert one.chi2_per_sample_ == pytest.approx(one.chi2_ / (2 * 131))
    assert one.values_["omega"] == pytest.approx(8.0, rel=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_floor_is_reached_where_one_start_gets_stuck(seed):
    simulator = tone()
    recording = simulator.record({"omega": np.random.default_rng(seed).uniform(14, 29)}, 0.02, seed=seed)
    stuck = MAPCalibrator(simulator, prior_scale=2.0, n_starts=1).fit(recording)
    fitted = MAPCalibrator(simulator, prior_scale=2.0, random_state=seed).fit(recording)
    assert stuck.chi2_per_sample_ > 100
    assert fitted.chi2_per_sample_ < 1 + 4 * np.sqrt(2 / 161)
    assert fitted.converged_
    assert 2 <= len(fitted.starts_) <= 8
    assert fitted.starts_[0]["chi2_per_sample"] == pytest.approx(stuck.chi2_per_sample_, rel=1e-6)


def test_a_given_start_is_followed_instead_of_the_nominal_one():
    simulator = tone()
    recording = simulator.record({"omega": 25.0}, 0.02, seed=0)
    stuck = MAPCalibrator(simulator, prior_scale=2.0, n_starts=1).fit(recording)
    near = simulator.parameters.embed([24.8], ["omega"])
    fitted = MAPCalibrator(simulator, prior_scale=2.0, n_starts=1, starts=near).fit(recording)
    assert stuck.chi2_per_sample_ > 100
    assert fitted.chi2_per_sample_ < 1.5
    assert len(fitted.starts_) == 1


def test_further_starts_are_taken_only_where_noise_does_not_explain_the_rest():
    right = MAPCalibrator(SIMULATOR, random_state=0).fit(SIMULATOR.record(TRUTH, 0.01, seed=0))
    assert len(right.starts_) == 2
    wrong = SIMULATOR.record(TRUTH, 0.01, seed=0)
    wrong.values[0] += 0.1 * np.sin(20 * TIME)  # no parameter makes it
    assert len(MAPCalibrator(SIMULATOR, random_state=0).fit(wrong).starts_) == 8


def test_samples_of_a_linear_fit_have_its_covariance():
    simulator = linear(COLUMNS)
    recording = simulator.record({"p0": 1.4, "p2": 0.2}, 0.5, seed=0)
    fitted = MAPCalibrator(simulator, n_starts=1).fit(recording)
    samples = fitted.sample_posterior(20_000, random_state=0)
    deviation = np.sqrt(np.diag(fitted.covariance_))
    np.testing.assert_allclose(samples.mean(axis=0), fitted.theta_, atol=0.05 * deviation.max())
    np.testing.assert_allclose(np.cov(samples.T), fitted.covariance_, atol=0.05 * deviation.max() ** 2)


def test_samples_stay_inside_the_bounds_and_on_the_determined_product():
    simulator = product_oscillator()
    recording = simulator.record({"a": 3.9, "b": 0.9}, 0.01, seed=0)
    fitted = MAPCalibrator(simulator, ["a", "b"], random_state=0).fit(recording)
    samples = fitted.sample_posterior(500, random_state=0)
    lower, upper = simulator.parameters.bounds.T
    assert np.all((samples >= lower) & (samples <= upper))
    product = samples[:, simulator.parameters.index("a")] * samples[:, simulator.parameters.index("b")]
    assert product.std() < 0.25 * samples[:, simulator.parameters.index("a")].std()
    others = [simulator.parameters.index(name) for name in ("omega", "zeta")]
    assert np.all(samples[:, others] == simulator.parameters.nominal[others])


def test_intervals_hold_the_truth_as_often_as_they_say():
    simulator, n, level = linear(COLUMNS), 150, 0.9
    rng = np.random.default_rng(5)
    hits, expected = np.zeros((n, 3), dtype=bool), np.zeros((n, 3))
    deviation = np.sqrt(np.diag(np.linalg.inv(COLUMNS.T @ COLUMNS / 4 + np.eye(3) / 0.3**2)))
    for i in range(n):
        truth = 1 + 0.3 * rng.standard_normal(3)  # from the prior, as the intervals assume
        recording = simulator.record(dict(zip(("p0", "p1", "p2"), truth, strict=True)), 2.0, seed=i)
        fitted = MAPCalibrator(simulator, n_starts=1, level=level).fit(recording)
        low, high = fitted.intervals_.T
        hits[i] = (low <= truth) & (truth <= high)
        # inflation only ever widens; what it widens to is known
        expected[i] = (
            2 * norm.cdf(norm.ppf(0.5 + level / 2) * np.sqrt(np.diag(fitted.covariance_)) / deviation) - 1
        )
    assert np.all(expected >= level - 1e-9)
    assert expected.mean() < level + 0.03
    spread = np.sqrt((expected * (1 - expected)).sum())
    assert abs(hits.sum() - expected.sum()) < 3 * spread


def test_intervals_of_a_nonlinear_model_hold_the_truth_as_often_as_they_say():
    names, n = list(TRUTH), 100
    hits = np.zeros((n, 3), dtype=bool)
    for i in range(n):
        recording = SIMULATOR.record(TRUTH, 0.05, seed=1000 + i)
        fitted = MAPCalibrator(SIMULATOR, names, n_starts=1, prior_scale=2.0).fit(recording)
        hits[i] = [low <= v <= high for v, (low, high) in zip(TRUTH.values(), fitted.intervals_, strict=True)]
    assert np.all(hits.mean(axis=0) > 0.9 - 3 * np.sqrt(0.9 * 0.1 / n))


def test_a_pull_outside_the_bounds_ends_on_the_bound_and_is_flagged():
    recording = SIMULATOR.record({"gain": 2.6}, 0.02, seed=0)
    fitted = MAPCalibrator(SIMULATOR, random_state=0).fit(recording)
    assert fitted.values_["gain"] == 2.0
    assert fitted.at_bound_.tolist() == [False, False, True, False]
    assert fitted.intervals_[2, 1] == 2.0
    assert np.all(fitted.intervals_ >= SIMULATOR.parameters.bounds[:, :1])
    assert fitted.chi2_per_sample_ > 2


def test_a_product_is_one_group_and_an_idle_parameter_none():
    simulator = product_oscillator()
    recording = simulator.record({"a": 3.0, "omega": 7.0}, 0.01, seed=0)
    fitted = MAPCalibrator(simulator, random_state=0).fit(recording)
    assert fitted.groups_ == [("a", "b")]
    assert fitted.identifiable_.tolist() == [True, False, True, False]
    assert fitted.correlation_[1, 3] < -0.99
    assert fitted.values_["a"] * fitted.values_["b"] == pytest.approx(1.5, rel=0.01)
    # the prior shares a relative change among both
    assert fitted.values_["a"] / 2.0 == pytest.approx(fitted.values_["b"] / 0.5, rel=0.01)

    idle = MAPCalibrator(SIMULATOR, random_state=0).fit(RECORDINGS)
    assert idle.groups_ == []
    assert idle.identifiable_.tolist() == [True, True, True, False]
    assert idle.values_["idle"] == pytest.approx(3.0)
    np.testing.assert_array_equal(idle.intervals_[3], [2.0, 4.0])


def test_a_misfit_that_is_no_noise_widens_the_intervals():
    clean, wrong = (SIMULATOR.record({"omega": 8.0, "gain": 1.4}, 0.01, seed=0) for _ in range(2))
    wrong.values[:] += 0.1 * np.sin(2.0 * TIME)
    fits = [MAPCalibrator(SIMULATOR, ["omega", "gain"], random_state=0).fit(r) for r in (clean, wrong)]
    assert fits[0].inflation_ < 1.5
    assert fits[1].inflation_ > 10 * fits[1].chi2_per_sample_  # because it is smooth in time
    assert np.all(np.ptp(fits[1].intervals_, axis=1) > 5 * np.ptp(fits[0].intervals_, axis=1))
    low, high = fits[1].intervals_.T
    assert np.all((low < [8.0, 1.4]) & (high > [8.0, 1.4]))


def test_two_recordings_narrow_the_intervals():
    one, both = (
        MAPCalibrator(SIMULATOR, ["omega"], random_state=0).fit(r) for r in (RECORDINGS[0], RECORDINGS)
    )
    assert np.ptp(both.intervals_) < np.ptp(one.intervals_)


def test_a_fit_next_to_a_region_that_fails_uses_the_side_that_works():
    simulator = oscillator(fail_above=8.0003)
    recording = simulator.record({"omega": 8.0, "gain": 1.2}, 0.01, seed=0)
    fitted = MAPCalibrator(simulator, random_state=0).fit(recording)
    assert fitted.values_["omega"] == pytest.approx(8.0, rel=0.002)
    assert fitted.identifiable_[0]
    assert fitted.n_failed_ > 0


def test_each_iteration_is_two_calls_for_each_event():
    simulator = oscillator()
    fitted = MAPCalibrator(simulator, library_size=64, random_state=0).fit(RECORDINGS)
    iterations = len(fitted.history_["active"])
    # library, starts, residuals at the end; the last iteration only finds that all have converged
    assert simulator.calls <= 2 * (3 + 2 * iterations)
    assert fitted.n_simulations_ == simulator.rows
    assert np.all(np.diff(fitted.history_["chi2_per_sample"]) <= 1e-9)
    assert fitted.history_["active"][-1] == 0


def test_iterations_that_do_not_suffice_are_reported():
    fitted = MAPCalibrator(SIMULATOR, n_starts=1, max_iterations=1).fit(RECORDINGS)
    assert not fitted.converged_
    assert fitted.starts_[0]["state"] == "active"
    with pytest.warns(DataWarning, match="did not end at a minimum"):
        fitted.sample_posterior(3, random_state=0)
    assert np.isfinite(fitted.intervals_).all()


def test_the_table_holds_one_row_for_each_parameter():
    simulator = product_oscillator()
    table = (
        MAPCalibrator(simulator, random_state=0).fit(simulator.record({"a": 3.0}, 0.01, seed=0)).to_frame()
    )
    assert list(table.index) == list(simulator.parameters.names)
    assert np.all((table["low"] <= table["value"]) & (table["value"] <= table["high"]))
    assert table["group"].tolist() == [0, 1, 0, 1]


def test_nothing_but_failures_is_an_error_with_its_remedy():
    with pytest.raises(SimulationError, match=r"no simulation of the fit ended well: .*reduce the step"):
        MAPCalibrator(oscillator(fail_above=0.0), library_size=16, random_state=0).fit(RECORDINGS)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_starts": 0}, "n_starts is 0"),
        ({"library_size": 3}, "library_size is 3. Allowed: an integer from 7 on"),
        ({"max_iterations": 0}, "max_iterations is 0"),
        ({"prior_scale": 0}, "prior_scale is 0"),
        ({"prior_scale": np.inf}, "prior_scale is inf"),
        ({"tol": 0}, "tol is 0"),
        ({"step": 0}, "step is 0"),
        ({"level": 1.2}, "level is 1.2"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        MAPCalibrator(SIMULATOR, **options).fit(RECORDINGS)
