"""Compiles the kernels: scalar Python to machine code."""
