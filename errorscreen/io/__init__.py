"""Recordings from files and tables."""

from errorscreen.io.csv_reader import read_csv
from errorscreen.io.frames import from_frame
from errorscreen.io.units import Column

__all__ = ["Column", "from_frame", "read_csv"]
