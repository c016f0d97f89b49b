import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares, lsq_linear

from errorscreen.calibration import BoundedSearch

WIDE = 1e3


def run(residuals, lower, upper, starts, *, prior=1e6, tol=1e-12, step=1e-4, iterations=200):
    search = BoundedSearch(residuals, lower, upper, prior=prior, tol=tol, step=step)
    search.begin(starts)
    for _ in range(iterations):
        if not search.iterate():
            break
    return search


def rosenbrock(u):
    return np.stack([10 * (u[:, 1] - u[:, 0] ** 2), 1 - u[:, 0]], axis=1)


def exponential(u):
    t = np.linspace(0, 3, 25)
    return u[:, :1] * np.exp(-u[:, 1:] * t) - (2.5 * np.exp(-1.3 * t) + 0.05 * np.cos(9 * t))


@pytest.mark.parametrize(("residuals", "start"), [(rosenbrock, [-1.2, 1.0]), (exponential, [1.0, 0.2])])
def test_without_bounds_it_finds_what_scipy_finds(residuals, start):
    search = run(residuals, [-WIDE] * 2, [WIDE] * 2, start)
    assert search.best.state == "converged"
    expected = least_squares(lambda u: residuals(u[None])[0], start, xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    np.testing.assert_allclose(search.best.u, expected, rtol=1e-6)


@given(seed=st.integers(0, 10**6), k=st.integers(1, 6))
@settings(max_examples=40)
def test_a_bounded_linear_problem_with_prior_is_solved_exactly(seed, k):
    rng = np.random.default_rng(seed)
    A, b = rng.standard_normal((12, k)), 3 * rng.standard_normal(12)
    lower, upper = -rng.uniform(0.1, 1, k), rng.uniform(0.1, 1, k)
    search = run(lambda u: u @ A.T - b, lower, upper, np.zeros(k), prior=0.7, tol=1e-15, step=1e-2)
    stacked = np.vstack([A, np.eye(k) / 0.7])
    expected = lsq_linear(stacked, np.append(b, np.zeros(k)), bounds=(lower, upper), method="bvls", tol=1e-14)
    np.testing.assert_allclose(search.best.u, expected.x, atol=1e-7)
    assert search.best.cost == pytest.approx(2 * expected.cost, rel=1e-9)
    assert search.best.state in ("converged", "kink")  # the last gain may be lost in rounding


def test_each_iteration_is_two_batches_for_all_starts_inside_the_bounds():
    sizes = []

    def counted(u):
        sizes.append(len(u))
        assert np.all((u >= -2) & (u <= 2))
        return rosenbrock(u)

    search = BoundedSearch(counted, [-2, -2], [2, 2], prior=1e6, tol=1e-8, step=1e-4)
    search.begin([[-1.2, 1.0], [2.0, -2.0], [0.0, 2.0]])
    search.iterate()
    assert sizes == [3, 3 * 2, 3 * 7]
    search.differentiate(search.tracks)  # what is asked for is central
    assert sizes[3:] == [3 * 4]


def test_one_sided_differences_save_evaluations_and_end_where_central_ones_do():
    ends, sizes = [], []
    for central in (False, True):
        evaluated = []

        def counted(u, evaluated=evaluated):
            evaluated.append(len(u))
            return np.hstack([10 * (u[:, 1:] - u[:, :-1] ** 2), 1 - u])

        search = BoundedSearch(counted, [-WIDE] * 8, [WIDE] * 8, prior=1e6, tol=1e-12, step=1e-4)
        search.begin(np.full(8, 0.3))
        search.tracks[0].central = central
        while search.iterate():
            pass
        ends.append(search.best)
        sizes.append(sum(n for n in evaluated if n != 7))
    assert all(best.state == "converged" and best.central for best in ends)
    np.testing.assert_allclose(ends[0].u, ends[1].u, rtol=1e-6)
    np.testing.assert_allclose(ends[0].u, 1.0, rtol=1e-6)
    assert sizes[0] < 0.75 * sizes[1]


@pytest.mark.parametrize("noise", [1e-3, 1.0])
def test_what_is_smooth_and_beyond_noise_is_not_lowered_by_its_last_thousandth(noise):
    def counted(u):
        evaluated.append(len(u))
        return exponential(u) / noise

    ends, sizes = [], []
    for tol in (1e-2, 1e-12):
        evaluated = []
        ends.append(run(counted, [-WIDE] * 2, [WIDE] * 2, [[1.0, 0.2]], tol=tol).best)
        sizes.append(sum(evaluated))
    early, late = ends
    enough = 1e-2 * max(1.0, late.cost / 25, 0.1 * (late.cost - 25))
    assert early.state == "converged"
    assert 0 <= early.cost - late.cost < enough
    assert sizes[0] < 0.8 * sizes[1]


def test_without_central_differences_a_search_ends_with_one_sided_ones():
    search = BoundedSearch(
        exponential, [-WIDE] * 2, [WIDE] * 2, prior=1e6, tol=1e-6, step=1e-4, central=False
    )
    search.begin([[1.0, 0.2]])
    while search.iterate():
        pass
    assert search.best.state == "converged"
    assert not search.best.central
    assert search.best.u == pytest.approx(
        run(exponential, [-WIDE] * 2, [WIDE] * 2, [[1.0, 0.2]]).best.u, rel=1e-3
    )


def test_a_descent_that_one_side_does_not_see_is_found():
    """To the left of 0 the residuals change, to the right they do not; the one side that is tried is the right."""

    def one_way(u):
        return np.stack([np.minimum(u[:, 0], 0.0) + 1.0, 0 * u[:, 0]], axis=1)

    search = run(one_way, [-2], [3], [[0.0]])
    assert search.best.u[0] == pytest.approx(-1.0, abs=1e-3)


def test_several_starts_escape_a_local_minimum():
    def two_wells(u):
        return np.concatenate([(u**2 - 1) * 5, 0.5 * (u - 1)], axis=1)

    one = run(two_wells, [-3], [3], [[-2.0]])
    both = run(two_wells, [-3], [3], [[-2.0], [2.0]])
    assert one.best.state == "converged"
    assert one.best.u[0] < -0.9
    assert both.best.u[0] == pytest.approx(1.0)
    assert [track.state for track in both.tracks] == ["converged", "converged"]


def test_failed_evaluations_are_walked_around():
    def holes(u):
        z = rosenbrock(u)
        z[np.hypot(u[:, 0] - 0.2, u[:, 1] + 0.3) < 0.25] = np.nan  # beside the valley
        z[u[:, 0] > 1.0 + 1e-9] = np.nan  # the minimum lies at the edge
        return z

    search = run(holes, [-WIDE] * 2, [WIDE] * 2, [[-1.2, 1.0], [0.2, -0.3]])
    assert len(search.tracks) == 1  # the second start failed
    np.testing.assert_allclose(search.best.u, [1.0, 1.0], atol=1e-4)


def test_a_parameter_whose_neighbours_both_fail_counts_as_without_effect():
    def blind(u):
        z = np.stack([u[:, 0] - 2.0, 0 * u[:, 0]], axis=1)
        z[np.isclose(np.abs(u[:, 1] - 0.5), 1e-4)] = np.nan
        return z

    search = run(blind, [-5, -5], [5, 5], [[0.0, 0.5]], prior=1e3)
    np.testing.assert_allclose(search.best.u, [2.0, 0.0], atol=1e-4)  # the prior takes it to nominal


def test_all_starts_failing_leaves_no_track():
    search = BoundedSearch(lambda u: np.full((len(u), 3), np.nan), [-1], [1], prior=1, tol=1e-3, step=1e-4)
    search.begin([[0.0], [0.5]])
    assert search.tracks == []


@pytest.mark.parametrize(("height", "state"), [(0.5, "kink"), (100.0, "stalled")])
def test_a_kink_is_told_from_a_stall_by_what_the_slope_promises(height, state):
    def kink(u):  # next to the kink the slope promises to lower height² to 0
        return np.hstack([height + 1e3 * np.abs(u) + 10 * u, np.zeros((len(u), 10**4))])

    search = run(kink, [-100], [100], [[0.3]])
    assert search.best.state == state
    assert search.best.u[0] == pytest.approx(0.0, abs=1e-3)


def test_nearly_collinear_parameters_do_not_break_it():
    A = np.random.default_rng(0).standard_normal((20, 1)) @ [[1.0, -2.0, 1e-9]]
    truth = np.array([0.5, 0.2, 0.0])
    search = run(lambda u: (u - truth) @ A.T * 1e4, [-1] * 3, [1] * 3, np.zeros(3), prior=1.0)
    assert search.best.state == "converged"
    # the smallest deviation with the measured sum
    np.testing.assert_allclose(search.best.u, np.array([1, -2, 0]) * 0.1 / 5, atol=1e-6)


def test_points_scatter_as_far_as_a_linear_model_leaves_them_free():
    A = np.array([[3.0, 1.0], [0.0, 0.5]])
    search = BoundedSearch(lambda u: u @ A.T, [-50.0, -50.0], [50.0, 50.0], prior=2.0, tol=1e-6, step=1e-4)
    search.begin([[0.3, 0.1]])
    search.differentiate(search.tracks)
    points = search.scattered(search.tracks[0], np.full(20000, 3.0), 0)
    expected = 9.0 * np.linalg.inv(A.T @ A + np.eye(2) / 4.0)
    np.testing.assert_allclose(np.cov(points.T), expected, rtol=0.05)
    np.testing.assert_allclose(points.mean(axis=0), [0.3, 0.1], atol=0.1)


def test_points_scatter_inside_the_bounds():
    search = BoundedSearch(lambda u: 0.1 * u, [-1.0, -1.0], [1.0, 2.0], prior=10.0, tol=1e-6, step=1e-4)
    search.begin([[0.9, -0.9]])
    search.iterate()
    points = search.scattered(search.tracks[0], np.linspace(0.1, 5.0, 50), 0)
    assert np.all((points >= [-1.0, -1.0]) & (points <= [1.0, 2.0]))


def test_starts_scatter_also_where_a_model_nearly_diverges():
    """The square of such a Jacobian is not positive definite any more."""
    search = BoundedSearch(
        lambda u: 1e14 * u.sum(axis=1, keepdims=True) * np.array([1.0, 1.3, 0.7]),
        [-1.0] * 3, [1.0] * 3, prior=0.3, tol=1e-6, step=1e-4,
    )  # fmt: skip
    search.begin(np.zeros((1, 3)))
    search.differentiate(search.tracks)
    points = search.scattered(search.best, np.ones(400), 0)
    # what the sum leaves free scatters as the prior does, and the sum itself hardly at all
    assert np.ptp(points.sum(axis=1)) < 1e-6
    assert np.std(points[:, 0] - points[:, 1]) == pytest.approx(0.3 * np.sqrt(2.0), rel=0.15)


def ridge(u):
    """Only the sum of the first two is told, where the third has a crease beside which no step keeps its promise."""
    crease = 30.0 + 1e3 * np.abs(u[:, 2:3]) + 10.0 * u[:, 2:3]
    return np.hstack([1e3 * (u[:, :1] + u[:, 1:2] - 0.4), crease, np.ones((len(u), 50))])


@pytest.mark.parametrize("upper", [2.0, 0.1])
def test_what_the_residuals_do_not_tell_settles_where_the_prior_wants_it(upper):
    search = run(ridge, [-2.0] * 3, [upper, 2.0, 2.0], [[-1.2, 1.6, 1e-9]], prior=0.3)
    before = search.best.cost
    assert search.best.u[1] - search.best.u[0] > 0.5
    search.follow_prior(search.best)
    np.testing.assert_allclose(search.best.u[:2], [min(0.2, upper), 0.4 - min(0.2, upper)], atol=1e-3)
    assert search.best.cost < before - 1.0
    assert search.best.jacobian is not None


def test_what_has_converged_has_settled():
    A = np.random.default_rng(0).standard_normal((20, 1)) @ [[1.0, -2.0, 1e-9]]
    calls = []

    def residuals(u):
        calls.append(len(u))
        return (u - [0.5, 0.2, 0.0]) @ A.T * 1e2

    search = run(residuals, [-1] * 3, [1] * 3, np.zeros(3), prior=1.0)
    u, before = search.best.u.copy(), len(calls)
    search.follow_prior(search.best)
    assert np.array_equal(search.best.u, u)
    assert sum(calls[before:]) <= 6  # differences, and no trial


def test_settling_stays_where_what_is_tried_fails():
    def fails(u):
        z = ridge(u)
        z[np.abs(u[:, 0] + 1.2) > 1e-3] = np.nan
        return z

    search = BoundedSearch(fails, [-2.0] * 3, [2.0] * 3, prior=0.3, tol=1e-3, step=1e-4)
    search.begin([[-1.2, 1.6, 0.0]])
    search.follow_prior(search.best)
    np.testing.assert_array_equal(search.best.u, [-1.2, 1.6, 0.0])
