"""What a step leads to that begins, and would end without contact, as the one before.

What lies between several slopes or in a pit, and others press, would be followed in every step through the same impacts, up
to a hundred of them.
"""

from __future__ import annotations

from typing import Any

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import crossable
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.resting import bends
from particlesim.laws.registry import moved_to

BEGUN, FREE, ENDED, RADIUS, STRUCK, COLUMNS = 0, 6, 12, 18, 19, 20
"""Columns of what is kept of particles: places and velocities with which a step begins, would end without contact, and ends
[6 each]; the radius; what has happened in the step, 1 more, so that 0 is that nothing is kept."""
FEW = 2
"""Planes up to which impacts are found as quickly as here."""


def worthwhile(contacts: Any) -> bool:
    """Whether a step is worth keeping: contacts do the same in all of them, nobody hears of it, and they are not only one or
    two planes."""
    if isinstance(contacts, Simple):
        return False
    colliders = contacts.continuous + contacts.discrete
    steady = not any(isinstance(c.shape, MovingRecord) or c.response.belt is not None for c in colliders)
    steady &= not any(c.response.heard is not None or c.response.turning is not None for c in colliders)
    slow = any(crossable(c) or bends(c) for c in contacts.continuous) or len(contacts.continuous) > FEW
    return steady and slow and len(contacts.soft) == 0


def is_same(kept: Any, i: Any, p: Any, q: Any) -> Any:
    """Whether the step of particle i from p to q, without contact, is the one that is kept, to the last bit."""
    same = (kept[i, STRUCK] > 0) & (kept[i, RADIUS] == p.r)
    for row, each in ((BEGUN, p), (FREE, q)):
        same &= (kept[i, row] == each.x) & (kept[i, row + 1] == each.y) & (kept[i, row + 2] == each.z)
        same &= (kept[i, row + 3] == each.vx) & (kept[i, row + 4] == each.vy) & (kept[i, row + 5] == each.vz)
    return same


def end_of(kept: Any, i: Any, q: Any) -> Any:
    """The end that is kept, at the time of q, and what has happened on the way."""
    x, y, z, u, v, w = (type_of(q.x, kept[i, ENDED + row]) for row in range(6))
    return moved_to(q, x, y, z, u, v, w, q.t), int(kept[i, STRUCK]) - 1


def keep_end(kept: Any, i: Any, p: Any, q: Any, r: Any, struck: Any) -> None:
    """Keep the end r of a step of particle i from p, which would have led to q."""
    for row, each in ((BEGUN, p), (FREE, q), (ENDED, r)):
        for k, number in enumerate((each.x, each.y, each.z, each.vx, each.vy, each.vz)):
            kept[i, row + k] = number
    kept[i, RADIUS] = p.r
    kept[i, STRUCK] = 1 + struck
