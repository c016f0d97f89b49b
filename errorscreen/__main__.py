"""``python -m errorscreen``."""

from errorscreen.cli import script

if __name__ == "__main__":
    script()
