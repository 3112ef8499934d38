"""Impacts of hard grains on each other to which emitters react: of every particle the first in a step.

An impact is an approach that rebounds: faster than what forces bring about in two steps. One that is found at the end of a
step was where both touched, to which they are followed back along their velocities; others have their own time (`swift`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import LEAST
from particlesim.engine.interactions.hard.bench import COUNT
from particlesim.engine.interactions.interaction import Ints, Site
from particlesim.engine.interactions.touching import line_between
from particlesim.scenario.reach import codes_of_groups


class Overheard(NamedTuple):
    """What emitters hear: codes by the group of a particle and that of the other one, as `reach.codes_of_groups` has them
    [groups, groups]; the group and the id of each particle [n]."""

    code: Ints
    owner: Ints
    id: Ints


def overheard_of(site: Site, names: Sequence[str]) -> Overheard | None:
    """What emitters hear of the contact of some groups; None if nothing."""
    every = tuple(site.state)
    code = codes_of_groups(site.scenario, every, every)
    mine = np.array([name in names for name in every])
    code[~np.logical_and.outer(mine, mine)] = -1
    if (code == -1).all():
        return None
    sizes = [state.count for state in site.state.values()]
    owner = np.repeat(np.arange(len(every)), sizes)
    return Overheard(code, owner, site.whole.id[: site.whole.count].copy())


@outlined
def tell_of(heard: Any, c: Any, i: Any, j: Any, x: Any, n: Any, speed: Any, v: Any, t: Any) -> None:
    """Write the impact of particle i at x, with its velocity v before, on particle j down, unless one was before it in the
    step; n: from j to i."""
    rows, code = c.hit, heard.code[heard.owner[i], heard.owner[j]]
    if code < -1 and not rows[2][i] > 0:
        rows[0][i], rows[1][i], rows[2][i] = t, code, speed
        rows[3][i], rows[4][i], rows[5][i] = x[0], x[1], x[2]
        rows[6][i], rows[7][i], rows[8][i] = n[0], n[1], n[2]
        rows[9][i], rows[10][i], rows[11][i] = v[0], v[1], v[2]
        rows[12][i] = heard.id[j]


def tell_both(
    heard: Any, c: Any, i: Any, j: Any, x: Any, y: Any, n: Any, speed: Any, v: Any, u: Any, t: Any
) -> None:
    """The impact of particles i at x and j at y, with velocities v and u, at time t."""
    tell_of(heard, c, i, j, x, n, speed, v, t)
    tell_of(heard, c, j, i, y, (-n[0], -n[1], -n[2]), speed, u, t)


@outlined
def overhear(each: Any, table: Any, c: Any, t: Any, h: Any) -> None:
    """Tell the impacts among the pairs of a table that touch at the end t of a step of h, before they have their impulses;
    from which speed on one rebounds is known."""
    bench = each.bench
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        v, u = (
            (float(c.vx[i]), float(c.vy[i]), float(c.vz[i])),
            (
                float(c.vx[j]),
                float(c.vy[j]),
                float(c.vz[j]),
            ),
        )
        x, y, z, far = (float(number) for number in line_between(c, i, j, bench.shift, k))
        w = (v[0] - u[0], v[1] - u[1], v[2] - u[2])
        closes = -(w[0] * x + w[1] * y + w[2] * z)
        overlap = float(c.r[i]) + float(c.r[j]) - far
        mine = bench.table[k] == table.rank
        if mine and overlap >= 0 and closes > bench.normal[LEAST, k]:
            back = min(overlap / closes, float(h))
            d = (far * x - back * w[0], far * y - back * w[1], far * z - back * w[2])
            size = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            if size > 0:
                n = (d[0] / size, d[1] / size, d[2] / size)
                speed = -(w[0] * n[0] + w[1] * n[1] + w[2] * n[2])
                at = (c.x[i] - back * v[0], c.y[i] - back * v[1], c.z[i] - back * v[2])
                other = (c.x[j] - back * u[0], c.y[j] - back * u[1], c.z[j] - back * u[2])
                tell_both(table.heard, c, i, j, at, other, n, speed, v, u, t - back)
