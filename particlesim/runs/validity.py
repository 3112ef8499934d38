"""Where laws and numbers stop being valid: monitored during a run, with warnings at its end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from particlesim.colliders import Collider
from particlesim.colliders.content import files_in
from particlesim.colliders.mesh import told_of_flat
from particlesim.colliders.solid import Solid
from particlesim.engine.diagnosis.crowding import crowded, crowded_births
from particlesim.engine.diagnosis.haste import Haste, haste
from particlesim.engine.diagnosis.overlaps import Caught, caught, no_room, overlaps
from particlesim.engine.diagnosis.slits import slits
from particlesim.engine.islands.base import Intrusion
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability.limits import double_advised, remedy
from particlesim.engine.step.following import MAX_IMPACTS
from particlesim.engine.world import World
from particlesim.errors import UsageError
from particlesim.scenario.reach import acts_on, collider_tables, held_back, interacting, meetings_of
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


def doubtful(world: World) -> tuple[str, ...]:
    """A sentence for everything in the first state that is doubtful."""
    return (
        *misplaced(world),
        *embedded(world),
        *squeezed(world),
        *(_coarse_told(label, *each, "at the start") for label, each in coarse(world).items()),
        *(_haste_told(label, each, "at the start") for label, each in haste(world).items()),
        *stiff(world),
        *knotted(world),
        *slits(world),
        *too_thin(world),
        *flat_triangles(world.scenario),
        *shapes_of_bodies(world.scenario),
    )


def misplaced(world: World) -> tuple[str, ...]:
    """A sentence for every group and collider with particles that are inside of it at the start, and for every group with
    particles that are outside of a periodic box."""
    found = outside_of_box(world)
    for island, structure in zip(world.islands, world.graph.islands, strict=True):
        if intrusions := island.intrusions():
            found.append(_intruding(world, intrusions))
        crammed = island.crammed() if intrusions else None
        if crammed is not None and not isinstance(crammed.other, tuple):
            (name, number), where = crammed.body, _called(world, crammed.other)
            found.append(
                f"body {number} of {name!r} does not fit into {where} in its orientation: contact moves it from one side "
                "to the other in every step"
            )
        looked: set[tuple[str, int]] = (
            set()
        )  # no room is told of a particle once, however many colliders it is in
        for overlap in overlaps(island, structure):
            state = overlap.state
            found.append(
                f"{overlap.number:,} of {state.count:,} particles of {state.name!r} start inside "
                f"{_called(world, overlap.collider)}, the deepest (id {state.id[overlap.deepest]}) by {overlap.depth:.3g} "
                "m: the first step puts them on its surface, which changes their energy"
            )
            if (state.name, overlap.deepest) in looked:
                continue
            looked.add((state.name, overlap.deepest))
            held = structure.colliders[island.states.index(state)]
            if (walls := no_room(overlap, [each for each in held if each.contact == "bounce"])) is not None:
                one, other = (_called(world, each) for each in walls)
                where = f"into {one}" if one == other else f"between {one} and {other}"
                found.append(
                    f"particle {state.id[overlap.deepest]} of {state.name!r}, with a radius of "
                    f"{state.radius[overlap.deepest]:.3g} m, does not fit {where}: contact moves it from one side to the "
                    "other in every step"
                )
    return tuple(dict.fromkeys(found))


def _called(world: World, collider: Collider) -> str:
    """What messages call a collider."""
    where = next(path for path, each in collider_tables(world.scenario) if each is collider)
    return f"{collider.kind} {collider.name or '.'.join(map(str, where))}"


def outside_of_box(world: World) -> list[str]:
    """Which groups have particles outside of the periodic box."""
    box = world.scenario.simulation.box
    if box is None:
        return []
    axes = np.flatnonzero(box.periodic)
    low = np.array(box.origin)[axes, None]
    high = low + np.array(box.size)[axes, None]
    found = []
    for state in world.states:
        x = state.x[axes, : state.count]
        if number := int(((x < low) | (x > high)).any(axis=0).sum()):
            found.append(
                f"{number:,} of {state.count:,} particles of {state.name!r} start outside of the periodic box: their "
                "images inside of it are used"
            )
    return found


def _intruding(world: World, intrusions: list[Intrusion]) -> str:
    """What bodies are inside of at the start, and how deep."""
    (name, number), other, depth = intrusions[0]
    what = f"body {other[1]} of {other[0]!r}" if isinstance(other, tuple) else _called(world, other)
    pairs = f"{len(intrusions):,} pairs overlap" if len(intrusions) > 1 else "one pair overlaps"
    return (
        f"rigid bodies start inside of others: {pairs}, the deepest of them body {number} of {name!r} and {what} by "
        f"{depth:.3g} m; the first steps push them apart, which may change their energy"
    )


def embedded(world: World) -> tuple[str, ...]:
    """A sentence for every group with particles that begin inside of rigid bodies which they touch."""
    if not (meetings := meetings_of(world.scenario)):
        return ()
    from particlesim.engine.diagnosis.embedding import embedding

    found = []
    for each in meetings:
        number, deepest, body, depth = embedding(world, each.particles, each.bodies)
        if number:
            what, begin = ("particle", "begins") if number == 1 else ("particles", "begin")
            found.append(
                f"{each.label}: {number:,} {what} of {each.particles!r} {begin} inside of rigid bodies, the deepest "
                f"(id {deepest}) in body {body} of {each.bodies!r} by {depth:.3g} m; the first steps push them apart, which "
                "may change their energy"
            )
    return tuple(found)


def stiff(world: World) -> tuple[str, ...]:
    """A sentence where steps are too long for springs at rigid bodies."""
    dt = world.grid.dt
    limits = (island.longest_step() for island in world.islands)
    return tuple(
        f"dt = {dt:.6g} s is beyond the largest stable step under springs at rigid bodies, {limit:.3g} s: "
        f"{remedy(limit, limited=True)}"
        for limit in limits
        if dt > limit
    )


def squeezed(world: World) -> tuple[str, ...]:
    """A sentence for every interaction by contact with particles that overlap each other at the start, or did, or will when
    they are born."""
    apart = [
        f"{each.label}: {_pairs(each.number)} overlapped at the start, the deepest by {each.depth:.3g} m: they have been "
        f"moved apart, by up to {each.way:.3g} m"
        + (f", and overlap by up to {each.left:.3g} m still, as there is no room" if each.cramped else "")
        + '; overlap = "keep" leaves them where they are'
        for each in world.separations
    ]
    known = {each.label for each in world.separations}
    found = [
        f"{each.label}: {_pairs(each.number)} overlap at the start, the deepest (ids {each.ids[0]} and {each.ids[1]}) by "
        f"{each.depth:.3g} m; they move apart"
        for each in crowded(world)
        if each.label not in known
    ]
    births = [
        f"{each.label}: {each.number} of the first {each.looked_at} particles of {each.emitter!r} are born in others, up to "
        f"{each.depth:.2g} of a radius deep, unless something else moves these away: soft contacts throw them apart; a "
        "larger shape, a lower rate or more speed lets them be born apart"
        for each in crowded_births(world)
    ]
    return (*apart, *found, *births)


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


def _coarse_told(label: str, step: float, length: float, precision: str, when: str) -> str:
    better = ', or precision = "double"' if precision == "single" else ""
    return (
        f"{label}: {when} particles are so far from the origin that positions are rounded by {step:.2g} m, and the "
        f"interaction acts over {length:.3g} m: place them nearer to the origin{better}"
    )


THINNEST = 64
"""The thickness of shapes, in steps between two numbers at a place, from which on contact knows their sides for sure."""


def too_thin(world: World) -> tuple[str, ...]:
    """A sentence for every shape so thin that places are rounded to a part of it and of what touches it.

    Single precision keeps places in steps of ε |x|. On its way in a step a particle is looked at in double precision, where
    gaps below 16 ε times its coordinates, the size of all colliders, and how far it moves in two steps are rounding.
    """
    scenario, found = world.scenario, []
    precision, tables = scenario.simulation.precision, [each for _, each in collider_tables(scenario)]
    states = [state for state in world.states if state.count]
    places = [np.abs(state.x[:, : state.count]) for state in states]
    speeds = [np.abs(state.v[:, : state.count]) for state in states]
    far = max((float(x.max()) for x in places), default=0.0)
    size = max((float(x.sum(axis=0).max()) for x in places), default=0.0)
    way = 2 * scenario.grid.dt * max((float(v.sum(axis=0).max()) for v in speeds), default=0.0)
    size += way + max((each.reach() for each in tables), default=0.0)
    for collider in tables:
        thickness = (
            collider.waist()
            if isinstance(collider, Solid) and not getattr(collider, "inside", False)
            else np.inf
        )
        touching = [group.least_size() for group in scenario.groups if held_back(collider, (group.name,))]
        if not touching or not np.isfinite(thickness):
            continue
        radius = min(0.0 if each is None else each[1] for each in touching)
        step = max(
            float(np.finfo(precision).eps) * max(far, float(np.abs(collider.pivot()).max())),
            float(np.finfo(float).eps) * size,
        )
        if thickness + 2 * radius < THINNEST * step:
            better = ', or precision = "double"' if precision == "single" else ""
            found.append(
                f"{_called(world, collider)} is {thickness:.3g} m thick, and positions there are rounded by {step:.2g} m: "
                f"what touches it may pass. Make it {THINNEST * step:.2g} m thick at least{better}"
            )
    return tuple(found)


def _haste_told(label: str, each: Haste, when: str) -> str:
    return (
        f"{label}: {when} particles move by up to {each.way:.3g} m in a step past others, which is more than their radii "
        f"together, {each.size:.3g} m: they may pass through each other; dt = {each.step:.2g} s lets them touch"
    )


def _pairs(number: int) -> str:
    return f"{number:,} pair{'s' if number > 1 else ''} of particles"


def knotted(world: World) -> tuple[str, ...]:
    """A sentence for every contact of surfaces and strands that cross, or are too close, at the start."""
    if not any(island.interactions for island in world.islands):
        return ()
    from particlesim.engine.diagnosis.tangles import tangled

    found = []
    for each in tangled(world):
        what, alone = " and ".join(dict.fromkeys(map(repr, each.groups))), each.groups[0] == each.groups[1]
        number = each.crossing or each.close
        places = f"{number:,} place{'s' if number > 1 else ''}"
        if each.crossing:
            found.append(
                f"{each.label}: {what} cross{'es itself' if alone else ''} at the start in {places}, the first near "
                f"{_place(each.place)}: they stay crossed, as contacts keep everything on the side on which it begins"
            )
        else:
            found.append(
                f"{each.label}: {what} touch{'es itself' if alone else ''} at the start in {places}, near "
                f"{_place(each.narrow)} {each.distance:.3g} m apart instead of {each.thickness:.3g} m, the sum of "
                "the radii; they move apart. Next to each other in a mesh this needs smaller radii, or fewer particles"
            )
    return tuple(found)


def _place(x: Any) -> str:
    """A place in words [m]."""
    return f"({', '.join(f'{each:.3g}' for each in x)}) m"


def flat_triangles(scenario: Scenario) -> tuple[str, ...]:
    """A sentence for every mesh that particles collide with some of whose triangles have no area."""
    return tuple(
        told_of_flat(solid.path, solid.dropped)
        for collider in scenario.colliders
        for _, solid in files_in(collider)
        if solid.dropped
    )


def shapes_of_bodies(scenario: Scenario) -> tuple[str, ...]:
    """What there is to tell of the shapes of rigid bodies."""
    return tuple(
        f"bodies {body.name!r}: {remark}" for body in scenario.bodies for remark in body.shape.remarks()
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
    return (*_stopped(world), *_stopped_grains(world), *_exhausted(world))


def _stopped(world: World) -> tuple[str, ...]:
    if (number := world.stopped_bodies()) == 0:
        return ()
    from particlesim.engine.rigid.swift import MOST_IMPACTS  # with all that bodies need

    return (
        f"{'once' if number == 1 else f'{number:,} times'} a rigid body had more than {MOST_IMPACTS} impacts in half a "
        "step, and rested until its end: a smaller dt lets it rebound, unless there is no room for it",
    )


def _stopped_grains(world: World) -> tuple[str, ...]:
    if (number := world.stopped_grains()) == 0:
        return ()
    from particlesim.engine.interactions.hard.ways import MOST_IMPACTS  # with all that grains need

    return (
        f"{'once' if number == 1 else f'{number:,} times'} a hard grain had {MOST_IMPACTS} impacts in a step, and stayed "
        "where it was until its end: a smaller dt lets it go on, unless there is no room for it",
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
                one, other = (_called(world, wall) for wall in held.between)
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
        name = _called(world, collider)
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
            _coarse_told(label, step, length, precision, f"from t = {time:.6g} s on")
            for label, (step, length, precision, time) in self._coarse.items()
            if time > 0
        )
        passed = tuple(
            _haste_told(label, each, f"from t = {time:.6g} s on")
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
