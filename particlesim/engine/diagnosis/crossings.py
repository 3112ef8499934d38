"""Crossings that contact has missed: who stands on the wrong side of a surface at a frame, and did not at the last one.

The wrong side is that of the material: the centre of a particle, or the centre of mass of a rigid body, is behind a plane,
outside of a container, or inside of a solid or a body, by more than rounding and the overlap that contacts leave. What began
there, or was born there, has crossed nothing. This looks at places alone, and knows nothing of how contacts are found, so
that it holds for every kind of detection. What has passed a thin collider stands outside of it again: for that the kernels
look at steps (`engine.step.crossing`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies import Bodies
from particlesim.colliders import Collider
from particlesim.colliders.gaps import gaps_of
from particlesim.colliders.plane import Plane
from particlesim.engine.diagnosis.overlaps import PIECE, TOUCHING
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.world import World
from particlesim.groups.group import Particles
from particlesim.model.arrays import Floats, Ints
from particlesim.model.vectors import unit
from particlesim.scenario.reach import meetings_of

NOISE = 64
"""Rounding errors of coordinates that a place on a surface may be off by."""
SMALL = 1e-6
"""The least size that coordinates and colliders are taken to have, as a part of that at the start: where planes meet at the
origin, there is none in their corner to tell rounding by."""
SUNK = 1e-3
"""Depth in a body, as a part of its smallest size, that contacts may leave: ten times what they tolerate (`rigid_scene`)."""


class Watched(NamedTuple):
    """A group, and a surface that holds it back: a collider, with its shape, or bodies of the groups with a 1 here."""

    state: GroupState
    collider: Collider | None
    shape: Any = None
    touch: Floats | None = None


class Crossings:
    """Counts crossings that were missed, by what stands on the wrong side at frames."""

    def __init__(self, world: World) -> None:
        self._watched = [*_of_colliders(world), *_of_bodies(world)]
        self._least = SMALL * max((_size(each) for each in self._watched), default=0.0)
        self.number = np.zeros(1, np.int64)
        self._inside: list[Ints] = [np.empty(0, np.int64) for _ in self._watched]
        self._newest = np.full(len(self._watched), -1)
        """The ids on the wrong side at the last frame, and the highest id there was."""

    def look(self, world: World) -> None:
        """Count who has come to a wrong side since the last look."""
        for k, each in enumerate(self._watched):
            state, n = each.state, each.state.count
            rows = _behind(world, each, self._least) if each.collider is not None else _within(world, each)
            ids = state.id[rows]
            known = ids <= self._newest[k]
            self.number[0] += int((known & ~np.isin(ids, self._inside[k])).sum())
            self._inside[k] = ids.copy()
            if n:
                self._newest[k] = max(self._newest[k], int(state.id[:n].max()))


def _of_colliders(world: World) -> Iterator[Watched]:
    """Groups and colliders that hold them back. Surfaces that yield let particles in."""
    for island, structure in zip(world.islands, world.graph.islands, strict=True):
        for state, group, colliders in zip(island.states, structure.groups, structure.colliders, strict=True):
            if isinstance(group, Bodies) and not _holds_its_centre(group):
                continue
            if isinstance(group, Particles) and group.pinned is True:
                continue
            yield from (Watched(state, each, each.body()) for each in colliders if not each.soft)


def _of_bodies(world: World) -> Iterator[Watched]:
    """Groups of particles, and of bodies, with the bodies that they touch."""
    bodies = world.scenario.bodies
    names = [each.name for each in bodies]
    touched: dict[str, list[str]] = {}
    for each in meetings_of(world.scenario):
        touched.setdefault(each.particles, []).append(each.bodies)
    for group in bodies:
        if _holds_its_centre(group):
            touched[group.name] = names
    island = next((each for each in world.islands if bodies and each.states[0].name in names), None)
    for state in world.states:
        if island is not None and state.name in touched:
            order = [each.name for each in island.states]
            touch = np.array([float(name in touched[state.name]) for name in order])
            yield Watched(state, None, touch=touch)


def _holds_its_centre(group: Bodies) -> bool:
    """Whether the centre of mass of bodies is inside of them, which that of a ring is not."""
    for piece in group.shape.own_pieces():
        low, high = piece.stretch(np.zeros((1, 3)))
        if low[0] < 0 < high[0]:
            return True
    return False


def _size(watched: Watched) -> float:
    """How large coordinates of a group and a collider are [m]."""
    state, collider = watched.state, watched.collider
    own = 0.0 if collider is None else collider.reach()
    return own + float(np.abs(state.x[:, : state.count]).max(initial=0.0))


def _behind(world: World, watched: Watched, least: float) -> Ints:
    """The rows of a group whose centres are on the wrong side of a collider; `least`: the size of what is small [m]."""
    state, collider = watched.state, watched.collider
    assert collider is not None
    found: list[Ints] = [np.empty(0, np.int64)]
    eps = max(TOUCHING, NOISE * float(np.finfo(state.dtype).eps))
    for first in range(0, state.count, PIECE):
        part = slice(first, min(first + PIECE, state.count))
        x = state.x[:, part]
        low, high = x.min(axis=1).astype(float), x.max(axis=1).astype(float)
        slack = eps * max(max(-low.min(), high.max()) + collider.reach(), least)
        if isinstance(collider, Plane) and collider.motion is None:
            n = np.array(unit(collider.normal))
            nearest = np.where(n > 0, low, high)
            if n @ (nearest - np.array(collider.point)) >= -slack:
                continue
        x = x.astype(float)
        gap = np.empty(x.shape[1])
        gaps_of(watched.shape, *x, np.zeros(x.shape[1]), world.time, gap)
        found.append(first + np.flatnonzero(gap < -slack))
    return _free(state, np.concatenate(found))


def _within(world: World, watched: Watched) -> Ints:
    """The rows of a group whose centres are inside of bodies."""
    from particlesim.engine.islands.rigid import RigidIsland  # with all that bodies need
    from particlesim.engine.rigid.standing import bodies_at

    island = next(each for each in world.islands if isinstance(each, RigidIsland))
    state, n = watched.state, watched.state.count
    assert watched.touch is not None
    own: Ints | None = None
    if any(each is state for each in island.states):
        before = [each.name for each in island.states].index(state.name)
        own = sum(each.count for each in island.states[:before]) + np.arange(n)
    x = state.x[:, :n].astype(float)
    slack = SUNK * min(each.shape.fineness() for each in world.scenario.bodies)
    inside = bodies_at(island.bodies(), watched.touch, x, slack, own)
    rows = np.flatnonzero(inside >= 0)
    if own is not None:
        rows = np.array([i for i in rows if not island.are_partners(int(own[i]), int(inside[i]))], np.int64)
    return _free(state, rows)


def _free(state: GroupState, rows: Ints) -> Ints:
    """Those of some rows that are neither pinned, led nor stuck, and alive."""
    if not state.clocked or not rows.size:
        return rows
    return rows[np.isfinite(state.start[rows])]
