"""Orientations as unit quaternions w, x, y, z."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.model.arrays import Floats

UNTURNED = (1.0, 0.0, 0.0, 0.0)


def times(a: Any, b: Any) -> Any:
    """The product of two quaternions: first the turn b, then a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def quaternion(rotation: Floats) -> Floats:
    """The unit quaternion w, x, y, z of a rotation matrix, with w ≥ 0. Source: S. Shepperd, J. Guidance Control 1, 223
    (1978)."""
    r = rotation
    squares = np.array([np.trace(r), r[0, 0], r[1, 1], r[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1 + np.trace(r), r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        q = np.empty(4)
        q[0] = r[m, j] - r[j, m]
        q[1 + i] = 1 + r[i, i] - r[j, j] - r[m, m]
        q[1 + j] = r[i, j] + r[j, i]
        q[1 + m] = r[i, m] + r[m, i]
    q = q / np.linalg.norm(q)
    return q if q[0] >= 0 else -q
