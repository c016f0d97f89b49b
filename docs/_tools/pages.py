"""Tables of the documentation that follow from the package: ``python docs/_tools/pages.py`` renews them in all pages.

A page holds a table between ``<!-- generated: NAME -->`` and ``<!-- end -->``.
"""

import contextlib
import io
import json
import os
import re
from collections import Counter
from pathlib import Path
from unittest.mock import patch

import numpy as np

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.bench.speed import dip_event
from errorscreen.cases import case_reference, ieee39_events, load_ieee39
from errorscreen.cli import main
from errorscreen.data.units import UNITS
from errorscreen.discovery.search.plan import PLAN
from errorscreen.effects import (
    EFFECTS,
    FAULT_DURATION,
    FAULT_IMPEDANCE,
    branch_trip,
    common_skew,
    effects_of,
    measurement_effects,
    mva_base,
)
from errorscreen.effects.generic.library import TEXTS
from errorscreen.models import DEVICES, LOAD
from errorscreen.models.standard import PARTS
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.base import REMEDIES, Status

DOCS = Path(__file__).parents[1]
#: step in ms that others are compared with, and those that are compared
FINE, STEPS = 0.25, (10.0, 5.0, 2.5, 1.0)
CASE_STEPS = (0.5, 5.0, 2.5, 1.0)
#: tables of long measurements in docs/tables, and the commands that renew them
MEASURED = {
    "speed": "errorscreen bench speed",
    "paper": "errorscreen bench paper --draws 100 --seed 2026 --noise-db 40",
    "paper_without_noise": "errorscreen bench paper --draws 50 --seed 2026",  # its part above table 2
    "ten_parameters": "python benchmarks/ten_parameters.py",
    "grid_search": "python benchmarks/grid_search.py",
    "discovery": "errorscreen bench discovery --case plant --scenarios 200 --seed 874",
    "discovery_ieee39": "errorscreen bench discovery --case ieee39 --scenarios 200 --seed 874",
    "discovery_noise": "python benchmarks/discovery_noise.py OUT plant",
    "discovery_noise_ieee39": "python benchmarks/discovery_noise.py OUT ieee39",
    "discovery_curves": "python benchmarks/discovery_curves.py OUT plant",
    "discovery_curves_ieee39": "python benchmarks/discovery_curves.py OUT ieee39",
    "places_plant": "python benchmarks/places.py OUT plant",
    "places_ieee39": "python benchmarks/places.py OUT ieee39",
    "first_look": "python benchmarks/first_look.py",
    "traps": "errorscreen bench discovery --case traps --scenarios 700 --seed 67",
    "measured_systems": "python benchmarks/measured_systems.py DATA",
    "reference_models": "python benchmarks/reference_models.py DATA",
    "search_speed": "python benchmarks/search_speed.py",
    "learning_curve": "python benchmarks/learning_curve.py",
}
PAPER_FIGURES = (
    "Figure 1: wavelet energy of the response error, by channel",
    "Figure 2: the system, its plants under test, the fault and what is observed",
    "Figure 3: responses before and after calibration of the ten parameters that the network ranks first",
    "Figure 4: responses before and after calibration of the ten parameters that the sensitivity ranks first",
)
PARAMETER_HEADER = ("name", "symbol", "unit", "typical", "bounds", "meaning")


#: a table in a page: its name and its text
MARKED = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)
#: a row of a device's table: parameter, and by how much P and Q move
MOVED = re.compile(r"^\| `(\w+)` \|.* \| ([\d.]+) \| ([\d.]+) \|$", re.MULTILINE)


def renewed(page, computed=True):
    """Text of a page with its tables as they should be; without `computed`, numbers of simulations stay as they are."""

    def block(match):
        name, old = match.groups()
        if name in DEVICES:
            moved = parameter_effects(DEVICES[name]) if computed else {n: m for n, *m in MOVED.findall(old)}
            text = device_tables(DEVICES[name], moved)
        elif name in COMPUTED:
            text = COMPUTED[name]() if computed else old
        elif name in MEASURED:
            text = published(name, MEASURED[name])
        else:
            text = DECLARED[name]()
        return f"<!-- generated: {name} -->\n{text.strip()}\n<!-- end -->"

    return MARKED.sub(block, page.read_text(encoding="utf-8"))


