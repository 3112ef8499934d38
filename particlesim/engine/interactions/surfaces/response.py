"""What contacts of surfaces do to displacements and velocities of a step.

A contact is the condition l·n ≥ d on the difference l = Σ w_k x_k of closest points, with n their unit normal at the moment
when they first are as near as is allowed. With u = Σ w_k (x_k − x_k⁰) and W = Σ w_k²/m_k displacements are corrected by

    x_k += (w_k/m_k) Λ n/W,   Λ ≥ 0 as small as it can be,

and the tangential displacement is taken back, by at most μ times that (Coulomb). Then velocities: contacts that have pushed
and still approach, with v_n = Σ w_k v_k·n < 0, get the impulse −(1 + e) v_n/W along n, and the tangential impulse that stops
sliding, at most μ times the normal one. All are taken one after the other, forwards and backwards (Gauss–Seidel). As
Σ w_k = 0, momentum is kept, and no impulse adds energy.

Displacements are those of the step, so a contact acts as if it had been there from the beginning of the step or from the
impact on: what rests neither sinks nor creeps, whatever the method. A contact that starts too close is widened by `GENTLY`
of its thickness in a step, which leaves velocities as they are.

Source: R. Bridson, R. Fedkiw, J. Anderson, ACM Trans. Graph. 21, 594 (2002), for impulses at closest points and the order of
repulsion, impacts and zones; J. J. Moreau (1988) for the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.response import falls_by
from particlesim.compiler import shared
from particlesim.engine.interactions.surfaces.closest import (
    Four,
    closest_points,
    first_nearness,
    relative_motion,
    thickness,
)
from particlesim.engine.interactions.surfaces.record import CONTACTS, EDGES, FACES, LOST, THIN
from particlesim.engine.interactions.surfaces.sieve import sift
from particlesim.engine.state.columns import held, presence

GENTLY = 0.02
"""Part of its thickness by which a contact that is too close is widened in a step, and a particle moved by that, at most."""
CORE = 0.2
"""Part of its thickness that a contact must keep on the way of a step, or of half of what it has if that is less."""
TURNS, MORE_TURNS = 12, 20
"""Turns through all contacts of a step at most: for displacements, and for velocities."""
SETTLED, CALMED = 1e-3, 1e-2
"""Iterations end when all corrections are smaller than that part of the thickness, or of the fastest approach that forces
have brought about in the step: the rest is corrected in the next."""
REST = 2.0
"""Steps in which forces bring about an approach that counts as rest."""
STATIC, KINETIC, REBOUND, CALM, PUSH, LOSS, GIVEN = range(7)
"""Rows of `Touches.bound`."""


@shared
def weigh(s: Any, m: Any, clock: Any, desk: Any) -> None:
    """Inverse masses: 0 of particles that no force moves, −1 of those that are absent in the step."""
    for j in range(s.rows.size):
        i = s.rows[j]
        desk.inverse[i] = 0.0 if held(clock, i) else 1.0 / float(m[i])
        if presence(clock, i) == 0:
            desk.inverse[i] = -1.0
        desk.mark[i] = 0


def movable(desk: Any, f: Any) -> Any:
    """Whether all four are there, and one of them can be moved."""
    a, b, c, d = desk.inverse[f.i], desk.inverse[f.j], desk.inverse[f.k], desk.inverse[f.m]
    return (min(a, b, c, d) >= 0) & (max(a, b, c, d) > 0)


def leverage(desk: Any, f: Any, c: Any) -> Any:
    """By how much two closest points come apart where no particle moves by more than 1, at most 1: little where those that
    can move are far from them, as at the roots of hair."""
    whole = most = 0.0
    for i, w in zip(f, (c.w0, c.w1, c.w2, c.w3), strict=True):
        part = abs(w) * desk.inverse[i]
        whole, most = whole + abs(w) * part, max(most, part)
    return min(whole / most, 1.0) if most > 0 else 0.0


def is_own(s: Any, found: Any, face: Any, q: Any, c: Any) -> Any:
    """Whether a contact is not also one of another pair: a vertex at an edge of a triangle belongs to the triangle that has
    that edge, and an end of an edge that meets an edge of a triangle to a vertex and a triangle."""
    if face:
        p = found.faces.of[1, q]
        corner_0, corner_1, corner_2 = c.w1 != 0, c.w2 != 0, c.w3 != 0
        number = (1 if corner_0 else 0) + (1 if corner_1 else 0) + (1 if corner_2 else 0)
        if number == 3:
            return True
        if number == 1:
            corner = 0 if corner_0 else (1 if corner_1 else 2)
            return s.vertices[corner, p] >= 0
        side = 0 if not corner_2 else (1 if not corner_0 else 2)
        return s.sides[side, p] >= 0
    first, second = (c.w0 == 0) | (c.w1 == 0), (c.w2 == 0) | (c.w3 == 0)
    e, f = found.edges.of[0, q], found.edges.of[1, q]
    return not ((first & (s.bordered[f] != 0)) | (second & (s.bordered[e] != 0)))


def append(
    s: Any,
    touches: Any,
    report: Any,
    tune: Any,
    face: Any,
    f: Any,
    c: Any,
    goal: Any,
    x: Any,
    before: Any,
    part: Any,
) -> None:
    """Write down a contact that begins after some part of the step."""
    n = report[CONTACTS]
    if n >= touches.rows.shape[1]:
        report[LOST] = max(report[LOST], 1)
        return
    by = 1.0 / c.distance if c.distance > 0 else 0.0
    nx, ny, nz = by * c.x, by * c.y if by > 0 else 1.0, by * c.z
    touches.rows[0, n], touches.rows[1, n], touches.rows[2, n], touches.rows[3, n] = f.i, f.j, f.k, f.m
    touches.weights[0, n], touches.weights[1, n] = c.w0, c.w1
    touches.weights[2, n], touches.weights[3, n] = c.w2, c.w3
    touches.normal[0, n], touches.normal[1, n], touches.normal[2, n] = nx, ny, nz
    touches.normal[3, n] = goal
    for k in range(3):
        u = 0.0
        for corner in range(4):
            i = touches.rows[corner, n]
            u += touches.weights[corner, n] * (float(x[k][i]) - float(before[k, i]))
        touches.shift[k, n] = part * u
        touches.drift[k, n] = touches.rubbed[k, n] = touches.carried[k, n] = 0.0
    report[CONTACTS] = n + 1


def rows_of(pairs: Any, q: Any) -> Any:
    """The rows of candidate q: a vertex and its triangle, or two edges."""
    return Four(pairs.rows[0, q], pairs.rows[1, q], pairs.rows[2, q], pairs.rows[3, q])


def look_at(
    s: Any,
    found: Any,
    touches: Any,
    desk: Any,
    report: Any,
    tune: Any,
    r: Any,
    x: Any,
    before: Any,
    face: Any,
) -> None:
    """`list_contacts` for vertices and triangles, or for edges."""
    pairs, number = (found.faces, report[FACES]) if face else (found.edges, report[EDGES])
    for k in range(sift(face, pairs, number, x, r, before, report, tune, 0.0)):
        q = pairs.due[k]
        f = rows_of(pairs, q)
        if movable(desk, f):
            now = closest_points(face, x, before, f.i, f.j, f.k, f.m, 0.0)
            goal, part = thickness(r, f, now), 0.0
            if now.distance > goal:
                motion = relative_motion(face, x, before, f)
                part = first_nearness(face, x, before, f.i, f.j, f.k, f.m, motion, goal)
            if part <= 1.0:
                at = closest_points(face, x, before, f.i, f.j, f.k, f.m, part) if part > 0.0 else now
                goal = thickness(r, f, at)
                if part == 0.0:
                    goal = min(goal, max(now.distance, 0.0) + GENTLY * goal * leverage(desk, f, at))
                if is_own(s, found, face, q, at):
                    append(s, touches, report, tune, face, f, at, goal, x, before, part)


@shared
def list_contacts(
    s: Any, found: Any, touches: Any, desk: Any, report: Any, tune: Any, r: Any, x: Any, before: Any
) -> None:
    """Write down the contacts of the step from `before` to x."""
    report[CONTACTS] = 0
    look_at(s, found, touches, desk, report, tune, r, x, before, True)
    look_at(s, found, touches, desk, report, tune, r, x, before, False)


def again(
    s: Any,
    found: Any,
    touches: Any,
    desk: Any,
    report: Any,
    tune: Any,
    r: Any,
    x: Any,
    before: Any,
    face: Any,
) -> Any:
    """`list_missed` for vertices and triangles, or for edges."""
    pairs, number = (found.faces, report[FACES]) if face else (found.edges, report[EDGES])
    missed = 0
    for n in range(sift(face, pairs, number, x, r, before, report, tune, (1.0 - CORE) * tune[THIN])):
        f = rows_of(pairs, pairs.due[n])
        if movable(desk, f):
            motion = relative_motion(face, x, before, f)
            now = closest_points(face, x, before, f.i, f.j, f.k, f.m, 0.0)
            goal = min(CORE * thickness(r, f, now), 0.5 * now.distance)
            if now.distance - motion < goal:
                part = first_nearness(face, x, before, f.i, f.j, f.k, f.m, motion, goal)
                if part <= 1.0:
                    at = closest_points(face, x, before, f.i, f.j, f.k, f.m, part)
                    goal = min(thickness(r, f, at), now.distance)
                    append(s, touches, report, tune, face, f, at, goal, x, before, part)
                    missed += 1
    return missed


@shared
def list_missed(
    s: Any, found: Any, touches: Any, desk: Any, report: Any, tune: Any, r: Any, x: Any, before: Any
) -> Any:
    """List the pairs that would come too close on the path from `before` to x; returns how many."""
    missed = again(s, found, touches, desk, report, tune, r, x, before, True)
    return missed + again(s, found, touches, desk, report, tune, r, x, before, False)


def inertia(touches: Any, desk: Any, n: Any) -> Any:
    """W = Σ w²/m of a contact."""
    total = 0.0
    for corner in range(4):
        w = touches.weights[corner, n]
        total += w * w * desk.inverse[touches.rows[corner, n]]
    return total


def shove(touches: Any, desk: Any, columns: Any, n: Any, dx: Any, dy: Any, dz: Any) -> None:
    """Add w/m times a vector to the columns of all rows of a contact."""
    for corner in range(4):
        by = touches.weights[corner, n] * desk.inverse[touches.rows[corner, n]]
        if by != 0:
            i = touches.rows[corner, n]
            kind = type(columns[0][i])
            columns[0][i] += kind(by * dx)
            columns[1][i] += kind(by * dy)
            columns[2][i] += kind(by * dz)


def difference(touches: Any, columns: Any, n: Any) -> Any:
    """Σ w times columns of a contact."""
    x = y = z = 0.0
    for corner in range(4):
        w, i = touches.weights[corner, n], touches.rows[corner, n]
        x += w * float(columns[0][i])
        y += w * float(columns[1][i])
        z += w * float(columns[2][i])
    return x, y, z


def difference_before(touches: Any, before: Any, n: Any) -> Any:
    """Σ w times places at the beginning of the step."""
    x = y = z = 0.0
    for corner in range(4):
        w, i = touches.weights[corner, n], touches.rows[corner, n]
        x += w * float(before[0, i])
        y += w * float(before[1, i])
        z += w * float(before[2, i])
    return x, y, z


@shared
def prepare(law: Any, touches: Any, desk: Any, report: Any, first: Any, v: Any, before: Any) -> Any:
    """Friction and rebound of contacts from number `first` on; returns the fastest approach that forces brought about.

    What falls faster at the end of the step than at its beginning rebounds as it would have from its beginning: its way ends
    at the impact, and with it what it would have gained.
    """
    most = 0.0
    for n in range(first, report[CONTACTS]):
        nx, ny, nz = touches.normal[0, n], touches.normal[1, n], touches.normal[2, n]
        now = then = 0.0
        for corner in range(4):
            w, i = touches.weights[corner, n], touches.rows[corner, n]
            now += w * (float(v[0][i]) * nx + float(v[1][i]) * ny + float(v[2][i]) * nz)
            then += w * (float(before[3, i]) * nx + float(before[4, i]) * ny + float(before[5, i]) * nz)
            desk.mark[i] |= 1
        change = abs(now - then)
        most = max(most, change)
        faster = (now < 0) & (now < then)
        speed = max(-then, 0.0) if faster else max(-now, 0.0)
        e = float(law.restitution)
        if law.falling is not None:
            e *= float(falls_by(law.falling, speed))
        touches.bound[REBOUND, n] = e * (speed / -now if faster else 1.0)
        touches.bound[CALM, n] = REST * change
        touches.bound[STATIC, n] = 0.0 if law.friction is None else float(law.friction.static)
        touches.bound[KINETIC, n] = 0.0 if law.friction is None else float(law.friction.kinetic)
        touches.bound[PUSH, n] = touches.bound[LOSS, n] = 0.0
    return most


@shared
def widened(touches: Any, report: Any, before: Any) -> Any:
    """By how much a contact is to be wider than it was at the beginning of the step, at most [m]."""
    most = 0.0
    for n in range(report[CONTACTS]):
        x, y, z = difference_before(touches, before, n)
        was = x * touches.normal[0, n] + y * touches.normal[1, n] + z * touches.normal[2, n]
        most = max(most, touches.normal[3, n] - was)
    return most


def rub(touches: Any, desk: Any, columns: Any, n: Any, whole: Any, x: Any, y: Any, z: Any, push: Any) -> Any:
    """Friction of contact n, which has been pushed by `push` in all: it takes back what slides, (x, y, z), up to μ_s of the
    push in all turns together, or is μ_k of it; returns by how much it has changed what slides."""
    fx, fy, fz = touches.rubbed[0, n] - x, touches.rubbed[1, n] - y, touches.rubbed[2, n] - z
    size = np.sqrt(fx * fx + fy * fy + fz * fz)
    part = 1.0
    if size > touches.bound[STATIC, n] * push:
        part = min(touches.bound[KINETIC, n] * push / size, 1.0)
    fx, fy, fz = part * fx, part * fy, part * fz
    dx, dy, dz = fx - touches.rubbed[0, n], fy - touches.rubbed[1, n], fz - touches.rubbed[2, n]
    touches.rubbed[0, n], touches.rubbed[1, n], touches.rubbed[2, n] = fx, fy, fz
    shove(touches, desk, columns, n, dx / whole, dy / whole, dz / whole)
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@shared
def displace(touches: Any, desk: Any, report: Any, x: Any, before: Any, backwards: Any) -> Any:
    """A turn through all contacts that corrects displacements; returns the largest correction [m]."""
    worst, number = 0.0, report[CONTACTS]
    for k in range(number):
        n = number - 1 - k if backwards else k
        nx, ny, nz = touches.normal[0, n], touches.normal[1, n], touches.normal[2, n]
        goal, push = touches.normal[3, n], touches.bound[PUSH, n]
        here, whole = difference(touches, x, n), inertia(touches, desk, n)
        add = max(goal - (here[0] * nx + here[1] * ny + here[2] * nz), -push)
        if whole > 0 and (add != 0 or push > 0):
            worst = max(worst, abs(add))
            push += add
            touches.bound[PUSH, n] = push
            shove(touches, desk, x, n, add / whole * nx, add / whole * ny, add / whole * nz)
            if touches.bound[STATIC, n] > 0:
                there = difference_before(touches, before, n)
                ux = here[0] - there[0] - touches.shift[0, n]
                uy = here[1] - there[1] - touches.shift[1, n]
                uz = here[2] - there[2] - touches.shift[2, n]
                along = ux * nx + uy * ny + uz * nz
                ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
                worst = max(worst, rub(touches, desk, x, n, whole, ux, uy, uz, push))
    return worst


@shared
def begin_impulses(touches: Any, report: Any) -> None:
    """No contact has been given an impulse, nor has friction."""
    for n in range(report[CONTACTS]):
        touches.bound[GIVEN, n] = 0.0
        for k in range(3):
            touches.rubbed[k, n] = 0.0


@shared
def give_impulses(touches: Any, desk: Any, report: Any, v: Any, backwards: Any) -> Any:
    """A turn through all contacts that have pushed; returns the fastest approach or change of sliding [m/s]."""
    worst, number = 0.0, report[CONTACTS]
    for k in range(number):
        n = number - 1 - k if backwards else k
        if touches.bound[PUSH, n] > 0:
            nx, ny, nz = touches.normal[0, n], touches.normal[1, n], touches.normal[2, n]
            u, whole = difference(touches, v, n), inertia(touches, desk, n)
            ux, uy, uz = u[0] - touches.drift[0, n], u[1] - touches.drift[1, n], u[2] - touches.drift[2, n]
            rate = ux * nx + uy * ny + uz * nz
            if whole > 0 and (rate < 0 or touches.bound[GIVEN, n] > 0):
                if rate < 0:
                    worst = max(worst, -rate)
                    change = -rate
                    if change > touches.bound[CALM, n]:
                        change *= 1.0 + touches.bound[REBOUND, n]
                    touches.bound[GIVEN, n] += change
                    shove(touches, desk, v, n, change / whole * nx, change / whole * ny, change / whole * nz)
                if touches.bound[STATIC, n] > 0:
                    sx, sy, sz = ux - rate * nx, uy - rate * ny, uz - rate * nz
                    worst = max(worst, rub(touches, desk, v, n, whole, sx, sy, sz, touches.bound[GIVEN, n]))
    return worst


@shared
def lose_sliding(touches: Any, desk: Any, report: Any, v: Any) -> None:
    """What colliders with a tangential loss take from sliding of contacts that have pushed."""
    for n in range(report[CONTACTS]):
        if (touches.bound[PUSH, n] > 0) & (touches.bound[LOSS, n] > 0):
            whole = inertia(touches, desk, n)
            if whole > 0:
                nx, ny, nz = touches.normal[0, n], touches.normal[1, n], touches.normal[2, n]
                u = difference(touches, v, n)
                x, y, z = u[0] - touches.drift[0, n], u[1] - touches.drift[1, n], u[2] - touches.drift[2, n]
                rate, by = x * nx + y * ny + z * nz, touches.bound[LOSS, n] / whole
                shove(touches, desk, v, n, by * (rate * nx - x), by * (rate * ny - y), by * (rate * nz - z))
