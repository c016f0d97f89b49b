"""Loads under test."""
