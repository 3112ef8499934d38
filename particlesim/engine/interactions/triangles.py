"""Drag on the triangles of surfaces, a third of it at each corner.

Every thread takes all that have a corner among its particles, as with hinges. To the matrix of implicit methods every
triangle adds −∂f/∂v, a ninth of it between any two of its corners. The change of the force as the triangle rotates is left
out: it is not symmetric.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.compiler import kernel
from particlesim.engine.interactions.element_tensors import CornerTensors
from particlesim.engine.interactions.interaction import (
    Floats,
    Interaction,
    Ints,
    Site,
    all_states,
    clear_form,
    give,
    is_gone,
    rows_after,
    rows_between,
    states_of,
)
from particlesim.engine.step.records import as_precision
from particlesim.forces.sheet_drag import SurfaceSet, Triangle
from particlesim.laws.registry import Particle, triangle_force, triangle_force_dv
from particlesim.layouts.mesh import is_closed, require_manifold

LOOKED_AT = 2_000
"""Triangles whose drag is looked at, evenly spread; the others count as the one before them does, by their area."""


class TriangleColumns(NamedTuple):
    """Triangles of a surface under one force: rows of the corners [3, n]; `mortal` is None where these do not die."""

    law: tuple[Any, ...]
    rows: Any
    mortal: Any = None


class Triangles(Interaction, TriangleColumns):
    """Triangles of a surface under one force: rows of the corners [3, n]."""

    __slots__ = ()
    internal: ClassVar[bool] = False
    numbers: ClassVar[int] = 6
    """A ninth of −∂f/∂v as xx, yy, zz, xy, xz, yz."""
    follows: ClassVar[frozenset[str]] = frozenset(TriangleColumns._fields)
    spends_as: ClassVar[str | None] = "surfaces"

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                continue
            fx, fy, fz = triangle_force(self.law, triangle(self, c, q, t))
            for corner in range(3):
                give(total, self.rows[corner, q], first, last, fx / 3, fy / 3, fz / 3)

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                clear_form(form, q)
                continue
            g = triangle_force_dv(self.law, triangle(self, c, q, t))
            form[0, q], form[1, q], form[2, q] = -g[0] / 9, -g[4] / 9, -g[8] / 9
            form[3, q], form[4, q], form[5, q] = -g[1] / 9, -g[2] / 9, -g[5] / 9
            for corner in range(3):
                i = self.rows[corner, q]
                if first <= i < last:
                    for row in range(6):
                        s.block[row, i] += form[row, q]

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        for q in range(self.rows.shape[1]):
            i, j, k = self.rows[0, q], self.rows[1, q], self.rows[2, q]
            g = form[:, q]
            ux, uy, uz = x[0, i] + x[0, j] + x[0, k], x[1, i] + x[1, j] + x[1, k], x[2, i] + x[2, j] + x[2, k]
            fx = g[0] * ux + g[3] * uy + g[4] * uz
            fy = g[3] * ux + g[1] * uy + g[5] * uz
            fz = g[4] * ux + g[5] * uy + g[2] * uz
            give(y, i, first, last, fx, fy, fz)
            give(y, j, first, last, fx, fy, fz)
            give(y, k, first, last, fx, fy, fz)

    @property
    def number(self) -> int:
        return int(self.rows.shape[1])

    @property
    def effort(self) -> int:
        return int(self.rows.size)

    def between(self, first: int, last: int) -> Self:
        mine = rows_between(self.rows, first, last)
        return self._replace(rows=np.ascontiguousarray(self.rows[:, mine]))

    def laid_again(self, site: Site, place: Ints) -> Self:
        return self._replace(rows=rows_after(self.rows, place)[0])

    @property
    def spends(self) -> bool:
        return True

    def power(self, c: Any, t: float) -> float:
        return float(sum_powers(self, c, t))

    def linearise(self, c: Any, t: float) -> CornerTensors:
        x, v = all_states(c)
        corners = x[:, self.rows]  # [3, corners, n]
        area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0).T
        middle, mean = corners.mean(axis=1).T, v[:, self.rows].mean(axis=1).T
        stride = -(-len(area) // LOOKED_AT)
        size = np.linalg.norm(area, axis=1)
        found = np.zeros((len(area), 3, 3))
        for k in range(0, len(area), stride):
            (ax, ay, az), (x, y, z), (vx, vy, vz) = area[k], middle[k], mean[k]
            plate = Triangle(ax, ay, az, Particle(x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, t))
            drag = -np.reshape(triangle_force_dv(self.law, plate), (3, 3)) / 9
            part = size[k : k + stride] / size[k] if size[k] > 0 else np.zeros(len(size[k : k + stride]))
            found[k : k + stride] = part[:, None, None] * drag
        return CornerTensors(self.rows, np.zeros((0, len(area), 3, 3)), found)

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        total = np.zeros(3)
        for q in np.flatnonzero((self.rows == row).any(axis=0)):
            x, v = states_of(c, self.rows[:, q])
            ax, ay, az = np.cross(x[1] - x[0], x[2] - x[0]) / 2
            middle = Particle(*(float(u) for u in (*x.mean(axis=0), *v.mean(axis=0), 0, 0, 0, t)))
            total += np.array(triangle_force(self.law, Triangle(ax, ay, az, middle))) / 3
        return total


def triangles_of(site: Site, surface: SurfaceSet) -> Triangles:
    """The triangles of a group's surface, in the order of their first corners. Raises UsageError for one that folds onto
    itself."""
    group = next(group for group in site.scenario.particles if group.name == surface.group)
    triangles = group.layout.open(site.scenario.folder).triangles()
    require_manifold(triangles, surface.group)
    order = np.argsort(triangles.min(axis=1), kind="stable")
    rows = np.ascontiguousarray(triangles[order].T + site.offset[surface.group])
    law = as_precision(surface.law.surface_record(is_closed(triangles)), site.dtype)
    return Triangles(law, rows, True if site.mortal(surface.group) else None)


def triangle(each: Any, c: Any, q: Any, t: Any) -> Any:
    """Triangle q as laws see it."""
    i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
    ax, ay, az = c.x[j] - c.x[i], c.y[j] - c.y[i], c.z[j] - c.z[i]
    bx, by, bz = c.x[k] - c.x[i], c.y[k] - c.y[i], c.z[k] - c.z[i]
    middle = Particle(
        c.x[i] + (ax + bx) / 3,
        c.y[i] + (ay + by) / 3,
        c.z[i] + (az + bz) / 3,
        (c.vx[i] + c.vx[j] + c.vx[k]) / 3,
        (c.vy[i] + c.vy[j] + c.vy[k]) / 3,
        (c.vz[i] + c.vz[j] + c.vz[k]) / 3,
        c.m[i] - c.m[i],
        c.m[i] - c.m[i],
        c.m[i] - c.m[i],
        t,
    )
    return Triangle((ay * bz - az * by) / 2, (az * bx - ax * bz) / 2, (ax * by - ay * bx) / 2, middle)


@kernel
def sum_powers(each: Any, c: Any, t: Any) -> float:
    """Power of the forces on all triangles of a set [W]."""
    total = 0.0
    for q in range(each.rows.shape[1]):
        if is_gone(each, c, q):
            continue
        plate = triangle(each, c, q, t)
        fx, fy, fz = triangle_force(each.law, plate)
        p = plate.middle
        total += float(fx) * float(p.vx) + float(fy) * float(p.vy) + float(fz) * float(p.vz)
    return total
