"""Set-up that all tests share."""

import os

from hypothesis import HealthCheck, settings

#: a package of somebody else: collected, its entry points would be there for all tests
collect_ignore = ["other_package"]

# before numba is imported: two threads, so that the threaded path runs on any machine
os.environ.setdefault("NUMBA_NUM_THREADS", "2")
os.environ.setdefault("OMP_NUM_THREADS", "1")

# no test depends on the speed of the machine
settings.register_profile(
    "any machine",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.load_profile("any machine")
