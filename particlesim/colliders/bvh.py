"""A bounding volume hierarchy of triangles: which is nearest to a place, and which does a moving ball meet first.

The tree is implicit. Triangles are sorted along a Z-curve (Morton codes of their middles) and cut into 2ᵐ leaves of equal
size; the children of node k are 2k + 1 and 2k + 2, and each node has the box about its triangles. So a tree of 10⁵ triangles
is some sorts and minima, and has no pointers.

A coarse grid about the mesh holds lower bounds of the distance, signed: most particles are far from most of a surface, and
need no more than a look at it. It also holds the nearest triangles, with which a search begins.

Sources: C. Lauterbach et al., Fast BVH construction on GPUs, Computer Graphics Forum 28, 375 (2009); C. Ericson, Real-Time
Collision Detection (2005), 5.1.5; J. A. Bærentzen, H. Aanæs, IEEE Trans. Vis. Comput. Graph. 11, 243 (2005): the sign of the
distance is that of (x − c)·N, with c the nearest place on the surface and N its angle-weighted pseudonormal.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders.way import Way, first_root
from particlesim.compiler import kernel, much, outlined
from particlesim.compiler.intrinsics import on_stack
from particlesim.model.arrays import Floats, Ints

LEAF = 4
"""Triangles of a leaf, at most."""

CELLS = 64
"""Cells of the grid along the longest side, at most."""

IN_PYTHON = 2000
"""Cells whose bounds plain Python may look for; more are worth a compiler."""

DEPTH = 64
"""Room for nodes that wait: a tree of 2³² leaves."""


class BvhRecord(NamedTuple):
    """Boxes of the nodes [k, 6] (low and high corner), corners of the triangles [t, 9], pseudonormals of each triangle's
    three corners, three edges and face [t, 21]; triangles in a leaf. The grid: its low corner, the side of its cells, lower
    bounds of the distance [nx, ny, nz], negative inside [m], and the triangle nearest to the middle of each cell."""

    boxes: NDArray[np.float64]
    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    leaf: int
    low: tuple[float, float, float]
    cell: float
    bounds: NDArray[np.float32]
    hints: NDArray[np.int32]


# Building


def build(corners: Floats, faces: Ints) -> BvhRecord:
    """The tree of triangles with corners [n, 3] in metres and rows [m, 3]."""
    triangles = corners[faces]
    order = z_order(triangles.mean(axis=1))
    number = len(order)
    leaves = 1 << max(0, int(np.ceil(np.log2(number / LEAF))))
    leaf = -(-number // leaves)
    # leaves that are not full repeat their last triangle
    row = np.minimum(np.arange(leaves * leaf), number - 1)
    order = order[row]
    ordered = triangles[order]
    boxes = np.empty((2 * leaves - 1, 6))
    grouped = ordered.reshape(leaves, leaf * 3, 3)
    boxes[leaves - 1 :, :3], boxes[leaves - 1 :, 3:] = grouped.min(axis=1), grouped.max(axis=1)
    first = leaves - 1
    while first > 0:
        children = boxes[first : 2 * first + 1]
        half = first // 2
        boxes[half:first, :3] = np.minimum(children[::2, :3], children[1::2, :3])
        boxes[half:first, 3:] = np.maximum(children[::2, 3:], children[1::2, 3:])
        first = half
    normals = pseudonormals(corners, faces)[order]
    tree = BvhRecord(
        boxes,
        np.ascontiguousarray(ordered.reshape(-1, 9)),
        np.ascontiguousarray(normals.reshape(-1, 21)),
        leaf,
        (0.0, 0.0, 0.0),
        1.0,
        np.zeros((1, 1, 1), np.float32),
        np.zeros((1, 1, 1), np.int32),
    )
    return _with_grid(tree, number)


def z_order(middles: Floats) -> Ints:
    """The order of places [n, 3] along a Z-curve."""
    low = middles.min(axis=0)
    size = max(float((middles.max(axis=0) - low).max()), 1e-300)
    step = np.minimum((middles - low) / size * 2**20, 2**20 - 1).astype(np.uint64)
    code = np.zeros(len(middles), np.uint64)
    for axis in range(3):
        bits = step[:, axis]
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        code |= bits << np.uint64(axis)
    return np.argsort(code, kind="stable")


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
    low, high = tree.boxes[0, :3], tree.boxes[0, 3:]
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
    boxes = tree.boxes
    a = max(boxes[0, 0] - x, x - boxes[0, 3], 0.0)
    b = max(boxes[0, 1] - y, y - boxes[0, 4], 0.0)
    c = max(boxes[0, 2] - z, z - boxes[0, 5], 0.0)
    return np.sqrt(a * a + b * b + c * c)


def _to_box(boxes: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
    """Square of the distance to the box of node k [m²]."""
    a = max(boxes[k, 0] - x, x - boxes[k, 3], 0.0)
    b = max(boxes[k, 1] - y, y - boxes[k, 4], 0.0)
    c = max(boxes[k, 2] - z, z - boxes[k, 5], 0.0)
    return a * a + b * b + c * c


@outlined
def nearest_on_triangle(corners: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
    """What of triangle k is nearest to a place (0 to 2 a corner, 3 to 5 an edge, 6 the face), and where [m]."""
    ax, ay, az = corners[k, 0], corners[k, 1], corners[k, 2]
    ux, uy, uz = corners[k, 3] - ax, corners[k, 4] - ay, corners[k, 5] - az
    vx, vy, vz = corners[k, 6] - ax, corners[k, 7] - ay, corners[k, 8] - az
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


@outlined
def _search(tree: Any, x: Any, y: Any, z: Any, hint: Any) -> Any:
    """The square of the distance of a place from the surface [m²], the nearest triangle and which of its parts, and the
    nearest place on it. The search begins at the triangle `hint`."""
    boxes, corners = tree.boxes, tree.corners
    leaves = (boxes.shape[0] + 1) // 2
    waiting = on_stack(DEPTH, 1, np.int64)
    number = 0
    node = 0
    found = hint
    what, cx, cy, cz = nearest_on_triangle(corners, hint, x, y, z)
    best = (x - cx) * (x - cx) + (y - cy) * (y - cy) + (z - cz) * (z - cz)
    while True:
        if node >= leaves - 1:
            first = (node - leaves + 1) * tree.leaf
            for k in range(first, first + tree.leaf):
                part, fx, fy, fz = nearest_on_triangle(corners, k, x, y, z)
                d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy) + (z - fz) * (z - fz)
                if d2 < best:
                    best, found, what = d2, k, part
                    cx, cy, cz = fx, fy, fz
        else:
            one, other = 2 * node + 1, 2 * node + 2
            d, e = _to_box(boxes, one, x, y, z), _to_box(boxes, other, x, y, z)
            near, far = (one if d <= e else other), (other if d <= e else one)
            if max(d, e) < best:
                waiting[number, 0] = far
                number += 1
            if min(d, e) < best:
                node = near
                continue
        again = False
        while number > 0 and not again:
            number -= 1
            node = waiting[number, 0]
            again = _to_box(boxes, node, x, y, z) < best
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
    if what < 6 and d > 1e-12 * (abs(x) + abs(y) + abs(z)):
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
    boxes = tree.boxes
    leaves = (boxes.shape[0] + 1) // 2
    waiting = on_stack(DEPTH, 1, np.int64)
    waiting[0, 0] = 0
    number = 1
    best = 2.0
    # The way deviates from the straight line between its ends by no more than |c|/4.
    bend = 0.25 * np.sqrt(w.cx * w.cx + w.cy * w.cy + w.cz * w.cz)
    pad = size + bend + 4 * slack
    ex, ey, ez = w.ux + w.cx, w.uy + w.cy, w.uz + w.cz
    while number > 0:
        number -= 1
        node = waiting[number, 0]
        if not _passes(boxes, node, x, y, z, ex, ey, ez, pad, min(best, 1.0), bend):
            continue
        if node >= leaves - 1:
            first = (node - leaves + 1) * tree.leaf
            for k in range(first, first + tree.leaf):
                best = min(best, touches(tree, k, w, x, y, z, begin, min(best, 1.0), size, side, slack))
        else:
            one, other = 2 * node + 1, 2 * node + 2
            swap = _to_box(boxes, one, x, y, z) < _to_box(boxes, other, x, y, z)
            waiting[number, 0] = other if swap else one
            waiting[number + 1, 0] = one if swap else other
            number += 2
    return best


def _passes(
    boxes: Any, k: Any, x: Any, y: Any, z: Any, ex: Any, ey: Any, ez: Any, pad: Any, end: Any, bend: Any
) -> Any:
    """Whether the straight way from a place by (ex, ey, ez), up to its part `end`, passes within `pad` of a node's box."""
    last = end if bend <= 0 else 1.0  # a part of a bent way is not that of its chord
    t0, t1 = 0.0, last
    for axis in range(3):
        p, e = (x, y, z)[axis], (ex, ey, ez)[axis]
        low, high = boxes[k, axis] - pad - p, boxes[k, axis + 3] + pad - p
        if e > 0 or e < 0:
            one, other = low / e, high / e
            t0, t1 = max(t0, min(one, other)), min(t1, max(one, other))
        elif low > 0 or high < 0:
            t0, t1 = 1.0, 0.0
    return t0 <= t1
