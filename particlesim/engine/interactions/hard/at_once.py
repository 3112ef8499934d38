"""Impulses of hard contacts, found all at once, where turns from pair to pair would take too long.

A turn through all pairs carries a push one pair further, and back: a column of n grains needs some n² turns. Without
rebound the velocities after all impulses λ ≥ 0 along the normals are those of least energy (Moreau; Gauss's principle),

    min over λ ≥ 0 of  E(λ) = ½ (v + W Jᵀλ)ᵀ W⁻¹ (v + W Jᵀλ),    ∂E/∂λ_k = rate at which the two of contact k part,

with W the inverse masses and J the normals. This is a quadratic problem with bounds, and is solved as such: by conjugate
gradients among the contacts that push, which let go of those that would pull by steps against the gradient, and take those
in that approach. Every iterate has less energy than the one before, and all λ are impulses between two particles, or at a
wall: so whatever is left after the last one, no energy has come, and momentum is kept.

It is done for clusters with few pairs that stand on something, such as columns, where impulses are determined and as many
iterations as there are pairs in a row find them. Those with many, such as heaps, would take hundreds, and are left as turns
leave them. In a cluster in which something has rebounded, what turns have given is kept, as rebounds would be taken back
else, and λ ≥ 0 is only what is missing until nothing approaches, as in an impact without rebound.

Source: Z. Dostál, J. Schöberl, Comput. Optim. Appl. 30, 23 (2005), algorithm MPRGP with Γ = 1; J. J. Moreau, Unilateral
contact and dry friction in finite freedom dynamics (1988).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.laws import restitution_at

FEW = 1.5
"""Pairs for each particle up to which a cluster is solved at once: a column has one, a heap of spheres about three."""
MOST = 400
"""Iterations at most, each of which takes as long as about two turns."""
UNCOUNTED = 1 << 62
"""What the number of particles of a cluster is below by as long as its own particle is not counted."""
FLAT = 1e-10
"""Curvature of the energy, in units of that along one impulse, below which impulses only push against each other."""
STEP = 1.8
"""Steps against the gradient over the inverse of the largest eigenvalue: below 2 they lose energy."""
GIVEN, FOUND, PUSH, RATE, WAY, ANSWER, SCALE, X, Y, Z, LEFT = range(11)
"""Rows of `Desk.contacts`. By the numbers of pairs, and after them of particles at walls: what they have been given at rest,
and what is found, as changes of the speed along the normal [m/s]. Of those that are solved for, one after the other:
unknowns √(w₁ + w₂) λ, the gradient, the direction, what it changes the gradient by, 1/√(w₁ + w₂), and the normal; and what
of their impulses is left as it is [m/s]."""
NUMBER, FIRST, SECOND = range(3)
"""Rows of `Desk.of`: the number of what is solved for, and its particles."""
PARENT, PARTICLES, TOUCHES, STANDS, APPROACHES, LIVELY = range(6)
"""Rows of `Desk.cluster`: a particle of the same cluster; of the one that stands for it, how many particles and pairs there
are, and whether something holds it that nothing moves, something in it still approaches, and something has rebounded."""


LEAST, PARTING, ALONG, PARTS, ROOM = 3, 4, 5, 7, 13
"""Rows of `normal` and `wall_normal` after the normal that are read here: less than 0 of what does not lie on its wall; more
than 0 of what has rebounded; of walls, how fast what lies on them moves along the normal [m/s]; of pairs, how a change of
their velocity is divided between the two [2], both 0 of those that get none, and how fast the two may approach [m/s]."""


class Desk(NamedTuple):
    """Room to work in: rows of contacts [11, contacts] and of their particles [3, contacts], changes of velocities [3, n],
    and clusters [6, n]."""

    contacts: Any
    of: Any
    change: Any
    cluster: Any


class Chosen(NamedTuple):
    """How many pairs and contacts with walls are solved for, and a bound of the largest eigenvalue of their matrix."""

    pairs: Any
    walls: Any
    largest: Any


def new_desk(contacts: int, particles: int) -> Desk:
    """Room for some contacts."""
    of, cluster = np.zeros((3, contacts), np.int64), np.zeros((6, particles), np.int64)
    return Desk(np.zeros((11, contacts)), of, np.zeros((3, particles)), cluster)


def root(cluster: Any, i: Any) -> Any:
    """The particle that stands for the cluster of particle i."""
    while cluster[PARENT, i] != i:
        cluster[PARENT, i] = cluster[PARENT, cluster[PARENT, i]]
        i = cluster[PARENT, i]
    return i


@outlined
def join(bench: Any, a: Any, pairs: Any, walls: Any) -> None:
    """Find out which particles touch each other, and how their clusters are; what nothing moves joins nothing."""
    cluster, first, second = bench.desk.cluster, bench.rows[0], bench.rows[1]
    for k in range(pairs):
        alone(cluster, first[k])
        alone(cluster, second[k])
    for k in range(pairs):
        if (a[first[k]] > 0) & (a[second[k]] > 0):
            i, j = root(cluster, first[k]), root(cluster, second[k])
            cluster[PARENT, max(i, j)] = min(i, j)
    for k in range(pairs):
        for i in (first[k], second[k]):
            if cluster[PARTICLES, i] < 0:  # which has not been counted
                cluster[PARTICLES, i] += UNCOUNTED
                cluster[PARTICLES, root(cluster, i)] += 1
    for k in range(pairs):
        i, j = first[k], second[k]
        if a[i] + a[j] > 0:
            at = root(cluster, i if a[i] > 0 else j)
            cluster[TOUCHES, at] += 1
            cluster[STANDS, at] = 1 if (a[i] <= 0) | (a[j] <= 0) else cluster[STANDS, at]
    for q in range(walls):
        if bench.wall_normal[LEAST, q] >= 0:
            cluster[STANDS, root(cluster, bench.wall[q])] = 1


def alone(cluster: Any, i: Any) -> None:
    """A particle that touches none yet."""
    cluster[PARENT, i], cluster[PARTICLES, i] = i, -UNCOUNTED
    cluster[TOUCHES, i] = cluster[STANDS, i] = cluster[APPROACHES, i] = cluster[LIVELY, i] = 0


def wanted(cluster: Any, i: Any) -> Any:
    """Whether the cluster of a particle is to be solved: one with few pairs that stands on something or has rebounded, and
    is not at rest."""
    at = root(cluster, i)
    few = float(cluster[TOUCHES, at]) <= FEW * float(cluster[PARTICLES, at])
    return few & (cluster[STANDS, at] + cluster[LIVELY, at] > 0) & (cluster[APPROACHES, at] > 0)


def left_as_it_is(row: Any, cluster: Any, i: Any, k: Any) -> Any:
    """What contact k of particle i has been given, where something has rebounded: that is not taken back."""
    return row[GIVEN, k] if cluster[LIVELY, root(cluster, i)] > 0 else 0.0


@outlined
def see(each: Any, c: Any, pairs: Any, walls: Any, calm: Any) -> None:
    """Find out in which clusters something still approaches, and in which something has rebounded."""
    bench, a, cluster = each.bench, each.a, each.bench.desk.cluster
    for k in range(pairs):
        i, j = bench.rows[0, k], bench.rows[1, k]
        at = root(cluster, i if a[i] > 0 else j)
        acts = bench.normal[PARTS, k] + bench.normal[PARTS + 1, k] > 0
        n = (bench.normal[0, k], bench.normal[1, k], bench.normal[2, k])
        rate = (c.vx[i] - c.vx[j]) * n[0] + (c.vy[i] - c.vy[j]) * n[1] + (c.vz[i] - c.vz[j]) * n[2]
        if (-rate - bench.normal[ROOM, k] > calm) & acts & (restitution_at(each, k) < 1):
            cluster[APPROACHES, at] = 1
        if bench.normal[PARTING, k] > 0:
            cluster[LIVELY, at] = 1
    for q in range(walls):
        if bench.wall_normal[PARTING, q] > 0:
            cluster[LIVELY, root(cluster, bench.wall[q])] = 1


@outlined
def choose(each: Any, c: Any, pairs: Any, walls: Any, calm: Any) -> Chosen:
    """Choose the contacts to solve for among clusters that are known (`join`), and scale them to a matrix J W Jᵀ with a
    diagonal of ones.

    With s_i = Σ w_i/(w₁ + w₂) over the contacts of particle i its largest eigenvalue is at most the largest s₁ + s₂ of a
    contact: it is a sum over particles of matrices of rank three, of which that of i has a norm of at most s_i.
    """
    see(each, c, pairs, walls, calm)
    bench, a = each.bench, each.a
    row, of, s, cluster = bench.desk.contacts, bench.desk.of, bench.desk.change, bench.desk.cluster
    m = 0
    for k in range(pairs):
        i, j = bench.rows[0, k], bench.rows[1, k]
        both = float(a[i]) + float(a[j])
        s[0, i] = s[0, j] = 0.0
        row[FOUND, k] = 0.0
        acts = bench.normal[PARTS, k] + bench.normal[PARTS + 1, k] > 0
        if acts and wanted(cluster, i if a[i] > 0 else j):
            of[NUMBER, m], of[FIRST, m], of[SECOND, m], row[SCALE, m] = k, i, j, 1.0 / np.sqrt(both)
            row[X, m], row[Y, m], row[Z, m] = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k]
            row[LEFT, m] = left_as_it_is(row, cluster, i if a[i] > 0 else j, k)
            m += 1
    n = m
    for q in range(walls):
        i = bench.wall[q]
        row[FOUND, pairs + q] = 0.0
        if (bench.wall_normal[LEAST, q] >= 0) and wanted(cluster, i):
            of[NUMBER, n], of[FIRST, n], row[SCALE, n] = pairs + q, i, 1.0 / np.sqrt(float(a[i]))
            normal = bench.wall_normal
            row[X, n], row[Y, n], row[Z, n] = normal[0, q], normal[1, q], normal[2, q]
            row[LEFT, n] = left_as_it_is(row, cluster, i, pairs + q)
            n += 1
    for k in range(m):
        i, j = of[FIRST, k], of[SECOND, k]
        both = float(a[i]) + float(a[j])
        s[0, i] += a[i] / both
        s[0, j] += a[j] / both
    for k in range(m, n):
        s[0, of[FIRST, k]] += 1.0
    largest = 1.0
    for k in range(m):
        largest = max(largest, s[0, of[FIRST, k]] + s[0, of[SECOND, k]])
    for k in range(m, n):
        largest = max(largest, s[0, of[FIRST, k]])
    return Chosen(m, n - m, largest)


@outlined
def rates(bench: Any, c: Any, chosen: Any, pairs: Any) -> None:
    """The rates at which all contacts part."""
    row, of = bench.desk.contacts, bench.desk.of
    for k in range(chosen.pairs + chosen.walls):
        i = of[FIRST, k]
        x, y, z = float(c.vx[i]), float(c.vy[i]), float(c.vz[i])
        if k < chosen.pairs:
            j = of[SECOND, k]
            x, y, z = x - c.vx[j], y - c.vy[j], z - c.vz[j]
            speed = -float(bench.normal[ROOM, of[NUMBER, k]])
        else:
            speed = float(bench.wall_normal[ALONG, of[NUMBER, k] - pairs])
        row[RATE, k] = row[SCALE, k] * (x * row[X, k] + y * row[Y, k] + z * row[Z, k] - speed)


@outlined
def find(desk: Any, a: Any, chosen: Any, calm: Any) -> Any:
    """Find impulses at rest from what contacts have been GIVEN, with the RATE at which they part then; leaves in FOUND what
    comes to them [m/s], and adds it to the former. Returns the fastest rate that is left [m/s].

    `a`: inverse masses. All lengths may be displacements, in place of velocities.
    """
    row, number, n, step = desk.contacts, desk.of[NUMBER], chosen.pairs + chosen.walls, STEP / chosen.largest
    for k in range(n):
        row[PUSH, k] = row[SCALE, k] * (row[GIVEN, number[k]] - row[LEFT, k])
    take_way(row, n)
    worst, iterations = left_over(row, n), 0
    while (worst > calm) & (iterations < MOST):
        if chopped(row, n) <= reduced(row, n, step):
            answer(desk, a, chosen)
            by, bound = along(row, n), reach(row, n)
            go(row, n, min(by, bound))
            if 0 < by <= bound:
                turn_way(row, n)
            else:
                downhill(row, n, step)
                answer(desk, a, chosen)
                for k in range(n):
                    row[RATE, k] -= row[ANSWER, k]
                take_way(row, n)
        else:
            for k in range(n):
                row[WAY, k] = min(row[RATE, k], 0.0) if row[PUSH, k] <= 0 else 0.0
            answer(desk, a, chosen)
            go(row, n, along(row, n))
            take_way(row, n)
        worst = left_over(row, n)
        iterations += 1
    for k in range(n):
        change = row[PUSH, k] / row[SCALE, k] + row[LEFT, k]
        row[FOUND, number[k]], row[GIVEN, number[k]] = change - row[GIVEN, number[k]], change
    return worst


@outlined
def answer(desk: Any, a: Any, chosen: Any) -> None:
    """What impulses along the direction change the gradient by."""
    row, of, change, pairs = desk.contacts, desk.of, desk.change, chosen.pairs
    u, v, w, first, second = change[0], change[1], change[2], of[FIRST], of[SECOND]
    nx, ny, nz, scale, way, found = row[X], row[Y], row[Z], row[SCALE], row[WAY], row[ANSWER]
    n = pairs + chosen.walls
    for k in range(n):
        i = first[k]
        u[i] = v[i] = w[i] = 0.0
    for k in range(pairs):
        j = second[k]
        u[j] = v[j] = w[j] = 0.0
    for k in range(n):
        by = scale[k] * way[k]
        if by != 0:
            i, x, y, z = first[k], by * nx[k], by * ny[k], by * nz[k]
            u[i], v[i], w[i] = u[i] + a[i] * x, v[i] + a[i] * y, w[i] + a[i] * z
            if k < pairs:
                j = second[k]
                u[j], v[j], w[j] = u[j] - a[j] * x, v[j] - a[j] * y, w[j] - a[j] * z
    for k in range(pairs):
        i, j = first[k], second[k]
        x, y, z = u[i] - u[j], v[i] - v[j], w[i] - w[j]
        found[k] = scale[k] * (x * nx[k] + y * ny[k] + z * nz[k])
    for k in range(pairs, n):
        i = first[k]
        found[k] = scale[k] * (u[i] * nx[k] + v[i] * ny[k] + w[i] * nz[k])


def free(row: Any, k: Any) -> Any:
    """The gradient of a contact that pushes, 0 of others."""
    return row[RATE, k] if row[PUSH, k] > 0 else 0.0


@outlined
def left_over(row: Any, n: Any) -> Any:
    """The fastest approach, or parting of two that push each other [m/s]."""
    worst = 0.0
    for k in range(n):
        rate = row[RATE, k] / row[SCALE, k]
        worst = max(worst, abs(rate) if row[PUSH, k] > 0 else -rate)
    return worst


@outlined
def chopped(row: Any, n: Any) -> Any:
    """The square of the gradient of contacts that do not push and should."""
    total = 0.0
    for k in range(n):
        if row[PUSH, k] <= 0:
            rate = min(row[RATE, k], 0.0)
            total += rate * rate
    return total


@outlined
def reduced(row: Any, n: Any, step: Any) -> Any:
    """The square of the gradient of contacts that push, as far as they can follow it in a step."""
    total = 0.0
    for k in range(n):
        rate = free(row, k)
        total += rate * min(rate, row[PUSH, k] / step)
    return total


@outlined
def along(row: Any, n: Any) -> Any:
    """How far to go along the direction for the least energy there; not at all where there is none, as between walls that
    leave no room, nor where it leads up, by rounding: directions that are conjugate to one like that would grow without
    bounds."""
    above = below = square = 0.0
    for k in range(n):
        above += row[RATE, k] * row[WAY, k]
        below += row[WAY, k] * row[ANSWER, k]
        square += row[WAY, k] * row[WAY, k]
    return above / below if (above > 0) & (below > FLAT * square) else 0.0


@outlined
def reach(row: Any, n: Any) -> Any:
    """How far one can go along the direction until a contact would pull."""
    most = np.inf
    for k in range(n):
        if row[WAY, k] > 0:
            most = min(most, row[PUSH, k] / row[WAY, k])
    return most


@outlined
def go(row: Any, n: Any, by: Any) -> None:
    """Go along the direction."""
    for k in range(n):
        row[PUSH, k] = max(row[PUSH, k] - by * row[WAY, k], 0.0)
        row[RATE, k] -= by * row[ANSWER, k]


@outlined
def take_way(row: Any, n: Any) -> None:
    """Begin anew, along the gradient of the contacts that push."""
    for k in range(n):
        row[WAY, k] = free(row, k)


@outlined
def turn_way(row: Any, n: Any) -> None:
    """The next of conjugate directions."""
    above = below = 0.0
    for k in range(n):
        above += free(row, k) * row[ANSWER, k]
        below += row[WAY, k] * row[ANSWER, k]
    by = above / below if below > 0 else 0.0
    for k in range(n):
        row[WAY, k] = free(row, k) - by * row[WAY, k]


@outlined
def downhill(row: Any, n: Any, step: Any) -> None:
    """A step against the gradient of the contacts that push, which lets go of those that would pull; its direction is what
    has been taken away."""
    for k in range(n):
        was = row[PUSH, k]
        row[PUSH, k] = max(was - step * free(row, k), 0.0)
        row[WAY, k] = was - row[PUSH, k]
