"""Meshes: surfaces of triangles, closed ones with an inside and an outside, or thin sheets.

The distance is that to the nearest triangle, its sign that of (x − c)·N, with c the nearest place of the surface and N its
pseudonormal (`bvh`). A closed mesh whose triangles are wound so that their fronts look outwards is solid.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt
from pydantic import PrivateAttr, model_validator

from particlesim.colliders.bvh import BvhRecord, build, coarse, first_triangle, nearest_triangle
from particlesim.colliders.content import SolidFromFile
from particlesim.colliders.overlaps import overlap_of
from particlesim.colliders.pose import UNTURNED, Orientation, Rows
from particlesim.colliders.solid import SolidCollider
from particlesim.colliders.triangulation import Triangles, three_cornered
from particlesim.colliders.way import Way, longest, place_on, way_of
from particlesim.compiler import outlined
from particlesim.errors import UsageError
from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    first_contact,
    gap,
    gap_and_normal,
    law,
    least_gap,
    normal,
    thinnest,
)
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number
from particlesim.model.units import Vector as VectorOf

THIN = 1e-3
"""Thickness that solid parts of a surface of triangles are taken to have at least, in parts of its size."""
MOST_GRAZES = 32
"""Touches without contact, as of an edge, after which a way is taken to be free."""


class TriangleSolid(SolidFromFile):
    """A solid whose surface is triangles."""

    convex: ClassVar[bool] = False

    _surface: Triangles | None = PrivateAttr(default=None)
    _tree: BvhRecord | None = PrivateAttr(default=None)

    def triangles(self) -> Triangles:
        assert self._surface is not None, "the file has not been read"
        return self._surface

    def tree(self) -> BvhRecord:
        """The hierarchy of its triangles, which is built when it is first needed."""
        if self._tree is None:
            self._tree = build(*self.triangles())
        return self._tree

    def geometry(self) -> Any:
        return MeshRecord(self.tree(), 1.0, 0.0)

    def grain(self) -> float:
        return 1e-6 * self.farthest()

    def farthest(self) -> float:
        return float(np.abs(self.triangles().corners).max())


class Mesh(TriangleSolid):
    """The triangles of a file (OBJ, PLY or STL): a closed surface, or with a `thickness` a sheet of any form."""

    kind: ClassVar[str] = "mesh"
    endings: ClassVar[tuple[str, ...]] = (".obj", ".ply", ".stl")

    type: Literal["mesh"] = "mesh"
    origin: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Where the origin of the file's coordinates is."""
    scale: Annotated[Number, Gt(0)] = 1.0
    """Metres per unit of the file."""
    orientation: Orientation | None = None
    """How it is turned about its origin."""
    thickness: Annotated[Metres, Gt(0)] | None = None
    """Makes it a sheet of this thickness, which particles touch from both sides and which need not be closed."""

    _dropped: int = PrivateAttr(default=0)

    def rotation(self) -> Rows:
        """From the axes of the file to those of the world."""
        return UNTURNED if self.orientation is None else self.orientation.rotation()

    def waist(self) -> float:
        return math.inf if self.thickness is None else self.thickness

    @property
    def dropped(self) -> int:
        """Triangles of the file that have no area, and are left out."""
        return self._dropped

    def take(self, content: tuple[Floats, Ints]) -> None:
        """Vertices [n, 3] and triangles [m, 3]. Raises UsageError when they enclose nothing, though they should."""
        vertices, faces = content
        largest = self.scale * float(np.abs(vertices).max(initial=0.0))
        if not largest < FAR:
            raise UsageError(
                f"{self.path}: its coordinates go up to {largest:.3g} m", f"they may be less than {FAR:g} m"
            )
        corners = Triangles(self.scale * vertices, faces).placed(self.origin, self.rotation()).corners
        solid, self._dropped = without_flat(corners, faces)
        if len(solid) == 0:
            raise UsageError(f"{self.path}: none of its triangles has an area", "is it flat?")
        if self.thickness is None:
            require_solid(corners, bounding(corners, faces), self.path)
        self._surface = Triangles(corners, solid)
        self._content = content

    def seen_from_inside(self) -> str | None:
        """What is wrong with it as a container, or as what is taken away from another solid; None if nothing is."""
        if self.thickness is not None or not self.is_open:
            return None
        surface = self.triangles()
        at = overlap_of(surface.corners, surface.faces)
        if at is None:
            return None
        x, y, z = at
        return (
            f"closed surfaces of {self.path} run into each other, as at ({x:.4g}, {y:.4g}, {z:.4g}): seen from inside, "
            "each is a wall in the others"
        )

    def geometry(self) -> Any:
        if self.thickness is None:
            return super().geometry()
        return MeshRecord(self.tree(), 0.0, 0.5 * self.thickness)

    def words(self) -> str:
        x, y, z = self.origin
        return f"{'sheet ' if self.thickness else ''}{self.path} at ({x:g}, {y:g}, {z:g})"


