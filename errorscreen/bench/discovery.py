"""The discovery study: it hides causes in simulated recordings, searches each blindly, and counts the rates."""

from __future__ import annotations

import contextlib
import json
import logging
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from tqdm import tqdm

from errorscreen._runtime.store import Store, digest, program
from errorscreen.bench.discovery_output import write_discovery
from errorscreen.bench.discovery_rates import summarise
from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.bench.scenarios import LEAST_SIZE, MIX, Scenario, check_sizes
from errorscreen.bench.timing import machine
from errorscreen.bench.trap_scenarios import TRAP_MIX, draw_trap_scenario
from errorscreen.bench.unit_scenarios import (
    ANDES_MIX,
    MODELS_MIX,
    draw_andes_scenario,
    draw_models_scenario,
)
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.hypotheses import JointFit
from errorscreen.discovery.search.plan import check_plan
from errorscreen.effects import Effect
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
#: for each case: the function that draws a scenario, and the kinds with their shares
CASES: dict[str, tuple[Callable[..., Scenario], tuple[tuple[str, float], ...]]] = {
    "plant": (draw_plant_scenario, MIX),
    "ieee39": (draw_grid_scenario, MIX),
    "traps": (draw_trap_scenario, TRAP_MIX),
    "andes": (draw_andes_scenario, ANDES_MIX),
    "models": (draw_models_scenario, MODELS_MIX),
}
#: cases whose hidden effects have a strength to scale
_SCALED = ("plant", "ieee39")
#: least sizes other than `LEAST_SIZE`: parameters of a unit make up for most of a part
_LEAST = {"andes": 1.0, "models": 1.0}
#: a group that holds the right name counts as correct if it has at most so many members
_LARGEST_GROUP = 2
#: iterations of the fit of the true structure, which starts at the true values
_ITERATIONS = 30

_log = logging.getLogger(__name__)
_Record = dict[str, Any]
_Array = NDArray[np.float64]


def discovery_study(
    out: str | Path,
    *,
    case: str = "plant",
    scenarios: int = 200,
    seed: int = 0,
    noise_db: float = 40.0,
    least_size: float | None = None,
    largest_size: float | None = None,
    kinds: Sequence[str] | None = None,
    plan: Sequence[str] | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Search hidden scenarios, write result, tables and figures into ``out``, and return the result.

    A scenario hides deviating parameters and, by the shares of the case, nothing else, one or two effects of the
    library, an effect in another form than the library's, an effect outside of the library, or a measurement fault.
    The truth has its own noise and at most a tenth of the fitted model's step. Finished scenarios stay in
    ``out/stages``: the same call goes on from there.

    Parameters
    ----------
    out : str or Path
        Folder; made where it is missing.
    case : {"plant", "ieee39", "traps", "andes", "models"}
        Where the hidden truth comes from: equations of the case study in playback, the 39-bus system, general ODE
        models, units of standard models simulated by ANDES (extra ``andes``), or by our own models.
    scenarios : int
    seed : int
        A scenario does not depend on the number of scenarios.
    noise_db : float
        Level of each channel's deviation from its value before the event over that of the noise, both rms.
    least_size : float, optional
        Least size of a hidden effect: the part that a refit of the parameters leaves, in multiples of the noise; 3
        where not given, and 1 of units of standard models, whose parameters make up for most of a part.
    largest_size : float, optional
        Scales strengths to sizes drawn between the two, evenly by order of magnitude; for plant and ieee39.
    kinds : sequence of str, optional
        Kinds to hide in turn, instead of the shares of the case.
    plan : sequence of str, optional
        Steps of the search, see `CauseFinder`; all where not given.
    n_jobs : int, optional
        Processes that share the scenarios. They do not change the result, only the times.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    dict
        ``scenarios``: truth, verdict, causes and held-out errors of each. ``rates``, each ``{value, interval, n}``:

        - ``correct``, ``wrong``, ``unknown`` and ``missed`` (explained by parameters) of the scenarios that hide one
          effect of the library or a measurement fault, ``false_alarm`` where nothing is hidden;
        - ``outside_unknown``, ``outside_place`` (right device) and ``outside_port`` of effects outside the library;
        - ``both_found`` and ``both_wrong`` of two effects;
        - ``interval_holds`` of the intervals of parameters of rightly named effects.

        ``by_kind`` and ``by_device``: number of each outcome. ``held_out_ratio_median``: error against the true
        response, extended over recalibrated model, of rightly named causes. ``true_structure_ratio_median`` and
        ``..._p90``: the same over a fit of the true structure. ``expected_calibration_error`` and ``reliability`` of
        the probabilities.

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
    least_size = check_real(
        _LEAST.get(case, LEAST_SIZE) if least_size is None else least_size, "the least size", low=0.0
    )
    if largest_size is not None:
        largest_size = check_real(largest_size, "the largest size", low=0.0)
        check_sizes(least_size, largest_size)
        if case not in _SCALED:
            raise InputError(
                f"effects of the case {case} are not scaled to a size", allowed=", ".join(_SCALED)
            )
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
        "plan": digest(check_plan(plan)),
    }
    store = Store(Path(out) / "stages", fingerprint)
    records = {
        i: json.loads(found["record"].tobytes().decode()) for i, found in store.load(range(scenarios)).items()
    }
    _log.info("%d scenarios, %d of them finished before", scenarios, len(records))
    missing = [i for i in range(scenarios) if i not in records]
    finished = search_all(
        case, seed, missing, noise_db, least_size, n_jobs, kinds=kinds, largest_size=largest_size, plan=plan
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
    """Result of `discovery_study` from the rows of `run_scenario`, without its times."""
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
        **summarise(rows, dict(mix)),
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
    """Search some scenarios in parallel, see `run_scenario`; rows come in the order in which they finish."""
    found: Iterator[_Record] = Parallel(n_jobs=n_jobs, return_as="generator_unordered")(
        delayed(run_scenario)(
            case, seed, i, noise_db, least_size, kinds[i % len(kinds)] if kinds else None, **options
        )
        for i in numbers
    )
    return found


def streams_of(seed: int, number: int) -> list[np.random.SeedSequence]:
    """Seeds of a scenario of a study: of its draw, and of its search."""
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
    plan: Sequence[str] | None = None,
) -> _Record:
    """Draw one scenario, search it, and judge the answer; without a kind, that is drawn too."""
    of_hidden, of_search = streams_of(seed, number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # some drawn recordings look odd on purpose
        sizes = {"least_size": least_size}
        if largest_size is not None:
            sizes["largest_size"] = largest_size
        hidden = CASES[case][0](of_hidden, noise_db, kind=kind, **sizes)
        started = perf_counter()
        search_seed = int(of_search.generate_state(1)[0])
        finder = CauseFinder(hidden.simulator, max_effects=max_effects, plan=plan, random_state=search_seed)
        finder.fit(list(hidden.recordings))
        seconds = perf_counter() - started
    verdict, best, closest = finder.verdict_.kind, finder.best_, finder.hypotheses_[0]
    base = next(h for h in finder.hypotheses_ if not h.effects)
    structures = {h.name: _names(h.effects) for h in finder.hypotheses_}
    named = verdict in ("effect", "measurement")
    names = _names(best.effects) if named else ()
    groups = [group.names for group in finder.groups_] if named else []
    alike = [structures[name] for group in groups if len(group) <= _LARGEST_GROUP for name in group]
    first = finder.causes_[0]
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
        "verdict": verdict,
        "named": list(names),
        "groups": [list(group) for group in groups],
        "probability": first.probability,
        "causes": [{"name": c.name, "probability": c.probability} for c in finder.causes_],
        "place": place and {"device": place.device, "port": place.place, "probability": place.probability},
        "outcome": _outcome(hidden, verdict, [names, *alike]),
        "top_is_right": _top_is_right(hidden, first.name, structures),
        "chi2_per_sample": {"parameters": base.chi2_per_sample, "chosen": best.chi2_per_sample},
        "converged": {"parameters": base.converged, "chosen": best.converged},
        "state": {"parameters": base.state, "chosen": best.state},
        "left": _left(finder),
        "closest": {"name": closest.name, "chi2_per_sample": closest.chi2_per_sample},
        "held_out": _held_out(hidden, finder),
        "intervals": _intervals(hidden, finder) if named else [],
        "simulations": finder.n_simulations_,
        "seconds": seconds,
    }


