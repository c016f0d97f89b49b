"""Threads, processes, files and random numbers that all rooms share."""
