"""Particles that begin inside of rigid bodies which they touch."""

from __future__ import annotations

import numpy as np

from particlesim.engine.diagnosis.overlaps import TOUCHING
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.grains import depths_in
from particlesim.engine.world import World


def embedding(world: World, particles: str, bodies: str) -> tuple[int, int, int, float]:
    """How many particles of a group are inside of bodies of another; of the deepest its id, which body of
    the group it is in, and how deep it is [m]."""
    state = next(each for each in world.states if each.name == particles)
    if not state.count:
        return 0, 0, 0, 0.0
    island = next(each for each in world.islands if isinstance(each, RigidIsland))
    group = [each.name for each in island.states].index(bodies)
    x, radius = state.x[:, : state.count].astype(float), state.radius[: state.count].astype(float)
    depth, which = np.full(state.count, -np.inf), np.zeros(state.count, np.int64)
    depths_in(island.bodies(), group, x, radius, depth, which)
    number = int((depth > TOUCHING * np.abs(x).max()).sum())
    row = int(depth.argmax())
    first = sum(each.count for each in island.states[:group])
    return number, int(state.id[row]), int(which[row]) - first, float(depth[row])
