"""Particles that overlap each other at the start, where an interaction makes them touch: told, as they will move apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.world import World
from particlesim.interactions.contact import Contact
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.reach import interacting, touches_by_surfaces

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the sum of both radii."""
CLASSES = 2.0
"""Ratio of radii within a class of sizes, which is looked through together."""


class Crowding(NamedTuple):
    """Pairs that overlap at the start: the interaction, how many, ids of the deepest two and how deep they are [m]."""

    label: str
    number: int
    ids: tuple[int, int]
    depth: float


def crowded(world: World) -> list[Crowding]:
    """The pairs of every contact interaction that overlap in the present state."""
    found = []
    for each in world.scenario.interactions:
        if not isinstance(each, Contact):
            continue
        groups = interacting(each, world.scenario.groups)
        if touches_by_surfaces(each, groups):
            continue  # `tangles`
        names = [group.name for group in groups]
        states = [state for name in names for state in world.states if state.name == name and state.count]
        if not states:
            continue
        x = np.concatenate([state.position.astype(float) for state in states])
        r = np.concatenate([state.radius[: state.count].astype(float) for state in states])
        ids = np.concatenate([state.id[: state.count] for state in states])
        side = np.repeat([names.index(state.name) for state in states], [state.count for state in states])
        i, j, depth = overlapping(x, r)
        deep = depth > TOUCHING * (r[i] + r[j])
        if each.between is not None:
            deep &= side[i] != side[j]
        if deep.any():
            k = int(np.argmax(np.where(deep, depth, -np.inf)))
            found.append(
                Crowding(each.label, int(deep.sum()), (int(ids[i[k]]), int(ids[j[k]])), float(depth[k]))
            )
    return found


def overlapping(x: Floats, r: Floats) -> tuple[Ints, Ints, Floats]:
    """All pairs of spheres at x [n, 3] with radii r [n] that overlap, each once, and how deep [m].

    Spheres are looked for among those of their own size and of smaller ones, size by size, so that few large ones do not
    make small ones look far.
    """
    from scipy.spatial import cKDTree

    there = np.flatnonzero((r > 0) & np.isfinite(x).all(axis=1))
    sizes = np.floor(np.log(r[there]) / np.log(CLASSES)).astype(np.int64)
    classes = [there[sizes == size] for size in np.unique(sizes)]
    trees = [cKDTree(x[rows]) for rows in classes]
    ends: list[tuple[Ints, Ints]] = []
    for k, (rows, tree) in enumerate(zip(classes, trees, strict=True)):
        inside = tree.query_pairs(2 * r[rows].max(), output_type="ndarray")
        ends.append((rows[inside[:, 0]], rows[inside[:, 1]]))
        for smaller, other in zip(classes[:k], trees[:k], strict=True):
            near = other.query_ball_point(x[rows], r[rows] + r[smaller].max())
            count = np.array([len(each) for each in near], np.int64)
            if count.any():
                ends.append((np.repeat(rows, count), smaller[np.concatenate(near).astype(np.int64)]))
    i = np.concatenate([np.empty(0, np.int64), *(a for a, _ in ends)])
    j = np.concatenate([np.empty(0, np.int64), *(b for _, b in ends)])
    depth = r[i] + r[j] - np.sqrt(((x[i] - x[j]) ** 2).sum(axis=1))
    touch = depth > 0
    return i[touch], j[touch], depth[touch]
