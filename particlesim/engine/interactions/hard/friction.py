"""Friction of hard contacts, which stops sliding, and rolling friction, which stops rolling: in the turns from contact to
contact (`turns`, `walls`) both are brought up to what the impulse along the normal allows.

With rolling friction μ_r a contact with the normal impulse P_n also has an angular impulse M across the normal,

    ω₁ += M/I₁,   ω₂ −= M/I₂,   |M| ≤ μ_r R P_n,   R = r₁ r₂/(r₁ + r₂),

R = r at a collider: what ends the rolling ω₁ − ω₂ across the normal, or what is allowed. It turns both by opposite impulses
and moves neither, so momentum and angular momentum are kept, and no turn adds energy. It is kept as q = M (w₁ + w₂)/R with
w = 1/m, a speed like those of friction, |q| ≤ μ_r v with v what the contact has given along the normal. With I = 2/5 m r²,

    ω₁ += 5/2 w₁/(w₁ + w₂) R/r₁² q,   ω₂ −= 5/2 w₂/(w₁ + w₂) R/r₂² q.

Source: the law of rigid bodies (`engine.rigid.rolling`); J. Ai, J.-F. Chen, J. M. Rotter, J. Y. Ooi, Powder Technol. 206,
269 (2011), on models of rolling friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import PARTS, root
from particlesim.engine.interactions.hard.bench import ARM, LIMIT, SHARE, SPINS, WORK
from particlesim.engine.interactions.hard.laws import kinetic_at, rolling_at, static_at
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.rubbing import STILL

ALIKE = 1e-3
"""What two spheres may differ in to count as equal, as a part of it."""


def surfaces(c: Any, i: Any, j: Any) -> Any:
    """r₁ ω₁ + r₂ ω₂ [m/s]."""
    s, a, b = c.spin, c.r[i], c.r[j]
    return a * s.wx[i] + b * s.wx[j], a * s.wy[i] + b * s.wy[j], a * s.wz[i] + b * s.wz[j]


def slip_of(each: Any, c: Any, k: Any, slide: Any) -> Any:
    """How the surfaces of pair k slide over each other; `slide` is the difference of their velocities across the normal
    [m/s]."""
    n, (sx, sy, sz) = each.bench.normal, slide
    if c.spin is not None:
        arm = n[ARM, k]
        u = surfaces(c, each.bench.rows[0, k], each.bench.rows[1, k])
        tx, ty, tz = cross(u, (n[0, k], n[1, k], n[2, k]))
        sx, sy, sz = sx - arm * tx, sy - arm * ty, sz - arm * tz
    return sx, sy, sz


def turn_pair(each: Any, c: Any, k: Any, tx: Any, ty: Any, tz: Any) -> None:
    """Turn both of pair k by friction that changes the velocity of the first relative to the second by t [m/s]."""
    if c.spin is not None:
        n = each.bench.normal
        turn = cross((n[0, k], n[1, k], n[2, k]), (-tx, -ty, -tz))
        spin_up(c, each.bench.rows[0, k], n[SPINS, k], turn)
        spin_up(c, each.bench.rows[1, k], n[SPINS + 1, k], turn)


def hold_pair(each: Any, c: Any, k: Any, slide: Any, given: Any) -> Any:
    """Bring the friction of pair k up to what it has been given along the normal; returns by how much that changes
    the velocity of the first relative to the second [m/s]."""
    slip, share = slip_of(each, c, k, slide), each.bench.normal[SHARE, k]
    t = held_by(each.bench.held, k, slip, share, given, static_at(each, k), kinetic_at(each, k))
    turn_pair(each, c, k, t[0], t[1], t[2])
    return t


def held_by(held: Any, k: Any, slip: Any, share: Any, given: Any, static: Any, kinetic: Any) -> Any:
    """Friction of contact k in place of what it has had in the step: what ends sliding, or what is allowed; by how much it
    changes [m/s]. Where pushes have become less it stays as large as it was, so that no change of it adds energy."""
    tx, ty, tz = held[0, k], held[1, k], held[2, k]
    x, y, z = tx - share * slip[0], ty - share * slip[1], tz - share * slip[2]
    size, had = x * x + y * y + z * z, tx * tx + ty * ty + tz * tz
    most = type_of(size, static) * given
    slides = size > max(max(most * most, had), type_of(size, STILL * STILL))
    if slides:
        part = min(max(type_of(size, kinetic) * given, np.sqrt(had)) / np.sqrt(size), type_of(size, 1))
        x, y, z = part * x, part * y, part * z
    held[0, k], held[1, k], held[2, k] = x, y, z
    held[LIMIT, k] = kinetic if slides else static
    return x - tx, y - ty, z - tz


def spin_up(c: Any, i: Any, part: Any, turn: Any) -> None:
    """Change the angular velocity of a particle by a part of something."""
    c.spin.wx[i] += part * turn[0]
    c.spin.wy[i] += part * turn[1]
    c.spin.wz[i] += part * turn[2]


# Rolling friction


@outlined
def hold_rolling(each: Any, c: Any, k: Any, given: Any) -> None:
    """Bring the rolling friction of pair k up to what it has been given along the normal."""
    bench, n, s = each.bench, each.bench.normal, c.spin
    i, j = bench.rows[0, k], bench.rows[1, k]
    x, y, z = s.wx[i] - s.wx[j], s.wy[i] - s.wy[j], s.wz[i] - s.wz[j]
    up = x * n[0, k] + y * n[1, k] + z * n[2, k]
    rolls = (x - up * n[0, k], y - up * n[1, k], z - up * n[2, k])
    mine, other = rolling_arms(each, c, k)
    if mine + other > 0:
        most = type_of(x, rolling_at(each, k))
        q = held_by(bench.rolled, k, rolls, type_of(x, 1) / (mine + other), given, most, most)
        roll_pair(each, c, k, q)


def rolling_arms(each: Any, c: Any, k: Any) -> Any:
    """By how much rolling friction turns each of pair k, over q [1/m]."""
    n, i, j = each.bench.normal, each.bench.rows[0, k], each.bench.rows[1, k]
    by = type_of(c.x[0], 2.5) / (c.r[i] + c.r[j])
    return by * n[PARTS, k] * c.r[j] / c.r[i], by * n[PARTS + 1, k] * c.r[i] / c.r[j]


def coupled(each: Any, c: Any, k: Any) -> Any:
    """Whether rolling friction makes the surfaces of pair k slide: it turns equal spheres by as much, and does not."""
    mine, other = rolling_arms(each, c, k)
    one, two = c.r[each.bench.rows[0, k]] * mine, c.r[each.bench.rows[1, k]] * other
    return abs(one - two) > type_of(one, ALIKE) * (one + two)


def roll_pair(each: Any, c: Any, k: Any, q: Any) -> None:
    """Turn both of pair k by rolling friction q [m/s]."""
    i, j = each.bench.rows[0, k], each.bench.rows[1, k]
    mine, other = rolling_arms(each, c, k)
    if (mine <= 0) != (other <= 0):
        book_rolling(each, c, k, q)
    spin_up(c, i, mine, q)
    spin_up(c, j, -other, q)


@outlined
def book_rolling(each: Any, c: Any, k: Any, q: Any) -> None:
    """Note the work that the one of pair k that nothing moves does by rolling friction."""
    i, j = each.bench.rows[0, k], each.bench.rows[1, k]
    if each.a[i] + each.a[j] > 0:
        at, moved, sign = (i, j, -1.0) if each.a[i] <= 0 else (j, i, 1.0)
        radius = float(c.r[i]) * float(c.r[j]) / (float(c.r[i]) + float(c.r[j]))
        power = float(q[0] * c.spin.wx[at] + q[1] * c.spin.wy[at] + q[2] * c.spin.wz[at])
        work = sign * radius * power / float(each.a[i] + each.a[j])
        each.bench.start[WORK, root(each.bench.desk.cluster, moved)] += work
