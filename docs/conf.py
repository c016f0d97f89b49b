"""Configuration of the documentation."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from _tools import figures

import errorscreen
from errorscreen.engine import kernels

project = "errorscreen"
author = "The errorscreen developers"
copyright = author
version = release = errorscreen.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
    "_tools.gallery",
]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3
myst_substitutions = {
    "lanes": kernels.LANES,
    "few_lanes": kernels.FEW_LANES,
    "small_batch": kernels.SMALL_BATCH,
}
default_role = "py:obj"
add_module_names = False
autodoc_typehints = "none"  # types and shapes stand in the docstrings
autosummary_generate = True
numpydoc_show_class_members = False
templates_path = ["_templates"]
exclude_patterns = ["_build", "_generated", "tables", "sg_execution_times.rst"]

html_static_path = ["_static"]
html_theme = "alabaster"
html_title = f"errorscreen {version}"
html_show_copyright = False
html_theme_options = {
    "description": "Finds the errors of a dynamic simulation, and their causes",
    "page_width": "1280px",
    "body_max_width": "none",
    "fixed_sidebar": True,
}

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "image_scrapers": ("_tools.figures.scrape",),
    "reset_modules": ("_tools.gallery.guard",),
    "reset_modules_order": "both",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 1e6,
}


def escape_bars(app, what, name, obj, options, lines):
    """Let docstrings write absolute values as they are: to reStructuredText a pair of bars is a substitution."""
    lines[:] = [line if ":math:" in line else re.sub(r"\|(\w+)\|", r"\\|\1\\|", line) for line in lines]


def setup(app):
    """Draw the figures of the pages before Sphinx looks for them."""
    figures.write_all(HERE / "_generated")
    app.connect("autodoc-process-docstring", escape_bars)
