"""Particles that have stuck to colliders which move: they keep their place in the frame of theirs.

The step in which a particle sticks ends with its place at the moment of contact (`columns.note`). From both follow the
collider, the one whose surface is next to it, and the place in its frame, once and for all. Where the particle is at any
time, and how fast, follows from that alone, so that it does not depend on how a run is cut into intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, alight, ride
from particlesim.compiler import kernel
from particlesim.laws.registry import Particle, gap
from particlesim.model.arrays import Floats

NONE, ASHORE = 0, -1
"""Instead of the number of a collider, counted from 1: the particle has not stuck, or has to one at rest."""


class Holder(NamedTuple):
    """A collider that particles stick to, as kernels take it."""

    shape: Any


@kernel
def _distances(shape: Any, x: Any, radius: Any, times: Any, out: Any) -> None:
    """How far particles at x [3, n] were from touching a shape at times of their own."""
    for i in range(out.size):
        zero = x[0, i] - x[0, i]
        p = Particle(x[0, i], x[1, i], x[2, i], zero, zero, zero, zero, radius[i], zero, times[i], zero)
        out[i] = abs(gap(shape, p))


@kernel
def _take_hold(shape: Any, x: Any, times: Any, out: Any) -> None:
    """Places x [3, n] at times of their own in the frame of a collider."""
    for i in range(times.size):
        zero = x[0, i] - x[0, i]
        p = Particle(x[0, i], x[1, i], x[2, i], zero, zero, zero, zero, zero, zero, times[i], zero)
        q = ride(shape, p)
        out[0, i], out[1, i], out[2, i] = q.x, q.y, q.z


@kernel
def _take_along(shape: Any, place: Any, t: Any, x: Any, v: Any) -> None:
    """Where places in the frame of a collider [3, n] are at a time, and how fast they move there."""
    for i in range(place.shape[1]):
        zero = place[0, i] - place[0, i]
        p = Particle(place[0, i], place[1, i], place[2, i], zero, zero, zero, zero, zero, zero, t, zero)
        q = alight(shape, p)
        x[0, i], x[1, i], x[2, i] = q.x, q.y, q.z
        v[0, i], v[1, i], v[2, i] = q.vx, q.vy, q.vz


def catch(holders: Sequence[Holder], x: Floats, radius: Floats, times: Floats) -> Floats:
    """For particles at x [3, n] that have stuck at some times [s] [n]: the number of the collider, and the place in its
    frame [m], shape [4, n]."""
    n = times.size
    apart = np.empty((len(holders), n))
    for each, row in zip(holders, apart, strict=True):
        _distances(each.shape, x, radius, times, row)
    nearest, found = apart.argmin(axis=0), np.full((4, n), float(ASHORE))
    for k, each in enumerate(holders):
        mine = np.flatnonzero(nearest == k)
        if mine.size and isinstance(each.shape, MovingRecord):
            place = np.empty((3, mine.size))
            _take_hold(each.shape, np.ascontiguousarray(x[:, mine]), times[mine], place)
            found[0, mine], found[1:, mine] = k + 1, place
    return found


def carried(holders: Sequence[Holder], held: Floats, time: float, x: Any, v: Any) -> None:
    """Put the particles that cling to colliders, as `catch` has told of all of them [4, n], where they are at a time [s]."""
    for k, each in enumerate(holders):
        mine = np.flatnonzero(held[0] == k + 1)
        if mine.size:
            at, speed = np.empty((2, 3, mine.size))
            _take_along(each.shape, np.ascontiguousarray(held[1:, mine]), time, at, speed)
            x[:, mine], v[:, mine] = at, speed
