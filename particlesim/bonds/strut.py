"""Struts: springs that push when they are shorter than their rest length, and do nothing else.

    f on 1 = −k (|l| − L₀) e − c ((v₁ − v₂)·e) e  where |l| < L₀, else 0,   U = ½ k (L₀ − |l|)² there

with l = x₁ − x₂, e = l/|l|. With the sum of two radii as rest length this is elastic contact of two balls. Coincident ends
have no direction and feel nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.bonds.spring import Pair, spring_dv, spring_dx
from particlesim.laws.registry import Matrix, bond_force, bond_force_dv, bond_force_dx, bond_potential, law


class StrutRecord(NamedTuple):
    """A spring that only pushes."""


@law(bond_force, StrutRecord)
def strut_force(f: StrutRecord, b: Pair) -> tuple[float, float, float]:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    inverse = length / square if 0 < length < b.rest else square - square
    along = (b.vx * b.x + b.vy * b.y + b.vz * b.z) * inverse
    s = -(b.k * (length - b.rest) + b.c * along) * inverse
    return s * b.x, s * b.y, s * b.z


@law(bond_force_dx, StrutRecord)
def strut_force_dx(f: StrutRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    presses = 0 < length < b.rest
    inverse = length / square if presses else square - square
    return spring_dx(b, b.k if presses else b.k - b.k, inverse)


@law(bond_force_dv, StrutRecord)
def strut_force_dv(f: StrutRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    return spring_dv(b, length / square if 0 < length < b.rest else square - square)


@law(bond_potential, StrutRecord)
def strut_potential(f: StrutRecord, b: Pair) -> float:
    stretch = min(np.sqrt(b.x * b.x + b.y * b.y + b.z * b.z) - b.rest, 0.0)
    return 0.5 * b.k * stretch * stretch
