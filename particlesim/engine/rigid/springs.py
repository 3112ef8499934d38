"""Springs between points of bodies, or from a point of a body to one of the world or to a particle.

The law is that of springs between particles (`bonds.spring`, `bonds.strut`), for l from the second point to the first; its
force acts at the points, with the torque r × f on bodies.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bonds.spring import Pair
from particlesim.compiler import kernel, outlined
from particlesim.engine.rigid.bodies import WORLD, orientation, place, row
from particlesim.engine.rigid.rotation import cross, matrix, to_world
from particlesim.laws.registry import bond_force, bond_potential


class BodySprings(NamedTuple):
    """Springs of one law: its record; both bodies (the second may be WORLD, or a guest) [m], their points in the frames of
    these (in the world for WORLD) [3, m]; stiffness, damping, rest length [m]; the strain and the pull [N] beyond which they
    break (infinite: never), and when each broke [s], infinity while it holds [m]."""

    law: Any
    first: Any
    second: Any
    point: Any
    other: Any
    k: Any
    c: Any
    rest: Any
    strain: Any
    limit: Any
    broke: Any


def end(b: Any, now: Any, i: Any, point: Any) -> Any:
    """A point of a body: its place, its velocity, and from the centre to it."""
    r = to_world(matrix(orientation(b, i)), point)
    x, m = place(b, i), now[i]
    u = cross((m[3], m[4], m[5]), r)
    return (x[0] + r[0], x[1] + r[1], x[2] + r[2]), (m[0] + u[0], m[1] + u[1], m[2] + u[2]), r


def stretched(springs: Any, b: Any, now: Any, s: Any) -> Any:
    """A spring as its law sees it, and the arms of both ends."""
    x, v, one = end(b, now, springs.first[s], row(springs.point, s))
    y, w, two = row(springs.other, s), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if springs.second[s] != WORLD:
        y, w, two = end(b, now, springs.second[s], row(springs.other, s))
    l = (x[0] - y[0], x[1] - y[1], x[2] - y[2])  # noqa: E741
    u = (v[0] - w[0], v[1] - w[1], v[2] - w[2])
    whole = 1.0 if springs.broke[s] == np.inf else 0.0
    return Pair(*l, *u, whole * springs.k[s], whole * springs.c[s], springs.rest[s]), one, two


@outlined
def pull(springs: Any, b: Any, now: Any, out: Any) -> None:
    """Add the forces and torques of springs to out [n, 6]."""
    for s in range(springs.first.size):
        pair, one, two = stretched(springs, b, now, s)
        f = bond_force(springs.law, pair)
        twist = cross(one, f)
        i, j = springs.first[s], springs.second[s]
        for axis in range(3):
            out[i, axis] += f[0] if axis == 0 else (f[1] if axis == 1 else f[2])
            out[i, 3 + axis] += twist[0] if axis == 0 else (twist[1] if axis == 1 else twist[2])
        if j != WORLD:
            twist = cross(two, f)
            for axis in range(3):
                out[j, axis] -= f[0] if axis == 0 else (f[1] if axis == 1 else f[2])
                out[j, 3 + axis] -= twist[0] if axis == 0 else (twist[1] if axis == 1 else twist[2])


@outlined
def snap(springs: Any, b: Any, now: Any, t: Any, h: Any) -> float:
    """Break springs that are stretched or pulled too far in the middle of a step of length h; returns what they had stored
    at its beginning [J]: they give nothing in this step."""
    lost = 0.0
    for s in range(springs.first.size):
        if springs.broke[s] == np.inf:
            p, _, _ = stretched(springs, b, now, s)
            f = bond_force(springs.law, p)
            length = np.sqrt(p.x * p.x + p.y * p.y + p.z * p.z)
            pulled = -(f[0] * p.x + f[1] * p.y + f[2] * p.z)
            if length - p.rest > springs.strain * p.rest or pulled > springs.limit * length:
                x, y, z = p.x - 0.5 * h * p.vx, p.y - 0.5 * h * p.vy, p.z - 0.5 * h * p.vz
                lost += bond_potential(springs.law, Pair(x, y, z, p.vx, p.vy, p.vz, p.k, p.c, p.rest))
                springs.broke[s] = t
    return lost


@kernel
def stored(springs: Any, b: Any, now: Any) -> float:
    """Potential energy of springs [J]."""
    total = 0.0
    for s in range(springs.first.size):
        pair, _, _ = stretched(springs, b, now, s)
        total += bond_potential(springs.law, pair)
    return total
