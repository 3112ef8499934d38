"""Which of all forces on a particle is the strongest, in plain Python: for messages about what went wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from particlesim.bonds.hinge import angle_gradient, dihedral_gradient, wrapped
from particlesim.bonds.spring import Pair
from particlesim.engine.interactions.bonds import Bonds
from particlesim.engine.interactions.elements import AngleColumns, Corners, DihedralColumns
from particlesim.engine.islands.coupled import CoupledIsland
from particlesim.engine.state.columns import Columns
from particlesim.engine.world import World
from particlesim.forces.sheet_drag import Triangle
from particlesim.graph.graph import Island
from particlesim.laws.registry import Particle, bond_force, evaluate, force, hinge_moment, triangle_force
from particlesim.model.arrays import Floats
from particlesim.scenario.reach import acts_on


def strongest(
    world: World,
    number: int,
    member: int,
    particle: Particle,
    place: int,
    bonds: tuple[Bonds, ...],
    columns: Columns,
) -> tuple[str | None, float]:
    """The label of the strongest force on a particle of a group of an island, and its size [N].

    `place` is its row in `columns`, and `bonds` are as they are then. Springs of a set are added up, and so are the hinges
    of a set and what acts on the triangles around the particle. A force that is not finite is the strongest.
    """
    structure = world.graph.islands[number]
    with np.errstate(all="ignore"):
        sizes = _alone(world, structure, member, particle)
        for kind, made in zip(structure.bonds, bonds, strict=False):
            sizes[kind.name] = _length(_of_bonds(made, columns, place))
        for label, corners in _corners(world, number, member):
            sizes[label] = _length(_of_corners(corners, columns, place, particle.t))
    wild = next((label for label, size in sizes.items() if not math.isfinite(size)), None)
    if wild is not None:
        return wild, sizes[wild]
    best = max(sizes, key=lambda label: sizes[label], default=None)
    return best, math.nan if best is None else sizes[best]


def _alone(world: World, structure: Island, member: int, particle: Particle) -> dict[str, float]:
    """Sizes of the one-particle forces [N], by label."""
    sizes: dict[str, float] = {}
    group = structure.groups[member]
    for label, law in zip(world.scenario.force_labels(), world.scenario.forces, strict=False):
        if acts_on(law, group) and not law.on_surfaces:
            try:
                sizes[label] = _length(evaluate(force, law.record(), particle))
            except (ArithmeticError, ValueError):  # what compiled code answers with an infinity or a NaN
                sizes[label] = math.nan
    return sizes


def _of_bonds(bond: Bonds, c: Columns, row: int) -> Floats:
    """Force of all bonds of a set on a particle [N]."""
    total = np.zeros(3)
    for k in np.flatnonzero((bond.i == row) | (bond.j == row)):
        i, j = bond.i[k], bond.j[k]
        apart = (float(column[i]) - float(column[j]) for column in (c.x, c.y, c.z, c.vx, c.vy, c.vz))
        constants = (
            float(column if np.ndim(column) == 0 else column[k]) for column in (bond.k, bond.c, bond.rest)
        )
        pull = np.array(bond_force(bond.law, Pair(*map(np.float64, (*apart, *constants)))))
        total += pull if i == row else -pull
    return total


def _corners(world: World, number: int, member: int) -> Iterator[tuple[str, Corners]]:
    """Labels and columns of all that acts among three and four particles of an island; of surfaces, those of one group."""
    island, structure = world.islands[number], world.graph.islands[number]
    if not isinstance(island, CoupledIsland):
        return
    for hinges, made in zip(structure.hinges, island.hinges, strict=True):
        yield hinges.name, made
    labels = dict(zip(map(id, world.scenario.forces), world.scenario.force_labels(), strict=False))
    surfaces = iter(island.corners[len(island.hinges) :])
    for k, forces in enumerate(structure.surfaces):
        for law in forces:
            triangles = next(surfaces)
            if k == member:
                yield labels[id(law)], triangles


def _of_corners(each: Corners, c: Columns, row: int, time: float) -> Floats:
    """Force of a set of hinges, or of a force on triangles, on a particle [N]."""
    total = np.zeros(3)
    for q in np.flatnonzero((each.rows == row).any(axis=0)):
        rows = each.rows[:, q]
        x, v = (
            np.array([[float(column[i]) for column in part] for i in rows])
            for part in ((c.x, c.y, c.z), (c.vx, c.vy, c.vz))
        )
        corner = int(np.flatnonzero(rows == row)[0])
        if isinstance(each, AngleColumns | DihedralColumns):
            total += _of_hinge(each, x, float(each.rest[q]))[corner]
        else:
            total += _of_triangle(each, x, v, time) / 3
    return total


def _of_hinge(each: AngleColumns | DihedralColumns, x: Floats, rest: float) -> Floats:
    """Forces of an angle or a dihedral on its particles [N], shape [3 or 4, 3]."""
    if isinstance(each, AngleColumns):
        angle, *slopes = angle_gradient(*(x[0] - x[1]), *(x[2] - x[1]))
        a, b = np.array(slopes).reshape(2, 3)
        gradients = np.array([a, -(a + b), b])
    else:
        angle, *slopes = dihedral_gradient(*(x[0] - x[1]), *(x[1] - x[2]), *(x[3] - x[2]))
        a, b, d = np.array(slopes).reshape(3, 3)
        gradients = np.array([a, b, -(a + b + d), d])
    return np.asarray(-hinge_moment(each.law, np.float64(wrapped(angle - rest))) * gradients)


def _of_triangle(each: Corners, x: Floats, v: Floats, time: float) -> Floats:
    """Force on a triangle [N], shape [3]."""
    ax, ay, az = np.cross(x[1] - x[0], x[2] - x[0]) / 2
    middle = Particle(*(float(u) for u in (*x.mean(axis=0), *v.mean(axis=0), 0, 0, 0, time)))
    fx, fy, fz = triangle_force(each.law, Triangle(ax, ay, az, middle))
    return np.array([fx, fy, fz])


def _length(vector: Any) -> float:
    return math.hypot(*map(float, vector))
