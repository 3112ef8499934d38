"""Ewald's sums: the field of all images of particles in a periodic box, to any accuracy, at the places of some of them.

Near pairs are summed one by one, by nearest images, and the far part of all of them over waves, with the same cut as for a
mesh (`split`, `influence`) but without one: so this is what a mesh is compared with.
Source: P. P. Ewald, Ann. Phys. 369, 253 (1921); S. W. de Leeuw, J. W. Perram, E. R. Smith, Proc. R. Soc. A 373, 27 (1980).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, lanes, on_stack, outlined
from particlesim.engine.interactions.mesh.influence import transform
from particlesim.engine.interactions.mesh.split import Near, far_of
from particlesim.laws.pair import Pair, central
from particlesim.process.threads import Team

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BLOCK = 64
"""Particles whose waves are added up together."""
CHUNK = 1 << 15
"""Particles whose sums are made one after the other."""
LANES = 8
TARGETS = 32
"""Particles whose near parts are summed together: roots and polynomials of several vectors at a time."""


class Field(NamedTuple):
    """∇Φ and Φ of Φ = Σ w/R at some particles, of all images of all others and of their own ones [3, rows], [rows]."""

    gradient: Floats
    height: Floats


class Sum(NamedTuple):
    """A sum by Ewald: box [m], splitting α [1/m], softening of far particles [m], numbers of waves along the axes; the law
    of the near part, c of its U = −c w₁ w₂/R, and the square of the distance from which it has a value [m²], negative where
    it always has."""

    size: tuple[float, float, float]
    alpha: float
    softening: float
    waves: tuple[int, int, int]
    law: Any
    strength: float
    least: float


def ewald_sum(
    law: Any,
    by: Any,
    strength: float,
    size: Sequence[float],
    softening: float,
    error: float,
    *,
    everywhere: bool,
) -> Sum:
    """A sum that is as exact as `error`, relative to the forces of near particles: its near part ends at half of the
    shortest side. `law`, `by`: as in `split.Near`; `everywhere`: whether the law has a value in one place."""
    end = math.sqrt(max(math.log(1 / error), 1.0)) + 0.3
    alpha = end / math.hypot(min(size) / 2, softening)
    x, y, z = (max(1, math.ceil(end * alpha * length / math.pi)) for length in size)
    far = far_of(alpha, softening * softening, strength, end, error / end**3)
    return Sum(
        (size[0], size[1], size[2]),
        alpha,
        softening,
        (x, y, z),
        Near(law, by, far),
        strength,
        -1.0 if everywhere else 0.0,
    )


def ewald_field(place: Floats, weight: Floats, rows: NDArray[np.int64], given: Sum, team: Team) -> Field:
    """The field at particles `rows` of all at `place` [3, n] with some `weight` [n]."""
    volume, lengths = math.prod(given.size), np.array(given.size)[:, None]
    x = place - lengths * np.floor(place / lengths)
    mean = -near_volume(given.law, min(given.size) / 2) / given.strength
    gradient, height = _near(x, weight, rows, given, team)
    height -= mean * float(weight.sum()) / volume
    far_gradient, far_height = _far(x, weight, rows, given, team)
    own = weight[rows] * own_height(given.alpha, given.softening)
    return Field(gradient + far_gradient, height + far_height - own)


def own_height(alpha: float, softening: float) -> float:
    """The far part of 1/R in one place, which waves have of a particle and itself [1/m]."""
    if softening == 0:
        return 2 * alpha / math.sqrt(math.pi)
    return math.erf(alpha * softening) / softening


@lru_cache(maxsize=16)
def near_volume(law: Any, reach: float) -> float:
    """∫ U of two unit particles over space, up to a reach [J m³], by Gauss and Legendre on pieces each half of the next."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    total, end = 0.0, reach
    for _ in range(40):
        for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
            r = end * (3 + node) / 4
            pair = Pair(r, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, q1=1.0, q2=1.0)
            total += weight * end / 4 * 4 * math.pi * r * r * float(central(law, pair, r * r)[0])
        end /= 2
    return total


# The near part


