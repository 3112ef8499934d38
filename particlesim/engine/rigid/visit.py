"""Particles that are guests among the bodies for a step, and their positions and velocities after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from particlesim.engine.rigid.bodies import Bodies
from particlesim.engine.rigid.grains import Guests
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.model.arrays import Floats, Ints

EPS = float(np.finfo(float).eps)


class Visitors(NamedTuple):
    """Particles that may touch bodies: places, velocities and angular momenta [3, n]; 1/m, 0 for those that are held,
    moments of inertia, infinite for those that do not turn, kinds, radii, ids [n]; contact by kind and group of bodies
    [kinds, groups]; by how much what else acts on them changes their velocities in a step, as it did in the last one [3, n];
    how many of them, the first ones, rods hold."""

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
    gain: Floats
    held: int = 0


class Left(NamedTuple):
    """Visitors after a step: new velocities and angular velocities, by how much they are to be moved [3, n], and whether
    anything has touched them [n]."""

    v: Floats
    turning: Floats
    shift: Floats
    moved: Ints


def among(chosen: Sequence[tuple[GroupState, Ints]], surfaces: Floats, gain: Floats, held: int) -> Visitors:
    """Some rows of groups as visitors, with what contact of each group does [4, kinds, groups of bodies]."""
    parts = []
    for kind, (state, rows) in enumerate(chosen):
        radius, weight = state.radius[rows].astype(float), 1 / state.mass[rows].astype(float)
        inertia, spin = np.full(len(rows), np.inf), np.zeros((3, len(rows)))
        if SPIN in state.parts:
            inertia = 0.4 / weight * radius**2
            spin = state.angular_velocity[:, rows].astype(float) * inertia
        if state.clocked:  # what is held, or is at its end, does not move
            still = ~np.isfinite(state.start[rows])
            weight[still], inertia[still] = 0.0, np.inf
        x, v = state.x[:, rows].astype(float), state.v[:, rows].astype(float)
        parts.append((x, v, spin, weight, inertia, np.full(len(rows), kind), radius, state.id[rows]))
    columns = [np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)]
    return Visitors._make([*columns, *surfaces, np.where(columns[3] > 0, gain, 0.0), held])


def guests_of(visitors: Visitors, bodies: int, h: float) -> Guests:
    """The visitors as kernels take them, after so many bodies, for a step of length h."""
    n = len(visitors.w)
    tables = (visitors.touch, visitors.restitution, visitors.static, visitors.kinetic)
    scratch = (np.zeros(n), np.zeros((3, n)), np.zeros((3, n)))
    columns = (visitors.kind, visitors.radius, visitors.id, *tables)
    known = (np.zeros((3, n)), np.zeros(1, np.int64))
    return Guests._make(
        [bodies, *(each.copy() for each in columns), *scratch, _others(visitors, h), visitors.held, *known]
    )


def _others(visitors: Visitors, h: float) -> Floats:
    """The force of what else acts on visitors [N], shape [3, n]."""
    return np.divide(visitors.gain, h * visitors.w, out=np.zeros_like(visitors.gain), where=visitors.w > 0)


def joined(b: Bodies, visitors: Visitors) -> Bodies:
    """Bodies with visitors after them, all of them copies."""
    n = b.w.size + len(visitors.w)
    columns = (np.empty((*each.shape[:-1], n), each.dtype) for each in b[:-1])
    whole = Bodies._make([*columns, b.pieces])
    fill(whole, b, visitors)
    return whole


def renew(guests: Guests, visitors: Visitors, h: float) -> None:
    """The same visitors in another step."""
    guests.other[:] = _others(visitors, h)
    guests.pull[:], guests.asked[0] = 0.0, 0


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
    """The visitors after a step of length h."""
    part, held = slice(guests.first, None), visitors.held
    x, end, spin = whole.x[:, part], whole.v[:, part], whole.spin[:, part]
    v = end - visitors.gain
    change = v - visitors.v
    rounding = 4 * EPS * (np.abs(end) + np.abs(visitors.gain))
    change[(np.abs(change) <= rounding) & (visitors.gain != 0)] = 0.0
    v = np.where(change == 0, visitors.v, v)
    # What has been moved apart, beyond the drift of the second half.
    apart = x - guests.at - 0.5 * h * end
    moved = (change != 0).any(axis=0) | (spin != visitors.spin).any(axis=0)
    moved |= np.abs(apart).max(axis=0) > 1e-12 * (1 + np.abs(guests.at).max(axis=0))
    shift = np.where(np.abs(apart) > 1e-12 * (1 + np.abs(guests.at)), apart, 0.0)
    shift += guests.shift - 0.5 * h * change
    # Rods give impulses at the beginning and at the end of the step, too: only the places at its ends tell.
    shift[:, :held] = (x - visitors.x - h * (v + 0.5 * visitors.gain))[:, :held]
    return Left(v, spin / visitors.inertia, shift, moved)
