import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joblib import parallel_config
from sklearn.model_selection import train_test_split

from errorscreen.exceptions import DataWarning, InputError, SimulationError
from errorscreen.learning import generation
from errorscreen.learning.datasets import ErrorDataset
from errorscreen.learning.generation import contribution_labels, generate_dataset, local_sensitivity
from errorscreen.metrics import top_k_overlap
from errorscreen.simulators.base import Status
from tests.plants import dip, plant
from tests.toys import TIME, Pulse, Toy, linear, oscillator

NAMES = ("theta", "responses", "contributions", "status")


def assert_same(a: ErrorDataset, b: ErrorDataset) -> None:
    for name in (*NAMES, "baseline", "time"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), strict=True)
    assert (a.names, a.channels, a.event) == (b.names, b.channels, b.event)
    assert dict(a.metadata) == dict(b.metadata)


def test_sensitivity_of_a_linear_model_is_the_norm_of_its_columns():
    matrix = np.random.default_rng(0).standard_normal((30, 3))
    simulator = linear(matrix)
    theta = np.array([[1.0, 1.0, 1.0], [2.0, -4.0, 0.5]])
    found = local_sensitivity(simulator, theta)
    np.testing.assert_allclose(found.values, np.tile(np.linalg.norm(matrix, axis=0), (2, 1)), rtol=1e-9)
    np.testing.assert_allclose(found.responses[:, 0], theta @ matrix.T)
    mask = np.arange(30)[None, :] < 10
    masked = local_sensitivity(simulator, theta, mask=mask).values
    np.testing.assert_allclose(masked[0], np.linalg.norm(matrix[:10], axis=0), rtol=1e-9)
    assert simulator.calls == 2


def test_labels_are_deviation_times_sensitivity_at_the_sample():
    simulator = oscillator()
    data = generate_dataset(simulator, 5, random_state=0)
    step = 1e-3
    for i, theta in enumerate(data.theta):
        for j, parameter in enumerate(simulator.parameters):
            delta = np.zeros(4)
            delta[j] = (
                step * parameter.scale * (1 if theta[j] + step * parameter.scale <= parameter.upper else -1)
            )
            change = simulator.simulate(np.stack([theta, theta + delta])).values
            norms = np.linalg.norm(change[1] - change[0], axis=1) * np.sqrt(simulator.event.dt)
            expected = abs(theta[j] - parameter.nominal) / parameter.scale * norms.mean() / step
            assert data.contributions[i, j] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_labels_of_given_samples_are_those_of_a_dataset(monkeypatch):
    simulator = oscillator()
    data = generate_dataset(simulator, 7, random_state=0)
    np.testing.assert_array_equal(contribution_labels(simulator, data.theta), data.contributions)
    monkeypatch.setattr(generation, "_BATCH_BYTES", 1)
    np.testing.assert_array_equal(contribution_labels(simulator, data.theta), data.contributions)


def test_a_parameter_without_effect_or_deviation_has_label_zero():
    simulator = oscillator()
    data = generate_dataset(simulator, 20, random_state=1)
    assert np.all(data.contributions[:, simulator.parameters.index("idle")] == 0)
    assert np.all(data.contributions[:, :3] > 0)
    nominal = local_sensitivity(simulator, simulator.parameters.nominal).values
    assert np.all(nominal * simulator.parameters.deviation(simulator.parameters.nominal) == 0)


@given(factor=st.floats(1e-3, 1e3), name=st.sampled_from(["omega", "zeta", "gain"]))
@settings(max_examples=15)
def test_labels_do_not_depend_on_the_unit_of_a_parameter(factor, name):
    plain = oscillator()
    p = plain.parameters[name]
    changed = {"nominal": p.nominal * factor, "lower": p.lower * factor, "upper": p.upper * factor}
    converted = Toy(
        plain.parameters.replace({name: changed}),
        lambda values, event: plain.response({**values, name: values[name] / factor}, event),
    )
    labels = [generate_dataset(s, 4, random_state=3).contributions for s in (plain, converted)]
    np.testing.assert_allclose(labels[0], labels[1], rtol=1e-6, atol=1e-12)
    absolute = [
        generate_dataset(s, 4, random_state=3, relative=False).contributions for s in (plain, converted)
    ]
    j = plain.parameters.index(name)
    np.testing.assert_allclose(absolute[0][:, j], absolute[1][:, j] * factor, rtol=1e-6)


