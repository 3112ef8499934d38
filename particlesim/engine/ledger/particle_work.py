"""The work of `ledger.work`, computed and added up while islands step, one step at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.interaction import Interaction
from particlesim.engine.ledger.work import (
    SIMPSON,
    Books,
    accelerations,
    halfway,
    halfway_between,
    met_jolts,
    moved,
    turned,
    weighted,
)
from particlesim.engine.state.columns import Clock, Columns, in_step, mapped
from particlesim.engine.state.prescribed import Driven, drive_to
from particlesim.graph.graph import Island
from particlesim.integrators import EmbeddedRungeKutta

Floats = NDArray[np.float64]

LENIENT = np.errstate(over="ignore", invalid="ignore")
"""Divergence is found where the ledger is checked."""


class Opened(NamedTuple):
    """A step that has begun: the state, when each particle begins and for how long it moves [s], and the end of the step
    without contact (None: nothing can be touched). `path`: states on the way, if the method told them; `interactions` as
    they were before it. `effort`: the energy that rods have given to led ends in that free step [J]. `since`: when the step
    of an island begins, in the middle of which particles may be born [s]."""

    columns: Columns
    begin: Floats
    h: Floats
    free: Columns | None
    path: tuple[Moment, ...] = ()
    interactions: tuple[Interaction, ...] = ()
    effort: float = 0.0
    since: float = 0.0


class Moment(NamedTuple):
    """A state on the way of a step, when that is [s], and its weight in an integral over the step of length 1."""

    columns: Columns
    time: float
    weight: float


class Legs(NamedTuple):
    """Own steps of independent particles: rows [n], beginnings and lengths [s], shape [n], and position and velocity at the
    beginning, at the end without contact, and with it, shape [6, n] each."""

    rows: NDArray[np.intp]
    begin: Floats
    h: Floats
    start: Floats
    free: Floats
    end: Floats


def spans(clock: Clock | None, number: int, t: float, end: float) -> tuple[Floats, Floats]:
    """When every particle begins to move in the step [t, end], and for how long; 0 for those that do not."""
    if clock is None:
        return np.full(number, t), np.full(number, end - t)
    begin = np.maximum(clock.start, t)
    h = np.maximum(np.minimum(clock.stop, end) - begin, 0.0)
    return np.where(h > 0, begin, t), h


class ParticleBooks:
    """The accounts of a group of independent particles."""

    def __init__(self, books: Books, forces: Any) -> None:
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

    @LENIENT
    def book_step(self, step: Opened, columns: Columns) -> None:
        """Book the work of forces and contact in a step that has been taken to the state `columns`."""
        books, finish = self.books, step.begin + step.h
        path = columns if step.free is None else step.free
        if books.spends(0):
            a0 = accelerations(self._forces, step.columns, step.begin)
            a1 = accelerations(self._forces, path, finish)
            middle = halfway(step.columns, path, a0, a1, step.h)
            states = ((step.columns, step.begin), (middle, step.begin + step.h / 2), (path, finish))
            books.book_powers(0, [books.powers(0, c, t) for c, t in states], SIMPSON, step.h)
        if self._contact:
            change = books.energies(0, columns, finish) - books.energies(0, path, finish)
            books.add("contact", float(change.sum()) - met_jolts(path, columns, books.jolts, step.h))

    @LENIENT
    def book_legs(self, legs: Legs, columns: Columns, method: EmbeddedRungeKutta) -> None:
        """Book the work of forces and contact in own steps of particles of a group with these columns."""
        books, here = self.books, picked(columns, legs.rows)
        if books.spends(0):
            powers: list[Floats] = []
            slopes: list[Floats] = []
            for row, c in zip(method.a, method.c, strict=True):
                ahead = legs.h * weighted(row, slopes) if row else np.zeros_like(legs.start)
                state, times = moved(here, legs.start, ahead), legs.begin + c * legs.h
                velocity = np.stack([state.vx, state.vy, state.vz]).astype(float)
                slopes.append(np.concatenate([velocity, accelerations(self._forces, state, times)]))
                powers.append(books.powers(0, state, times))
            books.book_powers(0, powers, method.b, legs.h)
        touched = np.flatnonzero((legs.free != legs.end).any(axis=0))
        if touched.size:
            met, times = picked(columns, legs.rows[touched]), (legs.begin + legs.h)[touched]
            before, after = (
                books.energies(0, moved(met, states[:, touched], np.zeros((6, 1))), times)
                for states in (legs.free, legs.end)
            )
            books.add("contact", float((after - before).sum()))

    @LENIENT
    def close(self, step: Opened, columns: Columns, driven: tuple[Driven, ...], end: float) -> None:
        """Book what motions and deaths did in a step that has been taken to the time `end` [s], the dead still there."""
        if not (self._mortal or driven):
            return
        books, finish = self.books, step.begin + step.h
        now = books.energies(0, columns, finish)
        spent = (
            self._book_led(step, columns, driven, end) if driven and books.spends(0) else np.zeros_like(now)
        )
        for each in driven:
            before = books.energies(0, step.columns, step.begin)
            books.add("motion", float((now - before - spent)[each.rows].sum()))
        if self._mortal and columns.clock is not None:
            books.add("deaths", -float(now[columns.clock.stop <= end].sum()))

    def _book_led(self, step: Opened, columns: Columns, driven: tuple[Driven, ...], end: float) -> Floats:
        """Book what forces do on led particles, which move though no force moves them; returns it [J], shape [n]."""
        rows = np.concatenate([each.rows for each in driven])
        h = np.zeros(len(columns.m))
        h[rows] = end - step.begin[rows]
        middle = led(driven, columns, end - h[rows[0]] / 2)
        states = ((step.columns, step.begin), (middle, step.begin + h / 2), (columns, step.begin + h))
        return self.books.book_powers(0, [self.books.powers(0, c, t) for c, t in states], SIMPSON, h)


def led(driven: tuple[Driven, ...], columns: Columns, time: float) -> Columns:
    """The columns with led particles where they are at a time [s]."""
    x = np.stack([columns.x, columns.y, columns.z])
    v = np.stack([columns.vx, columns.vy, columns.vz])
    drive_to(driven, x, v, time)
    return columns._replace(x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])


def picked(c: Columns, rows: NDArray[np.intp]) -> Columns:
    """Copies of some rows of columns."""
    return mapped(lambda array: array[rows], c)


def stages(
    before: Columns,
    states: tuple[Floats, Floats],
    span: tuple[float, float],
    h: Floats,
    method: EmbeddedRungeKutta,
) -> tuple[Moment, ...]:
    """The stages of a step that count, from the states at its beginning [6, n] and the slopes [stages, 6, n]."""
    (start, slopes), (begin, end) = states, span
    found = []
    for k, (row, c, weight) in enumerate(zip(method.a, method.c, method.b, strict=True)):
        if weight:
            ahead = h * weighted(row, list(slopes[:k])) if row else np.zeros_like(start)
            found.append(Moment(moved(before, start, ahead), begin + c * (end - begin), weight))
    return tuple(found)


class IslandBooks:
    """The accounts of an island whose particles act on each other.

    `bounds` are the borders of its groups, `names` those of its interactions; `forces` gives its total forces in a state.
    """

    def __init__(
        self,
        books: Books,
        structure: Island,
        bounds: list[int],
        driven: tuple[Driven, ...],
        names: tuple[str, ...],
        forces: Callable[..., Floats],
    ) -> None:
        self.books = books
        self._bounds, self._names, self._forces = bounds, names, forces
        self._held = bool(structure.constraints)
        self._driven = np.concatenate([each.rows for each in driven]) if driven else np.zeros(0, np.int64)
        self._members = range(len(structure.groups))
        self._contact = "contact" in books.names

    @LENIENT
    def close(
        self,
        step: Opened,
        columns: Columns,
        interactions: tuple[Interaction, ...],
        parts: Callable[[Columns], list[Columns]],
        end: float,
        effort: float,
        stored: Callable[[Sequence[Columns]], list[float]],
    ) -> None:
        """Book a step that has been taken to the state `columns` at the time `end` [s]; `interactions` are as before it, and
        `parts` cuts columns into those of the groups. `effort` is what rods have given to led ends [J], and `stored` tells
        what interactions have stored in two states, up to what both have in common [J]."""
        books, path = self.books, columns if step.free is None else step.free
        start, clock = step.since, step.columns.clock

        def within(
            c: Columns,
        ) -> Columns:  # particles act for the part of the step in which they are there, as in motion
            return in_step(c if clock is None else c._replace(clock=clock), start, end)

        if (
            any(each.spends for each in interactions)
            or self._driven.size
            or any(books.spends(k) for k in self._members)
        ):
            moments = step.path or self._halfway(step, path, interactions, (start, end), within)
            weights = [moment.weight for moment in moments]
            acting = [moment._replace(columns=within(moment.columns)) for moment in moments]
            forces = [
                self._forces(c, interactions, t) for c, t, _ in acting
            ]  # puts led particles where they are then
            moving = step.h.copy()
            moving[self._driven] = end - start  # nothing moves them, and yet forces work on them
            for k in self._members:
                if books.spends(k):
                    h = moving[self._bounds[k] : self._bounds[k + 1]]
                    powers = [books.powers(k, parts(c)[k], np.full(len(h), t)) for c, t, _ in moments]
                    books.book_powers(k, powers, weights, h)
            self._book_spent(acting, interactions, end - start)
            self._book_motion(moments, forces, (step.columns, path), end - start)
            if self._driven.size and self._held:
                books.add("motion", -effort)
        if self._contact:
            now, without = (
                self._energy(c, potential, parts, end)
                for c, potential in zip((columns, path), stored((columns, path)), strict=True)
            )
            books.add(
                "contact",
                now - without - met_jolts(path, columns, books.jolts, np.full(columns.x.size, end - start)),
            )

    @LENIENT
    def book_breaking(
        self, before: tuple[Interaction, ...], after: tuple[Interaction, ...], columns: Columns, end: float
    ) -> None:
        """Book the potential that was lost with what broke at the `end` of a step [s], on its own or with particles that
        died, and with contacts that snapped together or apart."""
        for name, old, new in zip(self._names, before, after, strict=True):
            if (snap := new.snapped(old, columns)) != 0:
                self.books.add(name, snap)
            then, now = old.broke, new.broke
            if then is not None and now is not None and not np.array_equal(then, now):
                living = old.without_dead(new, columns)
                left, was = (each.energy(columns, end) or 0.0 for each in (new, living))
                if f"{name}.breaking" in self.books.names:
                    self.books.add(f"{name}.breaking", left - was)
                if living is not old:
                    self.books.add("deaths", was - (old.energy(columns, end) or 0.0))

    @LENIENT
    def book_births(self, parts: Sequence[Columns], born: Sequence[int], stored: float) -> None:
        """Book what the last `born` particles of every group bring, beside what they have `stored` with others [J]."""
        for k, (columns, number) in enumerate(zip(parts, born, strict=True)):
            if number:
                low = len(columns.m) - number
                at = np.concatenate([np.zeros(low), columns.clock.start[low:]])
                stored += float(self.books.energies(k, columns, at)[low:].sum())
        self.books.add("births", stored)

    @LENIENT
    def book_dead(self, parts: Sequence[Columns], end: float) -> None:
        """Book the energy of particles that are dead at the time `end` [s], without that stored with others."""
        for k, columns in enumerate(parts):
            dead = columns.clock.stop <= end
            if dead.any():
                energies = self.books.energies(k, columns, np.full(len(dead), end))
                self.books.add("deaths", -float(energies[dead].sum()))

    def _halfway(
        self,
        step: Opened,
        path: Columns,
        interactions: tuple[Interaction, ...],
        span: tuple[float, float],
        within: Callable[[Columns], Columns],
    ) -> tuple[Moment, ...]:
        """Beginning, middle and end of a step of which nothing more is known."""
        start, end = span
        between, path = turned(step.columns, path, step.h)
        ends = ((step.columns, start), (path, end))
        f0, f1 = (self._forces(within(c), interactions, t) for c, t in ends)
        if self._held:  # whose forces are not among these
            middle = halfway_between(step.columns, between, step.h)
        else:
            middle = halfway(step.columns, between, f0 / path.m, f1 / path.m, step.h)
        states, times = (step.columns, middle, path), (start, (start + end) / 2, end)
        return tuple(Moment(*each) for each in zip(states, times, SIMPSON, strict=True))

    def _book_spent(self, moments: Sequence[Moment], interactions: tuple[Interaction, ...], h: float) -> None:
        """Book what interactions do beside their potential: dampers, and drag on surfaces."""
        for name, each in zip(self._names, interactions, strict=True):
            if each.spends:
                work = h * sum(weight * each.power(c, t) for c, t, weight in moments)
                self.books.add(each.spends_as or name, work)

    def _book_motion(
        self, moments: Sequence[Moment], forces: Sequence[Floats], ends: tuple[Columns, Columns], h: float
    ) -> None:
        """A motion along a path gives particles their kinetic energy, and balances all forces on them."""
        rows = self._driven
        if not rows.size:
            return
        work = sum(
            moment.weight * float((f[:, rows] * _velocity(moment.columns, rows)).sum())
            for moment, f in zip(moments, forces, strict=True)
        )
        m = ends[0].m[rows].astype(float)
        before, after = (0.5 * float((m * (_velocity(c, rows) ** 2).sum(axis=0)).sum()) for c in ends)
        self.books.add("motion", after - before - h * work)

    def _energy(
        self,
        columns: Columns,
        total: float,
        parts: Callable[[Columns], list[Columns]],
        time: float,
    ) -> float:
        """Energy of all particles [J], with what is stored in interactions in `total`."""
        for k, part in enumerate(parts(columns)):
            total += float(self.books.energies(k, part, np.full(len(part.m), time)).sum())
        return total


def _velocity(c: Columns, rows: NDArray[np.int64] | slice) -> Floats:
    """Velocities of some rows [m/s], shape [3, n]."""
    return np.stack([c.vx[rows], c.vy[rows], c.vz[rows]]).astype(float)
