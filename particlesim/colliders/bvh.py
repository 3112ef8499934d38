"""A bounding volume hierarchy of triangles: which is nearest to a place, and which does a moving ball meet first.

Triangles are halved along the longest side of the box about their middles, and each half again, down to leaves of eight;
eight leaves make a node, eight of these one above, and so on. So a tree of 10⁵ triangles is some sorts and minima, and has
five floors. Nodes hold the boxes of their children, and leaves the corners of their triangles, side by side, as vectors of
eight take them.

A coarse grid about the mesh holds lower bounds of the distance, signed: most particles are far from most of a surface, and
need no more than a look at it. It also holds the nearest triangles, with which a search begins.

Sources: I. Wald, C. Benthin, S. Boulos, Getting rid of packets, IEEE Symposium on Interactive Ray Tracing (2008): trees with
as many branches as a vector has lanes; C. Ericson, Real-Time Collision Detection (2005), 5.1.5; J. A. Bærentzen, H. Aanæs,
IEEE Trans. Vis. Comput. Graph. 11, 243 (2005): the sign of the distance is that of (x − c)·N, with c the nearest place on
the surface and N its angle-weighted pseudonormal.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders.way import Way, first_root
from particlesim.compiler import kernel, much, outlined
from particlesim.compiler.intrinsics import lanes, on_stack
from particlesim.model.arrays import Floats, Ints

WIDE = 8
"""Children of a node, and triangles of a leaf."""

CELLS = 64
"""Cells of the grid along the longest side, at most."""

IN_PYTHON = 2000
"""Cells whose bounds plain Python may look for; more are worth a compiler."""

DEPTH = 96
"""Room for nodes that wait, seven on each floor: a tree of 8¹³ leaves."""

NOWHERE = 1e150
"""Where boxes of children that are missing are [m]: nothing is near them, and no way passes them."""


class BvhRecord(NamedTuple):
    """The box about all triangles (low and high corner). The nodes, from the top floor down: boxes of their children [n, 6,
    8] and the number of the first child, which is a leaf from n on. Corners of the triangles by leaves [l, 9, 8]; their
    pseudonormals, of three corners, three edges and face [t, 21]. The grid: its low corner, the side of its cells, lower
    bounds of the distance [nx, ny, nz], negative inside [m], and the triangle nearest to the middle of each cell."""

    around: tuple[float, float, float, float, float, float]
    boxes: NDArray[np.float64]
    child: NDArray[np.int64]
    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    low: tuple[float, float, float]
    cell: float
    bounds: NDArray[np.float32]
    hints: NDArray[np.int32]


# Building


def build(corners: Floats, faces: Ints) -> BvhRecord:
    """The tree of triangles with corners [n, 3] in metres and rows [m, 3]."""
    triangles = corners[faces]
    order = halved(triangles.mean(axis=1))
    number = len(order)
    # a leaf that is not full repeats the last triangle
    order = order[np.minimum(np.arange(-(-number // WIDE) * WIDE), number - 1)]
    leaves = triangles[order].reshape(-1, WIDE, 3, 3)
    boxes, child = _nodes(np.concatenate([leaves.min(axis=(1, 2)), leaves.max(axis=(1, 2))], axis=1))
    around = tuple(float(v) for v in (*triangles.min(axis=(0, 1)), *triangles.max(axis=(0, 1))))
    tree = BvhRecord(
        around,  # type: ignore[arg-type]
        boxes,
        child,
        np.ascontiguousarray(leaves.reshape(-1, WIDE, 9).transpose(0, 2, 1)),
        np.ascontiguousarray(pseudonormals(corners, faces)[order].reshape(-1, 21)),
        (0.0, 0.0, 0.0),
        1.0,
        np.zeros((1, 1, 1), np.float32),
        np.zeros((1, 1, 1), np.int32),
    )
    return _with_grid(tree, number)


def _nodes(boxes: Floats) -> tuple[Floats, Ints]:
    """The boxes of the children of all nodes, and their first children, from the boxes of the leaves [l, 6]."""
    floors: list[Floats] = []
    while not floors or len(floors[-1]) > 1:
        full = np.full((-(-len(boxes) // WIDE) * WIDE, 6), NOWHERE)
        full[: len(boxes)] = boxes
        floors.append(full.reshape(-1, WIDE, 6))
        first = np.arange(0, len(boxes), WIDE)
        lows, highs = np.minimum.reduceat(boxes[:, :3], first), np.maximum.reduceat(boxes[:, 3:], first)
        boxes = np.concatenate([lows, highs], axis=1)
    child, begin = [], 0
    for floor in floors[::-1]:
        begin += len(floor)
        child.append(begin + WIDE * np.arange(len(floor)))
    return np.ascontiguousarray(np.concatenate(floors[::-1]).transpose(0, 2, 1)), np.concatenate(child)


def halved(middles: Floats) -> Ints:
    """The order of places [n, 3] that cuts them in halves along the longest side of the box about them, and each half again,
    down to leaves. The first half has a power of 2 of leaves, so that all of a node's are next to each other."""
    number = len(middles)
    order = np.arange(number)
    leaves, first = np.array([-(-number // WIDE)]), np.array([0])
    while leaves.max() > 1:
        places, begin = middles[order], first * WIDE
        sides = np.maximum.reduceat(places, begin) - np.minimum.reduceat(places, begin)
        part = np.repeat(np.arange(len(begin)), np.diff(begin, append=number))
        along = places[np.arange(number), sides.argmax(axis=1)[part]]
        order = order[np.lexsort((along, part))]
        half = np.where(leaves > 1, 1 << np.ceil(np.log2(leaves)).astype(int) >> 1, 1)
        first = np.stack([first, first + half], axis=1).ravel()
        leaves = np.stack([half, leaves - half], axis=1).ravel()
        first, leaves = first[leaves > 0], leaves[leaves > 0]
    return order


def pseudonormals(corners: Floats, faces: Ints) -> Floats:
    """Unit normals of each triangle's corners (weighted by angles), edges (ab, bc, ca) and face, shape [m, 7, 3]."""
    triangles = corners[faces]
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    face = _unit(np.cross(b - a, c - a))
    at = np.zeros_like(corners)
    for k in range(3):
        u = _unit(triangles[:, (k + 1) % 3] - triangles[:, k])
        v = _unit(triangles[:, (k + 2) % 3] - triangles[:, k])
        # the angle between unit vectors without loss near 0 and π (Kahan)
        angle = 2 * np.arctan2(np.linalg.norm(u - v, axis=1), np.linalg.norm(u + v, axis=1))
        np.add.at(at, faces[:, k], angle[:, None] * face)
    at = _unit(at)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    key = ends.min(axis=1) * len(corners) + ends.max(axis=1)
    _, which = np.unique(key, return_inverse=True)
    edge = np.zeros((int(which.max()) + 1, 3))
    np.add.at(edge, which.reshape(-1), np.repeat(face, 3, axis=0))
    along = _unit(edge)[which.reshape(-1)].reshape(-1, 3, 3)
    return np.concatenate([at[faces], along, face[:, None]], axis=1)


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300))


def _with_grid(tree: BvhRecord, number: int) -> BvhRecord:
    """The tree with a grid of lower bounds about it."""
    low, high = np.array(tree.around[:3]), np.array(tree.around[3:])
    longest = float((high - low).max())
    margin = 0.05 * longest
    fine = int(np.clip(np.cbrt(8.0 * number), 8, CELLS))
    cell = (longest + 2 * margin) / fine
    shape = np.maximum(np.ceil((high - low + 2 * margin) / cell), 1).astype(int)
    sides = tuple(int(side) for side in shape)
    bounds, hints = np.empty(sides, np.float32), np.empty(sides, np.int32)
    corner: Floats = 0.5 * (low + high - shape * cell)
    x, y, z = (float(v) for v in corner)
    tree = tree._replace(low=(x, y, z), cell=cell)
    with much(bounds.size > IN_PYTHON):
        fill_bounds(tree, bounds, hints)
    return tree._replace(bounds=bounds, hints=hints)


@kernel
def fill_bounds(tree: Any, bounds: Any, hints: Any) -> None:
    """The lower bound of each cell: the distance of a place, less the way from there to the farthest place of the cell.

    Cells far from the surface share the distance of the middle of a block of 16³ or 4³.
    """
    nx, ny, nz = bounds.shape[0], bounds.shape[1], bounds.shape[2]
    for i in range(0, nx, 16):
        for j in range(0, ny, 16):
            for k in range(0, nz, 16):
                if not _fill_block(tree, bounds, hints, i, j, k, 16):
                    for u in range(i, min(i + 16, nx), 4):
                        for v in range(j, min(j + 16, ny), 4):
                            for w in range(k, min(k + 16, nz), 4):
                                _fill_small(tree, bounds, hints, u, v, w)


def _fill_small(tree: Any, bounds: Any, hints: Any, i: Any, j: Any, k: Any) -> None:
    if not _fill_block(tree, bounds, hints, i, j, k, 4):
        for u in range(i, min(i + 4, bounds.shape[0])):
            for v in range(j, min(j + 4, bounds.shape[1])):
                for w in range(k, min(k + 4, bounds.shape[2])):
                    _fill_block(tree, bounds, hints, u, v, w, 1)


@outlined
def _fill_block(tree: Any, bounds: Any, hints: Any, i: Any, j: Any, k: Any, size: Any) -> bool:
    """The bounds of a block of cells from the distance of its middle, if that is far enough; of single cells always."""
    cell = tree.cell
    x, y, z = (i + 0.5 * size) * cell, (j + 0.5 * size) * cell, (k + 0.5 * size) * cell
    x0, y0, z0 = tree.low
    best, found, what, cx, cy, cz = _search(tree, x0 + x, y0 + y, z0 + z, 0)
    d = np.sqrt(best)
    at = 3 * what
    side = (
        (x0 + x - cx) * tree.normals[found, at]
        + (y0 + y - cy) * tree.normals[found, at + 1]
        + (z0 + z - cz) * tree.normals[found, at + 2]
    )
    half = 0.5 * np.sqrt(3.0) * cell
    if size > 1 and d < 2 * size * half:
        return False
    for u in range(i, min(i + size, bounds.shape[0])):
        for v in range(j, min(j + size, bounds.shape[1])):
            for w in range(k, min(k + size, bounds.shape[2])):
                a, b, c = (u + 0.5) * cell - x, (v + 0.5) * cell - y, (w + 0.5) * cell - z
                far = max(d - np.sqrt(a * a + b * b + c * c) - half, 0.0)
                far = far - 1e-6 * far  # rounded to single precision, it must stay a lower bound
                bounds[u, v, w] = far if side >= 0 else -far
                hints[u, v, w] = found
    return True


# Distances


def coarse(tree: Any, x: Any, y: Any, z: Any) -> Any:
    """A lower bound of the signed distance of a place outside; not above 0 inside or near the surface [m]."""
    u, v, w = (x - tree.low[0]) / tree.cell, (y - tree.low[1]) / tree.cell, (z - tree.low[2]) / tree.cell
    nx, ny, nz = tree.bounds.shape[0], tree.bounds.shape[1], tree.bounds.shape[2]
    inside = (u >= 0) & (v >= 0) & (w >= 0) & (u < nx) & (v < ny) & (w < nz)
    if inside:
        return float(tree.bounds[int(u), int(v), int(w)])
    # beyond the grid it is the distance to the box of the mesh
    box = tree.around
    a = max(box[0] - x, x - box[3], 0.0)
    b = max(box[1] - y, y - box[4], 0.0)
    c = max(box[2] - z, z - box[5], 0.0)
    return np.sqrt(a * a + b * b + c * c)


def _to_box(boxes: Any, node: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
    """Square of the distance to the box of child k of a node [m²]."""
    a = max(boxes[node, 0, k] - x, x - boxes[node, 3, k], 0.0)
    b = max(boxes[node, 1, k] - y, y - boxes[node, 4, k], 0.0)
    c = max(boxes[node, 2, k] - z, z - boxes[node, 5, k], 0.0)
    return a * a + b * b + c * c


def _to_triangle(corners: Any, leaf: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
    """Square of the distance to triangle k of a leaf, without branches [m²]: to its plane above its inside, else to the
    nearest of its edges."""
    ax, ay, az = corners[leaf, 0, k], corners[leaf, 1, k], corners[leaf, 2, k]
    ux, uy, uz = corners[leaf, 3, k] - ax, corners[leaf, 4, k] - ay, corners[leaf, 5, k] - az
    vx, vy, vz = corners[leaf, 6, k] - ax, corners[leaf, 7, k] - ay, corners[leaf, 8, k] - az
    px, py, pz = x - ax, y - ay, z - az
    up, vp = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    height = nx * px + ny * py + nz * pz
    b, c, area = up * vv - vp * uv, vp * uu - up * uv, nx * nx + ny * ny + nz * nz
    s, t = min(max(up / uu, 0.0), 1.0), min(max(vp / vv, 0.0), 1.0)
    wx, wy, wz, qx, qy, qz = vx - ux, vy - uy, vz - uz, px - ux, py - uy, pz - uz
    r = min(max((qx * wx + qy * wy + qz * wz) / (wx * wx + wy * wy + wz * wz), 0.0), 1.0)
    dx, dy, dz = px - s * ux, py - s * uy, pz - s * uz
    ex, ey, ez = px - t * vx, py - t * vy, pz - t * vz
    fx, fy, fz = qx - r * wx, qy - r * wy, qz - r * wz
    first, second = dx * dx + dy * dy + dz * dz, ex * ex + ey * ey + ez * ez
    edge = min(first, second, fx * fx + fy * fy + fz * fz)
    return height * height / area if (b >= 0) & (c >= 0) & (b + c <= area) else edge


@outlined
def nearest_on_triangle(corners: Any, number: Any, x: Any, y: Any, z: Any) -> Any:
    """What of a triangle is nearest to a place (0 to 2 a corner, 3 to 5 an edge, 6 the face), and where [m]."""
    leaf, k = number // WIDE, number % WIDE
    ax, ay, az = corners[leaf, 0, k], corners[leaf, 1, k], corners[leaf, 2, k]
    ux, uy, uz = corners[leaf, 3, k] - ax, corners[leaf, 4, k] - ay, corners[leaf, 5, k] - az
    vx, vy, vz = corners[leaf, 6, k] - ax, corners[leaf, 7, k] - ay, corners[leaf, 8, k] - az
    px, py, pz = x - ax, y - ay, z - az
    d1, d2 = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    if d1 <= 0 and d2 <= 0:
        return 0, ax, ay, az
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    d3, d4 = d1 - uu, d2 - uv
    if d3 >= 0 and d4 <= d3:
        return 1, ax + ux, ay + uy, az + uz
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        t = d1 / (d1 - d3)
        return 3, ax + t * ux, ay + t * uy, az + t * uz
    d5, d6 = d1 - uv, d2 - vv
    if d6 >= 0 and d5 <= d6:
        return 2, ax + vx, ay + vy, az + vz
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        t = d2 / (d2 - d6)
        return 5, ax + t * vx, ay + t * vy, az + t * vz
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 4, ax + ux + t * (vx - ux), ay + uy + t * (vy - uy), az + uz + t * (vz - uz)
    s = 1.0 / (va + vb + vc)
    b, c = vb * s, vc * s
    return 6, ax + b * ux + c * vx, ay + b * uy + c * vy, az + b * uz + c * vz


def _hint(tree: Any, x: Any, y: Any, z: Any) -> Any:
    """A triangle near a place: that of its cell, or of the cell of the grid that is nearest; some triangle of no place."""
    u, v, w = (x - tree.low[0]) / tree.cell, (y - tree.low[1]) / tree.cell, (z - tree.low[2]) / tree.cell
    nx, ny, nz = tree.hints.shape[0], tree.hints.shape[1], tree.hints.shape[2]
    i = int(min(max(0.0, u), nx - 1.0))
    j = int(min(max(0.0, v), ny - 1.0))
    k = int(min(max(0.0, w), nz - 1.0))
    return int(tree.hints[i, j, k])


def _wait(waiting: Any, ahead: Any, number: Any, far: Any, child: Any, best: Any) -> Any:
    """Put the children that are nearer than `best` to those that wait, the nearest last; how many wait then."""
    least = number
    for k in range(WIDE):
        d = far[0, k]
        if d < best:
            at = number
            while at > least and ahead[at - 1, 0] < d:
                ahead[at, 0], waiting[at, 0] = ahead[at - 1, 0], waiting[at - 1, 0]
                at -= 1
            ahead[at, 0], waiting[at, 0] = d, child + k
            number += 1
    return number


@outlined
def _search(tree: Any, x: Any, y: Any, z: Any, hint: Any) -> Any:
    """The square of the distance of a place from the surface [m²], the nearest triangle and which of its parts, and the
    nearest place on it. The search begins at the triangle `hint`."""
    boxes, corners = tree.boxes, tree.corners
    inner = boxes.shape[0]
    waiting = on_stack(DEPTH, 1, np.int64)
    ahead = on_stack(DEPTH, 1, np.float64)
    square = on_stack(1, WIDE, np.float64)
    number = 0
    node = 0
    found = hint
    what, cx, cy, cz = nearest_on_triangle(corners, hint, x, y, z)
    best = (x - cx) * (x - cx) + (y - cy) * (y - cy) + (z - cz) * (z - cz)
    while True:
        if node >= inner:
            least = best
            for k in lanes(WIDE):
                square[0, k] = _to_triangle(corners, node - inner, k, x, y, z)
            for k in range(WIDE):
                least = min(least, square[0, k])
            for k in range(WIDE):
                if square[0, k] <= least * (1 + 1e-6):
                    part, fx, fy, fz = nearest_on_triangle(corners, (node - inner) * WIDE + k, x, y, z)
                    d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy) + (z - fz) * (z - fz)
                    if d2 < best:
                        best, found, what = d2, (node - inner) * WIDE + k, part
                        cx, cy, cz = fx, fy, fz
        else:
            for k in lanes(WIDE):
                square[0, k] = _to_box(boxes, node, k, x, y, z)
            number = _wait(waiting, ahead, number, square, tree.child[node], best)
        again = False
        while number > 0 and not again:
            number -= 1
            node = waiting[number, 0]
            again = ahead[number, 0] < best
        if not again:
            break
    return best, found, what, cx, cy, cz


@outlined
def nearest_triangle(tree: Any, x: Any, y: Any, z: Any) -> Any:
    """The distance of a place from the surface [m], on which side it is (1 outside, −1 inside), and the unit vector from
    its nearest place, outwards."""
    best, found, what, cx, cy, cz = _search(tree, x, y, z, _hint(tree, x, y, z))
    d = np.sqrt(best)
    at = 3 * what
    nx, ny, nz = tree.normals[found, at], tree.normals[found, at + 1], tree.normals[found, at + 2]
    dx, dy, dz = x - cx, y - cy, z - cz
    side = 1.0 if dx * nx + dy * ny + dz * nz >= 0 else -1.0
    # On a face the way to the place is its normal, and at a place on the surface there is no other.
    x0, y0, z0 = tree.low
    if what < 6 and d > 1e-12 * (abs(x - x0) + abs(y - y0) + abs(z - z0) + abs(x0) + abs(y0) + abs(z0)):
        nx, ny, nz = side * dx / d, side * dy / d, side * dz / d
    return d, side, nx, ny, nz


# A moving ball


@outlined
def touches(
    tree: Any, k: Any, w: Way, x: Any, y: Any, z: Any, begin: Any, end: Any, size: Any, side: Any, slack: Any
) -> Any:
    """The first part of a way between `begin` and `end` at which triangle k is within `size` of the place, 2 if it is not:
    its gap is a convex function of the place. `side`: on which side of the surface the way begins."""
    s = begin
    nx, ny, nz = tree.normals[k, 18], tree.normals[k, 19], tree.normals[k, 20]
    for _ in range(96):
        px, py, pz = x + s * (w.ux + s * w.cx), y + s * (w.uy + s * w.cy), z + s * (w.uz + s * w.cz)
        what, fx, fy, fz = nearest_on_triangle(tree.corners, k, px, py, pz)
        dx, dy, dz = px - fx, py - fy, pz - fz
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        height = dx * nx + dy * ny + dz * nz
        if d <= 8 * slack:
            mx, my, mz, d = side * nx, side * ny, side * nz, side * height
        elif what == 6:
            up = 1.0 if height >= 0 else -1.0
            mx, my, mz = up * nx, up * ny, up * nz
        else:
            mx, my, mz = dx / d, dy / d, dz / d
        b = mx * (w.ux + 2 * s * w.cx) + my * (w.uy + 2 * s * w.cy) + mz * (w.uz + 2 * s * w.cz)
        a = mx * w.cx + my * w.cy + mz * w.cz
        if d - size < -slack and (b < 0 or (b == 0 and a < 0)):
            return s
        # What touches may move on into it, off, or along it: it does not do so much before it is twice the slack inside.
        s = s + first_root(a, b, d - size if d - size >= slack else 2 * slack + max(d - size, 0.0))
        if not s <= end:
            break
    return 2.0


@outlined
def first_triangle(
    tree: Any, w: Way, x: Any, y: Any, z: Any, begin: Any, size: Any, side: Any, slack: Any
) -> Any:
    """The first part of a way, from `begin` on, at which a place comes within `size` of the surface; 2 if it does not."""
    boxes, corners = tree.boxes, tree.corners
    inner = boxes.shape[0]
    waiting = on_stack(DEPTH, 1, np.int64)
    ahead = on_stack(DEPTH, 1, np.float64)
    enters = on_stack(1, WIDE, np.float64)
    number, node = 0, 0
    best = 2.0
    # The way deviates from the straight line between its ends by no more than |c|/4.
    bend = 0.25 * np.sqrt(w.cx * w.cx + w.cy * w.cy + w.cz * w.cz)
    pad = size + bend + 4 * slack
    ex, ey, ez = w.ux + w.cx, w.uy + w.cy, w.uz + w.cz
    while True:
        # a part of a bent way is not that of its chord
        last = min(best, 1.0) if bend <= 0 else 1.0
        if node >= inner:
            leaf = node - inner
            for k in lanes(WIDE):
                box = _box_of(corners, leaf, k)
                enters[0, k] = _enters(box, x, y, z, ex, ey, ez, pad, last)
            for k in range(WIDE):
                if enters[0, k] <= last:
                    t = touches(tree, leaf * WIDE + k, w, x, y, z, begin, min(best, 1.0), size, side, slack)
                    best = min(best, t)
        else:
            for k in lanes(WIDE):
                box = (
                    boxes[node, 0, k],
                    boxes[node, 1, k],
                    boxes[node, 2, k],
                    boxes[node, 3, k],
                    boxes[node, 4, k],
                    boxes[node, 5, k],
                )
                enters[0, k] = _enters(box, x, y, z, ex, ey, ez, pad, last)
            number = _wait(waiting, ahead, number, enters, tree.child[node], 1.5)
        again = False
        while number > 0 and not again:
            number -= 1
            node = waiting[number, 0]
            again = bend > 0 or ahead[number, 0] <= best
        if not again:
            break
    return best


def _box_of(corners: Any, leaf: Any, k: Any) -> Any:
    """The box about triangle k of a leaf."""
    c = tuple(corners[leaf, row, k] for row in range(9))
    low = tuple(min(c[axis], c[3 + axis], c[6 + axis]) for axis in range(3))
    return low + tuple(max(c[axis], c[3 + axis], c[6 + axis]) for axis in range(3))


def _enters(box: Any, x: Any, y: Any, z: Any, ex: Any, ey: Any, ez: Any, pad: Any, end: Any) -> Any:
    """The part of the straight way from a place by (ex, ey, ez), up to its part `end`, at which it comes within `pad` of a
    box; 2 if it does not."""
    begin = 0.0
    for axis in range(3):
        p, e = (x, y, z)[axis], (ex, ey, ez)[axis]
        low, high = box[axis] - pad - p, box[axis + 3] + pad - p
        moves = (e > 0) | (e < 0)
        turn = 1.0 / (e if moves else 1.0)
        one, other = low * turn, high * turn
        within = 0.0 if (low <= 0) & (high >= 0) else 2.0
        begin = max(begin, min(one, other) if moves else within)
        end = min(end, max(one, other) if moves else end)
    return begin if begin <= end else 2.0
