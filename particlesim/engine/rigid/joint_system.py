"""The joints and rods of bodies at the start: their ends in the frames of their bodies, their connected components, and the
order and profile in which they are solved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies import BallJoint, HingeJoint, Joint
from particlesim.bonds.pairs import SINGLE
from particlesim.bonds.pairs import WORLD as WORLD_NAME
from particlesim.bonds.rod import LENGTH_TOLERANCE, SPEED_TOLERANCE
from particlesim.engine.rigid.bodies import WORLD, Bodies
from particlesim.engine.rigid.joints import BALL, HINGE, ROD, ROWS, Joints
from particlesim.engine.rigid.rods import rod_lists
from particlesim.engine.rigid.rotation import angular_velocity, matrix
from particlesim.engine.rigid.stops import Stops
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.diagnose import scenario_error


class Made(NamedTuple):
    """A joint: its kind, its bodies by rows (the second may be WORLD), its ends in their frames, the axis of a hinge in the
    frame of the first body and two across it in that of the second, the length of a rod, its size [m], its name for people,
    and whether its bodies touch each other; what stops it; where it is stated, and what its two bodies are called."""

    kind: int
    first: int
    second: int
    end: Floats
    other_end: Floats
    axis: Floats
    across: Floats
    also_across: Floats
    length: float
    size: float
    name: str
    touch: bool
    stop: Stop | None = None
    stated: Path | None = None
    called: tuple[str, str] = ("", "")


class Stop(NamedTuple):
    """What bounds or drives a joint, as `Stops` have it."""

    mark: Floats
    other: Floats
    low: float
    high: float
    speed: float
    torque: float
    cone: bool


def frame(b: Bodies, i: int) -> Floats:
    """Rotation matrix of a body, shape [3, 3]; that of the world is one."""
    return np.eye(3) if i == WORLD else np.reshape(matrix(b.turn[:, i]), (3, 3))


def centre(b: Bodies, i: int) -> Floats:
    """Centre of a body [m]; that of the world is its origin."""
    return np.zeros(3) if i == WORLD else b.x[:, i].copy()


def rows_of(
    seats: Mapping[str, Ints], groups: tuple[str, str], pairs: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Rows of both bodies of every pair of indices."""
    for i, k in pairs:
        yield int(seats[groups[0]][i]), WORLD if groups[1] == WORLD_NAME else int(seats[groups[1]][k])


def own_points(scenario: Scenario, groups: tuple[str, str], points: Any) -> Floats:
    """The two ends that are given along the axes of shapes (None: the centres), along the principal axes; shape [2, 3]."""
    found = np.array(np.zeros((2, 3)) if points is None else points, float)
    axes = {group.name: group.shape.frame().axes for group in scenario.bodies}
    for k, name in enumerate(groups):
        if name in axes:
            found[k] = axes[name].T @ found[k]
    return found