def _near(
    x: Floats, weight: Floats, rows: NDArray[np.int64], given: Sum, team: Team
) -> tuple[Floats, Floats]:
    found = np.zeros((4, len(rows)))
    reach = min(given.size) / 2

    def work(k: int) -> None:
        near_field(given.law, x, weight, rows, k * TARGETS, given.size, (given.least, reach * reach), found)

    team.each(work, -(-len(rows) // TARGETS))
    return found[:3] / given.strength, -found[3] / given.strength


@kernel
def near_field(law: Any, x: Any, weight: Any, rows: Any, at: Any, size: Any, limits: Any, out: Any) -> None:
    """k l and U of the near part at TARGETS of the rows from `at` on, of unit weight, into out [4, rows]; `limits`: squares
    of the distances between which particles act."""
    _near_field(law, x, weight, rows, at, size, limits, out)


@outlined
def _near_field(law: Any, x: Any, weight: Any, rows: Any, at: Any, size: Any, limits: Any, out: Any) -> None:
    room, row = on_stack(7, TARGETS, np.float64), on_stack(1, TARGETS, np.int64)[0]
    tx, ty, tz, gx, gy, gz, u = (room[k] for k in range(7))
    number = min(TARGETS, rows.size - at)
    for i in range(TARGETS):
        row[i] = rows[at + min(i, number - 1)]
        tx[i], ty[i], tz[i] = x[0, row[i]], x[1, row[i]], x[2, row[i]]
        gx[i] = gy[i] = gz[i] = u[i] = 0.0
    least, most = limits
    ix, iy, iz = 1.0 / size[0], 1.0 / size[1], 1.0 / size[2]
    for j in range(weight.size):
        px, py, pz, w = x[0, j], x[1, j], x[2, j], weight[j]
        for i in range(TARGETS):
            dx, dy, dz = tx[i] - px, ty[i] - py, tz[i] - pz
            dx -= size[0] * np.rint(dx * ix)
            dy -= size[1] * np.rint(dy * iy)
            dz -= size[2] * np.rint(dz * iz)
            r2 = dx * dx + dy * dy + dz * dz
            acts = (r2 < most) & (r2 > least) & (row[i] != j)
            pair = Pair(dx, dy, dz, 0.0, 0.0, 0.0, 1.0, w, 0.0, 0.0, 1.0, w)
            e, k, _ = central(law, pair, r2 if acts else 1.0)
            k = k if acts else 0.0
            gx[i] += k * dx
            gy[i] += k * dy
            gz[i] += k * dz
            u[i] += e if acts else 0.0
    for i in range(number):
        for axis, sums in enumerate((gx, gy, gz, u)):
            out[axis, at + i] = sums[i]


# The far part


def _far(x: Floats, weight: Floats, rows: NDArray[np.int64], given: Sum, team: Team) -> tuple[Floats, Floats]:
    """Sums over waves: of all particles chunk by chunk, and then at the rows."""
    kx, ky, kz, factor = _lattice(given)
    sums = wave_sums(x, weight, given, team)
    amplitude = sums[kx, :, ky + given.waves[1], kz + given.waves[2]]  # [waves, 2]
    unit = 2 * np.pi / np.array(given.size)
    wave = np.stack([kx, ky, kz]) * unit[:, None]
    gradient, height = np.empty((3, len(rows))), np.empty(len(rows))
    step = max(1, (1 << 21) // max(len(kx), 1))
    for first in range(0, len(rows), step):
        some = rows[first : first + step]
        phase = sum(x[axis, some][:, None] * wave[axis] for axis in range(3))
        c, s = np.cos(phase), np.sin(phase)
        even, odd = factor * amplitude[:, 0], factor * amplitude[:, 1]
        height[first : first + step] = (c * even + s * odd).sum(axis=1)
        turned = c * odd - s * even
        for axis in range(3):
            gradient[axis, first : first + step] = (turned * wave[axis]).sum(axis=1)
    return gradient, height


def _last(given: Sum) -> float:
    """The wave number up to which waves count [1/m]."""
    return min(2 * math.pi * n / length for n, length in zip(given.waves, given.size, strict=True)) * (
        1 + 1e-12
    )


def _lattice(given: Sum) -> tuple[Ints, Ints, Ints, Floats]:
    """Waves of half of space with R/V, twice where the other half has its opposite."""
    mx, my, mz = given.waves
    ranges = np.arange(mx + 1), np.arange(-my, my + 1), np.arange(-mz, mz + 1)
    kx, ky, kz = (each.ravel() for each in np.meshgrid(*ranges, indexing="ij"))
    square = np.zeros(len(kx))
    for k, length in zip((kx, ky, kz), given.size, strict=True):
        square += (2 * np.pi * k / length) ** 2
    some = (square > 0) & (square <= _last(given) ** 2)
    kx, ky, kz, square = kx[some], ky[some], kz[some], square[some]
    twice = np.where(kx > 0, 2.0, 1.0)
    far = transform(given.alpha, given.softening).values(square)
    return kx, ky, kz, twice * far / math.prod(given.size)


def wave_sums(x: Floats, weight: Floats, given: Sum, team: Team) -> Floats:
    """Σ w cos(k·x) and Σ w sin(k·x), shape [mx + 1, 2, 2 my + 1, 2 mz + 1]."""
    mx, my, mz = given.waves
    chunks = range(0, max(len(weight), 1), CHUNK)
    parts = np.zeros((len(chunks), mx + 1, 2, 2 * my + 1, 2 * mz + 1))
    unit = tuple(2 * np.pi / length for length in given.size)

    def work(k: int) -> None:
        room = np.zeros((6, max(given.waves) + 1, BLOCK))
        first = chunks[k]
        add_waves(x, weight, first, min(first + CHUNK, len(weight)), unit, given.waves, room, parts[k])

    team.each(work, len(chunks))
    total = np.zeros(parts.shape[1:])
    for part in parts:  # in their order
        total += part
    return total


@kernel
def add_waves(x: Any, weight: Any, first: Any, last: Any, unit: Any, waves: Any, room: Any, out: Any) -> None:
    """Add the waves of particles [first, last) to `out`; `room` [6, waves + 1, BLOCK]: cos and sin of all multiples."""
    products = on_stack(2, BLOCK, np.float64)
    pr, pi = products[0], products[1]
    for begin in range(first, last, BLOCK):
        number = min(BLOCK, last - begin)
        for axis in range(3):
            c, s = room[2 * axis], room[2 * axis + 1]
            for i in range(BLOCK):
                angle = unit[axis] * x[axis, begin + min(i, number - 1)]
                c[0, i], s[0, i] = 1.0, 0.0
                c[1, i], s[1, i] = np.cos(angle), np.sin(angle)
            for k in range(2, waves[axis] + 1):
                for i in range(BLOCK):
                    c[k, i] = c[k - 1, i] * c[1, i] - s[k - 1, i] * s[1, i]
                    s[k, i] = s[k - 1, i] * c[1, i] + c[k - 1, i] * s[1, i]
        for kx in range(waves[0] + 1):
            for ky in range(-waves[1], waves[1] + 1):
                if (kx * kx) * (waves[1] * waves[1]) + (ky * ky) * (waves[0] * waves[0]) > (
                    waves[0] * waves[0]
                ) * (waves[1] * waves[1]):
                    continue  # beyond the last wave, whatever that along z
                flip = 1.0 if ky >= 0 else -1.0
                cx, sx, cy, sy = room[0, kx], room[1, kx], room[2, abs(ky)], room[3, abs(ky)]
                for i in range(BLOCK):
                    w = weight[begin + min(i, number - 1)] if i < number else 0.0
                    pr[i] = w * (cx[i] * cy[i] - flip * (sx[i] * sy[i]))
                    pi[i] = w * (sx[i] * cy[i] + flip * (cx[i] * sy[i]))
                _add_row(pr, pi, room, waves[2], out[kx], ky + waves[1])


@outlined
def _add_row(pr: Any, pi: Any, room: Any, most: Any, out: Any, ky: Any) -> None:
    """The waves of one row, forwards and backwards along z."""
    sums = on_stack(4, LANES, np.float64)
    a, b, c, d = sums[0], sums[1], sums[2], sums[3]
    for kz in range(most + 1):
        cos, sin = room[4, kz], room[5, kz]
        for i in lanes(LANES):
            a[i] = b[i] = c[i] = d[i] = 0.0
        for begin in range(0, BLOCK, LANES):
            for i in lanes(LANES):
                j = begin + i
                a[i] += pr[j] * cos[j]
                b[i] += pi[j] * sin[j]
                c[i] += pr[j] * sin[j]
                d[i] += pi[j] * cos[j]
        even, odd, even_back, odd_back = 0.0, 0.0, 0.0, 0.0
        for i in range(LANES):
            even += a[i] - b[i]
            odd += d[i] + c[i]
            even_back += a[i] + b[i]
            odd_back += d[i] - c[i]
        out[0, ky, most + kz] += even
        out[1, ky, most + kz] += odd
        if kz > 0:
            out[0, ky, most - kz] += even_back
            out[1, ky, most - kz] += odd_back
