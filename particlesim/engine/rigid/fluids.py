"""What fluids do to the surface of rigid bodies, triangle by triangle.

Buoyancy at a surface of the fluid is its pressure p = ρ |g| d at the depth d on what is wetted: the sums of −∫ p n dA and
−∫ p r × n dA over triangles, cut at the surface of the fluid, are exact. As p is 0 there, it needs no lid. With e upwards
the potential is U = ρ |g| ∫ d dV = −½ ρ |g| ∮ d² e·n dA (theorem of Gauss).

Drag is −½ ρ c_d |u| u per area across the flow, with u the velocity of a triangle relative to the fluid: A n·u/|u| for a
triangle that faces the flow, n·u > 0, and 0 for others. So the drag on a convex body that does not rotate is that of its
frontal area in any orientation, and a body that rotates is slowed down.

Source: L. D. Landau, E. M. Lifshitz, Fluid Mechanics, §§ 2 and 45.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.base import BodyShape
from particlesim.bodies.shape import BallBody
from particlesim.colliders.triangulation import Triangles
from particlesim.compiler import on_stack, outlined
from particlesim.engine.rigid.narrow import minus, plus
from particlesim.engine.rigid.rotation import cross, dot, to_world
from particlesim.forces.buoyancy import FloatingSphereRecord
from particlesim.forces.drag import DragRecord, relative
from particlesim.forces.drag_laws import Sphere, density, drag_speed
from particlesim.laws.registry import force, moved_to, potential


class Wetted(NamedTuple):
    """Pressure below a surface: upwards, its height [m], ρ |g| [N/m³], and the corners of the triangles of a body [9, t]."""

    up: tuple[float, float, float]
    height: float
    weight: float
    skin: Any


class Swept(NamedTuple):
    """Drag on a surface: its law, and the corners of the triangles of a body [9, t]."""

    law: Any
    skin: Any


class Whole(NamedTuple):
    """A law that acts on the body as a whole, at its centre."""

    law: Any


def through_surface(record: Any, shape: BodyShape) -> Any:
    """How a force acts on bodies of a shape, if not on points that have their mass: a record for `act`; None else."""
    if isinstance(record, FloatingSphereRecord):
        if isinstance(shape, BallBody):
            return Whole(record)
        up = (record.ux, record.uy, record.uz)
        return Wetted(up, record.surface, record.k / np.pi, corners_of(shape.skin()))
    if isinstance(record, DragRecord) and isinstance(record.area, Sphere) and not isinstance(shape, BallBody):
        return Swept(record, corners_of(shape.skin()))
    return None


def corners_of(surface: Triangles) -> Any:
    """The corners of all triangles [9, t]."""
    return np.ascontiguousarray(surface.corners[surface.faces].reshape(-1, 9).T)


@outlined
def act(each: Any, p: Any, r: Any, turning: Any, out: Any) -> None:
    """Add the force and the torque of a law to out [1, 6]; p is the body's centre as laws see particles."""
    if isinstance(each, Whole):
        f = force(each.law, p)
        out[0, 0] += f[0]
        out[0, 1] += f[1]
        out[0, 2] += f[2]
    elif isinstance(each, Wetted):
        press(each, p, r, out)
    else:
        sweep(each, p, r, turning, out)


def stored(each: Any, p: Any, r: Any) -> Any:
    """Potential energy of a law [J]; 0 if it has none."""
    if isinstance(each, Whole):
        return potential(each.law, p)
    if isinstance(each, Wetted):
        out = on_stack(1, 6, np.float64)
        return press(each, p, r, out)
    return 0.0


def corner(skin: Any, k: Any, number: Any, r: Any) -> Any:
    """From the centre of a body to a corner of a triangle."""
    return to_world(r, (skin[3 * number, k], skin[3 * number + 1, k], skin[3 * number + 2, k]))


