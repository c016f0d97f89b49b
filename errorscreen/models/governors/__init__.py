"""Turbines with their governors, one file a model."""

from errorscreen.models.governors.gast import GAST
from errorscreen.models.governors.ggov1 import GGOV1
from errorscreen.models.governors.hygov import HYGOV
from errorscreen.models.governors.ieeeg1 import IEEEG1
from errorscreen.models.governors.ieesgo import IEESGO
from errorscreen.models.governors.tgov1 import TGOV1

GOVERNORS = (TGOV1, HYGOV, IEEEG1, GGOV1, GAST, IEESGO)
