"""The broad phase: pairs of bodies, colliders and particles that may touch in a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import spin_of
from particlesim.compiler import outlined
from particlesim.engine.rigid.grains import find_guests
from particlesim.engine.rigid.narrow import touch
from particlesim.engine.rigid.oncoming import WATCHED, leave_to_drifts
from particlesim.engine.rigid.rolling import find_rolling
from particlesim.engine.rigid.stops import find_stops
from particlesim.engine.rigid.support import find_support
from particlesim.engine.rigid.walls import touch_wall

NEAR = 0.1
"""Contacts that swift bodies have in the middle of a step are as near, in units of their inner radius: what is farther they
meet in a drift. If they were kept from all that they may reach, they could not rebound from one into another."""


def are_joined(scene: Any, i: Any, j: Any) -> bool:
    """Whether a joint holds two bodies together that do not touch each other."""
    found = False
    if scene.joints is not None:
        for at in range(scene.partner_from[i], scene.partner_from[i + 1]):
            found = found or scene.partners[at] == j
    return found


@outlined
def find_contacts(scene: Any, b: Any, k: Any, motion: Any, memory: Any, t: Any, h: Any) -> None:
    """All contacts of bodies, colliders and particles that a step may meet in its middle."""
    look_around(scene, b, k, motion, memory, t, h)
    if scene.joints is not None:
        find_stops(scene.stops, scene.joints, b, k, motion, h)
    if scene.guests is not None:
        joined = None if scene.joints is None else scene.joined
        find_guests(scene.guests, joined, b, k, motion, scene.slop, t, h)
        find_support(scene.guests, b, k, t, h, scene.joints)


@outlined
def look_around(scene: Any, b: Any, k: Any, motion: Any, memory: Any, t: Any, h: Any) -> None:
    """Contacts of bodies and colliders; those that drifts are to meet are left to them.

    Bodies are sorted along x by where they begin, which changes little from step to step, and into strips across z that
    are as wide as the largest of them: those of one strip or of neighbours whose balls overlap are looked at.
    """
    n = b.w.size if scene.guests is None else scene.guests.first
    order, margin = memory.order, motion.margin
    k.number[0] = k.number[1] = 0
    for i in range(n):
        m = motion.now[i]
        speed = np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
        turning = np.sqrt(m[3] * m[3] + m[4] * m[4] + m[5] * m[5])
        way = h * (speed + turning * b.reach[i])
        if scene.swift.watch[i] == WATCHED and (scene.joints is None or scene.joined[i] == 0):
            way = min(way, NEAR * scene.swift.inner[i])
        margin[i] = way + 2 * scene.slop
    for wall in scene.walls:
        for i in range(n):
            if wall.on[b.group[i]] > 0:
                first = k.number[0]
                touch_wall(scene, wall, b, k, i, margin[i], t, h)
                if scene.surfaces.rolling is not None:
                    find_rolling(scene.surfaces.rolling, b, k, first, spin_of(wall.shape))
    for s in range(1, n):
        i, at = order[s], s
        begin = b.x[0, i] - b.reach[i] - margin[i]
        while at > 0 and starts_after(b, margin, order[at - 1], begin, i):
            order[at] = order[at - 1]
            at -= 1
        order[at] = i
    find_pairs(scene, b, k, motion, order, n)
    leave_to_drifts(scene, b, k, motion, t, h)


def begins(b: Any, margin: Any, i: Any) -> Any:
    """Where a body begins along x."""
    return b.x[0, i] - b.reach[i] - margin[i]


def ends(b: Any, margin: Any, i: Any) -> Any:
    """Where it ends."""
    return b.x[0, i] + b.reach[i] + margin[i]


def meet(scene: Any, b: Any, k: Any, margin: Any, i: Any, j: Any) -> None:
    """Look for contacts of two bodies if their balls overlap."""
    if scene.surfaces.touch[b.group[i], b.group[j]] > 0:
        dx, dy, dz = b.x[0, i] - b.x[0, j], b.x[1, i] - b.x[1, j], b.x[2, i] - b.x[2, j]
        near = b.reach[i] + b.reach[j] + margin[i] + margin[j]
        if dx * dx + dy * dy + dz * dz < near * near and not are_joined(scene, i, j):
            first = k.number[0]
            touch(b, k, scene.surfaces, min(i, j), max(i, j), margin[i] + margin[j])
            if scene.surfaces.rolling is not None:
                find_rolling(scene.surfaces.rolling, b, k, first, (0.0, 0.0, 0.0))


@outlined
def find_pairs(scene: Any, b: Any, k: Any, motion: Any, order: Any, n: Any) -> None:
    """Look at all pairs of bodies that may touch; `order` is that along x. Arrays of clusters serve for strips."""
    margin, strip, listed, begin = motion.margin, motion.cluster, motion.bodies, motion.body_from
    low, high, widest = np.inf, -np.inf, 0.0
    for i in range(n):
        low, high = min(low, b.x[2, i]), max(high, b.x[2, i])
        widest = max(widest, b.reach[i] + margin[i])
    width = max(
        2.000001 * widest, (high - low) / n
    )  # neighbours are in strips side by side, also after rounding
    parts = (high - low) / width
    number = int(parts) + 1 if parts < n - 1 else n
    for s in range(number + 1):
        begin[s] = 0
    for i in range(n):
        part = (b.x[2, i] - low) / width
        strip[i] = min(int(part), number - 1) if part >= 0 and part < n else 0
        begin[strip[i]] += 1
    for s in range(1, number):
        begin[s] += begin[s - 1]
    begin[number] = n
    for back in range(n):
        i = order[n - 1 - back]
        begin[strip[i]] -= 1
        listed[begin[strip[i]]] = i
    for s in range(number):
        for at in range(begin[s], begin[s + 1]):
            i, other = listed[at], at + 1
            while other < begin[s + 1] and begins(b, margin, listed[other]) <= ends(b, margin, i):
                meet(scene, b, k, margin, i, listed[other])
                other += 1
        if s + 1 < number:
            across(scene, b, k, motion, s, s + 1, True)
            across(scene, b, k, motion, s + 1, s, False)


@outlined
def across(scene: Any, b: Any, k: Any, motion: Any, s: Any, o: Any, together: Any) -> None:
    """Look at bodies of strip s and those of strip o that begin while they last, or `together` with them."""
    margin, listed, begin = motion.margin, motion.bodies, motion.body_from
    near = begin[o]
    for at in range(begin[s], begin[s + 1]):
        i = listed[at]
        mine = begins(b, margin, i)
        while near < begin[o + 1] and (
            begins(b, margin, listed[near]) < mine
            or (not together and begins(b, margin, listed[near]) == mine)
        ):
            near += 1
        other = near
        while other < begin[o + 1] and begins(b, margin, listed[other]) <= ends(b, margin, i):
            meet(scene, b, k, margin, i, listed[other])
            other += 1


def starts_after(b: Any, margin: Any, j: Any, begin: Any, i: Any) -> bool:
    """Whether body j begins, along x, after a place; of equal ones the one with the higher number."""
    mine = b.x[0, j] - b.reach[j] - margin[j]
    return mine > begin or (mine == begin and j > i)
