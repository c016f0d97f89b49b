"""The embedded example of the command line: a unit in a DYR file, four recordings of it, and what is hidden in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen._runtime.sampling import generator
from errorscreen.cases.demo import NOISE, Dip
from errorscreen.events import Playback
from errorscreen.models.dyr import read_dyr
from errorscreen.simulators import PlantSimulator

#: bases of the recorded columns
BASE_MVA, BASE_KV, F_NOMINAL = 100.0, 20.0, 60.0
#: the unit as its owner has it in the file
DYR = """// unit 1, as submitted
101 'GENROU' 1  6.0 0.04 0.8 0.06 {H:.4g} 0.0  1.8 1.7 0.3 0.5 0.22 0.15  0.05 0.25 /
101 'SEXS'   1  0.1 10.0 {K:.4g} 0.05 0.0 5.0 /
101 'IEEEST' 1  1 0  0.0 0.0 0.0 0.0 0.0 0.0  0.25 0.05 0.25 0.05  5.0 5.0 {KS:.4g}  0.1 -0.1 0.0 0.0 /
101 'TGOV1'  1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /
"""
FILE = {"H": 3.5, "K": 120.0, "KS": 15.0}
#: what happened, and from where: two recordings are fitted, two are held out
EVENTS = {
    "fault_near_the_plant": (
        Dip("fault near the plant", 0.50, 0.10, 0.35, 1.0),
        {"V": 1.00, "P": 0.75, "Q": 0.15},
    ),
    "fault_far_away": (Dip("fault far away", 0.20, 0.15, 0.25, 0.8), {"V": 1.02, "P": 0.60, "Q": 0.10}),
    "line_trip": (Dip("line trip", 0.08, 0.30, 0.30, 1.2), {"V": 0.99, "P": 0.80, "Q": 0.05}),
    "longer_fault": (Dip("longer fault", 0.40, 0.20, 0.40, 0.9), {"V": 1.01, "P": 0.50, "Q": 0.20}),
}
#: step of the hidden truth in seconds, readings in a second, and seconds of a record
_TRUTH_STEP, _RATE, _STOP, _START = 1e-3, 60, 9.0, 1.0
#: points of the truth's input for each reading
_FINE = 10

#: channel, header, unit, and 1 pu in that unit
_COLUMNS = (
    ("V", "U", "kV", BASE_KV),
    ("angle", "angle", "deg", 180.0 / np.pi),
    ("P", "P", "MW", BASE_MVA),
    ("Q", "Q", "Mvar", BASE_MVA),
)
_CASE = """# errorscreen check case.toml; errorscreen run case.toml
title = "Demo, seed {seed}: a steam unit"

[device]
dyr = "unit.dyr"
relative = 0.5

[recording]
path = "{first}.csv"
name = "{name}"
base_mva = {base_mva:g}
base_kv = {base_kv:g}
f_nominal = {f_nominal:g}

[recording.columns]
{columns}

{further}
[screening]
samples = 400
epochs = 20
top_k = 4

[discovery]
enabled = {discovery}
"""


class Hidden(NamedTuple):
    """What the recordings hide.

    Parameters
    ----------
    parameter : str
        The wrong number of the file; `value` is the true one.
    value : float
    turned : str
        Channel with the wrong polarity.
    """

    parameter: str
    value: float
    turned: str


def write_demo_case(
    folder: Path, seed: int, *, keys: dict[str, dict[str, Any]] | None = None, discovery: bool = True
) -> Hidden:
    """Write ``unit.dyr``, four recordings and ``case.toml``; return what is hidden in them.

    The truth is simulated with steps of 1 ms and ten points of input for each reading. Its stabiliser is out of
    service, one number of the file is wrong by a fifth to two fifths, and one transducer has the wrong polarity. All
    recorded channels have noise of about 50 dB.

    Parameters
    ----------
    folder : Path
        Must exist.
    seed : int
    keys : dict of str to dict, optional
        Further keys of ``[recording.columns.NAME]`` by channel, for example ``{"Q": {"scale": -1.0}}``.
    discovery : bool
        Whether the case searches causes.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hidden = write_demo_case(Path(folder), 0)
    ...     names = sorted(path.name for path in Path(folder).iterdir())
    >>> hidden.turned in ("Q", "angle"), names[:2]
    (True, ['case.toml', 'fault_far_away.csv'])
    """
    rng = generator(seed)
    name = ("H", "K")[rng.integers(2)]
    value = FILE[name] * rng.uniform(1.2, 1.4) ** rng.choice([-1, 1])
    hidden = Hidden({"H": "GENROU.H", "K": "SEXS.K"}[name], float(value), ("Q", "angle")[rng.integers(2)])
    truth = {**FILE, "KS": 0.0, name: value}
    write_text_atomic(folder / "unit.dyr", DYR.format(**truth))
    unit = read_dyr(folder / "unit.dyr").unit()
    write_text_atomic(folder / "unit.dyr", DYR.format(**FILE))
    for file, (dip, start) in EVENTS.items():
        time, values = _played(unit, dip, start, rng)
        values[hidden.turned] = -values[hidden.turned]
        rows = np.column_stack([time, *(base * values[channel] for channel, _, _, base in _COLUMNS)])
        header = ",".join(["time", *(f"{column} [{unit_of}]" for _, column, unit_of, _ in _COLUMNS)])
        lines = [header, *(",".join(f"{x:.7g}" for x in row) for row in rows)]
        write_text_atomic(folder / f"{file}.csv", "\n".join(lines) + "\n")
    write_text_atomic(folder / "case.toml", _case(seed, keys or {}, discovery))
    return hidden


def _played(
    unit: Any, dip: Dip, start: dict[str, float], rng: np.random.Generator
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Readings (L,) of the unit in an event, with noise."""
    time = np.arange(0.0, _STOP, 1.0 / (_RATE * _FINE))
    signals = dip.signals(time, _START)
    signals["V"] = signals["V"] * start["V"]
    event = Playback(time, dip.name, _START, signals, start)
    model = PlantSimulator(unit, event, step=_TRUTH_STEP)
    P, Q = model.simulate(model.parameters.nominal).require_ok("the truth of the demo").values[0]
    exact = {**signals, "P": P, "Q": Q}
    size = len(time[::_FINE])
    return time[::_FINE], {n: x[::_FINE] + NOISE[n] * rng.standard_normal(size) for n, x in exact.items()}


def _case(seed: int, keys: dict[str, dict[str, Any]], discovery: bool) -> str:
    columns = []
    for channel, column, unit, _ in _COLUMNS:
        entries: dict[str, Any] = {"column": f"{column} [{unit}]", "unit": unit, **keys.get(channel, {})}
        told = ", ".join(f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v:g}" for k, v in entries.items())
        columns.append(f"{channel} = {{ {told} }}")
    (first, (dip, _)), *others = EVENTS.items()
    roles = ("together", "held_out", "held_out")
    further = [
        f'[[{role}]]\npath = "{file}.csv"\nname = "{one.name}"\n'
        for role, (file, (one, _)) in zip(roles, others, strict=True)
    ]
    return _CASE.format(
        seed=seed,
        first=first,
        name=dip.name,
        base_mva=BASE_MVA,
        base_kv=BASE_KV,
        f_nominal=F_NOMINAL,
        columns="\n".join(columns),
        further="\n".join(further),
        discovery=str(discovery).lower(),
    )
