"""Three-component arithmetic on plain tuples, for the few numbers of a scenario."""

from __future__ import annotations

import math

Vector3 = tuple[float, float, float]


def square(x: float) -> float:
    """x², infinite where no number holds it: a length beyond all others. (x**2 would raise OverflowError.)"""
    return x * x


def dot(a: Vector3, b: Vector3) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(a: Vector3) -> float:
    """Length, without overflow."""
    return math.hypot(*a)


def unit(a: Vector3) -> Vector3:
    """The unit vector along a. Raises ValueError when a is zero: it has no direction."""
    length = norm(a)
    if not length > 0 or not math.isfinite(length):
        raise ValueError("a direction needs a finite length greater than zero, such as [0, 1, 0]")
    # An axis stays an axis to the last bit.
    return a[0] / length, a[1] / length, a[2] / length


def parallel(a: Vector3, b: Vector3) -> bool:
    """Whether two vectors point along one line, but for rounding."""
    return norm(cross(a, b)) <= 1e-14 * norm(a) * norm(b)


def perpendicular(a: Vector3) -> tuple[Vector3, Vector3]:
    """Two unit vectors that make a right-handed frame (u, v, a) with the unit vector a."""
    axis: Vector3 = (1.0, 0.0, 0.0) if abs(a[0]) < 0.9 else (0.0, 1.0, 0.0)
    u = unit(cross(axis, a))
    return u, cross(a, u)