def made_joints(scenario: Scenario, seats: Mapping[str, Ints], b: Bodies) -> list[Made]:
    """All joints and rods of bodies, and of particles among them; `seats` are the rows of all by groups.

    Raises UsageError for rods whose ends are not where their length wants them.
    """
    found, none = [], np.zeros(3)
    for table, joint in enumerate(scenario.joints):
        pairs = joint.pairs or SINGLE
        anchors = joint.anchors * (1 if joint.several else len(pairs))
        for k, (i, j) in enumerate(rows_of(seats, joint.groups(), pairs)):
            middle = centre(b, i) if j == WORLD else 0.5 * (centre(b, i) + centre(b, j))
            place = np.array(anchors[k]) if anchors else middle
            one, two = (frame(b, m).T @ (place - centre(b, m)) for m in (i, j))
            name = joint.name if len(pairs) == 1 else f"{joint.name} {k}"
            size = _size(b, i, j)
            called = _called(scenario, seats, joint.groups(), pairs[k])
            if isinstance(joint, HingeJoint):
                axis, p, q = _across(np.array(joint.axis))
                turned = (frame(b, i).T @ axis, frame(b, j).T @ p, frame(b, j).T @ q)
                hinge = Made(HINGE, i, j, one, two, *turned, 0.0, size, name, joint.touch)
                found.append(hinge._replace(stop=_stop(joint, frame(b, i).T @ p, turned[1])))
            else:
                ball = Made(BALL, i, j, one, two, none, none, none, 0.0, size, name, joint.touch)
                found.append(ball._replace(stop=_cone(joint, frame(b, i), frame(b, j))))
            found[-1] = found[-1]._replace(stated=("joints", table), called=called)
    for rods in rod_lists(scenario):
        points = own_points(scenario, rods.groups, rods.points)
        for k, (i, j) in enumerate(rows_of(seats, rods.groups, rods.pairs)):
            name = rods.name if len(rods.pairs) == 1 else f"{rods.name} {k}"
            ends = [frame(b, m) @ point + centre(b, m) for m, point in zip((i, j), points, strict=True)]
            apart = float(np.linalg.norm(ends[0] - ends[1]))
            length = apart if rods.length is None else rods.length
            if not abs(apart - length) <= LENGTH_TOLERANCE * length or apart == 0:
                hint = (
                    "move the ends, or leave length out"
                    if apart > 0
                    else "a ball joint holds two places together"
                )
                raise _misfit(
                    scenario,
                    _stated(rods.table),
                    f"{name}: its ends are {apart:.6g} m apart at the start, and its length is {length:.6g} m",
                    hint,
                )
            rod = Made(ROD, i, j, points[0], points[1], none, none, none, length, length, name, True)
            called = _called(scenario, seats, rods.groups, rods.pairs[k])
            found.append(rod._replace(stated=_stated(rods.table), called=called))
    return found


def _called(
    scenario: Scenario, seats: Mapping[str, Ints], groups: tuple[str, str], pair: Sequence[int]
) -> tuple[str, str]:
    """What messages call both ends of a joint: the only one of a group by its name."""
    bodies = {group.name for group in scenario.bodies}
    found = []
    for name, number in zip(groups, pair, strict=True):
        one = f"{'body' if name in bodies else 'particle'} {number} of {name!r}"
        found.append("the world" if name == WORLD_NAME else repr(name) if len(seats[name]) == 1 else one)
    return found[0], found[1]


def _stated(table: int | None) -> Path | None:
    """Where rods are stated; those of a group have no table."""
    return None if table is None else ("rods", table)


def _misfit(scenario: Scenario, stated: Path | None, text: str, hint: str) -> UsageError:
    """The error of joints that do not fit, with the place of their table, if it has one."""
    if scenario.source is None or stated is None:
        return UsageError(text, hint)
    return scenario_error(scenario.source, [Invalid(text, stated, hint=hint)])


def _stop(hinge: HingeJoint, mark: Floats, other: Floats) -> Stop | None:
    """Limits and motor of a hinge, whose bodies have these marks."""
    if hinge.limits is None and hinge.motor is None:
        return None
    low, high = (-np.inf, np.inf) if hinge.limits is None else np.radians(hinge.limits).tolist()
    speed, torque = (0.0, 0.0) if hinge.motor is None else (hinge.motor.speed, hinge.motor.torque)
    return Stop(mark, other, low, high, speed, torque, cone=False)


def _cone(ball: Joint, one: Floats, two: Floats) -> Stop | None:
    """The cone of a ball joint between bodies with these frames."""
    if not isinstance(ball, BallJoint) or ball.cone is None or ball.axis is None:
        return None
    axis = _across(np.array(ball.axis))[0]
    return Stop(one.T @ axis, two.T @ axis, 0.0, float(np.radians(ball.cone)), 0.0, 0.0, cone=True)


def new_stops(made: Sequence[Made], order: Ints) -> Stops:
    """Limits and motors of joints that have been put in an order."""
    found = [(k, stop) for k, number in enumerate(order.tolist()) if (stop := made[number].stop) is not None]
    marks, others = (
        np.array([getattr(each, name) for _, each in found], float).reshape(-1, 3).T.copy()
        for name in ("mark", "other")
    )
    numbers = (
        np.array([getattr(each, name) for _, each in found], float)
        for name in ("low", "high", "speed", "torque")
    )
    cone = np.array([each.cone for _, each in found], np.int64)
    low, high, speed, torque = numbers
    return Stops(np.array([k for k, _ in found], np.int64), marks, others, low, high, speed, torque, cone)


