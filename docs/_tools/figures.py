"""Figures of the documentation: those that an example makes go into the gallery, others are drawn for their page."""

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from errorscreen.cases import load_ieee39
from errorscreen.cases.ieee39_data import POSITIONS
from errorscreen.plotting import plot_system


def write_all(folder):
    """Draw every figure that stands on a page."""
    plot_system(load_ieee39(), positions=POSITIONS).savefig(folder / "ieee39_system.png", dpi=150)


def scrape(block, block_vars, gallery_conf):
    """Save the example's `figure` if this block of code made it; figures of errorscreen are not those of pyplot."""
    figure = block_vars["example_globals"].pop("figure", None)
    if not isinstance(figure, Figure):
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=90)
    return figure_rst([path], gallery_conf["src_dir"])
