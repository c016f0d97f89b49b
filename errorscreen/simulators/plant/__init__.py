"""One plant behind a recorded terminal voltage (playback)."""
