"""Whether a body that begins inside colliders can be shifted out of them, without rotation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from particlesim.model.arrays import Floats

LOOKS = 4
"""Shifts that are tried: each may bring the body to other colliders."""


def no_room(look: Callable[[Floats], tuple[Floats, Floats]], allowed: float) -> bool:
    """Whether no shift d frees a body; `look` gives the normals [n, 3] and gaps [m] of its contacts with colliders after a
    shift, which may be as deep as is `allowed`: what is wanted is n·d ≥ depth for all that have been met (a linear program).
    """
    from scipy.optimize import linprog

    shift, normals, depths = np.zeros(3), np.empty((0, 3)), np.empty(0)
    for _ in range(LOOKS):
        n, gap = look(shift)
        if not (gap < -allowed).any():
            return False
        normals, depths = np.concatenate([normals, n]), np.concatenate([depths, n @ shift - gap])
        found = linprog(normals.sum(axis=0), -normals, allowed - depths, bounds=(None, None))
        if not found.success:
            return True
        shift = np.asarray(found.x)
    return False
