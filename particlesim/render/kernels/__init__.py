"""Compiled loops that draw."""
