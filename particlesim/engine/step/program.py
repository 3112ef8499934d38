"""The program of an island: the records that its kernels are compiled for, and the size of the blocks that they step."""

from __future__ import annotations

from typing import Any, NamedTuple

BLOCK = 256
"""Particles in a block: 7 columns of 2 KiB and what a step remembers stay in a 32 KiB cache; more share evenly."""


class Program(NamedTuple):
    """The program for which kernels are compiled: method, dynamics, forces and contacts, as records."""

    method: tuple[Any, ...]
    dynamics: tuple[Any, ...]
    forces: tuple[Any, ...]
    contacts: tuple[Any, ...]
