"""Cells of rigid bodies find all that are near, wherever and however large and fast these are; the queue is in order."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from particlesim.engine.queue import empty, new_queue, put_in_order
from particlesim.engine.rigid.cells import follow, gather_at, gather_near, new_body_cells, sort


@pytest.mark.parametrize("n", [1, 8, 9, 200])
@pytest.mark.parametrize("shift", [0.0, -1e7, 1e20])
def test_cells_find_all_that_may_come_near(n: int, shift: float) -> None:
    """Against all pairs, after one of them has got another velocity, too."""
    rng, h = np.random.default_rng(n), 0.01
    x, v = rng.uniform(-3, 3, (3, n)) + shift, rng.normal(0, 2, (3, n))
    reach = rng.uniform(0.05, 0.2, n)
    reach[0] = 2.0
    v[:, n // 2] = 1e4
    b = SimpleNamespace(x=x.copy(), v=v, reach=reach)
    cells, around = new_body_cells(n), np.zeros(n, np.int64)
    sort(cells, b, n, h)
    for i in range(n):
        if i == n // 3:
            v[:, i] = [300.0, 0, 0]
            follow(cells, b, i, h)
        found = set(around[: gather_near(cells, b, i, h, n, around)].tolist())
        balls = reach + h * np.sqrt((v**2).sum(axis=0))
        near = np.sqrt(((x.T - x[:, i]) ** 2).sum(axis=1)) < balls + balls[i]
        assert set(np.flatnonzero(near).tolist()) <= found
    if n == 200 and shift == 0:
        far = gather_at(cells, (2.9, 2.9, 2.9), 0.01, n, around)
        assert far < 40  # a few of 200, not all
    for nowhere in (np.nan, np.inf):
        assert gather_at(cells, (0.0, nowhere, 0.0), 0.01, n, around) <= n


def test_a_queue_is_in_order_of_time_and_number() -> None:
    rng, n = np.random.default_rng(5), 50
    q, due = new_queue(n), rng.integers(0, 10, n).astype(float)
    empty(q)
    for _ in range(200):
        i = int(rng.integers(n))
        q.due[i] = due[i] = float(rng.integers(0, 10))
        put_in_order(q, i)
        there = np.flatnonzero(q.slot)
        assert q.size[0] == len(there)
        assert q.order[0] == min(there.tolist(), key=lambda k: (due[k], k))
        assert (q.order[q.slot[there] - 1] == there).all()
