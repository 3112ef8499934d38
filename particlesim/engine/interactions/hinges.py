"""Angles and dihedrals, which resist bending: forces among three and four particles.

Every thread takes all that have a corner among its particles, in one order, and adds to its own particles alone. Those with
corners of several threads are computed by each of them; in return no thread waits for another, and sums have the same bits
for any number of threads.

To the matrix of implicit methods each adds γ times the positive part of its second derivatives, which is one product w wᵀ
for a dihedral and two for an angle (`particlesim.bonds.hinge`), with w a vector on its three or four particles that sums to
zero. Left out are the terms that may be negative: a negative stiffness U'', and the rest of U' times the second derivatives
of the angle. Forces are complete, so that a converged step solves the equations of the method all the same.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.bonds import HingeSet
from particlesim.bonds.hinge import angle_forms, angle_gradient, angles_at, dihedral_gradient, wrapped
from particlesim.compiler import kernel
from particlesim.engine.interactions.element_tensors import CornerTensors, angle_forms_of, fold_gradient_of
from particlesim.engine.interactions.interaction import (
    Floats,
    Interaction,
    Ints,
    Site,
    add_square,
    all_states,
    clear_form,
    give,
    is_gone,
    rows_after,
    rows_between,
    states_of,
    take,
)
from particlesim.engine.step.records import as_precision
from particlesim.errors import UsageError
from particlesim.laws.registry import hinge_energy, hinge_moment, hinge_stiffness


class HingeColumns(NamedTuple):
    """Hinges of one law: rows of their particles [3 or 4, n], and rest angles [rad], [n]; `mortal` is None where these do
    not die."""

    law: tuple[Any, ...]
    rows: Any
    rest: Any
    mortal: Any = None


class Hinges(Interaction, HingeColumns):
    """The base of angles and dihedrals."""

    __slots__ = ()
    follows: ClassVar[frozenset[str]] = frozenset(HingeColumns._fields)

    def forms_of(self, stiffness: Floats, moment: Floats, points: list[Floats]) -> Floats:
        """The vectors w of all [m, n, corners, 3], from U'' and U' and the places of the corners, [n, 3] each."""
        raise NotImplementedError

    def gradients_of(self, x: Floats) -> tuple[float, Floats]:
        """The angle of particles at x [corners, 3], and its gradients by them."""
        raise NotImplementedError

    @property
    def number(self) -> int:
        return int(self.rows.shape[1])

    @property
    def effort(self) -> int:
        return int(self.rows.size)

    def between(self, first: int, last: int) -> Self:
        mine = rows_between(self.rows, first, last)
        return self._replace(rows=np.ascontiguousarray(self.rows[:, mine]), rest=self.rest[mine])

    def laid_again(self, site: Site, place: Ints) -> Self:
        rows, left = rows_after(self.rows, place)
        return self._replace(rows=rows, rest=self.rest[left])

    def energy(self, c: Any, t: float) -> float:
        return float(sum_hinges(self, c))

    def linearise(self, c: Any, t: float) -> CornerTensors:
        x, _ = all_states(c)
        number = self.number
        deviation = wrapped(angles_at(x, self.rows.T) - self.rest)
        stiffness = np.broadcast_to(np.maximum(hinge_stiffness(self.law, deviation), 0.0), number)
        points = [x[:, row].T for row in self.rows]
        moment = np.asarray(hinge_moment(self.law, deviation))
        return CornerTensors(self.rows, self.forms_of(stiffness, moment, points), np.zeros((number, 3, 3)))

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        total = np.zeros(3)
        for q in np.flatnonzero((self.rows == row).any(axis=0)):
            x, _ = states_of(c, self.rows[:, q])
            corner = int(np.flatnonzero(self.rows[:, q] == row)[0])
            angle, gradients = self.gradients_of(x)
            moment = hinge_moment(self.law, np.float64(wrapped(angle - float(self.rest[q]))))
            total += -moment * gradients[corner]
        return total


