"""Recordings, from files and tables to what a simulator compares with."""

from errorscreen.data.frames import from_frame
from errorscreen.data.observations import Observation
from errorscreen.data.readers import READERS, read_recording
from errorscreen.data.readers.csv import read_csv
from errorscreen.data.recordings import Recording
from errorscreen.data.units import Column

__all__ = ["READERS", "Column", "Observation", "Recording", "from_frame", "read_csv", "read_recording"]