def _size(b: Bodies, i: int, j: int) -> float:
    """The size of the bodies of a joint [m]."""
    return float(b.reach[i] if j == WORLD else max(b.reach[i], b.reach[j]))


def _across(axis: Floats) -> tuple[Floats, Floats, Floats]:
    """A unit vector and two across it."""
    largest = np.abs(axis).max()
    if not 1e-150 < largest < 1e150:  # the square of its length would be no number
        axis = axis / largest
    axis = axis / np.linalg.norm(axis)
    p = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    p /= np.linalg.norm(p)
    return axis, p, np.cross(axis, p)


def new_joints(made: Sequence[Made], bodies: int) -> tuple[Joints, Ints]:
    """All joints as kernels take them, and which of `made` each of them is."""
    first, second = (np.array([getattr(each, key) for each in made], np.int64) for key in ("first", "second"))
    sharing = _sharing(first, second)
    order, component = _ordered(len(made), sharing)
    made = [made[k] for k in order.tolist()]
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    first, second, component = first[order], second[order], component[order]
    kind = np.array([each.kind for each in made], np.int64)
    row = np.concatenate([[0], np.cumsum(np.array(ROWS, np.int64)[kind])])
    components = int(component[-1]) + 1
    group = np.searchsorted(component, np.arange(components + 1))
    links = [(k, k, 0, 0, int(first[k])) for k in range(len(made))]
    links += [(k, k, 1, 1, int(second[k])) for k in range(len(made)) if second[k] != WORLD]
    for g, h, one, two, body in sharing:
        late, early = int(place[g]), int(place[h])
        links.append((late, early, one, two, body) if late > early else (early, late, two, one, body))
    links.sort()
    link = np.array(links, np.int64)
    head_of = np.arange(len(made))
    np.minimum.at(head_of, link[:, 0], link[:, 1])
    of_row = np.repeat(np.arange(len(made)), np.diff(row))
    head = row[head_of[of_row]]
    start = np.concatenate([[0], np.cumsum(np.arange(row[-1]) - head + 1)])
    members, borders = [], [0]
    for k in range(components):
        part = slice(group[k], group[k + 1])
        mine = np.unique(np.concatenate([first[part], second[part]]))
        members.append(mine[mine != WORLD])
        borders.append(borders[-1] + len(members[-1]))

    def columns(key: str) -> Floats:
        return np.ascontiguousarray(np.array([getattr(each, key) for each in made], float).T)

    rows, of = int(row[-1]), np.full(bodies, -1)
    for number, mine in enumerate(members):
        of[mine] = number
    return Joints(
        kind,
        first,
        second,
        columns("end"),
        columns("other_end"),
        columns("axis"),
        columns("across"),
        columns("also_across"),
        columns("length"),
        columns("size"),
        row,
        group,
        np.concatenate(members),
        np.array(borders, np.int64),
        link,
        np.searchsorted(link[:, 0], group),
        head,
        start,
        np.zeros(int(start[-1])),
        np.zeros((rows, 15)),
        np.zeros(rows),
        np.zeros(rows),
        np.zeros(rows),
        np.zeros((bodies, 13)),
        of,
        np.full(components, -1),
        np.zeros(2),
    ), order


def _sharing(first: Ints, second: Ints) -> list[tuple[int, int, int, int, int]]:
    """Pairs of joints that share a body, on which side each has it, and the body."""
    at: dict[int, list[tuple[int, int]]] = {}
    for side, ends in enumerate((first, second)):
        for k, body in enumerate(ends.tolist()):
            if body != WORLD:
                at.setdefault(body, []).append((k, side))
    return [
        (g, h, one, two, body)
        for body, joints in at.items()
        for n, (g, one) in enumerate(joints)
        for h, two in joints[:n]
        if g != h
    ]


