"""Flights from a launch point: where a direction takes the particle, and which direction takes it to the target.

A flight is a point x(d, t) of the direction of launch d and the time t. Directions in the upright plane through the target
and times make a mesh, which a plane of positions is the image of; where cells of that image cover the target, there is
a guess. From it, Newton's method solves x(d, t) = target for all three unknowns, so that wind from the side is allowed for,
and straight up is a direction like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from particlesim.bodies import Bodies
from particlesim.engine.simulation import Simulation
from particlesim.errors import UsageError
from particlesim.fit.predict import hermite
from particlesim.forces.gravity import Gravity
from particlesim.groups.group import Particles
from particlesim.layouts.points import Points
from particlesim.model.arrays import Floats
from particlesim.model.spelling import did_you_mean
from particlesim.model.vectors import unit
from particlesim.scenario.load import scenario_of
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.overrides import Override, overrides_from_mapping
from particlesim.scenario.text.source import Source

ANGLES = np.radians(np.arange(-181.0, 182.0, 2.0))
"""Directions that are tried first, from ahead over up: the whole circle, since wind can turn a shot round."""
SAMPLES = 300
"""Places along a flight that are looked at, at most."""
MARGIN = 0.3
"""How far outside of a cell the target may be, in cells, to be looked for from there."""
CLOSE = 1e-9
"""A hit, as a part of the distance to the target."""
ITERATIONS = 40
STEP = 1e-6
"""Step of the differences that make derivatives by the direction [rad]."""
TURN = 0.1
"""Longest step of Newton's method [rad]."""


@dataclass(frozen=True)
class Hit:
    """A direction that hits, a unit vector, the time of flight [s], and the distance that is left [m]."""

    direction: Floats
    time: float
    miss: float


class FiringRange:
    """A launch point, a target, and runs between them.

    Raises UsageError when the group is not one particle or body at a point that flies, or the target is no point apart
    from it.
    """

    def __init__(
        self, source: Source, settings: tuple[Override, ...], folder: Any, group: str, target: Sequence[float]
    ) -> None:
        self._source, self._settings, self._folder, self._name = source, settings, folder, group
        if len(target) != 3 or not np.isfinite(target).all():
            raise UsageError("the target is not three finite numbers", "For example: --target 40,0,0")
        self.target = np.array(target, dtype=float)
        self.typical = scenario_of(source, settings, folder)
        aimed = self._group()
        position, velocity = (np.array(each[0], dtype=float) for each in _points(aimed))
        # Where a scenario has the velocity: a body has one of its own, unless a layout says where it is
        self._alone = isinstance(aimed, Bodies) and aimed.velocity is not None
        self._key = f"{aimed.kind}.{group}.{'' if self._alone else 'layout.'}velocity"
        self.speed = float(np.linalg.norm(velocity))
        if self.speed == 0:
            raise UsageError(f"{group!r} is launched without speed", "Its velocity says how fast it goes.")
        way = self.target - position
        self.distance = float(np.linalg.norm(way))
        if self.distance <= CLOSE * float(np.abs(position).max()):
            raise UsageError(f"the target is where {group!r} starts: every direction hits it")
        self.up = _up(self.typical)
        level = way - (way @ self.up) * self.up
        if np.linalg.norm(level) < 1e-9 * self.distance:
            level = velocity - (velocity @ self.up) * self.up
        if np.linalg.norm(level) < 1e-9 * self.speed:
            level = np.cross(self.up, (0.0, 0.0, 1.0) if abs(self.up[2]) < 0.9 else (1.0, 0.0, 0.0))
        self.ahead = level / np.linalg.norm(level)
        self.left = np.cross(self.up, self.ahead)

    def _group(self) -> Particles:
        """The group that is aimed."""
        names = [group.name for group in self.typical.groups]
        if self._name not in names:
            raise UsageError(
                f"there is no group {self._name!r}",
                did_you_mean(self._name, names) or f"There are: {', '.join(names)}",
            )
        group = self.typical.groups[names.index(self._name)]
        if (
            not isinstance(group, Particles)
            or not isinstance(group.layout, Points)
            or len(group.layout.position) != 1
        ):
            raise UsageError(
                f"{self._name!r} is not one {'body' if isinstance(group, Bodies) else 'particle'} at a point",
                'It needs layout = { type = "points" }.',
            )
        if group.dynamics.type != "second_order" or group.pinned:
            raise UsageError(f"{self._name!r} does not fly: it has no inertia, or is pinned")
        return group

    def upright(self, angle: float) -> Floats:
        """The direction at an angle from ahead, over up: a unit vector."""
        return np.asarray(math.cos(angle) * self.ahead + math.sin(angle) * self.up)

    def scenario(self, direction: Floats) -> Scenario:
        """The scenario with that launch."""
        velocity = (self.speed * direction).tolist()
        launch = overrides_from_mapping({self._key: velocity if self._alone else [velocity]})
        return scenario_of(self._source, (*self._settings, *launch), self._folder)

    def fly(self, direction: Floats, steps: Sequence[int]) -> tuple[Floats, Floats]:
        """Times [s] and states [n, 6] at steps of the run in order, until the particle is gone."""
        simulation = Simulation(self.scenario(direction), threads=1)
        state = next(each for each in simulation.states if each.name == self._name)
        times, states = [], []
        try:
            for step in steps:
                simulation.advance_to(step)
                if not state.count:
                    break
                times.append(simulation.time)
                states.append(np.concatenate([state.position[0], state.velocity[0]]).astype(float))
        finally:
            simulation.close()
        return np.array(times), np.array(states).reshape(-1, 6)

    def at(self, direction: Floats, time: float) -> Floats | None:
        """The state after a time of flight, by Hermite's cubic between steps; None when the particle is gone by then."""
        grid = self.typical.grid
        step = min(max(int(time / grid.dt), 0), grid.steps - 1)
        times, states = self.fly(direction, (step, step + 1))
        if len(times) < 2:
            return None
        h = float(times[1] - times[0])
        return np.asarray(hermite(states[:1], states[1:], [(time - times[0]) / h], h)[0])

    def survey(self, check: Callable[[], None]) -> Flights:
        """Flights in the upright plane through the target; `check` is called between them."""
        steps = np.unique(np.linspace(0, self.typical.grid.steps, SAMPLES + 1).astype(int)).tolist()
        flights = []
        for angle in ANGLES:
            check()
            times, states = self.fly(self.upright(float(angle)), steps)
            away = states[:, :3] - self.target
            flights.append((times, np.column_stack([away @ self.ahead, away @ self.up, away @ self.left])))
        return Flights(flights)

    def hit(self, angle: float, time: float, left: float) -> Hit | None:
        """The hit that Newton's method finds from a guess, which passes the target on the `left` [m]; None if none."""
        direction = self.upright(angle) - left / (self.speed * max(time, 1e-300)) * self.left
        direction /= np.linalg.norm(direction)
        longest = self.typical.grid.duration
        for _ in range(ITERATIONS):
            state = self.at(direction, time)
            if state is None:
                return None
            miss = state[:3] - self.target
            if np.linalg.norm(miss) <= 0.1 * CLOSE * max(self.distance, 1.0):
                return Hit(direction, time, float(np.linalg.norm(miss)))
            across = _across(direction)
            turned = [self.at(_turned(direction, STEP * way), time) for way in across]
            if any(other is None for other in turned):
                return None
            columns = [(other[:3] - state[:3]) / STEP for other in turned if other is not None]
            step = -np.linalg.lstsq(np.column_stack([*columns, state[3:]]), miss, rcond=1e-12)[0]
            step *= min(1.0, TURN / max(float(np.hypot(*step[:2])), TURN))
            direction = _turned(direction, step[0] * across[0] + step[1] * across[1])
            time = min(max(time + float(np.clip(step[2], -0.1 * longest, 0.1 * longest)), 0.0), longest)
        return None


