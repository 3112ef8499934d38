"""Crossings that discrete detection does not see are counted; continuous detection misses none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points, simulate, table

import particlesim as ps

SHEET = {"type": "rectangle", "size": [4, 4], "thickness": 0.01, "restitution": 0.5}
SHOTS = points(
    *((0.1 * k, 1.0 + 0.03 * k, 0.0) for k in range(8)), velocity=((0.0, -50.0, 0.0),) * 8, name="shots"
)


@pytest.mark.parametrize("method", ["velocity_verlet", "rk45"])
def test_each_crossing_is_counted_once(method: str) -> None:
    # 0.5 m in a step, through 1 cm: eight shots pass the sheet once; one that ends a step inside of it bounces.
    options: dict[str, Any] = {"detection": "discrete"}
    if method == "rk45":
        options["restitution"] = 0.5
    found = simulate(0.1, 0.01, method, particles=[SHOTS], colliders=[{**SHEET, **options}])
    passed = int((found.final.position[:, 1] < 0).sum())
    assert passed >= 7
    assert found.missed_crossings == passed
    assert any("continuous" in text for text in found.warnings)
    none = simulate(0.1, 0.01, method, particles=[SHOTS], colliders=[SHEET])
    assert none.missed_crossings == 0
    assert (none.final.position[:, 1] > 0).all()


def test_what_does_not_cross_is_not_counted() -> None:
    # Balls that bounce, slide and lie on a discrete ball, and others that fly past it.
    rng = np.random.default_rng(3)
    start = rng.uniform(-1.5, 1.5, (200, 3))
    start = start[np.linalg.norm(start, axis=1) > 1.05]
    grains = points(*map(tuple, start), velocity=((0.0, 0.0, 0.0),) * len(start), name="grains", radius=0.05)
    found = simulate(
        1.0,
        0.005,
        particles=[grains],
        forces=[{"type": "gravity"}],
        colliders=[{"type": "sphere", "radius": 1, "restitution": 0.2, "detection": "discrete"}],
    )
    assert found.missed_crossings == 0


def test_springs_and_the_dead_count_too() -> None:
    pairs = {"on": "shots", "pairs": [[0, 1], [2, 3]], "stiffness": 1.0}
    floor = {"point": [0, -1, 0], "contact": "kill"}
    parts = {"particles": [SHOTS], "colliders": [{**SHEET, "detection": "discrete"}]}
    held = simulate(0.1, 0.01, springs=[pairs], **parts)
    dead = simulate(0.1, 0.01, planes=[floor], **parts)
    assert held.missed_crossings >= 7
    assert dead.died == {"plane": dead.missed_crossings}


def test_a_check_can_ask_for_them() -> None:
    check = {"quantity": "missed_crossings", "max": 0, "at": "always"}
    parts = {"particles": [SHOTS], "checks": [check]}
    bad = table(0.1, 0.01, colliders=[{**SHEET, "detection": "discrete"}], **parts)
    assert not ps.run(ps.from_table(bad)).passed
    assert ps.run(ps.from_table(table(0.1, 0.01, colliders=[SHEET], **parts))).passed
