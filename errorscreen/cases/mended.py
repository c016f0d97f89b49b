"""Recordings of a case file without their wrong keys, so that their columns are examined in the same round."""

from __future__ import annotations

import difflib
from copy import deepcopy
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from errorscreen.cases.case_models import ColumnSection, RecordingSection
from errorscreen.cases.model_sections import EVENTS

#: numbers that stand for wrong ones: no column is found, and no unit known, because of them
_STAND_INS = {"base_mva": 100.0, "base_kv": 1.0, "f_nominal": 50.0}
#: keys that do not decide how columns are read
_APART = frozenset(
    {
        *_STAND_INS,
        *("name", "event_time", "t_start", "t_end", "shift", "noise", "level", "held", "max_missing"),
        *("on_duplicate", "load_level", "step", *EVENTS),
    }
)
#: keys that tell which column a channel has
_HEADERS = ("column", "real", "imag")
#: rounds: a key may be wrong only without another one
_ROUNDS = 3


def without_wrong_keys(data: Any) -> RecordingSection | None:
    """Section without the keys that are wrong; None where one of them decides how the columns are read.

    Parameters
    ----------
    data : object
        The section as in the file.
    """
    if not isinstance(data, dict):
        return None
    left = deepcopy(data)
    for _ in range(_ROUNDS):
        try:
            section = RecordingSection.model_validate(left)
        except ValidationError as error:
            if not all(_left_out(left, one) for one in error.errors()):
                return None
        else:
            return section if section.columns else None
    return None


def _left_out(data: dict[str, Any], error: ErrorDetails) -> bool:
    """Leave out a wrong key; False where the columns may be read in another way without it."""
    location = [str(part) for part in error["loc"]]
    if not location:  # keys that do not fit together
        for key in ("t_start", "t_end", "event_time", "step"):
            data.pop(key, None)
        return True
    key = location[0]
    if key == "columns" and len(location) > 1 and isinstance(data.get(key), dict):
        _column_left_out(data[key], location[1], location[2] if len(location) > 2 else "")
        return True
    meant = _meant(key, RecordingSection) if error["type"] == "extra_forbidden" else key
    if meant is not None and meant not in _APART:
        return False
    data.pop(key, None)
    if key in _STAND_INS:
        data[key] = _STAND_INS[key]
    return True


def _column_left_out(columns: dict[str, Any], role: str, key: str) -> None:
    """Leave out a wrong key of a channel, or the channel if the key may be that of its header."""
    column = columns.get(role)
    if isinstance(column, dict) and key in column and _meant(key, ColumnSection) not in _HEADERS:
        del column[key]
    else:
        columns.pop(role, None)


def _meant(key: str, section: type[RecordingSection] | type[ColumnSection]) -> str | None:
    """The key that is nearest to one in the file."""
    near = difflib.get_close_matches(key, section.model_fields, n=1, cutoff=0.5)
    return near[0] if near else None
