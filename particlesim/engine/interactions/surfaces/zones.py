"""The last resort: particles whose contacts no impulses could keep apart move as one for a step.

Pairs that would still come too close make zones. All particles of a zone get the mean displacement and the mean velocity of
the zone, weighted by mass, so that momentum is kept and no energy is gained; a zone with a particle that no force moves
takes the displacement and velocity of that particle. Particles of one zone come no closer to each other; zones that meet
become one, until no pair is too close.

Source: X. Provot, Collision and self-collision handling in cloth model dedicated to design garments (1997); R. Bridson, R.
Fedkiw, J. Anderson, ACM Trans. Graph. 21, 594 (2002), section 7.5, where zones rotate, too.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import shared
from particlesim.engine.interactions.surfaces.record import CONTACTS, ZONED

MASS, HELD = 6, 7
"""Rows of `Desk.sums` after those of displacement and velocity: mass, and the row of a particle that nothing moves, + 1."""
LEANS = 8
"""The mark of a particle whose zone goes with a collider."""
ALONE = -1
"""The zone of a particle that is in none."""


def root_of(zone: Any, i: Any) -> Any:
    """The particle that stands for the zone of particle i."""
    while zone[i] != i:
        zone[i] = zone[zone[i]]
        i = zone[i]
    return i


@shared
def no_zones(s: Any, desk: Any) -> None:
    """Every particle is in no zone."""
    for j in range(s.rows.size):
        desk.zone[s.rows[j]] = ALONE


@shared
def join(touches: Any, desk: Any, first: Any, last: Any) -> None:
    """Make one zone of the rows of each of contacts [first, last), with the zones that they are in."""
    zone = desk.zone
    for n in range(first, last):
        for corner in range(4):
            i = touches.rows[corner, n]
            if zone[i] == ALONE:
                zone[i] = i
        one = root_of(zone, touches.rows[0, n])
        for corner in range(1, 4):
            other = root_of(zone, touches.rows[corner, n])
            low, high = min(one, other), max(one, other)
            zone[high] = low
            one = low


@shared
def stand(desk: Any, i: Any, way: Any, speed: Any) -> None:
    """Give the zone of particle i, if it is in one, a displacement [m] and a velocity [m/s]: those of a collider."""
    if desk.zone[i] != ALONE:
        at = root_of(desk.zone, i)
        for k in range(3):
            desk.sums[k, at], desk.sums[3 + k, at] = way[k], speed[k]
        desk.sums[HELD, at] = -1.0


@shared
def stand_on(touches: Any, desk: Any, report: Any, first: Any, s: Any, x: Any, v: Any, before: Any) -> None:
    """Zones of contacts with colliders, from number `first` on, go with these, and so do those that have before."""
    for j in range(s.rows.size):
        i = s.rows[j]
        if (desk.mark[i] & LEANS) != 0:
            a, b, c = (float(x[k][i]) - float(before[k, i]) for k in range(3))
            stand(desk, i, (a, b, c), (float(v[0][i]), float(v[1][i]), float(v[2][i])))
    for n in range(first, report[CONTACTS]):
        i = touches.rows[0, n]
        if (desk.mark[i] & LEANS) == 0:
            way = touches.carried[0, n], touches.carried[1, n], touches.carried[2, n]
            stand(desk, i, way, (touches.drift[0, n], touches.drift[1, n], touches.drift[2, n]))
            desk.mark[i] |= LEANS


@shared
def leaning(touches: Any, desk: Any, report: Any, first: Any) -> Any:
    """Whether all contacts with colliders, from number `first` on, are within zones that go with colliders already."""
    found = joined(touches, desk, report, first)
    for n in range(first, report[CONTACTS]):
        found &= (desk.mark[touches.rows[0, n]] & LEANS) != 0
    return found


@shared
def sum_zones(s: Any, desk: Any, x: Any, v: Any, m: Any, before: Any) -> None:
    """Sums over the particles of each zone."""
    zone, sums = desk.zone, desk.sums
    for j in range(s.rows.size):
        i = s.rows[j]
        for k in range(8):
            sums[k, i] = 0.0
    for j in range(s.rows.size):
        i = s.rows[j]
        if zone[i] != ALONE:
            at, mass = root_of(zone, i), float(m[i])
            if desk.inverse[i] > 0:
                for k in range(3):
                    sums[k, at] += mass * (float(x[k][i]) - float(before[k, i]))
                    sums[3 + k, at] += mass * float(v[k][i])
                sums[MASS, at] += mass
            elif sums[HELD, at] == 0:
                sums[HELD, at] = float(i + 1)


@shared
def move_zones(s: Any, desk: Any, report: Any, x: Any, v: Any, before: Any) -> None:
    """Give the particles of each zone the displacement and velocity of the zone."""
    zone, sums = desk.zone, desk.sums
    for j in range(s.rows.size):
        i = s.rows[j]
        if (zone[i] != ALONE) & (desk.inverse[i] > 0):
            at = root_of(zone, i)
            held, by = sums[HELD, at], 1.0 / sums[MASS, at]
            kind = type(x[0][i])
            for k in range(3):
                way, speed = by * sums[k, at], by * sums[3 + k, at]
                if held > 0:
                    row = int(held) - 1
                    way, speed = float(x[k][row]) - float(before[k, row]), float(v[k][row])
                elif held < 0:
                    way, speed = sums[k, at], sums[3 + k, at]
                x[k][i] = kind(float(before[k, i]) + way)
                v[k][i] = kind(speed)
            report[ZONED] += 1
            desk.mark[i] |= 1


@shared
def joined(touches: Any, desk: Any, report: Any, first: Any) -> Any:
    """Whether all contacts from number `first` on are within zones that there are already."""
    for n in range(first, report[CONTACTS]):
        one = -2
        for corner in range(4):
            i = touches.rows[corner, n]
            at = ALONE if desk.zone[i] == ALONE else root_of(desk.zone, i)
            if (at == ALONE) | ((one != -2) & (one != at)):
                return False
            one = at
    return True
