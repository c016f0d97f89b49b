"""Cases: recordings and models to compare, from a file or ready-made."""

from errorscreen.cases.case_file import Case, case_reference, load_case
from errorscreen.cases.ieee39 import ieee39_events, load_ieee39
from errorscreen.cases.measured_systems import falling_ball, read_falling_ball, read_silverbox, silverbox

__all__ = [
    "Case",
    "case_reference",
    "falling_ball",
    "ieee39_events",
    "load_case",
    "load_ieee39",
    "read_falling_ball",
    "read_silverbox",
    "silverbox",
]
