"""``python -m errorscreen``."""

from errorscreen.cli import script

script()
