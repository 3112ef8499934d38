"""How the accounts of `engine.books` are kept while islands step, one step at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.bonding import Bonds
from particlesim.engine.books import Books, accelerations, damping, halfway, halfway_between
from particlesim.engine.columns import Clock, Columns
from particlesim.engine.driving import Driven
from particlesim.engine.measure import bond_energy
from particlesim.graph import Island

Floats = NDArray[np.float64]


class Opened(NamedTuple):
    """A step that has begun: the state, when each particle begins and for how long it moves [s], and the end of the step
    without contact (None: nothing can be touched); the energy that rods have given to led ends in that free step [J]."""

    columns: Columns
    begin: Floats
    h: Floats
    free: Columns | None
    effort: float = 0.0


def spans(clock: Clock | None, number: int, t: float, end: float) -> tuple[Floats, Floats]:
    """When every particle begins to move in the step [t, end], and for how long; 0 for those that do not."""
    if clock is None:
        return np.full(number, t), np.full(number, end - t)
    begin = np.maximum(clock.start, t)
    h = np.maximum(np.minimum(clock.stop, end) - begin, 0.0)
    return np.where(h > 0, begin, t), h


class ParticleBooks:
    """The accounts of a group of independent particles."""

    def __init__(self, books: Books, structure: Island, forces: Any) -> None:
        self.books = books
        self._forces = forces
        self._contact = "contact" in books.names
        self._mortal = "deaths" in books.names

    def born(self, columns: Columns, number: int, times: Floats) -> None:
        """Book what the last `number` particles bring, born at some times [s]."""
        if number:
            low = len(columns.m) - number
            at = np.concatenate([np.zeros(low), times])
            self.books.add("births", float(self.books.energies(0, columns, at)[low:].sum()))

    def close(self, step: Opened, columns: Columns, driven: tuple[Driven, ...], end: float) -> None:
        """Book a step that has been taken to the state `columns` at the time `end` [s], the dead among them."""
        books, finish = self.books, step.begin + step.h
        path = columns if step.free is None else step.free
        if books.spends(0):
            a0 = accelerations(self._forces, step.columns, step.begin)
            a1 = accelerations(self._forces, path, finish)
            middle = halfway(step.columns, path, a0, a1, step.h)
            states = ((step.columns, step.begin), (middle, step.begin + step.h / 2), (path, finish))
            books.book_powers(0, [books.powers(0, c, t) for c, t in states], step.h)
        if not (self._contact or self._mortal or driven):
            return
        now = books.energies(0, columns, finish)
        if self._contact:
            books.add("contact", float((now - books.energies(0, path, finish)).sum()))
        for each in driven:
            before = books.energies(0, step.columns, step.begin)
            books.add("motion", float((now - before)[each.rows].sum()))
        if self._mortal and columns.clock is not None:
            books.add("deaths", -float(now[columns.clock.stop <= end].sum()))


class SpringBooks:
    """The accounts of an island of springs.

    `bounds` are the borders of its groups; `forces` gives its total forces in a state, and `hinged` the energy of its
    hinges there [J].
    """

    def __init__(
        self,
        books: Books,
        structure: Island,
        bounds: list[int],
        driven: tuple[Driven, ...],
        forces: Callable[..., Floats],
        hinged: Callable[[Columns], float],
    ) -> None:
        self.books = books
        self._bounds, self._forces, self._hinged = bounds, forces, hinged
        self._surfaces = any(structure.surfaces)
        self._rods = bool(structure.rods)
        self._driven = np.concatenate([each.rows for each in driven]) if driven else np.zeros(0, np.int64)
        self._members = range(len(structure.groups))
        self._names = [bonds.name for bonds in structure.bonds]
        self._damped = [bonds.law.damped for bonds in structure.bonds]
        self._contact = "contact" in books.names

    def close(
        self,
        step: Opened,
        columns: Columns,
        bonds: tuple[Bonds, ...],
        parts: Callable[[Columns], list[Columns]],
        end: float,
        effort: float = 0.0,
    ) -> None:
        """Book a step that has been taken to the state `columns` at the time `end` [s]; `bonds` are as before it, and
        `parts` cuts columns into those of the groups. `effort` is what rods have given to led ends [J]."""
        books, path = self.books, columns if step.free is None else step.free
        start = float(step.begin.min(initial=end))
        if (
            self._surfaces
            or any(self._damped)
            or self._driven.size
            or any(books.spends(k) for k in self._members)
        ):
            f0, f1 = self._forces(step.columns, bonds, start), self._forces(path, bonds, end)
            if self._rods:  # whose forces are not among these
                middle = halfway_between(step.columns, path, step.h)
            else:
                middle = halfway(step.columns, path, f0 / columns.m, f1 / columns.m, step.h)
            fm = self._forces(
                middle, bonds, (start + end) / 2
            )  # which also puts led particles where they are then
            states = ((step.columns, start), (middle, (start + end) / 2), (path, end))
            for k in self._members:
                if books.spends(k):
                    h = step.h[self._bounds[k] : self._bounds[k + 1]]
                    powers = [books.powers(k, parts(c)[k], np.full(len(h), t)) for c, t in states]
                    books.book_powers(k, powers, h)
            self._book_damping([c for c, _ in states], bonds, end - start)
            self._book_motion([c for c, _ in states], (f0, fm, f1), end - start)
            if self._driven.size and self._rods:
                books.add("motion", -effort)
            if self._surfaces:
                bare = [self._forces(c, bonds, t, corners=False) for c, t in states]
                pulls = tuple(f - g for f, g in zip((f0, fm, f1), bare, strict=True))
                self._book_surfaces([c for c, _ in states], pulls, end - start)
        if self._contact:
            books.add(
                "contact", self._energy(columns, bonds, parts, end) - self._energy(path, bonds, parts, end)
            )

    def book_breaking(self, before: tuple[Bonds, ...], after: tuple[Bonds, ...], columns: Columns) -> None:
        """Book the potential that was lost with springs that broke at the end of a step."""
        for name, old, new in zip(self._names, before, after, strict=True):
            if new.breaking is not None and not np.array_equal(old.breaking.when, new.breaking.when):
                left, was = bond_energy((new, old), columns)
                self.books.add(f"{name}.breaking", left - was)

    def _book_damping(self, states: list[Columns], bonds: tuple[Bonds, ...], h: float) -> None:
        damped = [bond for bond, yes in zip(bonds, self._damped, strict=True) if yes]
        begin, middle, finish = (damping(damped, c) for c in states)
        names = [name for name, yes in zip(self._names, self._damped, strict=True) if yes]
        for name, joule in zip(names, h / 6 * (begin + 4 * middle + finish), strict=True):
            self.books.add(name, float(joule))

    def _book_motion(self, states: list[Columns], forces: tuple[Floats, Floats, Floats], h: float) -> None:
        """What leads particles along their paths gives them their kinetic energy, and holds against all forces on them."""
        rows = self._driven
        if not rows.size:
            return
        velocities = [np.stack([c.vx[rows], c.vy[rows], c.vz[rows]]).astype(float) for c in states]
        begin, middle, finish = (
            float((f[:, rows] * v).sum()) for f, v in zip(forces, velocities, strict=True)
        )
        m = states[0].m[rows].astype(float)
        kinetic = [0.5 * float((m * (v * v).sum(axis=0)).sum()) for v in (velocities[0], velocities[2])]
        self.books.add("motion", kinetic[1] - kinetic[0] - h / 6 * (begin + 4 * middle + finish))

    def _book_surfaces(self, states: list[Columns], pulls: tuple[Floats, ...], h: float) -> None:
        """Work on surfaces: that of all forces at corners, but for what goes into hinges."""
        begin, middle, finish = (
            float((f[0] * c.vx + f[1] * c.vy + f[2] * c.vz).sum()) for f, c in zip(pulls, states, strict=True)
        )
        stored = self._hinged(states[2]) - self._hinged(states[0])
        self.books.add("surfaces", h / 6 * (begin + 4 * middle + finish) + stored)

    def _energy(
        self,
        columns: Columns,
        bonds: tuple[Bonds, ...],
        parts: Callable[[Columns], list[Columns]],
        time: float,
    ) -> float:
        total = sum(bond_energy(bonds, columns)) + self._hinged(columns)
        for k, part in enumerate(parts(columns)):
            total += float(self.books.energies(k, part, np.full(len(part.m), time)).sum())
        return total
