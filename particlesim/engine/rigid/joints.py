"""Joints in kernels: positions corrected after every drift (SHAKE), velocities that violate joints removed (RATTLE).

A joint keeps some functions of two bodies at zero: the three coordinates of the distance of its ends (ball), these and the
two components of one axis across the other (hinge), or the length of the distance (rod). Their rates are rows

    u = n·(v₁ − v₂) + c₁·ω₁ − c₂·ω₂,   with c_k = r_k × n, or for the axes a of a hinge and p across it: n = 0, c_k = a × p

of a matrix J. A drift of length h from positions at which joints hold begins with impulses M⁻¹ Jᵀ λ such that joints hold at
its end, and ends with others that remove the components of the velocities along the rows. Free motion is symplectic, and so
is this; forces and contacts act where joints hold, on velocities without components along the rows (Reich). So joints hold
to rounding at all positions that are used or written, and the energy of bodies under joints oscillates within bounds.

All λ of connected bodies are solved for at once, by the factors of J M⁻¹ Jᵀ at the beginning of a drift (simplified Newton).
Rows are ordered such that the matrix has a narrow profile. Rows that depend on others, as in closed loops of hinges, have
vanishing pivots and get no impulse of their own: they hold because the others do.

Sources: J.-P. Ryckaert, G. Ciccotti, H. Berendsen, J. Comput. Phys. 23, 327 (1977); H. Andersen, ibid. 52, 24 (1983);
S. Reich, SIAM J. Numer. Anal. 33, 475 (1996); A. Kol, B. Laird, B. Leimkuhler, J. Chem. Phys. 107, 2580 (1997); profiles:
A. George, J. Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.rigid.bodies import WORLD, orientation, place, row
from particlesim.engine.rigid.rotation import (
    cross,
    dot,
    matrix,
    normalised,
    to_world,
    turned_by,
    turned_freely,
    world_inverse,
)
from particlesim.model.quaternions import times

BALL, HINGE, ROD = 0, 1, 2
"""Kinds of joints."""
ROWS = (3, 5, 1)
"""How many rows each has."""
TIGHT = 1e-14
"""Part of its size by which a joint may be open."""
ROUNDING = 8 * float(np.finfo(float).eps)
"""Rounding of a coordinate that shows in the opening of a joint, as a part of the coordinate."""
LIMIT = 60
"""Newton iterations; three to six are usual."""
DEPENDENT = 1e-11
"""Part of itself to which a pivot shrinks where a row depends on others."""


class Joints(NamedTuple):
    """All joints, connected ones contiguous.

    For each: kind, both bodies (the second may be WORLD), its ends in the frames of its bodies (in the world for WORLD)
    [3, joints], the axis of a hinge in the frame of the first and two across it in that of the second [3, joints], the
    length of a rod, its size [m], the first of its rows. Borders of components, in joints (`group`) and in bodies
    (`member_from`, of the list `members`). Links are pairs of joints that share a body, the later one first, with the side
    on which each has it, and the body; `link_from` are those of each component. The matrix: rows from column `head` on, at
    `start`; scratch: rows of J [rows, 15], right-hand sides, sums of λ, inverse pivots; places and momenta before a drift
    [n, 13]; the component of each body [n], −1 for none; the next component of the same cluster; by which joint and how far
    a step failed.
    """

    kind: Any
    first: Any
    second: Any
    end: Any
    other_end: Any
    axis: Any
    across: Any
    also_across: Any
    length: Any
    size: Any
    row: Any
    group: Any
    members: Any
    member_from: Any
    link: Any
    link_from: Any
    head: Any
    start: Any
    entries: Any
    rows: Any
    side: Any
    total: Any
    pivot: Any
    before: Any
    component: Any
    next: Any
    failed: Any


def arm_of(b: Any, i: Any, end: Any) -> Any:
    """From the centre of a body to a point of it."""
    return to_world(matrix(orientation(b, i)), end)


def difference(j: Any, b: Any, g: Any) -> Any:
    """From the second to the first end of a joint, and the arms of both."""
    i, k = j.first[g], j.second[g]
    one = arm_of(b, i, row(j.end, g))
    x, far = place(b, i), row(j.other_end, g)
    if k == WORLD:
        return (x[0] + one[0] - far[0], x[1] + one[1] - far[1], x[2] + one[2] - far[2]), one, (0.0, 0.0, 0.0)
    two, y = arm_of(b, k, far), place(b, k)
    # Centres first: the difference of what is far out keeps its digits.
    return (
        (
            (x[0] - y[0]) + (one[0] - two[0]),
            (x[1] - y[1]) + (one[1] - two[1]),
            (x[2] - y[2]) + (one[2] - two[2]),
        ),
        one,
        two,
    )


def axes(j: Any, b: Any, g: Any) -> Any:
    """The axis of a hinge by its first body, and the two across it by the second."""
    a, p, q = row(j.axis, g), row(j.across, g), row(j.also_across, g)
    a = to_world(matrix(orientation(b, j.first[g])), a)
    k = j.second[g]
    if k != WORLD:
        r = matrix(orientation(b, k))
        p, q = to_world(r, p), to_world(r, q)
    return a, p, q


def set_row(j: Any, inverse: Any, at: Any, g: Any, n: Any, one: Any, two: Any) -> None:
    """A row of J: direction and moments, and what the inverse inertias make of these."""
    e, k = j.rows[at], j.second[g]
    e[0], e[1], e[2] = n
    e[3], e[4], e[5] = one
    e[6], e[7], e[8] = two
    e[9], e[10], e[11] = turned_by(inverse[j.first[g]], one)
    if k != WORLD:
        e[12], e[13], e[14] = turned_by(inverse[k], two)


@outlined
def lay_rows(j: Any, b: Any, inverse: Any, first: Any, last: Any) -> None:
    """The rows of joints [first, last) where bodies are; their inertias are known."""
    for g in range(first, last):
        at, kind = j.row[g], j.kind[g]
        d, one, two = difference(j, b, g)
        if kind == ROD:
            k = 1 / np.sqrt(dot(d, d))
            n = (d[0] * k, d[1] * k, d[2] * k)
            set_row(j, inverse, at, g, n, cross(one, n), cross(two, n))
        else:
            x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
            set_row(j, inverse, at, g, x, cross(one, x), cross(two, x))
            set_row(j, inverse, at + 1, g, y, cross(one, y), cross(two, y))
            set_row(j, inverse, at + 2, g, z, cross(one, z), cross(two, z))
        if kind == HINGE:
            a, p, q = axes(j, b, g)
            none, c, d = (0.0, 0.0, 0.0), cross(a, p), cross(a, q)
            set_row(j, inverse, at + 3, g, none, c, c)
            set_row(j, inverse, at + 4, g, none, d, d)


@outlined
def misfit(j: Any, b: Any, first: Any, last: Any) -> tuple[float, int]:
    """How far joints [first, last) are open, into `side`; the largest in units of what is allowed, and by which."""
    worst, which = 0.0, first
    for g in range(first, last):
        at, kind = j.row[g], j.kind[g]
        d, _, _ = difference(j, b, g)
        x, size = place(b, j.first[g]), j.size[g]
        allowed = TIGHT * size + ROUNDING * (abs(x[0]) + abs(x[1]) + abs(x[2]) + size)
        opened = 0.0
        if kind == ROD:
            j.side[at] = np.sqrt(dot(d, d)) - j.length[g]
            opened = abs(j.side[at])
        else:
            j.side[at], j.side[at + 1], j.side[at + 2] = d
            opened = max(abs(d[0]), max(abs(d[1]), abs(d[2])))
        if kind == HINGE:
            a, p, q = axes(j, b, g)
            j.side[at + 3], j.side[at + 4] = dot(a, p), dot(a, q)
            # An axis that is off by an angle opens the joint by that times its size.
            opened = max(opened, size * max(abs(j.side[at + 3]), abs(j.side[at + 4])))
        if not opened / allowed <= worst:
            worst, which = opened / allowed, g
    return worst, which


# ---- the matrix J M⁻¹ Jᵀ by its profile


@outlined
def factorise(j: Any, b: Any, component: Any) -> None:
    """The matrix of a component, from its rows, and its factors in its place: L D Lᵀ, with 1/D in `pivot`."""
    begin, end = j.row[j.group[component]], j.row[j.group[component + 1]]
    for at in range(j.start[begin], j.start[end]):
        j.entries[at] = 0.0
    for m in range(j.link_from[component], j.link_from[component + 1]):
        add_link(j, b, j.link[m])
    entries, pivot = j.entries, j.pivot
    for r in range(begin, end):
        head, mine = j.head[r], j.start[r] - j.head[r]
        whole = entries[mine + r]
        for c in range(head, r):
            low, theirs = max(head, j.head[c]), j.start[c] - j.head[c]
            total = entries[mine + c]
            for m in range(low, c):
                total -= entries[mine + m] * entries[theirs + m]
            entries[mine + c] = total
        left = whole
        for c in range(head, r):
            scaled = entries[mine + c] * pivot[c]
            left -= scaled * entries[mine + c]
            entries[mine + c] = scaled
        pivot[r] = 1 / left if left > DEPENDENT * whole else 0.0


def add_link(j: Any, b: Any, link: Any) -> None:
    """The coupling of two joints through a body that they share."""
    late, early, body = link[0], link[1], link[4]
    sign, w = (1.0 if link[2] == link[3] else -1.0), b.w[body]
    mine, theirs = 3 + 3 * link[2], 9 + 3 * link[3]
    for r in range(j.row[late], j.row[late + 1]):
        e, at = j.rows[r], j.start[r] - j.head[r]
        for c in range(j.row[early], min(j.row[early + 1], r + 1)):
            o = j.rows[c]
            part = w * (e[0] * o[0] + e[1] * o[1] + e[2] * o[2])
            part += e[mine] * o[theirs] + e[mine + 1] * o[theirs + 1] + e[mine + 2] * o[theirs + 2]
            j.entries[at + c] += sign * part


def forward(j: Any, begin: Any, end: Any) -> None:
    """Replace the right-hand side b of rows [begin, end), those of a component, by L⁻¹ b."""
    side, entries = j.side, j.entries
    for r in range(begin, end):
        at, total = j.start[r] - j.head[r], side[r]
        for c in range(j.head[r], r):
            total -= entries[at + c] * side[c]
        side[r] = total


@outlined
def solved(j: Any, component: Any) -> None:
    """Replace the right-hand side of a component by the solution."""
    begin, end = j.row[j.group[component]], j.row[j.group[component + 1]]
    side, entries = j.side, j.entries
    forward(j, begin, end)
    for r in range(begin, end):
        side[r] *= j.pivot[r]
    for back in range(end - begin):
        r = end - 1 - back
        at, x = j.start[r] - j.head[r], side[r]
        for c in range(j.head[r], r):
            side[c] -= entries[at + c] * x


# ---- velocities


def component_of(j: Any, i: Any) -> int:
    """The component of joints that a body is in; −1 for none, for particles that no rod holds, and for colliders."""
    return int(j.component[i]) if 0 <= i < j.component.size else -1


@outlined
def level(j: Any, b: Any, now: Any, gained: Any, component: Any) -> None:
    """Take away what velocities `now` have along the rows of a component, which are laid out and factorised; `gained`
    are the angular momenta that this takes. (Both as in `Motion`.)"""
    first, last = j.group[component], j.group[component + 1]
    for g in range(first, last):
        m, k = now[j.first[g]], j.second[g]
        for r in range(j.row[g], j.row[g + 1]):
            e = j.rows[r]
            u = e[0] * m[0] + e[1] * m[1] + e[2] * m[2] + e[3] * m[3] + e[4] * m[4] + e[5] * m[5]
            if k != WORLD:
                o = now[k]
                u -= e[0] * o[0] + e[1] * o[1] + e[2] * o[2] + e[6] * o[3] + e[7] * o[4] + e[8] * o[5]
            j.side[r] = -u
    solved(j, component)
    for g in range(first, last):
        i, k = j.first[g], j.second[g]
        for r in range(j.row[g], j.row[g + 1]):
            e, size = j.rows[r], j.side[r]
            m, s = now[i], size * b.w[i]
            for axis in range(3):
                m[axis] += s * e[axis]
                m[3 + axis] += size * e[9 + axis]
                gained[i, axis] += size * e[3 + axis]
            if k != WORLD:
                m, s = now[k], size * b.w[k]
                for axis in range(3):
                    m[axis] -= s * e[axis]
                    m[3 + axis] -= size * e[12 + axis]
                    gained[k, axis] -= size * e[6 + axis]


def ready(j: Any, b: Any, motion: Any, component: Any) -> None:
    """Inertias, velocities, rows and factors of a component where its bodies are."""
    for at in range(j.member_from[component], j.member_from[component + 1]):
        i = j.members[at]
        world_inverse(orientation(b, i), row(b.inertia, i), motion.inverse[i])
        turning = turned_by(motion.inverse[i], row(b.spin, i))
        for axis in range(3):
            motion.now[i, axis] = b.v[axis, i]
            motion.gained[i, axis] = 0.0
        motion.now[i, 3], motion.now[i, 4], motion.now[i, 5] = turning
    lay_rows(j, b, motion.inverse, j.group[component], j.group[component + 1])
    factorise(j, b, component)


def levelled(j: Any, b: Any, motion: Any, component: Any) -> None:
    """Take away what the bodies of a component have along its rows, which are ready."""
    # Twice: what rounding leaves of large velocities is taken by the second.
    level(j, b, motion.now, motion.gained, component)
    level(j, b, motion.now, motion.gained, component)
    for at in range(j.member_from[component], j.member_from[component + 1]):
        i = j.members[at]
        for axis in range(3):
            b.v[axis, i] = motion.now[i, axis]
            b.spin[axis, i] += motion.gained[i, axis]
            motion.gained[i, axis] = 0.0


# ---- places


@shared
def drift_joined(j: Any, b: Any, motion: Any, component: Any, h: Any, ends: Any) -> bool:
    """Move and turn the bodies of a component freely, but for its joints, and where a step `ends` there, take away what they
    have along its rows, and leave these ready; whether that could be done."""
    ready(j, b, motion, component)
    begin, end = j.row[j.group[component]], j.row[j.group[component + 1]]
    for at in range(j.member_from[component], j.member_from[component + 1]):
        i, s = j.members[at], j.before[j.members[at]]
        s[3], s[4], s[5], s[6] = orientation(b, i)
        for axis in range(3):
            s[axis], s[7 + axis], s[10 + axis] = b.x[axis, i], b.v[axis, i], b.spin[axis, i]
    for r in range(begin, end):
        j.total[r] = 0.0
    held = False
    for turn in range(LIMIT):
        for at in range(j.member_from[component], j.member_from[component + 1]):
            i, s = j.members[at], j.before[j.members[at]]
            for axis in range(3):
                b.x[axis, i] = s[axis] + h * b.v[axis, i]
            q = turned_freely((s[3], s[4], s[5], s[6]), row(b.spin, i), row(b.inertia, i), h)
            b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q
        worst, which = misfit(j, b, j.group[component], j.group[component + 1])
        if worst <= 1.0:
            held = True
            break
        if not worst < np.inf or turn == LIMIT - 1:
            j.failed[0], j.failed[1] = which, worst
            break
        for r in range(begin, end):
            j.side[r] *= -1 / h
        solved(j, component)
        for r in range(begin, end):
            j.total[r] += j.side[r]
        push(j, b, component)
    if ends:
        ready(j, b, motion, component)
        levelled(j, b, motion, component)
    return held


def push(j: Any, b: Any, component: Any) -> None:
    """Velocities and momenta before a drift with the impulses `total` along the rows there."""
    for at in range(j.member_from[component], j.member_from[component + 1]):
        i, s = j.members[at], j.before[j.members[at]]
        for axis in range(3):
            b.v[axis, i], b.spin[axis, i] = s[7 + axis], s[10 + axis]
    for g in range(j.group[component], j.group[component + 1]):
        i, k = j.first[g], j.second[g]
        for r in range(j.row[g], j.row[g + 1]):
            e, size = j.rows[r], j.total[r]
            for axis in range(3):
                b.v[axis, i] += b.w[i] * size * e[axis]
                b.spin[axis, i] += size * e[3 + axis]
                if k != WORLD:
                    b.v[axis, k] -= b.w[k] * size * e[axis]
                    b.spin[axis, k] -= size * e[6 + axis]


@shared
def fit(j: Any, b: Any, motion: Any, component: Any) -> bool:
    """Bring the bodies of a component to near places where its joints are closed, and take away what their velocities have
    along them; whether that could be done."""
    held = False
    for turn in range(LIMIT):
        worst, which = misfit(j, b, j.group[component], j.group[component + 1])
        if worst <= 1.0:
            held = True
            break
        if not worst < np.inf or turn == LIMIT - 1:
            j.failed[0], j.failed[1] = which, worst
            break
        ready(j, b, motion, component)
        # What was measured stands in `side`: a shift along the rows, by the inertias, that closes the joints.
        for at in range(j.member_from[component], j.member_from[component + 1]):
            for axis in range(6):
                motion.now[j.members[at], axis] = 0.0
        close(j, b, motion, component)
        for at in range(j.member_from[component], j.member_from[component + 1]):
            i = j.members[at]
            m, q = motion.now[i], orientation(b, i)
            for axis in range(3):
                b.x[axis, i] += m[axis]
            turn_by = times((0.0, 0.5 * m[3], 0.5 * m[4], 0.5 * m[5]), q)
            q = normalised((q[0] + turn_by[0], q[1] + turn_by[1], q[2] + turn_by[2], q[3] + turn_by[3]))
            b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q
    ready(j, b, motion, component)
    levelled(j, b, motion, component)
    return held


def close(j: Any, b: Any, motion: Any, component: Any) -> None:
    """Shifts, into motion.now, that close joints by what stands in `side`."""
    for r in range(j.row[j.group[component]], j.row[j.group[component + 1]]):
        j.side[r] = -j.side[r]
    solved(j, component)
    for g in range(j.group[component], j.group[component + 1]):
        i, k = j.first[g], j.second[g]
        for r in range(j.row[g], j.row[g + 1]):
            e, size = j.rows[r], j.side[r]
            for axis in range(3):
                motion.now[i, axis] += size * b.w[i] * e[axis]
                motion.now[i, 3 + axis] += size * e[9 + axis]
                if k != WORLD:
                    motion.now[k, axis] -= size * b.w[k] * e[axis]
                    motion.now[k, 3 + axis] -= size * e[12 + axis]
