"""Rigid bodies in the way of hard grains within a step: where they are in it, when a grain comes to one, and its rebound.

Bodies make their step before particles do. For these they go steadily from where they began it to where they end it,
x(s) = x₀ + s g, and turn steadily about the axis from one orientation to the other, by an angle s φ: s is the part of the
step that is over. The distance f from a convex piece is convex along a straight way, so f(s + τ) ≥ f + f' τ − ½ c τ² with
the most by which turning bends the way that the body sees, c = φ (2 |u| + 3 φ D) with the way u relative to it and the
distance D from its centre: a particle goes as far as this is above zero, again and again, which converges as Newton's
method does.

What is slow, lies on a body, or comes to one that touches something or is in a joint, has been its guest by then (`grains`).
This is for what comes far in a step, whom it meets first, and for what others have sent to a body. Bodies that touch
something do not rebound here: what comes to them waits at their surface for the next step. An impulse changes the velocity
that a body has at the end of the step, and its way from then on, but not how it turns in it: energy is kept, or lost, impact
by impact, as that of grains is (`interactions.hard.rebounds`). With the normal n of the body, the place a of the impact
relative to its centre, and w = 1/m and I of both the impulse and its friction are

    P = (1 + e) u_n/(w₁ + w₂ + (a × n)·I₂⁻¹ (a × n)),   |T| ≤ μ P,   T = u_t/(7/2 w₁ + w₂ + (a × t)·I₂⁻¹ (a × t)) at most,

with 1 in place of 7/2 for what does not turn, and rolling friction ends what rolls with M ≤ μ_r R P.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.interactions.hard.walls_ahead import MOST_STRIDES, TOUCHES
from particlesim.engine.rigid.bodies import Bodies, row
from particlesim.engine.rigid.grains import away_from
from particlesim.engine.rigid.narrow import minus, plus
from particlesim.engine.rigid.pieces import solid_of
from particlesim.engine.rigid.rotation import angular_velocity, cross, dot, matrix
from particlesim.engine.rigid.touching import Touching, no_contact
from particlesim.model.arrays import Floats, Ints
from particlesim.model.quaternions import times

SMALL = 1e-3
"""What counts as the radius of points, as a part of the reach of a body."""
SINKS = 1e-4
"""How far a particle at the surface of a body must come into it in the rest of a step to hit it, as a part of its radius."""


class Obstacles(NamedTuple):
    """Bodies: the pieces of their shapes, group [b], reach [b], 1/m [b] and principal moments of inertia [3, b] of each;
    place [3, b] and orientation [4, b] at the beginning of a step, by how much they move [3, b] and turn [3, b] in it;
    velocity [3, b], angular momentum [3, b] and orientation [4, b] at its end, and the acceleration by forces [3, b]; by
    how much particles have changed these velocities and momenta since, and where the ways of bodies begin and how far they
    lead (`given` [12, b]), those of this island alone (`mine`); which touch nothing and are in no joint, and how often
    their ways have changed [b]. Their contact with particles [kinds, groups]; the kind of each particle, 1 where its
    impacts on bodies in the step are left to it, as it is swift, and 1 of those that have been guests among bodies in it
    [n]. Whether what comes to bodies waits there for its impact until the next step, as emitters hear of impacts [1]."""

    pieces: Any
    group: Any
    reach: Any
    w: Any
    inertia: Any
    x: Any
    turn: Any
    go: Any
    turns: Any
    v: Any
    spin: Any
    face: Any
    pull: Any
    given: Any
    mine: Any
    free: Any
    changes: Any
    touching: Touching
    kind: Any
    left: Any
    guests: Any
    waits: Any

    def begin(self) -> None:
        """Forget what particles of this island have done to bodies, at the beginning of their step."""
        begin(self)

    def find(self, x: Any, go: Any, r: Any, i: Any, begin: Any, end: Any) -> Any:
        """When particle i, from x on with a way `go` in a step, comes to a body between two times, infinity if it does not;
        which body, how far its surface there goes in a step, and the normal there."""
        return find(self, x, go, r, i, begin, end)

    def outside(self, x: Any, r: Any, i: Any, deep: Any) -> Any:
        """Where particle i ends the step: at x, but on the surface of a body in which it would be deeper than so much."""
        return outside(self, x, r, i, deep)

    def strike(self, i: Any, j: Any, blow: Any) -> Any:
        """The impact of particle i on body j: by how much it changes the velocity of the particle, and turns it, and how far
        the surface there goes in a step from then on."""
        return strike(self, i, j, blow)


def obstacles_of(b: Bodies, *, waits: bool) -> Obstacles:
    """Bodies that are in nobody's way yet."""
    n = b.w.size
    turn = np.zeros((4, n))
    turn[0] = 1.0
    vectors = [np.zeros((3, n)) for _ in range(5)]
    left = np.zeros(0, np.int64)
    return Obstacles._make(
        [
            *(b.pieces, b.group, b.reach, b.w, b.inertia, vectors[0], turn, *vectors[1:], turn.copy()),
            *(np.zeros((3, n)), np.zeros((12, n)), np.zeros((12, n)), np.zeros(n, np.int64)),
            *(np.zeros(n, np.int64), no_contact(0), left, left, left, np.array([int(waits)])),
        ]
    )


