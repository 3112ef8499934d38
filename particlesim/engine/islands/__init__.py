"""Islands: what steps together, from its first particles to its frames."""
