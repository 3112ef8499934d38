"""Where laws and numbers stop being valid: monitored during a run, with warnings at its end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from particlesim.colliders import Collider
from particlesim.engine.diagnosis.haste import Haste, haste
from particlesim.engine.diagnosis.overlaps import Caught, caught
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability.limits import double_advised
from particlesim.engine.step.following import MAX_IMPACTS
from particlesim.engine.world import World
from particlesim.errors import UsageError
from particlesim.scenario.reach import acts_on, collider_tables, interacting
from particlesim.scenario.scenario import Scenario

FASTEST = 4
"""Particles looked at per frame and group: the fastest ones."""


TOO_LARGE = "sums of m v²/2, m g y and the like must stay below 1.8e308: smaller numbers, or ledger = false under [output]"
"""What to do about energies that no number can hold."""


LARGEST = float(np.finfo(np.float32).max)
"""What single precision holds."""

STORED = 'precision = "double" under [output] stores it'


def check_ledger(simulation: Simulation) -> None:
    """Refuse a start whose energies or momenta are beyond all numbers. Raises UsageError."""
    if not simulation.scenario.output.ledger:
        return
    if (name := infinite(simulation.ledger())) is not None:
        for island in simulation.islands:
            island.refuse_wild(simulation.time)
        raise UsageError(
            f"the ledger's {name} is not finite at the start: {_extremes(simulation)}",
            double_advised(simulation.scenario) or TOO_LARGE,
        )


def check_stored(world: World) -> None:
    """Refuse a start that double precision holds and the trajectory does not. Raises UsageError."""
    scenario = world.scenario
    if (scenario.simulation.precision, scenario.output.precision) != ("double", "single"):
        return
    for state in world.states:
        for field, values in (("position", state.x), ("velocity", state.v)):
            part = values[:, : state.count]
            if part.size and max(part.max(), -part.min()) > LARGEST:
                raise UsageError(
                    f"the trajectory cannot store a {field} that is beyond {LARGEST:.2g}: {_extremes(world)}",
                    STORED,
                )


def infinite(row: dict[str, float]) -> str | None:
    """The first quantity of a row of the ledger that is not finite, None if all are."""
    return next((name for name, value in row.items() if not math.isfinite(value)), None)


def _extremes(world: World) -> str:
    """How far and how fast particles are, in words."""
    far = [np.abs(state.x[:, : state.count]).max() for state in world.states if state.count]
    fast = [np.abs(state.v[:, : state.count]).max() for state in world.states if state.count]
    return f"coordinates are up to {max(far):.3g} m, velocities up to {max(fast):.3g} m/s"


def called(world: World, collider: Collider) -> str:
    """What messages call a collider."""
    where = next(path for path, each in collider_tables(world.scenario) if each is collider)
    return f"{collider.kind} {collider.name or '.'.join(map(str, where))}"


COARSE = 1e-3
"""The step between two numbers at a place, over the length of an interaction, from which its forces are wrong visibly."""


def coarse(world: World) -> dict[str, tuple[float, float, str]]:
    """Interactions of particles so far from the origin that places are rounded to a part of what the law is about: by label
    the step between two numbers there [m], the length of the law [m], and the precision."""
    found: dict[str, tuple[float, float, str]] = {}
    for each in world.scenario.interactions:
        names = {group.name for group in interacting(each, world.scenario.groups)}
        states = [state for state in world.states if state.name in names and state.count]
        if not states:
            continue
        length = each.length() or getattr(each, "softening", 0.0) or each.reach()
        if each.touching():
            radii = [state.radius[: state.count] for state in states if state.radius is not None]
            length = min((float(r[r > 0].min(initial=np.inf)) for r in radii), default=np.inf)
        far = max(float(np.abs(state.x[:, : state.count]).max()) for state in states)
        step = float(np.finfo(states[0].dtype).eps) * far
        if length and step > COARSE * length:
            found[each.label] = step, length, world.scenario.simulation.precision
    return found


def coarse_told(label: str, step: float, length: float, precision: str, when: str) -> str:
    """That positions are rounded by too much."""
    better = ', or precision = "double"' if precision == "single" else ""
    return (
        f"{label}: {when} particles are so far from the origin that positions are rounded by {step:.2g} m, and the "
        f"interaction acts over {length:.3g} m: place them nearer to the origin{better}"
    )


def haste_told(label: str, each: Haste, when: str) -> str:
    """That particles may pass through each other in a step."""
    return (
        f"{label}: {when} particles move by up to {each.way:.3g} m in a step past others, which is more than their radii "
        f"together, {each.size:.3g} m: they may pass through each other; dt = {each.step:.2g} s lets them touch"
    )


def missed(simulation: Simulation) -> tuple[str, ...]:
    """A sentence where particles or bodies have passed what should have held them back."""
    if (number := simulation.missed_crossings()) == 0:
        return ()
    were = f"{number:,} crossing{'s' if number > 1 else ''} of colliders or bodies {'were' if number > 1 else 'was'} missed"
    if any(each.detection == "discrete" for each in simulation.scenario.all_colliders):
        return (
            f"{were}: with discrete detection what falls between the ends of steps has no effect; "
            'detection = "continuous" looks at the ways of steps',
        )
    return (f"{were}: what should have been held back has passed; a smaller dt may hold it",)


def exhausted(world: World) -> tuple[str, ...]:
    """Sentences where particles or rigid bodies have had more impacts in a step than are followed."""
    return (*_stopped(world), *_kept_back(world), *_stopped_grains(world), *_exhausted(world))


def _stopped(world: World) -> tuple[str, ...]:
    if (number := world.stopped_bodies()) == 0:
        return ()
    from particlesim.engine.rigid.swift import MOST_IMPACTS  # with all that bodies need

    return (
        f"{'once' if number == 1 else f'{number:,} times'} a rigid body had more than {MOST_IMPACTS} impacts in half a "
        "step, and rested until its end: a smaller dt lets it rebound, unless there is no room for it",
    )


def _kept_back(world: World) -> tuple[str, ...]:
    if (number := world.kept_back()) == 0:
        return ()
    return (
        f"{'once' if number == 1 else f'{number:,} times'} a rod to a rigid body would have drawn a particle through a "
        "collider: it stayed before that for the step, with all that hangs on it; a smaller dt lets it go on",
    )


def _stopped_grains(world: World) -> tuple[str, ...]:
    if (number := world.stopped_grains()) == 0:
        return ()
    from particlesim.engine.interactions.hard.ways import MOST_IMPACTS  # with all that grains need

    grains = sum(state.count for each in world.islands if each.stopped_grains() > 0 for state in each.states)
    share = f"{100 * number / (max(world.step, 1) * max(grains, 1)):.2g} % of all steps of grains"
    return (
        f"{'once' if number == 1 else f'{number:,} times'} a hard grain had {MOST_IMPACTS} impacts in a step ({share}), and "
        "stayed where it was until its end: a smaller dt lets it go on, unless there is no room for it",
    )


def _exhausted(world: World) -> tuple[str, ...]:
    if (number := world.exhausted_steps()) == 0:
        return ()
    return (
        f"{'once' if number == 1 else f'{number:,} times'} a particle met colliders more than {MAX_IMPACTS} times in one "
        "step, and finished it without rebound, which may have taken energy: a smaller dt lets it rebound, unless "
        "colliders leave it no room",
    )


def _caught_told(each: Caught, one: str, other: str) -> str:
    """What is wrong where colliders close on a particle."""
    where = f"in {one}" if one == other else f"between {one} and {other}"
    return (
        f"there is no room {where} for particle {each.id} of {each.group!r}, with a radius of {each.radius:.3g} m, which is "
        f"{each.depth:.3g} m inside of {one} there"
    )


class Watch:
    """Collects warnings about laws used outside of their range."""

    def __init__(self, scenario: Scenario) -> None:
        self._largest: dict[str, tuple[float, float]] = {}
        self._overflowed: dict[str, float] = {}
        self._coarse: dict[str, tuple[float, float, str, float]] = {}
        self._hasty: dict[str, tuple[Haste, float]] = {}
        self._caught: dict[str, tuple[str, str, str, str, float]] = {}
        laws: Iterator[tuple[str, Any]] = zip(scenario.labels.forces, scenario.forces, strict=True)
        self._laws = [(label, force) for label, force in laws if force.limited()]

    def look(self, world: World) -> None:
        """Look at the fastest particles of the present state, and at the farthest."""
        for label, each in coarse(world).items():
            self._coarse.setdefault(label, (*each, world.time))
        for label, found in haste(world).items():
            self._hasty.setdefault(label, (found, world.time))
        for island, structure in zip(world.islands, world.graph.islands, strict=True):
            for held in caught(island, structure, world.time, partial(self._told, world)):
                one, other = (called(world, wall) for wall in held.between)
                told = _caught_told(held, one, other), held.group, one, other, world.time
                self._caught[f"{held.group} {one} {other}"] = told
        for label, force in self._laws:
            for group, state in zip(world.scenario.groups, world.states, strict=True):
                if not acts_on(force, group) or not state.count:
                    continue
                speed2 = (state.v[:, : state.count].astype(float) ** 2).sum(axis=0)
                for i in np.argsort(speed2)[-FASTEST:]:
                    excess = force.excess(state.particle(int(i), world.time))
                    if excess > max(1.0, self._largest.get(label, (0.0, 0.0))[0]):
                        self._largest[label] = (excess, world.time)

    def _told(self, world: World, group: str, collider: Collider) -> bool:
        """Whether it is known that a collider leaves particles of a group no room; at the start that is told before."""
        if world.time == 0:
            return True
        name = called(world, collider)
        return any(group == each and name in (one, other) for _, each, one, other, _ in self._caught.values())

    def overflowed(self, field: str, time: float) -> None:
        """Take note of a field that the trajectory stores as infinite at a time [s], though it is not."""
        self._overflowed.setdefault(field, time)

    def state(self) -> dict[str, dict[str, Any]]:
        """What it has seen so far, as plain data."""
        return {
            "reynolds": self._largest,
            "overflowed": self._overflowed,
            "coarse": self._coarse,
            "hasty": self._hasty,
            "caught": self._caught,
        }

    def restore(self, state: Mapping[str, Mapping[str, Any]]) -> None:
        """Go on from a `state`."""
        self._largest = {label: (excess, time) for label, (excess, time) in state["reynolds"].items()}
        self._overflowed = dict(state["overflowed"])
        self._coarse = {
            label: (step, length, precision, time)
            for label, (step, length, precision, time) in state.get("coarse", {}).items()
        }

        self._hasty = {label: (Haste(*each), time) for label, (each, time) in state.get("hasty", {}).items()}
        self._caught = {label: tuple(told) for label, told in state.get("caught", {}).items()}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to tell the user."""
        stored = tuple(
            f"{field}: from t = {time:.6g} s on, some are beyond {LARGEST:.2g} and stored as infinite; {STORED}"
            for field, time in self._overflowed.items()
        )
        laws = dict(self._laws)
        rounded = tuple(
            coarse_told(label, step, length, precision, f"from t = {time:.6g} s on")
            for label, (step, length, precision, time) in self._coarse.items()
            if time > 0
        )
        passed = tuple(
            haste_told(label, each, f"from t = {time:.6g} s on")
            for label, (each, time) in self._hasty.items()
            if time > 0
        )
        between = tuple(
            f"in the frame at t = {time:.6g} s {told}" for told, *_, time in self._caught.values()
        )
        return (
            stored
            + rounded
            + passed
            + between
            + tuple(
                f"{label}: {laws[label].beyond(excess, time)}"
                for label, (excess, time) in self._largest.items()
            )
        )
