"""Impulses of the last step, with which the next one begins: those of contacts that are there again, found by a hash of the
two bodies and the place on them."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import NOBODY, Memory, new_memory, row
from particlesim.engine.rigid.contact_rows import bounded, strike
from particlesim.engine.rigid.stops import LIMIT, MOTOR, ROLL


def address(memory: Any, i: Any, j: Any, feature: Any) -> int:
    """Where a contact is in the memory, or the free place for it."""
    mask = memory.keys.shape[1] - 1
    at = (i * 73856093 + j * 19349663 + feature * 83492791) & mask
    while memory.keys[0, at] != NOBODY and not (
        memory.keys[0, at] == i and memory.keys[1, at] == j and memory.keys[2, at] == feature
    ):
        at = (at + 1) & mask
    return int(at)


@outlined
def recall(b: Any, k: Any, motion: Any, memory: Any) -> None:
    """Begin with the impulses of the last step. What had one goes on touching, and does not hit."""
    for c in range(k.number[0]):
        at = address(memory, k.names[0, c], k.names[1, c], k.feature[c])
        if memory.keys[0, at] != NOBODY:
            p = row(memory.impulse, at)
            e = k.rows[c]
            if k.turns[c] == LIMIT or k.turns[c] == MOTOR:
                k.impulse[c, 0] = bounded(k, c, p[0])
                strike(b, k, motion, c, 0, k.impulse[c, 0])
                continue
            k.struck[c] = 0.0
            rolls = k.turns[c] == ROLL
            press = max(p[0] * e[0, 0] + p[1] * e[0, 1] + p[2] * e[0, 2], 0.0)
            start, most = (3, k.impulse[int(k.aim[0, c]), 0]) if rolls else (0, press)
            one = p[0] * e[1, start] + p[1] * e[1, start + 1] + p[2] * e[1, start + 2]
            two = p[0] * e[2, start] + p[1] * e[2, start + 1] + p[2] * e[2, start + 2]
            size = np.sqrt(one * one + two * two)
            part = k.surface[1, c] * most / size if size > k.surface[1, c] * most else 1.0
            k.impulse[c, 0], k.impulse[c, 1], k.impulse[c, 2] = press, part * one, part * two
            for d in range(3):
                strike(b, k, motion, c, d, k.impulse[c, d])


def forget(memory: Any) -> None:
    """Nothing touched in this step."""
    for at in range(memory.keys.shape[1]):
        memory.keys[0, at] = NOBODY


@outlined
def remember(k: Any, memory: Any) -> None:
    """Keep the impulses for the next step."""
    forget(memory)
    for c in range(k.number[0]):
        if k.impulse[c, 0] > 0 or k.turns[c] > 0:
            one, two = k.names[0, c], k.names[1, c]
            at = address(memory, one, two, k.feature[c])
            memory.keys[0, at], memory.keys[1, at], memory.keys[2, at] = one, two, k.feature[c]
            start, scale = 0, 1.0
            if k.turns[c] == ROLL:
                start, scale = 3, (1 / k.aim[1, c] ** 2 if k.aim[1, c] > 0 else 0.0)
            for axis in range(3):
                total = 0.0
                for d in range(3):
                    total += k.rows[c, d, start + axis] * k.impulse[c, d]
                turns = k.turns[c] == LIMIT or k.turns[c] == MOTOR
                memory.impulse[axis, at] = k.impulse[c, 0] if turns else scale * total


def copy_of(memory: Memory) -> Memory:
    """A memory of its own."""
    return Memory(*(array.copy() for array in memory))


def larger(memory: Memory, contacts: int) -> Memory:
    """A memory with room for more contacts, and the same impulses in it."""
    found = new_memory(max(contacts, memory.keys.shape[1] // 2), len(memory.order))
    found.order[:] = memory.order
    for old in np.flatnonzero(memory.keys[0] != NOBODY).tolist():
        at = address(found, *(int(key) for key in memory.keys[:, old]))
        found.keys[:, at] = memory.keys[:, old]
        found.impulse[:, at] = memory.impulse[:, old]
    return found
