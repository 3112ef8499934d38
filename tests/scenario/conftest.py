"""Hypothesis keeps no database here: a test run leaves the working directory as it was."""

from hypothesis import settings

settings.register_profile("psim", database=None, deadline=None, max_examples=60, derandomize=True)
settings.load_profile("psim")
