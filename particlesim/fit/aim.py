"""Aiming: the directions of launch with which a particle or a body hits a target. The speed of launch stays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from particlesim.engine.world import World
from particlesim.errors import UsageError
from particlesim.fit.shooting import CLOSE, FiringRange, Hit
from particlesim.laws.registry import Particle, gap, normal
from particlesim.process.signals import held_signals
from particlesim.scenario.load import Overrides, parse_overrides
from particlesim.scenario.reach import held_back
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.source import read_source

SAME = 1e-6
"""Angle between two directions that are one [rad]."""


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


def aim(
    scenario: str | Path, group: str, target: Sequence[float], *, overrides: Overrides | None = None
) -> Aim:
    """Directions in which the one particle or body of `group` hits the point `target` [m], with the speed that it has.

    Elevation is counted from the horizontal, which lies across gravity (across y without gravity), azimuth from the
    direction to the target. Of a direction that passes the target several times, the first time counts. Raises UsageError
    when the group is not one particle or body at a point that flies, and when the target is out of range.
    """
    path = Path(scenario)
    range_ = FiringRange(read_source(path), parse_overrides(overrides), path.resolve().parent, group, target)
    with held_signals() as signals:
        survey = range_.survey(signals.check)
        hits = _hits(range_, survey.guesses(), signals.check)
    if not hits:
        raise _unreachable(range_, group, survey.nearest())
    shots = sorted((_shot(range_, hit) for hit in hits), key=lambda shot: shot.elevation)
    x, y, z = range_.target.tolist()
    return Aim(group, (x, y, z), tuple(shots))


def _hits(
    range_: FiringRange, guesses: Iterable[tuple[float, float, float]], check: Callable[[], None]
) -> list[Hit]:
    """One hit for each direction, the earliest."""
    found: list[Hit] = []
    for angle, time, left in guesses:
        check()
        hit = range_.hit(angle, time, left)
        if hit is None:
            continue
        same = [k for k, other in enumerate(found) if np.linalg.norm(hit.direction - other.direction) < SAME]
        if not same:
            found.append(hit)
        elif hit.time < found[same[0]].time:
            found[same[0]] = hit
    return found


def _shot(range_: FiringRange, hit: Hit) -> Shot:
    ahead, left, up = (float(hit.direction @ axis) for axis in (range_.ahead, range_.left, range_.up))
    level = math.hypot(ahead, left)
    x, y, z = (range_.speed * hit.direction).tolist()
    return Shot(
        math.degrees(math.atan2(up, level)),
        math.degrees(math.atan2(left, ahead)) if level > CLOSE else 0.0,
        (x, y, z),
        hit.time,
        hit.miss,
        range_.scenario(hit.direction),
    )


def _unreachable(range_: FiringRange, group: str, nearest: float) -> UsageError:
    """Why nothing hits: a collider keeps the particle away, or it does not fly far enough."""
    world = World(range_.typical)
    radius, what = float(next(state.radius[0] for state in world.states if state.name == group)), "one radius"
    body = next((each for each in range_.typical.bodies if each.name == group), None)
    if body is not None and body.shape.type != "sphere":
        radius, what = body.shape.reach(), "or less, as it is turned"
    there = Particle(*range_.target.tolist(), *[0.0] * 7)
    for collider in range_.typical.all_colliders:
        if not held_back(collider, (group,)):
            continue
        away = np.array([part or 0.0 for part in normal(collider.shape(), there)])
        free = float(gap(collider.shape(), there))
        if free < radius or free < 0:
            # A little more than a radius, so that it is not in the middle of an impact there.
            clear = range_.target + (1.1 * radius + 2 * range_.speed * range_.typical.grid.dt - free) * away
            where = ",".join(f"{part:.4g}" for part in clear)
            return UsageError(
                f"the target is {free:.6g} m from a {collider.kind}, which keeps the centre of {group!r} {radius:.6g} m "
                f"off, {what}",
                f"Aim at a point above it, such as --target {where}",
            )
    return UsageError(
        f"the target is out of range: the nearest that {group!r} comes to it is about {nearest:.3g} m",
        "Launch it faster, come closer, or let the run last longer.",
    )
