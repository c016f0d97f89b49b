"""The plan of the search: a table of its steps, each of which can be left out, and what each cost and gained."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from errorscreen._runtime.typed import Real
from errorscreen.exceptions import InputError, unknown_name


@dataclass(frozen=True)
class Step:
    """A row of the plan.

    Parameters
    ----------
    name : str
    when : str
        Condition in words.
    what : str
        What happens, in words.
    inside : str
        Step that it is a part of; empty for those of `ModelSearch.run`.
    """

    name: str
    when: str
    what: str
    inside: str = ""


#: the steps in their order
PLAN = (
    Step(
        "add effects",
        "the nominal model leaves more than noise",
        "signatures of all effects and joint fits of the most promising; then the same for a second effect beside the "
        "best one, as long as nothing leaves only noise",
    ),
    Step(
        "fits from nominal values",
        "nothing leaves clearly only noise, and every single effect more than 2 % of the base fit's error",
        "joint fits of all single effects from the nominal parameters",
        inside="add effects",
    ),
    Step(
        "restart before pairs",
        "no single effect leaves only noise",
        "the best single effect starts all over its ranges",
        inside="add effects",
    ),
    Step(
        "leave local minima",
        "after joint fits and restarts",
        "one parameter of an effect at a time moves through its range, and fits start where that promises less",
        inside="any step",
    ),
    Step(
        "finer step",
        "a fit comes near to noise",
        "it is repeated with a quarter of the integration step, and kept if only noise is left then",
        inside="any step",
    ),
    Step(
        "exchange effects",
        "no set of effects leaves only noise",
        "all others in place of each effect of the best pairs, or all pairs",
    ),
    Step(
        "restart nearest",
        "nothing leaves only noise",
        "starts over all ranges: base fit, best single effect, best pair and each of its effects, and up to three "
        "pairs that leave less than 0.3 %",
    ),
    Step(
        "restart again",
        "the nearest fit leaves little enough to be named, and its effects have several minima",
        "the same, up to three times in all",
    ),
    Step(
        "drop effects",
        "a hypothesis with effects leaves only noise",
        "it is fitted again without each of its effects",
    ),
    Step("complete fits", "always", "fits that the verdict rests on go on to their end"),
    Step("improve base", "the base fit stalls", "starts around it, until nothing leads lower"),
    Step(
        "improve parts",
        "effects may be named",
        "they are fitted again from the new base fit; single effects of a pair are led to a minimum too",
    ),
    Step(
        "refine values",
        "the result has effects with thresholds or timers",
        "off the edge, and out of local minima once more; then fits are completed again",
    ),
)
#: names of the steps
STEPS = tuple(step.name for step in PLAN)


@dataclass(frozen=True)
class StepReport:
    """What a step of the plan cost and gained.

    Parameters
    ----------
    name : str
    runs : int
        How often it ran.
    simulations : int
        Without those of other steps inside it.
    seconds : float
        The same.
    left : float
        Share of the base fit's error beyond noise that the nearest hypothesis left at its end.
    adequate : int
        Hypotheses that left only noise at its end.
    """

    name: str
    runs: int
    simulations: int
    seconds: Real
    left: Real
    adequate: int


def check_plan(plan: Iterable[str] | None) -> tuple[str, ...]:
    """Names of the steps of a plan in their order; all for None. `InputError` for an unknown one.

    Examples
    --------
    >>> check_plan(["drop effects", "add effects"])
    ('add effects', 'drop effects')
    """
    if plan is None:
        return STEPS
    if isinstance(plan, str):
        raise InputError("plan is a text", allowed="a list of names of steps", where="plan")
    names = list(plan)
    for name in names:
        if name not in STEPS:
            raise unknown_name(str(name), STEPS, kind="step of the plan", where="plan")
    return tuple(step for step in STEPS if step in names)


class Ledger:
    """Costs of the steps of a search, each without those that ran inside it."""

    def __init__(self) -> None:
        self._rows: dict[str, list[Any]] = {}
        self._inside: list[list[float]] = []

    @contextmanager
    def entry(self, name: str, search: Any) -> Iterator[None]:
        """Count what happens inside for a step; `search` tells `n_simulations`, `share_left` and `adequate`."""
        started, before = perf_counter(), search.n_simulations
        self._inside.append([0.0, 0])
        try:
            yield
        finally:
            seconds, used = perf_counter() - started, search.n_simulations - before
            of_others, simulated = self._inside.pop()
            if self._inside:
                self._inside[-1][0] += seconds
                self._inside[-1][1] += used
            row = self._rows.setdefault(name, [0, 0, 0.0])
            row[0] += 1
            row[1] += used - simulated
            row[2] += seconds - of_others
            row[3:] = [search.share_left, len(search.adequate)]

    @property
    def report(self) -> tuple[StepReport, ...]:
        """A row for each step that ran, in the order of the plan."""
        return tuple(
            StepReport(name, runs, int(used), seconds, left, adequate)
            for name, (runs, used, seconds, left, adequate) in sorted(
                self._rows.items(), key=lambda item: STEPS.index(item[0])
            )
        )
