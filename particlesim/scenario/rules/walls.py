"""Walls that leave no room for what they hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from particlesim.bodies import Bodies
from particlesim.colliders import Collider, Plane
from particlesim.colliders.combination import Combination, Difference, Intersection
from particlesim.colliders.content import files_in
from particlesim.colliders.emptiness import Depth, surely_forbidden
from particlesim.colliders.half_space import HalfSpace
from particlesim.colliders.solid import SolidCollider
from particlesim.groups.group import Group, Particles
from particlesim.laws.registry import sure_gap
from particlesim.model.arrays import Floats
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.vectors import Vector3, dot, unit
from particlesim.scenario.reach import collider_tables, held_back
from particlesim.scenario.tables import Tables

NOWHERE = 1e-9
"""Part of the distances of planes from the origin by which they must overlap at least, for all that is rounded."""
ON = "on = [...] names the groups that a wall holds back"
"""What helps where walls hold what they need not."""
FACING = 1e-12
"""How far n·m of two planes that face each other is from −1, at most."""
BEYOND = 0.1
"""Margin of the box about a solid, in parts of its size: facets are inside of what is round."""
FEW, MANY = 600, 20_000
"""Boxes that are looked at for a place between walls; the second number for two of them whose gap takes no search, and less
for more: half a second."""


def room(scenario: Tables) -> Iterator[Invalid]:
    """Two planes at rest that face each other and hold the same particles leave room for them."""
    led = _led(scenario)
    planes: list[tuple[Path, Plane]] = [
        (path, each)
        for path, each in collider_tables(scenario)
        if isinstance(each, Plane) and each.name not in led
    ]
    for k, (path, one) in enumerate(planes):
        for other_path, other in planes[:k]:
            if dot(unit(one.normal), unit(other.normal)) > -1 + FACING:
                continue
            offsets = dot(unit(one.normal), one.point), dot(unit(other.normal), other.point)
            between, rounded = -sum(offsets), NOWHERE * max(map(abs, offsets))
            shared = [
                g
                for g in scenario.groups
                if held_back(one, (g.name,)) and held_back(other, (g.name,)) and not _may_be_pinned(g)
            ]
            if between < -rounded and shared:
                yield Invalid(
                    f"these walls overlap by {-between:.3g} m: no position is on the allowed side of both",
                    path,
                    ((other_path, "the other wall"),),
                    hint="normals point to where particles may be",
                )
            for group in () if between < -rounded or _lets_in(one) or _lets_in(other) else shared:
                if (size := group.least_size()) is not None and 2 * size[1] * (
                    1 - NOWHERE
                ) > between + rounded:
                    yield Invalid(
                        f"these walls are {between:.3g} m apart, and particles of {group.name!r} {2 * size[1]:.3g} m thick",
                        path,
                        ((other_path, "the other wall"),),
                        hint=f"a smaller radius, or walls that are farther apart; {ON}",
                    )


def _led(scenario: Tables) -> set[str | None]:
    """The names of colliders that move; None, that of others, is none."""
    return {motion.collider for motion in scenario.motions if motion.collider is not None}


def _may_be_pinned(group: Group) -> bool:
    """Whether colliders may have nothing to do with some particles of a group, which never move."""
    return isinstance(group, Particles) and group.pinned is not False


def _lets_in(collider: Collider) -> bool:
    """Whether balls may be inside of it for some steps, or die there."""
    return collider.soft or collider.contact == "kill"


def common_place(scenario: Tables) -> Iterator[Invalid]:
    """There is a place for the smallest particle of each group between all the walls at rest that hold it: planes,
    containers and solids, of those in files the ones that have been read."""
    led = _led(scenario)
    still = [
        _Wall(path, each)
        for path, each in collider_tables(scenario)
        if each.name not in led and all(solid.is_open for _, solid in files_in(each))
    ]
    told: set[tuple[Path, ...]] = set()
    known: dict[
        tuple[tuple[Path, ...], float], list[_Wall]
    ] = {}  # groups often are alike, as those of emitters
    for group in scenario.groups:
        if _may_be_pinned(group):
            continue
        size = None if isinstance(group, Bodies) else group.least_size()
        walls = [wall for wall in still if held_back(wall.collider, (group.name,))]
        radius = 0.0 if size is None else size[1]
        alike = tuple(wall.path for wall in walls), radius
        between = known[alike] if alike in known else known.setdefault(alike, _without_place(walls, radius))
        if radius and between and (all_of_it := _without_place(walls, 0.0)):
            radius, between = 0.0, all_of_it  # there is no place for a point either
        paths = tuple(wall.path for wall in between)
        if not paths or paths in told:
            continue
        told.add(paths)
        helps = (("a smaller radius, or more room", radius > 0), (ON, len(paths) > 1))
        yield Invalid(
            _no_place(len(paths), group.name, radius),
            paths[-1],
            tuple((path, "another of the walls") for path in paths[:-1]),
            hint="; ".join(text for text, fits in helps if fits),
        )


def _no_place(number: int, group: str, radius: float) -> str:
    """What there is no place for, between how many walls."""
    if not radius:
        return f"no position is on the allowed side of all of these walls, which hold {group!r}"
    ball = f"no particle of {group!r} fits"
    if number == 1:
        return f"{ball} into this wall: the smallest has a radius of {radius:.3g} m"
    return f"{ball} between these walls: the smallest has a radius of {radius:.3g} m"


class _Wall:
    """A collider at rest, where it is stated, and how deep places are in what it forbids."""

    def __init__(self, path: Path, collider: Collider) -> None:
        self.path = path
        self.collider = collider
        self.plane = collider if isinstance(collider, Plane) else None
        self.hollow = isinstance(collider, SolidCollider) and collider.inside
        self._shape = collider.shape()

    def depth(self, radius: float) -> Depth:
        """How deep balls of a radius are in what it forbids. Some walls let them in, up to their centres at least, and of
        what is put together it is not known how far they are in it."""
        loose = _lets_in(self.collider) or isinstance(self.collider, Combination)
        shape, size = self._shape, 0.0 if loose else radius
        return lambda p: -float(sure_gap(shape, p._replace(r=size)))


def _without_place(walls: list[_Wall], radius: float) -> list[_Wall]:
    """The walls that together leave no place for a ball of a radius, none of them too many; none where there is a place, or
    may be one."""
    planes = [wall for wall in walls if wall.plane is not None]
    if between := _planes_without_place(planes, radius):
        return between
    if len(planes) == len(walls) or not _leave_none(walls, radius):
        return []
    for wall in tuple(walls):
        fewer = [each for each in walls if each is not wall]
        if _leave_none(fewer, radius):
            walls = fewer
    return walls


def _leave_none(walls: list[_Wall], radius: float) -> bool:
    """Whether walls that are not all planes surely leave no place for a ball of a radius."""
    boxes = [_box_about(wall.collider) for wall in walls if wall.hollow]
    if boxes:
        ends = np.max([low for low, _ in boxes], axis=0), np.min([high for _, high in boxes], axis=0)
        if (ends[0] > ends[1]).any():
            return True
        if not np.isfinite(ends).all():
            return False  # a container without an end leaves something
        low, high = (tuple(each.tolist()) for each in ends)
    elif (found := _between_planes([wall for wall in walls if wall.plane is not None])) is not None:
        low, high = found
    else:
        return False  # of what has no end, solids leave something
    most = FEW if any(wall.collider.costly for wall in walls) else max(2 * MANY // len(walls), FEW)
    smaller = radius - NOWHERE * (radius + max(map(abs, (*low, *high))))  # what fits but for rounding fits
    if radius and not smaller > 0:
        return False
    quick_first = sorted(walls, key=lambda wall: wall.collider.costly)
    return surely_forbidden([wall.depth(max(smaller, 0.0)) for wall in quick_first], low, high, most)


def _box_about(solid: Any) -> tuple[Floats, Floats]:
    """The low and the high corner of a box about a solid, and about the facets that it is drawn with; of half of all space
    that has no end."""
    if isinstance(solid, HalfSpace):
        return np.full(3, -np.inf), np.full(3, np.inf)
    if isinstance(solid, Combination):
        parts = solid.of
        if isinstance(solid, Intersection):  # which is inside of each of them
            parts = tuple(part for part in parts if not isinstance(part, HalfSpace))
        elif isinstance(solid, Difference):
            parts = parts[:1]
        boxes = [_box_about(part) for part in parts]
        return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
    corners = solid.triangles().corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = BEYOND * float((high - low).max())
    return low - margin, high + margin


def _half_spaces(planes: list[_Wall]) -> tuple[Floats, Floats]:
    """Normals n [k, 3] of planes and n·p of a place on each [m], [k]."""
    sides = [(unit(wall.plane.normal), wall.plane.point) for wall in planes if wall.plane is not None]
    return np.array([n for n, _ in sides]), np.array([dot(n, point) for n, point in sides])


def _between_planes(planes: list[_Wall]) -> tuple[Vector3, Vector3] | None:
    """The low and the high corner of the box about what is on the allowed side of planes; None if that has no end."""
    if len(planes) < 4:
        return None
    from scipy.optimize import linprog

    normals, offsets = _half_spaces(planes)
    ends: list[float] = []
    for cost in (*np.eye(3), *-np.eye(3)):
        found = linprog(cost, A_ub=-normals, b_ub=-offsets, bounds=(None, None))
        if not found.success or found.fun is None:
            return None
        ends.append(float(found.fun))
    return (ends[0], ends[1], ends[2]), (-ends[3], -ends[4], -ends[5])


def _planes_without_place(planes: list[_Wall], radius: float) -> list[_Wall]:
    """The planes that exclude each other, three or more, by the linear program: the largest t with n·x ≥ n·p + t for all."""
    if len(planes) < 3:
        return []
    from scipy.optimize import linprog

    normals, offsets = _half_spaces(planes)
    scale = max(float(np.abs(offsets).max()), radius) or 1.0
    size = np.array([0.0 if _lets_in(wall.collider) else radius for wall in planes])
    rows = np.hstack([-normals, np.ones((len(planes), 1))])
    bounds = [(None, None)] * 3 + [(None, 1.0)]
    found = linprog([0, 0, 0, -1], A_ub=rows, b_ub=-(offsets + size) / scale, bounds=bounds)
    if found.x is None or not found.success or not found.x[3] < -NOWHERE:
        return []
    needed = [wall for wall, dual in zip(planes, found.ineqlin.marginals, strict=True) if dual < -1e-9]
    return needed if len(needed) > 2 else []  # two are told by `room`