class MeshCollider(Mesh, SolidCollider):
    """The triangles of a file (OBJ, PLY or STL): a closed surface, or with a `thickness` a sheet of any form."""

    costly: ClassVar[bool] = True

    @model_validator(mode="after")
    def _sheets_have_two_sides(self) -> MeshCollider:
        if self.inside and self.thickness is not None:
            raise invalid(
                "a sheet has no inside", at=("inside",), also=[(("thickness",), "makes it a sheet")]
            )
        return self

    def take(self, content: tuple[Floats, Ints]) -> None:
        super().take(content)
        if self.inside and (fault := self.seen_from_inside()) is not None:
            raise UsageError(
                fault,
                "programs that edit meshes can join them; or give each a file of its own, and put these together: "
                'type = "union", of = [ … ], inside = true',
            )

    def shape(self) -> Any:
        record = self.geometry()
        return record._replace(side=-1.0) if self.inside else record


def without_flat(corners: Floats, faces: Ints) -> tuple[Ints, int]:
    """The triangles that have an area, and how many have none."""
    flat = flat_ones(corners, faces)
    return faces[~flat], int(flat.sum())


def flat_ones(corners: Floats, faces: Ints) -> Any:
    """Which triangles have no area: they are no higher than the rounding of a file in single precision."""
    a, b, c = corners[faces].transpose(1, 0, 2)
    double = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.sqrt(np.max([((u - v) ** 2).sum(axis=1) for u, v in ((a, b), (b, c), (c, a))], axis=0))
    return double <= FLAT * longest * np.ptp(corners, axis=0).max()


def bounding(corners: Floats, faces: Ints) -> Ints:
    """The triangles that a surface is closed with, if it is: those without an area only where they close a gap, as beside a
    corner on an edge, and not where they lie on an edge that is closed without them."""
    faces = faces[three_cornered(faces)]
    flat = flat_ones(corners, faces)
    while flat.any():
        ends = _ends_of(faces)
        there, back = _numbered(ends, len(corners))
        _, place, times = np.unique(there, return_inverse=True, return_counts=True)
        odd = ~np.isin(there, back) | (times[place.reshape(-1)] > 1)
        idle = flat & odd.reshape(-1, 3).any(axis=1)
        if not idle.any():
            break
        faces, flat = faces[~idle], flat[~idle]
    return faces


