"""Impulses of a cluster by a direct method, where sweeps do not find them: heavy bodies on light ones.

Sweeps pass on what a light body can carry; under one that is k times heavier they take about k turns. Here all contacts are
looked at together, by the method of multipliers: impulses P become those within bounds that are nearest to P − R u, with a
penalty R, where u is by how much the velocities miss what they are to be, with the new impulses. These change velocities by
the x for which a convex function is least, whose gradient is

    ∇φ(x) = M x + Jᵀ (P − P'),   P' = [P − R (u + J x)] within bounds,

found by Newton's method, (M + Jᵀ D J) d = −∇φ with D = −∂P'/∂u, and a search along d for where φ stops falling, so that it
cannot go in circles. Bounds of friction are μ times the normal impulses of the turn before.

With a finite R redundant contacts, such as the four corners of a box, share what they carry. 1/(R λ) of an error is left,
with 1/λ the mass of all bodies; rounding leaves ε R/m, with m the least mass that a contact meets. R = √(m/(λ ε)) makes
both the same, and the next turn begins with what is left.

Bounds that were those of the turn before make slow progress where things slide. So from the second turn on it is tried to
have friction go with what presses, P_t = μ P_n t with both unknown, for which there is no such function, and Newton's method
goes all of its way or is given up.

Sources: R. Rockafellar, SIAM J. Control Optim. 14, 877 (1976) (multipliers); E. Todorov, ICRA 2014, 6054 (Newton's method
for contacts as a convex problem); J. Haslinger, Math. Methods Appl. Sci. 5, 422 (1983) (given bounds of friction, in turns);
P. Alart, A. Curnier, Comput. Methods Appl. Mech. Engrg. 92, 353 (1991) (friction that goes with what presses); M. Silcowitz,
S. Niebe, K. Erleben, GRAPP 2010 (in turn with sweeps).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.rigid.bodies import WORLD, orientation
from particlesim.engine.rigid.contact_rows import speed_along, strike
from particlesim.engine.rigid.equations import eliminate
from particlesim.engine.rigid.rotation import matrix, to_body
from particlesim.engine.rigid.stops import ROLL

EPS = float(np.finfo(float).eps)
SEEN, AGAIN, ANEW = 0, 1, 2
"""By what it is told which impulses are at their bounds: motion and impulses, impulses of the last turn, all being stuck."""
QUICK = 4.0
"""What slides this many times as fast as anything approaches goes on sliding, it seems."""
EDGE = 1e-9
"""Part of a bound by which an impulse that is at it may miss it."""
NEWTON = 16
"""Newton's iterations in a turn at most."""
FLAT = 1e-7
"""Part of the slope at the beginning of a way at which it counts as zero."""
TOUCHING = 1e-6
"""Part of the largest speed below which bodies that part still touch."""
HALVINGS = 40
"""Looks at the slope along a way at most."""
LINE = 24
"""A row of J for both of its bodies, and what an impulse along it does to their velocities."""


def keep_impulses(k: Any, motion: Any, cluster: Any) -> None:
    """Keep the impulses of a cluster."""
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.kept[c, d] = k.impulse[c, d]


@outlined
def begin_anew(b: Any, k: Any, motion: Any, cluster: Any, part: Any) -> None:
    """Begin with a part, none or all, of the impulses that were kept."""
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        for axis in range(6):
            motion.now[i, axis] = motion.start[i, axis]
        for axis in range(3):
            motion.gained[i, axis] = motion.start[i, 6 + axis]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.impulse[c, d] = part * k.kept[c, d]
            if part > 0:
                strike(b, k, motion, c, d, k.impulse[c, d])


def pressing(k: Any, impulse: Any, c: Any) -> float:
    """That of some impulses which bounds the friction of a contact."""
    return float(impulse[int(k.aim[0, c]), 0] if k.turns[c] == ROLL else impulse[c, 0])


@outlined
def set_bounds(k: Any, motion: Any, cluster: Any, coupled: Any) -> None:
    """Bounds of friction by the normal impulses that there are, to which they stay `coupled`, or not."""
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.bound[c] = k.friction[c] * pressing(k, k.impulse, c)
        k.grip[c] = k.friction[c] if coupled and k.turns[c] != ROLL else 0.0


@outlined
def bound_at_first(b: Any, k: Any, motion: Any, cluster: Any, stiff: Any) -> None:
    """The same by what has been solved for with all that presses stuck."""
    new = on_stack(1, 3, np.float64)
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.bound[c] = k.grip[c] = 0.0
        in_bounds(k, int(k.aim[0, c]) if k.turns[c] == ROLL else c, 0.0, stiff, new)
        k.onward[c, 0] = new[0, 0]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.bound[c] = k.friction[c] * k.onward[c, 0]


