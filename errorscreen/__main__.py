"""``python -m errorscreen``."""

import sys

from errorscreen.cli import main

sys.exit(main())