def _ordered(count: int, sharing: Sequence[tuple[int, int, int, int, int]]) -> tuple[Ints, Ints]:
    """An order of joints in which those that share bodies are near each other (reverse Cuthill and McKee), component by
    component, and the component of each joint, by its number before."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

    pairs = np.array([each[:2] for each in sharing], np.int64).reshape(-1, 2)
    ends = np.concatenate([pairs, pairs[:, ::-1]]).T
    near = coo_array((np.ones(ends.shape[1], np.int8), (ends[0], ends[1])), shape=(count, count)).tocsr()
    label = connected_components(near, directed=False)[1]
    _, begins, number = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(begins))
    component = rank[number.ravel()]
    narrow = np.asarray(reverse_cuthill_mckee(near, symmetric_mode=True), np.int64)
    order = narrow[np.argsort(component[narrow], kind="stable")]
    return order, component


def require_speeds(scenario: Scenario, made: Sequence[Made], b: Bodies, start: tuple[Floats, Floats]) -> None:
    """Raises UsageError where bodies would open a joint with the velocities and angular momenta [3, n] at the start."""
    velocity, spin = start
    for each in made:
        speeds, scale = [], 0.0
        for i, end in ((each.first, each.end), (each.second, each.other_end)):
            if i == WORLD:
                speeds.append((np.zeros(3), np.zeros(3)))
            else:
                turning = np.array(angular_velocity(b.turn[:, i], spin[:, i], b.inertia[:, i]))
                about = np.cross(turning, frame(b, i) @ end)
                speeds.append((velocity[:, i] + about, turning))
                size = np.linalg.norm(turning) * np.linalg.norm(end)
                scale = max(scale, float(np.linalg.norm(velocity[:, i])), float(size))
        opening = speeds[0][0] - speeds[1][0]
        if each.kind == ROD:
            along = (frame(b, each.first) @ each.end + centre(b, each.first)) - (
                frame(b, each.second) @ each.other_end + centre(b, each.second)
            )
            opening = along * (opening @ along) / (along @ along)
        speed = float(np.linalg.norm(opening))
        if speed > SPEED_TOLERANCE * scale:
            raise _misfit(
                scenario,
                each.stated,
                f"{each.name}: {' and '.join(each.called)} move apart at {speed:.3g} m/s at the start "
                f"{_ends(each, b)}",
                "a body that turns with ω about a place at the distance r from its centre moves with velocity ω × r"
                if each.kind != ROD
                else "give velocities across the rod",
            )
        if each.kind == HINGE:
            axis = frame(b, each.first) @ each.axis
            turning = speeds[0][1] - speeds[1][1]
            off = float(np.linalg.norm(turning - axis * (axis @ turning)))
            if off > SPEED_TOLERANCE * max(np.linalg.norm(each) for _, each in speeds):
                raise _misfit(
                    scenario,
                    each.stated,
                    f"{each.name}: {' and '.join(each.called)} turn against each other at {off:.3g} rad/s across the axis "
                    "at the start",
                    "give angular velocities that differ along the axis only",
                )


def _ends(each: Made, b: Bodies) -> str:
    """Where a joint or a rod is, and how far a joint is from the centres of its bodies, in words."""
    ends = ((each.called[0], each.first, each.end), (each.called[1], each.second, each.other_end))
    places = " and ".join(dict.fromkeys(_place(frame(b, i) @ end + centre(b, i)) for _, i, end in ends))
    if each.kind == ROD:
        return f"with its ends at {places}"
    away = [f"{np.linalg.norm(end):.3g} m from the centre of {name}" for name, i, end in ends if i != WORLD]
    return f"where they are joined, at {places}, {' and '.join(away)}"


def _place(x: Floats) -> str:
    """A place in words [m]."""
    return f"({', '.join(f'{each:.3g}' for each in (np.round(x, 12) + 0.0).tolist())}) m"


def partners_of(scenario: Scenario, made: Sequence[Made], bodies: int) -> tuple[Ints, Ints, Ints]:
    """Which bodies are joined at all [bodies]; and the bodies that each is joined to by a ball joint or a hinge and does not
    touch, with where those of each begin [bodies + 1]."""
    joined = np.zeros(bodies, np.int64)
    found: list[set[int]] = [set() for _ in range(bodies)]
    for each in made:
        for i, j in ((each.first, each.second), (each.second, each.first)):
            if i != WORLD:
                joined[i] = 1
                if j != WORLD and not each.touch:
                    found[i].add(j)
    partners = np.array([j for mine in found for j in sorted(mine)] or [WORLD], np.int64)
    return joined, partners, np.concatenate([[0], np.cumsum([len(mine) for mine in found])]).astype(np.int64)