@outlined
def correct(b: Any, k: Any, motion: Any, cluster: Any, fresh: Any, coupled: Any) -> bool:
    """Give the impulses of one turn of the method to all contacts of a cluster. The first turn begins with all that presses
    stuck. Whether they were found: else nothing is given."""
    a, n = motion.room, 0
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        a.number[motion.bodies[at]] = n
        n += 6
    for r in range(n):
        a.change[r] = 0.0
    first, last = motion.contact_from[cluster], motion.contact_from[cluster + 1]
    stiff = stiffness(b, k, motion, cluster)
    for at in range(first, last):
        c = k.order[at]
        for d in range(3):
            used = k.turns[c] != ROLL if d == 0 else k.surface[1, c] > 0
            k.before[c, d] = speed_along(k, motion, c, d) - (k.target[c] if d == 0 else 0.0) if used else 0.0
    done = False
    for turn in range(NEWTON):
        lay_equations(b, k, motion, cluster, n, stiff, SEEN if turn > 0 else (ANEW if fresh else AGAIN))
        eliminate(a.matrix, a.side, a.scale, a.order, n)
        for at in range(first, last):
            c = k.order[at]
            for d in range(3):
                k.onward[c, d] = along(k.rows[c, d], k.first[c], k.second[c], a, a.scale)
        if turn == 0:
            move_on(k, motion, cluster, n, 1.0)
            if fresh:
                bound_at_first(b, k, motion, cluster, stiff)
        elif go_along(b, k, motion, cluster, n, stiff, coupled):
            done = True
            break
    if done:
        give_all(b, k, motion, first, last, stiff)
    return bool(done)


@outlined
def give_all(b: Any, k: Any, motion: Any, first: Any, last: Any, stiff: Any) -> None:
    """Give contacts [first, last) of the order the impulses that have been found."""
    new = on_stack(1, 3, np.float64)
    for at in range(first, last):
        c = k.order[at]
        in_bounds(k, c, 0.0, stiff, new)
        for d in range(3):
            strike(b, k, motion, c, d, new[0, d] - k.impulse[c, d])
            k.impulse[c, d] = new[0, d]


@outlined
def stiffness(b: Any, k: Any, motion: Any, cluster: Any) -> float:
    """The penalty R of a cluster [kg]."""
    heavy, light = 0.0, np.inf
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        w = b.w[motion.bodies[at]]
        heavy += 1 / w if w > 0 else 0.0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        if k.turns[c] == 0:
            light = min(light, min(k.rows[c, 0, 15], min(k.rows[c, 1, 15], k.rows[c, 2, 15])))
    return float(np.sqrt(heavy * min(light, heavy) / EPS))


# ---- impulses within bounds


@outlined
def in_bounds(k: Any, c: Any, part: Any, stiff: Any, new: Any) -> float:
    """The impulses P' of a contact at a part of the way, into new [1, 3]; returns the size that its friction would have."""
    new[0, 0] = 0.0
    if k.turns[c] != ROLL:
        new[0, 0] = max(k.impulse[c, 0] - stiff * (k.before[c, 0] + part * k.onward[c, 0]), 0.0)
    new[0, 1] = new[0, 2] = 0.0
    if k.grip[c] > 0:
        k.bound[c] = k.grip[c] * new[0, 0]
    if not k.bound[c] > 0:
        return 0.0
    one = k.impulse[c, 1] - stiff * (k.before[c, 1] + part * k.onward[c, 1])
    two = k.impulse[c, 2] - stiff * (k.before[c, 2] + part * k.onward[c, 2])
    size = np.sqrt(one * one + two * two)
    less = k.bound[c] / size if size > k.bound[c] else 1.0
    new[0, 1], new[0, 2] = less * one, less * two
    return float(size)


def is_free(k: Any, c: Any, d: Any, size: Any, new: Any) -> bool:
    """Whether an impulse of a contact is not at its bound; `size` and `new` as by `in_bounds`."""
    if d > 0:
        return bool(k.bound[c] > 0 and size <= k.bound[c])
    return bool(new[0, 0] > 0)


@outlined
def stays(b: Any, k: Any, motion: Any, cluster: Any, stiff: Any) -> bool:
    """Whether at the end of the way the same impulses are at their bounds as at its beginning."""
    same, new = True, on_stack(1, 3, np.float64)
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        size = in_bounds(k, c, 0.0, stiff, new)
        presses, holds = is_free(k, c, 0, size, new), is_free(k, c, 1, size, new)
        size = in_bounds(k, c, 1.0, stiff, new)
        same = same and presses == is_free(k, c, 0, size, new) and holds == is_free(k, c, 1, size, new)
    return bool(same)


