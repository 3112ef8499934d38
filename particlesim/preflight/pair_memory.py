"""Memory of interactions of pairs: what their methods need in addition to the particles.

A tree is as large for every particle of many, so a smaller one is made and looked at. Lists have room for up to twice the
candidates that they hold; how many follows from how dense a periodic box is, and elsewhere nobody knows before the run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from particlesim.engine.interactions.mesh.fourier import half_of
from particlesim.engine.interactions.mesh.mesh_pairs import Aim, first_plan, task_in
from particlesim.engine.interactions.mesh.plan import class_of
from particlesim.engine.interactions.mesh.split import ByCharge, ByMass
from particlesim.engine.interactions.methods import chosen_in
from particlesim.engine.interactions.neighbours.record import BLOCK, ROOM, SKIN
from particlesim.engine.interactions.tree.calibration import order_for
from particlesim.engine.interactions.tree.field import new_tree
from particlesim.engine.interactions.tree.form import BothSigns, Form, Gradient, OneSign, Plummer
from particlesim.interactions.contact import Contact
from particlesim.interactions.far import FarInteraction
from particlesim.scenario.reach import pair_sets
from particlesim.scenario.scenario import Scenario

SAMPLE = 100_000
"""Particles of a tree that is looked at."""
LISTED, LISTED_NUMBERS = 60, 15
"""Bytes, and numbers, of a particle in lists beside its candidates: places, order and scratch of the sort; positions now and
when lists were built, what laws read, forces."""
IN_TURN = 2
"""Plans of a mesh that are in memory together while one is looked for."""


def pair_bytes(scenario: Scenario, numbers: Mapping[str, float], width: int) -> float:
    """Bytes of all interactions of pairs but contacts, for so many particles of each group in numbers of so many bytes."""
    box = scenario.simulation.box
    total = 0.0
    for each in pair_sets(scenario):
        law, count = each.law, round(sum(numbers[name] for name in each.groups))
        if isinstance(law, Contact) or count == 0:
            continue
        method = chosen_in(scenario, each, count)
        size = None if box is None else tuple(float(length) for length in box.size)
        if method == "neighbours":
            total += _list_bytes(count, law.reach() or 0.0, size, width)
        elif isinstance(law, FarInteraction) and method == "tree":
            total += _tree_bytes(law, count)
        elif isinstance(law, FarInteraction) and method == "mesh" and size is not None:
            total += IN_TURN * _mesh_bytes(law, count, size, width)
    return total


def in_lists(scenario: Scenario, numbers: Mapping[str, float]) -> frozenset[str]:
    """Groups whose particles are found by neighbour lists."""
    sets = [(each, round(sum(numbers[name] for name in each.groups))) for each in pair_sets(scenario)]
    listed = [
        each.groups
        for each, count in sets
        if count and (isinstance(each.law, Contact) or chosen_in(scenario, each, count) == "neighbours")
    ]
    return frozenset(name for groups in listed for name in groups)


def _tree_bytes(law: FarInteraction, count: int) -> float:
    signs = OneSign() if law.by == "mass" else BothSigns()
    form = Form((None,) * order_for(law.accuracy), signs, Plummer(0.0), Gradient())
    some = min(count, SAMPLE)
    return held(new_tree(form, some, 1)) * count / some


def _list_bytes(count: int, reach: float, size: Any, width: int) -> float:
    room = float(ROOM)
    if size is not None:  # of eight in a cube, all that are near any of them have one list
        density = count / math.prod(size)
        seen = density * 4 / 3 * math.pi * (reach * (1 + SKIN) + density ** (-1 / 3)) ** 3 / 8
        while room < seen:
            room *= 2
    return count * (LISTED + LISTED_NUMBERS * width + 4 * room) + 4 * 64 * BLOCK


def _mesh_bytes(law: FarInteraction, count: int, size: Any, width: int) -> float:
    by = ByMass() if law.by == "mass" else ByCharge()
    aim = Aim(law.record(), by, law.coupling(), law.accuracy, law.far_softening(), law.near_reach())
    order, _ = class_of(law.accuracy)
    plan = first_plan(task_in(size, aim, order, count), law.accuracy)
    x, y, z = plan.shape
    waves = 8 * half_of(z) * (2 * x * y + (x // 2 + 1) * (y // 2 + 1))
    return waves + _list_bytes(count, plan.cutoff, size, width)


def held(part: Any) -> int:
    """Bytes of all arrays in a tuple, and in those that it holds."""
    if isinstance(part, np.ndarray):
        return part.nbytes
    return sum(map(held, part)) if isinstance(part, tuple) else 0