def begin_step(o: Obstacles, b: Bodies) -> None:
    """Bodies begin a step where they are."""
    o.x[:], o.turn[:] = b.x, b.turn


def end_step(o: Obstacles, b: Bodies, free: Ints, pull: Floats) -> None:
    """Bodies end it where they are; which of them touch nothing and are in no joint [b], and by how much forces accelerate
    them [b, 6]."""
    o.free[:], o.pull[:] = np.where(b.w > 0, free, 1), b.w * pull[:, :3].T
    o.go[:], o.v[:], o.spin[:], o.face[:] = b.x - o.x, b.v, b.spin, b.turn
    w, *v = times(b.turn, o.turn * np.array([[1.0], [-1.0], [-1.0], [-1.0]]))
    axis = np.array(v) * np.where(w < 0, -1.0, 1.0)
    sine = np.sqrt((axis**2).sum(axis=0))
    o.turns[:] = axis * np.divide(
        2 * np.arctan2(sine, np.abs(w)), sine, out=np.full_like(sine, 2.0), where=sine > 0
    )


def give(o: Obstacles, b: Bodies) -> None:
    """Bodies get what particles have given them in a step."""
    b.v[:] += o.given[:3]
    b.spin[:] += o.given[3:6]
    b.x[:] += o.given[6:9] + o.given[9:]


def begin(o: Any) -> None:
    """`Obstacles.begin`."""
    for j in range(o.reach.size):
        for number in range(12):
            o.given[number, j] -= o.mine[number, j]
            o.mine[number, j] = 0.0


@outlined
def find(o: Any, x: Any, go: Any, r: Any, i: Any, begin: Any, end: Any) -> Any:
    """`Obstacles.find`."""
    best, which, pace, n = np.inf, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(o.reach.size):
        if o.touching.touch[o.kind[i], o.group[j]] > 0 and comes_near(o, x, go, r, j, begin, min(end, best)):
            when, along, across = comes_to(o, x, go, r, j, begin, min(end, best))
            if when < best:
                best, which, pace, n = when, j, along, across
    return best, which, pace, n


def comes_near(o: Any, x: Any, go: Any, r: Any, j: Any, begin: Any, end: Any) -> bool:
    """Whether a particle comes into the ball about body j between two times."""
    d, g = minus(x, plus(start_of(o, j), begin, way_of(o, j))), minus(go, way_of(o, j))
    size, reach = dot(g, g), o.reach[j] + r
    after = min(max(-dot(d, g) / size, 0.0), end - begin) if size > 0 else 0.0
    d = plus(d, after, g)
    return bool(dot(d, d) < reach * reach)


@outlined
def comes_to(o: Any, x: Any, go: Any, r: Any, j: Any, begin: Any, end: Any) -> Any:
    """When a particle comes to body j between two times, infinity if it does not; how far the surface there goes in a step,
    and its normal."""
    p, best, pace, n = o.pieces, np.inf, way_of(o, j), (0.0, 0.0, 0.0)
    for number in range(p.first[o.group[j]], p.first[o.group[j] + 1]):
        when, along, across = comes_to_piece(o, x, go, r, j, number, begin, min(end, best))
        if when < best:
            best, pace, n = when, along, across
    return best, pace, n