def seems_pressed(k: Any, motion: Any, cluster: Any, c: Any) -> bool:
    """Whether a contact will press, it seems: it did with the impulses that were kept, or its bodies do not part."""
    return bool(k.kept[c, 0] > 0 or k.before[c, 0] < TOUCHING * motion.largest[cluster])


# ---- Newton's method


def along(e: Any, i: Any, j: Any, a: Any, x: Any) -> float:
    """What a row makes of changes x of the velocities of bodies."""
    at, u = a.number[i], 0.0
    for m in range(6):
        u += e[m] * x[at + m]
    if j != WORLD:
        at = a.number[j]
        for m in range(3):
            u -= e[m] * x[at + m] + e[6 + m] * x[at + 3 + m]
    return float(u)


@outlined
def lay_equations(b: Any, k: Any, motion: Any, cluster: Any, n: Any, stiff: Any, guess: Any) -> None:
    """The matrix 1 + M⁻¹ Jᵀ D J, and the side −M⁻¹ ∇φ."""
    a, line, quick = motion.room, on_stack(1, LINE, np.float64), 0.0
    for r in range(n):
        for c in range(n):
            a.matrix[r, c] = 0.0
        a.matrix[r, r] = 1.0
        a.side[r] = -a.change[r]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        quick = max(quick, -QUICK * k.before[k.order[at], 0])
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.onward[c, d] = 0.0
        if guess == ANEW:
            add_at_first(b, k, motion, cluster, c, stiff, quick, line)
        else:
            add_seen(b, k, motion, c, stiff, guess == AGAIN, line)


@outlined
def add_at_first(
    b: Any, k: Any, motion: Any, cluster: Any, c: Any, stiff: Any, quick: Any, line: Any
) -> None:
    """Add a contact as if it were stuck where it seems to press; what runs faster than `quick` slides on as it does."""
    e, i, j, r = k.rows[c], k.first[c], k.second[c], stiff
    presser = int(k.aim[0, c]) if k.turns[c] == ROLL else c
    if not seems_pressed(k, motion, cluster, presser):
        return
    pace = np.sqrt(k.before[c, 1] * k.before[c, 1] + k.before[c, 2] * k.before[c, 2])
    runs = k.turns[c] == 0 and pace > quick
    if presser == c:
        lay_line(b, e[0], i, j, line, 1.0, False)
        add_line(motion.room, i, j, line, r, -r * k.before[c, 0])
        if runs:
            part = -k.friction[c] / pace
            lay_way(b, e, i, j, line, part * k.before[c, 1], part * k.before[c, 2])
            add_line(motion.room, i, j, line, r, -r * k.before[c, 0])
    for d in range(1, 3):
        if k.surface[1, c] > 0 and not runs:
            lay_line(b, e[d], i, j, line, 1.0, False)
            add_line(motion.room, i, j, line, r, -r * k.before[c, d])


@outlined
def add_seen(b: Any, k: Any, motion: Any, c: Any, stiff: Any, again: Any, line: Any) -> None:
    """Add a contact as it is by its motion and its impulses, or by these alone, where they are those of the last turn
    (`again`) and the motion is what still has to be taken away."""
    new, a = on_stack(1, 3, np.float64), motion.room
    e, i, j, r = k.rows[c], k.first[c], k.second[c], stiff
    size = in_bounds(k, c, 0.0, 0.0 if again else stiff, new)
    slides = k.bound[c] > 0 and size > (1 - EDGE if again else 1.0) * k.bound[c]
    for d in range(3):
        more, inside = new[0, d] - k.impulse[c, d], is_free(k, c, d, size, new)
        if again:
            inside = inside and not (d > 0 and slides)
            more -= r * k.before[c, d] if inside else 0.0
        if more != 0 or inside:
            lay_line(b, e[d], i, j, line, 1.0, False)
            add_line(a, i, j, line, r if inside else 0.0, more)
        if d == 0 and inside and k.grip[c] > 0 and slides:
            # Friction goes with what presses.
            part = k.grip[c] / k.bound[c]
            lay_way(b, e, i, j, line, part * new[0, 1], part * new[0, 2])
            add_line(a, i, j, line, r, 0.0)
    if slides:
        # What slides can still be turned across its friction.
        lay_line(b, e[1], i, j, line, -new[0, 2] / k.bound[c], False)
        lay_line(b, e[2], i, j, line, new[0, 1] / k.bound[c], True)
        add_line(a, i, j, line, r * k.bound[c] / size, 0.0)


