"""Walls that leave no room for what they hold."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders import Plane
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.vectors import dot, unit
from particlesim.scenario.reach import collider_tables, held_back
from particlesim.scenario.tables import Tables

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