@given(n=st.integers(1, 30), batch_size=st.integers(1, 200))
@settings(max_examples=20)
def test_batches_change_nothing(n, batch_size):
    simulator = oscillator()
    assert_same(
        generate_dataset(simulator, n, random_state=7, batch_size=batch_size),
        generate_dataset(simulator, n, random_state=7, batch_size=10**6),
    )


def test_batches_of_long_responses_are_small(monkeypatch):
    """Four copies of what is simulated at a time fit into the bytes allowed, and the result stays the same."""
    simulator = oscillator()
    free = generate_dataset(simulator, 40, random_state=7)
    simulate, sizes = simulator.simulate, []

    def counting(theta, event=None):
        responses = simulate(theta, event)
        sizes.append(responses.values.nbytes)
        return responses

    monkeypatch.setattr(simulator, "simulate", counting)
    generate_dataset(simulator, 40, random_state=7)
    assert max(sizes) == 40 * 5 * free.baseline.nbytes  # all at once
    sizes.clear()
    monkeypatch.setattr(generation, "_BATCH_BYTES", 4 * 12 * free.baseline.nbytes)
    assert_same(generate_dataset(simulator, 40, random_state=7), free)
    assert max(sizes) == 2 * 5 * free.baseline.nbytes


def test_the_number_of_workers_changes_nothing():
    simulator = linear(np.random.default_rng(1).standard_normal((20, 4)))
    options = {"n_samples": 50, "random_state": 2, "batch_size": 16}
    one = generate_dataset(simulator, **options, n_jobs=1)
    assert_same(generate_dataset(simulator, **options, n_jobs=2), one)
    with parallel_config(backend="threading", n_jobs=3):
        assert_same(generate_dataset(simulator, **options), one)


def test_no_perturbed_simulation_leaves_the_bounds():
    simulator = oscillator()
    lower, upper = simulator.parameters.bounds.T
    seen = []
    response = simulator.response
    simulator.response = lambda p, event: seen.append(np.hstack(list(p.values()))) or response(p, event)
    generate_dataset(simulator, 200, random_state=0, step=0.2)
    rows = np.concatenate(seen)
    assert np.all((rows >= lower - 1e-12) & (rows <= upper + 1e-12))


def test_a_range_narrower_than_two_steps_is_halved():
    simulator = linear(np.eye(2), half_range=1e-4)
    found = local_sensitivity(simulator, simulator.parameters.bounds.T, step=1e-2)
    np.testing.assert_allclose(found.values, 1.0, rtol=1e-9)


def test_failures_are_counted_aloud_and_masked():
    simulator = oscillator(fail_above=9.0)
    with pytest.warns(DataWarning, match=r"of 60 samples are masked: .*DIVERGED: the response left"):
        data = generate_dataset(simulator, 60, random_state=0)
    expected = data.theta[:, 0] + 6e-3 > 9.0
    assert data.n_failed == expected.sum() > 0
    np.testing.assert_array_equal(data.ok, ~expected)
    for name in ("responses", "contributions", "errors"):
        bad = np.isnan(getattr(data, name)).reshape(60, -1)
        np.testing.assert_array_equal(bad, np.repeat(expected[:, None], bad.shape[1], axis=1))
    assert set(data.status[expected]) == {Status.DIVERGED}
    valid = data.valid()
    assert len(valid) == 60 - data.n_failed
    assert valid.failures() == ""


def test_nothing_usable_is_an_error():
    with pytest.raises(SimulationError, match="nominal parameters failed"):
        generate_dataset(oscillator(fail_above=0.0), 5)
    simulator = oscillator()
    simulator.fails = lambda p: p["omega"] != 6.0
    with pytest.raises(SimulationError, match="every sample failed: 5 of 5"):
        generate_dataset(simulator, 5, random_state=0)


def test_another_event_gives_other_labels_and_its_name():
    event = Pulse(TIME, name="short", start=0.5, duration=0.1)
    data = generate_dataset(oscillator(), 5, event, random_state=0)
    assert data.event == "short"
    assert not np.allclose(
        data.contributions, generate_dataset(oscillator(), 5, random_state=0).contributions
    )