class Angles(Hinges):
    """Angles of one law: rows of the particles [3, n], the angle at the second; rest angles [rad], [n]."""

    __slots__ = ()
    numbers: ClassVar[int] = 12
    """w and p by a and b."""

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                continue
            d, g = bent(self, c, q)
            s = -hinge_moment(self.law, d)
            ax, ay, az = s * g[1], s * g[2], s * g[3]
            bx, by, bz = s * g[4], s * g[5], s * g[6]
            give(total, self.rows[0, q], first, last, ax, ay, az)
            give(total, self.rows[1, q], first, last, -(ax + bx), -(ay + by), -(az + bz))
            give(total, self.rows[2, q], first, last, bx, by, bz)

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                clear_form(form, q)
                continue
            i, j, k = self.rows[0, q], self.rows[1, q], self.rows[2, q]
            d, _ = bent(self, c, q)
            stiff = max(hinge_stiffness(self.law, d), d - d)
            w = angle_forms(
                reach * stiff,
                reach * hinge_moment(self.law, d),
                c.x[i] - c.x[j],
                c.y[i] - c.y[j],
                c.z[i] - c.z[j],
                c.x[k] - c.x[j],
                c.y[k] - c.y[j],
                c.z[k] - c.z[j],
            )
            for row, entry in enumerate(w):
                form[row, q] = entry
            for ax, ay, az, bx, by, bz in (w[:6], w[6:]):
                add_square(s, i, first, last, ax, ay, az)
                add_square(s, j, first, last, ax + bx, ay + by, az + bz)
                add_square(s, k, first, last, bx, by, bz)
            ax, ay, az, bx, by, bz = angle_times(self, form, s.lead, q)
            take(s, i, first, last, ax, ay, az)
            take(s, j, first, last, -(ax + bx), -(ay + by), -(az + bz))
            take(s, k, first, last, bx, by, bz)

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        for q in range(self.rows.shape[1]):
            ax, ay, az, bx, by, bz = angle_times(self, form, x, q)
            give(y, self.rows[0, q], first, last, ax, ay, az)
            give(y, self.rows[1, q], first, last, -(ax + bx), -(ay + by), -(az + bz))
            give(y, self.rows[2, q], first, last, bx, by, bz)

    def forms_of(self, stiffness: Floats, moment: Floats, points: list[Floats]) -> Floats:
        return angle_forms_of(stiffness, moment, points)

    def gradients_of(self, x: Floats) -> tuple[float, Floats]:
        angle, *slopes = angle_gradient(*(x[0] - x[1]), *(x[2] - x[1]))
        a, b = np.array(slopes).reshape(2, 3)
        return angle, np.array([a, -(a + b), b])


