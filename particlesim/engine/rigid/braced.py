"""Contacts of bodies in joints where the joints take nearly all that an impulse gives.

A door closes on a wall beside its hinge: what presses there acts on a lever ℓ that goes to zero, and the door gives way by
ℓ²/I, far less than a free body would. Sweeps that solve for joints after all contacts come nearer by that ratio only, turn
by turn. Here it is known: with J the rows of the joints and c that of a contact, a unit impulse changes its speed by

    c·M⁻¹c − (J M⁻¹c)·(J M⁻¹Jᵀ)⁻¹ (J M⁻¹c),

and joints are solved for after each impulse. Where nothing is left of it, within rounding, the contact cannot move and gets
no impulse.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD
from particlesim.engine.rigid.joints import component_of, forward, level

PART = 0.1
"""Part of the give of free bodies below which joints are solved for after each impulse."""
HELD = 1e-12
"""The part below which it counts as none."""
MOST_WORK = 1 << 20
"""Contacts of a cluster times the rows of its joints at most."""


@outlined
def brace(b: Any, k: Any, motion: Any, joints: Any, cluster: Any) -> bool:
    """Lay out what impulses do at the contacts of a cluster with its joints, where these take nearly all; whether there are
    any. Rows of joints are laid out and factorised."""
    first, last = motion.contact_from[cluster], motion.contact_from[cluster + 1]
    found = False
    if rows_of(motion, joints, cluster) * (last - first) > MOST_WORK:
        return found
    for at in range(first, last):
        c = k.order[at]
        left, least = (1.0, 1.0, 1.0), 1.0
        for d in range(3):
            part = part_left(b, k, joints, c, d)
            left = (part if d == 0 else left[0], part if d == 1 else left[1], part if d == 2 else left[2])
            least = min(least, part)
        if least < PART:
            found = True
            k.braced[c] = 1
            for d in range(3):
                part, give = left[0] if d == 0 else (left[1] if d == 1 else left[2]), free_give(b, k, c, d)
                if give > 0:  # what only turns bodies has fewer directions
                    k.rows[c, d, 15] = 1 / (give * max(part, HELD))
            if left[0] < HELD:
                k.target[c] = -np.inf
    return found


def rows_of(motion: Any, joints: Any, cluster: Any) -> int:
    """How many rows the joints of a cluster have."""
    rows, component = 0, motion.first_component[cluster]
    while component >= 0:
        rows += joints.row[joints.group[component + 1]] - joints.row[joints.group[component]]
        component = joints.next[component]
    return int(rows)


def free_give(b: Any, k: Any, c: Any, d: Any) -> Any:
    """By how much a unit impulse along a direction of a contact would change its speed without joints."""
    e, i, j = k.rows[c, d], k.first[c], k.second[c]
    along = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
    give = along * b.w[i] + e[3] * e[9] + e[4] * e[10] + e[5] * e[11]
    if j != WORLD:
        give += along * b.w[j] + e[6] * e[12] + e[7] * e[13] + e[8] * e[14]
    return give


@outlined
def part_left(b: Any, k: Any, joints: Any, c: Any, d: Any) -> float:
    """The part of that which joints leave; 1 where a contact has no such direction."""
    whole = free_give(b, k, c, d)
    if not whole > 0:
        return 1.0
    i, j, taken = k.first[c], k.second[c], 0.0
    one, two = component_of(joints, i), component_of(joints, j)
    for each in range(2):
        component = one if each == 0 else two
        if component >= 0 and (each == 0 or two != one):
            begin, end = joints.row[joints.group[component]], joints.row[joints.group[component + 1]]
            for g in range(joints.group[component], joints.group[component + 1]):
                for r in range(joints.row[g], joints.row[g + 1]):
                    joints.side[r] = along_joint(b, k, joints, c, d, g, r)
            forward(joints, begin, end)
            for r in range(begin, end):
                taken += joints.side[r] * joints.side[r] * joints.pivot[r]
    return float((whole - taken) / whole)


def along_joint(b: Any, k: Any, joints: Any, c: Any, d: Any, g: Any, r: Any) -> Any:
    """The speed along a row of joint g that a unit impulse along a direction of a contact gives."""
    total = 0.0
    for side in range(2):
        body = k.first[c] if side == 0 else k.second[c]
        if body != WORLD and joints.first[g] == body:
            total += response(b, k, joints, c, d, r, side, body, 3)
        if body != WORLD and joints.second[g] == body:
            total -= response(b, k, joints, c, d, r, side, body, 6)
    return total


def response(b: Any, k: Any, joints: Any, c: Any, d: Any, r: Any, side: Any, body: Any, arm: Any) -> Any:
    """That of one body, whose moments stand at `arm` in the row of the joint."""
    e, o, at = k.rows[c, d], joints.rows[r], 9 + 3 * side
    u = b.w[body] * (o[0] * e[0] + o[1] * e[1] + o[2] * e[2])
    u += o[arm] * e[at] + o[arm + 1] * e[at + 1] + o[arm + 2] * e[at + 2]
    return u if side == 0 else -u


@outlined
def level_there(b: Any, k: Any, joints: Any, now: Any, gained: Any, c: Any) -> None:
    """Take away what the bodies of a contact, and all that they are joined to, have along joints."""
    i, j = k.first[c], k.second[c]
    one, two = component_of(joints, i), component_of(joints, j)
    if one >= 0:
        level(joints, b, now, gained, one)
    if two >= 0 and two != one:
        level(joints, b, now, gained, two)