def lay_line(b: Any, e: Any, i: Any, j: Any, line: Any, part: Any, more: Any) -> None:
    """A row of J for both bodies, and what an impulse along it does; a part of it, added to what is there if `more`."""
    for m in range(LINE):
        if not more:
            line[0, m] = 0.0
    for m in range(3):
        line[0, m] += part * e[m]
        line[0, 3 + m] += part * e[3 + m]
        line[0, 12 + m] += part * b.w[i] * e[m]
        line[0, 15 + m] += part * e[9 + m]
        if j != WORLD:
            line[0, 6 + m] -= part * e[m]
            line[0, 9 + m] -= part * e[6 + m]
            line[0, 18 + m] -= part * b.w[j] * e[m]
            line[0, 21 + m] -= part * e[12 + m]


def lay_way(b: Any, e: Any, i: Any, j: Any, line: Any, one: Any, two: Any) -> None:
    """What impulses do along the tangents of a contact, in the place of what one does along a row."""
    for m in range(3):
        line[0, 12 + m] = b.w[i] * (one * e[1, m] + two * e[2, m])
        line[0, 15 + m] = one * e[1, 9 + m] + two * e[2, 9 + m]
        if j != WORLD:
            line[0, 18 + m] = -b.w[j] * (one * e[1, m] + two * e[2, m])
            line[0, 21 + m] = -(one * e[1, 12 + m] + two * e[2, 12 + m])


@outlined
def add_line(a: Any, i: Any, j: Any, line: Any, stiff: Any, more: Any) -> None:
    """Add a row with its penalty to the matrix, and an impulse along it to the side."""
    sides = 1 if j == WORLD else 2
    for one in range(sides):
        at = a.number[i if one == 0 else j]
        for m in range(6):
            push = line[0, 12 + 6 * one + m]
            a.side[at + m] += push * more
            for two in range(sides):
                to = a.number[i if two == 0 else j]
                for c in range(6):
                    a.matrix[at + m, to + c] += stiff * push * line[0, 6 * two + c]


@outlined
# ---- the way that Newton's method says


@outlined
def go_along(b: Any, k: Any, motion: Any, cluster: Any, n: Any, stiff: Any, coupled: Any) -> bool:
    """Go along the change that has been solved for to where φ stops falling; whether that was the end of the way, and so
    the least of φ."""
    line = on_stack(1, 2, np.float64)
    quadratic(b, motion, cluster, line)
    begin = slope(b, k, motion, cluster, stiff, line, 0.0)
    end = slope(b, k, motion, cluster, stiff, line, 1.0)
    part, low, high = 1.0, 0.0, 1.0
    noise = 4 * EPS * motion.largest[cluster]
    flat = not abs(end) > FLAT * abs(begin) or not abs(begin) > stiff * noise * noise
    done = flat and stays(b, k, motion, cluster, stiff)
    if end > 0 and not flat and not coupled:
        for _ in range(HALVINGS):
            part = 0.5 * (low + high)
            middle = slope(b, k, motion, cluster, stiff, line, part)
            if abs(middle) <= 1e-3 * abs(begin):
                break
            if middle > 0:
                high = part
            else:
                low = part
    move_on(k, motion, cluster, n, part)
    return bool(done)


def move_on(k: Any, motion: Any, cluster: Any, n: Any, part: Any) -> None:
    """Go a part of the way."""
    for r in range(n):
        motion.room.change[r] += part * motion.room.scale[r]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.before[c, d] += part * k.onward[c, d]


@outlined
def slope(b: Any, k: Any, motion: Any, cluster: Any, stiff: Any, line: Any, part: Any) -> float:
    """The slope of φ at a part of the way."""
    new, total = on_stack(1, 3, np.float64), line[0, 0] + part * line[0, 1]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        in_bounds(k, c, part, stiff, new)
        for d in range(3):
            total += (k.impulse[c, d] - new[0, d]) * k.onward[c, d]
    return float(total)


@outlined
def quadratic(b: Any, motion: Any, cluster: Any, line: Any) -> None:
    """What masses add to the slope: at the beginning, and along the whole way."""
    a = motion.room
    line[0, 0] = line[0, 1] = 0.0
    for where in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[where]
        at, x, d = a.number[i], a.change, a.scale
        for axis in range(3):
            if b.w[i] > 0:  # a guest that is held does not move
                line[0, 0] += x[at + axis] * d[at + axis] / b.w[i]
                line[0, 1] += d[at + axis] * d[at + axis] / b.w[i]
        r = matrix(orientation(b, i))
        one, two = (
            to_body(r, (x[at + 3], x[at + 4], x[at + 5])),
            to_body(r, (d[at + 3], d[at + 4], d[at + 5])),
        )
        for axis in range(3):
            p = one[0] if axis == 0 else (one[1] if axis == 1 else one[2])
            q = two[0] if axis == 0 else (two[1] if axis == 1 else two[2])
            if b.inertia[axis, i] < np.inf:
                line[0, 0] += b.inertia[axis, i] * p * q
                line[0, 1] += b.inertia[axis, i] * q * q
