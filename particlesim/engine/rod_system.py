"""The rods of an island: which particles they join, how long they are, and whether the start fits them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import RodSet
from particlesim.bonds.rod import LENGTH_TOLERANCE, SPEED_TOLERANCE
from particlesim.crossfield import Invalid, Path
from particlesim.engine.islands import Unheld
from particlesim.engine.rigging import new_rig, new_rods
from particlesim.engine.rods import Rods, fit_rods, places, take_aim
from particlesim.engine.state import GroupState
from particlesim.errors import UsageError
from particlesim.forces.field import Field
from particlesim.graph import Island
from particlesim.scenario.diagnose import scenario_error
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Members:
    """The rods of a set: rows of both ends in the island and lengths [m], each [n]."""

    made: RodSet
    first: Ints
    second: Ints
    length: Floats


class RodSystem:
    """All rods of an island: `rods` as kernels take them, `order` as the sets list them."""

    def __init__(self, members: Sequence[Members], offset: dict[str, int], rods: Rods, order: Ints) -> None:
        self.members = tuple(members)
        self.rods = rods
        self._order = order
        self._offset = offset

    @property
    def number(self) -> int:
        """How many rods there are."""
        return len(self._order)

    @property
    def ends(self) -> Ints:
        """Rows of all particles on rods, sorted."""
        return np.unique(
            np.concatenate([part for each in self.members for part in (each.first, each.second)])
        )

    @property
    def components(self) -> int:
        """Sets of rods that hang together."""
        return len(self.rods.failed)

    @property
    def effort(self) -> float:
        """The energy that rods have given to led ends since `begin` [J]."""
        return float(self.rods.effort.sum())

    def unheld(self) -> Unheld | None:
        """The first rod that could not be held in the last steps."""
        bad = np.flatnonzero(self.rods.failed >= 0)
        if not bad.size:
            return None
        rod = int(self._order[self.rods.failed[bad[0]]])
        borders = np.cumsum([0, *(len(each.first) for each in self.members)])
        each = self.members[k := int(np.searchsorted(borders, rod, side="right")) - 1]
        rod -= int(borders[k])
        a, b = each.made.groups
        pair = int(each.first[rod]) - self._offset[a], int(each.second[rod]) - self._offset[b]
        return Unheld(each.made.name, pair, (a, b), float(each.length[rod]), float(self.rods.misfit[bad[0]]))

    def row_of(self, unheld: Unheld, free: NDArray[np.bool_]) -> int:
        """The row of an end of a rod in the island, one of the `free` ones."""
        rows = [self._offset[name] + k for name, k in zip(unheld.groups, unheld.particles, strict=True)]
        return next((row for row in rows if free[row]), rows[0])

    def begin(self) -> None:
        """Forget what earlier steps have left: rods that could not be held, and work on led ends."""
        self.rods.failed[:] = -1
        self.rods.effort[:] = 0

    def fit(self, columns: Any) -> None:
        """Bring particles to the nearest places and velocities that fit."""
        self.begin()
        take_aim(self.rods, places(columns))
        fit_rods(self.rods, places(columns))

    def topology(self, ids: Ints) -> list[Topology]:
        """The rods of every set as a trajectory keeps them; `ids` are those of the island's rows."""
        return [
            Topology(
                each.made.name,
                np.stack([ids[each.first], ids[each.second]], axis=1),
                each.length,
                np.full(len(each.length), np.inf),
            )
            for each in self.members
        ]


def rod_system(
    scenario: Scenario,
    island: Island,
    whole: GroupState,
    states: Sequence[GroupState],
    offset: dict[str, int],
) -> RodSystem | None:
    """The rods of an island, None where there are none. Its particles are put where they fit, and their velocities.

    `offset` are the first rows of its groups in `whole`. Raises UsageError (ScenarioError with the place, where that is
    known) when rods and the particles at the start do not go together.
    """
    if not island.rods:
        return None
    count = {state.name: state.count for state in states}
    members = [_members(scenario, each, whole, count, offset) for each in island.rods]
    first, second, length = (
        np.concatenate([getattr(each, key) for each in members]) for key in ("first", "second", "length")
    )
    _require_once(scenario, members, first, second)
    inverse = 1 / whole.mass[: whole.count].astype(float)
    if whole.clocked:
        inverse[np.isinf(whole.start[: whole.count])] = 0
    for each in members:
        _require_motion(scenario, each, inverse, whole, offset)
        _require_speed(scenario, each, whole, offset)
    rig, order = new_rig(first, second, length, inverse)
    found = RodSystem(members, offset, new_rods(rig, eager=_eager(island), touched=any(island.planes)), order)
    found.fit(whole.columns(radius=False, thermal=False))
    if (bad := found.unheld()) is not None:
        a, b = bad.particles
        raise UsageError(
            f"{bad.name}: rods do not fit each other at the start; that between particles {a} and {b} misses its length "
            f"by {bad.misfit * bad.length:.3g} m",
            "give places that all lengths fit, or leave length out",
        )
    return found