@outlined
def comes_to_piece(o: Any, x: Any, go: Any, r: Any, j: Any, number: Any, begin: Any, end: Any) -> Any:
    """`comes_to` for a piece of the body."""
    p, found, turns, s, stride = o.pieces, on_stack(1, 9, np.float64), row(o.turns, j), begin, 0
    g, size, hits = minus(go, way_of(o, j)), max(r, SMALL * o.reach[j]), False
    own, angle, pace, n = np.sqrt(dot(g, g)), np.sqrt(dot(turns, turns)), way_of(o, j), (0.0, 0.0, 0.0)
    while (s < end) & (not hits) & (stride < MOST_STRIDES):
        at, centre = plus(x, s - begin, go), plus(start_of(o, j), s, way_of(o, j))
        arm = minus(at, centre)
        away, n = away_from(p, solid_of(p, number, centre, matrix(turned_at(o, j, s))), at, found)
        pace = plus(way_of(o, j), 1.0, cross(turns, arm))
        gap, rate = away - r, dot(minus(go, pace), n)
        touches = gap <= TOUCHES * size
        hits = touches & (-rate * (end - s) > SINKS * size)
        far = np.sqrt(dot(arm, arm)) + own * (end - s)
        bends = angle * (2.0 * own + 3.0 * angle * far)
        gap = SINKS * size if touches else gap
        under = np.sqrt(rate * rate + 2.0 * bends * gap) - rate
        if not hits:
            s += 2.0 * gap / under if under > 0 else np.inf
        stride += 1
    return (s if hits else np.inf), pace, n


def turned_at(o: Any, j: Any, s: Any) -> Any:
    """The orientation of body j at time s of a step."""
    a = row(o.turns, j)
    angle = np.sqrt(dot(a, a))
    half = 0.5 * s * angle
    by = np.sin(half) / angle if angle > 0 else 0.0
    return times(
        (np.cos(half), by * a[0], by * a[1], by * a[2]),
        (o.turn[0, j], o.turn[1, j], o.turn[2, j], o.turn[3, j]),
    )


def start_of(o: Any, j: Any) -> Any:
    """Where body j would have begun the step on its way."""
    g = o.given
    return o.x[0, j] + g[6, j], o.x[1, j] + g[7, j], o.x[2, j] + g[8, j]


def way_of(o: Any, j: Any) -> Any:
    """How far body j goes in a step on its way."""
    g = o.given
    return o.go[0, j] + g[9, j], o.go[1, j] + g[10, j], o.go[2, j] + g[11, j]


@outlined
def outside(o: Any, x: Any, r: Any, i: Any, deep: Any) -> Any:
    """`Obstacles.outside`."""
    p, found = o.pieces, on_stack(1, 9, np.float64)
    for j in range(o.reach.size):
        if o.touching.touch[o.kind[i], o.group[j]] > 0:
            centre = plus(start_of(o, j), 1.0, way_of(o, j))
            d = minus(x, centre)
            if dot(d, d) < (o.reach[j] + r) ** 2:
                faces = matrix(turned_at(o, j, 1.0))
                for number in range(p.first[o.group[j]], p.first[o.group[j] + 1]):
                    away, n = away_from(p, solid_of(p, number, centre, faces), x, found)
                    if away - r < -deep:
                        x = plus(x, r - away, n)
    return x


# ---- the impact


