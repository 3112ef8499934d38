"""Rigid bodies in the way of hard grains within a step: where they are in it, when a grain comes to one, and its rebound.

Bodies make their step before particles do. For these they go steadily from where they began it to where they end it,
x(s) = x₀ + s g, and turn steadily about the axis from one orientation to the other, by an angle s φ: s is the part of the
step that is over. A particle comes nearer to a surface by no more than |u| + φ R, with its way u relative to the centre and
the reach R of the body; so it goes as far as that is away, again and again (conservative advancement).

What is slow, or lies on a body, has been its guest by then (`grains`). This is for what comes far in a step, whom it meets
first, and for what others have sent to a body. Its impulses change the velocities that bodies have at the end of the step,
and not their ways in it: energy is kept, or lost, impact by impact, as that of grains is (`interactions.hard.blows`). With
the normal n of the body, the place a of the impact relative to its centre, and w = 1/m and I of both the impulse and its
friction are

    P = (1 + e) u_n/(w₁ + w₂ + (a × n)·I₂⁻¹ (a × n)),   |T| ≤ μ P,   T = u_t/(7/2 w₁ + w₂ + (a × t)·I₂⁻¹ (a × t)) at most,

with 1 in place of 7/2 for what does not turn, and rolling friction ends what rolls with M ≤ μ_r R P.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.interactions.hard.blows import LEAVES, MOST_STRIDES, ROUNDING, TOUCHES
from particlesim.engine.rigid.bodies import Bodies, row
from particlesim.engine.rigid.grains import away_from
from particlesim.engine.rigid.narrow import minus, plus
from particlesim.engine.rigid.pieces import solid_of
from particlesim.engine.rigid.rotation import angular_velocity, cross, dot, matrix
from particlesim.engine.rigid.touching import Touching, no_contact
from particlesim.model.quaternions import times

SMALL = 1e-3
"""What counts as the radius of points, as a part of the reach of a body."""
SINKS = 1e-4
"""How far a particle at the surface of a body must come into it in the rest of a step to hit it, as a part of its radius."""


class Obstacles(NamedTuple):
    """Bodies: the pieces of their shapes, group [b], reach [b], 1/m [b] and principal moments of inertia [3, b] of each;
    place [3, b] and orientation [4, b] at the beginning of a step, by how much they move [3, b] and turn [3, b] in it;
    velocity [3, b], angular momentum [3, b] and orientation [4, b] at its end, and by how much particles have changed both
    since (`given` [6, b]), those of this island alone (`mine`). Their contact with particles [kinds, groups]; the kind of
    each particle, and 1 where its impacts on bodies in the step are left to it, as it is swift [n]. Whether what comes to
    them waits there for its impact until the next step, as emitters hear of impacts [1]."""

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
    given: Any
    mine: Any
    touching: Touching
    kind: Any
    left: Any
    waits: Any

    def begin(self) -> None:
        """Forget what particles of this island have done to bodies, at the beginning of their step."""
        begin(self)

    def find(self, x: Any, go: Any, r: Any, i: Any, begin: Any, end: Any) -> Any:
        """When particle i, from x on with a way `go` in a step, comes to a body between two times, infinity if it does not;
        which body, how far its surface there goes in a step, and the normal there."""
        return find(self, x, go, r, i, begin, end)

    def strike(self, i: Any, j: Any, blow: Any) -> Any:
        """The impact of particle i on body j: by how much it changes the velocity of the particle, and turns it."""
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
            *(np.zeros((6, n)), np.zeros((6, n)), no_contact(0), left, left, np.array([int(waits)])),
        ]
    )


def begin_step(o: Obstacles, b: Bodies) -> None:
    """Bodies begin a step where they are."""
    o.x[:], o.turn[:] = b.x, b.turn


def end_step(o: Obstacles, b: Bodies) -> None:
    """Bodies end it where they are."""
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
    b.spin[:] += o.given[3:]


def begin(o: Any) -> None:
    """`Obstacles.begin`."""
    for j in range(o.reach.size):
        for axis in range(6):
            o.given[axis, j] -= o.mine[axis, j]
            o.mine[axis, j] = 0.0


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
    d, g = minus(x, plus(row(o.x, j), begin, row(o.go, j))), minus(go, row(o.go, j))
    size, reach = dot(g, g), o.reach[j] + r
    after = min(max(-dot(d, g) / size, 0.0), end - begin) if size > 0 else 0.0
    d = plus(d, after, g)
    return bool(dot(d, d) < reach * reach)


@outlined
def comes_to(o: Any, x: Any, go: Any, r: Any, j: Any, begin: Any, end: Any) -> Any:
    """When a particle comes to body j between two times, infinity if it does not; how far the surface there goes in a step,
    and its normal."""
    found, turns, s, stride = on_stack(1, 9, np.float64), row(o.turns, j), begin, 0
    g, size = minus(go, row(o.go, j)), max(r, SMALL * o.reach[j])
    fast, pace, hits = np.sqrt(dot(g, g)) + np.sqrt(dot(turns, turns)) * o.reach[j], row(o.go, j), False
    n = (0.0, 0.0, 0.0)
    while (s < end) & (not hits) & (fast > 0):
        at, centre = plus(x, s - begin, go), plus(row(o.x, j), s, row(o.go, j))
        gap, n = gap_to(o, at, r, j, centre, turned_at(o, j, s), found)
        pace = plus(row(o.go, j), 1.0, cross(turns, minus(at, centre)))
        rate = dot(minus(go, pace), n)
        closes = (rate < -ROUNDING * fast) & ((gap > TOUCHES * size) | (-rate * (end - s) > SINKS * size))
        stride += 1
        hits = ((gap <= TOUCHES * size) & closes) | (stride >= MOST_STRIDES)
        if not hits:
            s += max(gap, (TOUCHES if closes else LEAVES) * size) / fast
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


def gap_to(o: Any, at: Any, r: Any, j: Any, centre: Any, q: Any, found: Any) -> Any:
    """The gap between a particle and body j, and the normal there."""
    p, best, n, rotation = o.pieces, np.inf, (0.0, 0.0, 0.0), matrix(q)
    for number in range(p.first[o.group[j]], p.first[o.group[j] + 1]):
        away, along = away_from(p, solid_of(p, number, centre, rotation), at, found)
        if away - r < best:
            best, n = away - r, along
    return best, n


# ---- the impact


@outlined
def strike(o: Any, i: Any, j: Any, blow: Any) -> Any:
    """`Obstacles.strike`."""
    law, kind, group = o.touching, o.kind[i], o.group[j]
    n, arm = blow.n, minus(plus(blow.at, -blow.r, blow.n), plus(row(o.x, j), blow.s, row(o.go, j)))
    v, turning, none = blow.v, blow.turning, (0.0, 0.0, 0.0)
    approach = -dot(minus(v, surface(o, j, arm)), n)
    dv, turn = none, none
    if approach > 0:
        e = law.restitution[kind, group]
        lively = (approach > blow.slow) | (e >= 1)
        e = e * max(approach / law.speed[kind, group], 1.0) ** (-law.exponent[kind, group]) if lively else 0.0
        given = (1.0 + e) * approach / (blow.light + weight(o, j, arm, n))
        kick(o, j, -given, n, arm)
        dv = plus(none, blow.light * given, n)
        static, kinetic = law.static[kind, group], law.kinetic[kind, group]
        rolls = turning is not None and blow.r > 0
        if static > 0:
            own = plus(v, 1.0, dv)
            if turning is not None:
                own = minus(own, cross(plus(none, blow.r, turning), n))
            slip = minus(own, surface(o, j, arm))
            slip = plus(slip, -dot(slip, n), n)
            size = np.sqrt(dot(slip, slip))
            if size > 0:
                t = plus(none, 1.0 / size, slip)
                stops = size / ((3.5 if rolls else 1.0) * blow.light + weight(o, j, arm, t))
                rubs = stops if stops <= static * given else min(kinetic * given, stops)
                kick(o, j, rubs, t, arm)
                dv = plus(dv, -rubs * blow.light, t)
                if turning is not None and blow.r > 0:
                    turn = plus(none, 2.5 * rubs * blow.light / blow.r, cross(n, t))
        if turning is not None and blow.r > 0 and law.rolling[kind, group] > 0:
            other = abs(dot(arm, n))
            radius = blow.r if law.flat[kind, group] > 0 else blow.r * other / (blow.r + other)
            most = law.rolling[kind, group] * radius * given
            turn = plus(turn, 1.0, slow_rolling(o, j, blow, plus(turning, 1.0, turn), most))
    return dv, turn


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
        o.given[3 + axis, j] += share
        o.mine[3 + axis, j] += share
    return -by * light * d[0], -by * light * d[1], -by * light * d[2]


def turned(o: Any, j: Any, spin: Any) -> Any:
    """The angular velocity that an angular momentum is for body j, as it faces at the end of the step."""
    q = (o.face[0, j], o.face[1, j], o.face[2, j], o.face[3, j])
    return angular_velocity(q, spin, row(o.inertia, j))


def turning_of(o: Any, j: Any) -> Any:
    """The angular velocity of body j."""
    g = o.given
    return turned(o, j, plus(row(o.spin, j), 1.0, (g[3, j], g[4, j], g[5, j])))


def surface(o: Any, j: Any, arm: Any) -> Any:
    """The velocity of body j at a place."""
    return plus(plus(row(o.v, j), 1.0, row(o.given, j)), 1.0, cross(turning_of(o, j), arm))


def weight(o: Any, j: Any, arm: Any, d: Any) -> Any:
    """By how much an impulse of 1 N s along a direction changes the velocity of body j at a place along that [1/kg]."""
    twist = cross(arm, d)
    return o.w[j] + dot(twist, turned(o, j, twist))


def kick(o: Any, j: Any, impulse: Any, d: Any, arm: Any) -> None:
    """Give body j an impulse along a direction at a place."""
    twist = cross(arm, d)
    for axis in range(3):
        along = d[0] if axis == 0 else d[1] if axis == 1 else d[2]
        turns = twist[0] if axis == 0 else twist[1] if axis == 1 else twist[2]
        o.given[axis, j] += o.w[j] * impulse * along
        o.mine[axis, j] += o.w[j] * impulse * along
        o.given[3 + axis, j] += impulse * turns
        o.mine[3 + axis, j] += impulse * turns
