"""Where an unknown input enters, and its waveform."""
