"""errorscreen: find out what a dynamic simulation gets wrong, and why."""

__version__ = "0.1.0"
