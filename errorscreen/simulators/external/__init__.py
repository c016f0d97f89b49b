"""Models that run in other programs."""
