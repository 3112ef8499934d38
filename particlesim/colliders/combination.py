"""Union, intersection and difference of solids.

The gap of a union is the smallest of those of its parts, that of an intersection the largest; a difference is the
intersection of the first part with the outsides of the others. The normal is that of the part that decides. Outside of a
union and inside of an intersection that is the distance; elsewhere it is a lower bound of it. So a ball that comes to an
edge which a cut has made meets it as if both faces went on: the edge is sharp, for balls too.

Source: J. C. Hart, Sphere tracing, The Visual Computer 12, 527 (1996), section 3.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from particlesim.colliders import COMPONENTS, SOLIDS
from particlesim.colliders.emptiness import common_of, surely_apart
from particlesim.colliders.gaps import gaps_and_normals_of, gaps_of
from particlesim.colliders.half_space import HalfSpace
from particlesim.colliders.mesh import Mesh
from particlesim.colliders.parts import IntersectionRecord, UnionRecord, spread
from particlesim.colliders.solid import GRAIN, HollowConvexRecord, HollowRecord, Solid, SolidCollider
from particlesim.colliders.triangulation import (
    Distance,
    Triangles,
    clipped,
    joined,
    shifted,
    side_of,
    turned_over,
    without_slivers,
)
from particlesim.laws.registry import bend
from particlesim.model.mistakes import invalid
from particlesim.model.variants import Tagged

MOST_PARTS = 80
"""Solids that are put together at most: each is looked at in turn. A mesh has room for more."""
AnySolid = Annotated[Solid, Tagged("type", SOLIDS)]
AnyPart = Annotated[Solid, Tagged("type", COMPONENTS)]

SHARP, ROUNDED, MOST_ENDS = 0.7, 1e-9, 64
"""How much too early balls may meet the edges of cuts, in radii: these are sharp, at a right angle it is 0.41, at 72° 0.7.
What of the size of a solid is taken for rounding. How many places are looked at to see how much too early balls touch."""
BLUNT = 0.45
"""The same for edges that stand into a union: 0.41 at a right angle."""
FLUSH = 1e-7
"""How far before and behind a face places are looked at that tell whether it is on the surface, in parts of its size."""
FINE = 128
"""Triangles of a cut surface along the longest side of a part, at least."""


class Combination(Solid):
    """Solids put together."""

    convex: ClassVar[bool] = False

    of: tuple[AnySolid, ...] = Field(min_length=2, max_length=MOST_PARTS)
    """The solids: tables with a type and the keys of that shape."""

    _doubtful: bool = PrivateAttr(default=False)

    @model_validator(mode="after")
    def _ends(self) -> Combination:
        if all(isinstance(part, HalfSpace) for part in self.of):
            raise invalid(
                "where planes alone end is not known",
                at=("of",),
                allowed="at least one solid that has an end, such as a box about what they enclose",
                hint="several [[planes]] hold particles back on their own",
            )
        return self

    def grain(self) -> float:
        return min(part.grain() for part in self.of)

    def waist(self) -> float:
        return min(part.waist() for part in self.of)  # at most

    def farthest(self) -> float:
        return max(part.farthest() for part in self.of)

    def empty(self) -> Iterator[str]:
        """What seems to have nothing in it: the solid itself, and combinations among its parts."""
        if self._doubtful:
            yield f"the {self.kind} of {self.words()}" if self.kind == "intersection" else self.words()
        for part in self.of:
            if isinstance(part, Combination):
                yield from part.empty()

    def hollow_parts(self, inside: bool) -> Iterator[Solid]:
        """The solids among its parts of which the outside counts, where it is a container or not."""
        for k, part in enumerate(self.of):
            hollow = inside != (isinstance(self, Difference) and k > 0)
            if isinstance(part, Combination):
                yield from part.hollow_parts(hollow)
            elif hollow:
                yield part

    def surface_of(self, part: Solid) -> Triangles:
        """The surface of a part, without walls in it; of a plane, what there is about all others."""
        if isinstance(part, HalfSpace):
            return part.within(self.farthest())
        return part.walls() if isinstance(part, Union) else part.triangles()

    def words(self) -> str:
        return listed(self.of)

    def whole(self) -> tuple[Any, ...]:
        """The shapes whose intersection it is, or union, one for each solid, as kernels take them."""
        raise NotImplementedError

    def outside(self) -> Any:
        """All that is not in it, as kernels take it."""
        raise NotImplementedError

    def triangles(self) -> Triangles:
        """Of each part what lies inside of all the others."""
        first, *others = (self.surface_of(part) for part in self.of)
        others = [turned_over(each) for each in others] if isinstance(self, Difference) else others
        return _common(self.whole(), [first, *others])


class CombinationCollider(SolidCollider):
    """Solids put together that hold particles back."""

    costly: ClassVar[bool] = True

    def shape(self) -> Any:
        assert isinstance(self, Combination)
        return self.outside() if self.inside else self.geometry()

    def doubts(self, name: str, lightest: float | None, dt: float) -> Iterator[str]:
        yield from super().doubts(name, lightest, dt)
        assert isinstance(self, Combination)
        for words in self.empty():
            yield f"{name}: no place was found in {words}: it seems to be empty, or is too thin to be met"
        for part in self.hollow_parts(self.inside):
            if isinstance(part, Mesh) and (fault := part.seen_from_inside()) is not None:
                yield f"{name}: {fault}"


def _outside_of(part: Solid) -> Any:
    """What is not in a solid, as kernels take it."""
    if isinstance(part, (HalfSpace, Combination)):
        return part.outside()
    return (HollowConvexRecord if part.convex else HollowRecord)(part.geometry(), part.grain())


def _least_reach(parts: Sequence[Solid]) -> float:
    """The largest coordinate [m] that a place in all of some solids may have."""
    return min(part.farthest() for part in parts if not isinstance(part, HalfSpace))


def listed(parts: Sequence[Solid]) -> str:
    """Solids in a sentence: a sphere, a box and a cone."""
    *some, last = (f"a {part.kind}" for part in parts)
    return f"{', '.join(some)} and {last}" if some else last


def are_exact(parts: Sequence[Solid]) -> bool:
    """Whether the gaps of all of some solids are distances, and known without reading a file."""
    return all(part.exact for part in parts)


def distances(shape: Any, corners: Any) -> Any:
    """Signed distances of places [n, 3] to a shape [m], shape [n]."""
    x, y, z = np.ascontiguousarray(corners.T, float)
    out = np.empty(x.size)
    gaps_of(shape, x, y, z, np.zeros(x.size), 0.0, out)
    return out


def _common(shapes: Sequence[Any], surfaces: Sequence[Triangles]) -> Triangles:
    """The surface of what shapes have in common, from their surfaces. Where faces of two lie on each other that of the first
    is taken, if they look the same way, else none: places just behind a face are in all shapes, and those just before it not
    in earlier ones."""
    found = []
    for k, surface in enumerate(surfaces):
        size = float(np.ptp(surface.corners, axis=0).max())
        for j, shape in enumerate(shapes):
            for by in () if j == k else (-FLUSH,) if j > k else (-FLUSH, FLUSH):
                moved = clipped(shifted(surface, by * size), distance_to(shape), size / FINE)
                surface = shifted(moved, -by * size)
        found.append(without_slivers(surface))
    return joined(found)


def distance_to(shape: Any) -> Distance:
    """The signed distance to a shape, as surfaces are clipped by it."""
    return Distance(functools.partial(distances, shape), functools.partial(_side_of, shape))


def _side_of(shape: Any, triangles: Any) -> Any:
    """On which side of a shape triangles [m, 3, 3] are for sure: −1 inside, 1 outside, 0 where that is not known."""
    if isinstance(shape, (UnionRecord, IntersectionRecord)):
        sides = np.stack([_side_of(part, triangles) for part in shape.parts])
        return sides.min(axis=0) if isinstance(shape, UnionRecord) else sides.max(axis=0)
    if bend(shape) == 0:
        return np.zeros(len(triangles), int)
    x, y, z = np.ascontiguousarray(triangles.reshape(-1, 3).T, float)
    gaps, normals = np.empty(x.size), np.empty((x.size, 3))
    gaps_and_normals_of(shape, x, y, z, gaps, normals)
    return side_of(triangles, gaps.reshape(-1, 3), normals.reshape(-1, 3, 3), bend(shape))


class Union(Combination):
    """Solids that are one: particles stay out of all of them."""

    kind: ClassVar[str] = "union"

    type: Literal["union"] = "union"

    def whole(self) -> tuple[Any, ...]:
        return tuple(part.geometry() for part in self.of)

    def geometry(self) -> Any:
        return spread(UnionRecord(self.whole(), self.grain()))

    def outside(self) -> Any:
        return spread(IntersectionRecord(tuple(_outside_of(part) for part in self.of), self.grain()))

    def triangles(self) -> Triangles:
        return joined([self.surface_of(part) for part in self.of])  # what lies inside of another is not seen

    def walls(self) -> Triangles:
        """Of each part what lies outside of all the others."""
        outsides = [_outside_of(part) for part in self.of]
        return turned_over(_common(outsides, [turned_over(self.surface_of(part)) for part in self.of]))


class UnionCollider(Union, CombinationCollider):
    """Solids that are one: particles stay out of all of them."""

    of: tuple[AnyPart, ...] = Field(min_length=2, max_length=MOST_PARTS)
    """The solids: tables with a type and the keys of that shape. A plane is all that is behind it; a part may itself be put
    together, of solids that are not."""

    def early(self, radius: float) -> float:
        """As a container it is as deep as the deepest of its parts. Where a ball goes from one to another it meets the ends
        of both, which are no walls, unless they overlap by its diameter."""
        if not self.inside or not are_exact(self.of):
            return 0.0
        shapes = [part.geometry() for part in self.of]
        places = np.concatenate([_under(self.surface_of(part), radius) for part in self.of])
        deep = -np.min([distances(shape, places) for shape in shapes], axis=0)
        places, deep = places[(deep > 0) & (deep < radius)], deep[(deep > 0) & (deep < radius)]
        walls = self.walls()
        if not len(places) or not len(walls.faces):
            return 0.0
        few = np.linspace(0, len(places) - 1, min(len(places), 4 * MOST_ENDS)).astype(int)
        room = np.minimum(distances_from_surface(walls, places[few]), radius)
        most = float((room - deep[few]).max())
        return most if most > BLUNT * radius + ROUNDED * self.farthest() else 0.0

    def early_where(self, radius: float) -> str:
        return (
            "where its parts meet, as if each of them ended there with a wall: "
            f"let them overlap by {2 * radius:.3g} m"
        )


class Intersection(Combination):
    """What several solids have in common."""

    kind: ClassVar[str] = "intersection"

    type: Literal["intersection"] = "intersection"

    @model_validator(mode="after")
    def _holds_something(self) -> Intersection:
        if not are_exact(self.of):
            return self
        convex = all(part.convex for part in self.of)
        found = common_of(self.whole(), _least_reach(self.of), self.grain() / GRAIN, convex=convex)
        if found in ("nothing", "touch"):
            raise invalid(
                f"{listed(self.of)} have nothing in common"
                if found == "nothing"
                else f"{listed(self.of)} only touch: what they have in common has no volume",
                at=("of",),
                allowed="solids that overlap each other",
                hint='a "union" is all of them together',
            )
        self._doubtful = found == "doubt"
        return self

    def whole(self) -> tuple[Any, ...]:
        return tuple(part.geometry() for part in self.of)

    def geometry(self) -> Any:
        return spread(IntersectionRecord(self.whole(), self.grain()))

    def outside(self) -> Any:
        return spread(UnionRecord(tuple(_outside_of(part) for part in self.of), self.grain()))


class IntersectionCollider(Intersection, CombinationCollider):
    """What several solids have in common."""

    of: tuple[AnyPart, ...] = Field(min_length=2, max_length=MOST_PARTS)
    """The solids: tables with a type and the keys of that shape. A plane is all that is behind it; a part may itself be put
    together, of solids that are not."""


class Difference(Combination):
    """The first solid without the others."""

    kind: ClassVar[str] = "difference"

    type: Literal["difference"] = "difference"

    @model_validator(mode="after")
    def _leaves_something(self) -> Difference:
        first, *others = self.of
        for k, other in enumerate(others, start=1):
            if other.model_dump() == first.model_dump():
                raise invalid(
                    f"nothing is left of a {first.kind} without the same {other.kind}",
                    at=("of", k),
                    also=[(("of", 0), "the same solid")],
                    allowed="solids that take off a part of the first",
                )
        if isinstance(first, HalfSpace) or not are_exact(self.of):
            return self  # a plane has no end
        convex = first.convex and all(isinstance(part, HalfSpace) for part in others)
        found = common_of(self.whole(), first.farthest(), self.grain() / GRAIN, convex=convex)
        if found in ("nothing", "touch"):
            raise invalid(
                f"nothing is left of a {first.kind} without {listed(others)}",
                at=("of",),
                allowed="a first solid that is not wholly inside of the others",
            )
        self._doubtful = found == "doubt"
        return self

    def waist(self) -> float:
        return self.of[0].waist()  # at most

    def whole(self) -> tuple[Any, ...]:
        first, *others = self.of
        return (
            first.geometry(),
            *(_outside_of(part) for part in others),
        )

    def geometry(self) -> Any:
        return spread(IntersectionRecord(self.whole(), self.grain()))

    def outside(self) -> Any:
        first, *others = self.of
        return spread(UnionRecord((_outside_of(first), *(part.geometry() for part in others)), self.grain()))

    def words(self) -> str:
        first, *others = self.of
        return f"a {first.kind} without {listed(others)}"


class DifferenceCollider(Difference, CombinationCollider):
    """The first solid without the others."""

    of: tuple[AnyPart, ...] = Field(min_length=2, max_length=MOST_PARTS)
    """The solids: tables with a type and the keys of that shape. A plane is all that is behind it; a part may itself be put
    together, of solids that are not."""

    def early(self, radius: float) -> float:
        """What is taken off also ends outside of the first solid, where no surface is. Balls meet those ends where they are
        nearer than a diameter to it."""
        if self.inside or not are_exact(self.of):
            return 0.0
        first, *_ = shapes = self.whole()
        ends = np.concatenate([_under(self.surface_of(part), radius) for part in self.of[1:]])
        ends = ends[distances(first, ends) < radius]
        seen = np.max([distances(shape, ends) for shape in shapes], axis=0)
        ends, seen = ends[seen < radius], seen[seen < radius]
        if not len(ends):
            return 0.0
        surface = self.triangles()
        if not len(surface.faces):
            return 0.0  # nothing seems to be left of it, which `doubts` tells
        few = np.linspace(0, len(ends) - 1, min(len(ends), MOST_ENDS)).astype(int)
        most = float((distances_from_surface(surface, ends[few]) - seen[few]).max())
        return most if most > SHARP * radius + ROUNDED * self.farthest() else 0.0

    def early_where(self, radius: float) -> str:
        return (
            f"where what is taken off ends, as if that had a surface outside of the {self.of[0].kind}, too: "
            f"let it reach {2 * radius:.3g} m beyond"
        )

    def doubts(self, name: str, lightest: float | None, dt: float) -> Iterator[str]:
        yield from super().doubts(name, lightest, dt)
        first, *others = self.of
        for k, other in enumerate(others, start=1):
            pair = (first, other)
            if are_exact(pair) and surely_apart([part.geometry() for part in pair], _least_reach(pair)):
                yield f"{name}: the {other.kind} of[{k}] takes nothing off, as it is apart from the {first.kind}"


def _under(surface: Triangles, radius: float) -> Any:
    """Places under a surface, at most a radius deep, [n, 3]."""
    a, b, c = (surface.corners[surface.faces[:, k]] for k in range(3))
    out = np.cross(b - a, c - a)
    size = np.linalg.norm(out, axis=1, keepdims=True)
    inwards = -out / np.where(size > 0, size, 1)
    shares = [(u / 3, v / 3, (3 - u - v) / 3) for u in range(4) for v in range(4 - u)]
    on = [u * a + v * b + w * c for u, v, w in shares]
    return np.concatenate(
        [each + depth * radius * inwards for each in on for depth in (0.25, 0.5, 0.75, 0.98)]
    )


def distances_from_surface(surface: Triangles, places: Any) -> Any:
    """Distances of places to a surface [m]."""
    from trimesh.triangles import closest_point

    corners = surface.corners[surface.faces]
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    found = []
    for x in places:
        away = np.linalg.norm(middles - x, axis=1)
        near = corners[away - reach <= (away + reach).min()]
        nearest = closest_point(near, np.broadcast_to(x, (len(near), 3)))  # type: ignore[no-untyped-call]
        found.append(np.linalg.norm(nearest - x, axis=1).min())
    return np.array(found)
