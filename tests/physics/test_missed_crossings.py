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


BALL = {"type": "sphere", "radius": 1, "inside": True}
"""A container of radius 1 m."""


def grazing(depth: float, *, dt: float = 1e-3, **options: Any) -> tuple[Any, list[str]]:
    """A particle at 10⁵ m/s near the wall of a ball, so deep in it, for ten steps, and what the run tells of impacts."""
    start = points((1 - depth, 0.0, 0.0), velocity=((0.0, 1e5, 0.0),))
    found = simulate(10 * dt, dt, particles=[start], colliders=[{**BALL, **options}])
    return found, [text for text in found.warnings if "1024" in text]


def test_more_impacts_than_are_followed_are_told() -> None:
    # Chords of 2 √(2 depth) m: 100 m in a step are 1118 of them at 1 mm, and 354 at 1 cm.
    found, told = grazing(1e-3)
    assert len(told) == 1
    assert told[0].startswith("once")
    assert np.linalg.norm(found.final.position, axis=1) == pytest.approx(1, abs=2e-3)
    found, told = grazing(1e-2)
    assert not told
    assert np.linalg.norm(found.final.velocity, axis=1) == pytest.approx(1e5, rel=1e-9)
    assert not grazing(1e-3, dt=1e-4)[1]


@pytest.mark.parametrize("method", ["rk45", "springs"])
def test_other_kinds_of_steps_tell_it_too(method: str) -> None:
    parts: dict[str, Any] = {"colliders": [BALL]}
    start = points((0.999, 0.0, 0.0), (0.0, 0.0, 0.0), velocity=((0.0, 1e5, 0.0), (0.0, 0.0, 0.0)), name="p")
    if method == "springs":
        parts["springs"] = [{"on": "p", "pairs": [[0, 1]], "stiffness": 1e-9}]
    found = simulate(
        0.01, 1e-3, "rk45" if method == "rk45" else "velocity_verlet", particles=[start], **parts
    )
    assert any("1024" in text for text in found.warnings)


def test_what_comes_to_rest_is_not_told() -> None:
    # Bounces that die out, on a plane, in a wedge, and between walls that leave no room.
    ball = points((0.0, 1.0, 0.0), radius=0.1)
    wedge = [{"normal": [1, 1, 0], "restitution": 0.5}, {"normal": [-1, 1, 0], "restitution": 0.5}]
    tight = [
        {},
        {"normal": [0, -1, 0], "point": [0, 1.1, 0]},
        {"normal": [-0.1, -1, 0], "point": [0, 0.15, 0]},
    ]
    for planes in ([{"restitution": 0.5}], wedge, tight):
        found = simulate(3.0, 0.01, particles=[ball], forces=[{"type": "gravity"}], planes=planes)
        assert not any("1024" in text for text in found.warnings)


def test_a_check_can_ask_for_them() -> None:
    check = {"quantity": "missed_crossings", "max": 0, "at": "always"}
    parts = {"particles": [SHOTS], "checks": [check]}
    bad = table(0.1, 0.01, colliders=[{**SHEET, "detection": "discrete"}], **parts)
    assert not ps.run(ps.from_table(bad)).passed
    assert ps.run(ps.from_table(table(0.1, 0.01, colliders=[SHEET], **parts))).passed
