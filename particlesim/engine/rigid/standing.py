"""Places inside of rigid bodies: the centres of particles, and of other bodies, where nothing should be."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import kernel, on_stack
from particlesim.engine.rigid.bodies import orientation, place
from particlesim.engine.rigid.grains import away_from
from particlesim.engine.rigid.narrow import minus
from particlesim.engine.rigid.pieces import solid_of
from particlesim.engine.rigid.rotation import dot, matrix
from particlesim.model.arrays import Floats, Ints


@kernel
def _stand_in(
    b: Any, touch: Any, own: Any, x: Any, order: Any, begin: Any, end: Any, slack: Any, inside: Any
) -> None:
    found, p = on_stack(1, 9, np.float64), b.pieces
    for m in range(own.size):
        at = (x[0, m], x[1, m], x[2, m])
        for row in range(begin[m], end[m]):
            i = order[row]
            d = minus(at, place(b, i))
            if i != own[m] and touch[b.group[i]] > 0 and dot(d, d) < b.reach[i] * b.reach[i]:
                r = matrix(orientation(b, i))
                for number in range(p.first[b.group[i]], p.first[b.group[i] + 1]):
                    away, _ = away_from(p, solid_of(p, number, place(b, i), r), at, found)
                    if away < -slack:
                        inside[m] = i


def bodies_at(b: Any, touch: Floats, x: Floats, slack: float, own: Ints | None = None) -> Ints:
    """A body that each place x [3, m] is in, by more than `slack` [m] from the surface of one of its pieces; −1 for none.
    Bodies of the groups that `touch` [groups] count, but not the body that is the place's `own` [m]."""
    n, inside = x.shape[1], np.full(x.shape[1], -1)
    order = np.argsort(b.x[0], kind="stable")
    sorted_x, widest = b.x[0][order], float(b.reach.max(initial=0.0))
    begin, end = np.searchsorted(sorted_x, x[0] - widest), np.searchsorted(sorted_x, x[0] + widest, "right")
    own = np.full(n, -1) if own is None else own
    _stand_in(b, touch, own, np.ascontiguousarray(x), order, begin, end, slack, inside)
    return inside
