"""Volume, centre of mass and second moments of what triangles enclose, exactly, and principal axes.

A closed surface is cut into the tetrahedra of its triangles with the origin, of signed volumes det/6 = a·(b × c)/6. With
s = a + b + c

    V = Σ det/6,  ∫ x dV = Σ det s/24,  ∫ x xᵀ dV = Σ det (s sᵀ + a aᵀ + b bᵀ + c cᵀ)/120.

Source: F. Tonon, J. Math. Stat. 1, 8 (2005); B. Mirtich, J. Graphics Tools 1, 31 (1996).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.model.arrays import Floats, Ints

LEVEL = 1e-9
"""Parts of the largest second moment below which two of them, or what couples two axes, count as equal or nothing."""


class Solidity(NamedTuple):
    """A volume [m³], its centre [m], and C = ∫ x xᵀ dV about that centre [m⁵], shape [3, 3]."""

    volume: float
    center: Floats
    second: Floats

    def seen(self, center: Floats, rotation: Floats) -> Solidity:
        """The same in another frame: x = c + R y, with this frame's y."""
        return Solidity(self.volume, center + rotation @ self.center, rotation @ self.second @ rotation.T)


def enclosed_by(corners: Floats, faces: Ints) -> Solidity:
    """What a closed surface encloses: corners [n, 3], triangles [m, 3] with their fronts outwards."""
    middle = corners.mean(
        axis=0
    )  # near the centre, so that little is lost where places are far from the origin
    a, b, c = (corners - middle)[faces].transpose(1, 0, 2)
    det, s = np.einsum("ij,ij->i", a, np.cross(b, c)), a + b + c
    volume = det.sum() / 6
    center = (det[:, None] * s).sum(axis=0) / (24 * volume)
    second = sum(np.einsum("i,ij,ik->jk", det, p, p) for p in (s, a, b, c)) / 120
    return Solidity(float(volume), middle + center, second - volume * np.outer(center, center))


def together(parts: list[Solidity]) -> Solidity:
    """Several solids that do not overlap as one."""
    volume = sum(part.volume for part in parts)
    center, second = np.zeros(3), np.zeros((3, 3))
    for part in parts:
        center += part.volume / volume * part.center
    for part in parts:
        arm = part.center - center
        second += part.second + part.volume * np.outer(arm, arm)
    return Solidity(volume, center, second)


def principal(second: Floats) -> tuple[Floats, Floats]:
    """J = ∫ x² dV along the principal axes [3], and these as columns of a rotation [3, 3].

    They are as near to the given axes as can be: axes that are principal already stay, and where moments are equal, as those
    of a cube, all directions are principal.
    """
    scale = np.abs(second).max()
    off = second - np.diag(np.diag(second))
    if np.abs(off).max() <= LEVEL * scale:
        return np.diag(second).copy(), np.eye(3)
    values, vectors = np.linalg.eigh(second)
    vectors = _alike(values, vectors, scale)
    # Each to the axis that it is nearest to, and turned towards it.
    order = max(
        ((i, j, k) for i in range(3) for j in range(3) for k in range(3) if {i, j, k} == {0, 1, 2}),
        key=lambda p: sum(abs(vectors[axis, p[axis]]) for axis in range(3)),
    )
    axes = vectors[:, list(order)]
    axes = axes * np.where(np.diag(axes) < 0, -1.0, 1.0)
    if np.linalg.det(axes) < 0:
        axes[:, int(np.argmin(np.abs(np.diag(axes))))] *= -1
    return np.diag(axes.T @ second @ axes).copy(), axes


def _alike(values: Floats, vectors: Floats, scale: float) -> Floats:
    """Axes of two equal moments, which may be turned about the third at will, as near to the given ones as can be."""
    for lone in (0, 2):
        one, two = 1, 2 - lone
        if abs(values[one] - values[two]) <= LEVEL * scale:
            axis = vectors[:, lone]
            nearest = int(np.argmin(np.abs(axis)))
            u = np.eye(3)[nearest] - axis[nearest] * axis
            u /= np.linalg.norm(u)
            return np.stack([axis, u, np.cross(axis, u)], axis=1)
    return vectors
