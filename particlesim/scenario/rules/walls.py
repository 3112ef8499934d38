"""Walls that leave no room for what they hold."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np

from particlesim.colliders import Collider, Plane
from particlesim.colliders.emptiness import surely_apart
from particlesim.colliders.solid import SolidCollider
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.vectors import dot, unit
from particlesim.scenario.reach import collider_tables, held_back
from particlesim.scenario.tables import Tables

NOWHERE = 1e-9
"""Part of the distances of planes from the origin by which they must overlap at least, for all that is rounded."""
FACING = 1e-12
"""How far n·m of two planes that face each other is from −1, at most."""


def room(scenario: Tables) -> Iterator[Invalid]:
    """Two planes that face each other and hold the same particles leave room for them."""
    planes: list[tuple[Path, Plane]] = [
        (path, each) for path, each in collider_tables(scenario) if isinstance(each, Plane)
    ]
    for k, (path, one) in enumerate(planes):
        for other_path, other in planes[:k]:
            if dot(unit(one.normal), unit(other.normal)) > -1 + FACING:
                continue
            between = -dot(unit(one.normal), one.point) - dot(unit(other.normal), other.point)
            shared = [g for g in scenario.groups if held_back(one, (g.name,)) and held_back(other, (g.name,))]
            if between < 0 and shared:
                yield Invalid(
                    f"these walls overlap by {-between:.3g} m: no position is on the allowed side of both",
                    path,
                    ((other_path, "the other wall"),),
                    hint="normals point to where particles may be",
                )
            for group in () if between < 0 or one.soft or other.soft else shared:
                if (size := group.least_size()) is not None and 2 * size[1] > between:
                    yield Invalid(
                        f"these walls are {between:.3g} m apart, and particles of {group.name!r} {2 * size[1]:.3g} m thick",
                        path,
                        ((other_path, "the other wall"),),
                        hint="on = [...] names the groups that a wall holds back",
                    )


def common_place(scenario: Tables) -> Iterator[Invalid]:
    """There is a place that all walls at rest allow a group: planes, and containers whose gap is a distance."""
    led = {motion.collider for motion in scenario.motions if motion.collider is not None}
    still = [
        (path, each) for path, each in collider_tables(scenario) if each.name is None or each.name not in led
    ]
    told: set[tuple[Path, ...]] = set()
    for group in scenario.groups:
        walls = [(path, each) for path, each in still if held_back(each, (group.name,))]
        planes = [(path, each) for path, each in walls if isinstance(each, Plane)]
        hollow = [(path, each) for path, each in walls if _is_container(each)]
        for paths in (*_planes_without_place(planes), *_containers_apart(hollow)):
            if paths not in told:
                told.add(paths)
                yield Invalid(
                    f"no position is on the allowed side of all of these walls, which hold {group.name!r}",
                    paths[-1],
                    tuple((path, "another of the walls") for path in paths[:-1]),
                    hint="on = [...] names the groups that a wall holds back",
                )


def _is_container(each: Collider) -> bool:
    """Whether particles are held in it, and its gap is known to be a distance."""
    return isinstance(each, SolidCollider) and each.inside and bool(getattr(each, "exact", False))


def _containers_apart(hollow: list[tuple[Path, Collider]]) -> Iterator[tuple[Path, ...]]:
    """Pairs of containers that have no place in common."""
    for (path, one), (other_path, other) in combinations(hollow, 2):
        solids: list[Any] = [one, other]
        if surely_apart([each.geometry() for each in solids], min(each.farthest() for each in solids)):
            yield path, other_path


def _planes_without_place(planes: list[tuple[Path, Plane]]) -> Iterator[tuple[Path, ...]]:
    """The planes that exclude each other, three or more, by the linear program: the largest t with n·x ≥ n·p + t for all."""
    if len(planes) < 3:
        return
    from scipy.optimize import linprog

    normals = np.array([unit(each.normal) for _, each in planes])
    offsets = np.array([dot(unit(each.normal), each.point) for _, each in planes])
    scale = float(np.abs(offsets).max()) or 1.0
    rows = np.hstack([-normals, np.ones((len(planes), 1))])
    bounds = [(None, None)] * 3 + [(None, 1.0)]
    found = linprog([0, 0, 0, -1], A_ub=rows, b_ub=-offsets / scale, bounds=bounds)
    if found.x is not None and found.success and found.x[3] < -NOWHERE:
        needed = [
            path for (path, _), dual in zip(planes, found.ineqlin.marginals, strict=True) if dual < -1e-9
        ]
        if len(needed) > 2:  # two are told by `room`
            yield tuple(needed)
