"""Models given as ordinary differential equations in Python."""
