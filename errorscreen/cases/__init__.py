"""Cases: what to compare with what, from a file or ready-made."""

from errorscreen.cases.case_file import Case, case_reference, load_case

__all__ = ["Case", "case_reference", "load_case"]
