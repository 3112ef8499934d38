"""Pairs of particles that are near each other."""

from __future__ import annotations

import numpy as np

from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints

MOST = 50_000_000
"""Springs that one `within` may make: some ten gigabytes."""


def near_pairs(distance: float, inside: bool, label: str, first: Floats, second: Floats) -> Ints:
    """Pairs at most `distance` [m] apart, sorted, shape [n, 2]; positions have shape [3, n].

    With `inside`, both ends are in one group, and each pair is given once, the smaller index first. Raises UsageError
    when there are none, or more than memory is for.
    """
    from scipy.spatial import cKDTree

    a = cKDTree(first.T)
    b = a if inside else cKDTree(second.T)
    try:
        ordered = int(a.count_neighbors(b, distance))
    except ValueError:  # squares of distances overflow
        raise UsageError(
            f"{label}: some particles are so far out that distances are no numbers", "look at their positions"
        ) from None
    number = (ordered - first.shape[1]) // 2 if inside else ordered
    if number == 0:
        raise UsageError(f"{label}: no two particles are within {distance:g} m", "give a larger `within`")
    if number > MOST:
        raise UsageError(
            f"{label}: {number:,} pairs are within {distance:g} m, more than the {MOST:,} that may be joined",
            "give a smaller `within`",
        )
    if inside:
        pairs = a.query_pairs(distance, output_type="ndarray").astype(np.int64)
    else:
        found = a.sparse_distance_matrix(b, distance, output_type="ndarray")
        pairs = np.stack([found["i"], found["j"]], axis=1).astype(np.int64)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
