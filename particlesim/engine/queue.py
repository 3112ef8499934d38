"""A queue in order of time, as a binary heap, for kernels: what is next is at its top."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import shared


class Queue(NamedTuple):
    """Members by their places in the heap [n], the place of each, counted from 1, 0 if it is not there, and its time [n];
    how many there are [1]."""

    order: Any
    slot: Any
    due: Any
    size: Any


def new_queue(n: int) -> Queue:
    """An empty queue for up to n members."""
    return Queue(np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n), np.zeros(1, np.int64))


def empty(q: Queue) -> None:
    """Have nobody in the queue."""
    q.size[0] = 0
    for i in range(q.slot.size):
        q.slot[i] = 0


def comes_first(q: Queue, i: Any, j: Any) -> Any:
    """Whether member i is before member j; of those with one time the one with the lower number is."""
    a, b = q.due[i], q.due[j]
    return (a < b) | ((a == b) & (i < j))


@shared
def put_in_order(q: Queue, i: Any) -> None:
    """Put a member where it belongs after its time has changed, or at first."""
    k = q.slot[i] - 1
    if k < 0:
        k = q.size[0]
        q.size[0] += 1
        put(q, k, i)
    while k > 0 and comes_first(q, i, q.order[(k - 1) // 2]):
        put(q, k, q.order[(k - 1) // 2])
        k = (k - 1) // 2
        put(q, k, i)
    sinks = True
    while sinks:
        child = 2 * k + 1
        if child + 1 < q.size[0]:
            child += 1 if comes_first(q, q.order[child + 1], q.order[child]) else 0
        sinks = False
        if child < q.size[0]:
            sinks = comes_first(q, q.order[child], i)
        if sinks:
            put(q, k, q.order[child])
            k = child
            put(q, k, i)


def put(q: Queue, k: Any, i: Any) -> None:
    """Put a member in place k of the heap."""
    q.order[k] = i
    q.slot[i] = k + 1
