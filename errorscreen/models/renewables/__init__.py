"""Plants behind converters: standard models, one family a file, and two devices of their own."""

from errorscreen.models.part import Part
from errorscreen.models.renewables.der_a import DERA1
from errorscreen.models.renewables.reec import REECA1, REECB1
from errorscreen.models.renewables.reec_d import REECD1
from errorscreen.models.renewables.regc_a import REGCA1
from errorscreen.models.renewables.regc_b import REGCB1
from errorscreen.models.renewables.regfm_a import REGFMA1
from errorscreen.models.renewables.repc_a import REPCA1
from errorscreen.models.renewables.wind_turbine import WTARA1, WTDTA1, WTPTA1, WTTQA1

CONVERTERS: tuple[Part, ...] = (
    REGCA1, REGCB1, REECA1, REECB1, REECD1, REPCA1, WTDTA1, WTARA1, WTPTA1, WTTQA1, DERA1, REGFMA1,
)  # fmt: skip
