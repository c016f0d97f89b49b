"""Section of a case file for the connection of the unit to the recorded point."""

from __future__ import annotations

from pathlib import Path

from pydantic import PrivateAttr, model_validator

from errorscreen.cases.model_sections import DeviceSection
from errorscreen.cases.section import NotNegative, Positive, Section, setting
from errorscreen.exceptions import InputError
from errorscreen.models.raw import read_raw
from errorscreen.simulators.plant.connection import Connection
from errorscreen.simulators.plant.from_raw import RawPlant, plant_in

#: keys for the network of a file, instead of numbers
_OF_FILE = ("raw", "measured")


class PlantSection(Section):
    """Connection of the unit to the recorded point, in pu of the unit's base, or from a RAW file."""

    raw: str | None = setting(
        None, "power flow file of PSS/E with the unit of device.dyr, instead of the numbers below"
    )
    measured: int | str | None = setting(None, "bus in raw where V, P and Q were recorded, by number or name")
    resistance: NotNegative = setting(0.0, "R of transformer, collector and line in series")
    reactance: NotNegative = setting(0.0, "the same, X")
    tap: Positive = setting(1.0, "ratio of the transformer in pu; above 1 the recorded voltage is higher")
    shunt: float = setting(0.0, "susceptance B at the recorded point; a capacitor is positive")
    conductance: float = setting(0.0, "conductance G at the recorded point")
    auxiliary_p: float = setting(0.0, "active power of a load that is supplied before the recorded point")
    auxiliary_q: float = setting(0.0, "the same, reactive power")
    _found: RawPlant | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _one_source(self) -> PlantSection:
        if (self.raw is None) != (self.measured is None):
            given, missing = _OF_FILE if self.measured is None else _OF_FILE[::-1]
            raise InputError(f"{given} is given without {missing}", allowed="both, or none of them")
        if self.raw is not None and (others := sorted(self.model_fields_set - {*_OF_FILE})):
            raise InputError(
                f"raw and {others[0]} are both given",
                allowed="the RAW file, or the numbers",
                remedy="Leave one out",
            )
        return self

    def in_network(self, folder: Path, device: DeviceSection) -> RawPlant | None:
        """Unit in the RAW file, relative to a folder and read once; None where the numbers are given.

        `InputError` if the file cannot be used, or equal units in it have other models in the DYR file.
        """
        if self.raw is None or self.measured is None or self._found is not None:
            return self._found
        file = device.file(folder)
        if file is None:
            raise InputError(
                "raw is given, but the unit has no model file",
                where="plant",
                allowed="raw with device.dyr, whose bus and identifier say which generator it is",
                remedy="Give device.dyr, or state resistance and reactance in [plant]",
            )
        bus, id = file.key(device.bus, device.id)
        found = plant_in(read_raw(folder / self.raw), bus, id, self.measured)
        for other in found.units[1:]:
            if (bus, other) not in file.units:
                continue  # a file with one of several equal units
            one, two = (file.unit(bus, name, leave_out=device.leave_out) for name in (id, other))
            if (one.candidates, one.constants) != (two.candidates, two.constants):
                raise InputError(
                    f"units {id!r} and {other!r} at bus {bus} are equal in {self.raw}, but not in {device.dyr}",
                    where="plant.raw",
                    allowed="equal units, which count as one",
                    remedy="Correct one of the files, or state the connection of the recorded unit in [plant]",
                )
        self._found = found
        return found

    @property
    def connection(self) -> Connection:
        """The connection of the numbers."""
        return Connection(**self.model_dump(exclude={*_OF_FILE}))
