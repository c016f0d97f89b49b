"""Pages of the documentation that are computed or read off the package, so that nothing is typed twice."""

import contextlib
import io
import json
import re
from collections import Counter
from pathlib import Path

import numpy as np

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.bench.plant_scenarios import FIT, OPERATING_POINT, RATE, START, STOP, GridSide
from errorscreen.bench.speed import dip_event
from errorscreen.cases import case_reference, ieee39_events, load_ieee39
from errorscreen.cli import main
from errorscreen.data.units import UNITS
from errorscreen.effects import (
    FAULT_DURATION,
    FAULT_IMPEDANCE,
    LIBRARY,
    branch_trip,
    common_skew,
    measurement_effects,
)
from errorscreen.effects.generic.library import TEXTS
from errorscreen.events import Playback
from errorscreen.models import DEVICES, LOAD
from errorscreen.plotting import plot_signature
from errorscreen.simulators import LoadUnderTest, PlantSimulator
from errorscreen.simulators.base import REMEDIES, Status

DOCS = Path(__file__).parents[1]
#: step in ms that others are compared with, and those that are compared
FINE, STEPS = 0.25, (10.0, 5.0, 2.5, 1.0)
CASE_STEPS = (0.5, 5.0, 2.5, 1.0)
#: tables that take too long for a build of the documentation, and what renews them
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


def write_all(folder):
    """Write every page that differs from what is there."""
    folder.mkdir(exist_ok=True)
    texts = {f"{name}.md": device_page(device) for name, device in DEVICES.items()}
    texts["load.md"] = load_page()
    texts |= {
        "steps.md": step_errors(),
        "effects.md": effect_table(folder),
        "generic_effects.md": generic_table(),
        "case_keys.md": case_reference(),
        "commands.md": commands(),
        "units.md": unit_table(),
        "status.md": status_table(),
        "result.md": result_table(),
        **{f"{name}.md": published(name, command) for name, command in MEASURED.items()},
        "paper_figures.md": paper_figures(),
        "ieee39_effects.md": case_effects(),
        "ieee39_steps.md": case_step_errors(),
    }
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


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


def device_page(device):
    """Tables of one device: candidates with what they move, constants, ports, effects."""
    change = parameter_effects(device)
    candidates = [
        (*parameter_cells(p.name, p), *(f"{1e3 * value:.2f}" for value in change[p.name]))
        for p in device.candidates
    ]
    channels = [(f"`channel.{n}`", f"measured {n}, in pu", "") for n in device.outputs]
    return "\n".join(
        [
            "## Candidate parameters\n",
            "What can be screened and calibrated. The last two columns are the rms changes of P and Q, in 10⁻³ pu, "
            "when the parameter is 10 % above its typical value and a dip of the voltage to 0.45 pu is played back for "
            "5 s.\n",
            table((*PARAMETER_HEADER, "P moves by", "Q moves by"), candidates),
            "## Other constants\n",
            "Stated in a case file or with `constants=`; never calibrated.\n",
            constant_table(device),
            "## Ports\n",
            "Where an effect may act, and the effects of the library that act there.\n",
            table(("port", "quantity", "effects"), [*port_rows(device), *channels]),
            states_and_source(device),
        ]
    )


def load_page():
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
    """What a device needs besides its candidates."""
    rows = [(f"`{c.name}`", c.unit, f"{c.value:g}", c.description) for c in device.constants]
    return table(("name", "unit", "value", "meaning"), rows)


def port_rows(device):
    """Ports with the effects that act on them."""
    library = LIBRARY[device.name]
    for port, text in device.ports.items():
        names = (f"`{e.name}`" for e in library if port in (e.port, *e.beside) and e.kind != "latent")
        yield f"`{port}`", text, ", ".join(names)


def states_and_source(device):
    """Last line of a device's page."""
    return f"States: {', '.join(f'`{s}`' for s in device.states)}. Source: {device.source}.\n"


