"""Springs at bodies at the start: their end points, their stiffness, and their lines in a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from particlesim.bonds import Springs, record_of
from particlesim.bonds.pairs import SINGLE
from particlesim.bonds.pairs import WORLD as WORLD_NAME
from particlesim.engine.rigid.bodies import WORLD, Bodies
from particlesim.engine.rigid.joint_system import centre, frame, own_points, rows_of
from particlesim.engine.rigid.springs import BodySprings
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology


class Laid(NamedTuple):
    """The springs of one table: their name in the ledger, and as kernels take them. Of springs to particles these are of the
    group `tied`, and `second` are their rows there; None for all others. `breaks`: whether they can break."""

    name: str
    springs: BodySprings
    tied: str | None
    breaks: bool


def body_springs(
    scenario: Scenario, seats: Mapping[str, Ints], b: Bodies, particles: Mapping[str, GroupState]
) -> tuple[Laid, ...]:
    """All springs of bodies; `seats` are the rows of bodies by groups."""
    return tuple(_laid(scenario, label, each, seats, b, particles) for label, each in scenario.body_springs)


def _laid(
    scenario: Scenario,
    label: str,
    springs: Springs,
    seats: Mapping[str, Ints],
    b: Bodies,
    particles: Mapping[str, GroupState],
) -> Laid:
    """A frequency and a damping ratio are meant for the mass μ that swings along the spring at the start,
    1/μ = Σ 1/m + (r × e)·I⁻¹(r × e).

    Raises UsageError for springs that may break by their strain and have no length.
    """
    names, pairs = springs.groups(), springs.pairs or SINGLE
    points = own_points(scenario, names, springs.points)
    if names[0] in particles:  # a particle comes second
        names, points, pairs = (names[1], names[0]), points[::-1], tuple((k, i) for i, k in pairs)
    tied = particles.get(names[1])
    rows_there = seats if tied is None else {**seats, names[1]: np.arange(tied.count)}
    rows = np.array(list(rows_of(rows_there, names, pairs)), np.int64)
    first, second = rows[:, 0].copy(), rows[:, 1].copy()
    far = np.zeros((len(rows), 3))
    for k, (i, j) in enumerate(rows.tolist()):
        other = frame(b, j) @ points[1] + centre(b, j) if tied is None else tied.x[:, j].astype(float)
        far[k] = frame(b, i) @ points[0] + centre(b, i) - other
    with np.errstate(over="ignore"):  # what is too far is told by what it stores
        length = np.linalg.norm(far, axis=1)
    along = np.divide(far, length[:, None], out=np.zeros_like(far), where=length[:, None] > 0)
    inverse = _yielding(b, first, points[0], along)
    inverse += _yielding(b, second, points[1], along) if tied is None else _weights(tied)[second]
    law = springs.spring_law()
    mass = np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0)
    stiffness, damping = law.constants(mass)
    if law.break_strain is not None and law.rest_length is None and not length.all():
        raise UsageError(
            f"{label}: both ends are at the same place; a strain needs a length to compare with",
            "give a rest_length, or break_force instead of break_strain",
        )
    rest = length if law.rest_length is None else np.full(len(rows), law.rest_length)
    one, two = (np.ascontiguousarray(np.repeat(point[:, None], len(rows), axis=1)) for point in points)
    limits = (np.inf if each is None else each for each in (law.break_strain, law.break_force))
    constants = (stiffness, damping, rest, *limits, np.full(len(rows), np.inf))
    made = BodySprings(record_of(law), first, second, one, two, *constants)
    return Laid(label, made, None if tied is None else names[1], law.breaks)


def _yielding(b: Bodies, bodies: Ints, point: Floats, along: Floats) -> Floats:
    """How much a point of each body yields to a force along a direction [1/kg]; the world does not."""
    found = np.zeros(len(bodies))
    for k, i in enumerate(bodies.tolist()):
        if i != WORLD:
            moment = np.cross(point, frame(b, i).T @ along[k])
            found[k] = b.w[i] + float((moment**2 / b.inertia[:, i]).sum())
    return found


def _weights(state: GroupState) -> Floats:
    """1/m of particles [1/kg], 0 of those that are held."""
    weight = 1 / state.mass[: state.count].astype(float)
    if state.clocked:
        weight[~np.isfinite(state.start[: state.count])] = 0.0
    return np.asarray(weight)


def lines(
    scenario: Scenario, ids: Mapping[str, Ints], rest: Mapping[str, Floats], broke: Mapping[str, Floats]
) -> list[Topology]:
    """Springs at bodies as a trajectory keeps them, with the ids of groups, and rest lengths and, of those that may break,
    when they did, by the names of their sets."""
    found = []
    for name, each in scenario.body_springs:
        pairs = each.pairs or SINGLE
        known = [np.array([-1]) if group == WORLD_NAME else ids[group] for group in each.groups()]
        ends = np.array([[known[0][i], known[1][k]] for i, k in pairs], np.int64)
        points = np.broadcast_to(np.array(each.points or np.zeros((2, 3)), float), (len(pairs), 2, 3))
        whole = np.full(len(pairs), np.inf)
        found.append(
            Topology(
                name,
                ends,
                rest[name],
                broke.get(name, whole),
                breakable=name in broke,
                points=np.array(points),
            )
        )
    return found
