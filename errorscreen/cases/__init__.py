"""Cases: what to compare with what, from a file or ready-made."""

from errorscreen.cases.case_file import Case, case_reference, load_case
from errorscreen.cases.ieee39 import ieee39_events, load_ieee39

__all__ = ["Case", "case_reference", "ieee39_events", "load_case", "load_ieee39"]
