"""Trajectory files: written while a run goes on, read by everyone."""