@outlined
def strike(o: Any, i: Any, j: Any, blow: Any) -> Any:
    """`Obstacles.strike`."""
    law, kind, group = o.touching, o.kind[i], o.group[j]
    n, arm = blow.n, minus(plus(blow.at, -blow.r, blow.n), plus(start_of(o, j), blow.s, way_of(o, j)))
    v, turning, none = blow.v, blow.turning, (0.0, 0.0, 0.0)
    approach = -dot(minus(v, surface(o, j, arm, blow)), n)
    dv, turn = none, none
    if approach > 0:
        e = law.restitution[kind, group]
        lively = (approach > blow.slow) | (e >= 1)
        e = e * max(approach / law.speed[kind, group], 1.0) ** (-law.exponent[kind, group]) if lively else 0.0
        given = (1.0 + e) * approach / (blow.light + weight(o, j, arm, n))
        kick(o, j, -given, n, arm, blow)
        dv = plus(none, blow.light * given, n)
        static, kinetic = law.static[kind, group], law.kinetic[kind, group]
        rolls = turning is not None and blow.r > 0
        if static > 0:
            own = plus(v, 1.0, dv)
            if turning is not None:
                own = minus(own, cross(plus(none, blow.r, turning), n))
            slip = minus(own, surface(o, j, arm, blow))
            slip = plus(slip, -dot(slip, n), n)
            size = np.sqrt(dot(slip, slip))
            if size > 0:
                t = plus(none, 1.0 / size, slip)
                stops = size / ((3.5 if rolls else 1.0) * blow.light + weight(o, j, arm, t))
                rubs = stops if stops <= static * given else min(kinetic * given, stops)
                kick(o, j, rubs, t, arm, blow)
                dv = plus(dv, -rubs * blow.light, t)
                if turning is not None and blow.r > 0:
                    turn = plus(none, 2.5 * rubs * blow.light / blow.r, cross(n, t))
        if turning is not None and blow.r > 0 and law.rolling[kind, group] > 0:
            other = abs(dot(arm, n))
            radius = blow.r if law.flat[kind, group] > 0 else blow.r * other / (blow.r + other)
            most = law.rolling[kind, group] * radius * given
            turn = plus(turn, 1.0, slow_rolling(o, j, blow, plus(turning, 1.0, turn), most))
    return dv, turn, plus(way_of(o, j), 1.0, cross(row(o.turns, j), arm))


def slow_rolling(o: Any, j: Any, blow: Any, turning: Any, most: Any) -> Any:
    """Rolling friction, up to an angular impulse; by how much it changes the angular velocity of the particle."""
    rolls = minus(turning, turning_of(o, j))
    rolls = plus(rolls, -dot(rolls, blow.n), blow.n)
    size, light = np.sqrt(dot(rolls, rolls)), 2.5 * blow.light / (blow.r * blow.r)
    if size == 0:
        return 0.0, 0.0, 0.0
    d = (rolls[0] / size, rolls[1] / size, rolls[2] / size)
    by = min(size / (light + dot(d, turned(o, j, d))), most)
    for axis in range(3):
        share = by * (d[0] if axis == 0 else d[1] if axis == 1 else d[2])
        add(o, 3 + axis, j, share)
    return -by * light * d[0], -by * light * d[1], -by * light * d[2]


def turned(o: Any, j: Any, spin: Any) -> Any:
    """The angular velocity that an angular momentum is for body j, as it faces at the end of the step."""
    q = (o.face[0, j], o.face[1, j], o.face[2, j], o.face[3, j])
    return angular_velocity(q, spin, row(o.inertia, j))


def turning_of(o: Any, j: Any) -> Any:
    """The angular velocity of body j."""
    g = o.given
    return turned(o, j, plus(row(o.spin, j), 1.0, (g[3, j], g[4, j], g[5, j])))


def surface(o: Any, j: Any, arm: Any, blow: Any) -> Any:
    """The velocity of body j at a place at the time of an impact, when forces have not yet done all that they do."""
    v = plus(plus(row(o.v, j), 1.0, row(o.given, j)), -(1.0 - blow.s) * blow.h, row(o.pull, j))
    return plus(v, 1.0, cross(turning_of(o, j), arm))


def weight(o: Any, j: Any, arm: Any, d: Any) -> Any:
    """By how much an impulse of 1 N s along a direction changes the velocity of body j at a place along that [1/kg]."""
    twist = cross(arm, d)
    return o.w[j] + dot(twist, turned(o, j, twist))


def kick(o: Any, j: Any, impulse: Any, d: Any, arm: Any, blow: Any) -> None:
    """Give body j an impulse along a direction at a place. It goes on with the velocity that it has then."""
    twist = cross(arm, d)
    for axis in range(3):
        along = d[0] if axis == 0 else d[1] if axis == 1 else d[2]
        turns = twist[0] if axis == 0 else twist[1] if axis == 1 else twist[2]
        by = o.w[j] * impulse * along
        add(o, axis, j, by)
        add(o, 3 + axis, j, impulse * turns)
        add(o, 6 + axis, j, -blow.s * blow.h * by)
        add(o, 9 + axis, j, blow.h * by)
    o.changes[j] += 1


def add(o: Any, number: Any, j: Any, by: Any) -> None:
    """Note what a particle of this island has given to body j."""
    o.given[number, j] += by
    o.mine[number, j] += by
