"""When work in an island enters the ledger: before and after every step, at births and deaths (`ledger.particle_work`)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.coupled.adaptive import BEGAN, ENDED, Pace
from particlesim.engine.coupled.forces import forces_in_step, island_forces
from particlesim.engine.interactions.pair_tensors import parts_of_step
from particlesim.engine.islands.joined import Joined
from particlesim.engine.islands.layout import Interactions, Layout
from particlesim.engine.islands.moment import Moment
from particlesim.engine.islands.present import Stored, Which
from particlesim.engine.islands.stepping import Stepper
from particlesim.engine.ledger.particle_work import IslandBooks, Opened, spans, stages
from particlesim.engine.ledger.work import Books, moved, unjolted
from particlesim.engine.state.columns import Columns, in_step
from particlesim.engine.step.contacts import Simple
from particlesim.graph.graph import Island
from particlesim.integrators import EmbeddedRungeKutta
from particlesim.model.arrays import Floats

Leg = tuple[Opened, Interactions, float]
"""An own step at the end of which an island pauses, the interactions before it, and when it ends [s]."""
Kept = tuple[Floats, Which]
"""Amounts that are booked and turned over [J], shape [2, causes], and the particles that existed in the last own step."""


class Bookkeeper:
    """Keeps the account of work (`ledger.work.Books`) of an island, as long as it has the particles of a layout.

    Methods with own steps end one at every birth and death. What others have stored with those particles is booked there,
    where all are then: `_here` are those who were there in the last own step, shape [n].
    """

    def __init__(
        self,
        books: Books,
        structure: Island,
        names: tuple[str, ...],
        joined: Joined,
        layout: Layout,
        stepper: Stepper,
        stored: Stored,
    ) -> None:
        self.books = books
        self._stored = stored
        self._here = np.ones(layout.count, np.bool_)
        self._joined, self._layout, self._stepper = joined, layout, stepper
        self._island = IslandBooks(books, structure, layout.bounds, layout.driven, names, self._forces_in)

    def open(self, now: Moment, step: int) -> Opened:
        """The state at the beginning of a step."""
        dt, layout = self._stepper.dt, self._layout
        columns, interactions = now.copied()
        begin, h = spans(columns.clock, layout.count, step * dt, (step + 1) * dt)
        free, given = None, 0.0
        if "contact" in self.books.names:
            free, copies = now.copied()
            parts = tuple(part._replace(contacts=Simple(()), cores=None) for part in layout.parts)
            self._stepper.copy(layout, parts, copies, free, step, 1)
            given = self._given()
        columns = unjolted(columns, self.books.jolts)
        return Opened(columns, begin, h, free, interactions=interactions, effort=given, since=step * dt)

    def close(self, opened: Opened, now: Moment, last: int) -> None:
        """Book a step that has been taken, up to the beginning of step `last`."""
        given = opened.effort if opened.free is not None else self._given()
        self._book(opened, opened.interactions, now.columns, last * self._stepper.dt, given)
        self._island.book_breaking(
            opened.interactions, now.interactions, now.columns, last * self._stepper.dt
        )

    def open_leg(self, now: Moment, pace: Pace) -> Leg:
        """The own step at the end of which an island pauses."""
        method, work = self._stepper.method, self._layout.work
        assert isinstance(method, EmbeddedRungeKutta)
        began, ended = float(pace.present[BEGAN]), float(pace.present[ENDED])
        free, interactions = now.copied()
        begin, h = spans(free.clock, self._layout.count, began, ended)
        start = work.before.astype(float)
        before = moved(free, start, np.zeros((6, 1)))
        path = stages(before, (start, work.slopes), (began, ended), h, method)
        if before.clock is not None:
            there = np.empty(self._layout.count)
            parts_of_step(in_step(before, began, ended), there)
            here = there > 0.5  # events in between are less than NEAR away
            self._go_on(Moment(before, interactions), began, here)
        return Opened(before, begin, h, free, path, since=began), interactions, ended

    def close_leg(self, leg: Leg, now: Moment, *, arrived: bool) -> None:
        """Book an own step, of which it is known by now what contact and breaking springs made of its end."""
        opened, interactions, ended = leg
        columns = now.columns
        if not arrived:  # the next step has been tried already, from there
            columns = moved(columns, self._layout.work.before.astype(float), np.zeros((6, 1)))
        self._book(opened, interactions, columns, ended, 0.0)
        self._island.book_breaking(interactions, now.interactions, columns, ended)
        if arrived and columns.clock is not None:
            self._go_on(Moment(columns, now.interactions), ended, columns.clock.stop > ended)

    def kept(self) -> Kept:
        """What is booked so far, to `go_back` to."""
        return np.stack([self.books.totals, self.books.turned]), self._here

    def go_back(self, kept: Kept) -> None:
        """Forget what has been booked since."""
        (self.books.totals[:], self.books.turned[:]), self._here = kept

    def _go_on(self, moment: Moment, time: float, here: Which) -> None:
        """Book the energy stored with particles that are gone from a moment on, and with those that have come; `time` is
        that of the moment [s]."""
        left = self._here & here
        if (left == self._here).all() and (left == here).all():
            return
        before, between, after = self._stored.among(moment, time, (self._here, left, here))
        if (left != self._here).any():
            self.books.add("deaths", between - before)
        if (left != here).any():
            self.books.add("births", after - between)
        self._here = here

    def book_births(self, before: Moment, now: Moment, born: Sequence[int], begin: float) -> None:
        """Book what the last `born` particles of every group bring in the step that begins at `begin` [s]; others are then
        where they will be when those are born, on average. With own steps, what is stored with others follows there."""
        if self._stepper.method.adaptive:
            for last, number in zip(self._layout.bounds[1:], born, strict=True):
                self._here[last - number : last] = False
            self._island.book_births(self._joined.cut(now.columns), born, 0.0)
            return
        start = now.columns.clock.start
        new = (start > begin) & np.isfinite(start)
        ahead = float(start[new].mean()) - begin if new.any() else 0.0
        change = _all_stored(now, begin, ahead, ~new) - _all_stored(
            before, begin, ahead, np.ones(before.columns.m.size, np.bool_)
        )
        self._island.book_births(self._joined.cut(now.columns), born, change)

    def book_deaths(self, before: Moment, dead: NDArray[np.bool_], now: Moment, end: float) -> None:
        """Book what the `dead` have taken away by the time `end` [s] from the island as it was `before`; others
        are then where they were when those died, on average. Own steps have booked it where they ended."""
        if self._stepper.method.adaptive:
            return
        ahead = float(before.columns.clock.stop[dead].mean()) - end
        change = _all_stored(now, end, ahead, np.ones(now.columns.m.size, np.bool_)) - _all_stored(
            before, end, ahead, ~dead
        )
        self.books.add("deaths", change)

    def book_dead(self, now: Moment, end: float) -> None:
        """Book the energy of particles that are dead at the time `end` [s], without that stored with others."""
        self._island.book_dead(self._joined.cut(now.columns), end)

    def _book(
        self, opened: Opened, interactions: Interactions, columns: Columns, end: float, given: float
    ) -> None:
        stored = partial(self._stored_at, interactions, end)
        self._island.close(opened, columns, interactions, self._joined.cut, end, given, stored)

    def _stored_at(self, interactions: Interactions, time: float, ends: Sequence[Columns]) -> list[float]:
        """What is stored in interactions at ends of the present step, with contact and without [J]."""
        one, other = ends
        apart = not self._here.all()
        if apart and all(np.array_equal(getattr(one, x), getattr(other, x)) for x in "xyz"):
            return [0.0, 0.0]  # nothing was touched, and the difference is what counts
        return [self._stored.whole(Moment(each, interactions), time, self._here) for each in ends]

    def _given(self) -> float:
        """The energy that constraints gave to led particles in the last steps [J]."""
        return 0.0 if self._layout.constraint is None else self._layout.constraint.given

    def _forces_in(self, columns: Columns, interactions: Interactions, time: float) -> Floats:
        """Total force on every particle in a state and at a time [N], or in a step that its clock knows, shape [3, n]; led
        particles go to their places."""
        bonds, work, share = self._layout.alone(interactions)
        within = columns.clock is not None and columns.clock.begin is not None
        forces = forces_in_step if within else island_forces
        forces(self._layout.parts, bonds, columns, work, share, time)
        return np.array(work.force[:3], float)


def _all_stored(moment: Moment, time: float, ahead: float, moves: NDArray[np.bool_]) -> float:
    """The potential energy of all interactions when those who move have gone on from `time` for a time `ahead` [J]."""
    c = moment.columns
    step = np.where(moves, ahead, 0.0)
    places = {x: (getattr(c, x) + step * getattr(c, f"v{x}")).astype(c.x.dtype) for x in "xyz"}
    return sum(each.energy(c._replace(**places), time + ahead) or 0.0 for each in moment.interactions)
