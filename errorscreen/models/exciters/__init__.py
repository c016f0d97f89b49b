"""Excitation systems, one file a model."""

from errorscreen.models.exciters.ac1 import ESAC1A, EXAC1
from errorscreen.models.exciters.ac8b import AC8B
from errorscreen.models.exciters.esac6a import ESAC6A
from errorscreen.models.exciters.esdc import ESDC1A, ESDC2A
from errorscreen.models.exciters.esst1a import ESST1A
from errorscreen.models.exciters.esst4b import ESST4B
from errorscreen.models.exciters.exac2 import EXAC2
from errorscreen.models.exciters.expic1 import EXPIC1
from errorscreen.models.exciters.exst1 import EXST1
from errorscreen.models.exciters.ieeet1 import IEEET1
from errorscreen.models.exciters.rexsys import REXSYS
from errorscreen.models.exciters.scrx import SCRX
from errorscreen.models.exciters.sexs import SEXS
from errorscreen.models.exciters.st5b import ST5B

EXCITERS = (
    SEXS,
    SCRX,
    IEEET1,
    ESST1A,
    ESST4B,
    EXST1,
    ESDC1A,
    ESDC2A,
    ST5B,
    EXPIC1,
    EXAC1,
    ESAC1A,
    EXAC2,
    ESAC6A,
    AC8B,
    REXSYS,
)
