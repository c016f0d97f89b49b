"""Power system stabilisers, one file a model."""

from errorscreen.models.part import Part
from errorscreen.models.stabilisers.ieeest import IEEEST
from errorscreen.models.stabilisers.pss2 import PSS2A, PSS2B
from errorscreen.models.stabilisers.st2cut import ST2CUT
from errorscreen.models.stabilisers.stab1 import STAB1

STABILISERS: tuple[Part, ...] = (IEEEST, PSS2A, PSS2B, ST2CUT, STAB1)
