"""Implicit steps of islands: linear systems and their solvers."""
