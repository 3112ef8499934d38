"""The particles of one group as arrays, and their births and deaths.

Structure of arrays: position and velocity [3, capacity], everything else [capacity]; the first `count` are there.
Columns that nothing uses are never touched, so they take no memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.state.columns import Clock, Columns, Thermal
from particlesim.engine.state.prescribed import Driven, drive_to
from particlesim.groups.group import Cooling
from particlesim.laws.registry import ABSORB, KILL, LEAVE, STICK, Particle

CAUSES = {0: "end", 1: "age", 2: "cold", 3: "recycled", 4: "plane", 5: "outside", 6: "collider"}
"""Why a particle died, by code."""
AGE, COLD, RECYCLED, BY_PLANE, OUTSIDE, BY_COLLIDER = 1, 2, 3, 4, 5, 6


@dataclass(frozen=True)
class Deaths:
    """Particles that died: id, time [s], cause."""

    ids: NDArray[np.int64]
    times: NDArray[np.float64]
    causes: NDArray[np.uint8]


class GroupState:
    """Arrays of one group.

    `memory` is how many numbers the method remembers per particle; `clocked` whether particles may be born, die, stick
    or be pinned; `cooling` is None for constant temperatures.
    """

    def __init__(
        self,
        name: str,
        capacity: int,
        *,
        dtype: Any = np.float64,
        memory: int = 0,
        clocked: bool = False,
        warm: bool = False,
        cooling: Cooling | None = None,
    ) -> None:
        self.name = name
        self.dtype = np.dtype(dtype)
        self.cooling = cooling
        self.clocked = clocked
        self.warm = warm
        self.count = 0
        self.driven: tuple[Driven, ...] = ()
        self._allocate(capacity, memory)

    def _allocate(self, capacity: int, memory: int) -> None:
        self.x = np.zeros((3, capacity), self.dtype)
        self.v = np.zeros((3, capacity), self.dtype)
        self.mass = np.zeros(capacity, self.dtype)
        self.radius = np.zeros(capacity, self.dtype)
        self.id = np.zeros(capacity, np.int64)
        self.memory = tuple(np.zeros(capacity, self.dtype) for _ in range(memory))
        size = capacity if self.clocked else 0
        self.birth = np.zeros(size)
        self.start = np.zeros(size)
        self.stop = np.zeros(size)
        self.outcome = np.zeros(size, np.int8)
        self.cause = np.zeros(size, np.uint8)
        self.heat = np.zeros(capacity if self.warm else 0)

    @property
    def capacity(self) -> int:
        """Particles that fit without growing."""
        return int(self.mass.size)

    @property
    def position(self) -> NDArray[np.floating[Any]]:
        """Positions [m], shape [n, 3]; a view."""
        return self.x[:, : self.count].T

    @property
    def velocity(self) -> NDArray[np.floating[Any]]:
        """Velocities [m/s], shape [n, 3]; a view."""
        return self.v[:, : self.count].T

    def temperature(self, time: float) -> NDArray[np.float64]:
        """Temperatures at a time [K], shape [n]; NaN for a group that has none."""
        heat = self.heat[: self.count]
        if not self.warm:
            return np.full(self.count, np.nan)
        if self.cooling is None:
            return heat.copy()
        excess = (heat - self.cooling.ambient) * np.exp(-self.cooling.rate * self.age(time))
        return np.asarray(self.cooling.ambient + excess)

    def age(self, time: float) -> NDArray[np.float64]:
        """Ages at a time [s], shape [n]."""
        return time - self.birth[: self.count] if self.clocked else np.full(self.count, time)

    def particle(self, row: int, time: float) -> Particle:
        """One particle as laws see it, in plain Python; its temperature is 0 if it has none."""
        x, y, z = (float(c) for c in self.x[:, row])
        vx, vy, vz = (float(c) for c in self.v[:, row])
        heat = float(self.temperature(time)[row]) if self.warm else 0.0
        mass = float(self.mass[row])
        return Particle(x, y, z, vx, vy, vz, mass, float(self.radius[row]), heat, time, 1 / mass)

    def columns(self, *, radius: bool, thermal: bool) -> Columns:
        """The arrays as kernels take them, with what its laws use."""
        n = self.count
        clock = Clock(self.start[:n], self.stop[:n], self.outcome[:n]) if self.clocked else None
        heat = None
        if thermal:
            rate, ambient = (self.cooling.rate, self.cooling.ambient) if self.cooling else (0.0, 0.0)
            born = self.birth[:n] if self.clocked else np.zeros(n)
            heat = Thermal(self.heat[:n], born, rate, ambient)
        return Columns(
            self.x[0, :n],
            self.x[1, :n],
            self.x[2, :n],
            self.v[0, :n],
            self.v[1, :n],
            self.v[2, :n],
            self.mass[:n],
            self.radius[:n] if radius else None,
            heat,
            clock,
            tuple(column[:n] for column in self.memory),
        )

    def arrays(self) -> list[NDArray[Any]]:
        """All columns, in a fixed order; those that are not used are empty."""
        return [
            *self.x,
            *self.v,
            self.mass,
            self.radius,
            self.id,
            *self.memory,
            self.birth,
            self.start,
            self.stop,
            self.outcome,
            self.cause,
            self.heat,
        ]

    def stretch(self, member: GroupState, part: slice) -> GroupState:
        """A group as a stretch of this one's arrays, with the member's name and cooling."""
        view = GroupState(
            member.name, 0, dtype=self.dtype, clocked=self.clocked, warm=self.warm, cooling=member.cooling
        )
        view.x, view.v = self.x[:, part], self.v[:, part]
        for name in ("mass", "radius", "id"):
            setattr(view, name, getattr(self, name)[part])
        for name in ("birth", "start", "stop", "outcome", "cause", "heat"):
            column = getattr(self, name)
            setattr(view, name, column[part] if column.size else column)
        view.memory = tuple(column[part] for column in self.memory)
        view.count = part.stop - part.start
        view.driven = member.driven
        return view

    def reserve(self, wanted: int) -> None:
        """Make room for `wanted` particles; grows by half at least, so that births stay cheap."""
        if wanted <= self.capacity:
            return
        old = self.arrays()
        self._allocate(max(wanted, self.capacity + self.capacity // 2), len(self.memory))
        for before, now in zip(old, self.arrays(), strict=True):
            if now.size:
                now[: self.count] = before[: self.count]

    def pin(self, which: NDArray[np.int64]) -> None:
        """Particles that no force moves: their clock never starts."""
        self.start[: self.count][which] = np.inf

    def drive(self, time: float) -> None:
        """Put particles that are led along paths where they are at a time."""
        if self.driven:
            drive_to(self.driven, self.x, self.v, time)

    def kick(self, impulse: tuple[float, float, float]) -> None:
        """Δv = j/m for every particle that is free to move; methods that remember the velocity start anew."""
        n = self.count
        free = np.isfinite(self.start[:n]) if self.clocked else np.ones(n, bool)
        for k, j in enumerate(impulse):
            self.v[k, :n][free] += (j / self.mass[:n].astype(float)[free]).astype(self.dtype)
        if self.memory:
            self.memory[-1][:n] = 0

    def kinetic(self) -> float:
        """Kinetic energy of the group [J]."""
        n = self.count
        speed2 = (self.v[:, :n].astype(float) ** 2).sum(axis=0)
        return float((0.5 * self.mass[:n].astype(float) * speed2).sum())

    def bury(self, time: float) -> Deaths:
        """Take out all particles whose clock has stopped by `time`; the others keep their order."""
        n = self.count
        dead = self.stop[:n] <= time
        if not dead.any():
            return Deaths(np.empty(0, np.int64), np.empty(0), np.empty(0, np.uint8))
        outcome = self.outcome[:n]
        cause = self.cause[:n]
        cause[outcome == KILL] = BY_PLANE
        cause[outcome == LEAVE] = OUTSIDE
        cause[outcome == ABSORB] = BY_COLLIDER
        deaths = Deaths(self.id[:n][dead], self.stop[:n][dead], cause[dead])
        keep = ~dead
        place = np.cumsum(keep) - 1
        self.driven = tuple(each._replace(rows=place[each.rows]) for each in self.driven)
        for column in self.arrays():
            if column.size:
                column[: int(keep.sum())] = column[:n][keep]
        self.count = int(keep.sum())
        return deaths

    def stuck(self) -> NDArray[np.bool_]:
        """Which particles stay where they touched, shape [n]."""
        if not self.clocked:
            return np.zeros(self.count, bool)
        return np.asarray(self.outcome[: self.count] == STICK)
