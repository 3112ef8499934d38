"""Springs and rods from bodies to particles of other islands.

Such particles are guests among the bodies in every step, as those that touch bodies are (`grains`). All other forces on them
are estimated from the last step and act in the middle of this one; then that estimate is taken back, and the particle makes
its own step with the velocity change Δv that springs and rods have given it. That step starts from a shifted position, so
that it ends where an impulse in the middle of the step would have led.

A spring gives both ends the impulse h f, with f at their positions in the middle of the step; the particle is shifted by
−h Δv/2. So momentum and angular momentum are kept to rounding, and the step is of second order: the commutator terms
h² [A, S]/2 cancel, where S is the spring and A everything else that moves the particle.

After that a rod misses its length by as much as A has changed since the last step. So once all have made their steps, bodies
and the particles on rods drift back to the middle of the step, get impulses along the rods there, and drift forward again,
such that rods and joints fit at the end (`hold_ends`): here, too, impulses act between positions at the same time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.rigid.held_walls import HOP
from particlesim.engine.rigid.spring_layout import Laid
from particlesim.engine.rigid.springs import BodySprings
from particlesim.engine.rigid.touching import Touching
from particlesim.engine.rigid.visit import Left, Visitors, among
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints

NOTICED = 0.05
"""An impact in the own step of a particle changes its velocity by more than this part of what bodies have given it."""


class Ties:
    """The springs to particles among those that are laid out, the particles, and those of them that rods hold (`held`, rows
    by groups)."""

    def __init__(
        self, laid: Sequence[Laid], held: Mapping[str, Ints], particles: Mapping[str, GroupState]
    ) -> None:
        self._sets = [(each.springs, each.tied) for each in laid if each.tied is not None]
        self.held, self._states = held, {}
        self.rows: dict[str, Ints] = {}
        """Of every group, the rows of the particles that hang on bodies."""
        for name in dict.fromkeys([*held, *(name for _, name in self._sets)]):
            rows = [held.get(name, np.empty(0, np.int64))]
            rows += [springs.second for springs, tied in self._sets if tied == name]
            self.rows[name], self._states[name] = np.unique(np.concatenate(rows)), particles[name]
        self.gained = {name: np.zeros((2, 3, state.count)) for name, state in self._states.items()}
        """By how much what else acts on them has changed their velocities in the last step, and is expected to in the next
        one [m/s], shape [2, 3, particles]."""
        self._left: dict[str, Floats] = {}
        self._after: Left
        self.given = self.awaited = np.zeros((3, 0))
        """Of the present step, and of particles on rods [m/s], shape [3, n]: velocities that bodies have given them, and
        changes by what else acts on them for which those are right."""

    def refuse_led(self) -> None:
        """Raises UsageError where motions lead some of these particles: the work at such ends is not known."""
        for name, state in self._states.items():
            led = [
                row for each in state.driven for row in np.intersect1d(each.rows, self.rows[name]).tolist()
            ]
            if led:
                raise UsageError(
                    f"a motion leads particle {led[0]} of {name!r}, which springs or rods join to bodies: the work of "
                    "such a motion is not recorded",
                    "leave out work under [output], or lead another particle of the group",
                )

    def __bool__(self) -> bool:
        return bool(self.rows)

    def visitors(self, *, held: bool = False) -> Visitors:
        """All these particles as they are, or those that rods hold."""
        rows = self.held if held else self.rows
        chosen = [(self._states[name], mine) for name, mine in rows.items()]
        number = sum(map(len, rows.values()))
        nothing = (
            np.zeros((len(Touching._fields), len(chosen), 1)),
            np.zeros((7, number)),
            number if held else 0,
        )
        none = np.zeros(number, np.int64)
        return among(chosen, *nothing, np.ones(number, np.int64), none, none)

    def on_rods(self) -> list[tuple[GroupState, Ints]]:
        """The particles that rods hold: groups, and rows of them."""
        return [(self._states[name], rows) for name, rows in self.held.items()]

    def take(self, x: Floats, v: Floats) -> None:
        """The places and velocities of the particles that rods hold have become these [3, n]."""
        first = 0
        for state, rows in self.on_rods():
            part = slice(first, first + len(rows))
            state.x[:, rows], state.v[:, rows] = x[:, part], v[:, part]
            first += len(rows)

    def gain(self, chosen: Sequence[tuple[GroupState, Ints]]) -> Floats:
        """By how much what else acts on visitors, rows of groups, is expected to change their velocities in a step [m/s],
        shape [3, visitors]."""
        parts = [np.zeros((3, len(rows))) for _, rows in chosen]
        for part, (state, rows) in zip(parts, chosen, strict=True):
            if state.name in self.gained:
                part[:] = self.gained[state.name][1][:, rows]
        return np.concatenate(parts, axis=1)

    def leave(self, given: Floats, awaited: Floats, after: Left) -> None:
        """Visitors, those that rods hold first, are about to make their own steps, as the step of bodies has left them."""
        number = sum(map(len, self.held.values()))
        self._after = after
        self.given, self.awaited = given[:, :number], awaited[:, :number]
        self._left = {name: self._speeds(name) for name in self._states}

    def arrive(self, h: float, pulls: Callable[[], Floats]) -> float:
        """They have made them, of length h. What has changed a velocity as in the step before, or no more than twice as
        much as was expected, is expected again: an impact is not, nor is one after another. Of what rods hold at a collider
        only forces are expected, as `pulls` tells them, accelerations [3, held]: what that collider does is found among
        bodies. Returns the energy [J] that those get which end otherwise (`_take_back`)."""
        gained = self._take_back(h) if self.held else 0.0
        for name, rows in self.rows.items():
            last, expected = self.gained[name][:, :, rows]
            came = self._speeds(name) - self._left[name]
            again = ((came - last) ** 2).sum(axis=0) <= (last**2).sum(axis=0)
            again |= (came**2).sum(axis=0) <= 4 * (expected**2).sum(axis=0)
            self.gained[name][:, :, rows] = came, np.where(again, came, expected)
        self._left = {}
        if self.held and self._after.linked.any():
            self.expect(h * pulls(), self._after.linked)
        return gained

    def expect(self, gain: Floats, some: NDArray[np.bool_] | None = None) -> None:
        """Forces are to change velocities of particles on rods, or of some of them, by so much [m/s], shape [3, held]."""
        first = 0
        for state, rows in self.on_rods():
            part = slice(first, first + len(rows))
            first += len(rows)
            chosen = np.ones(len(rows), np.bool_) if some is None else some[part]
            self.gained[state.name][:, :, rows[chosen]] = gain[:, part][:, chosen]

    def _take_back(self, h: float) -> float:
        """Those that rods hold begin their own step beside where they should, and are put back by that. What may touch a
        collider ends it where bodies have led it, as that collider has acted among bodies; so does what has hit something
        beyond that end. Returns the energy that these get [J]."""
        gained, first = 0.0, 0
        for state, rows in self.on_rods():
            part = slice(first, first + len(rows))
            first += len(rows)
            state.x[:, rows] -= self._after.lifted[:, part].astype(state.dtype)
            given, awaited = self.given[:, part], self.awaited[:, part]
            aim = self._after.fast[:, part]
            change = aim - state.v[:, rows]
            least = np.maximum(4 * (awaited**2).sum(axis=0), NOTICED**2 * (given**2).sum(axis=0))
            lifted = (self._after.lifted[:, part] ** 2).sum(axis=0) > (HOP * h) ** 2 * (awaited**2).sum(
                axis=0
            )
            back = self._after.linked[part] | (lifted & ((change**2).sum(axis=0) > least))
            mine, change = rows[back], change[:, back]
            gained += float((state.mass[mine] * (change * (aim[:, back] - 0.5 * change)).sum(axis=0)).sum())
            state.x[:, mine], state.v[:, mine] = self._after.ends[:, part][:, back], aim[:, back]
            state.let_know(mine, change)
        return gained

    def _speeds(self, name: str) -> Floats:
        """Velocities of a group's particles that hang on bodies [m/s], shape [3, n]."""
        return self._states[name].v[:, self.rows[name]].astype(float)

    def unforeseen(self) -> float:
        """The energy that rods have taken in excess [J], as velocities have changed by δ more than was expected:
        Δv m δ/2."""
        chosen = self.on_rods()
        came = np.concatenate([self.gained[state.name][0][:, rows] for state, rows in chosen], axis=1)
        mass = np.concatenate([state.mass[rows] for state, rows in chosen])
        return float(0.5 * (mass * self.given * (came - self.awaited)).sum())

    def springs(self, visitors: Visitors, bodies: int) -> tuple[BodySprings, ...]:
        """The springs where visitors, who are among them, come after so many bodies."""
        order = np.argsort(visitors.id)

        def place(springs: BodySprings, name: str) -> BodySprings:
            ids = self._states[name].id[springs.second]
            return springs._replace(second=bodies + order[np.searchsorted(visitors.id, ids, sorter=order)])

        return tuple(place(springs, str(name)) for springs, name in self._sets)

    def forces(self, pull: Floats) -> dict[str, tuple[Ints, Floats]]:
        """Of every group the rows, and the forces on them [N], shape [n, 3]; `pull` is what acts on all visitors [n, 6]."""
        found, first = {}, 0
        for name, rows in self.rows.items():
            found[name] = rows, pull[first : first + len(rows), :3].copy()
            first += len(rows)
        return found
