"""Fourier transforms of meshes, by all threads of an island together.

Transforms go along one axis after the other. Eight lines at a time, the lanes of vectors, are copied into a scratch, which
stays in the cache, transformed there by Stockham's algorithm, which needs no reordering, and copied back. Lines along the
last axis are real: two of them are the real and the imaginary part of a complex one. No line depends on another one, so
results do not depend on threads.

A mesh of n₀ × n₁ × n₂ real nodes stands in an array [n₀, n₁, 2 half]: rows of n₂ numbers, or, transformed, of n₂/2 + 1
real parts and, from `half` on, as many imaginary ones; `half` is a multiple of the eight lanes.
Source: P. N. Swarztrauber, FFT algorithms for vector computers, Parallel Comput. 1, 45 (1984).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import lanes, on_stack, outlined
from particlesim.engine.barrier import meet

LANES = 8
"""Lines that are transformed together."""
SIN60 = 0.8660254037844386


class Waves(NamedTuple):
    """What transforms along the three axes need: cos and sin of 2π k/n for each, shape [2, n]."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]


def half_of(count: int) -> int:
    """Numbers that a transformed row of so many real nodes takes for the real parts, in whole vectors."""
    return -(-(count // 2 + 1) // LANES) * LANES


def new_waves(shape: tuple[int, int, int]) -> Waves:
    """Roots of unity for meshes of a shape; sizes are powers of 2, or three times one."""
    found = []
    for n in shape:
        angle = 2 * np.pi * np.arange(n) / n
        found.append(np.stack([np.cos(angle), np.sin(angle)]))
    return Waves(*found)


def new_lines(shape: tuple[int, int, int], threads: int) -> NDArray[np.float64]:
    """Scratch of so many threads, each with two complex copies of eight lines: [threads, 4, 8 n]."""
    return np.zeros((threads, 4, LANES * max(shape)))


# Lines


def _read(row: Any, at: Any, into: Any) -> None:
    for i in lanes(LANES):
        into[i] = row[at + i]


def _write(row: Any, at: Any, values: Any) -> None:
    for i in lanes(LANES):
        row[at + i] = values[i]


def _turned(re: Any, im: Any, c: Any, s: Any, out_re: Any, out_im: Any, at: Any) -> None:
    """(re + i im)(c − i s), to its place."""
    for i in lanes(LANES):
        out_re[at + i] = re[i] * c + im[i] * s
    for i in lanes(LANES):
        out_im[at + i] = im[i] * c - re[i] * s


@outlined
def _by_two(xr: Any, xi: Any, yr: Any, yi: Any, stride: Any) -> None:
    """A last pass over lines of which two numbers are left."""
    room = on_stack(4, LANES, np.float64)
    ar, ai, br, bi = room[0], room[1], room[2], room[3]
    for q in range(stride):
        a, b = LANES * q, LANES * (q + stride)
        _read(xr, a, ar)
        _read(xi, a, ai)
        _read(xr, b, br)
        _read(xi, b, bi)
        for i in lanes(LANES):
            yr[a + i] = ar[i] + br[i]
        for i in lanes(LANES):
            yi[a + i] = ai[i] + bi[i]
        for i in lanes(LANES):
            yr[b + i] = ar[i] - br[i]
        for i in lanes(LANES):
            yi[b + i] = ai[i] - bi[i]


@outlined
def _by_three(xr: Any, xi: Any, yr: Any, yi: Any, count: Any, stride: Any, turn: Any) -> None:
    """A pass that makes one transform of `count` three of a third of it; roots of unity are taken every `stride`."""
    room, third = on_stack(10, LANES, np.float64), count // 3
    ar, ai, br, bi, cr, ci = room[0], room[1], room[2], room[3], room[4], room[5]
    pr, pi, mr, mi = room[6], room[7], room[8], room[9]
    for p in range(third):
        c1, s1 = turn[0, p * stride], turn[1, p * stride]
        c2, s2 = turn[0, 2 * p * stride], turn[1, 2 * p * stride]
        for q in range(stride):
            a = LANES * (q + stride * p)
            b, c, out = (
                a + LANES * stride * third,
                a + 2 * LANES * stride * third,
                LANES * (q + stride * 3 * p),
            )
            _read(xr, a, ar)
            _read(xi, a, ai)
            _read(xr, b, br)
            _read(xi, b, bi)
            _read(xr, c, cr)
            _read(xi, c, ci)
            for i in lanes(LANES):
                yr[out + i] = ar[i] + (br[i] + cr[i])
            for i in lanes(LANES):
                yi[out + i] = ai[i] + (bi[i] + ci[i])
            for i in lanes(LANES):
                midr, midi = ar[i] - 0.5 * (br[i] + cr[i]), ai[i] - 0.5 * (bi[i] + ci[i])
                offr, offi = SIN60 * (bi[i] - ci[i]), SIN60 * (br[i] - cr[i])
                pr[i] = midr + offr
                pi[i] = midi - offi
                mr[i] = midr - offr
                mi[i] = midi + offi
            _turned(pr, pi, c1, s1, yr, yi, out + LANES * stride)
            _turned(mr, mi, c2, s2, yr, yi, out + 2 * LANES * stride)


@outlined
def _by_four(xr: Any, xi: Any, yr: Any, yi: Any, count: Any, stride: Any, turn: Any) -> None:
    """A pass that makes one transform of `count` four of a quarter of it."""
    room, part = on_stack(16, LANES, np.float64), count // 4
    ar, ai, br, bi, cr, ci, dr, di = (room[k] for k in range(8))
    er, ei, fr, fi, gr, gi = (room[k] for k in range(8, 14))
    step = LANES * stride * part
    for p in range(part):
        c1, s1 = turn[0, p * stride], turn[1, p * stride]
        c2, s2 = turn[0, 2 * p * stride], turn[1, 2 * p * stride]
        c3, s3 = turn[0, 3 * p * stride], turn[1, 3 * p * stride]
        for q in range(stride):
            a, out = LANES * (q + stride * p), LANES * (q + stride * 4 * p)
            _read(xr, a, ar)
            _read(xi, a, ai)
            _read(xr, a + step, br)
            _read(xi, a + step, bi)
            _read(xr, a + 2 * step, cr)
            _read(xi, a + 2 * step, ci)
            _read(xr, a + 3 * step, dr)
            _read(xi, a + 3 * step, di)
            for i in lanes(LANES):
                yr[out + i] = (ar[i] + cr[i]) + (br[i] + dr[i])
            for i in lanes(LANES):
                yi[out + i] = (ai[i] + ci[i]) + (bi[i] + di[i])
            for i in lanes(LANES):
                er[i] = (ar[i] - cr[i]) + (bi[i] - di[i])
                ei[i] = (ai[i] - ci[i]) - (br[i] - dr[i])
                fr[i] = (ar[i] + cr[i]) - (br[i] + dr[i])
                fi[i] = (ai[i] + ci[i]) - (bi[i] + di[i])
                gr[i] = (ar[i] - cr[i]) - (bi[i] - di[i])
                gi[i] = (ai[i] - ci[i]) + (br[i] - dr[i])
            _turned(er, ei, c1, s1, yr, yi, out + LANES * stride)
            _turned(fr, fi, c2, s2, yr, yi, out + 2 * LANES * stride)
            _turned(gr, gi, c3, s3, yr, yi, out + 3 * LANES * stride)


@outlined
def transform_lines(lines: Any, count: Any, turn: Any, backwards: Any) -> Any:
    """Σ_j x_j e^(−2πi jk/n) of eight lines of n = `count` numbers in `lines` [4, 8 n], of which rows 0 and 1 are the real
    and imaginary parts; with `backwards` that with e^(+2πi jk/n), not divided by n. Returns the row of the real parts of the
    result; the imaginary ones are in the next."""
    at, left, stride = 0, count, 1
    flip = (
        1 if backwards else 0
    )  # conjugate of the transform of the conjugate: real and imaginary parts change roles
    while left > 1:
        xr, xi = lines[at + flip], lines[at + 1 - flip]
        yr, yi = lines[2 - at + flip], lines[3 - at - flip]
        if left % 3 == 0:
            _by_three(xr, xi, yr, yi, left, stride, turn)
            left, stride = left // 3, stride * 3
        elif left % 4 == 0:
            _by_four(xr, xi, yr, yi, left, stride, turn)
            left, stride = left // 4, stride * 4
        else:
            _by_two(xr, xi, yr, yi, stride)
            left, stride = left // 2, stride * 2
        at = 2 - at
    return at


# Meshes


def _load_columns(from_re: Any, width: Any, lines: Any, k: Any) -> None:
    """Eight neighbouring real and imaginary parts of a row, as number k of eight lines."""
    re, im = lines[0], lines[1]
    for i in lanes(LANES):
        re[LANES * k + i] = from_re[i]
    for i in lanes(LANES):
        im[LANES * k + i] = from_re[width + i]


def _store_columns(re: Any, im: Any, k: Any, to_re: Any, width: Any) -> None:
    for i in lanes(LANES):
        to_re[i] = re[LANES * k + i]
    for i in lanes(LANES):
        to_re[width + i] = im[LANES * k + i]


@outlined
def _rows_forwards(mesh: Any, waves: Any, lines: Any, x: Any, y: Any, count: Any) -> None:
    """Sixteen real rows (x, y) to (x, y + 15) become rows of real and imaginary parts."""
    width, re, im = mesh.shape[2] // 2, lines[0], lines[1]
    for i in range(LANES):
        even, odd = mesh[x, y + 2 * i], mesh[x, y + 2 * i + 1]
        for k in range(count):
            re[LANES * k + i] = even[k]
            im[LANES * k + i] = odd[k]
    at = transform_lines(lines, count, waves.z, False)
    re, im = lines[at], lines[at + 1]
    for i in range(LANES):
        even, odd = mesh[x, y + 2 * i], mesh[x, y + 2 * i + 1]
        for k in range(count // 2 + 1):
            here, there = LANES * k + i, LANES * ((count - k) % count) + i
            ar, ai, br, bi = re[here], im[here], re[there], im[there]
            even[k] = 0.5 * (ar + br)
            even[width + k] = 0.5 * (ai - bi)
            odd[k] = 0.5 * (ai + bi)
            odd[width + k] = 0.5 * (br - ar)


@outlined
def _rows_backwards(mesh: Any, waves: Any, lines: Any, x: Any, y: Any, count: Any) -> None:
    """The way back: rows of real and imaginary parts become sixteen real rows."""
    width, re, im = mesh.shape[2] // 2, lines[0], lines[1]
    for i in range(LANES):
        even, odd = mesh[x, y + 2 * i], mesh[x, y + 2 * i + 1]
        for k in range(count // 2 + 1):
            re[LANES * k + i] = even[k] - odd[width + k]
            im[LANES * k + i] = even[width + k] + odd[k]
        for k in range(1, count - count // 2):
            re[LANES * (count - k) + i] = even[k] + odd[width + k]
            im[LANES * (count - k) + i] = odd[k] - even[width + k]
    at = transform_lines(lines, count, waves.z, True)
    re, im = lines[at], lines[at + 1]
    for i in range(LANES):
        even, odd = mesh[x, y + 2 * i], mesh[x, y + 2 * i + 1]
        for k in range(count):
            even[k] = re[LANES * k + i]
            odd[k] = im[LANES * k + i]


@outlined
def _plane(mesh: Any, waves: Any, lines: Any, x: Any, backwards: Any) -> None:
    """Transform the lines of plane x along the middle axis, in place."""
    count, width = mesh.shape[1], mesh.shape[2] // 2
    for z in range(0, width, LANES):
        for y in range(count):
            _load_columns(mesh[x, y, z:], width, lines, y)
        at = transform_lines(lines, count, waves.y, backwards)
        for y in range(count):
            _store_columns(lines[at], lines[at + 1], y, mesh[x, y, z:], width)


@outlined
def _filtered(mesh: Any, waves: Any, lines: Any, influence: Any, y: Any, z: Any, back: Any) -> None:
    """Transform eight lines along the first axis, multiply them by the influence function, and back again; without `back`
    the first only."""
    count, width = mesh.shape[0], mesh.shape[2] // 2
    for x in range(count):
        _load_columns(mesh[x, y, z:], width, lines, x)
    at = transform_lines(lines, count, waves.x, False)
    re, im = lines[at], lines[at + 1]
    if back:
        row = min(y, mesh.shape[1] - y)
        to_re, to_im = lines[0], lines[1]
        for x in range(count):
            factor = influence[min(x, count - x), row, z:]
            for i in lanes(LANES):
                to_re[LANES * x + i] = re[LANES * x + i] * factor[i]
            for i in lanes(LANES):
                to_im[LANES * x + i] = im[LANES * x + i] * factor[i]
        at = transform_lines(lines, count, waves.x, True)
        re, im = lines[at], lines[at + 1]
    for x in range(count):
        _store_columns(re, im, x, mesh[x, y, z:], width)


def to_waves(mesh: Any, count: Any, waves: Any, lines: Any, share: Any) -> None:
    """From nodes to waves along the last two axes. All threads of the share call it; it ends with a `meet`."""
    planes = mesh.shape[0]
    for x in range(planes * share.number // share.threads, planes * (share.number + 1) // share.threads):
        for y in range(0, mesh.shape[1], 2 * LANES):
            _rows_forwards(mesh, waves, lines, x, y, count)
        _plane(mesh, waves, lines, x, False)
    meet(share.gate, share.threads)


def filter_waves(mesh: Any, waves: Any, lines: Any, influence: Any, share: Any, back: Any) -> None:
    """The first axis: to waves, times the influence function, and back; or to waves only. It ends with a `meet`."""
    rows = mesh.shape[1]
    for y in range(rows * share.number // share.threads, rows * (share.number + 1) // share.threads):
        for z in range(0, mesh.shape[2] // 2, LANES):
            _filtered(mesh, waves, lines, influence, y, z, back)
    meet(share.gate, share.threads)


def from_waves(mesh: Any, count: Any, waves: Any, lines: Any, share: Any) -> None:
    """Back from waves to nodes along the last two axes. It ends with a `meet`."""
    planes = mesh.shape[0]
    for x in range(planes * share.number // share.threads, planes * (share.number + 1) // share.threads):
        _plane(mesh, waves, lines, x, True)
        for y in range(0, mesh.shape[1], 2 * LANES):
            _rows_backwards(mesh, waves, lines, x, y, count)
    meet(share.gate, share.threads)