def _members(
    scenario: Scenario, made: RodSet, whole: GroupState, count: dict[str, int], offset: dict[str, int]
) -> Members:
    """The rods of a set, with their lengths."""
    pairs = made.find()
    for end, name in enumerate(made.groups):
        if pairs[:, end].max() >= count[name]:
            worst = int(pairs[:, end].argmax())
            _refuse(
                scenario,
                f"{name!r} has {count[name]} particles, there is no particle {pairs[worst, end]}",
                _place(made, worst),
            )
    first, second = (pairs[:, end] + offset[name] for end, name in enumerate(made.groups))
    x = whole.x.astype(float)
    distance = np.sqrt(((x[:, first] - x[:, second]) ** 2).sum(axis=0))
    if not distance.all():
        a, b = pairs[worst := int(distance.argmin())]
        _refuse(
            scenario,
            f"particles {a} and {b} are at the same place: a rod between them has no direction",
            _place(made, worst),
        )
    miss = np.abs(distance - (distance if made.length is None else made.length)) / distance
    if miss.max() > LENGTH_TOLERANCE:
        a, b = pairs[worst := int(miss.argmax())]
        _refuse(
            scenario,
            f"particles {a} and {b} are {distance[worst]:.7g} m apart at the start, and this rod is {made.length:g} m long",
            _place(made, worst),
            (((*made.at, "length"), "here"),),
            f"they must fit to {LENGTH_TOLERANCE:g} of the length; without length, a rod is as long as at the start",
        )
    return Members(made, first, second, distance if made.length is None else np.full(len(pairs), made.length))


def _require_once(scenario: Scenario, members: Sequence[Members], first: Ints, second: Ints) -> None:
    """No two sets join the same particles."""
    pairs = np.sort(np.stack([first, second], axis=1), axis=1)
    _, number, times = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    twice = np.flatnonzero(times[number.ravel()] > 1)
    if not twice.size:
        return
    same = np.flatnonzero(number.ravel() == number.ravel()[twice[0]])
    owner = np.repeat(np.arange(len(members)), [len(each.first) for each in members])
    begin = np.cumsum([0, *(len(each.first) for each in members)])
    a, b = ((members[owner[k]].made, int(k - begin[owner[k]])) for k in same[:2])
    _refuse(
        scenario,
        "a rod joins these particles already",
        _place(*b),
        ((_place(*a), f"one of {a[0].name!r}"),),
    )


def _require_motion(
    scenario: Scenario, each: Members, inverse: Floats, whole: GroupState, offset: dict[str, int]
) -> None:
    """A listed rod has an end that can move."""
    still = (inverse[each.first] == 0) & (inverse[each.second] == 0)
    if each.made.listed and still.any():
        rod = int(still.argmax())
        a, b = (
            int(rows[rod]) - offset[name]
            for rows, name in zip((each.first, each.second), each.made.groups, strict=True)
        )
        _refuse(
            scenario,
            f"particles {a} and {b} are both pinned: a rod between them does nothing",
            _place(each.made, rod),
        )


def _require_speed(scenario: Scenario, each: Members, whole: GroupState, offset: dict[str, int]) -> None:
    """No rod is stretched by the velocities at the start."""
    x, v = whole.x.astype(float), whole.v.astype(float)
    along = x[:, each.first] - x[:, each.second]
    along /= np.sqrt((along**2).sum(axis=0))
    speed = np.abs(((v[:, each.first] - v[:, each.second]) * along).sum(axis=0))
    size = np.sqrt(np.maximum((v[:, each.first] ** 2).sum(axis=0), (v[:, each.second] ** 2).sum(axis=0)))
    excess = speed - SPEED_TOLERANCE * size
    if excess.max() > 0:
        rod = int(excess.argmax())
        a, b = (
            int(rows[rod]) - offset[name]
            for rows, name in zip((each.first, each.second), each.made.groups, strict=True)
        )
        _refuse(
            scenario,
            f"the velocities of particles {a} and {b} at the start change the length of the rod between them by "
            f"{speed[rod]:.6g} m/s",
            _place(each.made, rod),
            hint="along a rod both ends must be equally fast, led ones included, to "
            f"{SPEED_TOLERANCE:g} of their speed; across it they may turn",
        )


def _eager(island: Island) -> bool:
    """Whether a force on the island depends on velocities."""
    return (
        any(island.surfaces)
        or any(bonds.law.damped for bonds in island.bonds)
        or any(
            force.needs_velocity or (isinstance(force, Field) and force.reads_velocity())
            for forces in island.forces
            for force in forces
        )
    )


def _place(made: RodSet, rod: int) -> Path:
    return (*made.at, "pairs", rod) if made.listed else made.at


def _refuse(
    scenario: Scenario,
    message: str,
    at: Path,
    also: tuple[tuple[Path, str], ...] = (),
    hint: str | None = None,
) -> NoReturn:
    """Raise what is wrong, with its place where the text of the scenario is known."""
    if scenario.source is not None:
        raise scenario_error(scenario.source, [Invalid(message, at, also, hint=hint)])
    where = ".".join(map(str, at))
    raise UsageError(f"{where}: {message}", hint)
