"""The engine: what advances a scenario in time."""
