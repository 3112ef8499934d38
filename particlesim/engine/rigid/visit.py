"""Particles among the bodies for a step, and what has become of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from particlesim.engine.rigid.bodies import Bodies
from particlesim.engine.rigid.grains import Guests
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.model.arrays import Floats, Ints


class Visitors(NamedTuple):
    """Particles that may touch bodies: places, velocities and angular momenta [3, n]; 1/m, 0 for those that are held,
    moments of inertia, infinite for those that do not turn, kinds, radii, ids [n]; contact by kind and group of bodies
    [kinds, groups]; `lean` as guests have it."""

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
    lean: Floats


class Left(NamedTuple):
    """Visitors after a step: new velocities and angular velocities, by how much they are to be moved [3, n], and whether
    anything has touched them [n]."""

    v: Floats
    turning: Floats
    shift: Floats
    moved: Ints


def among(
    chosen: Sequence[tuple[GroupState, Ints]], surfaces: Floats, lean: Floats | None = None
) -> Visitors:
    """Some rows of groups as visitors, with what contact of each group does [4, kinds, groups of bodies]."""
    parts = []
    for kind, (state, rows) in enumerate(chosen):
        radius, weight = state.radius[rows].astype(float), 1 / state.mass[rows].astype(float)
        inertia, spin = np.full(len(rows), np.inf), np.zeros((3, len(rows)))
        if SPIN in state.parts:
            inertia = 0.4 / weight * radius**2
            spin = state.angular_velocity[:, rows].astype(float) * inertia
        if state.clocked:  # what is held, or is at its end, does not move
            held = ~np.isfinite(state.start[rows])
            weight[held], inertia[held] = 0.0, np.inf
        x, v = state.x[:, rows].astype(float), state.v[:, rows].astype(float)
        parts.append((x, v, spin, weight, inertia, np.full(len(rows), kind), radius, state.id[rows]))
    columns = [np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)]
    lean = np.zeros(columns[0].shape) if lean is None else lean
    return Visitors._make([*columns, *surfaces, lean])


def guests_of(visitors: Visitors, bodies: int) -> Guests:
    """The visitors as kernels take them, after so many bodies."""
    n = len(visitors.w)
    tables = (visitors.touch, visitors.restitution, visitors.static, visitors.kinetic)
    scratch = (np.zeros(n), np.zeros((3, n)), np.zeros((3, n)))
    columns = (visitors.kind, visitors.radius, visitors.id, *tables)
    return Guests._make([bodies, *(each.copy() for each in columns), *scratch, visitors.lean.copy()])


def joined(b: Bodies, visitors: Visitors) -> Bodies:
    """Bodies with visitors after them, all of them copies."""
    n = b.w.size + len(visitors.w)
    columns = (np.empty((*each.shape[:-1], n), each.dtype) for each in b[:-1])
    whole = Bodies._make([*columns, b.pieces])
    fill(whole, b, visitors)
    return whole


def fill(whole: Bodies, b: Bodies, visitors: Visitors) -> None:
    """Put bodies and visitors as they are now into what `joined` has made of as many."""
    n = b.w.size
    for mine, each in zip(whole[:-1], b[:-1], strict=True):
        mine[..., :n] = each
    whole.turn[:, n:] = np.array([[1.0], [0.0], [0.0], [0.0]])
    whole.group[n:] = 0
    given = (visitors.x, visitors.v, visitors.spin, visitors.w, visitors.inertia, visitors.radius)
    for mine, each in zip(
        (whole.x, whole.v, whole.spin, whole.w, whole.inertia, whole.reach), given, strict=True
    ):
        mine[..., n:] = each


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