def test_weights_choose_channels():
    first, second, both = (
        generate_dataset(oscillator(), 4, random_state=0, weights=weights).contributions
        for weights in ([1, 0], [0, 1], None)
    )
    np.testing.assert_allclose(both, (first + second) / 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_samples": 0}, "number of samples is 0"),
        ({"step": -1e-3}, "step is -0.001"),
        ({"weights": [1.0]}, "channel weights"),
        ({"batch_size": 0}, "batch_size is 0"),
        ({"checkpoint": "x"}, "random_state is None"),
    ],
)
def test_wrong_arguments_are_named(options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        generate_dataset(oscillator(), **{"n_samples": 3, **options})


class TestCheckpoint:
    OPTIONS = {"n_samples": 40, "random_state": 4, "batch_size": 25}

    def interrupt(self, folder, after):
        simulator = oscillator()
        response = simulator.response

        def stop(p, event):
            if simulator.calls > after:
                raise KeyboardInterrupt
            return response(p, event)

        simulator.response = stop
        with pytest.raises(KeyboardInterrupt, match=r"2 of 8 batches are stored in .*resumes from there"):
            generate_dataset(simulator, **self.OPTIONS, checkpoint=folder)

    def test_an_interrupted_run_goes_on(self, tmp_path):
        folder = tmp_path / "run"
        self.interrupt(folder, after=3)  # the baseline and two batches
        simulator = oscillator()
        data = generate_dataset(simulator, **self.OPTIONS, checkpoint=folder)
        assert simulator.calls == 1 + 6
        assert_same(data, generate_dataset(oscillator(), **self.OPTIONS))
        again = oscillator()
        assert_same(data, generate_dataset(again, **self.OPTIONS, checkpoint=folder))
        assert again.calls == 1

    @pytest.mark.parametrize(
        ("change", "what"),
        [
            ({"random_state": 5}, "samples"),
            ({"step": 1e-4}, "options"),
            ({"event": Pulse(TIME, start=0.6)}, "simulator, event"),
        ],
    )
    def test_another_run_is_refused(self, tmp_path, change, what):
        generate_dataset(oscillator(), **self.OPTIONS, checkpoint=tmp_path)
        with pytest.raises(InputError, match=f"belongs to another run: {what} differ"):
            generate_dataset(oscillator(), **{**self.OPTIONS, **change}, checkpoint=tmp_path)

    def test_other_parameters_are_refused(self, tmp_path):
        generate_dataset(oscillator(), **self.OPTIONS, checkpoint=tmp_path)
        other = oscillator()
        other.parameters = other.parameters.replace({"gain": {"upper": 3.0}})
        with pytest.raises(InputError, match="belongs to another run: parameters, samples differ"):
            generate_dataset(other, **self.OPTIONS, checkpoint=tmp_path)

    def test_a_file_in_the_place_of_the_folder_is_named(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(InputError, match="folder cannot be made"):
            generate_dataset(oscillator(), **self.OPTIONS, checkpoint=tmp_path / "file")


class TestErrorDataset:
    @pytest.fixture
    def data(self):
        with pytest.warns(DataWarning):
            return generate_dataset(oscillator(fail_above=9.0), 12, random_state=0)

    def test_saved_and_loaded_is_the_same(self, data, tmp_path):
        assert_same(ErrorDataset.load(data.save(tmp_path / "set.npz")), data)

    def test_errors_are_measured_from_the_baseline(self, data):
        np.testing.assert_array_equal(data.valid().errors, data.valid().responses - data.baseline)

    def test_it_splits_like_arrays(self, data):
        train, test = (data.take(rows) for rows in train_test_split(np.arange(12), random_state=0))
        assert len(train) + len(test) == 12
        merged = np.concatenate([train.theta, test.theta])
        np.testing.assert_array_equal(np.sort(merged, axis=0), np.sort(data.theta, axis=0))
        assert top_k_overlap(train.valid().contributions, train.valid().contributions, 2) == 1

    def test_shapes_that_do_not_fit_are_named(self, data):
        fields = {name: getattr(data, name) for name in ErrorDataset.__dataclass_fields__}
        with pytest.raises(InputError, match=r"contributions has shape \(11, 4\)"):
            ErrorDataset(**{**fields, "contributions": data.contributions[1:]})

    def test_a_foreign_file_is_refused(self, tmp_path):
        np.savez(tmp_path / "x.npz", a=np.ones(2))
        with pytest.raises(InputError, match="not written by errorscreen"):
            ErrorDataset.load(tmp_path / "x.npz")


def test_a_checkpoint_belongs_to_the_constants_of_the_simulator(tmp_path):
    """Also to one that the nominal response does not feel."""
    event = dip(stop=2.0)
    wide, narrow = (plant("dfig_plant", event, constants={"Pwimax": limit}) for limit in (0.1, 0.03))
    generate_dataset(wide, 20, random_state=0, checkpoint=tmp_path)
    with pytest.raises(InputError, match="belongs to another run: simulator"):
        generate_dataset(narrow, 20, random_state=0, checkpoint=tmp_path)
