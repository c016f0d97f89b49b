"""Hidden scenarios of units of standard models, whose truth ANDES makes (``andes``), or another model (``models``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench import unit_differences as differ
from errorscreen.bench.andes_network import BASE, COLUMNS, F_NOMINAL, FAULT, GridEvent, simulate_unit
from errorscreen.bench.andes_network import RECORDS as ANDES_RECORDS
from errorscreen.bench.plant_scenarios import FIT, HELD_OUT, START, STOP, TRUTH_STEP, GridSide
from errorscreen.bench.scenarios import LEAST_SIZE, Scenario, draw_kind, pick, surviving, too_small
from errorscreen.bench.unit_differences import Channels, Difference, Records
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import Playback
from errorscreen.exceptions import InputError, SimulationError, unknown_name
from errorscreen.simulators import PlantSimulator

#: kinds of scenarios and their shares
_MACHINE_MIX = (
    ("healthy", 0.08),
    ("nothing", 0.17),
    ("part missing", 0.2),
    ("part off", 0.15),
    ("other family", 0.1),
    ("saturation", 0.08),
    ("MVA base", 0.06),
    ("measurement", 0.06),
    ("two effects", 0.1),
)
ANDES_MIX = _MACHINE_MIX
MODELS_MIX = (*((kind, 0.9 * share) for kind, share in _MACHINE_MIX), ("flag", 0.1))
#: samples a second, points of the truth for each sample, and rest in front of a simulation of ANDES in s
_RATE, _FINE, _LEAD = 120, 10, 4.0
#: recordings that are fitted; the last one is held out
_FITTED = 2
#: end of a simulation of ANDES in s, and rating of the source in units
_END, _SOURCE = 8.0, 3.0
#: tries until a difference is large enough: a truth of ANDES takes half a minute
_TRIES = 20
#: constants that do not deviate: those of GENROU that other constants bound, and the product r Tr of HYGOV, 1 in ANDES
_KEPT = {"GENROU": ("Xl",), "HYGOV": ("r", "Tr")}

_Array = NDArray[np.float64]
#: an event, and power and voltage before it
Situation = tuple[Any, Mapping[str, float]]


@dataclass(frozen=True)
class Program:
    """Where the truth of a case comes from.

    Parameters
    ----------
    exciters, governors, stabilisers : tuple of str
        Models of a complete unit, one of each.
    other : tuple of str
        Models of families that the library does not offer for an empty slot.
    own : mapping
        Constants other than the typical ones.
    events : callable
        Draws the events, each with power and voltage before it; the last one is held out.
    respond : callable
        ``respond(records, event, point)`` simulates a unit: V, angle, P and Q at ten times the rate of the recording.
    start : float
        Instant of the events in s.
    """

    exciters: tuple[str, ...]
    governors: tuple[str, ...]
    stabilisers: tuple[str, ...]
    other: tuple[str, ...]
    own: Mapping[str, Mapping[str, float]]
    events: Callable[[np.random.Generator], Sequence[Situation]]
    respond: Callable[[Records, Any, Mapping[str, float]], tuple[_Array, Channels]]
    start: float


def draw_andes_scenario(seed: Any, noise_db: float, *, kind: str | None = None, **sizes: Any) -> Scenario:
    """Draw a scenario whose truth ANDES simulates, in a network with a weak source; needs the extra ``andes``."""
    return _draw(ANDES, ANDES_MIX, seed, noise_db, kind, **sizes)


def draw_models_scenario(seed: Any, noise_db: float, *, kind: str | None = None, **sizes: Any) -> Scenario:
    """Draw a scenario whose truth is another unit of standard models, simulated with a tenth of the step."""
    return _draw(MODELS, MODELS_MIX, seed, noise_db, kind, **sizes)


def _draw(
    program: Program,
    mix: Sequence[tuple[str, float]],
    seed: Any,
    noise_db: float,
    kind: str | None,
    least_size: float = LEAST_SIZE,
) -> Scenario:
    """Draw differences between a unit and its file until each is large enough, and record the unit."""
    rng = np.random.default_rng(seed)
    drawn = draw_kind(rng, mix)
    kind = kind or drawn
    if kind not in dict(mix):
        raise unknown_name(kind, dict(mix), kind="kind")
    for _ in range(_TRIES):
        whole, differences = _differences(program, kind, rng)
        events = program.events(rng)
        try:
            true = whole if kind == "healthy" else differ.deviated(whole, rng, _KEPT)
            found = _recorded(program, true, whole, differences, events, noise_db, rng)
        except (InputError, SimulationError):  # deviating parameters that make no unit, or no equilibrium
            continue
        if found is not None and all(size >= least_size for size in found.sizes):
            return found.scenario(kind, differences)
    raise too_small("", least_size, noise_db, _TRIES)


def _differences(
    program: Program, kind: str, rng: np.random.Generator
) -> tuple[Records, tuple[Difference, ...]]:
    """Typical records of a complete unit, and in what unit and file differ."""
    if kind == "flag":
        whole = differ.typical(("REGCA1", "REECA1", "REPCA1"))
        return whole, (differ.flag(pick(rng, differ.device_of(whole).effects)),)
    parts = [pick(rng, program.exciters), pick(rng, program.governors), pick(rng, program.stabilisers)]
    if kind == "other family":
        other = pick(rng, program.other)
        parts = [other if differ.PARTS[other].slot == differ.PARTS[model].slot else model for model in parts]
        return differ.typical(("GENROU", *parts), program.own), (differ.other_family(other),)
    whole = differ.typical(("GENROU", *parts), program.own)
    drawn: dict[str, Callable[[], Difference]] = {
        "part missing": lambda: differ.missing(pick(rng, parts)),
        "part off": lambda: differ.off(pick(rng, parts)),
        "saturation": lambda: differ.saturation("GENROU"),
        "MVA base": lambda: differ.other_base(rng),
        "measurement": lambda: differ.fault_of_measurement(rng),
    }
    if kind in drawn:
        return whole, (drawn[kind](),)
    while kind == "two effects":
        two = tuple(drawn[pick(rng, list(drawn))]() for _ in range(2))
        if differ.fit_together(two):
            return whole, two
    return whole, ()


@dataclass(frozen=True)
class _Recorded:
    """Recordings of a unit, the model of its file, true responses, and sizes of the differences."""

    simulator: PlantSimulator
    observations: list[Observation]
    truths: list[_Array]
    sizes: tuple[float, ...]

    def scenario(self, kind: str, differences: Sequence[Difference]) -> Scenario:
        n = _FITTED
        return Scenario(
            kind=kind,
            device=" and ".join(one.slot for one in differences) or "none",
            effects=tuple(one.right[0] for one in differences),
            hidden=tuple(one.name for one in differences),
            place="",
            size=min(self.sizes, default=0.0),
            theta=self.simulator.parameters.nominal,
            simulator=self.simulator,
            recordings=tuple(self.observations[:n]),
            held_out=tuple(self.observations[n:]),
            truths=tuple(self.truths[n:]),
            structure=(),
            values=np.zeros(0),
            alternatives=tuple(one.right for one in differences),
        )


def _recorded(
    program: Program,
    true: Records,
    stated: Records,
    differences: Sequence[Difference],
    events: Sequence[Situation],
    noise_db: float,
    rng: np.random.Generator,
) -> _Recorded | None:
    """Recordings of the unit `true`, of which the file says `stated` but for the differences."""
    truth = differ.truth_of(true, differences)
    clean = [_distorted(program.respond(truth, *event), differences) for event in events]
    if not all(np.isfinite(values).all() for channels in clean for values in channels[1].values()):
        return None
    seeds = rng.integers(2**32, size=len(events))
    pairs = list(zip(events, clean, seeds, strict=True))
    noisy = [_recording(program, event, one, noise_db, int(seed)) for event, one, seed in pairs]
    device = differ.device_of(differ.file_of(stated, differences))
    simulator = PlantSimulator(device, noisy[0], parameters=differ.candidates_of(device), n_threads=1)
    observations = [simulator.observe(recording) for recording in noisy]
    exact = [_recording(program, event, one, None, 0) for event, one in zip(events, clean, strict=True)]
    sizes = []
    for k, one in enumerate(differences):
        others = [*differences[:k], *differences[k + 1 :]]
        initial = exact
        if one.distort is not None:
            plain = [_distorted(program.respond(truth, *event), others) for event in events]
            initial = [_recording(program, event, c, None, 0) for event, c in zip(events, plain, strict=True)]
        own, of_file = (differ.truth_of(one.stated(records), others) for records in (true, stated))
        sizes.append(_size(own, of_file, initial[:_FITTED], exact[:_FITTED], observations[:_FITTED]))
    sampled = [o.values for o in (simulator.observe(recording) for recording in exact)]
    return _Recorded(simulator, observations, sampled, tuple(sizes))


def _size(
    true: Records, stated: Records, initial: list[Recording], exact: list[Recording], noisy: list[Observation]
) -> float:
    """What a refit of the unit without a difference leaves, in multiples of the noise, see `surviving`.

    The refit begins at the true values and at those of the file, and stays inside what its user lets move.
    """
    device = differ.device_of(stated)
    plant = PlantSimulator(device, initial[0], parameters=differ.candidates_of(device), n_threads=1)
    observed = [replace(plant.observe(one), noise=o.noise) for one, o in zip(initial, noisy, strict=True)]
    names = [name.split(".") for name in plant.parameters.names]
    theta = np.clip([true[model][constant] for model, constant in names], *plant.parameters.bounds.T)
    changes = []
    for observation, recording in zip(observed, exact, strict=True):
        found = plant.simulate(theta, observation.event).require_ok("the unit without a difference")
        changes.append(plant.observe(recording).values - found.values[0])
    return surviving(plant, theta, observed, changes, plant.parameters.nominal)


def _distorted(found: tuple[_Array, Channels], differences: Sequence[Difference]) -> tuple[_Array, Channels]:
    time, channels = found
    for one in differences:
        if one.distort is not None:
            channels = one.distort(channels, float(time[1] - time[0]))
    return time, channels


def _recording(
    program: Program, event: Situation, found: tuple[_Array, Channels], noise_db: float | None, seed: int
) -> Recording:
    """Samples of all channels, with noise unless its level is None; that of the angle is that of the phasor."""
    rng = np.random.default_rng(seed)
    time, channels = found[0][::_FINE], {name: values[::_FINE] for name, values in found[1].items()}
    for name in ("V", "angle", "P", "Q"):
        if name != "angle":  # an angle that drifts away would count as a large signal
            moved = float(np.sqrt(np.mean((channels[name] - channels[name][0]) ** 2)))
        if noise_db is not None:
            sigma = max(moved * 10 ** (-noise_db / 20), 1e-6)
            channels[name] = channels[name] + sigma * rng.standard_normal(len(time))
    options: dict[str, Any] = {"base_mva": BASE, "f_nominal": F_NOMINAL, "event_time": program.start}
    return Recording.from_arrays(time, channels, name=event[0].name, **options)


def _grid_events(rng: np.random.Generator) -> list[Situation]:
    """Faults of different depth and duration, each with the loss of another generator."""
    durations = rng.choice(np.arange(6, 19), 3, replace=False) / _RATE
    reactances, lost = rng.permutation([0.02, 0.06, 0.15]), rng.permutation([0.08, 0.14, 0.2])
    names = ("first fault", "second fault", "held-out fault")
    rows = zip(reactances, durations, lost, names, strict=True)
    return [(GridEvent(float(x), float(t), float(p), name), _point(rng)) for x, t, p, name in rows]


def _point(rng: np.random.Generator) -> dict[str, float]:
    """Operating point; of a simulation of ANDES the reactive power follows from the voltage."""
    limits = {"P": (0.45, 0.8), "V": (0.97, 1.06), "Q": (-0.2, 0.4)}
    return {name: float(rng.uniform(*between)) for name, between in limits.items()}


def _by_andes(records: Records, event: GridEvent, point: Mapping[str, float]) -> tuple[_Array, Channels]:
    """Response of a unit in ANDES, at rest for some seconds first."""
    rows = simulate_unit(records, event, power=point["P"], voltage=point["V"], source=_SOURCE, end=_END)
    time = np.arange(-_LEAD, _END, 1 / (_RATE * _FINE))
    columns = dict(zip(COLUMNS, rows.T, strict=True))
    return time, {name: np.interp(time, columns["time"], columns[name]) for name in COLUMNS[1:]}


def _sides(rng: np.random.Generator) -> list[Situation]:
    return [(side, _point(rng)) for side in (*FIT, pick(rng, HELD_OUT))]


def _by_models(records: Records, event: GridSide, point: Mapping[str, float]) -> tuple[_Array, Channels]:
    """Response of a unit of standard models to a voltage, with the step of the truth."""
    time = np.arange(0, STOP, 1 / (_RATE * _FINE))
    signals = event.signals(time)
    signals["V"] = signals["V"] * point["V"]
    played = Playback(time, event.name, START, signals, dict(point))
    plant = PlantSimulator(differ.device_of(records), played, step=TRUTH_STEP, effects=(), n_threads=1)
    response = plant.simulate(plant.parameters.nominal, played).require_ok("the true unit").values[0]
    return time, {**signals, "P": response[0], "Q": response[1]}


ANDES = Program(
    ("SEXS",),
    ("TGOV1", "IEEEG1", "HYGOV"),
    ("IEEEST",),
    ("ESST4B",),
    ANDES_RECORDS,
    _grid_events,
    _by_andes,
    FAULT,
)
MODELS = Program(
    ("SEXS",), ("TGOV1", "HYGOV", "GGOV1"), ("IEEEST",),
    ("IEEET1", "ESST4B", "ESAC6A", "EXPIC1", "GAST", "IEESGO"), {}, _sides, _by_models, START,
)  # fmt: skip
