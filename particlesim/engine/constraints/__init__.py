"""Rods: lengths held exactly, as constraints."""
