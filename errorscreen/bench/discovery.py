"""How often causes are found: hidden scenarios, each searched blindly, and what came out."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from tqdm import tqdm

from errorscreen._runtime.checkpoint import Checkpoint, digest, program
from errorscreen.bench.discovery_output import write_discovery
from errorscreen.bench.discovery_rates import summarise
from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.bench.scenarios import LEAST_SIZE, MIX, Scenario, check_sizes
from errorscreen.bench.timing import machine
from errorscreen.bench.trap_scenarios import TRAP_MIX, draw_trap_scenario
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.hypotheses import JointFit
from errorscreen.exceptions import (
    DataWarning,
    InputError,
    SimulationError,
    check_integer,
    check_real,
    unknown_name,
)
from errorscreen.simulators import Simulator

SCHEMA_VERSION = 1
#: how a hidden scenario of each case is drawn, and the kinds that are drawn with their shares
CASES: dict[str, tuple[Callable[..., Scenario], tuple[tuple[str, float], ...]]] = {
    "plant": (draw_plant_scenario, MIX),
    "ieee39": (draw_grid_scenario, MIX),
    "traps": (draw_trap_scenario, TRAP_MIX),
}
#: a group that holds the right name counts if it has at most so many members
_LARGEST_GROUP = 2
#: iterations of the fit with the true structure, from the true values
_ITERATIONS = 30

_Record = dict[str, Any]
_Array = NDArray[np.float64]


def discovery_study(
    out: str | Path,
    report: Callable[[str], None] = print,
    *,
    case: str = "plant",
    scenarios: int = 200,
    seed: int = 0,
    noise_db: float = 40.0,
    least_size: float = LEAST_SIZE,
    largest_size: float | None = None,
    kinds: Sequence[str] | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Search hidden scenarios, write result, table and figures into ``out``, and return the result.

    A scenario hides deviating parameters and, by the shares of `MIX`, nothing else, an effect of the library, two of
    them, one in another functional form, an effect that the library does not hold, or a measurement fault; a trap hides
    nothing or one effect, by `TRAP_MIX`. The truth has a tenth of the fitted model's step or less, and noise of its
    own. `CauseFinder` sees what is to be fitted.
    What is finished stays in ``out/stages``: the same call goes on from there.

    Parameters
    ----------
    out : str or Path
        Folder, made where it is missing.
    report : callable
        Takes lines of text.
    case : {"plant", "ieee39", "traps"}
    scenarios : int
    seed : int
        A scenario does not depend on how many there are.
    noise_db : float
        Level of each channel's deviation from its value before the event over that of the noise, both rms.
    least_size : float
        Least part of a hidden effect that survives a refit of the parameters, in multiples of the noise.
    largest_size : float, optional
        Where given, strengths of effects are scaled to sizes drawn between the two, evenly by order of magnitude;
        not of traps.
    kinds : sequence of str, optional
        What the scenarios hide, in turn, in place of the shares of the case.
    n_jobs : int, optional
        Processes that share the scenarios; the result does not depend on it, times do.
    progress : bool

    Returns
    -------
    dict
        ``scenarios``, each with its truth, verdict, causes and held-out errors; ``rates``: ``correct``, ``wrong`` and
        ``unknown`` of the scenarios that hide one effect of the library or a measurement fault, ``false_alarm`` where
        nothing is hidden, ``missed`` where parameters were said to explain an effect, ``outside_unknown``,
        ``outside_place`` (right device) and ``outside_port`` of effects outside the library, ``both_found`` and
        ``both_wrong`` of two effects, ``interval_holds``, how many intervals of the parameters of rightly named effects
        hold the true value, each ``{value, interval, n}``; ``by_kind`` and ``by_device``, how many had which
        outcome; ``held_out_ratio_median``, error of the extended over that of the recalibrated model against the true
        response where the cause was named rightly; ``true_structure_ratio_median`` and ``..._p90``, the same over a fit
        of the true structure, and its 90 % quantile; ``expected_calibration_error`` and ``reliability``.

    Raises
    ------
    InputError
        If an argument cannot be used, or ``out/stages`` belongs to another run.
    """
    if case not in CASES:
        raise unknown_name(case, CASES, kind="case", where="bench discovery")
    scenarios = check_integer(scenarios, "the number of scenarios", low=1)
    seed = check_integer(seed, "the seed", low=0, high=2**32 - 1)
    noise_db = check_real(noise_db, "noise_db", low=0.0, high=100.0)
    least_size = check_real(least_size, "the least size", low=0.0)
    if largest_size is not None:
        largest_size = check_real(largest_size, "the largest size", low=0.0)
        check_sizes(least_size, largest_size)
        if case == "traps":
            raise InputError("effects of traps are not scaled to a size", allowed="a case other than traps")
    _, mix = CASES[case]
    if kinds is not None and not kinds:
        raise InputError("the list of kinds is empty", allowed=", ".join(dict(mix)), where="kinds")
    for kind in kinds or ():
        if kind not in dict(mix):
            raise unknown_name(kind, dict(mix), kind="kind", where="kinds")
    if n_jobs == 0:
        raise InputError("the number of jobs is 0", allowed="None, a positive number, or -1 for all cores")
    started = perf_counter()
    fingerprint = {
        "program": program(),
        "case": digest(case),
        "seed, noise and size": digest(seed, noise_db, least_size, largest_size),
        "mix": digest(mix, kinds),
    }
    store = Checkpoint(Path(out) / "stages", fingerprint)
    records = {i: _unpack(found) for i, found in store.load(range(scenarios)).items()}
    report(f"{scenarios} scenarios" + (f", {len(records)} of them finished before" if records else ""))
    missing = [i for i in range(scenarios) if i not in records]
    finished = search_all(
        case, seed, missing, noise_db, least_size, n_jobs, kinds=kinds, largest_size=largest_size
    )
    with tqdm(total=scenarios, initial=len(records), desc="scenarios", disable=not progress) as bar:
        for record in finished:
            i = record["number"]
            store.save(i, {"record": np.frombuffer(json.dumps(record).encode(), dtype=np.uint8)})
            records[i] = record
            bar.update()
    rows = [records[i] for i in range(scenarios)]
    result = {
        **result_of(rows, case=case, seed=seed, noise_db=noise_db, least_size=least_size, kinds=kinds),
        "largest_size": largest_size,
        "seconds": perf_counter() - started,
        "machine": machine(),
    }
    write_discovery(result, Path(out))
    return result


