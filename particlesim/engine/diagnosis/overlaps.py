"""Particles inside a collider: at the start that is a mistake, and the contact that moves them out changes their energy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from particlesim.colliders import Collider
from particlesim.colliders.gaps import gaps_of, put_outside
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the largest coordinate."""


ROUNDS, LOOKS = 500, 20_000
"""How often a particle is put to the surfaces of all colliders before there is taken to be no room for it; at fewer where
that would be more looks at a collider: a second."""
HARD = ("bounce", "slide")
"""Contacts that keep particles outside."""
CAUGHT = 1e-3
"""Overlap with a collider, as a part of the radius, from which on a particle is inside of it."""
PIECE = 1 << 16
"""Particles looked at together: a run needs no more memory for it."""


class Overlap(NamedTuple):
    """A group of which particles are inside of a collider: how many, and the row and depth [m] of the deepest."""

    state: GroupState
    collider: Collider
    number: int
    deepest: int
    depth: float


def overlaps(
    island: BaseIsland, structure: Island, time: float = 0.0, contacts: Sequence[str] = ("bounce",)
) -> Iterator[Overlap]:
    """Groups of an island that are inside of colliders with some kinds of contact at a time [s]. Backdrops, which never
    move, are left out; rigid bodies know themselves where they are inside (`RigidIsland.intrusions`)."""
    if structure.rigid:
        return
    for state, group, colliders in zip(island.states, structure.groups, structure.colliders, strict=True):
        if not state.count or (isinstance(group, Particles) and group.pinned is True):
            continue
        farthest = max(float(state.position.max()), -float(state.position.min()))
        for collider in colliders:
            if collider.contact in contacts:
                found = _overlap(state, collider, TOUCHING * farthest, time)
                if found.number:
                    yield found


def no_room(
    overlap: Overlap, others: Sequence[Collider], time: float = 0.0
) -> tuple[Collider, Collider] | None:
    """Two colliders between which the deepest particle does not fit; None where a position for it is found. It is moved to
    the surface of each, one after the other, again and again. If it fits and they are convex, that converges (L. M. Bregman,
    Sov. Math. Dokl. 6, 688 (1965)); if it does not fit, it alternates.
    """
    state, row = overlap.state, overlap.deepest
    x, radius = state.x[:, row].astype(float)[None], state.radius[row : row + 1].astype(float)
    margin = 2 * TOUCHING * max(float(np.abs(x).max()), float(radius[0]))
    inside: list[Collider] = []
    for _ in range(min(ROUNDS, max(LOOKS // max(len(others), 1), 20))):
        inside = []
        for each in others:
            depth = np.empty(1)
            gaps_of(each.body(), x[:, 0], x[:, 1], x[:, 2], radius, time, depth)
            if depth[0] < -margin:
                inside.append(each)
                put_outside(each.body(), x, radius, np.ones(1, np.int64), time)
        if not inside:
            return None
    return inside[0], inside[-1]


class Caught(NamedTuple):
    """A particle, by its group, id and radius [m], that is `depth` [m] inside of the first of two colliders, which leave no
    room for it between them."""

    group: str
    id: int
    radius: float
    depth: float
    between: tuple[Collider, Collider]


def caught(
    island: BaseIsland, structure: Island, time: float, known: Callable[[str, Collider], bool]
) -> Iterator[Caught]:
    """For each group of an island some of whose colliders move, and each of its colliders, the deepest particle if there is
    no room for it; not for groups and colliders that are `known`."""
    if all(each.motion is None for colliders in structure.colliders for each in colliders):
        return
    for overlap in overlaps(island, structure, time, HARD):
        state, row = overlap.state, overlap.deepest
        radius = float(state.radius[row])
        number = island.states.index(state)
        soft = structure.touched_softly(structure.groups[number].name)
        walls = [each for each in structure.colliders[number] if each.contact in HARD]
        yields = any(each.recovery is not None for each in walls)
        if soft or yields or overlap.depth <= CAUGHT * radius or known(state.name, overlap.collider):
            continue
        if (found := no_room(overlap, walls, time)) is not None:
            one = overlap.collider
            other = next((each for each in found if each is not one), one)
            yield Caught(state.name, int(state.id[row]), radius, overlap.depth, (one, other))


def _overlap(state: GroupState, collider: Collider, margin: float, time: float) -> Overlap:
    """How a group lies to a collider at a time [s]; up to `margin` [m] particles only touch it."""
    shape = collider.body()
    number, deepest, most = 0, 0, -np.inf
    for first in range(0, state.count, PIECE):
        part = slice(first, min(first + PIECE, state.count))
        x, y, z, radius = (column[part].astype(float) for column in (*state.x, state.radius))
        depth = np.empty(x.size)
        gaps_of(shape, x, y, z, radius, time, depth)
        depth *= -1
        number += int((depth > margin).sum())
        row = int(depth.argmax())
        if depth[row] > most:
            deepest, most = first + row, float(depth[row])
    return Overlap(state, collider, number, deepest, most)
