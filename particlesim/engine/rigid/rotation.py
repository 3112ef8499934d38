"""Rotation of rigid bodies: orientations as unit quaternions, and the motion of a body that rotates freely.

An orientation q = (w, x, y, z) takes vectors from the frame of a body, whose axes are its principal ones, to that of the
world: a ↦ q a q*. The state has the angular momentum L in the world, which only torques change, so that free bodies conserve
it exactly. Their rotation is split into rotations about the three principal axes, each of which is exact,

    Φ₁(h/2) Φ₂(h/2) Φ₃(h) Φ₂(h/2) Φ₁(h/2),   Φ_k(h): a rotation by h L_k/I_k about axis k,

of second order, symplectic and reversible: the energy oscillates within bounds and does not drift.

Source: A. Dullweber, B. Leimkuhler, R. McLachlan, J. Chem. Phys. 107, 5840 (1997).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.model.quaternions import times


def normalised(q: Any) -> Any:
    """The unit quaternion of this direction."""
    k = 1 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * k, q[1] * k, q[2] * k, q[3] * k


def matrix(q: Any) -> Any:
    """The rotation matrix of a unit quaternion, row by row."""
    w, x, y, z = q
    return (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )


def to_world(r: Any, a: Any) -> Any:
    """A vector of the body's frame in the world; r is the rotation matrix."""
    return (
        r[0] * a[0] + r[1] * a[1] + r[2] * a[2],
        r[3] * a[0] + r[4] * a[1] + r[5] * a[2],
        r[6] * a[0] + r[7] * a[1] + r[8] * a[2],
    )


def to_body(r: Any, a: Any) -> Any:
    """A vector of the world in the body's frame."""
    return (
        r[0] * a[0] + r[3] * a[1] + r[6] * a[2],
        r[1] * a[0] + r[4] * a[1] + r[7] * a[2],
        r[2] * a[0] + r[5] * a[1] + r[8] * a[2],
    )


def cross(a: Any, b: Any) -> Any:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def dot(a: Any, b: Any) -> Any:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def rotated(a: Any, w: Any, t: Any) -> Any:
    """A vector that has rotated with an angular velocity w for a time t, which may be negative (Rodrigues)."""
    rate = np.sqrt(dot(w, w))
    if rate * t == 0:
        return a
    k, c, s = (w[0] / rate, w[1] / rate, w[2] / rate), np.cos(rate * t), np.sin(rate * t)
    across, along = cross(k, a), (1 - c) * dot(k, a)
    return (
        c * a[0] + s * across[0] + along * k[0],
        c * a[1] + s * across[1] + along * k[1],
        c * a[2] + s * across[2] + along * k[2],
    )


def angular_velocity(q: Any, spin: Any, inertia: Any) -> Any:
    """ω = R I⁻¹ Rᵀ L [1/s] of a body with angular momentum `spin` and principal moments `inertia`."""
    r = matrix(q)
    a = to_body(r, spin)
    return to_world(r, (a[0] / inertia[0], a[1] / inertia[1], a[2] / inertia[2]))


@outlined
def world_inverse(q: Any, inertia: Any, inverse: Any) -> None:
    """The inverse of the inertia in the world: R I⁻¹ Rᵀ as xx, yy, zz, xy, xz, yz."""
    r = matrix(q)
    a, c, d = 1 / inertia[0], 1 / inertia[1], 1 / inertia[2]
    inverse[0] = r[0] * r[0] * a + r[1] * r[1] * c + r[2] * r[2] * d
    inverse[1] = r[3] * r[3] * a + r[4] * r[4] * c + r[5] * r[5] * d
    inverse[2] = r[6] * r[6] * a + r[7] * r[7] * c + r[8] * r[8] * d
    inverse[3] = r[0] * r[3] * a + r[1] * r[4] * c + r[2] * r[5] * d
    inverse[4] = r[0] * r[6] * a + r[1] * r[7] * c + r[2] * r[8] * d
    inverse[5] = r[3] * r[6] * a + r[4] * r[7] * c + r[5] * r[8] * d


def turned_by(m: Any, a: Any) -> Any:
    """A symmetric matrix times a vector."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[3] * a[0] + m[1] * a[1] + m[5] * a[2],
        m[4] * a[0] + m[5] * a[1] + m[2] * a[2],
    )


def turned_freely(q: Any, spin: Any, inertia: Any, h: Any) -> Any:
    """The orientation after a time h without torque."""
    own = to_body(matrix(q), spin)
    half = 0.5 * h
    q, own = _about_x(q, own, half / inertia[0])
    q, own = _about_y(q, own, half / inertia[1])
    q, own = _about_z(q, own, h / inertia[2])
    q, own = _about_y(q, own, half / inertia[1])
    q, own = _about_x(q, own, half / inertia[0])
    return normalised(q)


# A turn by the angle φ about an axis of the body takes its orientation to q (cos φ/2, n sin φ/2), and turns the angular
# momentum, as the body sees it, backwards.


def _about_x(q: Any, a: Any, k: Any) -> Any:
    angle = k * a[0]
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    cc, ss = c * c - s * s, 2 * c * s
    return times(q, (c, s, 0.0, 0.0)), (a[0], cc * a[1] + ss * a[2], cc * a[2] - ss * a[1])


def _about_y(q: Any, a: Any, k: Any) -> Any:
    angle = k * a[1]
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    cc, ss = c * c - s * s, 2 * c * s
    return times(q, (c, 0.0, s, 0.0)), (cc * a[0] - ss * a[2], a[1], cc * a[2] + ss * a[0])


def _about_z(q: Any, a: Any, k: Any) -> Any:
    angle = k * a[2]
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    cc, ss = c * c - s * s, 2 * c * s
    return times(q, (c, 0.0, 0.0, s)), (cc * a[0] + ss * a[1], cc * a[1] - ss * a[0], a[2])
