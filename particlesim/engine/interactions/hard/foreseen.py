"""Whom grains that come not far in a step may meet in it, by neighbour lists: who meets nobody needs no search (`swift`).

In a step that leads members by at most s relative to their mean, two that meet are at most their radii and 2 s apart at its
end. Lists name all these pairs if no member is further than half of the skin from where it was when they were built, neither
where it begins nor where it ends: then they are valid all along straight ways. Motions common to all do not count.

Both of a pair are followed, or none, as where all are followed: so lists change no bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.hard.ways import BEGUN, BEND, ENDS, FOLLOWED, MEETING, STRAIGHT
from particlesim.engine.interactions.near_pairs import bring_up
from particlesim.engine.interactions.neighbours.record import BEGUN_FAR, GROUP, SLICES, STALE, slice_of
from particlesim.engine.interactions.neighbours.refresh import drift_of, drifts
from particlesim.engine.interactions.neighbours.sort import over_slices
from particlesim.engine.interactions.touching import touching
from particlesim.engine.state.columns import in_step

FAR = 0.5
"""How far members come, as a part of the skin, from which on lists are not valid all along their ways."""
MARGIN = 1.001
"""By how much wider those are that may meet, for rounding."""


def is_plain(w: Any, i: Any) -> Any:
    """Whether the way of a particle is one leg that takes the whole step."""
    return (w.when[BEGUN, i] <= 0) & (w.when[ENDS, i] >= 1) & (w.when[BEND, i] == STRAIGHT)


class Meeting(NamedTuple):
    """Those of pairs that may meet are followed."""

    w: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Follow the first of a pair if the two may meet; each of them comes first once."""
        w = self.w
        if w.what[FOLLOWED, row] == MEETING:
            d = (float(p.x), float(p.y), float(p.z))
            g = tuple(w.go[axis, row] - w.go[axis, other] for axis in range(3))
            square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
            since = (d[0] * g[0] + d[1] * g[1] + d[2] * g[2]) / square if square > 0 else 0.0
            since = min(max(since, 0.0), 1.0)
            q = tuple(d[axis] - since * g[axis] for axis in range(3))
            reach = MARGIN * (float(p.r1) + float(p.r2))
            near = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] <= reach * reach
            if near | (not is_plain(w, other)):
                w.what[FOLLOWED, row] = 1


def follow_meeting(sets: Any, w: Any, c: Any, share: Any, t: Any) -> None:
    """Follow those of the MEETING that meet somebody in the step that ends at time t. All threads come here, with all
    particles in their places."""
    way, least = w.reach[0], w.reach[1]
    for each in sets:
        near, valid = each.near, False
        if way <= FAR * near.skin[0] or near.report[STALE] != 0:
            bring_up(each, in_step(c, t, t), share, t)
            measure_beginning(near, w, share)
            meet(share.gate, share.threads)
            _, far = over_slices(near, BEGUN_FAR)
            valid = far <= FAR * near.skin[0]
        groups = near.begin.size
        first, last = groups * share.number // share.threads, groups * (share.number + 1) // share.threads
        if valid:
            for g in range(first, last):
                touching(each, g, Meeting(w), t, 1 + 2 * way / least)
        else:
            follow_all(near, w, GROUP * first, GROUP * last)


@outlined
def measure_beginning(near: Any, w: Any, share: Any) -> None:
    """How far members have been at the beginning of the step from where they were when lists were built, slice by slice."""
    drift = drift_of(near)
    common = tuple(drift[axis] - w.reach[2 + axis] if drifts(near) else 0.0 for axis in range(3))
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(near.order.size, s)
        far = 0.0
        for k in range(first, last):
            i = near.order[k]
            if i >= 0:
                d = tuple(
                    float(near.x[axis, k]) - w.go[axis, i] - float(near.base[axis, k]) - common[axis]
                    for axis in range(3)
                )
                size = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
                far = size if (size > far) & (w.when[ENDS, i] > 0) else far
        near.slots[s, BEGUN_FAR] = np.sqrt(far)


@outlined
def follow_all(near: Any, w: Any, first: Any, last: Any) -> None:
    """Follow all of the MEETING in places [first, last)."""
    for place in range(first, last):
        i = near.order[place]
        if i >= 0 and w.what[FOLLOWED, i] == MEETING:
            w.what[FOLLOWED, i] = 1
