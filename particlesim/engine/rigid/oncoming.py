"""Impacts to come within a step that nothing else takes part in: drifts meet them, at their own time and place (`swift`).

Impulses in the middle of a step take the normal that there is then, ahead of the impact. That turns the way of what hits an
edge or a ball by up to the way of a step over the radius, and of what passes it, too; and several of them at once may take
energy where e = 1. Bodies that touch nothing may as well meet in drifts, one by one. So may balls on flat ground, as
billiard balls, where an impact is along the ground.

A contact is left to drifts unless it closes in the step no faster than what comes to rest there does, if all bodies that it
joins with others near to them have no joint, are `CROWD` at most where they rebound well, else one or two that come together
or to colliders, have no rolling friction there, and each is

- free: farther from all else than `TOUCHING` of its inner radius, or
- a ball whose contacts all press along one direction, across that of its impacts to `ACROSS`.

In a heap, where that is rare, an impact would have to be passed on from body to body, again and again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.acting import sum_all_forces
from particlesim.engine.rigid.bodies import WORLD, place, row
from particlesim.engine.rigid.clusters import root, unite
from particlesim.engine.rigid.contact_rows import direct, speed_along
from particlesim.engine.rigid.narrow import minus
from particlesim.engine.rigid.rotation import dot
from particlesim.engine.rigid.stops import ROLL
from particlesim.engine.rigid.timing import RESTING, kick_along

TOUCHING = 1e-4
"""Gap up to which bodies touch, and at which swift ones have an impact, in units of the inner radius. What closes by less in
a drift is left to the solver."""
ACROSS = 1e-2
"""Cosine of the angle between the normals of an impact and of the ground, below which the ground takes no part in it."""
WATCHED = 2
"""Drifts for which what is left to them, or was swift, is looked at."""
CROWD, LIVELY = 64, 0.5
"""Bodies near to each other that meet in drifts, and from which restitution on they do: others come together by so many
impacts that the solver does better."""
ELSE, FLIES, LEFT = 0, 1, 2
"""Whether impacts of bodies are left to drifts: they are not; those that come from others that are, and are lively; all."""
DULL, ASIDE = 3, 4
"""Columns of `other`: after the direction of the ground."""
FREE, ROLLS, HELD = 0.0, 1.0, 2.0
"""What a body touches: nothing; all contacts of a ball press along one direction; more, or it has a joint, or particles are
near."""


@outlined
def leave_to_drifts(scene: Any, b: Any, k: Any, motion: Any, t: Any, h: Any) -> None:
    """Take away the contacts that the next drifts meet, and have their bodies looked at there."""
    if k.number[1] > 0:  # there is no room for some: they are looked for again
        return
    found = find_closing(scene, b, k, motion, t, h)
    note_ground(scene, b, k, motion)
    if scene.guests is not None:
        note_guests(scene.guests, b, motion, scene.slop, h)
    for i in range(scene.swift.alone.size):
        scene.swift.alone[i] = FLIES if motion.low[i] == FREE and b.w[i] > 0 else ELSE
    if not found:
        return
    find_crowds(b, k, motion)
    left, moved, kept = False, k.order, 0
    for c in range(k.number[0]):
        if k.target[c] > 0:
            free = may_drift(motion, motion.parent[k.first[c] if b.w[k.first[c]] > 0 else k.second[c]])
            k.target[c], left = 1.0 if free else 0.0, left or free
    for c in range(k.number[0] if left else 0):
        rolls = k.turns[c] == ROLL
        own = int(k.aim[0, c]) if rolls else c  # the contact that presses
        if k.target[own] > 0:
            leave(scene.swift, k.first[c])
            if k.second[c] != WORLD:
                leave(scene.swift, k.second[c])
        else:
            moved[c] = kept
            move_contact(k, c, kept)
            if rolls:
                k.aim[0, kept] = moved[own]
            kept += 1
    if left:
        k.number[0] = kept


def leave(s: Any, i: Any) -> None:
    """Body i is looked at in the next drifts."""
    s.watch[i], s.alone[i] = WATCHED, LEFT


def are_left(scene: Any, b: Any, i: Any, j: Any) -> bool:
    """Whether impacts of bodies i and j, or of i and a collider, are left to these drifts."""
    one = scene.swift.alone[i]
    if j == WORLD:
        return bool(one != ELSE)
    two, e = scene.swift.alone[j], scene.surfaces.restitution[b.group[i], b.group[j]]
    return bool((one == LEFT and two == LEFT) or (one != ELSE and two != ELSE and e >= LIVELY))


@outlined
def find_closing(scene: Any, b: Any, k: Any, motion: Any, t: Any, h: Any) -> bool:
    """Mark contacts that close in the step as impacts by a `target` of 1, those that may by the way of other places or by a
    turn, and others by 0, and where bodies come to rest by −1; whether there are impacts."""
    found = False
    for c in range(k.number[0]):
        i, j = k.first[c], k.second[c]
        moves = b.w[i] > 0 or (j != WORLD and b.w[j] > 0)
        k.target[c] = 1.0 if moves and k.turns[c] == 0 and k.gap[c] > 0 else 0.0
        found = found or k.target[c] > 0
    if not found:
        return False
    sum_all_forces(scene, b, motion, t)
    found = False
    for c in range(k.number[0]):
        if k.target[c] > 0:
            k.target[c] = closes(scene, b, k, motion, c, h)
            found = found or k.target[c] > 0
    return found


def closes(scene: Any, b: Any, k: Any, motion: Any, c: Any, h: Any) -> float:
    """The mark of a contact with a gap (`find_closing`)."""
    i, j = k.first[c], k.second[c]
    direct(b, k, motion, c, 0, i, j, row(k.point, c), row(k.normal, c))
    one, two = kick_along(b, k, motion, c, False, h), 0.0
    if j != WORLD:
        two = kick_along(b, k, motion, c, True, h)
    u, slow = speed_along(k, motion, c, 0) + k.bend[c], RESTING * (abs(one) + abs(two))
    if -(u + one - two) * h > k.gap[c]:
        return 1.0 if -u > slow else -1.0
    # Two balls that do not close go apart.
    may = j == WORLD or scene.swift.lever[i] > 0 or scene.swift.lever[j] > 0
    return 1.0 if may and k.gap[c] > TOUCHING * inner(scene.swift, i, j) else 0.0


def inner(s: Any, i: Any, j: Any) -> Any:
    """The inner radius of body i, or the smaller one of two [m]."""
    return s.inner[i] if j == WORLD else min(s.inner[i], s.inner[j])


def is_joined(scene: Any, i: Any) -> bool:
    """Whether a joint holds body i."""
    return bool(i != WORLD and scene.joints is not None and scene.joined[i] > 0)


@outlined
def note_ground(scene: Any, b: Any, k: Any, motion: Any) -> None:
    """What each body touches, into `low`, and the direction of what a ball lies on, into `other`."""
    for i in range(b.w.size):
        motion.low[i] = HELD if is_joined(scene, i) else FREE
    for c in range(k.number[0]):
        i, j, s = k.first[c], k.second[c], scene.swift
        lies = k.target[c] < 0 or (k.target[c] == 0 and k.gap[c] <= TOUCHING * inner(s, i, j))
        if k.turns[c] == 0 and lies:
            lie(s, motion, i, row(k.normal, c))
            if j != WORLD:
                lie(s, motion, j, row(k.normal, c))
        if k.turns[c] == ROLL and k.target[int(k.aim[0, c])] > 0:  # drifts know of no rolling friction
            motion.low[i] = HELD
            if j != WORLD:
                motion.low[j] = HELD


def lie(s: Any, motion: Any, i: Any, n: Any) -> None:
    """Body i touches something in a direction n."""
    ground = motion.other[i]
    same = motion.low[i] == FREE or abs(dot(n, (ground[0], ground[1], ground[2]))) > 1 - ACROSS * ACROSS
    if s.lever[i] > 0 or not same:
        motion.low[i] = HELD
    elif motion.low[i] == FREE:
        motion.low[i] = ROLLS
        for axis in range(3):
            ground[axis] = n[0] if axis == 0 else (n[1] if axis == 1 else n[2])


@outlined
def note_guests(guests: Any, b: Any, motion: Any, slop: Any, h: Any) -> None:
    """Note which bodies particles may touch in a step of length h: those are not free."""
    for i in range(guests.first):
        group = b.group[i]
        for m in range(guests.radius.size if motion.low[i] != HELD else 0):
            if motion.low[i] != HELD and guests.touch[guests.kind[m], group] > 0:
                guest, now = guests.first + m, motion.now[i]
                d, other = minus(place(b, guest), place(b, i)), motion.now[guest]
                u = (other[0] - now[0], other[1] - now[1], other[2] - now[2])
                near = b.reach[i] + guests.radius[m] + h * np.sqrt(dot(u, u)) + slop
                motion.low[i] = HELD if dot(d, d) < near * near else motion.low[i]


@outlined
def find_crowds(b: Any, k: Any, motion: Any) -> None:
    """The body that stands for those near to each other, into `parent`; for it, how many they are, into `gain`, and how
    often something holds one of them in an impact, into `bend`; into `other`, impacts that are not lively, and those on
    colliders. What nothing moves joins nobody."""
    parent, size, held, other = motion.parent, motion.gain, motion.bend, motion.other
    for i in range(b.w.size):
        parent[i], size[i], held[i], other[i, DULL], other[i, ASIDE] = i, 0.0, 0.0, 0.0, 0.0
    for c in range(k.number[0]):
        i, j = k.first[c], k.second[c]
        if j != WORLD and b.w[i] > 0 and b.w[j] > 0:
            unite(parent, i, j)
    for i in range(b.w.size):
        parent[i] = root(parent, i)
        size[parent[i]] += 1
        held[parent[i]] += 1.0 if motion.low[i] == HELD and b.w[i] > 0 else 0.0
    for c in range(k.number[0]):
        if k.target[c] > 0:
            for each in range(2):
                i = k.second[c] if each > 0 else k.first[c]
                if i != WORLD and b.w[i] > 0:
                    j = k.first[c] if each > 0 else k.second[c]
                    held[parent[i]] += 1.0 if is_held(motion, i, row(k.normal, c)) else 0.0
                    other[parent[i], DULL] += 1.0 if k.surface[0, c] < LIVELY else 0.0
                    other[parent[i], ASIDE] += 1.0 if j == WORLD or b.w[j] == 0 else 0.0


def may_drift(motion: Any, crowd: Any) -> bool:
    """Whether the bodies for which one stands have their impacts in drifts."""
    size, of = motion.gain[crowd], motion.other[crowd]
    apart = size == 1 or (size == 2 and of[ASIDE] == 0)
    return bool(motion.bend[crowd] == 0 and size <= CROWD and (of[DULL] == 0 or apart))


def is_held(motion: Any, i: Any, n: Any) -> bool:
    """Whether what body i touches takes part in an impact along n."""
    ground = motion.other[i]
    along = abs(dot(n, (ground[0], ground[1], ground[2]))) >= ACROSS
    return bool(motion.low[i] == HELD or (motion.low[i] == ROLLS and along))


def move_contact(k: Any, c: Any, to: Any) -> None:
    """Contact c gets another number; what the search for contacts knows of it."""
    if c == to:
        return
    k.first[to], k.second[to], k.feature[to] = k.first[c], k.second[c], k.feature[c]
    k.names[0, to], k.names[1, to] = k.names[0, c], k.names[1, c]
    k.gap[to], k.turns[to], k.braced[to] = k.gap[c], k.turns[c], k.braced[c]
    k.swing[to], k.bend[to] = k.swing[c], k.bend[c]
    k.late[0, to], k.late[1, to] = k.late[0, c], k.late[1, c]
    k.aim[0, to], k.aim[1, to] = k.aim[0, c], k.aim[1, c]
    for axis in range(3):
        k.point[axis, to], k.normal[axis, to] = k.point[axis, c], k.normal[axis, c]
        k.surface[axis, to] = k.surface[axis, c]
        k.belt[axis, to], k.lead[axis, to] = k.belt[axis, c], k.lead[axis, c]
        k.slip[axis, to] = k.slip[axis, c]
    if k.falls is not None:
        for law in range(6):
            k.falls[law, to] = k.falls[law, c]
