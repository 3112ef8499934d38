"""Particles among the bodies for a step, and what has become of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.rigid.bodies import Bodies
from particlesim.engine.rigid.grains import Guests
from particlesim.model.arrays import Floats, Ints


class Visitors(NamedTuple):
    """Particles that may touch bodies: places, velocities and angular momenta [3, n]; 1/m, 0 for those that are held,
    moments of inertia, infinite for those that do not turn, kinds, radii, ids [n]; contact by kind and group of bodies
    [kinds, groups]."""

    x: Floats
    v: Floats
    spin: Floats
    w: Floats
    inertia: Floats
    kind: Ints
    radius: Floats
    id: Ints
    touch: Floats
    restitution: Floats
    static: Floats
    kinetic: Floats


class Left(NamedTuple):
    """Visitors after a step: new velocities and angular velocities, by how much they are to be moved [3, n], and whether
    anything has touched them [n]."""

    v: Floats
    turning: Floats
    shift: Floats
    moved: Ints


def guests_of(visitors: Visitors, bodies: int) -> Guests:
    """The visitors as kernels take them, after so many bodies."""
    n = len(visitors.w)
    tables = (visitors.touch, visitors.restitution, visitors.static, visitors.kinetic)
    scratch = (np.zeros(n), np.zeros((3, n)), np.zeros((3, n)))
    return Guests(bodies, visitors.kind, visitors.radius, visitors.id, *tables, *scratch)


def joined(b: Bodies, visitors: Visitors) -> Bodies:
    """Bodies with visitors after them, all of them copies."""
    n = len(visitors.w)
    turn = np.zeros((4, n))
    turn[0] = 1.0
    return Bodies(
        np.concatenate([b.x, visitors.x], axis=1),
        np.concatenate([b.v, visitors.v], axis=1),
        np.concatenate([b.turn, turn], axis=1),
        np.concatenate([b.spin, visitors.spin], axis=1),
        np.concatenate([b.w, visitors.w]),
        np.concatenate([b.inertia, np.broadcast_to(visitors.inertia, (3, n))], axis=1),
        np.concatenate([b.reach, visitors.radius]),
        np.concatenate([b.group, np.zeros(n, np.int64)]),
        b.pieces,
    )


def left(whole: Bodies, guests: Guests, visitors: Visitors, h: float) -> Left:
    """What has become of visitors in a step of length h."""
    part = slice(guests.first, None)
    v, spin = whole.v[:, part], whole.spin[:, part]
    change = v - visitors.v
    # What has been moved apart, beyond the drift of the second half.
    apart = whole.x[:, part] - guests.at - 0.5 * h * v
    moved = (change != 0).any(axis=0) | (spin != visitors.spin).any(axis=0)
    moved |= np.abs(apart).max(axis=0) > 1e-12 * (1 + np.abs(guests.at).max(axis=0))
    shift = np.where(np.abs(apart) > 1e-12 * (1 + np.abs(guests.at)), apart, 0.0)
    return Left(v, spin / visitors.inertia, shift - 0.5 * h * change + guests.shift, moved)
