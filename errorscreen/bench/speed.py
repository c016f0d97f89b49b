"""Speed of simulation, wavelet images, training and labels, each against its reference in the same run."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.persistence import write_json_atomic, write_text_atomic
from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.bench.labels import label_rows, measure_labels, plot_labels
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.timing import best_seconds, in_new_process, machine
from errorscreen.events import Playback
from errorscreen.exceptions import MissingExtraError
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator

BATCHES = (1, 64, 1024)
THREADS = (1, 2)
SCHEMA_VERSION = 1
_CNN_SHAPE = (2500, 2, 64, 256)

_log = logging.getLogger(__name__)


def measure_speed(out: str | Path, *, cnn: bool = True, labels: bool = True) -> dict[str, Any]:
    """Measure, write ``result.json``, ``table.md`` and ``labels.png`` into `out`, and return the result.

    Parameters
    ----------
    out : str or Path
        Folder; made where it is missing.
    cnn : bool
        Whether to time an epoch of the network, which needs the extra ``cnn`` and takes a minute or more.
    labels : bool
        Whether to time the labels of the 39-bus system, which takes some minutes. The ratio to ANDES needs the extra
        ``andes``.

    Returns
    -------
    dict
        ``simulations_per_second`` by case and batch size with the largest number of threads, and the same by number of
        threads in ``threads``; ``compile_seconds`` and ``cached_import_seconds`` by case; ``cwt`` with
        ``signals_per_second`` and ``ratio_to_pywt``; ``cnn_epoch_seconds``. With `labels` also, on `load_ieee39` with
        all threads and without set-up:

        - ``labels_102500_seconds`` and ``labels_102500_seconds_default_step``: 2500 samples of 41 simulations at a step
          of 5 and of 2.5 ms, each in a new process; ``labels_simulations``, their number; ``labels_threads``;
          ``labels_peak_gib``, largest memory of the two processes, None on systems other than Linux;
        - ``labels_scaling``: list of ``{n, seconds}`` for about 1000 to 100 000 simulations at 5 ms;
          ``labels_exponent``: the power of n that fits them;
        - ``ratio_to_andes`` at 5 ms and ``ratio_to_andes_default_step`` at 2.5 ms: simulations a second over those of
          ANDES at its default step on one core;
        - ``andes``: version, case, number of variables, seconds of one run of the New England system at its default
          step (``default_step``, ``default_step_seconds``) and at 5 ms (``coarse_step``, ``coarse_step_seconds``),
          and ``ratios``, a list of ``{step, andes_step, ratio, per_core}``.

        Without ANDES, ``andes`` and both ratios are None.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "kind": "bench-speed", "machine": machine()}
    result["threads"] = {str(k): {} for k in THREADS}
    for name in DEVICES:
        for threads in THREADS:
            figures = simulations_per_second(name, threads)
            result["threads"][str(threads)][name] = figures
            told = ", ".join(f"n = {n}: {v:.0f}/s" for n, v in figures.items())
            _log.info("%s, %d thread(s): %s", name, threads, told)
    result["simulations_per_second"] = result["threads"][str(THREADS[-1])]
    result |= {"compile_seconds": {}, "cached_import_seconds": {}}
    for name in DEVICES:
        compiled, cached = first_use_seconds(name)
        result["compile_seconds"][name], result["cached_import_seconds"][name] = compiled, cached
        _log.info("%s: first use %.1f s, from the cache %.1f s (new process each)", name, compiled, cached)
    result["cwt"] = cwt = cwt_speed()
    _log.info("CWT: %.0f signals/s, %.1f times pywt.cwt", cwt["signals_per_second"], cwt["ratio_to_pywt"])
    if labels:
        result |= measure_labels()
        plot_labels(result, out / "labels.png")
    if cnn:
        try:
            result["cnn_epoch_seconds"] = seconds = cnn_epoch_seconds()
            _log.info("one epoch on %s: %.1f s", " x ".join(map(str, _CNN_SHAPE)), seconds)
        except MissingExtraError as error:
            _log.info("no epoch of the network: %s", error)
    write_json_atomic(out / "result.json", result)
    write_text_atomic(out / "table.md", table(result))
    return result


def dip_event(seconds: float = 5.0) -> Playback:
    """Voltage dip of 0.15 s with a swing of the angle, sampled as by a phasor measurement unit."""
    time = np.arange(0, seconds, 1 / 60.0)
    low = (time > 1.0) & (time < 1.15)
    angle = np.where(time > 1.0, 0.25 * np.sin(5.0 * (time - 1.0)) * np.exp(-(time - 1.0) / 2), 0.0)
    signals = {"V": np.where(low, 0.45, 1.0), "angle": angle}
    return Playback(time, "benchmark", 1.0, signals, {"V": 1.0, "P": 0.7, "Q": 0.15})