@outlined
def press(each: Any, p: Any, r: Any, out: Any) -> float:
    """Add force and torque of the pressure to out; returns its potential energy."""
    room = each.height - dot(each.up, (p.x, p.y, p.z))
    energy = 0.0
    for k in range(each.skin.shape[1]):
        a, b, c = corner(each.skin, k, 0, r), corner(each.skin, k, 1, r), corner(each.skin, k, 2, r)
        i, j, m = room - dot(each.up, a), room - dot(each.up, b), room - dot(each.up, c)
        wet = (1 if i > 0 else 0) + (1 if j > 0 else 0) + (1 if m > 0 else 0)
        if wet == 3:
            energy += triangle(each, a, b, c, i, j, m, out)
        elif wet > 0:
            # The corner that differs from both others comes first.
            odd = (i > 0) == (wet == 1)
            if not odd:
                a, b, c, i, j, m = b, c, a, j, m, i
                odd = (i > 0) == (wet == 1)
            if not odd:
                a, b, c, i, j, m = b, c, a, j, m, i
            d, e = plus(a, i / (i - j), minus(b, a)), plus(a, i / (i - m), minus(c, a))
            if wet == 1:
                energy += triangle(each, a, d, e, i, 0.0, 0.0, out)
            else:
                energy += triangle(each, d, b, c, 0.0, j, m, out)
                energy += triangle(each, d, c, e, 0.0, m, 0.0, out)
    return float(energy)


def triangle(each: Any, a: Any, b: Any, c: Any, i: Any, j: Any, m: Any, out: Any) -> Any:
    """Force and torque of the pressure on a triangle below the surface, by the depths of its corners; its energy."""
    n = cross(minus(b, a), minus(c, a))
    n = (0.5 * n[0], 0.5 * n[1], 0.5 * n[2])
    total = i + j + m
    push = -each.weight * total / 3
    # ∫ d r dA = A/12 (Σ d Σ r + Σ d r)
    s = (
        total * (a[0] + b[0] + c[0]) + i * a[0] + j * b[0] + m * c[0],
        total * (a[1] + b[1] + c[1]) + i * a[1] + j * b[1] + m * c[1],
        total * (a[2] + b[2] + c[2]) + i * a[2] + j * b[2] + m * c[2],
    )
    twist, lever = cross(s, n), -each.weight / 12
    for axis in range(3):
        part = n[0] if axis == 0 else (n[1] if axis == 1 else n[2])
        turn = twist[0] if axis == 0 else (twist[1] if axis == 1 else twist[2])
        out[0, axis] += push * part
        out[0, 3 + axis] += lever * turn
    return -each.weight / 24 * dot(each.up, n) * (total * total + i * i + j * j + m * m)


@outlined
def sweep(each: Any, p: Any, r: Any, turning: Any, out: Any) -> None:
    """Add force and torque of drag to out."""
    for k in range(each.skin.shape[1]):
        a, b, c = corner(each.skin, k, 0, r), corner(each.skin, k, 1, r), corner(each.skin, k, 2, r)
        n = cross(minus(b, a), minus(c, a))
        arm = ((a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3)
        w = cross(turning, arm)
        at = moved_to(p, p.x + arm[0], p.y + arm[1], p.z + arm[2], p.vx + w[0], p.vy + w[1], p.vz + w[2], p.t)
        q = relative(each.law.flow, at)
        u = (q.vx, q.vy, q.vz)
        into = 0.5 * dot(n, u)
        if into > 0:
            area = into / np.sqrt(dot(u, u))
            s = -each.law.half * density(each.law.density, at) * area * drag_speed(each.law.coefficient, q)
            f = (s * u[0], s * u[1], s * u[2])
            g = cross(arm, f)
            for axis in range(3):
                out[0, axis] += f[0] if axis == 0 else (f[1] if axis == 1 else f[2])
                out[0, 3 + axis] += g[0] if axis == 0 else (g[1] if axis == 1 else g[2])