def parameter_effects(device):
    """Rms change of P and Q in pu for each parameter at 1.1 times nominal."""
    plant = PlantSimulator(device, dip_event())
    nominal = plant.parameters.nominal
    rows = np.vstack([nominal, nominal + np.diag(0.1 * nominal)])
    values = plant.simulate(rows).require_ok().values
    rms = np.sqrt(np.mean((values[1:] - values[0]) ** 2, axis=-1))
    return dict(zip(plant.parameters.names, rms, strict=True))


def step_errors():
    """Largest and largest rms error of P and Q by step, over the typical parameters and 31 draws inside the bounds."""
    rows = []
    for device in DEVICES.values():
        plants = [PlantSimulator(device, dip_event(), step=step / 1e3) for step in (FINE, *STEPS)]
        theta = latin_hypercube(device.candidates, 32, 0)
        theta[0] = device.candidates.nominal
        exact, *others = (plant.simulate(theta).require_ok(device.name) for plant in plants)
        for r, channel in enumerate(exact.channels):
            errors = [y.values[:, r] - exact.values[:, r] for y in others]
            rms = [np.sqrt(np.mean(e**2, axis=-1)).max() for e in errors]
            cells = (f"{np.abs(e).max():.1e} ({s:.1e})" for e, s in zip(errors, rms, strict=True))
            rows.append((f"`{device.name}`", channel, *cells))
    return table(("device", "channel", *(f"{step:g} ms" for step in STEPS)), rows)


def case_effects():
    """Rms change of each channel of the 39-bus case for each parameter at 1.1 times nominal."""
    system = load_ieee39()
    nominal = system.parameters.nominal
    values = system.simulate(np.vstack([nominal, nominal + np.diag(0.1 * nominal)])).require_ok().values
    rms = np.sqrt(np.mean((values[1:] - values[0]) ** 2, axis=-1))
    rows = [
        (f"`{p.device}`", f"`{p.name}`", *(f"{1e3 * value:.3f}" for value in line))
        for p, line in zip(system.parameters, rms, strict=True)
    ]
    return table(("device", "parameter", *(f"{name} moves by" for name in system.channels)), rows)


def case_step_errors():
    """Largest and largest rms error of U and P by event, over the nominal parameters and 31 draws."""
    systems = [load_ieee39(step=step / 1e3) for step in CASE_STEPS]
    space = systems[0].parameters
    theta = latin_hypercube(space, 32, 0)
    theta[0] = space.nominal
    rows = []
    for name, event in ieee39_events().items():
        exact, *others = (system.simulate(theta, event).require_ok(name).values for system in systems)
        for r, channel in enumerate(systems[0].channels):
            errors = [y[:, r] - exact[:, r] for y in others]
            rms = [np.sqrt(np.mean(e**2, axis=-1)).max() for e in errors]
            cells = (f"{np.abs(e).max():.1e} ({s:.1e})" for e, s in zip(errors, rms, strict=True))
            rows.append((name, channel, f"{np.ptp(exact[:, r], axis=-1).max():.2g}", *cells))
    header = (f"{step:g} ms" for step in CASE_STEPS[1:])
    return table(("event", "channel", "range", *header), rows)


_BENCHES = ("speed", "paper", "discovery")
#: events of the signatures: those that hidden scenarios are fitted to, and two that make limiters and protection act
_SIDES = (*FIT, GridSide("low for two seconds", 0.6, 2.0), GridSide("high to the end", step=0.12))
#: where the effects of a load act in their figures
LOAD_BUS = 4
#: what effects that belong to no device act on
_OF = {"measurement": "every simulator, for each of its channels", "event": "grids, for a fault"}


