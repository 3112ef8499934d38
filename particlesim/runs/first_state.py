"""What is doubtful in the first state: a sentence for each, told before a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders.combination import Combination
from particlesim.colliders.content import files_in
from particlesim.colliders.mesh import told_of_flat
from particlesim.colliders.solid import Solid
from particlesim.colliders.thinness import step_of_search, thinnest_wall
from particlesim.engine.diagnosis.crowding import crowded, crowded_births
from particlesim.engine.diagnosis.haste import haste
from particlesim.engine.diagnosis.overlaps import no_room, overlaps
from particlesim.engine.diagnosis.slits import slits
from particlesim.engine.islands.base import Intrusion
from particlesim.engine.stability.limits import remedy
from particlesim.engine.world import World
from particlesim.runs.validity import called, coarse, coarse_told, haste_told
from particlesim.scenario.reach import collider_tables, held_back, meetings_of
from particlesim.scenario.scenario import Scenario

THINNEST = 64
"""The thickness of shapes, in steps between two numbers at a place, from which on contact knows their sides for sure."""
SURE = 1e-9
"""What is thicker than this part of all that there is has been tried, where no search goes in steps."""
BLOCK = 1 << 16
"""Particles that are looked at together."""
LIES_IN = 0.1
"""How deep a grain with soft contact may be in a collider at rest, as a part of its radius."""
PUT = "the first step puts them on its surface, which changes their energy"
PUSHED = "its contact pushes them out, with all the energy that this stores"


def doubtful(world: World) -> tuple[str, ...]:
    """A sentence for everything in the first state that is doubtful."""
    return (
        *misplaced(world),
        *embedded(world),
        *squeezed(world),
        *(coarse_told(label, *each, "at the start") for label, each in coarse(world).items()),
        *(haste_told(label, each, "at the start") for label, each in haste(world).items()),
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
            (name, number), where = crammed.body, called(world, crammed.other)
            found.append(
                f"body {number} of {name!r} does not fit into {where} in its orientation: contact moves it from one side "
                "to the other in every step"
            )
        looked: set[tuple[str, int]] = (
            set()
        )  # no room is told of a particle once, however many colliders it is in
        for overlap in overlaps(island, structure):
            state = overlap.state
            soft = structure.touched_softly(state.name)
            if soft and overlap.depth < LIES_IN * state.radius[overlap.deepest]:
                continue
            found.append(
                f"{overlap.number:,} of {state.count:,} particles of {state.name!r} start inside "
                f"{called(world, overlap.collider)}, the deepest (id {state.id[overlap.deepest]}) by {overlap.depth:.3g} m: "
                + (PUSHED if soft else PUT)
            )
            if (state.name, overlap.deepest) in looked:
                continue
            looked.add((state.name, overlap.deepest))
            held = structure.colliders[island.states.index(state)]
            if (walls := no_room(overlap, [each for each in held if each.contact == "bounce"])) is not None:
                one, other = (called(world, each) for each in walls)
                where = f"into {one}" if one == other else f"between {one} and {other}"
                found.append(
                    f"particle {state.id[overlap.deepest]} of {state.name!r}, with a radius of "
                    f"{state.radius[overlap.deepest]:.3g} m, does not fit {where}: contact moves it from one side to the "
                    "other in every step"
                )
    return tuple(dict.fromkeys(found))


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
    what = f"body {other[1]} of {other[0]!r}" if isinstance(other, tuple) else called(world, other)
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


def too_thin(world: World) -> tuple[str, ...]:
    """A sentence for every shape so thin that places are rounded to a part of it and of what touches it, or that has a wall
    so thin, or thinner than the steps in which impacts on it are searched.

    Single precision keeps places in steps of ε |x|. On its way in a step a particle is looked at in double precision, where
    gaps below 16 ε times its coordinates, the size of all colliders, and how far it moves in two steps are rounding; of
    those that move with the ε of single precision, as they come upon places that are rounded.
    """
    scenario = world.scenario
    found: list[str] = []
    precision, tables = scenario.simulation.precision, [each for _, each in collider_tables(scenario)]
    if not tables:
        return ()
    sizes = [_largest(state.x[:, : state.count]) for state in world.states]
    speeds = [_largest(state.v[:, : state.count])[1] for state in world.states]
    far, size = (max((each[k] for each in sizes), default=0.0) for k in (0, 1))
    way = 2 * scenario.grid.dt * max(speeds, default=0.0)
    size += way + max(each.reach() for each in tables)
    for collider in tables:
        touching = [group.least_size() for group in scenario.groups if held_back(collider, (group.name,))]
        if not touching or not isinstance(collider, Solid) or getattr(collider, "inside", False):
            continue
        diameter = 2 * min(0.0 if each is None else each[1] for each in touching)
        step = max(
            float(np.finfo(precision).eps) * max(far, float(np.abs(collider.pivot()).max())),
            float(np.finfo(float if collider.motion is None else precision).eps) * size,
        )
        found.extend(_thin(collider, called(world, collider), diameter, step, size, precision))
    return tuple(found)


def _largest(vectors: NDArray[Any]) -> tuple[float, float]:
    """The largest coordinate and the largest sum of coordinates of vectors [3, n], without a copy of all."""
    most = total = 0.0
    for first in range(0, vectors.shape[1], BLOCK):
        block = np.abs(vectors[:, first : first + BLOCK])
        most, total = max(most, float(block.max())), max(total, float(block.sum(axis=0).max()))
    return most, total


def _thin(
    collider: Solid, name: str, diameter: float, step: float, size: float, precision: str
) -> Iterator[str]:
    """What there is to tell of a collider where positions are rounded by a step, which things of a diameter touch [m]."""
    better = ', or precision = "double"' if precision == "single" else ""
    if collider.waist() + diameter < THINNEST * step:
        yield (
            f"{name} is {collider.waist():.3g} m thick, and positions there are rounded by {step:.2g} m: "
            f"what touches it may pass. Make it {THINNEST * step:.2g} m thick at least{better}"
        )
    elif isinstance(collider, Combination):
        search = step_of_search(collider)
        least = max(search, THINNEST * step)
        if least > SURE * size and diameter < least:
            wall = thinnest_wall(collider, least - diameter)
            if wall is not None:
                yield (
                    f"{name} has a wall of {wall.thickness:.2g} m near {_place(wall.place)}: what touches it may pass. "
                    f"Make it {least - diameter:.2g} m thick at least, or of a rectangle or a box of its own"
                    + (better if least > search else "")
                )


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


def _pairs(number: int) -> str:
    return f"{number:,} pair{'s' if number > 1 else ''} of particles"
