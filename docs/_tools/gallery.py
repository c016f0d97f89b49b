"""Checks of the examples, which run once: while the gallery is built."""

import warnings
from pathlib import Path

from sphinx.errors import ExtensionError

EXAMPLES = Path(__file__).parents[2] / "examples"
#: text that the output of each example must hold
SAYS = {
    "plot_quickstart": "Values of the parameters reproduce the recording",
    "plot_grid_search": "overlap of the five largest",
    "plot_ieee39_grid_search": "| mean contribution (blind) |",
    "plot_dyr": "GENROU.H",
    "plot_dyr_renewable": "REPCA1.Ki",
    "plot_own_simulator": "Values of the parameters reproduce the recording",
    "plot_effect": "exciter.K",
    "plot_fmu": "Clock skew of y",
    "plot_own_equations": "Coulomb friction on speed, in the equation of speed",
    "plot_wavelet_image": "(2, 2, 64, 256)",
}
_running = {}


def guard(gallery_conf, name, when):
    """Make warnings errors while an example runs, and refuse files that it leaves behind."""
    if when == "before":
        _running["warnings"] = warnings.catch_warnings()
        _running["warnings"].__enter__()
        warnings.simplefilter("error")
        _running["files"] = set(EXAMPLES.iterdir())
    else:
        _running.pop("warnings").__exit__(None, None, None)
        left = sorted(path.name for path in set(EXAMPLES.iterdir()) - _running.pop("files"))
        if left:
            raise ExtensionError(f"{name} leaves {', '.join(left)} behind")


def check_output(app, error):
    """Refuse a gallery with an example that lacks its expected output."""
    for name, text in SAYS.items():
        page = Path(app.srcdir) / "gallery" / f"{name}.rst"
        if error is None and text not in page.read_text(encoding="utf-8"):
            raise ExtensionError(f"the output of {name}.py does not hold {text!r}")


def setup(app):
    """Check the output when everything is built."""
    app.connect("build-finished", check_output)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
