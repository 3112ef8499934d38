"""Aiming: the directions of launch with which a particle hits a target.

The speed of launch stays. The distance by which a shot misses is a vector in the plane across its flight where it comes
closest; where it changes its sign as the elevation grows, there is a solution, which Newton's method then finds in elevation
and azimuth together, so that wind from the side is allowed for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.simulation import Simulation
from particlesim.errors import UsageError
from particlesim.fit.predict import hermite
from particlesim.groups import Particles
from particlesim.interruption import held_signals
from particlesim.layouts.points import Points
from particlesim.names import did_you_mean
from particlesim.scenario.load import Overrides, parse_overrides, scenario_of
from particlesim.scenario.overrides import Override, overrides_from_mapping
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.source import Source, read_source
from particlesim.vectors import unit

Floats = NDArray[np.float64]

ELEVATIONS = np.radians(np.linspace(-88, 88, 89))
"""Elevations that are tried first."""
SAMPLES = 2000
"""Places along a flight that are looked at, at most; between them it is interpolated."""
CLOSE = 1e-9
"""A hit, as a part of the distance to the target."""


@dataclass(frozen=True)
class Shot:
    """A direction that hits: elevation and azimuth [deg], velocity of launch [m/s], time of flight [s], miss [m]."""

    elevation: float
    azimuth: float
    velocity: tuple[float, float, float]
    time: float
    miss: float
    scenario: Scenario


@dataclass(frozen=True)
class Aim:
    """The shots that hit, flattest first."""

    group: str
    target: tuple[float, float, float]
    shots: tuple[Shot, ...]


def aim(scenario: str | Path, group: str, target: Sequence[float], *, overrides: Overrides = ()) -> Aim:
    """Directions in which the one particle of `group` hits the point `target` [m], with the speed that it has.

    Elevation is counted from the horizontal, which lies across gravity (across y without gravity), azimuth from the
    direction to the target. Raises UsageError when the group is not one particle at a point that flies, and when the target
    is out of range.
    """
    path = Path(scenario)
    range_ = _Range(read_source(path), parse_overrides(overrides), path.resolve().parent, group, target)
    with held_signals() as signals:
        flights = []
        for elevation in ELEVATIONS:
            signals.check()
            flights.append(range_.fly(float(elevation), 0.0))
        shots: list[Shot] = []
        for before, after, guess in _changes(flights):
            signals.check()
            shot = range_.hit(before, after, guess)
            if shot is not None and not any(_same(shot, other) for other in shots):
                shots.append(shot)
    if not shots:
        best = min(flights, key=lambda flight: flight.distance)
        raise UsageError(
            f"the target is out of range: the nearest that {group!r} comes to it is {best.distance:.6g} m, "
            f"with an elevation of {math.degrees(best.elevation):.3g} degrees",
            "Launch it faster, come closer, or let the run last longer.",
        )
    return Aim(group, range_.target, tuple(sorted(shots, key=lambda shot: shot.elevation)))


@dataclass(frozen=True)
class _Flight:
    """Where a shot comes closest: distance [m], the vertical and the lateral part of it, time [s]; NaN parts when that is
    an end of the flight."""

    elevation: float
    distance: float
    up: float
    side: float
    time: float


class _Range:
    """A launch point, a target, and runs between them."""

    def __init__(
        self,
        source: Source,
        settings: tuple[Override, ...],
        folder: Path,
        group: str,
        target: Sequence[float],
    ) -> None:
        self._source, self._settings, self._folder, self._name = source, settings, folder, group
        if len(target) != 3 or not np.isfinite(target).all():
            raise UsageError("the target is not three finite numbers", "For example: --target 40,0,0")
        self.target = (float(target[0]), float(target[1]), float(target[2]))
        typical = scenario_of(source, settings, folder)
        self._layout = self._points(typical)
        position, velocity = (np.array(each[0], dtype=float) for each in self._layout)
        self._speed = float(np.linalg.norm(velocity))
        if self._speed == 0:
            raise UsageError(f"{group!r} is launched without speed", "Its velocity says how fast it goes.")
        self._up = _up(typical)
        way = np.array(self.target) - position
        self._distance = float(np.linalg.norm(way))
        level = way - (way @ self._up) * self._up
        if np.linalg.norm(level) < 1e-9 * max(self._distance, 1e-300):
            level = velocity - (velocity @ self._up) * self._up
        if np.linalg.norm(level) == 0:
            level = np.cross(self._up, (0.0, 0.0, 1.0) if abs(self._up[2]) < 0.9 else (1.0, 0.0, 0.0))
        self._ahead = level / np.linalg.norm(level)
        self._left = np.cross(self._up, self._ahead)

    def _points(self, scenario: Scenario) -> tuple[Any, Any]:
        names = [group.name for group in scenario.groups]
        if self._name not in names:
            raise UsageError(
                f"there is no group {self._name!r}",
                did_you_mean(self._name, names) or f"There are: {', '.join(names)}",
            )
        group = scenario.groups[names.index(self._name)]
        one = (
            isinstance(group, Particles)
            and isinstance(group.layout, Points)
            and len(group.layout.position) == 1
        )
        if not one or not isinstance(group, Particles) or not isinstance(group.layout, Points):
            raise UsageError(
                f"{self._name!r} is not one particle at a point", 'It needs layout = { type = "points" }.'
            )
        if group.dynamics.type != "second_order" or group.pinned:
            raise UsageError(f"{self._name!r} does not fly: it has no inertia, or is pinned")
        return group.layout.position, group.layout.velocity or ((0.0, 0.0, 0.0),)

    def direction(self, elevation: float, azimuth: float) -> Floats:
        """A unit vector."""
        level = math.cos(azimuth) * self._ahead + math.sin(azimuth) * self._left
        return np.asarray(math.cos(elevation) * level + math.sin(elevation) * self._up)

    def scenario(self, elevation: float, azimuth: float) -> Scenario:
        """The scenario with that launch."""
        velocity = (self._speed * self.direction(elevation, azimuth)).tolist()
        key = f"particles.{self._name}.layout.velocity"
        return scenario_of(
            self._source, (*self._settings, *overrides_from_mapping({key: [velocity]})), self._folder
        )

    def fly(self, elevation: float, azimuth: float) -> _Flight:
        """A shot, and where it comes closest to the target."""
        times, states = _track(self.scenario(elevation, azimuth), self._name)
        away = np.array(self.target) - states[:, :3]
        squares = (away**2).sum(axis=1)
        # Between two places the flight passes the target where it no longer comes closer.
        closing = (away * states[:, 3:]).sum(axis=1)
        passing = np.flatnonzero((closing[:-1] > 0) & (closing[1:] <= 0))
        if not passing.size:
            best = int(squares.argmin())
            return _Flight(elevation, math.sqrt(squares[best]), math.nan, math.nan, float(times[best]))
        found = [self._closest(times[k : k + 2], states[k : k + 2]) for k in passing]
        time, state = min(found, key=lambda each: float(((each[1][:3] - self.target) ** 2).sum()))
        miss = state[:3] - np.array(self.target)
        along = state[3:] / np.linalg.norm(state[3:])
        side = np.cross(self._up, along)
        side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-12 else self._left
        up = np.cross(along, side)
        return _Flight(elevation, float(np.linalg.norm(miss)), float(miss @ up), float(miss @ side), time)

    def _closest(self, times: Floats, states: Floats) -> tuple[float, Floats]:
        """Where the flight between two places is across the way to the target."""
        from scipy.optimize import brentq

        h = float(times[1] - times[0])

        def state(part: float) -> Floats:
            return hermite(states[:1], states[1:], [part], h)[0]

        def closing(part: float) -> float:
            here = state(part)
            return float((np.array(self.target) - here[:3]) @ here[3:])

        ends = closing(0.0), closing(1.0)
        part = (
            float(brentq(closing, 0.0, 1.0, xtol=1e-15)) if ends[0] > 0 >= ends[1] and ends[1] != 0 else 1.0
        )
        return float(times[0]) + part * h, state(part)

    def hit(self, before: float, after: float, guess: float) -> Shot | None:
        """The shot between two elevations that hits; None when there is only a jump, as at an edge."""
        from scipy.optimize import root

        def miss(angles: Floats) -> list[float]:
            flight = self.fly(float(angles[0]), float(angles[1]))
            if math.isnan(flight.up):
                return [flight.distance, flight.distance]
            return [flight.up, flight.side]

        solution = root(miss, [guess, 0.0], method="hybr", options={"xtol": 1e-13, "eps": 1e-10})
        elevation, azimuth = (float(angle) for angle in solution.x)
        width = after - before
        if not before - width <= elevation <= after + width:
            return None
        flight = self.fly(elevation, azimuth)
        if math.isnan(flight.up) or flight.distance > CLOSE * max(self._distance, 1.0):
            return None
        velocity = self._speed * self.direction(elevation, azimuth)
        return Shot(
            math.degrees(elevation),
            round(math.degrees(azimuth), 12),
            (float(velocity[0]), float(velocity[1]), float(velocity[2])),
            flight.time,
            flight.distance,
            self.scenario(elevation, azimuth),
        )


def _up(scenario: Scenario) -> Floats:
    """Against uniform gravity, or along y."""
    for law in scenario.forces:
        if law.type == "gravity" and any(law.acceleration):
            return -np.array(unit(law.acceleration))
    return np.array([0.0, 1.0, 0.0])


def _track(scenario: Scenario, group: str) -> tuple[Floats, Floats]:
    """Times [s] and states [n, 6] along the flight of a group's only particle, until it is gone or the run ends."""
    simulation = Simulation(scenario, threads=1)
    state = next(each for each in simulation.states if each.name == group)
    every = max(1, scenario.grid.steps // SAMPLES)
    times, states = [], []
    try:
        for step in [*range(0, scenario.grid.steps, every), scenario.grid.steps]:
            simulation.advance_to(step)
            if not state.count:
                break
            times.append(simulation.time)
            states.append(np.concatenate([state.position[0], state.velocity[0]]).astype(float))
    finally:
        simulation.close()
    return np.array(times), np.array(states)


def _changes(flights: Sequence[_Flight]) -> list[tuple[float, float, float]]:
    """Pairs of elevations between which the vertical miss changes its sign, and a guess between them."""
    found = []
    for a, b in pairwise(flights):
        if a.up * b.up <= 0:  # False for NaN
            part = a.up / (a.up - b.up) if a.up != b.up else 0.5
            found.append((a.elevation, b.elevation, a.elevation + part * (b.elevation - a.elevation)))
    return found


def _same(a: Shot, b: Shot) -> bool:
    return abs(a.elevation - b.elevation) < 1e-6 and abs(a.azimuth - b.azimuth) < 1e-6