def pages():
    """Pages that hold tables."""
    found = (page for folder in (DOCS, *DOCS.iterdir()) for page in sorted(folder.glob("*.md")))
    return [page for page in found if MARKED.search(page.read_text(encoding="utf-8"))]


def table(header, rows):
    """Markdown table; bars in cells are escaped."""
    lines = [header, ["---"] * len(header), *rows]
    return (
        "\n".join("| " + " | ".join(str(c).replace("|", "\\|") for c in line) + " |" for line in lines) + "\n"
    )


def math(symbol):
    """Symbol of a parameter for MathJax: everything behind an underscore is one index."""
    return "$" + re.sub(r"_([\w,]+)", r"_{\1}", symbol) + "$"


def parameter_cells(name, p):
    """Row of a table of parameters."""
    bounds = f"{p.lower:g} to {p.upper:g}"
    return f"`{name}`", math(p.symbol), p.unit, f"{p.nominal:g}", bounds, p.description


def device_tables(device, moved):
    """Tables of one device: candidates with the changes that they cause, constants, ports, effects."""
    candidates = [(*parameter_cells(p.name, p), *moved[p.name]) for p in device.candidates]
    channels = [(f"`channel.{n}`", f"measured {n}, in pu", "") for n in device.outputs]
    return "\n".join(
        [
            "## Candidate parameters\n",
            "These can be screened and calibrated. The last two columns are the rms changes of P and Q, in 10⁻³ pu, "
            "when the parameter is 10 % above its typical value and a dip of the voltage to 0.45 pu is played back for "
            "5 s.\n",
            table((*PARAMETER_HEADER, "P moves by", "Q moves by"), candidates),
            "## Other constants\n",
            "Stated in a case file or with `constants=`; never calibrated"
            + "".join(f", but for `{name}` where a case file names it" for name in device.further.names)
            + ".\n",
            constant_table(device),
            "## Ports\n",
            "An effect may act at a port. The last column names the library's effects there.\n",
            table(("port", "quantity", "effects"), [*port_rows(device), *channels]),
            states_and_source(device),
        ]
    )


def load_tables():
    """Tables of a load in a grid, which has no candidates."""
    return "\n".join(
        [
            "## Constants\n",
            "Stated with `LoadUnderTest(bus, {...})`.\n",
            constant_table(LOAD),
            "## Ports\n",
            table(("port", "quantity", "effects"), port_rows(LOAD)),
            states_and_source(LOAD),
        ]
    )


def constant_table(device):
    """Constants of a device beside its candidates."""
    rows = [(f"`{c.name}`", c.unit, f"{c.value:g}", c.description) for c in device.constants]
    return table(("name", "unit", "value", "meaning"), rows)


def port_rows(device):
    """Ports with the effects that act on them."""
    for port, text in device.ports.items():
        names = (
            f"`{e.name}`"
            for e in effects_of(device.name)
            if port in (e.port, *e.beside) and e.kind != "latent"
        )
        yield f"`{port}`", text, ", ".join(names)


def states_and_source(device):
    """Last line of a device's page."""
    return f"States: {', '.join(f'`{s}`' for s in device.states)}. Source: {device.source}.\n"


def moves(simulator, form):
    """Rms change of each channel, as text in 10⁻³ pu, for each parameter at 1.1 times its nominal value."""
    nominal = simulator.parameters.nominal
    values = simulator.simulate(np.vstack([nominal, nominal + np.diag(0.1 * nominal)])).require_ok().values
    rms = np.sqrt(np.mean((values[1:] - values[0]) ** 2, axis=-1))
    return [[format(1e3 * value, form) for value in line] for line in rms]


def parameter_effects(device):
    """Changes of P and Q by each parameter of a device."""
    plant = PlantSimulator(device, dip_event())
    return dict(zip(plant.parameters.names, moves(plant, ".2f"), strict=True))


