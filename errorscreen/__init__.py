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
    from errorscreen.models.dyr import read_dyr
    from errorscreen.models.raw import read_raw
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
    "read_dyr",
    "read_raw",
]
#: modules of the public names, and names that are shorter here
_MODULES = {
    "api": ("calibrate", "find_causes", "read"),
    "cases": ("load_case",),
    "data": ("Column", "Recording"),
    "discovery": ("CauseFinder", "diagnose"),
    "exceptions": ("InputError",),
    "models.dyr": ("read_dyr",),
    "models.raw": ("read_raw",),
    "parameters": ("Parameter", "ParameterSpace"),
    "simulators": ("CallableSimulator", "Grid", "ODESimulator", "Plant"),
}
_LONG_NAMES = {"Grid": "PowerSystemSimulator", "Plant": "PlantSimulator"}


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562)."""
    for module, names in _MODULES.items():
        if name in names:
            from importlib import import_module

            found = import_module(f"{__name__}.{module}")
            value = globals()[name] = getattr(found, _LONG_NAMES.get(name, name))
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Names of the module, with those that are not loaded yet."""
    return sorted({*globals(), *__all__})
