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
from particlesim.trajectory.box import in_period

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BLOCK = 64
"""Particles whose waves are added up together."""
CHUNK = 1 << 15
"""Particles whose sums are made one after the other."""
SHARES = 16
"""Parts into which the waves of a chunk are cut, for threads to share."""
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
    x = in_period(place, lengths)
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
    factor, last = _lattice(given)
    sums = wave_sums(x, weight, given, last, team)
    sums *= factor[:, None]
    unit = tuple(2 * np.pi / length for length in given.size)
    found = np.zeros((4, len(rows)))

    def work(k: int) -> None:
        room = np.zeros((6, max(given.waves) + 1, BLOCK))
        read_waves(x, rows, k * BLOCK, unit, given.waves, last, sums, room, found)

    team.each(work, -(-len(rows) // BLOCK))
    return found[:3], found[3]


def _last(given: Sum) -> float:
    """The wave number up to which waves count [1/m]."""
    return min(2 * math.pi * n / length for n, length in zip(given.waves, given.size, strict=True)) * (
        1 + 1e-12
    )


def _lattice(given: Sum) -> tuple[Floats, Ints]:
    """R/V of the waves of half of space, twice where the other half has its opposite and 0 of those that do not count,
    [mx + 1, 2 my + 1, 2 mz + 1]; and the last wave along z that counts, −1 where none does [mx + 1, 2 my + 1]."""
    mx, my, mz = given.waves
    unit = [2 * np.pi / length for length in given.size]
    kx, ky, kz = np.arange(mx + 1), np.arange(-my, my + 1), np.arange(-mz, mz + 1)
    flat = (unit[0] * kx)[:, None] ** 2 + (unit[1] * ky) ** 2
    square = flat[..., None] + (unit[2] * kz) ** 2
    counts = square <= _last(given) ** 2
    last = np.where(counts.any(axis=2), counts[..., mz:].sum(axis=2) - 1, -1)
    counts &= square > 0
    factor = np.zeros(square.shape)
    far = transform(given.alpha, given.softening).values(square[counts])
    factor[counts] = far / math.prod(given.size)
    factor[1:] *= 2
    return factor, last


def wave_sums(x: Floats, weight: Floats, given: Sum, last: Ints, team: Team) -> Floats:
    """Σ w cos(k·x) and Σ w sin(k·x) of the waves that count, shape [mx + 1, 2, 2 my + 1, 2 mz + 1]."""
    mx, my, mz = given.waves
    chunks = range(0, max(len(weight), 1), CHUNK)
    parts = np.zeros((len(chunks), mx + 1, 2, 2 * my + 1, 2 * mz + 1))
    unit = tuple(2 * np.pi / length for length in given.size)
    rows = -(-(mx + 1) // min(SHARES, mx + 1))

    def work(k: int) -> None:
        room = np.zeros((6, max(given.waves) + 1, BLOCK))
        chunk, share = divmod(k, SHARES)
        first, low = chunks[chunk], min(share * rows, mx + 1)
        planes = (low, min(low + rows, mx + 1))
        end = min(first + CHUNK, len(weight))
        add_waves(x, weight, first, end, unit, given.waves, planes, last, room, parts[chunk])

    team.each(work, SHARES * len(chunks))
    total: Floats = parts[0]
    for part in parts[1:]:  # in their order
        total += part
    return total


def _multiples(x: Any, unit: Any, waves: Any, rows: Any, room: Any) -> None:
    """cos and sin of all multiples of the angles of a block of particles, into `room` [6, waves + 1, BLOCK]."""
    for axis in range(3):
        c, s = room[2 * axis], room[2 * axis + 1]
        for i in range(BLOCK):
            angle = unit[axis] * x[axis, rows[i]]
            c[0, i], s[0, i] = 1.0, 0.0
            c[1, i], s[1, i] = np.cos(angle), np.sin(angle)
        for k in range(2, waves[axis] + 1):
            for i in range(BLOCK):
                c[k, i] = c[k - 1, i] * c[1, i] - s[k - 1, i] * s[1, i]
                s[k, i] = s[k - 1, i] * c[1, i] + c[k - 1, i] * s[1, i]


@kernel
def add_waves(
    x: Any,
    weight: Any,
    first: Any,
    end: Any,
    unit: Any,
    waves: Any,
    planes: Any,
    last: Any,
    room: Any,
    out: Any,
) -> None:
    """Add the waves of particles [first, end) to some planes of `out`; `room` as in `_multiples`."""
    products, row = on_stack(2, BLOCK, np.float64), on_stack(1, BLOCK, np.int64)[0]
    pr, pi = products[0], products[1]
    for begin in range(first, end, BLOCK):
        number = min(BLOCK, end - begin)
        for i in range(BLOCK):
            row[i] = begin + min(i, number - 1)
        _multiples(x, unit, waves, row, room)
        for kx in range(planes[0], planes[1]):
            for ky in range(-waves[1], waves[1] + 1):
                most = last[kx, ky + waves[1]]
                if most < 0:
                    continue  # beyond the last wave, whatever that along z
                flip = 1.0 if ky >= 0 else -1.0
                cx, sx, cy, sy = room[0, kx], room[1, kx], room[2, abs(ky)], room[3, abs(ky)]
                for i in range(BLOCK):
                    w = weight[row[i]] if i < number else 0.0
                    pr[i] = w * (cx[i] * cy[i] - flip * (sx[i] * sy[i]))
                    pi[i] = w * (sx[i] * cy[i] + flip * (cx[i] * sy[i]))
                _add_row(pr, pi, room, most, waves[2], out[kx], ky + waves[1])


@outlined
def _add_row(pr: Any, pi: Any, room: Any, most: Any, middle: Any, out: Any, ky: Any) -> None:
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
        out[0, ky, middle + kz] += even
        out[1, ky, middle + kz] += odd
        if kz > 0:
            out[0, ky, middle - kz] += even_back
            out[1, ky, middle - kz] += odd_back


@kernel
def read_waves(
    x: Any, rows: Any, at: Any, unit: Any, waves: Any, last: Any, sums: Any, room: Any, out: Any
) -> None:
    """The gradient and the height of waves with amplitudes `sums`, as of `wave_sums`, at a block of the rows from `at` on,
    into out [4, rows]."""
    found, row = on_stack(8, BLOCK, np.float64), on_stack(1, BLOCK, np.int64)[0]
    pr, pi, turned, gx, gy, gz, height = (found[k] for k in range(7))
    number = min(BLOCK, rows.size - at)
    for i in range(BLOCK):
        row[i] = rows[at + min(i, number - 1)]
        gx[i] = gy[i] = gz[i] = height[i] = 0.0
    _multiples(x, unit, waves, row, room)
    for kx in range(waves[0] + 1):
        for ky in range(-waves[1], waves[1] + 1):
            most = last[kx, ky + waves[1]]
            if most < 0:
                continue
            flip = 1.0 if ky >= 0 else -1.0
            cx, sx, cy, sy = room[0, kx], room[1, kx], room[2, abs(ky)], room[3, abs(ky)]
            for i in range(BLOCK):
                pr[i] = cx[i] * cy[i] - flip * (sx[i] * sy[i])
                pi[i] = sx[i] * cy[i] + flip * (cx[i] * sy[i])
                turned[i] = 0.0
            _read_row(found, room, most, waves[2], unit[2], sums[kx], ky + waves[1])
            for i in range(BLOCK):
                gx[i] += unit[0] * kx * turned[i]
                gy[i] += unit[1] * ky * turned[i]
    for i in range(number):
        for axis, each in enumerate((gx, gy, gz, height)):
            out[axis, at + i] = each[i]


@outlined
def _read_row(found: Any, room: Any, most: Any, middle: Any, unit: Any, sums: Any, ky: Any) -> None:
    """What the waves of one row add, forwards and backwards along z."""
    pr, pi, turned, gz, height = found[0], found[1], found[2], found[5], found[6]
    for kz in range(most + 1):
        cos, sin = room[4, kz], room[5, kz]
        even, odd = sums[0, ky, middle + kz], sums[1, ky, middle + kz]
        even_back = sums[0, ky, middle - kz] if kz > 0 else 0.0
        odd_back = sums[1, ky, middle - kz] if kz > 0 else 0.0
        for i in range(BLOCK):
            a, b, c, d = pr[i] * cos[i], pi[i] * sin[i], pi[i] * cos[i], pr[i] * sin[i]
            height[i] += (a - b) * even + (c + d) * odd + ((a + b) * even_back + (c - d) * odd_back)
            t = (a - b) * odd - (c + d) * even
            back = (a + b) * odd_back - (c - d) * even_back
            turned[i] += t + back
            gz[i] += unit * kz * (t - back)