def _ends_of(faces: Ints) -> Ints:
    """From which corner to which the edges of triangles go, [3 m, 2]."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)


def _numbered(ends: Ints, corners: int) -> tuple[Ints, Ints]:
    """A number for every edge as it goes, and for its way back."""
    size = corners + 1
    return ends[:, 0] * size + ends[:, 1], ends[:, 1] * size + ends[:, 0]


SHEET = "thickness makes it a sheet, which particles touch from both sides and which may be open"


TURN = "wind the corners of its triangles the other way round"


def told_of_flat(name: str, dropped: int) -> str:
    """That triangles of a file have no area."""
    verbs = ("has", "is") if dropped == 1 else ("have", "are")
    return "{}: {:,} of its triangles {} no area and {} left out".format(name, dropped, *verbs)


def require_solid(
    corners: Floats,
    faces: Ints,
    name: str,
    hint: str = SHEET,
    turn: str = f"{TURN}; a container is inside = true",
) -> None:
    """Raises UsageError for triangles that enclose no body with their fronts outwards; the hint is for open ones, `turn` for
    those that look inwards."""
    ends = _ends_of(faces)
    there, back = _numbered(ends, len(corners))
    alone = ~np.isin(there, back)
    if alone.any():
        k = int(alone.argmax())
        x, y, z = corners[ends[k]].mean(axis=0)
        _, sides = np.unique(np.sort(ends, axis=1) @ [len(corners) + 1, 1], return_counts=True)
        if (sides == 2).all():
            raise UsageError(
                f"{name} is turned both outwards and inwards: the triangles at {int(alone.sum())} of its edges do not go "
                f"round the same way, as at ({x:.4g}, {y:.4g}, {z:.4g})",
                "programs that edit meshes can make all normals point outwards",
            )
        raise UsageError(
            f"{name} is open: {int(alone.sum())} of its edges have a triangle on one side only, as at "
            f"({x:.4g}, {y:.4g}, {z:.4g})",
            hint,
        )
    _, times = np.unique(there, return_counts=True)
    if (times > 1).any():
        raise UsageError(
            f"{name}: {int((times > 1).sum())} of its edges have more than two triangles, or two that are wound differently",
            hint,
        )
    volume = enclosed(corners, faces)
    if abs(volume) <= FLAT * float(np.ptp(corners, axis=0).max()) * area(corners, faces):
        raise UsageError(f"{name} has no volume: its triangles lie back to back", hint)
    if volume < 0:
        raise UsageError(f"{name} is inside out: its triangles turn their fronts inwards", turn)


def enclosed(corners: Floats, faces: Ints) -> float:
    """Volume that the triangles of a closed surface enclose [m³]; negative where their fronts look inwards."""
    a, b, c = (corners - corners.mean(axis=0))[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def area(corners: Floats, faces: Ints) -> float:
    """Area of all triangles [m²]."""
    a, b, c = corners[faces].transpose(1, 0, 2)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


FAR = 1e100
"""Coordinates that no mesh has, and whose products are numbers [m]."""
FLAT = 2e-7
"""Height of a triangle in parts of the size of its mesh, up to which it has no area; a solid that is half as thick
has no volume."""


class MeshRecord(NamedTuple):
    """A tree of triangles; which side particles are on: 1 outside, −1 inside, 0 both; half the thickness of a sheet [m]."""

    tree: BvhRecord
    side: float
    half: float


@law(thinnest, MeshRecord)
def mesh_thinnest(c: MeshRecord) -> Any:
    """What is taken to be behind all parts of the surface at least [m]: half a sheet, or a part of the size of a solid."""
    box = c.tree.around
    size = max(box[3] - box[0], box[4] - box[1], box[5] - box[2])
    return c.half if c.side == 0 else THIN * size


def mesh_distance(c: Any, p: Particle) -> Any:
    """The distance of a place from the surface on the side of the particles [m], and the unit normal there."""
    d, side, x, y, z = nearest_triangle(c.tree, float(p.x), float(p.y), float(p.z))
    sign = side * c.side if c.side != 0 else 1.0
    turn = c.side if c.side != 0 else side
    like = type(p.x)
    return like(sign * d - c.half), like(turn * x), like(turn * y), like(turn * z)


@law(gap, MeshRecord)
def mesh_gap(c: MeshRecord, p: Particle) -> float:
    return mesh_distance(c, p)[0] - p.r


@law(normal, MeshRecord)
def mesh_normal(c: MeshRecord, p: Particle) -> Vector:
    _, x, y, z = mesh_distance(c, p)
    return x, y, z


@law(gap_and_normal, MeshRecord)
def mesh_gap_and_normal(c: MeshRecord, p: Particle) -> tuple[float, Vector]:
    d, x, y, z = mesh_distance(c, p)
    return d - p.r, (x, y, z)


@outlined
@law(least_gap, MeshRecord)
def mesh_least_gap(c: MeshRecord, p: Particle, need: float) -> float:
    """A lower bound of the gap [m]: that of the grid if it is above `need`, else the gap."""
    lower = coarse(c.tree, float(p.x), float(p.y), float(p.z))
    free = type(p.x)((lower * c.side if c.side != 0 else abs(lower)) - c.half) - p.r
    return free if free > need else mesh_gap(c, p)


@law(apart, MeshRecord)
@outlined
def mesh_apart(c: MeshRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    way = longest(way_of(p, q, h))
    return mesh_least_gap(c, p, way) > way


@law(first_contact, MeshRecord)
@outlined
def mesh_first_contact(c: MeshRecord, p: Particle, q: Particle, h: float, slack: float) -> float:
    v = way_of(p, q, h)
    one = type(p.x)(1)
    w = Way(float(v.ux), float(v.uy), float(v.uz), float(v.cx), float(v.cy), float(v.cz))
    x, y, z, size = float(p.x), float(p.y), float(p.z), float(p.r) + c.half
    tiny = float(slack)
    speed = float(longest(v))
    side, thin = c.side, float(p.r) + thinnest(c)
    if side == 0:
        side = nearest_triangle(c.tree, x, y, z)[1]
    begin = 0.0
    for _ in range(MOST_GRAZES):
        s = first_triangle(c.tree, w, x, y, z, begin, size, side, tiny)
        if not s < 1:
            return one
        # it touches: on by some rounding errors, twice as far each time, until it is inside or has left again; no farther
        # than it is thick, or another part would be passed
        ahead = tiny / speed
        while s + ahead < 1 and ahead * speed < thin:
            g = gap(c, place_on(v, p, type(p.x)(s + ahead)))
            if g < -slack:
                return type(p.x)(s + ahead)
            if g > 8 * slack:
                break
            ahead = 2 * ahead
        begin = s + ahead
        if not begin < 1:
            return one
    return one
