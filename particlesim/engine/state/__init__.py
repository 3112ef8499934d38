"""Particles as arrays: columns, births and deaths, particles on prescribed paths."""
