"""The rods solved together with bodies: those at bodies, and those between particles that rods connect to bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from particlesim.bonds.pairs import SINGLE
from particlesim.bonds.pairs import WORLD as WORLD_NAME
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology


class RodList(NamedTuple):
    """Rods of one name: the groups of both ends, the indices there, the ends along the axes of shapes [2, 3] (None: the
    places of particles), their length [m] (None: the distance at the start), and which table under [[rods]] says so (None: a
    group does)."""

    name: str
    groups: tuple[str, str]
    pairs: Sequence[tuple[int, int]]
    points: Floats | None
    length: float | None
    table: int | None


def rod_lists(scenario: Scenario) -> Iterator[RodList]:
    """All rods that bodies hold."""
    tables = {id(rods): k for k, rods in enumerate(scenario.rods)}
    for label, rods in scenario.body_rods:
        points = np.array(rods.points or np.zeros((2, 3)), float)
        yield RodList(label, rods.groups(), rods.pairs or SINGLE, points, rods.length, tables[id(rods)])
    for each in scenario.hung_rods:
        pairs = [(i, k) for i, k in each.find().tolist()]
        yield RodList(each.name, each.groups, pairs, None, each.length, None)


def held_rows(scenario: Scenario, particles: Mapping[str, GroupState]) -> dict[str, Ints]:
    """Of every group, the rows of particles that rods of bodies hold. Raises UsageError for particles that do not exist."""
    found: dict[str, list[int]] = {}
    for each in rod_lists(scenario):
        for name, ends in zip(each.groups, zip(*each.pairs, strict=True), strict=True):
            if name in particles:
                if max(ends) >= (number := particles[name].count):
                    text = f"{each.name}: {name!r} has {number} particles, there is no particle {max(ends)}"
                    raise UsageError(text, f"0 to {number - 1}")
                found.setdefault(name, []).extend(ends)
    return {name: np.unique(np.array(rows, np.int64)) for name, rows in found.items()}


def seats_of(
    offset: Mapping[str, int], counts: Mapping[str, int], held: Mapping[str, Ints], bodies: int
) -> dict[str, Ints]:
    """By groups, the places of all bodies among them, and those of the particles on rods after them."""
    found = {name: first + np.arange(counts[name]) for name, first in offset.items()}
    for name, rows in held.items():
        found[name] = np.full(int(rows.max()) + 1, -1)
        found[name][rows] = bodies + np.arange(len(rows))
        bodies += len(rows)
    return found


def rod_lines(scenario: Scenario, ids: Mapping[str, Ints], lengths: Floats) -> list[Topology]:
    """Rods as a trajectory keeps them, with the ids of groups, and lengths in the order of `rod_lists`."""
    found = []
    for each in rod_lists(scenario):
        number = len(each.pairs)
        known = [np.array([-1]) if name == WORLD_NAME else ids[name] for name in each.groups]
        ends = np.array([[known[0][i], known[1][k]] for i, k in each.pairs], np.int64)
        points = None if each.points is None else np.tile(each.points, (number, 1, 1))
        found.append(Topology(each.name, ends, lengths[:number], np.full(number, np.inf), points=points))
        lengths = lengths[number:]
    return found
