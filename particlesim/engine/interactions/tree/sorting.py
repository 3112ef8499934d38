"""Sorting by threads together: radix sort from the lowest digit (Knuth 5.2.5).

Each pass is stable, so equal keys keep the order of their particles, and the result does not depend on how many threads
there are. Passes in which all keys have the same digit move nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet

_BITS = 11
_DIGITS = 1 << _BITS
_PASSES = 6
"""Of 11 bits: keys of 63."""


class Keys(NamedTuple):
    """Keys and what they belong to, twice: passes go from one to the other."""

    key: NDArray[np.int64]
    """[2, n]"""
    rows: NDArray[np.int32]
    """[2, n]"""
    counts: NDArray[np.int64]
    """[2, threads, digits]: how many of each digit a thread has, and where its next one goes."""


def new_keys(count: int, threads: int) -> Keys:
    """Room for the keys of so many particles."""
    return Keys(
        np.zeros((2, count), np.int64),
        np.zeros((2, count), np.int32),
        np.zeros((2, threads, _DIGITS), np.int64),
    )


def sort(keys: Any, first: Any, last: Any, share: Any) -> Any:
    """Sort `key[0]` and `rows[0]`, of which this thread has the part [first, last); returns which of the two holds the
    result.

    All threads of the share call it, each with its part, in the order of their numbers.
    """
    side = 0
    for turn in range(_PASSES):
        side = _pass(keys, side, _BITS * turn, first, last, share)
    return side


@outlined
def _pass(keys: Any, side: Any, shift: Any, first: Any, last: Any, share: Any) -> Any:
    mine = keys.counts[0, share.number]
    mine[:] = 0
    key = keys.key[side]
    for i in range(first, last):
        mine[(key[i] >> shift) & (_DIGITS - 1)] += 1
    meet(share.gate, share.threads)
    moves = _places(keys, share)
    if moves:
        index, to_key, to_index = keys.rows[side], keys.key[1 - side], keys.rows[1 - side]
        place = keys.counts[1, share.number]
        for i in range(first, last):
            digit = (key[i] >> shift) & (_DIGITS - 1)
            at = place[digit]
            place[digit] = at + 1
            to_key[at] = key[i]
            to_index[at] = index[i]
    meet(share.gate, share.threads)
    return 1 - side if moves else side


def _places(keys: Any, share: Any) -> Any:
    """Where the digits of this thread go; False if all keys have the same."""
    total = 0
    kinds = 0
    for digit in range(_DIGITS):
        own, before = total, 0
        for thread in range(share.threads):
            there = keys.counts[0, thread, digit]
            before += there if thread < share.number else 0
            total += there
        keys.counts[1, share.number, digit] = own + before
        kinds += 1 if total > own else 0
    return kinds > 1