def result_of(
    rows: Sequence[_Record],
    *,
    case: str,
    seed: int,
    noise_db: float,
    least_size: float,
    kinds: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Result of the study that some scenarios are, see `discovery_study`, but for how long it took.

    Parameters
    ----------
    rows : sequence of dict
        Of `run_scenario`.
    case, seed, noise_db, least_size, kinds
        See `discovery_study`.
    """
    _, mix = CASES[case]
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "bench-discovery",
        "case": case,
        "seed": seed,
        "noise_db": noise_db,
        "least_size": least_size,
        "mix": dict(mix) if kinds is None else {kind: kinds.count(kind) / len(kinds) for kind in kinds},
        "scenarios": list(rows),
        **summarise(rows),
    }


def search_all(
    case: str,
    seed: int,
    numbers: Iterable[int],
    noise_db: float,
    least_size: float,
    n_jobs: int | None = None,
    *,
    kinds: Sequence[str] | None = None,
    **options: Any,
) -> Iterator[_Record]:
    """Search some scenarios side by side, see `run_scenario`; their kinds in turn, or as drawn.

    They come in whatever order they finish: a long one must not keep others from being stored.
    """
    found: Iterator[_Record] = Parallel(n_jobs=n_jobs, return_as="generator_unordered")(
        delayed(run_scenario)(
            case, seed, i, noise_db, least_size, kinds[i % len(kinds)] if kinds else None, **options
        )
        for i in numbers
    )
    return found


def streams_of(seed: int, number: int) -> list[np.random.SeedSequence]:
    """Seeds of a scenario of a study: of what is hidden, and of the search."""
    return np.random.SeedSequence(seed, spawn_key=(number,)).spawn(2)


def run_scenario(
    case: str,
    seed: int,
    number: int,
    noise_db: float,
    least_size: float,
    kind: str | None = None,
    *,
    largest_size: float | None = None,
    max_effects: int = 2,
) -> _Record:
    """Draw one scenario, of a kind if it is given, search it, and judge what was found."""
    of_hidden, of_search = streams_of(seed, number)
    with warnings.catch_warnings():  # of recordings that look odd, which is meant
        warnings.simplefilter("ignore", DataWarning)
        draw, _ = CASES[case]
        sizes = {"least_size": least_size}
        if largest_size is not None:
            sizes["largest_size"] = largest_size
        hidden = draw(of_hidden, noise_db, kind=kind, **sizes)
        started = perf_counter()
        search_seed = int(of_search.generate_state(1)[0])
        finder = CauseFinder(hidden.simulator, max_effects=max_effects, random_state=search_seed)
        finder.fit(list(hidden.recordings))
        seconds = perf_counter() - started
    first = finder.causes_[0]
    base = next(h for h in finder.hypotheses_ if not h.effects)
    named = finder.verdict_.kind in ("effect", "measurement")
    names = [e.name for e in finder.best_.effects] if named else []
    groups = [list(group.names) for group in finder.groups_] if named else []
    outcome = _outcome(hidden, finder.verdict_.kind, names, groups)
    place = finder.input_locations_[0] if finder.input_locations_ else None
    return {
        "number": number,
        "truth": {
            "kind": hidden.kind,
            "device": hidden.device,
            "hidden": list(hidden.hidden),
            "right": list(hidden.effects),
            "place": hidden.place,
            "size": hidden.size,
        },
        "verdict": finder.verdict_.kind,
        "named": names,
        "groups": groups,
        "probability": first.probability,
        "causes": [{"name": c.name, "probability": c.probability} for c in finder.causes_],
        "place": None
        if place is None
        else {"device": place.device, "port": place.place, "probability": place.probability},
        "outcome": outcome,
        "top_is_right": _top_is_right(hidden, first.name),
        "chi2_per_sample": {
            "parameters": base.chi2_per_sample,
            "chosen": finder.best_.chi2_per_sample,
        },
        "converged": {"parameters": base.converged, "chosen": finder.best_.converged},
        "state": {"parameters": base.state, "chosen": finder.best_.state},
        "left": _left(finder),
        "closest": {
            "name": finder.hypotheses_[0].name,
            "chi2_per_sample": finder.hypotheses_[0].chi2_per_sample,
        },
        "held_out": _held_out(hidden, finder),
        "intervals": _intervals(hidden, finder) if named else [],
        "simulations": finder.n_simulations_,
        "seconds": seconds,
    }


def _left(finder: CauseFinder) -> list[float | None]:
    """Least share of what parameters leave beyond noise that one effect leaves, that two leave, and so on."""
    whole = finder.residual_tests_["parameters"].excess
    out: list[float | None] = []
    for number in range(1, finder.max_effects + 1):
        left = [finder.residual_tests_[h.name].excess for h in finder.hypotheses_ if len(h.effects) == number]
        out.append(min(left) / whole if left and whole > 0 else None)
    return out


def _outcome(hidden: Scenario, verdict: str, names: Sequence[str], groups: Sequence[Sequence[str]]) -> str:
    """``"correct"``, ``"wrong"``, ``"unknown"``, ``"missed"`` (explained by parameters) or ``"false alarm"``."""
    if verdict in ("within-noise", "parameters"):
        return "correct" if hidden.kind == "nothing" else "missed"
    if hidden.kind == "nothing":
        return "false alarm"
    if verdict == "unknown":
        return "correct" if hidden.kind == "outside" else "unknown"
    right = set(hidden.effects)
    if right and set(names) == right:
        return "correct"
    members = [set(name.split(" + ")) for group in groups if len(group) <= _LARGEST_GROUP for name in group]
    return "correct" if right and right in members else "wrong"


def _top_is_right(hidden: Scenario, name: str) -> bool:
    if hidden.kind == "nothing":
        return name == "parameters"
    if hidden.kind == "outside":
        return name == "unknown"
    return set(name.split(" + ")) == set(hidden.effects)


def _intervals(hidden: Scenario, finder: CauseFinder) -> list[_Record]:
    """True value, estimate and interval of each parameter of what is hidden; none where something else was named."""
    effects = {effect.name: effect for effect in finder.best_.effects}
    if not hidden.structure or set(effects) != set(hidden.structure):
        return []
    names = [effects[name].local(p.name) for name in hidden.structure for p in effects[name].parameters]
    told = finder.causes_[0].values
    return [
        {"name": name, "true": true, "value": told[name][0], "interval": list(told[name][1:])}
        for name, true in zip(names, hidden.values.tolist(), strict=True)
    ]


def _held_out(hidden: Scenario, finder: CauseFinder) -> dict[str, float | None]:
    """Rms distance from the true held-out responses in multiples of the noise, of several models."""

    def distance(model: Simulator) -> float:
        total = count = 0.0
        for observation, truth in zip(hidden.held_out, hidden.truths, strict=True):
            y = model.simulate(model.parameters.nominal, observation.event).values[0]
            total += float(np.sum(((y - truth) / observation.sigma) ** 2))
            count += truth.size
        return float(np.sqrt(total / count))

    true = None
    alike = hidden.simulator.with_step_of(finder.extended_simulator_)
    if hidden.structure:
        simulator = alike
        for name in hidden.structure:
            simulator = simulator.extend(name)
        problem = FitProblem(simulator, list(hidden.recordings))
        u = (np.concatenate([hidden.theta, hidden.values]) - problem.space.nominal) / problem.space.scales
        with contextlib.suppress(SimulationError):
            best = JointFit(simulator.extensions, problem, u).run(_ITERATIONS).hypothesis()
            true = distance(simulator.with_nominal(best.theta))
    found = {
        "baseline": distance(alike),
        "recalibrated": distance(finder.recalibrated_simulator_),
        "extended": distance(finder.extended_simulator_),
        "true_structure": true,
    }
    return {
        name: value if value is not None and np.isfinite(value) else None for name, value in found.items()
    }


def _unpack(arrays: Mapping[str, NDArray[Any]]) -> _Record:
    record: _Record = json.loads(arrays["record"].tobytes().decode())
    return record
