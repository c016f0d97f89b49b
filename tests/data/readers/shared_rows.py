"""A dip that all readers read, and damage to files of any format."""

import warnings
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from errorscreen.data import read_recording
from errorscreen.exceptions import InputError

BASES = {"base_mva": 100.0, "base_kv": 20.0, "f_nominal": 50.0}
COLUMNS = {"V": {"column": "V", "unit": "kV"}, "P": {"column": "P", "unit": "MW"}}
TIME = np.arange(100) * 0.02
WOBBLE = 1e-4 * np.sin(9e4 * TIME)
V = 20.0 * np.where(TIME < 0.799, 1.0 + WOBBLE, 0.7 + WOBBLE)
P = 100.0 * np.where(TIME < 0.799, 0.8 + WOBBLE, 0.5 + WOBBLE)

bounded = settings(max_examples=30, deadline=None, suppress_health_check=[*HealthCheck])
damages = st.tuples(
    st.integers(0, 10**6), st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=8)
)


def check(rec):
    assert rec.event_time == pytest.approx(0.8)
    assert rec.initial(["V", "P"]) == pytest.approx({"V": 1.0, "P": 0.8}, abs=1e-3)
    assert np.nanmedian(rec.channel("V").values[-20:]) == pytest.approx(0.7, abs=1e-3)


def survives(path, content, damage, columns=COLUMNS, **options):
    """Only an `InputError` may come out of a damaged file."""
    end, changes = damage
    broken = bytearray(content[: end % (2 * len(content))])
    for at, byte in changes:
        if broken:
            broken[at % len(broken)] = byte
    path.write_bytes(broken)
    with warnings.catch_warnings(), suppress(InputError):
        warnings.simplefilter("ignore")
        read_recording(path, columns, **options, **BASES)
