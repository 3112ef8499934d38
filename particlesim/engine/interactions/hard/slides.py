"""Hard grains that slide along bent walls, and what turns of them do to the impulses of a step."""

from __future__ import annotations

from typing import Any

from particlesim.colliders.response import put_back
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import BENDS, PAIRED, SWERVED, WAY
from particlesim.engine.interactions.hard.turns import MIDDLE
from particlesim.engine.interactions.hard.walls import FLAT, along_side, colliders_of, whole
from particlesim.engine.state.columns import fetch, let_know, type_of
from particlesim.laws.registry import gap_and_normal, moved_to


def slide_on(each: Any, parts: Any, c: Any, before: Any, t: Any, h: Any) -> None:
    """What slides along a bent wall goes on along it after the impulses of the step: it turns these, too."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            if not isinstance(collider.shape, FLAT):
                slide_on_wall(each, collider, c, before, begin, each.bench.ends[k], t, h)
            begin = each.bench.ends[k]
            k += 1


@outlined
def slide_on_wall(
    each: Any, collider: Any, c: Any, before: Any, begin: Any, end: Any, t: Any, h: Any
) -> None:
    """`slide_on` for particles [begin, end) of the list: again from where impulses act, as fast as they leave it."""
    w, s = each.bench.wall_normal, each.bench.start
    for q in range(begin, end):
        i = each.bench.wall[q]
        if (w[BENDS, q] > 0) & (each.bench.mark[i] == PAIRED):
            v, way, size = (float(c.vx[i]), float(c.vy[i]), float(c.vz[i])), s[WAY, i], 0.0
            for axis in range(3):
                size += abs(v[axis] - s[axis, i])
            if (size > 0) & (way == MIDDLE + each.ways.late[0]):
                u = tuple(v[axis] - way * s[SWERVED + axis, i] for axis in range(3))
                n = (float(w[0, q]), float(w[1, q]), float(w[2, q]))
                if way < 1:
                    x, y, z = (
                        float(a[i]) - h * way * (v[axis] - 0.5 * way * s[SWERVED + axis, i])
                        for axis, a in enumerate((c.x, c.y, c.z))
                    )
                else:
                    x, y, z = float(before[0, i]), float(before[1, i]), float(before[2, i])
                p, by = fetch(c, i, t), h * way
                like = p.x
                p = moved_to(
                    p,
                    type_of(like, x + by * u[0]),
                    type_of(like, y + by * u[1]),
                    type_of(like, z + by * u[2]),
                    p.vx,
                    p.vy,
                    p.vz,
                    t,
                )
                g, m = gap_and_normal(collider.shape, p)
                place = (p.x, p.y, p.z)
                if g < 0:
                    m = whole(m, g)
                    place = put_back(collider.shape, p, g, m)
                    up = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
                    flat = (u[0] - up * n[0], u[1] - up * n[1], u[2] - up * n[2])
                    m = (float(m[0]), float(m[1]), float(m[2]))
                    u = along_side(flat, m, m)
                c.x[i], c.y[i], c.z[i] = place
                c.vx[i], c.vy[i], c.vz[i] = type_of(like, u[0]), type_of(like, u[1]), type_of(like, u[2])
                let_know(c.memory, i, u[0] - v[0], u[1] - v[1], u[2] - v[2])
