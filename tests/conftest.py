"""Set-up that all tests share."""

import os

# before numba is imported: two threads, so that the threaded path runs on any machine
os.environ.setdefault("NUMBA_NUM_THREADS", "2")
os.environ.setdefault("OMP_NUM_THREADS", "1")
