"""Trajectory files: written during a run, read by psim and other tools."""