class Dihedrals(Hinges):
    """Dihedrals of one law: rows of the particles [4, n], the edge from the second to the third; rest folds [rad], [n]."""

    __slots__ = ()
    numbers: ClassVar[int] = 9
    """w by x₁, x₂ and x₄."""

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                continue
            d, g = bent(self, c, q)
            s = -hinge_moment(self.law, d)
            ax, ay, az = s * g[1], s * g[2], s * g[3]
            bx, by, bz = s * g[4], s * g[5], s * g[6]
            dx, dy, dz = s * g[7], s * g[8], s * g[9]
            give(total, self.rows[0, q], first, last, ax, ay, az)
            give(total, self.rows[1, q], first, last, bx, by, bz)
            give(total, self.rows[2, q], first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
            give(total, self.rows[3, q], first, last, dx, dy, dz)

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        for q in range(self.rows.shape[1]):
            if is_gone(self, c, q):
                clear_form(form, q)
                continue
            i, j, k, m = self.rows[0, q], self.rows[1, q], self.rows[2, q], self.rows[3, q]
            d, g = bent(self, c, q)
            root = np.sqrt(reach * max(hinge_stiffness(self.law, d), d - d))
            for row, entry in enumerate(g[1:]):
                form[row, q] = root * entry
            w = form[:, q]
            add_square(s, i, first, last, w[0], w[1], w[2])
            add_square(s, j, first, last, w[3], w[4], w[5])
            add_square(s, k, first, last, w[0] + w[3] + w[6], w[1] + w[4] + w[7], w[2] + w[5] + w[8])
            add_square(s, m, first, last, w[6], w[7], w[8])
            ax, ay, az, bx, by, bz, dx, dy, dz = dihedral_times(self, form, s.lead, q)
            take(s, i, first, last, ax, ay, az)
            take(s, j, first, last, bx, by, bz)
            take(s, k, first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
            take(s, m, first, last, dx, dy, dz)

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        for q in range(self.rows.shape[1]):
            ax, ay, az, bx, by, bz, dx, dy, dz = dihedral_times(self, form, x, q)
            give(y, self.rows[0, q], first, last, ax, ay, az)
            give(y, self.rows[1, q], first, last, bx, by, bz)
            give(y, self.rows[2, q], first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
            give(y, self.rows[3, q], first, last, dx, dy, dz)

    def forms_of(self, stiffness: Floats, moment: Floats, points: list[Floats]) -> Floats:
        return np.asarray(np.sqrt(stiffness)[:, None, None] * fold_gradient_of(points)[None])

    def gradients_of(self, x: Floats) -> tuple[float, Floats]:
        angle, *slopes = dihedral_gradient(*(x[0] - x[1]), *(x[1] - x[2]), *(x[3] - x[2]))
        a, b, d = np.array(slopes).reshape(3, 3)
        return angle, np.array([a, b, -(a + b + d), d])


def hinges_of(site: Site, hinges: HingeSet) -> Angles | Dihedrals:
    """Angles or dihedrals in the order of their first particles. Raises UsageError for those that cannot be."""
    count, offset = site.state[hinges.group].count, site.offset[hinges.group]
    rows = hinges.find()
    if rows.size and rows.max() >= count:
        raise UsageError(
            f"{hinges.name}: {hinges.group!r} has {count} particles, there is no particle {int(rows.max())}"
        )
    rows = rows[np.argsort(rows.min(axis=1), kind="stable")] + offset
    x = site.place
    for end in (0, 2) if hinges.size == 3 else ():
        same = (x[:, rows[:, end]] == x[:, rows[:, 1]]).all(axis=0)
        if same.any():
            a, b, c = (int(row) - offset for row in rows[same.argmax()])
            raise UsageError(
                f"{hinges.name}: the angle of particles {a}, {b} and {c} has no size, as {(a, c)[end // 2]} and {b} are "
                "at the same place"
            )
    rest = angles_at(x, rows)
    if hinges.rest is not None:
        rest = np.full(len(rows), hinges.rest)
    kind = Angles if hinges.size == 3 else Dihedrals
    law, mortal = as_precision(hinges.law, site.dtype), True if site.mortal(hinges.group) else None
    return kind(law, np.ascontiguousarray(rows.T), rest.astype(site.dtype), mortal)


def bent(each: Any, c: Any, q: Any) -> Any:
    """Angle or dihedral q: the deviation from its rest angle [rad], and the gradients as `bonds.hinge` gives them."""
    if isinstance(each, Angles):
        i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
        g = angle_gradient(
            c.x[i] - c.x[j],
            c.y[i] - c.y[j],
            c.z[i] - c.z[j],
            c.x[k] - c.x[j],
            c.y[k] - c.y[j],
            c.z[k] - c.z[j],
        )
        return wrapped(g[0] - each.rest[q]), g
    i, j, k, m = each.rows[0, q], each.rows[1, q], each.rows[2, q], each.rows[3, q]
    fold = dihedral_gradient(
        c.x[i] - c.x[j],
        c.y[i] - c.y[j],
        c.z[i] - c.z[j],
        c.x[j] - c.x[k],
        c.y[j] - c.y[k],
        c.z[j] - c.z[k],
        c.x[m] - c.x[k],
        c.y[m] - c.y[k],
        c.z[m] - c.z[k],
    )
    return wrapped(fold[0] - each.rest[q]), fold


def angle_times(each: Any, form: Any, x: Any, q: Any) -> Any:
    """The matrix of an angle times x [3, particles]: its rows for the first particle and the third."""
    i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
    ax, ay, az = x[0, i] - x[0, j], x[1, i] - x[1, j], x[2, i] - x[2, j]
    bx, by, bz = x[0, k] - x[0, j], x[1, k] - x[1, j], x[2, k] - x[2, j]
    w, p = form[0:6, q], form[6:12, q]
    u = w[0] * ax + w[1] * ay + w[2] * az + w[3] * bx + w[4] * by + w[5] * bz
    v = p[0] * ax + p[1] * ay + p[2] * az + p[3] * bx + p[4] * by + p[5] * bz
    return (
        u * w[0] + v * p[0],
        u * w[1] + v * p[1],
        u * w[2] + v * p[2],
        u * w[3] + v * p[3],
        u * w[4] + v * p[4],
        u * w[5] + v * p[5],
    )


def dihedral_times(each: Any, form: Any, x: Any, q: Any) -> Any:
    """The matrix of a dihedral times x: its rows for the first, second and fourth particle."""
    i, j, k, m = each.rows[0, q], each.rows[1, q], each.rows[2, q], each.rows[3, q]
    w, u = form[:, q], x[0, i] - x[0, i]
    for axis in range(3):
        base = x[axis, k]
        u += w[axis] * (x[axis, i] - base)
        u += w[3 + axis] * (x[axis, j] - base)
        u += w[6 + axis] * (x[axis, m] - base)
    return u * w[0], u * w[1], u * w[2], u * w[3], u * w[4], u * w[5], u * w[6], u * w[7], u * w[8]


@kernel
def sum_hinges(each: Any, c: Any) -> float:
    """Potential energy of a set of angles or dihedrals [J]."""
    total = 0.0
    for q in range(each.rows.shape[1]):
        d, _ = bent(each, c, q)
        total += hinge_energy(each.law, d)
    return total
