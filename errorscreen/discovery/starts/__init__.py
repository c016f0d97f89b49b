"""Starts for joint fits."""
