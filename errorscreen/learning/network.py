"""The network and its training; imported only where one is trained or read, because it needs torch."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from skorch import NeuralNet
from skorch.callbacks import Callback, EarlyStopping, LRScheduler
from skorch.dataset import ValidSplit
from skorch.utils import noop
from torch import nn
from tqdm import tqdm

from errorscreen.exceptions import InputError

# the feature maps are averaged onto at most this many rows and columns before the fully connected layers
_GRID = (8, 32)
# images that are widened to float64 at a time
_BLOCK = 256


def build_network(
    shape: tuple[int, int, int],
    n_outputs: int,
    n_filters: tuple[int, int, int],
    n_hidden: int,
    dropout: float,
    nonnegative: bool,
) -> nn.Sequential:
    """Three convolution and two fully connected layers, equations (17)–(19), for images of any shape (R, H, W).
    `nonnegative` adds Softplus; for the other arguments see `CNNContributionRegressor`.
    """
    channels, *size = shape
    layers: list[nn.Module] = []
    # Strides, not max pooling: similar parameters differ by little in the signed coefficients, and the largest of four
    # neighbours loses that difference. Only the first layer has a wide kernel and stride, because it costs most.
    for filters, reach, stride in zip(n_filters, (5, 3, 3), (2, 1, 2), strict=True):
        kernel = [min(reach, 2 * length - 1) for length in size]  # a wider one would only cover more padding
        layers.append(nn.Conv2d(channels, filters, kernel, stride, padding=[k // 2 for k in kernel]))
        layers += [nn.BatchNorm2d(filters), nn.ReLU()]
        size = [math.ceil(length / stride) for length in size]
        channels = filters
    # not AdaptiveAvgPool2d: its gradient is not deterministic on a GPU
    pool = [math.ceil(length / cells) for length, cells in zip(size, _GRID, strict=True)]
    size = [math.ceil(length / reach) for length, reach in zip(size, pool, strict=True)]
    layers += [nn.AvgPool2d(pool, ceil_mode=True), nn.Flatten()]
    layers += [nn.Linear(channels * math.prod(size), n_hidden), nn.ReLU(), nn.Dropout(dropout)]
    layers.append(nn.Linear(n_hidden, n_outputs))
    if nonnegative:
        layers.append(nn.Softplus())
    return nn.Sequential(*layers)


def find_device(name: str) -> str:
    """Return the torch device of this name, or raise `InputError`; ``"auto"`` is a GPU where there is one."""
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError, TypeError) as error:
        raise InputError(
            f"device {name!r} cannot be used here",
            allowed="'auto', 'cpu', or 'cuda' with a GPU that torch can use",
        ) from error
    return name


@contextmanager
def own_random_state(seed: int) -> Iterator[None]:
    """Give torch its own random numbers and repeatable kernels inside the block; the caller's are restored."""
    devices = range(torch.cuda.device_count())
    kernels = torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True)
    with torch.random.fork_rng(devices=devices), kernels:
        torch.manual_seed(seed)
        yield


class Progress(Callback):
    """Progress bar over the epochs, on standard error."""

    def on_train_begin(self, net: NeuralNet, **kwargs: Any) -> None:
        """Open the bar."""
        self.bar_ = tqdm(total=net.max_epochs, desc="training", unit="epoch")

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Advance it and show the losses."""
        losses = {key: net.history[-1][key] for key in ("train_loss", "valid_loss") if key in net.history[-1]}
        self.bar_.set_postfix({key: f"{value:.4g}" for key, value in losses.items()})
        self.bar_.update()

    def on_train_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Close it."""
        self.bar_.close()
        del self.bar_


class Net(NeuralNet):
    """Net that records whether its training was completed; skorch returns silently from an interrupted one."""

    def fit_loop(self, X: Any, y: Any = None, epochs: int | None = None, **parameters: Any) -> Net:
        """Train; an interrupt, and early stopping too, leaves `completed_` false."""
        self.completed_ = False
        super().fit_loop(X, y, epochs, **parameters)
        self.completed_ = True
        return self


class AdamW(torch.optim.AdamW):
    """The optimiser without the hooks for torch's compiler, which is not used here and takes seconds to import."""

    add_param_group = inspect.unwrap(torch.optim.AdamW.add_param_group)
    zero_grad = inspect.unwrap(torch.optim.AdamW.zero_grad)
    step = torch.no_grad()(inspect.unwrap(torch.optim.AdamW.step))


def wrap_network(network: nn.Module, device: str, batch_size: int) -> Net:
    """Wrap a network in an untrained skorch net."""
    return Net(network, nn.HuberLoss, device=device, batch_size=batch_size, train_split=None, verbose=0)


def read_weights(net: NeuralNet) -> dict[str, NDArray[Any]]:
    """Weights of a trained net in float32, the precision of the training."""
    return {
        name: (value.float() if value.is_floating_point() else value).cpu().numpy()
        for name, value in net.module_.state_dict().items()
    }


def load_weights(net: NeuralNet, weights: Mapping[str, NDArray[Any]]) -> None:
    """Load weights into a net; torch raises RuntimeError where they do not fit."""
    net.initialize()
    net.module_.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    net.module_.double()


def train_network(net: Net, X: NDArray[Any], y: NDArray[Any], options: Any, split_seed: int) -> None:
    """Train with the Huber loss, equations (20) and (21), and keep the weights of the best epoch.
    `options` is a `CNNContributionRegressor`. Without `patience`, or with too few samples to set one aside, the last
    weights are kept. Raises `KeyboardInterrupt` if the user stops it, `InputError` if the loss is not finite.
    """
    fraction, patience = options.validation_fraction, options.patience
    n_validation = math.ceil(fraction * len(X))  # as scikit-learn rounds it
    watched = patience is not None and fraction * len(X) >= 1 and len(X) - n_validation >= 2
    n_train = len(X) - n_validation * watched
    stopping = EarlyStopping(patience=patience, load_best=True, sink=noop)
    # down to 0 at the end of the last epoch, along half a cosine
    cosine = LRScheduler(torch.optim.lr_scheduler.CosineAnnealingLR, T_max=options.max_epochs)
    net.set_params(
        optimizer=AdamW,
        optimizer__weight_decay=options.weight_decay,
        lr=options.lr,
        criterion__delta=options.huber_delta,
        max_epochs=options.max_epochs,
        iterator_train__shuffle=True,
        # batch normalisation fails on a last batch of one sample
        iterator_train__drop_last=n_train > net.batch_size and n_train % net.batch_size == 1,
        train_split=ValidSplit(fraction, random_state=split_seed) if watched else None,
        callbacks=[("stopping", stopping)] * watched
        + [("schedule", cosine)] * (options.lr_schedule == "cosine")
        + [("progress", Progress())] * options.verbose,
    )
    net.fit(np.require(X, requirements="W"), y)  # torch warns of arrays that it could not write to
    if not (net.completed_ or (watched and stopping.misses_ == patience)):
        raise KeyboardInterrupt
    if not math.isfinite(net.history[-1]["train_loss"]):
        raise InputError("the training diverged: its loss is not finite", remedy="Lower lr")
    # predictions in float64 do not depend on which samples share a batch
    net.module_.double()


def predict_network(net: NeuralNet, X: NDArray[Any]) -> NDArray[np.float64]:
    """Outputs of a trained net for any number of images (n, R, H, W)."""
    blocks = range(0, len(X), _BLOCK)
    return np.concatenate([net.predict(X[start : start + _BLOCK].astype(np.float64)) for start in blocks])
