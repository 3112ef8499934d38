"""What colliders say of a point of a body: gap and normal there."""

from __future__ import annotations

from typing import Any

from particlesim.laws.registry import Particle, normal
from particlesim.model.attributes import FURTHER


def probe(p: Any, radius: Any, t: Any) -> Any:
    """A point with a radius, as colliders see particles."""
    zero = 0.0
    return Particle(p[0], p[1], p[2], zero, zero, zero, 1.0, radius, zero, t, 1.0, *[zero for _ in FURTHER])


def away(shape: Any, p: Any) -> Any:
    """The normal of a collider; a component that is always zero may be None."""
    n = normal(shape, p)
    return (
        0.0 if n[0] is None else n[0],
        0.0 if n[1] is None else n[1],
        0.0 if n[2] is None else n[2],
    )
