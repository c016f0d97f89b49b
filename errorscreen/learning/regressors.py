"""The network from images to contributions as a scikit-learn regressor."""

from __future__ import annotations

import importlib.util
import os
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.persistence import load_tensors, save_tensors
from errorscreen.exceptions import InputError, MissingExtraError, check_integer, check_real
from errorscreen.features.checks import as_images, check_choice, check_stack

_FORMAT, _VERSION = "errorscreen-cnn", 2
# fitted values stored beside the weights and the target scale
_FITTED = ("shape_in_", "n_features_in_", "n_outputs_", "nonnegative_", "_one_dimensional")
_CURVES = ("loss_curve_", "validation_curve_")


class CNNContributionRegressor(RegressorMixin, BaseEstimator):
    r"""Convolutional network from images to contributions, equations (17)–(21).

    Three convolution layers, each with batch normalisation and ReLU, two of them with stride 2, and two fully connected
    layers; Softplus makes contributions positive. AdamW minimises the Huber loss (20), (21). Needs
    ``pip install "errorscreen[cnn]"``.

    Parameters
    ----------
    n_filters : tuple of three int, default (16, 32, 64)
        Filters of the convolution layers.
    n_hidden : int, default 128
        Units of the first fully connected layer.
    dropout : float, default 0.0
        Share of hidden units left out in training, below 1.
    lr : float, default 3e-3
        Step size of the optimiser.
    lr_schedule : {"cosine", "constant"}, default "cosine"
        ``"cosine"`` lowers the step size to 0 over `max_epochs`; the last small steps average out the noise of the
        batches.
    weight_decay : float, default 1e-4
    batch_size : int, default 32
    max_epochs : int, default 60
        Largest number of passes over the training set.
    patience : int or None, default 10
        Stop after this many epochs without a better validation loss and restore the best weights; None runs
        all epochs on all samples.
    validation_fraction : float, default 0.15
        Share of the samples set aside for this; none where it is less than one sample.
    huber_delta : float, default 1.0
        Threshold δ, in multiples of the target scale.
    target_power : float, default 0.5
        Labels of an output are divided by μ·(μⱼ/μ)^power before the loss, with the mean size μⱼ of the output and μ
        of all outputs. With 0, small outputs are hardly learned; with 1, they count as much as large ones. 0.5 ranked
        best on trial problems.
    output : {"auto", "softplus", "linear"}, default "auto"
        Labels of (15) are nonnegative and get Softplus; ``"auto"`` takes a linear output and centred labels where
        some label is negative.
    device : str, default "auto"
        Name of a torch device; ``"auto"`` is a GPU where torch can use one.
    random_state : int, RandomState instance or None, default None
        Seed of weights, order of samples, dropout and validation split; torch's own state stays. With an integer,
        results repeat bit by bit on the same machine with the same number of threads.
    verbose : bool, default False
        Show a progress bar.

    Attributes
    ----------
    net_ : skorch.NeuralNet
        The trained network.
    loss_curve_, validation_curve_ : list of float
        Huber loss of each epoch; the second is empty without validation.
    target_offset_, target_scale_ : ndarray of shape (m,)
        Outputs of the network are multiplied by the scale and added to the offset.
    nonnegative_ : bool
        Whether the output is Softplus.
    n_outputs_ : int
        Number of parameters m.
    shape_in_ : tuple
        Shape of one sample in fit.

    Raises
    ------
    InputError
        If an option cannot be used, or labels are negative with ``output="softplus"``.
    MissingExtraError
        If torch, skorch or safetensors is not installed.

    Notes
    -----
    Input is (n, R, H, W) in float32; (n, R, L) is read as images of one row, and (n, F) as one channel of one row.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> images = rng.normal(size=(40, 1, 8, 16))
    >>> contributions = np.abs(images.mean(axis=(2, 3))) * [1.0, 2.0]
    >>> model = CNNContributionRegressor((4, 4, 4), 8, max_epochs=2, random_state=0).fit(images, contributions)
    >>> model.predict(images[:3]).shape
    (3, 2)
    """

    def __init__(
        self,
        n_filters: tuple[int, int, int] = (16, 32, 64),
        n_hidden: int = 128,
        *,
        dropout: float = 0.0,
        lr: float = 3e-3,
        lr_schedule: str = "cosine",
        weight_decay: float = 1e-4,
        batch_size: int = 32,
        max_epochs: int = 60,
        patience: int | None = 10,
        validation_fraction: float = 0.15,
        huber_delta: float = 1.0,
        target_power: float = 0.5,
        output: str = "auto",
        device: str = "auto",
        random_state: Any = None,
        verbose: bool = False,
    ) -> None:
        self.n_filters = n_filters
        self.n_hidden = n_hidden
        self.dropout = dropout
        self.lr = lr
        self.lr_schedule = lr_schedule
        self.weight_decay = weight_decay
        self.batch_size = batch_size
        self.max_epochs = max_epochs
        self.patience = patience
        self.validation_fraction = validation_fraction
        self.huber_delta = huber_delta
        self.target_power = target_power
        self.output = output
        self.device = device
        self.random_state = random_state
        self.verbose = verbose

    def fit(self, X: ArrayLike, y: ArrayLike) -> CNNContributionRegressor:
        """Train with contributions y, (n, m) or (n,), on images X of shape (n, R, H, W), (n, R, L) or (n, F)."""
        network = import_network()
        self._check_options()
        checks = {"multi_output": True, "y_numeric": True, "ensure_min_samples": 2}
        images, y = check_stack(self, X, y=y, reset=True, max_ndim=4, dtype=np.float32, **checks)
        targets = self._scale_targets(np.asarray(y, dtype=float))
        seed = check_random_state(self.random_state).randint(np.iinfo(np.int32).max)
        with network.own_random_state(seed):
            net = self._build(network)
            network.train_network(net, as_images(images), targets, self, seed)
        self.net_ = net  # only now, so that an interrupted fit leaves no net that predicts
        self.loss_curve_ = self.net_.history[:, "train_loss"]
        validated = "valid_loss" in self.net_.history[-1]
        self.validation_curve_ = self.net_.history[:, "valid_loss"] if validated else []
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Contributions (n, m) of images X, or (n,) where fit was given a 1-D y."""
        check_is_fitted(self, "net_")
        images = as_images(check_stack(self, X, reset=False, max_ndim=4, dtype=np.float32))
        network = import_network()
        with network.own_random_state(0):  # the loader of the batches draws a number
            scaled = network.predict_network(self.net_, images)
        contributions = scaled * self.target_scale_ + self.target_offset_
        return contributions.ravel() if self._one_dimensional else contributions

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write weights and configuration to one safetensors file; return its path.

        A `random_state` that is not an integer is written as None. Raises `InputError` if the file cannot be written.
        """
        check_is_fitted(self, "net_")
        parameters = self.get_params(deep=False)
        if not isinstance(self.random_state, Integral):
            parameters["random_state"] = None
        fitted = {name: getattr(self, name) for name in (*_FITTED, *_CURVES)}
        fitted["feature_names_in_"] = getattr(self, "feature_names_in_", None)
        scales = {"target_offset_": self.target_offset_, "target_scale_": self.target_scale_}
        return save_tensors(
            path,
            format=_FORMAT,
            version=_VERSION,
            arrays=import_network().read_weights(self.net_) | scales,
            meta={"parameters": parameters, "fitted": fitted},
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, device: str = "auto") -> CNNContributionRegressor:
        """Read a file of `save`, for predictions on any `device`; no code in it is run.

        Raises `InputError` if the file is missing, damaged, or of another format or version.
        """
        network = import_network()
        arrays, meta = load_tensors(path, format=_FORMAT, version=_VERSION)
        try:
            parameters, fitted = meta["parameters"], meta["fitted"]
            parameters |= {"n_filters": tuple(parameters["n_filters"]), "device": device}
            model = cls(**parameters)
            for name in (*_FITTED, *_CURVES):
                setattr(model, name, fitted[name])
            model.shape_in_ = tuple(fitted["shape_in_"])
            if fitted["feature_names_in_"] is not None:
                model.feature_names_in_ = np.asarray(fitted["feature_names_in_"], dtype=object)
            model.target_offset_ = arrays.pop("target_offset_")
            model.target_scale_ = arrays.pop("target_scale_")
            with network.own_random_state(0):
                model.net_ = model._build(network)
            network.load_weights(model.net_, arrays)
        except (KeyError, TypeError, RuntimeError) as error:
            raise InputError(
                "the configuration does not fit the weights",
                where=f"file {path}",
                remedy="Train and save it anew",
            ) from error
        return model

    def _build(self, network: Any) -> Any:
        channels, *size = as_images(np.empty((0, *self.shape_in_))).shape[1:]
        module = network.build_network(
            (channels, *size), self.n_outputs_, self.n_filters, self.n_hidden, self.dropout, self.nonnegative_
        )
        return network.wrap_network(module, network.find_device(self.device), self.batch_size)

    def _scale_targets(self, y: NDArray[np.float64]) -> NDArray[np.float32]:
        """Choose the output layer and the scale of the labels, and scale them."""
        self._one_dimensional = y.ndim == 1
        y = y.reshape(len(y), -1)
        self.n_outputs_ = y.shape[1]
        self.nonnegative_ = self.output == "softplus" or (self.output == "auto" and bool(np.all(y >= 0)))
        if self.nonnegative_ and np.any(y < 0):
            raise InputError(
                f"the smallest label is {y.min():g}",
                where=type(self).__name__,
                allowed="labels >= 0, equation (15)",
                remedy="Give output='linear' for labels of another kind",
            )
        self.target_offset_ = np.zeros(self.n_outputs_) if self.nonnegative_ else y.mean(axis=0)
        sizes = np.abs(y - self.target_offset_).mean(axis=0)
        mean = sizes.mean() or 1.0
        # a constant output has no size of its own
        self.target_scale_ = mean * np.where(sizes > 0, sizes / mean, 1.0) ** self.target_power
        return ((y - self.target_offset_) / self.target_scale_).astype(np.float32)

    def _check_options(self) -> None:
        name = type(self).__name__
        if not isinstance(self.n_filters, tuple | list) or len(self.n_filters) != 3:
            raise InputError(
                f"n_filters is {self.n_filters!r}", where=name, allowed="three integers from 1 on"
            )
        for filters in self.n_filters:
            check_integer(filters, "n_filters")
        check_integer(self.n_hidden, "n_hidden")
        check_integer(self.max_epochs, "max_epochs")
        check_integer(self.batch_size, "batch_size", low=2)  # a batch of one has no variance to normalise by
        if self.patience is not None:
            check_integer(self.patience, "patience")
        for option in ("lr", "huber_delta"):
            check_real(getattr(self, option), option, low=0, above=True)
        check_real(self.target_power, "target_power", low=0, high=1)
        check_real(self.weight_decay, "weight_decay", low=0)
        check_real(self.dropout, "dropout", low=0, high=0.99)
        check_real(self.validation_fraction, "validation_fraction", low=0, high=0.9)
        check_choice("lr_schedule", self.lr_schedule, ("cosine", "constant"), name)
        check_choice("output", self.output, ("auto", "softplus", "linear"), name)
        check_choice("verbose", self.verbose, (False, True), name)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.target_tags.multi_output = True
        tags.non_deterministic = self.random_state is None
        return tags


def require_network() -> None:
    """Raise `MissingExtraError` where the network cannot be imported, without the slow import of torch."""
    for name in ("torch", "skorch"):
        if importlib.util.find_spec(name) is None:
            raise MissingExtraError(name, extra="cnn")


def import_network() -> Any:
    """Import the module that needs torch, or raise `MissingExtraError`."""
    try:
        from errorscreen.learning import network
    except ImportError as error:
        raise MissingExtraError(error.name or "torch", extra="cnn") from error
    return network
