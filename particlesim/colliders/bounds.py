"""The edge of the world: a box outside of which particles die. It has no surface, and nobody is put back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from particlesim.colliders.response import ColliderRecord, ResponseRecord
from particlesim.laws.registry import LEAVE, PASS, Particle, contact, gap, law


class BoundsRecord(NamedTuple):
    """Corners of the box [m]."""

    x0: float
    y0: float
    z0: float
    x1: float
    y1: float
    z1: float


@law(gap, BoundsRecord)
def bounds_gap(c: BoundsRecord, p: Particle) -> float:
    return min(p.x - c.x0, p.y - c.y0, p.z - c.z0, c.x1 - p.x, c.y1 - p.y, c.z1 - p.z)


@law(contact, BoundsRecord)
def bounds_contact(c: BoundsRecord, p: Particle) -> tuple[Particle, int]:
    inside = (p.x >= c.x0) & (p.y >= c.y0) & (p.z >= c.z0) & (p.x <= c.x1) & (p.y <= c.y1) & (p.z <= c.z1)
    return p, PASS if inside else LEAVE


def edge(low: Sequence[float], high: Sequence[float]) -> ColliderRecord:
    """The bounds between two corners [m], as kernels take colliders."""
    return ColliderRecord(BoundsRecord(*low, *high), ResponseRecord(0.0, 0.0, 1.0, LEAVE))