def _names(effects: Iterable[Effect]) -> tuple[str, ...]:
    return tuple(effect.name for effect in effects)


def _left(finder: CauseFinder) -> list[float | None]:
    """Smallest share of the excess of the parameters' fit that one effect leaves, that two leave, and so on."""
    whole = finder.residual_tests_["parameters"].excess
    out: list[float | None] = []
    for number in range(1, finder.max_effects_ + 1):
        left = [finder.residual_tests_[h.name].excess for h in finder.hypotheses_ if len(h.effects) == number]
        out.append(min(left) / whole if left and whole > 0 else None)
    return out


def _outcome(hidden: Scenario, verdict: str, answers: Sequence[tuple[str, ...]]) -> str:
    """``"correct"``, ``"wrong"``, ``"unknown"``, ``"missed"`` (explained by parameters) or ``"false alarm"``."""
    if verdict in ("within-noise", "parameters"):
        return "correct" if hidden.hides_nothing else "missed"
    if hidden.hides_nothing:
        return "false alarm"
    if verdict == "unknown":
        return "correct" if hidden.kind == "outside" else "unknown"
    return "correct" if any(frozenset(answer) in hidden.answers for answer in answers) else "wrong"


def _top_is_right(hidden: Scenario, name: str, structures: Mapping[str, tuple[str, ...]]) -> bool:
    """Whether the first cause is right; `structures` tells the effects of each hypothesis."""
    if hidden.hides_nothing or hidden.kind == "outside":
        return name == ("parameters" if hidden.hides_nothing else "unknown")
    return frozenset(structures.get(name, ())) in hidden.answers


def _intervals(hidden: Scenario, finder: CauseFinder) -> list[_Record]:
    """True value, estimate and interval of each parameter of the hidden effects, where these were named."""
    effects = {effect.name: effect for effect in finder.best_.effects}
    if not hidden.structure or set(effects) != set(hidden.structure):
        return []
    names = [effects[name].local(p.name) for name in hidden.structure for p in effects[name].parameters]
    found = finder.causes_[0].values
    rows = []
    for name, true in zip(names, hidden.values.tolist(), strict=True):
        value, *ends = found[name]  # a value at a bound may have no interval
        interval = [end if np.isfinite(end) else value for end in ends]
        rows.append({"name": name, "true": true, "value": value, "interval": interval})
    return rows


def _held_out(hidden: Scenario, finder: CauseFinder) -> dict[str, float | None]:
    """Rms distance of several models from the true held-out responses, in multiples of the noise."""

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
