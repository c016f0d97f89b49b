"""A power system with plants and loads under test."""