def _points(group: Particles) -> tuple[Any, Any]:
    """The places and velocities of a group at points."""
    assert isinstance(group.layout, Points)
    return group.layout.position, group.layout.velocity or ((0.0, 0.0, 0.0),)


class Flights:
    """Flights as (times [n], positions relative to the target [n, 3]: ahead, up, left), one for each of `ANGLES`."""

    def __init__(self, flights: Sequence[tuple[Floats, Floats]]) -> None:
        self._flights = flights

    def nearest(self) -> float:
        """The shortest distance between any of the flights and the target [m]."""
        return min(_shortest(away) for _, away in self._flights)

    def guesses(self) -> Iterator[tuple[float, float, float]]:
        """Angle, time and passing distance on the left near which there may be a hit; two guesses for each cell."""
        for k in range(len(ANGLES) - 1):
            (times, one), (_, other) = self._flights[k : k + 2]
            for j in _covering(one[:, :2], other[:, :2]):
                time = 0.5 * float(times[j] + times[j + 1])
                for part in (0.0, 1.0):
                    left = float((one if part == 0 else other)[j, 2])
                    yield float(ANGLES[k] + part * (ANGLES[k + 1] - ANGLES[k])), time, left


def _covering(one: Floats, other: Floats) -> list[int]:
    """Which cells between two flights [n, 2] cover the origin, or nearly so; cells without an area count when it is near."""
    n = min(len(one), len(other))
    corners = np.stack([one[: n - 1], one[1:n], other[: n - 1], other[1:n]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = MARGIN * (high - low)
    near = np.flatnonzero(((low - margin <= 0) & (high + margin >= 0)).all(axis=1))
    found: list[int] = []
    for j in near.tolist():
        a, b, c, d = corners[:, j]
        sides = 0.5 * np.column_stack([b + d - a - c, c + d - a - b])
        area = abs(float(np.linalg.det(sides)))
        flat = area <= 0.1 * float(np.linalg.norm(sides[:, 0]) * np.linalg.norm(sides[:, 1]))
        if flat or (np.abs(np.linalg.solve(sides, -corners[:, j].mean(axis=0))) <= 0.5 + MARGIN).all():
            found.append(j)
    return found


def _shortest(path: Floats) -> float:
    """The shortest distance between the origin and a path of straight pieces [n, 3]."""
    begin, way = path[:-1], np.diff(path, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    part = np.clip(-(begin * way).sum(axis=1) / square, 0.0, 1.0)[:, None]
    ends = np.linalg.norm(path, axis=1)
    return float(min(ends.min(), np.linalg.norm(begin + part * way, axis=1).min(initial=math.inf)))


def _across(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors across a direction and each other."""
    axis = np.zeros(3)
    axis[int(np.abs(direction).argmin())] = 1.0
    first = np.cross(direction, axis)
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)


def _turned(direction: Floats, way: Floats) -> Floats:
    turned = direction + way
    return np.asarray(turned / np.linalg.norm(turned))


def _up(scenario: Scenario) -> Floats:
    """Against uniform gravity, or along y."""
    for law in scenario.forces:
        if isinstance(law, Gravity) and any(law.acceleration):
            return -np.array(unit(law.acceleration))
    return np.array([0.0, 1.0, 0.0])
