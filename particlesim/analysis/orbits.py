"""Orbital elements: the ellipse, parabola or hyperbola that a body follows about another one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from particlesim.analysis.shapes import per_particle
from particlesim.errors import UsageError

Floats = npt.NDArray[np.float64]

STRAIGHT = 1e-12
"""Sine of an inclination, or eccentricity, below which a node, or a pericentre, has no direction."""


@dataclass(frozen=True)
class Elements:
    """Osculating elements of n bodies, each [n]; angles in radians, the plane of reference is x y.

    `semi_major_axis` [m] is negative for hyperbolas and infinite for parabolas; `period` [s] is infinite for both. Where
    an orbit lies in the plane of reference its node is on the x axis; where it is a circle its pericentre is at the node.
    """

    semi_major_axis: Floats
    eccentricity: Floats
    inclination: Floats
    ascending_node: Floats
    pericentre: Floats
    true_anomaly: Floats
    period: Floats


def orbital_elements(position: npt.ArrayLike, velocity: npt.ArrayLike, mu: npt.ArrayLike) -> Elements:
    """Elements of bodies from position and velocity relative to the central body.

    position [m], velocity [m/s]: [n, 3] or [3]; mu: G (M + m) [m³/s²], a number or [n]. Raises UsageError for shapes that do
    not fit, numbers that are not finite, a body in the centre, or mu ≤ 0. Source: C. D. Murray, S. F. Dermott, Solar System
    Dynamics, section 2.8.
    """
    x, v = np.atleast_2d(np.asarray(position, float)), np.atleast_2d(np.asarray(velocity, float))
    if x.shape != v.shape or x.ndim != 2 or x.shape[1] != 3:
        raise UsageError(
            f"positions have the shape {x.shape} and velocities {v.shape}", "[n, 3] each is needed"
        )
    strength = per_particle(mu, len(x), "mu")
    if not (strength > 0).all():
        raise UsageError("mu must be above 0", "G times the sum of both masses, in m³/s²")
    if not (known := (np.isfinite(x) & np.isfinite(v)).all(axis=1)).all():
        body = int(np.argmin(known))
        raise UsageError(f"body {body} is at {x[body]} with velocity {v[body]}", "finite numbers are needed")
    r = np.linalg.norm(x, axis=1)
    if not (r > 0).all():
        raise UsageError(
            f"body {int(np.argmin(r))} is in the centre", "positions are relative to the central body"
        )
    h = np.cross(x, v)
    toward = (
        np.cross(v, h) / strength[:, None] - x / r[:, None]
    )  # to the pericentre, as long as the eccentricity
    e = np.linalg.norm(toward, axis=1)
    energy = (v**2).sum(axis=1) / 2 - strength / r
    with np.errstate(divide="ignore"):
        a = np.where(energy == 0, np.inf, -strength / (2 * energy))
    inclination = np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2])
    size = np.linalg.norm(h, axis=1)
    flat = np.hypot(h[:, 0], h[:, 1]) <= STRAIGHT * size
    node = np.where(flat[:, None], [1.0, 0.0, 0.0], np.column_stack((-h[:, 1], h[:, 0], 0 * size)))
    peri = np.where((e <= STRAIGHT)[:, None], node, toward)
    bound = a > 0
    with np.errstate(invalid="ignore"):
        period = np.where(bound & np.isfinite(a), 2 * np.pi * np.sqrt(np.abs(a) ** 3 / strength), np.inf)
    return Elements(
        a,
        e,
        inclination,
        np.arctan2(node[:, 1], node[:, 0]) % (2 * np.pi),
        _angle(node, peri, h),
        _angle(peri, x, h),
        period,
    )


def _angle(a: Floats, b: Floats, normal: Floats) -> Floats:
    """Angle from a to b about a normal, in [0, 2π)."""
    size = np.linalg.norm(normal, axis=1)
    size = np.where(size > 0, size, 1.0)
    sine = (np.cross(a, b) * normal).sum(axis=1) / size
    return np.asarray(np.arctan2(sine, (a * b).sum(axis=1)) % (2 * np.pi))
