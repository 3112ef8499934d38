"""Cardinal B-splines: how a particle is spread over the nodes of a mesh, and the field read at its place.

Of order p, the spline M_p is p cells wide and has p − 2 continuous derivatives: 2 are clouds in cells, 3 triangular clouds.
A particle at u, in cells, gives node k the part M_p(u − k), for the p nodes k = ⌊u⌋ − p + 1 … ⌊u⌋. So nodes stand for places
p/2 cells further on; as the field is read by the same weights, that cancels.
Source: I. J. Schoenberg, Quart. Appl. Math. 4, 45 (1946); recursion as in U. Essmann et al., J. Chem. Phys.
103, 8577 (1995).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import lanes

LANES = 8
"""Particles whose weights are found together."""


def order_of(spline: Any) -> int:
    """p, of a tuple of as many None."""
    return len(spline)


def weigh(spline: Any, part: Any, weights: Any, slopes: Any) -> None:
    """Weights [p, LANES] of LANES particles on their nodes, the lowest first, and their derivatives by u, unless None;
    `part` [LANES] is u − ⌊u⌋.

    M_k(w) = (w M_(k−1)(w) + (k − w) M_(k−1)(w − 1))/(k − 1), M'_k(w) = M_(k−1)(w) − M_(k−1)(w − 1): node j from below is at
    w = part + p − 1 − j.
    """
    order = order_of(spline)
    for i in lanes(LANES):
        weights[0, i] = 1.0 - part[i]
        weights[1, i] = part[i]
    for below, _ in enumerate(spline):  # written out: all bounds are known
        k = below + 1
        if k < 3:
            continue
        if slopes is not None and k == order:
            for i in lanes(LANES):
                slopes[0, i] = -weights[0, i]
                slopes[order - 1, i] = weights[order - 2, i]
            for j in range(1, order - 1):
                for i in lanes(LANES):
                    slopes[j, i] = weights[j - 1, i] - weights[j, i]
        # row j of order k − 1 is at w = part + k − 2 − j; from the last row on, as each needs itself and the one before
        for i in lanes(LANES):
            weights[k - 1, i] = part[i] * weights[k - 2, i] / (k - 1)
        for j in range(k - 2, 0, -1):
            for i in lanes(LANES):
                w = part[i] + (k - 1 - j)
                weights[j, i] = (w * weights[j - 1, i] + (k - w) * weights[j, i]) / (k - 1)
        for i in lanes(LANES):
            weights[0, i] = (1.0 - part[i]) * weights[0, i] / (k - 1)


def window(order: int, angle: Any) -> Any:
    """The Fourier transform of M_p over a cell: (sin(a/2)/(a/2))^p, with a = k h in radians."""
    return np.sinc(np.asarray(angle) / (2 * np.pi)) ** order