def error_cells(exact, others):
    """Largest and largest rms error of a channel (n, L) for each other step."""
    for values in others:
        error = values - exact
        yield f"{np.abs(error).max():.1e} ({np.sqrt(np.mean(error**2, axis=-1)).max():.1e})"


def drawn(space):
    """Nominal parameters and 31 draws inside the bounds."""
    theta = latin_hypercube(space, 32, 0)
    theta[0] = space.nominal
    return theta


def step_errors():
    """Errors of P and Q by step, over 32 parameter vectors of each device."""
    rows = []
    for device in DEVICES.values():
        theta = drawn(device.candidates)
        plants = [PlantSimulator(device, dip_event(), step=step / 1e3) for step in (FINE, *STEPS)]
        exact, *others = (plant.simulate(theta).require_ok(device.name).values for plant in plants)
        for r, channel in enumerate(plants[0].channels):
            rows.append((f"`{device.name}`", channel, *error_cells(exact[:, r], [y[:, r] for y in others])))
    return table(("device", "channel", *(f"{step:g} ms" for step in STEPS)), rows)


def case_effects():
    """Changes of each channel of the 39-bus case by each parameter."""
    system = load_ieee39()
    rows = [
        (f"`{p.device}`", f"`{p.name}`", *line)
        for p, line in zip(system.parameters, moves(system, ".3f"), strict=True)
    ]
    return table(("device", "parameter", *(f"{name} moves by" for name in system.channels)), rows)


def case_step_errors():
    """Errors of U and P by event and step, over 32 parameter vectors."""
    systems = [load_ieee39(step=step / 1e3) for step in CASE_STEPS]
    theta = drawn(systems[0].parameters)
    rows = []
    for name, event in ieee39_events().items():
        exact, *others = (system.simulate(theta, event).require_ok(name).values for system in systems)
        for r, channel in enumerate(systems[0].channels):
            size = f"{np.ptp(exact[:, r], axis=-1).max():.2g}"
            rows.append((name, channel, size, *error_cells(exact[:, r], [y[:, r] for y in others])))
    return table(("event", "channel", "range", *(f"{step:g} ms" for step in CASE_STEPS[1:])), rows)


_COMMANDS = (
    ("demo",),
    ("init",),
    ("split",),
    ("check",),
    ("run",),
    ("diagnose",),
    ("keys",),
    ("effects",),
    ("models",),
)
_BENCHES = ("speed", "paper", "discovery")
#: where effects that belong to no device act
_OF = {"measurement": "every simulator, for each of its channels", "event": "grids, for a fault"}


def effect_sections():
    """Heading, file of the figure, effect and its devices for each effect of the library, and those of any simulator.

    Effects of one name that differ from device to device have a section each, told apart by the devices.
    """
    of_channels = *measurement_effects(["P"]), mva_base(), common_skew()
    outside = *of_channels, FAULT_DURATION, FAULT_IMPEDANCE, branch_trip((3, 4))
    found = [effect for effect in (*EFFECTS.values(), *outside) if effect.kind != "latent"]
    sections_of = Counter(effect.name for effect in found)
    for effect in found:
        names, alone = effect.devices, sections_of[effect.name] == 1
        heading = f"`{effect.name}`" if alone else f"`{effect.name}` of {owners(names)}"
        file = "-".join(("effect", effect.name, *(() if alone else names))).replace(" ", "-") + ".png"
        yield f"{heading}: {effect.title}", file, effect, names


def effect_text(heading, file, effect, devices):
    """Section of the page of effects."""
    parameters = [parameter_cells(effect.local(p.name), p) for p in effect.parameters]
    shown = " of ".join(filter(None, (effect.name, owners(devices[:1]).replace("`", ""))))
    return "\n".join(
        [
            f"### {heading}\n",
            f"{effect.description} `{effect.formula}` Acts on `{effect.place}` of "
            f"{owners(devices) or _OF[effect.kind]}. Easily confused with "
            f"{'; '.join(effect.confused_with)}. Source: {effect.source}.\n",
            table(PARAMETER_HEADER, parameters),
            f"![Changes by {shown}](../_generated/{file})\n",
        ]
    )