def effect_sections():
    """Heading, file of the figure, effect and its devices for each effect of the library, and those of any simulator.

    Effects of one name that differ from device to device have a section each, told apart by the devices.
    """
    devices = {}
    for device, library in LIBRARY.items():
        for effect in library:
            if effect.kind != "latent":
                devices.setdefault(effect, []).append(device)
    outside = *measurement_effects(["P"]), common_skew(), FAULT_DURATION, FAULT_IMPEDANCE, branch_trip((3, 4))
    devices |= {effect: [] for effect in outside}
    sections_of = Counter(effect.name for effect in devices)
    for effect, names in devices.items():
        alone = sections_of[effect.name] == 1
        heading = f"`{effect.name}`" if alone else f"`{effect.name}` of {code_list(names)}"
        file = "-".join(("effect", effect.name, *(() if alone else names))) + ".png"
        yield f"{heading}: {effect.title}", file, effect, names


def effect_text(heading, file, effect, devices):
    """Section of the page of effects."""
    parameters = [parameter_cells(effect.local(p.name), p) for p in effect.parameters]
    return "\n".join(
        [
            f"### {heading}\n",
            f"{effect.description} `{effect.formula}` Acts on `{effect.port}` of "
            f"{code_list(devices) or _OF[effect.kind]}. Easily confused with "
            f"{'; '.join(effect.confused_with)}. Source: {effect.source}.\n",
            table(PARAMETER_HEADER, parameters),
            f"![What {' of '.join((effect.name, *devices[:1]))} changes](../_generated/{file})\n",
        ]
    )


def code_list(names):
    """Names as code, with commas."""
    return ", ".join(f"`{name}`" for name in names)


def effect_table(folder):
    """Effects of the library with the devices they fit, and a figure of what each changes."""
    grid = load_ieee39(loads=[LoadUnderTest(LOAD_BUS)])
    time = np.arange(0, STOP, 1 / RATE)
    events = [Playback(time, side.name, START, side.signals(time), OPERATING_POINT) for side in _SIDES]
    text = []
    for heading, file, effect, devices in effect_sections():
        if effect.kind == "event" or devices == ["load"]:
            figure = plot_signature(grid, f"load_{LOAD_BUS}.{effect.name}" if devices else effect.name)
        else:
            plant = PlantSimulator(next(iter(devices), "synchronous_machine"), events[0])
            figure = plot_signature(plant, effect.name, events)
        figure.savefig(folder / file, dpi=80)
        text.append(effect_text(heading, file, effect, devices))
    return "\n".join(text)


def generic_table():
    """Templates of generic effects."""
    rows = []
    for name, (title, formula, source, description, confused) in TEXTS.items():
        words = {"s": "s", "v": "v", "into": ""}
        others = "; ".join(confused).format(**words)
        rows.append((f"`{name}`", title, f"`{formula}`", description.format(**words), others, source))
    return table(("template", "", "equation", "what it means", "confused with", "source"), rows)


def commands():
    """Help texts of the command line."""
    text = []
    for words in ((), ("demo",), ("run",), ("diagnose",), *(("bench", kind) for kind in _BENCHES)):
        output = io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.suppress(SystemExit):
            main([*words, "--help"])
        text.append(
            f"## `{' '.join(('errorscreen', *words))}`\n\n```text\n{output.getvalue().strip()}\n```\n"
        )
    return "\n".join(text)


def unit_table():
    """Units that the reader knows, by channel."""
    rows = [(f"`{role}`", ", ".join(f"`{unit}`" for unit in units)) for role, units in UNITS.items()]
    return table(("channel", "units"), rows)


def status_table():
    """What can become of a simulation, and what to do about it."""
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
    """Table that a long measurement has left, or the command for it where it has not been run."""
    path = DOCS / "tables" / f"{name}.md"
    return path.read_text(encoding="utf-8") if path.exists() else f"```text\n{command}\n```\n"


def paper_figures():
    """Those figures of the case study that have been drawn."""
    captions = {f"paper-figure{k}.png": caption for k, caption in enumerate(PAPER_FIGURES, start=1)}
    there = [(file, caption) for file, caption in captions.items() if (DOCS / "images" / file).exists()]
    return "\n".join(f"![{caption}](../images/{file})\n\n{caption}.\n" for file, caption in there)
