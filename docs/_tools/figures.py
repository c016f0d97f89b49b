"""Figures of the documentation: of the examples for the gallery, and of single pages."""

import numpy as np
from _tools.pages import effect_sections
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from errorscreen.bench.plant_scenarios import FIT, OPERATING_POINT, RATE, START, STOP, GridSide
from errorscreen.cases import load_ieee39
from errorscreen.cases.ieee39_data import POSITIONS
from errorscreen.events import Playback
from errorscreen.models import DEVICES
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.plotting import plot_signature, plot_system
from errorscreen.simulators import LoadUnderTest, PlantSimulator

#: events of the signatures: those of the study's scenarios, and two that bring limiters and protection into action
_SIDES = (*FIT, GridSide("low for two seconds", 0.6, 2.0), GridSide("high to the end", step=0.12))
#: bus of the load whose effects are drawn
_LOAD_BUS = 4
#: standard models of units, of which the first that has an effect shows it
_UNITS = (
    ("GENROU", "SEXS", "TGOV1"),
    ("GENROU", "SEXS", "TGOV1", "STAB1"),
    ("GENROU", "SEXS", "MNLEX2"),
    ("GENSAL", "SEXS", "HYGOV"),
    ("GENROU",),
    ("REGCA1", "REECA1", "REPCA1"),
    ("REGCA1",),
)


def write_all(folder):
    """Draw the 39-bus system, and the changes by each effect of the library."""
    folder.mkdir(exist_ok=True)
    plot_system(load_ieee39(), positions=POSITIONS).savefig(folder / "ieee39_system.png", dpi=150)
    grid = load_ieee39(loads=[LoadUnderTest(_LOAD_BUS)])
    time = np.arange(0, STOP, 1 / RATE)
    events = [Playback(time, side.name, START, side.signals(time), OPERATING_POINT) for side in _SIDES]
    for _, file, effect, devices in effect_sections():
        if effect.kind == "event" or devices == ("load",):
            figure = plot_signature(grid, f"load_{_LOAD_BUS}.{effect.name}" if devices else effect.name)
        else:
            plant = PlantSimulator(shown_on(devices), events[0])
            figure = plot_signature(plant, effect.name, events)
        figure.savefig(folder / file, dpi=80)


def shown_on(devices):
    """Device that shows an effect: the first that has it, or a unit of standard models."""
    name = next(iter(devices), "synchronous_machine")
    if name in DEVICES:
        return name
    linear = unit([Record(PARTS["GENROU"], {"S10": 0.0, "S12": 0.0})])
    units = (unit([Record(PARTS[model], {}) for model in models]) for models in _UNITS)
    return next(one for one in (*units, linear) if name in one.tags)


def scrape(block, block_vars, gallery_conf):
    """Save the example's `figure` if this block of code made it; figures of errorscreen are not those of pyplot."""
    figure = block_vars["example_globals"].pop("figure", None)
    if not isinstance(figure, Figure):
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=90)
    return figure_rst([path], gallery_conf["src_dir"])
