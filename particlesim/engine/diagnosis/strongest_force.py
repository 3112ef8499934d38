"""Which of all forces on a particle is the strongest, in plain Python: for messages about what went wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particlesim.engine.interactions.interaction import Interaction
from particlesim.engine.state.columns import Columns
from particlesim.engine.world import World
from particlesim.graph.graph import Island
from particlesim.laws.registry import Particle, evaluate, force
from particlesim.model.arrays import Floats
from particlesim.scenario.reach import acts_on


def strongest(
    world: World,
    number: int,
    member: int,
    particle: Particle,
    place: int,
    interactions: tuple[Interaction, ...],
    columns: Columns,
) -> tuple[str | None, float]:
    """The label of the strongest force on a particle of a group of an island, and its size [N].

    `place` is its row in `columns`, and `interactions` are as they are then. Those of one name
    are added up. A force that is not finite is the strongest.
    """
    structure = world.graph.islands[number]
    with np.errstate(all="ignore"):
        sizes = alone(world, structure, member, particle)
        shared: dict[str, Floats] = {}
        for name, each in zip(world.islands[number].names, interactions, strict=True):
            force = each.force_on(columns, place, particle.t)[:3]  # contacts that roll tell their torque, too
            shared[name] = shared.get(name, np.zeros(3)) + force
        sizes |= {name: _length(each) for name, each in shared.items()}
    wild = next((label for label, size in sizes.items() if not math.isfinite(size)), None)
    if wild is not None:
        return wild, sizes[wild]
    best = max(sizes, key=lambda label: sizes[label], default=None)
    return best, math.nan if best is None else sizes[best]


def alone(world: World, structure: Island, member: int, particle: Particle) -> dict[str, float]:
    """Sizes of the one-particle forces [N], by label."""
    sizes: dict[str, float] = {}
    group = structure.groups[member]
    for label, law in zip(world.scenario.labels.forces, world.scenario.forces, strict=True):
        if acts_on(law, group) and not law.on_surfaces:
            try:
                sizes[label] = _length(evaluate(force, law.record(), particle))
            except (ArithmeticError, ValueError):  # what compiled code answers with an infinity or a NaN
                sizes[label] = math.nan
    return sizes


def _length(vector: Any) -> float:
    return math.hypot(*map(float, vector))
