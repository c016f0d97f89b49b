import builtins
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import Ridge
from sklearn.metrics import r2_score
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen._runtime.persistence import load_tensors, save_arrays, save_tensors
from errorscreen.exceptions import InputError, MissingExtraError
from errorscreen.learning import network
from errorscreen.learning.regressors import CNNContributionRegressor

TINY = {"n_filters": (4, 4, 4), "n_hidden": 8, "max_epochs": 3}


@parametrize_with_checks(
    [
        CNNContributionRegressor(max_epochs=15, random_state=0),  # enough to learn what the checks ask for
        CNNContributionRegressor(
            (4, 8, 8), 16, max_epochs=20, patience=None, lr=1e-2, target_power=1.0, random_state=0
        ),
    ]
)
def test_scikit_learn_contract(estimator, check):
    check(estimator)


def blobs(seed, n=300):
    """Images of three blobs that stand at fixed places, and labels |amplitude| of unequal size."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:16, :32]
    places = [(3, 6), (9, 12), (12, 25)]
    shapes = np.stack([np.exp(-((rows - r) ** 2 + (columns - c) ** 2) / 12) for r, c in places])
    amplitudes = rng.uniform(-1, 1, size=(n, 3))
    images = np.einsum("nk,khw->nhw", amplitudes, shapes)[:, None] + 0.05 * rng.normal(size=(n, 1, 16, 32))
    return images, np.abs(amplitudes) * [1.0, 10.0, 3.0]


@pytest.mark.parametrize("target_power", [0, 0.5, 1])
def test_learns_what_a_linear_model_cannot(target_power):
    images, labels = blobs(1)
    test_images, test_labels = blobs(2)
    model = CNNContributionRegressor(
        (8, 16, 16), 32, lr=3e-3, target_power=target_power, max_epochs=20, random_state=0
    )
    score = r2_score(test_labels, model.fit(images, labels).predict(test_images))
    ridge = Ridge(1.0).fit(images.reshape(len(images), -1), labels)
    linear = r2_score(test_labels, ridge.predict(test_images.reshape(len(images), -1)))
    assert linear < 0.1  # |amplitude| is even, a linear model is odd
    assert score > 0.8
    assert model.predict(test_images).min() >= 0


def test_early_stopping_restores_the_weights_of_the_best_epoch():
    images, labels = blobs(3, n=60)
    labels = np.random.default_rng(0).permuted(labels, axis=0)  # nothing to learn, so validation soon worsens
    model = CNNContributionRegressor(
        (8, 8, 8), 16, lr=1e-2, lr_schedule="constant", patience=4, validation_fraction=0.5, max_epochs=200,
        random_state=0,
    )  # fmt: skip
    model.fit(images, labels)
    epochs = len(model.validation_curve_)
    best = int(np.argmin(model.validation_curve_))
    assert best + 1 < epochs < 200
    short = clone(model).set_params(max_epochs=best + 1).fit(images, labels)
    np.testing.assert_array_equal(model.predict(images), short.predict(images))


def test_the_step_size_falls_to_nothing_over_the_epochs():
    images, labels = blobs(6, n=40)

    model = CNNContributionRegressor((4, 4, 4), 8, patience=None, max_epochs=8, random_state=0).fit(
        images, labels
    )
    rates = model.net_.history[:, "event_lr"]
    np.testing.assert_allclose(rates, 3e-3 * (1 + np.cos(np.pi * np.arange(8) / 8)) / 2)
    constant = CNNContributionRegressor(**TINY, lr_schedule="constant", random_state=0).fit(images, labels)
    assert "event_lr" not in constant.net_.history[-1]


def test_without_patience_all_epochs_run_on_all_samples():
    images, labels = blobs(4, n=20)
    model = CNNContributionRegressor(**TINY, patience=None, random_state=0).fit(images, labels)
    assert len(model.loss_curve_) == 3
    assert model.validation_curve_ == []
    few = CNNContributionRegressor(**TINY, random_state=0).fit(images[:4], labels[:4])
    assert few.validation_curve_ == []


def test_the_same_seed_gives_the_same_bits_and_leaves_the_callers_random_numbers_alone():
    images, labels = blobs(5, n=40)
    model = CNNContributionRegressor(**TINY, dropout=0.3, random_state=7)
    torch.manual_seed(1)
    np.random.seed(1)  # noqa: NPY002 (the global state is what is guarded here)
    expected = model.fit(images, labels).predict(images)
    after = torch.rand(3), np.random.rand(3)  # noqa: NPY002
    torch.manual_seed(1)
    np.random.seed(1)  # noqa: NPY002
    untouched = torch.rand(3), np.random.rand(3)  # noqa: NPY002
    assert torch.equal(after[0], untouched[0])
    np.testing.assert_array_equal(after[1], untouched[1])
    np.testing.assert_array_equal(clone(model).fit(images, labels).predict(images), expected)
    other = clone(model).set_params(random_state=8).fit(images, labels).predict(images)
    assert not np.array_equal(other, expected)


@settings(max_examples=15)
@given(shape=st.lists(st.integers(1, 40), min_size=1, max_size=3), n=st.integers(2, 35))
def test_any_size_of_image_and_any_number_of_samples_work(shape, n):
    rng = np.random.default_rng(0)
    images, labels = rng.normal(size=(n, *shape)), rng.uniform(size=(n, 2))
    model = CNNContributionRegressor((2, 2, 2), 4, max_epochs=1, random_state=0).fit(images, labels)
    predicted = model.predict(images)
    assert predicted.dtype == np.float64
    assert predicted.shape == (n, 2)
    assert np.all(np.isfinite(predicted))


@given(factor=st.floats(1e-6, 1e6))
@settings(max_examples=8)
def test_the_unit_of_the_labels_scales_the_prediction(factor):
    images, labels = blobs(6, n=40)
    model = CNNContributionRegressor(**TINY, random_state=0)
    expected = factor * model.fit(images, labels).predict(images)
    np.testing.assert_allclose(model.fit(images, factor * labels).predict(images), expected, rtol=1e-3)


@pytest.mark.parametrize("target_power", [0, 0.5, 1])
@pytest.mark.parametrize("output", ["softplus", "linear"])
def test_an_output_that_never_changes_is_no_trouble(target_power, output):
    images, labels = blobs(7, n=60)
    labels[:, 1] = 0
    model = CNNContributionRegressor((4, 4, 4), 8, output=output, target_power=target_power, random_state=0)
    predicted = model.fit(images, labels).predict(images)
    assert np.abs(predicted[:, 1]).mean() < 0.5 * labels.mean()


def test_negative_labels_get_a_linear_output_unless_softplus_is_asked_for():
    images, labels = blobs(8, n=40)
    model = CNNContributionRegressor(**TINY, random_state=0)
    assert model.fit(images, labels).nonnegative_
    assert not model.fit(images, labels - 1).nonnegative_
    assert not clone(model).set_params(output="linear").fit(images, labels).nonnegative_
    with pytest.raises(InputError, match=r"smallest label is -1.*labels >= 0, equation \(15\)"):
        clone(model).set_params(output="softplus").fit(images, labels - 1 - labels.min())


@pytest.mark.parametrize("one_dimensional", [False, True])
def test_saved_and_loaded_predicts_the_same(tmp_path, one_dimensional):
    images, labels = blobs(9, n=40)
    labels = labels[:, 0] if one_dimensional else labels - 1
    model = CNNContributionRegressor(**TINY, random_state=0).fit(images, labels)
    path = model.save(tmp_path / "cnn.safetensors")
    loaded = CNNContributionRegressor.load(path)
    np.testing.assert_array_equal(loaded.predict(images), model.predict(images))
    assert loaded.get_params() == model.get_params()
    assert loaded.loss_curve_ == model.loss_curve_
    np.testing.assert_array_equal(clone(loaded).fit(images, labels).predict(images), model.predict(images))


def test_saving_keeps_column_names_and_drops_a_random_state_that_json_cannot_hold(tmp_path):
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(np.random.default_rng(0).normal(size=(20, 2)), columns=["a", "b"])
    model = CNNContributionRegressor(**TINY, random_state=np.random.RandomState(0)).fit(table, np.ones(20))
    loaded = CNNContributionRegressor.load(model.save(tmp_path / "a"))
    assert loaded.random_state is None
    np.testing.assert_array_equal(loaded.predict(table), model.predict(table))
    with pytest.raises(ValueError, match="feature names"):
        loaded.predict(table[["b", "a"]])


def test_files_that_do_not_fit_are_input_errors(tmp_path):
    images, labels = blobs(10, n=20)
    path = CNNContributionRegressor(**TINY, random_state=0).fit(images, labels).save(tmp_path / "a")
    arrays, meta = load_tensors(path, format="errorscreen-cnn", version=2)
    meta["parameters"]["n_hidden"] = 9
    save_tensors(tmp_path / "b", format="errorscreen-cnn", version=2, arrays=arrays, meta=meta)
    save_tensors(tmp_path / "c", format="errorscreen-cnn", version=2, arrays=arrays, meta={})
    for name in "bc":
        with pytest.raises(InputError, match="the configuration does not fit the weights"):
            CNNContributionRegressor.load(tmp_path / name)
    save_arrays(tmp_path / "d", format="errorscreen-dataset", version=1, arrays={})
    with pytest.raises(InputError, match="was not written by errorscreen as 'errorscreen-cnn'"):
        CNNContributionRegressor.load(tmp_path / "d")
    with pytest.raises(NotFittedError):
        CNNContributionRegressor().save(tmp_path / "e")


def test_pickles_without_its_training_data():
    images, labels = blobs(11, n=256)
    model = CNNContributionRegressor(**TINY, random_state=0).fit(images, labels)
    data = pickle.dumps(model)
    assert len(data) < images.astype(np.float32).nbytes / 2
    np.testing.assert_array_equal(pickle.loads(data).predict(images), model.predict(images))


def test_a_progress_bar_shows_each_epoch(capsys):
    images, labels = blobs(12, n=20)
    model = CNNContributionRegressor(**TINY, verbose=True, random_state=0).fit(images, labels)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "3/3" in captured.err
    assert "train_loss" in captured.err
    pickle.dumps(model)


@pytest.mark.parametrize("epoch", [2, 3], ids=["within", "while the last one is judged"])
def test_an_interrupt_by_the_user_is_not_taken_for_the_end_of_the_training(epoch, monkeypatch):
    images, labels = blobs(13, n=20)

    def interrupt(self, net, **_):
        if len(net.history) == epoch:
            raise KeyboardInterrupt

    monkeypatch.setattr(network.Progress, "on_epoch_end", interrupt)
    model = CNNContributionRegressor(**TINY, verbose=True, random_state=0)
    with pytest.raises(KeyboardInterrupt):
        model.fit(images, labels)
    with pytest.raises(NotFittedError):
        model.predict(images)


def test_a_training_that_diverges_is_an_input_error():
    images, labels = blobs(14, n=20)
    with pytest.raises(InputError, match=r"diverged.*Lower lr"):
        CNNContributionRegressor(**TINY, lr=1e30, patience=None, random_state=0).fit(images, labels)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_filters": (4, 4)}, "n_filters is (4, 4). Allowed: three integers from 1 on"),
        ({"n_filters": 4}, "n_filters is 4"),
        ({"n_filters": (4, 0, 4)}, "n_filters is 0"),
        ({"n_hidden": 0}, "n_hidden is 0"),
        ({"batch_size": 1}, "batch_size is 1. Allowed: an integer from 2 on"),
        ({"max_epochs": 1.5}, "max_epochs is 1.5"),
        ({"patience": 0}, "patience is 0"),
        ({"lr": 0}, "lr is 0"),
        ({"huber_delta": -1}, "huber_delta is -1"),
        ({"weight_decay": np.inf}, "weight_decay is inf"),
        ({"dropout": 1.0}, "dropout is 1.0"),
        ({"validation_fraction": 1}, "validation_fraction is 1"),
        ({"target_power": 2}, "target_power is 2. Allowed: a number >= 0 and <= 1"),
        ({"output": "relu"}, "output='relu'"),
        ({"verbose": "loud"}, "verbose='loud'"),
        ({"device": "abacus"}, "device 'abacus' cannot be used here"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(options, message):
    with pytest.raises(InputError) as caught:
        CNNContributionRegressor(**{**TINY, **options}).fit(*blobs(0, n=10))
    assert message in str(caught.value)


def test_shapes_that_do_not_fit_are_input_errors():
    images, labels = blobs(15, n=10)
    model = CNNContributionRegressor(**TINY, random_state=0).fit(images, labels)
    with pytest.raises(InputError, match=r"\(n, 1, 16, 32\), as in fit"):
        model.predict(images[..., :30])
    with pytest.raises(InputError, match=r"\(samples, channels, frequencies, time\) or \(samples, time\)"):
        model.fit(images[:, None], labels)


def test_without_torch_the_extra_is_named(monkeypatch):
    real = builtins.__import__

    def without_torch(name, *args, **kwargs):
        if name == "errorscreen.learning" and "network" in (args[2] or ()):
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_torch)
    with pytest.raises(MissingExtraError, match=r'torch is not installed.*pip install "errorscreen\[cnn\]"'):
        CNNContributionRegressor().fit(np.ones((4, 3)), np.ones(4))
