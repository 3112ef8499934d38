"""Whether the initial positions and velocities satisfy the rods: errors name the rod that they are about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from particlesim.bonds import RodSet
from particlesim.bonds.rod import LENGTH_TOLERANCE, SPEED_TOLERANCE
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Members:
    """The rods of a set: indices of both ends in their groups [n, 2], their rows in the island and lengths [m], each [n]."""

    made: RodSet
    indices: Ints
    first: Ints
    second: Ints
    length: Floats

    def place(self, rod: int) -> Path:
        """Where the scenario states a rod."""
        return (*self.made.at, "pairs", rod) if self.made.listed else self.made.at


def members_of(
    scenario: Scenario,
    made: RodSet,
    whole: GroupState,
    count: Mapping[str, int],
    offset: Mapping[str, int],
) -> Members:
    """The rods of a set in an island, whose groups have `count` particles and begin at rows `offset`.

    Raises UsageError for particles that do not exist, are at the same place, or not as far apart as the rod is long.
    """
    pairs = made.find()
    first, second = (pairs[:, end] + offset[name] for end, name in enumerate(made.groups))
    found = Members(made, pairs, first, second, np.zeros(len(pairs)))
    for end, name in enumerate(made.groups):
        worst = int(pairs[:, end].argmax())
        if pairs[worst, end] >= count[name]:
            text = f"{name!r} has {count[name]} particles, there is no particle {pairs[worst, end]}"
            _refuse(scenario, text, found.place(worst))
    x = whole.x.astype(float)
    distance = np.sqrt(((x[:, first] - x[:, second]) ** 2).sum(axis=0))
    a, b = pairs[worst := int(distance.argmin())]
    if distance[worst] == 0:
        text = f"particles {a} and {b} are at the same place: a rod between them has no direction"
        _refuse(scenario, text, found.place(worst))
    if made.length is None:
        return replace(found, length=distance)
    miss = np.abs(distance - made.length) / made.length
    a, b = pairs[worst := int(miss.argmax())]
    if miss[worst] > LENGTH_TOLERANCE:
        _refuse(
            scenario,
            f"particles {a} and {b} are {distance[worst]:.7g} m apart at the start, and this rod is {made.length:g} m long",
            found.place(worst),
            (((*made.at, "length"), "here"),),
            f"they must fit to {LENGTH_TOLERANCE:g} of the length; without length, a rod is as long as at the start",
        )
    return replace(found, length=np.full(len(pairs), made.length))


def require_once(scenario: Scenario, members: Sequence[Members]) -> None:
    """Raises UsageError when two sets join the same particles; within a set, its model has seen to that."""
    if len(members) < 2:
        return
    seen: dict[tuple[int, int], tuple[Members, int]] = {}
    for each in members:
        for rod, (a, b) in enumerate(zip(each.first.tolist(), each.second.tolist(), strict=True)):
            pair = (min(a, b), max(a, b))
            if pair in seen:
                other, number = seen[pair]
                also = ((other.place(number), f"one of {other.made.name!r}"),)
                _refuse(scenario, "a rod joins these particles already", each.place(rod), also)
            seen[pair] = each, rod


def require_motion(scenario: Scenario, each: Members, inverse: Floats) -> None:
    """Raises UsageError for a listed rod between two particles that are held; `inverse` is 1/m, 0 for these."""
    still = (inverse[each.first] == 0) & (inverse[each.second] == 0)
    if each.made.listed and still.any():
        a, b = each.indices[rod := int(still.argmax())]
        text = f"particles {a} and {b} are both pinned: a rod between them does nothing"
        _refuse(scenario, text, each.place(rod))


def require_speed(scenario: Scenario, each: Members, whole: GroupState) -> None:
    """Raises UsageError for a rod that is stretched by the velocities at the start."""
    x, v = whole.x.astype(float), whole.v.astype(float)
    along = x[:, each.first] - x[:, each.second]
    along /= np.sqrt((along**2).sum(axis=0))
    speed = np.abs(((v[:, each.first] - v[:, each.second]) * along).sum(axis=0))
    fastest = np.maximum((v[:, each.first] ** 2).sum(axis=0), (v[:, each.second] ** 2).sum(axis=0))
    excess = speed - SPEED_TOLERANCE * np.sqrt(fastest)
    a, b = each.indices[rod := int(excess.argmax())]
    if excess[rod] > 0:
        _refuse(
            scenario,
            f"the velocities of particles {a} and {b} at the start change the length of the rod between them by "
            f"{speed[rod]:.6g} m/s",
            each.place(rod),
            hint="along a rod both ends must be equally fast, led ones included, to "
            f"{SPEED_TOLERANCE:g} of their speed; across it they may turn",
        )


def _refuse(
    scenario: Scenario,
    message: str,
    at: Path,
    also: tuple[tuple[Path, str], ...] = (),
    hint: str | None = None,
) -> NoReturn:
    """Raise what is wrong, with its place where the text of the scenario is known."""
    if scenario.source is not None:
        from particlesim.scenario.text.diagnose import scenario_error

        raise scenario_error(scenario.source, [Invalid(message, at, also, hint=hint)])
    where = ".".join(map(str, at))
    raise UsageError(f"{where}: {message}", hint)
