"""errorscreen: find out what a dynamic simulation gets wrong, and why.

The public names are loaded when they are first used, so importing the package takes no time.

Examples
--------
>>> import errorscreen as es
>>> from errorscreen.cases.demo import demo_recordings
>>> rec = demo_recordings(0)[0]
>>> plant = es.Plant("synchronous_machine", rec)
>>> fit = es.calibrate(plant, rec, n_starts=1)
>>> fit.names_[:3]
('Xd', 'Xd1', 'Xq')
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from errorscreen.api import calibrate, find_causes, read
    from errorscreen.cases.case_file import load_case
    from errorscreen.data.recordings import Recording
    from errorscreen.data.units import Column
    from errorscreen.discovery.diagnose import diagnose
    from errorscreen.discovery.finder import CauseFinder
    from errorscreen.exceptions import InputError
    from errorscreen.parameters import Parameter, ParameterSpace
    from errorscreen.simulators.external.callable import CallableSimulator
    from errorscreen.simulators.grid.simulator import PowerSystemSimulator as Grid
    from errorscreen.simulators.ode.simulator import ODESimulator
    from errorscreen.simulators.plant.simulator import PlantSimulator as Plant

__version__ = "0.1.0"
__all__ = [
    "CallableSimulator",
    "CauseFinder",
    "Column",
    "Grid",
    "InputError",
    "ODESimulator",
    "Parameter",
    "ParameterSpace",
    "Plant",
    "Recording",
    "calibrate",
    "diagnose",
    "find_causes",
    "load_case",
    "read",
]
#: module and name of each public object
_SOURCES = {
    "CallableSimulator": ("simulators", "CallableSimulator"),
    "CauseFinder": ("discovery", "CauseFinder"),
    "Column": ("data", "Column"),
    "Grid": ("simulators", "PowerSystemSimulator"),
    "InputError": ("exceptions", "InputError"),
    "ODESimulator": ("simulators", "ODESimulator"),
    "Parameter": ("parameters", "Parameter"),
    "ParameterSpace": ("parameters", "ParameterSpace"),
    "Plant": ("simulators", "PlantSimulator"),
    "Recording": ("data", "Recording"),
    "calibrate": ("api", "calibrate"),
    "diagnose": ("discovery", "diagnose"),
    "find_causes": ("api", "find_causes"),
    "load_case": ("cases", "load_case"),
    "read": ("api", "read"),
}


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562)."""
    if name not in _SOURCES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _SOURCES[name]
    value = globals()[name] = getattr(import_module(f"{__name__}.{module}"), attribute)
    return value


def __dir__() -> list[str]:
    """Names of the module, with those that are not loaded yet."""
    return sorted({*globals(), *__all__})