def simulations_per_second(device: str, threads: int) -> dict[str, float]:
    """Speed of playback of 5 s at the default step of 2.5 ms, by batch size."""
    simulator = PlantSimulator(device, dip_event(), n_threads=threads)
    theta = latin_hypercube(simulator.parameters, max(BATCHES), 0)
    return {str(n): n / best_seconds(lambda n=n: simulator.simulate(theta[:n])) for n in BATCHES}  # type: ignore[misc]


def first_use_seconds(device: str) -> tuple[float, float]:
    """Seconds of the first batch in a new process, with an empty cache and with the cache it left."""
    code = (
        "from time import perf_counter\n"
        "start = perf_counter()\n"
        "import numpy as np\n"
        "from errorscreen.events import Playback\n"
        "from errorscreen.simulators import PlantSimulator\n"
        "time, signals = np.arange(0, 5, 1 / 60), {'V': np.ones(300), 'angle': np.zeros(300)}\n"
        "event = Playback(time, 'benchmark', 1.0, signals, {'V': 1.0, 'P': 0.7, 'Q': 0.15})\n"
        f"simulator = PlantSimulator({device!r}, event)\n"
        "simulator.simulate([simulator.parameters.nominal] * 16)\n"
        "print(perf_counter() - start)\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        compiled, cached = (float(in_new_process(code, ERRORSCREEN_CACHE_DIR=folder)) for _ in range(2))
    return compiled, cached


def cwt_speed(n_signals: int = 256, n_samples: int = 501) -> dict[str, float]:
    """Speed of the wavelet energy on 64 scales, against one call of `pywt.cwt` for each signal at its fastest."""
    import pywt

    from errorscreen.features import CWTTransformer

    signals = np.random.default_rng(0).standard_normal((n_signals, 1, n_samples))
    transformer = CWTTransformer(sampling_period=0.01, energy="linear", n_jobs=-1).fit(signals)
    ours = n_signals / best_seconds(lambda: transformer.transform(signals))

    def one_by_one(block: NDArray[Any], method: str) -> None:
        for signal in block:
            np.abs(pywt.cwt(signal, transformer.scales_, transformer.wavelet, method=method)[0]) ** 2

    few = signals[:32, 0]
    theirs = max(
        len(few) / best_seconds(lambda d=d, m=m: one_by_one(few.astype(d), m))  # type: ignore[misc]
        for d in (np.float32, np.float64)
        for m in ("fft", "conv")
    )
    return {"signals_per_second": ours, "pywt_signals_per_second": theirs, "ratio_to_pywt": ours / theirs}


def cnn_epoch_seconds() -> float:
    """Seconds of one epoch of the network with its default settings on 2500 two-channel images of 64 x 256."""
    from errorscreen.learning.regressors import CNNContributionRegressor

    rng = np.random.default_rng(0)
    images = rng.standard_normal(_CNN_SHAPE, dtype=np.float32)
    labels = rng.uniform(0, 1, (len(images), 40))

    def fit(epochs: int) -> float:
        model = CNNContributionRegressor(max_epochs=epochs, patience=None, random_state=0)
        start = perf_counter()
        model.fit(images, labels)
        return perf_counter() - start

    return fit(2) - fit(1)  # without set-up


def table(result: dict[str, Any]) -> str:
    """Markdown table of a result of `measure_speed`."""
    rows = []
    for threads, cases in result["threads"].items():
        for name, figures in cases.items():
            cells = [f"{figures[str(n)]:.0f}/s" for n in BATCHES]
            cells += [f"{result[key][name]:.1f} s" for key in ("compile_seconds", "cached_import_seconds")]
            rows.append((name, threads, *cells))
    sizes = [f"n = {n}" for n in BATCHES]
    lines = table_lines(("device", "threads", *sizes, "first use", "from cache"), rows)
    cwt = result["cwt"]
    lines += [
        "",
        f"CWT: {cwt['signals_per_second']:.0f} signals/s, {cwt['ratio_to_pywt']:.1f} times `pywt.cwt` for each signal.",
    ]
    if "cnn_epoch_seconds" in result:
        lines.append(f"One epoch of the network on 2500 × 2 × 64 × 256: {result['cnn_epoch_seconds']:.1f} s.")
    lines += label_rows(result)
    system = result["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in system["versions"].items())
    lines += [
        "",
        f"All responses are of 5 s, those of devices at 2.5 ms. {system['cores']} cores ({system['processor']}), "
        f"Python {system['python']}, {versions}.",
    ]
    return "\n".join(lines) + "\n"
