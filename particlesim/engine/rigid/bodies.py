"""What the kernels of rigid bodies work on: bodies as columns, contacts, impulses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.rigid.equations import new_room

WORLD = -1
"""The other side of a contact with a collider."""
FEATURES = 1 << 32
"""Numbers for the features of a body at each collider."""
NOBODY = -2
"""A free place in the memory."""
GUEST = -3
"""In the names of contacts: a particle, whose id is in the feature. Below it, what it may touch: colliders."""
GRAINS = 1 << 48
"""First number for the features of particles, which are their ids."""


class Bodies(NamedTuple):
    """Rigid bodies: place and velocity of the centre of mass [3, n], orientation [4, n], angular momentum [3, n]; 1/m
    [n]; the principal moments of inertia [3, n]; radius of a ball about it [n]; its group [n]; the pieces of the shapes
    of groups (`pieces`)."""

    x: Any
    v: Any
    turn: Any
    spin: Any
    w: Any
    inertia: Any
    reach: Any
    group: Any
    pieces: Any


class Surfaces(NamedTuple):
    """What contact does between two groups [groups, groups]: whether they touch, restitution, static and kinetic
    friction; rolling friction (`rolling`), None without; restitution of slow impacts, the speed above which it falls, and
    how fast, by group [3, groups], None where none falls."""

    touch: Any
    restitution: Any
    static: Any
    kinetic: Any
    rolling: Any = None
    falls: Any = None


class Contacts(NamedTuple):
    """Contacts of a step: the two bodies and what tells the contact from others of theirs [k], and names for the two that
    last, where those of bodies do not (`GUEST`) [2, k]; where, and the normal from the second to the first [3, k]; the gap
    [k]; restitution, static and kinetic friction [3, k]; velocity of a collider's surface in the middle of the step, by how
    much it is another at the end, where the body lies, and that with which what rolls on a bent one leaves it (`bending`)
    [3, k]; speed to be reached along the normal [k]; the speed of an impact on a collider, 0 without
    [k]; of impacts of particles the time since the step began, 0 of other contacts, how much else accelerates them along
    the normal, the time at which the kick of the step counts as given, or `energy.LIES`, and how much more they are
    pulled back by forces that change where the impulse shifts them, as w k τ² by a spring k [4, k]; impulses along the
    normal and two tangents, and one that only pushes apart what overlaps [k, 4]; what an impulse does along each of
    three directions [k, 3, ROW]; impulses before a sweep, and the direction in which sweeps go on [k, 3]; contacts by
    their clusters [k]; of those that turn bodies only, limits and motors of joints (`stops`) and rolling friction, what
    they are [k], 0 for others, and of motors the speed and the greatest impulse, of rolling friction the contact that
    presses and the radius [2, k]; of those solved for together what bounds friction, as an impulse and as a part of the
    one that presses (0: given) [k], and impulses to return to [k, 3]; 1 where joints are solved for after each impulse
    (`braced`), else 0 [k]; accelerations along the normal by swinging (`swinging`) [k]; the speed along the normal with
    which bodies go along hollow colliders (`bending`) [k]; the coefficient of friction that
    counts in a solve, of two: that at rest where it holds (`friction`) [k]. `number`: how many there are,
    how many found no room, and 1 where bodies fly and the first touch counts rather than firm rest (`narrow`). `falls`: two
    laws by which restitution falls with the speed of an impact, the smaller of which counts: that of slow ones, the speed
    above which it falls, and how fast [6, k]; None where none falls."""

    first: Any
    second: Any
    feature: Any
    names: Any
    point: Any
    normal: Any
    gap: Any
    surface: Any
    belt: Any
    lead: Any
    slip: Any
    target: Any
    struck: Any
    late: Any
    impulse: Any
    rows: Any
    before: Any
    onward: Any
    order: Any
    turns: Any
    aim: Any
    bound: Any
    grip: Any
    kept: Any
    braced: Any
    swing: Any
    bend: Any
    friction: Any
    number: Any
    falls: Any = None


ROW = 16
"""Along a direction: itself; the arms of both bodies times it; the inverse inertias times those; the mass that it meets."""


class Motion(NamedTuple):
    """What a solve works on, body by body [n, 6]: velocity and angular velocity; the inverse of the inertia in the
    world (xx, yy, zz, xy, xz, yz); velocities that only push apart what overlaps; angular momentum from contact [n, 3];
    how far a body may come in a step [n]; velocities and momenta before impulses, with rebounds, before a sweep, and how
    sweeps go on [n, 9]; the body that stands for those that touch it, and their energies [n]; the cluster of each body, the
    bodies by their clusters [n], where bodies and contacts of each begin [n + 1], the largest speed that contact deals with
    in each [n], and how many there are; forces and torques [n, 6]; the first of the components of joints in each cluster
    [n], −1 for none; velocities before a kick, and those with which its forces are summed, where work is booked [n, 6]; the
    clusters whose impulses were not found [n]; room for solving for them together (`equations`)."""

    now: Any
    inverse: Any
    apart: Any
    gained: Any
    margin: Any
    start: Any
    other: Any
    before: Any
    onward: Any
    parent: Any
    gain: Any
    low: Any
    bend: Any
    cluster: Any
    bodies: Any
    body_from: Any
    contact_from: Any
    largest: Any
    clusters: Any
    pull: Any
    first_component: Any
    came: Any
    stage: Any
    unsettled: Any
    room: Any


class Memory(NamedTuple):
    """Impulses of the last step by contact: a table with open addresses, first body, second body, feature [3, size];
    impulses [3, size]; and the order of the bodies along x [n]."""

    keys: Any
    impulse: Any
    order: Any


def new_contacts(room: int, falls: bool = False) -> Contacts:
    """Room for contacts, the restitution of some of which `falls` with the speed of impacts."""
    first, second, feature = (np.zeros(room, np.int64) for _ in range(3))
    names = np.zeros((2, room), np.int64)
    point, normal, surface, belt, lead, slip = (np.zeros((3, room)) for _ in range(6))
    gap, target, struck, late = np.zeros(room), np.zeros(room), np.zeros(room), np.zeros((4, room))
    impulse, rows, number = np.zeros((room, 4)), np.zeros((room, 3, ROW)), np.zeros(3, np.int64)
    before, onward, order = np.zeros((room, 3)), np.zeros((room, 3)), np.zeros(room, np.int64)
    return Contacts(
        *(first, second, feature, names, point, normal, gap, surface, belt, lead, slip, target, struck, late),
        *(
            impulse,
            rows,
            before,
            onward,
            order,
            np.zeros(room, np.int64),
            np.zeros((2, room)),
            np.zeros(room),
            np.zeros(room),
            np.zeros((room, 3)),
            np.zeros(room, np.int64),
            np.zeros(room),
            np.zeros(room),
            np.zeros(room),
            number,
            np.zeros((6, room)) if falls else None,
        ),
    )


def new_memory(room: int, bodies: int) -> Memory:
    """An empty memory for some contacts."""
    size = 1 << max(6, (2 * room - 1).bit_length())
    return Memory(np.full((3, size), NOBODY, np.int64), np.zeros((3, size)), np.arange(bodies))


def new_motion(bodies: int) -> Motion:
    """Room for a solve."""
    now, inverse, apart = (np.zeros((bodies, 6)) for _ in range(3))
    start, other, before, onward = (np.zeros((bodies, 9)) for _ in range(4))
    margin, gain, low, bend = (np.zeros(bodies) for _ in range(4))
    parent, cluster, ordered = (np.zeros(bodies, np.int64) for _ in range(3))
    begins = (np.zeros(bodies + 1, np.int64), np.zeros(bodies + 1, np.int64))
    gained = np.zeros((bodies, 3))
    return Motion(
        *(now, inverse, apart, gained, margin, start, other, before, onward),
        *(parent, gain, low, bend, cluster, ordered, *begins, np.zeros(bodies), np.zeros(1, np.int64)),
        *(np.zeros((bodies, 6)), np.zeros(bodies, np.int64), np.zeros((bodies, 6)), np.zeros((bodies, 6))),
        *(np.zeros(bodies, np.int64), new_room(bodies)),
    )


def place(b: Any, i: Any) -> Any:
    """Centre of mass of body i."""
    return b.x[0, i], b.x[1, i], b.x[2, i]


def orientation(b: Any, i: Any) -> Any:
    """Orientation of body i."""
    return b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i]


def row(a: Any, i: Any) -> Any:
    """Column i of an array of three rows."""
    return a[0, i], a[1, i], a[2, i]


def add_contact(k: Any, i: Any, j: Any, feature: Any, point: Any, normal: Any, gap: Any) -> int:
    """Note a contact; returns its number, −1 where there is no room."""
    number = k.number[0]
    if number >= k.first.size:
        k.number[1] += 1
        return -1
    k.first[number], k.second[number], k.feature[number], k.gap[number] = i, j, feature, gap
    k.names[0, number], k.names[1, number] = i, j
    k.turns[number], k.braced[number], k.swing[number], k.bend[number] = 0, 0, 0.0, 0.0
    k.late[0, number], k.late[1, number] = 0.0, 0.0
    for axis in range(3):
        k.belt[axis, number] = k.lead[axis, number] = k.slip[axis, number] = 0.0
    k.point[0, number], k.point[1, number], k.point[2, number] = point
    k.normal[0, number], k.normal[1, number], k.normal[2, number] = normal
    k.number[0] = number + 1
    return int(number)


def name_contact(k: Any, number: Any, one: Any, other: Any) -> None:
    """Give the two of a contact names that last."""
    if number >= 0:
        k.names[0, number], k.names[1, number] = one, other


def set_surface(k: Any, number: Any, restitution: Any, static: Any, kinetic: Any) -> None:
    """What contact does there; restitution does not fall unless `set_fall` says more."""
    if number >= 0:
        k.surface[0, number], k.surface[1, number], k.surface[2, number] = restitution, static, kinetic
        if k.falls is not None:
            set_fall(k, number, 0, restitution, 1.0, 0.0)
            set_fall(k, number, 3, restitution, 1.0, 0.0)


def set_fall(k: Any, number: Any, law: Any, restitution: Any, speed: Any, exponent: Any) -> None:
    """One of the two laws, 0 or 3, by which restitution falls there."""
    k.falls[law, number], k.falls[law + 1, number], k.falls[law + 2, number] = restitution, speed, exponent
