"""What the impulses of hard contacts are worked out on: the arrays that the kernels of a step share (`impulses`)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.interactions.hard.at_once import Desk, new_desk
from particlesim.interactions.contact import AT_REST

COUNT, WANTED, WALLS_WANTED = range(3)
"""In `report`: how many pairs there are; since there was last more room, for how many pairs there should have been room, and
for how many particles at colliders."""
PAIRED, THROWN = 1, 2
"""In `mark`: that a particle is in a pair, and that a collider has thrown it back in the step."""
ARM, KEPT, SHARE, SPINS, LATER = 5, 6, 9, 10, 12
"""Rows of `normal` after the normal, LEAST, the least speed of an impact that rebounds, and PARTING, the one with which
impacts of the step have done so [m/s]: distance over sum of radii; the overlap down to which the two are moved apart [m]; of
a change of their relative velocity, after PARTS [2], which part of sliding it has to be to end that, and by
how much it turns each of them [2] [1/m]; what forces add to their approach after an impact in the step [m/s]."""
OWN, RUBS, ABOVE, FASTER = 6, 9, 10, 11
"""Rows of `wall_normal` after the normal, LEAST, PARTING and ALONG: the velocity of the surface [m/s], the coefficient
of its friction at rest, how far above it a particle is that does not touch it [m], and by how much faster the surface is at
the end of the step than in its middle, when impulses work [3] [m/s]."""
STILL, BENDS = 14, 15
"""Row of `normal` and `wall_normal` after these: 1 of what touched at the beginning of the step and hardly moved along the
normal then, so that an elastic contact rests, too; else 0. Then, of walls alone: 1 of one along which a particle has slid
that turns its velocity, so that its normal is that of when impulses act; else 0."""
FREE, BOUNCY = -1, -2
"""Values of LEAST of what does not lie on its wall, where that is elastic, too."""
LIMIT = 3
"""Row of `held` after the friction: how much of it there is at most, over what pushes, as it slides or not."""
TURN, WORK, GAIN, SQUARE, WAY, CARRIED, SWERVED = 3, 6, 7, 8, 9, 10, 13
"""Rows of `start`, after velocities before impulses: angular velocities; of the particle that stands for a cluster, the work
of what nothing moves, what impulses have added, and the sum of m |Δv|² + I |Δω|² [J]; how far forces have moved a particle
in the step, over what they have changed its velocity by times the step; what colliders that it rests on have taken up of
their kick [3] [m/s]; by how much those along which it slides have turned its velocity [3] [m/s]."""
REST, CLOSES = 2.0, 4
"""Steps in which forces bring about an approach that counts as rest, and in which what rests over a gap may close it."""
NEAR, WIDE = 3.0, 1 + AT_REST
"""Gap below which what does not touch is looked at, too, as it may rest there, in units of what forces move in a step; and
the sum of both radii with it, at most, as a part of that sum."""
NEAR_WALL = 0.1
"""Gap to a collider, as a part of the radius, below which a particle is watched; impulses move none further in a step."""
FARTHEST = 1.0
"""The same where there are no colliders."""


class Bench(NamedTuple):
    """Room to work in: rows of pairs [2, room], the smaller one first, and the numbers of their tables [room]; normals and
    more of pairs [15, room]; what to add to the difference of their places for the nearest image [3, room] [m].

    Rows of particles at colliders [walls], their normals and more [16, walls], the numbers of their colliders [walls], and
    where those at each collider of each group end. Of pairs, and after them of particles at walls: the friction that they
    have been given at rest, as a change of velocity [m/s], and its LIMIT [4, room + walls].

    Of particles: `mark` [n]; by how much forces have changed velocities in the step, at most in a cluster [n] [m/s];
    velocities before impulses, sums over clusters, and more [27, n]; by how much faster those are that nothing moves than in
    the middle of the step [3, n] [m/s]. A desk for impulses that are found at once.

    With rolling friction, None without: what contacts have been given of it at rest (`friction`), and its LIMIT, as for
    `held` [4, room + walls]; of particles at colliders its coefficient, and how the collider turns [4, walls] [1/s].
    """

    rows: Any
    table: Any
    normal: Any
    shift: Any
    wall: Any
    wall_normal: Any
    collider: Any
    ends: Any
    held: Any
    mark: Any
    change: Any
    start: Any
    faster: Any
    desk: Desk
    rolled: Any = None
    wall_rolls: Any = None


def new_bench(room: int, walls: int, ends: int, particles: int, dtype: Any, rolls: bool) -> Bench:
    """Room for some pairs, for particles at colliders, and for the ends of their lists, among some particles."""
    return Bench(
        np.zeros((2, room), np.int64),
        np.zeros(room, np.int16),
        np.zeros((15, room), dtype),
        np.zeros((3, room), dtype),
        np.zeros(walls, np.int64),
        np.zeros((16, walls), dtype),
        np.zeros(walls, np.int64),
        np.zeros(ends, np.int64),
        np.zeros((4, room + walls), dtype),
        np.zeros(particles, np.int8),
        np.zeros(particles, dtype),
        np.zeros((27, particles)),
        np.zeros((3, particles)),
        new_desk(room + walls, particles),
        np.zeros((4, room + walls), dtype) if rolls else None,
        np.zeros((4, walls), dtype) if rolls else None,
    )


def farthest(bench: Any) -> float:
    """How far impulses move a particle in a step at most, in units of its radius."""
    return NEAR_WALL if bench.ends.size > 1 else FARTHEST
