"""Which two particles are where their force or energy has no finite value, for an error message."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particlesim.compiler import kernel
from particlesim.engine.interactions.near_pairs import NearPairs
from particlesim.engine.interactions.pair_blocks import energy_in, force_in
from particlesim.engine.interactions.pair_tensors import pair_between
from particlesim.engine.interactions.pairs import DirectPairs
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.laws.pair import pair_potential, square
from particlesim.laws.registry import has_law

MOST_LOOKED_AT = 200_000_000
"""Pairs that are looked at: a few seconds."""


@kernel
def wild_pair(each: Any, c: Any, t: Any, out: Any) -> bool:
    """Find the first pair of direct sums whose force, or energy, is no number; its rows into out [2]."""
    for k in range(len(each.spans)):
        for i in range(each.spans[k, 0], each.spans[k, 1]):
            for j in range(max(each.spans[k, 2], i + 1), each.spans[k, 3]):
                if is_wild(each, c, i, j, t):
                    out[0], out[1] = i, j
                    return True
    return False


@kernel
def wild_among(each: Any, c: Any, first: Any, second: Any, t: Any, out: Any) -> bool:
    """Find the first of listed pairs whose force, or energy, is no number; its rows into out [2]."""
    for q in range(first.size):
        if is_wild(each, c, first[q], second[q], t):
            out[0], out[1] = first[q], second[q]
            return True
    return False


def is_wild(each: Any, c: Any, i: Any, j: Any, t: Any) -> Any:
    """Whether the force or the energy of two particles is infinite, or no number."""
    p = pair_between(each, c, i, j, t)
    fx, fy, fz = force_in(each, p)
    drop = (fx - fx) + (fy - fy) + (fz - fz)
    if has_law(pair_potential, each.law):
        u = energy_in(each, p, True)
        drop += u - u
    return drop != 0


def refuse_wild(each: Any, name: str, states: Sequence[GroupState], c: Any, t: float) -> None:
    """Raise UsageError, which names both, for two particles whose force or energy is no number where they are."""
    out = np.zeros(2, np.int64)
    if isinstance(each, DirectPairs):
        found = each.number <= MOST_LOOKED_AT and wild_pair(each, c, t, out)
    elif isinstance(each, NearPairs):
        found = wild_among(each, c, *each.list_pairs(c), t, out)
    else:
        return
    if not found:
        return
    names = [
        f"particle {row - first} of {state.name!r}"
        for row in out
        for state, first in [_group_of(states, int(row))]
    ]
    p = pair_between(each, c, int(out[0]), int(out[1]), t)
    distance = float(np.sqrt(square(p)))
    raise UsageError(
        f"{name}: {names[0]} and {names[1]} are {distance:.4g} m apart, where the force or the energy of a pair is no "
        "finite number",
        "move them, soften the law, or look at its parameters",
    )


def _group_of(states: Sequence[GroupState], row: int) -> tuple[GroupState, int]:
    """The group of a row of an island, and the row of its first particle."""
    first = 0
    for state in states:
        if row < first + state.count:
            return state, first
        first += state.count
    raise IndexError(row)
