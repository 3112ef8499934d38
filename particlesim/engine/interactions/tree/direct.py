"""The field at the particles of a leaf: of near particles by direct sums, of far ones by the polynomial of the leaf.

Some targets at a time stay in registers while sources follow one by one, so that a sum is in the order of the sources for
any width of vectors, and no partial sums need to be added.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import lanes, on_stack, outlined
from particlesim.engine.interactions.tree.expansions import gradient, height, taken
from particlesim.engine.interactions.tree.form import (
    Height,
    Plummer,
    field_columns,
    order_of,
    root_order,
)
from particlesim.engine.interactions.tree.inverse_root import inverse_root

TARGETS = 16
"""Targets at a time: two vectors of AVX-512. With fewer, LLVM writes the loop out before it looks for vectors."""
WIDE, SLIM = (None,) * TARGETS, (None,) * (TARGETS // 2)
"""So many at a time, as kernels know it while they are compiled."""
FEW = 4
"""Targets that are taken one by one, as many sources at a time as a vector has numbers."""
SOURCES = 8
THIN = 0.16
"""What a source costs one of few targets, over what it costs a vector of targets; some places of the last vector of a run
stay empty."""
LEAST_SQUARE = 1e-60
"""Added to squares of distances in units of the box, so that a particle finds nothing infinite in its own place."""


def pair(softening: Any, r2: Any, order: Any) -> Any:
    """f and −f'/r at the square of a distance, as exact as multipoles of an order need it."""
    if isinstance(softening, Plummer):
        q = inverse_root(r2 + (softening.square + LEAST_SQUARE), order)
        return q, q * q * q
    q = inverse_root(r2 + LEAST_SQUARE, order)
    h = softening.radius
    u = r2 * q / h
    inner = 32 / 3 + u * u * (32 * u - 38.4)
    v = q * h
    outer = 64 / 3 - 48 * u + 38.4 * u * u - 32 / 3 * u * u * u - v * v * v / 15
    near = inner if u < 0.5 else outer
    slope = q * q * q if u >= 1 else near / (h * h * h)
    deep = 2.8 - u * u * (16 / 3 + u * u * (6.4 * u - 9.6))
    rim = 3.2 - v / 15 - u * u * (32 / 3 + u * (-16 + u * (9.6 - 32 / 15 * u)))
    f = q if u >= 1 else (deep if u < 0.5 else rim) / h
    return f, slope


def vectors_for(targets: Any) -> Any:
    """How many vectors a source costs so many targets."""
    rest = targets % SOURCES
    return targets // SOURCES + (rest * THIN if rest <= FEW else 1.0)


@outlined
def add_near(
    form: Any, s: Any, begins: Any, ends: Any, count: Any, at: Any, place: Any, row: Any, out: Any, wide: Any
) -> None:
    """The field at `wide` targets from `at` on, into out [4, TARGETS]: gradient, and Σ w f where it is wanted.

    `begins`, `ends`: so many runs of near particles; `row`: the polynomial of far cells about `place`.
    """
    width = len(wide)
    t = on_stack(7, width, np.float64)
    _add_far(form, s, at, place, row, t, width)
    for k in range(count):
        for j in range(begins[k], ends[k]):
            x, y, z, w = s.x[j], s.y[j], s.z[j], s.w[j]
            for lane in lanes(width):
                dx, dy, dz = x - t[0, lane], y - t[1, lane], z - t[2, lane]
                f, slope = pair(form.softening, dx * dx + dy * dy + dz * dz, root_order(form))
                g = w * slope
                t[3, lane] += g * dx
                t[4, lane] += g * dy
                t[5, lane] += g * dz
                if isinstance(form.wanted, Height):
                    t[6, lane] += w * f if j != at + lane else 0.0
    for lane in lanes(width):
        for k in range(4):
            out[k, lane] = t[3 + k, lane]


def _add_far(form: Any, s: Any, at: Any, place: Any, row: Any, t: Any, width: Any) -> None:
    """Places of targets and what far cells do there, into t [7, width]."""
    field = taken(row, field_columns(form))
    for lane in lanes(width):
        x, y, z = s.x[at + lane], s.y[at + lane], s.z[at + lane]
        v = (x - place[0], y - place[1], z - place[2])
        gx, gy, gz = gradient(field, v, order_of(form))
        t[0, lane] = x
        t[1, lane] = y
        t[2, lane] = z
        t[3, lane] = gx
        t[4, lane] = gy
        t[5, lane] = gz
        t[6, lane] = height(field, v, order_of(form)) if isinstance(form.wanted, Height) else 0.0


@outlined
def add_near_to_few(
    form: Any, s: Any, begins: Any, ends: Any, count: Any, at: Any, last: Any, place: Any, row: Any, out: Any
) -> None:
    """`add_near` for targets [at, last), at most FEW."""
    t, sums = on_stack(7, FEW, np.float64), on_stack(4, SOURCES, np.float64)
    _add_far(form, s, at, place, row, t, FEW)
    for target in range(last - at):
        x, y, z = t[0, target], t[1, target], t[2, target]
        for lane in lanes(SOURCES):
            sums[0, lane] = sums[1, lane] = sums[2, lane] = sums[3, lane] = 0.0
        for k in range(count):
            end = ends[k]
            for j in range(begins[k], end, SOURCES):
                for lane in lanes(SOURCES):
                    i = j + lane
                    w = s.w[i] if i < end else 0.0
                    dx, dy, dz = s.x[i] - x, s.y[i] - y, s.z[i] - z
                    f, slope = pair(form.softening, dx * dx + dy * dy + dz * dz, root_order(form))
                    g = w * slope
                    sums[0, lane] += g * dx
                    sums[1, lane] += g * dy
                    sums[2, lane] += g * dz
                    if isinstance(form.wanted, Height):
                        sums[3, lane] += w * f if i != at + target else 0.0
        for k in range(4):
            total = t[3 + k, target]
            for lane in range(SOURCES):
                total += sums[k, lane]
            out[k, target] = total
