"""Ranking of hidden effects by the network's first look, beside the full search: renews its table in the docs.

``python benchmarks/first_look.py [SCENARIOS [SAMPLES [SEED]]]`` draws scenarios with one effect or measurement fault
for each device. All have the same event, so that one network reads them all.
"""

import sys
import warnings
from itertools import count
from pathlib import Path
from time import perf_counter

import numpy as np

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.discovery import CauseFinder, FirstLook
from errorscreen.effects.base import DURING
from errorscreen.exceptions import DataWarning
from errorscreen.models import DEVICES

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "first_look.md"
SCENARIOS, SAMPLES, SEED = 16, 4000, 41
#: least size of a large effect, in multiples of the noise
LARGE = 20.0


def look_and_search(device, scenarios, samples, seed):
    """Rank of each hidden effect in the first look, whether the search named it, sizes, and seconds of both."""
    hidden = [_drawn(device, seed, i) for i in range(scenarios)]
    started = perf_counter()
    look = FirstLook(hidden[0].simulator, n_samples=samples, random_state=seed).fit(hidden[0].recordings[0])
    training = perf_counter() - started
    ranks, named, searching = [], [], 0.0
    for one in hidden:
        found = dict(zip(look.names_, look.contributions(one.recordings[0]), strict=True))
        order = sorted(look.effects_, key=lambda name: -found[name])
        (right,) = (name.partition(DURING)[0] for name in one.effects)
        ranks.append(order.index(right) + 1)
        started = perf_counter()
        finder = CauseFinder(one.simulator, random_state=seed).fit(one.recordings[0])
        searching += perf_counter() - started
        named.append(finder.causes_[0].name == right)
    sizes = np.array([one.size for one in hidden])
    return np.array(ranks), np.array(named), sizes, training, searching / scenarios


def _drawn(device, seed, number):
    """Draw a scenario whose effect acts in the first recording, the only one that is searched."""
    kind = ("effect", "measurement")[number % 2]
    for attempt in count():
        hidden = draw_plant_scenario([seed, number, attempt], 40.0, kind=kind, device=device)
        if hidden.effects[0].partition(DURING)[2] in ("", hidden.recordings[0].event.name):
            return hidden


def main(scenarios, samples, seed):
    """Table with one row for each device."""
    header = ("device", "scenarios", "first look: first", "among three", "first, if large", "search: first")
    header += ("training", "one search")
    rows = []
    for device in DEVICES:
        ranks, named, sizes, training, searching = look_and_search(device, scenarios, samples, seed)
        large = sizes >= LARGE
        shares = (ranks == 1).mean(), (ranks <= 3).mean(), (ranks[large] == 1).mean(), named.mean()
        cells = [device, f"{scenarios} ({large.sum()} large)", *(f"{share:.2f}" for share in shares)]
        cells += [f"{training:.0f} s", f"{searching:.0f} s"]
        print(*cells, sep=" | ", flush=True)
        rows.append(cells)
    return "\n".join(table_lines(header, rows)) + (
        f"\n\nOne event is seen, by both. {samples} training samples, 40 dB, seed {seed}; large: at least {LARGE:g} "
        "times the noise survives a refit of the parameters.\n"
    )


if __name__ == "__main__":
    warnings.simplefilter("ignore", DataWarning)
    given = [int(n) for n in sys.argv[1:]]
    write_text_atomic(TABLE, main(*(given + [SCENARIOS, SAMPLES, SEED][len(given) :])))
