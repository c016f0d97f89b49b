"""Labelled datasets of response errors, and the network that learns from them."""
