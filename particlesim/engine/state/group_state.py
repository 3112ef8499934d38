"""The particles of one group as arrays, and their births and deaths.

Structure of arrays: position and velocity [3, capacity], everything else [capacity]; the first `count` are there.
`engine.state.table` lists the columns. Those that nothing uses are never touched, so they take no memory.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.state.clinging import NONE, Holder, carried, catch
from particlesim.engine.state.columns import STORMER, Clock, Columns, Spin, Thermal
from particlesim.engine.state.prescribed import Driven, drive_to
from particlesim.engine.state.table import (
    CLINGS,
    CLOCK,
    HEARD,
    HIT,
    ROTATION,
    SPIN,
    TABLE,
    TRACED,
    WATCHED,
    column_of,
)
from particlesim.groups.group import Cooling
from particlesim.laws.registry import ABSORB, KILL, LEAVE, STICK, Particle
from particlesim.model.arrays import Floats, Ints
from particlesim.model.attributes import FURTHER
from particlesim.model.quaternions import UNTURNED, times

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
    """Arrays of one group, by the names of the table of columns.

    `memory` is how many numbers the method remembers per particle; `parts` what the group has beside the columns of all
    groups: CLOCK where particles may be born, die, stick or be pinned, and attributes such as "temperature". `cooling` is
    None for constant temperatures. `axes` turns the principal axes of bodies, which `turn` is about, into those of their
    shape.
    """

    x: NDArray[Any]
    v: NDArray[Any]
    mass: NDArray[Any]
    radius: NDArray[Any]
    id: NDArray[np.int64]
    memory: NDArray[Any]
    birth: NDArray[np.float64]
    start: NDArray[np.float64]
    stop: NDArray[np.float64]
    outcome: NDArray[np.int8]
    cause: NDArray[np.uint8]
    stuck_at: NDArray[np.float64]
    held: NDArray[np.float64]
    missed: NDArray[np.int64]
    exhausted: NDArray[np.int32]
    hit: NDArray[np.float64]
    heat: NDArray[np.float64]
    angular_velocity: NDArray[Any]
    turned: NDArray[Any]
    turn: NDArray[np.float64]
    spin: NDArray[np.float64]

    def __init__(
        self,
        name: str,
        capacity: int,
        *,
        dtype: Any = np.float64,
        memory: int = 0,
        parts: Collection[str] = (),
        cooling: Cooling | None = None,
    ) -> None:
        self.name = name
        self.dtype = np.dtype(dtype)
        self.parts = frozenset(parts)
        self.cooling = cooling
        self.count = 0
        self.driven: tuple[Driven, ...] = ()
        self.holders: tuple[Holder, ...] = ()
        """The colliders that particles stick to, where some of them move."""
        self.axes = UNTURNED
        self.missed_by_dead, self.exhausted_by_dead = 0, 0
        self._allocate(capacity, memory)

    def _allocate(self, capacity: int, memory: int) -> None:
        for column in TABLE:
            setattr(self, column.name, column.empty(capacity, self.dtype, self.parts, memory))
        self._known_columns: tuple[Any, ...] = ()

    @property
    def clocked(self) -> bool:
        """Whether particles may be born, die, stick or be pinned."""
        return CLOCK in self.parts

    @property
    def warm(self) -> bool:
        """Whether particles have a temperature."""
        return "temperature" in self.parts

    def columns_by_name(self) -> dict[str, NDArray[Any]]:
        """The columns of the particles that are there, [n] or [rows, n]; those that the group does not have are empty."""
        return {column.name: getattr(self, column.name)[..., : self.count] for column in TABLE}

    def attribute(self, name: str, rows: Any = slice(None)) -> Any:
        """An attribute of some particles at the start of each; zeros where the group does not have it."""
        column = getattr(self, column_of(name))[: self.count]
        return (column if column.size else np.broadcast_to(column.dtype.type(0), self.count))[rows]

    def assign(self, name: str, part: slice, values: Any) -> None:
        """Set an attribute of some particles, there already or about to be."""
        getattr(self, column_of(name))[part] = values

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

    def orientations(self) -> NDArray[np.float64]:
        """Unit quaternions w, x, y, z of the axes of bodies, shape [4, n]; particles, which do not turn, have that of no
        turn."""
        if ROTATION in self.parts:
            turns = self.turn[:, : self.count]
            if self.axes == UNTURNED:
                return turns
            w, x, y, z = self.axes
            return np.array(times(turns, (w, -x, -y, -z)))
        return np.repeat([[1.0], [0.0], [0.0], [0.0]], self.count, axis=1)

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
        more = [float(self.attribute(each.name, row)) for each in FURTHER]
        return Particle(x, y, z, vx, vy, vz, mass, float(self.radius[row]), heat, time, 1 / mass, *more)

    def columns(self, read: frozenset[str]) -> Columns:
        """The arrays as kernels take them, with those attributes that are read by laws: the same object, which kernels know
        when it comes again, until there are other particles."""
        n = self.count
        if self._known_columns[:2] != (n, read):
            self._known_columns = n, read, self._columns(n, read)
        columns: Columns = self._known_columns[2]
        return columns

    def _columns(self, n: int, read: frozenset[str]) -> Columns:
        (x, y, z), (vx, vy, vz) = self.x[:, :n], self.v[:, :n]
        heat = None
        if "temperature" in read and self.warm:
            rate, ambient = (self.cooling.rate, self.cooling.ambient) if self.cooling else (0.0, 0.0)
            born = self.birth[:n] if self.clocked else np.zeros(n)
            heat = Thermal(self.heat[:n], born, rate, ambient)
        return Columns(
            x,
            y,
            z,
            vx,
            vy,
            vz,
            self.mass[:n],
            self.radius[:n] if "radius" in read else None,
            heat,
            self._clock(n) if self.clocked else None,
            tuple(self.memory[:, :n]),
            tuple(self.attribute(each.name) if each.name in read & self.parts else None for each in FURTHER),
            Spin(*self.angular_velocity[:, :n], *self.turned[:, :n]) if SPIN in self.parts else None,
            self.missed[:n] if WATCHED in self.parts else None,
            self.exhausted[:n] if TRACED in self.parts else None,
            tuple(self.hit[:, :n]) if HEARD in self.parts else (),
        )

    def _clock(self, n: int) -> Clock:
        stuck = self.stuck_at[:n] if CLINGS in self.parts else None
        return Clock(self.start[:n], self.stop[:n], self.outcome[:n], stuck=stuck)

    def arrays(self) -> list[NDArray[Any]]:
        """All columns row by row, in the order of the table; those that the group does not have are empty."""
        columns = (getattr(self, column.name) for column in TABLE)
        return [row for column in columns for row in (column if column.ndim > 1 else (column,))]

    def move_into(self, whole: GroupState, part: slice) -> None:
        """Make this group a stretch of the arrays of a larger one, which has its particles there already.

        It gets a clock where the larger one has one; other parts that it did not have it does not get.
        """
        self.parts |= whole.parts & {CLOCK}
        for column in TABLE:
            has = column.part is None or column.part in self.parts
            setattr(self, column.name, getattr(whole, column.name)[..., part if has else slice(0)])
        self._known_columns = ()

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

    def carry(self, time: float) -> None:
        """Put particles that have stuck to colliders which move where these have taken them by a time."""
        if not self.holders:
            return
        n = self.count
        new = np.flatnonzero((self.outcome[:n] == STICK) & (self.held[0, :n] == NONE))
        if new.size:
            x, radius = self.x[:, new].astype(float), self.radius[new].astype(float)
            self.held[:, new] = catch(self.holders, x, radius, self.stuck_at[new])
        carried(self.holders, self.held[:, :n], time, self.x[:, :n], self.v[:, :n])

    def kick(self, impulse: tuple[float, float, float]) -> None:
        """Δv = j/m for every particle that is free to move; methods that remember the velocity start anew."""
        n = self.count
        free = np.isfinite(self.start[:n]) if self.clocked else np.ones(n, bool)
        had = self.v[:, :n].copy()
        for k, j in enumerate(impulse):
            self.v[k, :n][free] += (j / self.mass[:n].astype(float)[free]).astype(self.dtype)
        self.let_know(np.arange(n), self.v[:, :n] - had)

    def let_know(self, rows: Ints, change: Floats) -> None:
        """Something has changed the velocities of particles between steps [m/s], shape [3, rows]: Störmer's rule goes on
        with that, other methods that remember them begin again."""
        if len(self.memory) == STORMER:
            self.memory[:3, rows] += change
        elif len(self.memory):
            self.memory[-1, rows] = 0

    def kinetic(self) -> float:
        """Kinetic energy of the group, without that of its rotation [J]."""
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
        self.missed_by_dead += int(self.missed[:n][dead].sum()) if WATCHED in self.parts else 0
        self.exhausted_by_dead += int(self.exhausted[:n][dead].sum()) if TRACED in self.parts else 0
        for column in self.arrays():
            if column.size:
                column[: int(keep.sum())] = column[:n][keep]
        self.count = int(keep.sum())
        return deaths

    def take_impacts(self) -> NDArray[np.float64]:
        """The impacts to which emitters react, since they were last taken, shape [len(HIT) + 2, k]: as `table.HIT`, then
        radius and id of what hit, in the order of time."""
        if HEARD not in self.parts:
            return np.empty((len(HIT) + 2, 0))
        n = self.count
        rows = np.flatnonzero(self.hit[HIT.index("speed"), :n] > 0)
        found = np.concatenate(
            [self.hit[:, rows], [self.radius[rows].astype(float)], [self.id[rows].astype(float)]]
        )
        self.hit[:, :n] = 0
        return found[:, np.lexsort((found[-1], found[0]))]

    def missed_crossings(self) -> int:
        """How often particles have passed a collider that looks at the end of steps alone, the dead among them."""
        return self.missed_by_dead + int(self.missed[: self.count].sum())

    def exhausted_steps(self) -> int:
        """In how many of their steps particles had more impacts than are followed, the dead among them."""
        return self.exhausted_by_dead + int(self.exhausted[: self.count].sum())

    def stuck(self) -> NDArray[np.bool_]:
        """Which particles stay where they touched, shape [n]."""
        if not self.clocked:
            return np.zeros(self.count, bool)
        return np.asarray(self.outcome[: self.count] == STICK)
