"""From the graph to what kernels take: records of methods, dynamics, forces and contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particlesim.bodies import Bodies
from particlesim.colliders import Collider, Plane
from particlesim.colliders.bounds import edge
from particlesim.colliders.response import ColliderRecord, crossable
from particlesim.colliders.seams import closed
from particlesim.emitters import Emitter
from particlesim.engine.step.contacts import Careful, Simple
from particlesim.engine.step.particle_step import Newtonian, Overdamped, Tracer
from particlesim.engine.step.program import Program
from particlesim.engine.step.resting import round_inside
from particlesim.forces import Force
from particlesim.graph.graph import Island
from particlesim.groups.group import FirstOrder, Group, Particles, TracerMotion
from particlesim.laws.registry import STICK
from particlesim.model.vectors import dot, unit

CONTACT_TOLERANCE = 16
"""Overlap that counts as touching, in units of the rounding error of the coordinates."""
SMALLEST = 1e-9
"""How large several colliders are at least, for those errors [m]: in a corner of planes at the origin coordinates have none,
and hops in it would die out for a thousand impacts."""

FEW, SOME = 2, 6
"""How many colliders that are not planes are met in vectors at most: with more, a kernel takes long to compile, and to run.
`SOME` is for methods with a memory, and for cores, for which it is not known how far particles are from colliders."""


def as_precision(record: Any, dtype: np.dtype[Any]) -> Any:
    """A record with all its numbers in the run's precision. Integers and None stay."""
    if isinstance(record, tuple):
        parts = [as_precision(part, dtype) for part in record]
        return type(record)(*parts) if hasattr(record, "_fields") else tuple(parts)
    if isinstance(record, float):
        with np.errstate(over="ignore"):  # what is infinite is told where it acts
            return dtype.type(record)
    return record


def dynamics_record(group: Group) -> tuple[Any, ...]:
    """How the particles of a group respond to force."""
    if isinstance(group.dynamics, TracerMotion):
        return Tracer(tuple(flow.record() for flow in group.dynamics.flow))
    if isinstance(group.dynamics, FirstOrder):
        return Overdamped(group.dynamics.drag, tuple(flow.record() for flow in group.dynamics.flow))
    return Newtonian()


def contacts_record(
    colliders: Sequence[Collider],
    group: Group,
    dtype: np.dtype[Any],
    heard: Sequence[int | None] = (),
    *,
    smooth: bool = False,
    few: int = FEW,
    turning: bool = False,
    even: bool = False,
    late: bool = False,
    until: float = 0.0,
) -> Simple | Careful:
    """What the particles of a group may touch, in the simplest form that is right. `heard` are the numbers of those to whose
    impacts emitters react, None for others; none unless given. `smooth`: without friction. `few`: how many colliders that
    are not planes are met in vectors at most; where there are more, each particle near them is looked at by itself.
    `turning`: forces depend on the place, and may turn along the way of what lies on a collider. `even`: they do not;
    `late`: velocities are not those of the places, and it is not known by what. `until`: how long colliders move [s]."""
    bounds: tuple[Any, ...] = ()
    if isinstance(group, Emitter) and group.die is not None and group.die.outside is not None:
        bounds = (edge(*group.die.outside),)
    # Without inertia nothing rebounds: such particles are put back on the surface that they would cross.
    inert = group.dynamics.type != "second_order"
    numbers = heard or [None] * len(colliders)
    records = {id(c): _numbered(c.record(), k) for c, k in zip(colliders, numbers, strict=True)}
    hard = [each for each in colliders if inert or not each.soft]
    if inert or smooth:
        records = {key: without_friction(each) for key, each in records.items()}
    for each in hard:
        if each.turns_in_place() and is_smooth(records[id(each)]):
            records[id(each)] = records[id(each)]._replace(shape=each.shape())
    reach = max((each.reach() for each in hard), default=0.0)
    if len(hard) > 1:
        reach = max(reach, SMALLEST)
    firm = [id(each) for each in hard if each.detection == "continuous" and not inert]
    shapes = closed([records[key].shape for key in firm], reach, dtype, until)
    for key, shape in zip(firm, shapes, strict=True):
        records[key] = records[key]._replace(shape=shape)
    if turning:
        records = {key: under_turning(each) for key, each in records.items()}
    if even:
        records = {key: under_even(each, late) for key, each in records.items()}
    soft = tuple(each.record() for each in colliders if each.soft and not inert)
    continuous = [records[key] for key in firm]
    discrete = [
        without_yielding(records[id(each)]) if inert else records[id(each)]
        for each in hard
        if each.detection == "discrete" or inert
    ]
    silent = all(number is None for number in numbers)
    if silent and not continuous and (len(hard) <= 1 or _at_right_angles(hard)):
        return Simple((*discrete, *bounds), soft)
    resting = [without_rebound(each) for each in continuous]
    tolerance = CONTACT_TOLERANCE * float(np.finfo(dtype).eps)
    bodies = sum(not isinstance(each, Plane) for each in hard)
    one_by_one = () if bodies > few or any(each.costly for each in hard) else None
    return Careful(
        tuple(continuous), tuple(resting), (*discrete, *bounds), tolerance, reach, one_by_one, soft
    )


