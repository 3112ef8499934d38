"""Particles that are guests among the bodies for a step, and their positions and velocities after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.rigid.bodies import Bodies, Contacts
from particlesim.engine.rigid.grains import Guests
from particlesim.engine.rigid.held_walls import lift_held
from particlesim.engine.rigid.support import Support, lift_out, new_crowd
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.model.arrays import Floats, Ints

EPS = float(np.finfo(float).eps)


class Visitors(NamedTuple):
    """Particles that may touch bodies: places, velocities and angular momenta [3, n]; 1/m, 0 for those that are held,
    moments of inertia, infinite for those that do not turn, kinds, radii, ids [n]; contact by kind and group of bodies
    [kinds, groups]; by how much what else acts on them changes their velocities in a step [3, n], of what is not tied to
    bodies without its forces before these are known, and moves them beyond half of that (`beyond` [3, n]); the part of a
    step by which their velocities are late (`Method.lag`) [n]; which of them springs and rods tie to bodies, whose impacts
    are left to their own step, and which touch bodies or others that do, or are on rods [n]; how many of them, the first
    ones, rods hold."""

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
    speed: Floats
    exponent: Floats
    rolling: Floats
    flat: Floats
    gain: Floats
    beyond: Floats
    lag: Floats
    tied: Ints
    swift: Ints
    stands: Ints
    held: int = 0


class Left(NamedTuple):
    """Visitors after a step: new velocities and angular velocities, by how much they are to be moved [3, n], whether
    anything has touched them, and whether impacts on bodies are left to them [n], and by how much forces change their
    velocities [m/s], no numbers where none lies on a body [3, n]; how far those that rods hold begin their own step from
    where they should, as a collider is in the way, and where they are to end it [m], both [3, held]; which visitors
    contacts have pressed [n]; how fast those on rods are to be at its end [3, held], and which of them may touch a
    collider [held]."""

    v: Floats
    turning: Floats
    shift: Floats
    moved: Ints
    alone: Ints
    forces: Floats
    lifted: Floats
    ends: Floats
    pressed: NDArray[np.bool_]
    fast: Floats
    linked: NDArray[np.bool_]


def among(
    chosen: Sequence[tuple[GroupState, Ints]],
    surfaces: Floats,
    load: Floats,
    held: int,
    tied: Ints,
    swift: Ints,
    stands: Ints,
) -> Visitors:
    """Some rows of groups as visitors, with what contact of each group does, as `Touching`
    [fields, kinds, groups of bodies], and `load`, which
    is `gain`, `beyond` and `lag` [7, n]."""
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
    load = np.where(columns[3] > 0, load, 0.0)
    return Visitors._make([*columns, *surfaces, load[:3], load[3:6], load[6], tied, swift, stands, held])


def guests_of(visitors: Visitors, support: Support, bodies: int, h: float) -> Guests:
    """The visitors as kernels take them, after so many bodies, with what they lie on, for a step of length h."""
    n = len(visitors.w)
    tables = (
        visitors.touch,
        visitors.restitution,
        visitors.static,
        visitors.kinetic,
        visitors.speed,
        visitors.exponent,
        visitors.rolling,
        visitors.flat,
    )
    scratch = (np.zeros(n), np.zeros((3, n)), np.zeros((3, n)))
    crowd = new_crowd(visitors.stands, visitors.radius)
    crowd.began[:, : visitors.held] = visitors.x[:, : visitors.held]
    columns = (visitors.kind, visitors.radius, visitors.id, *tables)
    known = (np.zeros((3, n)), np.zeros(1, np.int64), np.zeros((3, n)), np.zeros(n))
    return Guests._make(
        [
            bodies,
            *(each.copy() for each in columns),
            *scratch,
            _others(visitors, h),
            *(visitors.tied.copy(), np.zeros(n, np.int64), visitors.swift.astype(np.int64)),
            *(np.zeros(bodies, np.int64), np.zeros(n, np.int64)),
            visitors.held,
            *known,
            *(visitors.lag.copy(), support, crowd),
        ]
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
    guests.tied[:], guests.swift[:], guests.crowd.stands[:] = visitors.tied, visitors.swift, visitors.stands
    guests.pull[:], guests.asked[0], guests.bend[:], guests.lag[:] = 0.0, 0, 0.0, visitors.lag
    guests.crowd.began[:, : guests.held] = visitors.x[:, : guests.held]


def inform(guests: Guests, visitors: Visitors, pull: Floats, h: float) -> Visitors:
    """Visitors, now that it is known what accelerates those that are not tied to bodies [m/s²], shape [3, n]."""
    guests.pull[:], guests.asked[0] = pull, 1
    gain = visitors.gain + np.where(visitors.w > 0, h * pull, 0.0)
    late = np.where(visitors.tied > 0, 0.0, h * visitors.lag * gain)
    visitors = visitors._replace(gain=gain, beyond=visitors.beyond + late)
    guests.other[:] = _others(visitors, h)
    return visitors


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


def learn_bend(guests: Guests, shift: Floats, pull: Floats) -> None:
    """What accelerates guests where they have been shifted so far is known, too [m/s²], both [3, n]."""
    length2, back = (shift**2).sum(axis=0), ((guests.pull - pull) * shift).sum(axis=0)
    guests.bend[:] = np.divide(back, length2, out=np.zeros_like(back), where=length2 > 0)
    guests.asked[0] = 2


def lies(guests: Guests) -> bool:
    """Whether some guest that is not tied to bodies touches one."""
    return bool((guests.awaits > guests.tied).any())


def left(whole: Bodies, contacts: Contacts, guests: Guests, visitors: Visitors, t: float, h: float) -> Left:
    """The visitors after a step of length h that began at a time t, with its contacts."""
    part, held = slice(guests.first, None), visitors.held
    x, end, spin = whole.x[:, part], whole.v[:, part], whole.spin[:, part]
    gain = np.where(guests.awaits > 0, visitors.gain, 0.0) - guests.crowd.borne
    v = end - gain
    change = v - visitors.v
    rounding = 4 * EPS * (np.abs(end) + np.abs(gain))
    change[(np.abs(change) <= rounding) & (gain != 0)] = 0.0
    v = np.where(change == 0, visitors.v, v)
    # What has been moved apart, beyond the drift of the second half.
    apart = x - guests.at - 0.5 * h * end
    moved = (change != 0).any(axis=0) | (spin != visitors.spin).any(axis=0)
    moved |= np.abs(apart).max(axis=0) > 1e-12 * (1 + np.abs(guests.at).max(axis=0))
    shift = np.where(np.abs(apart) > 1e-12 * (1 + np.abs(guests.at)), apart, 0.0)
    shift += guests.shift - 0.5 * h * change
    # What contact takes back of the kick, a method may have moved them further by than half of it.
    beyond = visitors.beyond - h * visitors.lag * guests.crowd.borne
    length2, along = (change**2).sum(axis=0), (change * beyond).sum(axis=0)
    kick = np.maximum(-(change * gain).sum(axis=0), length2)
    part_of = np.divide(along, kick, out=np.zeros_like(along), where=(length2 > 0) & (guests.awaits > 0))
    shift -= part_of * change
    # Rods give impulses at the beginning and at the end of the step, too: only the places at its ends tell.
    shift[:, :held] = (x - visitors.x - h * (v + 0.5 * gain))[:, :held]
    # What others and colliders give is in this step, and none of the forces that are to be expected.
    forces = np.where((guests.crowd.linked > 0) | (not lies(guests)), np.nan, h * guests.pull)
    lift_out(guests, visitors.x, v, shift, t)
    lifted = np.zeros((3, held))
    if held:
        lift_held(guests, visitors.x, v, visitors.gain, shift, lifted, t, h)
    alone = (guests.alone > 0) & (guests.when == 0)
    pressing = contacts.impulse[: contacts.number[0], 0] != 0
    ends = np.concatenate([each[: len(pressing)][pressing] for each in (contacts.first, contacts.second)])
    pressed = np.zeros(len(visitors.w), np.bool_)
    pressed[ends[ends >= guests.first] - guests.first] = True
    ends, fast = x[:, :held].copy(), end[:, :held].copy()
    linked = guests.crowd.linked[:held] > 0
    return Left(v, spin / visitors.inertia, shift, moved, alone, forces, lifted, ends, pressed, fast, linked)
