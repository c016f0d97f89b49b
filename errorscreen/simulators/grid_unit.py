"""A plant under test in a grid: which device, where, how large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.power import DEVICES, Device


@dataclass(frozen=True)
class Unit:
    """A plant under test at a bus of the grid; it delivers what the load flow finds for the generator there.

    Parameters
    ----------
    bus : int
    device : Device or str
        A device, or its name, that can be connected to a grid.
    rating : float
        Base of the plant's own per unit in MVA.
    constants : mapping of str to float
        Values of the device's constants other than the default ones.

    Examples
    --------
    >>> Unit(37, "dfig_plant", rating=600.0).model.title
    'DFIG wind plant with voltage control, virtual inertia and active-power control'
    """

    bus: int
    device: Device | str
    rating: float
    constants: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"unit at bus {self.bus}"
        if self.model.grid is None:
            raise InputError(f"the device {self.model.name!r} cannot be connected to a grid", where=where)
        check_real(self.rating, "the rating", low=0, above=True, where=where)
        for name in self.constants:
            if name not in self.default_constants:
                raise unknown_name(name, self.default_constants, kind="constant", where=where)

    @property
    def model(self) -> Device:
        """The device itself."""
        if not isinstance(self.device, str):
            return self.device
        if self.device not in DEVICES:
            raise unknown_name(self.device, DEVICES, kind="device", where=f"unit at bus {self.bus}")
        return DEVICES[self.device]

    @property
    def default_constants(self) -> dict[str, float]:
        """Constants of the device and of its connection; the frequency is that of the grid."""
        assert self.model.grid is not None
        constants = (*self.model.constants, *self.model.grid.constants)
        return {c.name: c.value for c in constants if c.name != "f0"}
