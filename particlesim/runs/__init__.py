"""A run from its start to its end: the loop, frames, checkpoints, checks, results."""
