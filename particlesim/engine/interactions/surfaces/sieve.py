"""Which candidates can meet in a step. Two numbers of each pair rule out most; the others are measured.

A pair with the gap g between its surfaces at the beginning of step n₀, which narrows by u at most in that step, narrows by
u + Σ 2a_j at most in a later step n. Here a_j bounds the change of any particle's displacement from step j − 1 to step j,
without the change that all particles have in common. With C the sum of 2a_j up to the present step, W the sum of C over the
steps before it, both since candidates were found, and C₀ and W₀ their values in step n₀, the pair cannot have met while

    W + C + n β ≤ g + W₀ + (n₀ − 1) β,   β = u − C₀.

So a pair keeps two numbers, which are compared with two that are the same for all pairs. Only where that does not decide are
g and u measured again, many pairs at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.interactions.surfaces.closest import Four, closest, relative_motion, widest
from particlesim.engine.interactions.surfaces.record import AGE, COURSE, HORIZON, SKIN, WAY

AT_ONCE = 64
"""Pairs that are looked at together."""


def gap_and_motion(face: Any, pairs: Any, q: Any, x: Any, r: Any, before: Any) -> Any:
    """How far pair q is from touching at the beginning of the step, and by how much that may change in it [m]."""
    f = Four(pairs.rows[0, q], pairs.rows[1, q], pairs.rows[2, q], pairs.rows[3, q])
    gap = closest(face, x, before, f, 0.0).distance - widest(face, r, f)
    return gap, relative_motion(face, x, before, f)


def choose_due(pairs: Any, number: Any, bar: Any, age: Any) -> Any:
    """Write down which of the first pairs may have met, as far as their numbers tell; returns how many."""
    due = 0
    for first in range(0, number, AT_ONCE):
        last = min(first + AT_ONCE, number)
        some = 0
        for q in range(first, last):
            some += 1 if bar + age * pairs.slope[q] > pairs.until[q] else 0
        if some > 0:
            for q in range(first, last):
                if bar + age * pairs.slope[q] > pairs.until[q]:
                    pairs.due[due] = q
                    due += 1
    return due


def sift(
    face: Any, pairs: Any, number: Any, x: Any, r: Any, before: Any, report: Any, tune: Any, slack: Any
) -> Any:
    """Write down which of the first pairs may come nearer to each other in the step than they are thick, less `slack` [m];
    returns how many."""
    age = float(report[AGE])
    due = choose_due(pairs, number, tune[WAY] + tune[COURSE] - slack, age)
    room, kept = on_stack(2, AT_ONCE, np.float64), 0
    for first in range(0, due, AT_ONCE):
        size = min(AT_ONCE, due - first)
        for k in range(size):
            room[0, k], room[1, k] = gap_and_motion(face, pairs, pairs.due[first + k], x, r, before)
        for k in range(size):
            q, gap, motion = pairs.due[first + k], room[0, k], room[1, k]
            note(pairs, q, gap, motion, report, tune)
            if gap - motion < -slack:
                pairs.due[kept] = q
                kept += 1
    return kept


def note(pairs: Any, q: Any, gap: Any, motion: Any, report: Any, tune: Any) -> None:
    """Remember how far pair q was from touching in the present step, and by how much that may change."""
    pairs.slope[q] = motion - tune[COURSE]
    pairs.until[q] = gap + tune[WAY] + (float(report[AGE]) - 1.0) * pairs.slope[q]


@outlined
def choose_near(
    face: Any, pairs: Any, kept: Any, number: Any, x: Any, r: Any, before: Any, report: Any, tune: Any
) -> Any:
    """Keep those of pairs [kept, number) that may meet while candidates hold, behind those that have been kept before;
    returns how many there are then. No more than `AT_ONCE` at a time."""
    room = on_stack(2, AT_ONCE, np.float64)
    for k in range(number - kept):
        room[0, k], room[1, k] = gap_and_motion(face, pairs, kept + k, x, r, before)
    end = kept
    for k in range(number - kept):
        gap, motion, q = room[0, k], room[1, k], kept + k
        if gap - (1.0 + tune[HORIZON]) * motion <= 2.0 * tune[SKIN]:
            for side in range(2):
                pairs.of[side, end] = pairs.of[side, q]
            for corner in range(4):
                pairs.rows[corner, end] = pairs.rows[corner, q]
            note(pairs, end, gap, motion, report, tune)
            end += 1
    return end