def _numbered(c: ColliderRecord, number: int | None) -> ColliderRecord:
    """The same collider, with a number for emitters that react to its impacts."""
    return c._replace(response=c.response._replace(heard=number))


def under_turning(c: ColliderRecord) -> ColliderRecord:
    """The same collider under forces that may turn along the way of what lies on it."""
    return c._replace(response=c.response._replace(turning=()))


def under_even(c: ColliderRecord, late: bool) -> ColliderRecord:
    """The same collider under forces that are the same all along it, if that matters there."""
    round_there, even = c.response.loss == 0 and round_inside(c.shape), ((),) if late else ()
    return c._replace(response=c.response._replace(even=even)) if round_there else c


def without_rebound(c: ColliderRecord) -> ColliderRecord:
    """The same collider for particles that lie on it."""
    return c._replace(response=c.response._replace(bounce=min(c.response.bounce, 1.0), falling=None))


def without_friction(c: ColliderRecord) -> ColliderRecord:
    """The same collider without friction, for particles without inertia, and for those that rotate (`rubbing`)."""
    return c._replace(response=c.response._replace(friction=None, belt=None))


def is_smooth(c: ColliderRecord) -> bool:
    """Whether contact changes a velocity along the normal alone."""
    r = c.response
    return r.friction is None and r.belt is None and r.loss == 0 and r.outcome != STICK


def without_yielding(c: ColliderRecord) -> ColliderRecord:
    """The same collider for particles without inertia, which are put back at once."""
    return c._replace(response=c.response._replace(yielding=None))


def _at_right_angles(colliders: Sequence[Collider]) -> bool:
    """Whether they are planes, and meeting one after the other never brings a particle back into an earlier one."""
    planes = [each for each in colliders if isinstance(each, Plane) and each.motion is None]
    if len(planes) < len(colliders):
        return False
    normals = [unit(plane.normal) for plane in planes]
    pairs = [(a, b) for k, a in enumerate(normals) for b in normals[:k]]
    # Parallel planes are met one at a time, unless they leave no room between them.
    return all(abs(dot(a, b)) < 1e-15 or dot(a, b) < -1 + 1e-15 for a, b in pairs)


def group_program(
    island: Island, forces: Sequence[Force], colliders: Sequence[Collider], group: Group, dtype: np.dtype[Any]
) -> Program:
    """What is compiled for a group of independent particles."""
    program = Program(
        island.method.record(),
        dynamics_record(group),
        tuple(force.record() for force in forces),
        contacts_record(
            colliders,
            group,
            dtype,
            island.heard[0] if island.heard else (),
            few=SOME if island.method.memory else FEW,
            turning=any(force.by_place for force in forces),
            even=not any(force.by_place for force in forces),
            until=island.duration,
        ),
    )
    return as_precision(program, dtype)


def may_miss(colliders: Sequence[Collider], group: Group) -> bool:
    """Whether the way of a step may lead a particle of a group through a collider, which is counted."""
    return any(crossable(each.record()) for each in colliders) and not isinstance(group, Bodies)


def may_exhaust(colliders: Sequence[Collider], group: Group) -> bool:
    """Whether particles of a group are followed from impact to impact within a step."""
    inert = group.dynamics.type != "second_order" or isinstance(group, Bodies)
    return any(each.detection == "continuous" for each in colliders) and not inert


def needs_clock(group: Group, colliders: Sequence[Collider], led: bool) -> bool:
    """Whether particles of a group may be born, die, stick or be pinned; those that a motion leads are pinned."""
    pinned = isinstance(group, Particles) and (led or group.has_pins())
    return (
        isinstance(group, Emitter) or pinned or any(each.contact in ("stick", "kill") for each in colliders)
    )
