"""Standard models by their names in DYR files."""

from errorscreen._runtime.registry import Registry
from errorscreen.models.compensators import COMPENSATORS
from errorscreen.models.exciters import EXCITERS
from errorscreen.models.governors import GOVERNORS
from errorscreen.models.limiters import LIMITERS
from errorscreen.models.machines import MACHINES
from errorscreen.models.part import Part
from errorscreen.models.renewables import CONVERTERS
from errorscreen.models.stabilisers import STABILISERS

#: Parts that a record can name.
PARTS: Registry[Part] = Registry(
    "standard model",
    "errorscreen.parts",
    Part,
    {
        part.name: part
        for part in (*MACHINES, *COMPENSATORS, *EXCITERS, *LIMITERS, *GOVERNORS, *STABILISERS, *CONVERTERS)
    },
)
