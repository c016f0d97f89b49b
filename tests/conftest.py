"""Set-up that all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

#: a package of somebody else: collected, its entry points would be there for all tests
collect_ignore = ["other_package"]

# before numba is imported: two threads, so that the threaded path runs on any machine
os.environ.setdefault("NUMBA_NUM_THREADS", "2")
os.environ.setdefault("OMP_NUM_THREADS", "1")

# no test depends on the speed of the machine or on chance; --hypothesis-profile=explore draws other examples each time
_SLOW = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}
settings.register_profile("explore", **_SLOW)
settings.register_profile("any machine", derandomize=True, **_SLOW)
settings.load_profile("any machine")


@pytest.fixture
def undrawn_figures(monkeypatch):
    """Save figures as empty pictures: to draw those of a report takes three quarters of a small run.

    They are made all the same. For tests of a whole run that are not about pictures; `test_cli` draws those of one run,
    `tests/plotting` and `tests/workflow/test_figures.py` each kind.
    """
    from matplotlib.figure import Figure

    def savefig(self, target, **options):
        picture = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
        if hasattr(target, "write"):
            target.write(picture)
        elif isinstance(target, str | Path):  # else the pages of a PDF
            Path(target).write_bytes(picture)

    monkeypatch.setattr(Figure, "savefig", savefig)