def owners(names):
    """Devices of an effect, and what it asks of a unit of standard models."""
    devices = [name for name in names if name in DEVICES or name == LOAD.name]
    tags = [name for name in names if name not in devices]
    units = f"units of standard models ({code_list(tags)})" if tags else ""
    return " and ".join(filter(None, (code_list(devices), units)))


def code_list(names):
    """Names as code, with commas."""
    return ", ".join(f"`{name}`" for name in names)


def part_table():
    """Standard models that a DYR file may hold."""
    rows = [
        (
            ", ".join(f"`{name}`" for name in (part.name, *part.aliases)),
            part.slot.replace("_", " "),
            part.title,
            len(part.fields),
            part.checked or "nothing outside yet",
        )
        for part in (PARTS[name] for name in PARTS)
    ]
    return table(("name in the file", "slot", "model", "constants", "compared with"), rows)


def effect_table():
    """Effects of the library with the devices they fit."""
    return "\n".join(effect_text(*section) for section in effect_sections())


def generic_table():
    """Templates of generic effects."""
    rows = []
    for name, (title, formula, source, description, confused) in TEXTS.items():
        words = {"s": "s", "v": "v", "into": ""}
        others = "; ".join(confused).format(**words)
        rows.append((f"`{name}`", title, f"`{formula}`", description.format(**words), others, source))
    return table(("template", "", "equation", "meaning", "confused with", "source"), rows)


def commands():
    """Help texts of the command line."""
    text = []
    for words in ((), *_COMMANDS, *(("bench", kind) for kind in _BENCHES)):
        output = io.StringIO()
        width = patch.dict(os.environ, COLUMNS="80")
        with width, contextlib.redirect_stdout(output), contextlib.suppress(SystemExit):
            main([*words, "--help"])
        text.append(
            f"## `{' '.join(('errorscreen', *words))}`\n\n```text\n{output.getvalue().strip()}\n```\n"
        )
    return "\n".join(text)


def unit_table():
    """Units that the reader knows, by channel."""
    rows = [(f"`{role}`", ", ".join(f"`{unit}`" for unit in units)) for role, units in UNITS.items()]
    return table(("channel", "units"), rows)


def plan_table():
    """Steps of the search."""
    rows = [(f"`{s.name}`", s.inside and f"in {s.inside}", s.when, s.what) for s in PLAN]
    return table(("step", "part", "when", "what happens"), rows)


def status_table():
    """Status of a simulation with its remedy."""
    return table(("status", "remedy"), [(f"`{s.name}`", REMEDIES[s] or "none needed") for s in Status])


def result_table():
    """Top of the schema of result.json."""
    schema = json.loads((DOCS / "result_schema.json").read_text(encoding="utf-8"))
    rows = []
    for key, value in schema["properties"].items():
        target = schema["$defs"].get(value.get("$ref", "").rpartition("/")[2], {})
        rows.append((f"`{key}`", value.get("description") or target.get("description", "")))
    return table(("key", "meaning"), rows)


def published(name, command):
    """Table of a long measurement, or the command for it where it has not been run."""
    path = DOCS / "tables" / f"{name}.md"
    return path.read_text(encoding="utf-8") if path.exists() else f"```text\n{command}\n```\n"


def paper_figures():
    """Figures of the case study that have been drawn."""
    captions = {f"paper-figure{k}.png": caption for k, caption in enumerate(PAPER_FIGURES, start=1)}
    there = [(file, caption) for file, caption in captions.items() if (DOCS / "images" / file).exists()]
    return "\n".join(f"![{caption}](../images/{file})\n\n{caption}.\n" for file, caption in there)


#: tables by name: those of one call, and those that take simulations
DECLARED = {
    "case_keys": case_reference,
    "commands": commands,
    "effects": effect_table,
    "generic_effects": generic_table,
    "load": load_tables,
    "paper_figures": paper_figures,
    "plan": plan_table,
    "result": result_table,
    "standard_models": part_table,
    "status": status_table,
    "units": unit_table,
}
COMPUTED = {"steps": step_errors, "ieee39_effects": case_effects, "ieee39_steps": case_step_errors}

if __name__ == "__main__":
    for page in pages():
        page.write_text(renewed(page), encoding="utf-8")
