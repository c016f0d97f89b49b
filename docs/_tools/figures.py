"""Puts the figures that an example makes into the gallery."""

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def scrape(block, block_vars, gallery_conf):
    """Save the example's `figure` if this block of code made it; figures of errorscreen are not those of pyplot."""
    figure = block_vars["example_globals"].pop("figure", None)
    if not isinstance(figure, Figure):
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=90)
    return figure_rst([path], gallery_conf["src_dir"])
