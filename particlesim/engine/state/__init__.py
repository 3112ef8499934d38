"""Particles as arrays: columns, births and deaths, particles that are led."""
