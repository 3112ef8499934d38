"""Crossings that contact misses are counted, whatever the detection; continuous detection misses none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points, simulate, table
from support import careful

import particlesim as ps
from particlesim.colliders.disc import DiscCollider
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.step.crossing import passed
from particlesim.laws.registry import Particle

SHEET = {"type": "rectangle", "size": [4, 4], "thickness": 0.01, "restitution": 0.5}
SHOTS = points(
    *((0.1 * k, 1.0 + 0.03 * k, 0.0) for k in range(8)), velocity=((0.0, -50.0, 0.0),) * 8, name="shots"
)


@pytest.mark.sampled(2)
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


# Who stands on the wrong side at a frame


def bodies(*position: tuple[float, float, float], name: str, **shape: Any) -> dict[str, Any]:
    return points(*position, name=name, shape=shape, density=1000)


PLACES = ((0.0, 1.0, 0.0), (2.0, 1.0, 0.0), (-2.0, 3.0, 0.0))
SCENE = {
    "particles": [points(*PLACES, name="p", radius=0.1)],
    "colliders": [
        {"type": "plane"},
        {"type": "sphere", "radius": 20, "inside": True},
        {"type": "rectangle", "size": [1, 1], "thickness": 0.2, "center": [6, 3, 0]},
    ],
    "bodies": [
        bodies((0.0, 5.0, 0.0), (3.0, 5.0, 0.0), name="boxes", type="box", size=[1, 1, 1]),
        bodies((-4.0, 5.0, 0.0), name="ring", type="torus", radius=1.0, tube=0.1),
    ],
    "interactions": [{"type": "contact", "model": "impulse"}],
}


def stage() -> Simulation:
    """A simulation before its first step that has been looked at once."""
    simulation = Simulation(ps.from_table(table(1.0, 0.01, **SCENE)), threads=1)
    simulation.check()
    return simulation


def put(simulation: Simulation, group: int, row: int, *place: float) -> int:
    """What is counted when a particle or body turns up at a place, and back where it was."""
    before, state = simulation.missed_crossings(), simulation.states[group]
    was = state.x[:, row].copy()
    state.x[:, row] = place
    simulation.check()
    simulation.check()  # what stays there has not crossed again
    state.x[:, row] = was
    simulation.check()
    return simulation.missed_crossings() - before


@pytest.mark.parametrize(
    ("group", "place", "number"),
    [
        (0, (0.0, -0.01, 0.0), 1),  # centre behind the plane
        (0, (0.0, 0.01, 0.0), 0),  # deep in it, and centre on this side
        (0, (0.0, -1e-9, 0.0), 0),  # rounding, as a part of 20 m
        (0, (0.0, 25.0, 0.0), 1),  # out of the container
        (0, (6.3, 2.95, 0.2), 1),  # in the material of the sheet
        (0, (0.3, 5.3, 0.0), 1),  # in a body
        (0, (0.7, 5.0, 0.0), 0),  # beside it
        (0, (-4.0, 5.0, 0.0), 0),  # in the hole of the ring
        (1, (0.0, -0.1, 0.0), 1),  # a body behind the plane
        (1, (0.0, 0.1, 0.0), 0),  # tilted into it, centre on this side
        (1, (3.2, 5.0, 0.1), 2),  # two bodies in each other
        (2, (6.0, 3.0, 0.0), 0),  # a ring around the sheet
    ],
)
def test_what_stands_on_the_wrong_side_has_crossed(
    group: int, place: tuple[float, float, float], number: int
) -> None:
    simulation = stage()
    assert put(simulation, group, 0, *place) == number
    simulation.close()


def test_what_begins_there_has_crossed_nothing_and_a_resumed_run_knows() -> None:
    simulation = Simulation(ps.from_table(table(1.0, 0.01, **SCENE)), threads=1)
    state = simulation.states[0]
    state.x[1, 0] = -1.0
    simulation.check()
    assert simulation.missed_crossings() == 0
    state.x[1, 1] = -1.0
    simulation.check()
    saved = snapshot(simulation)
    other = stage()
    restore(other, saved)
    other.check()
    assert other.missed_crossings() == simulation.missed_crossings() == 1
    simulation.close()
    other.close()


# Steps that lead through thin colliders


def shot(x: float, y: float, vx: float, vy: float, radius: float = 0.0) -> Particle:
    zero = np.float64(0)
    return Particle(*map(np.float64, (x, y, 0, vx, vy, 0, 1, radius)), zero, zero, np.float64(1))


@pytest.mark.parametrize(
    ("begin", "end", "number"),
    [
        ((0.2, 0.5, 0, -1), (0.2, -0.5, 0, -1), 1),  # straight through
        ((0.2, 0.5, 0, -1), (0.2, 0.5, 0, 1), 0),  # a rebound
        ((1.2, 0.5, 0, -1), (1.2, -0.5, 0, -1), 0),  # beside it
        ((0.9, 0.2, 1.5, -1.5), (0.9, -0.2, -1.5, -1.5), 0),  # fast enough to have gone around the rim
        ((0.2, 0.2, 0.5, -0.5), (0.2, -0.2, -0.5, -0.5), 1),  # too slow for that
    ],
)
def test_a_step_through_a_disc_is_seen(begin: Any, end: Any, number: int) -> None:
    # A disc of radius 1 about the origin, and a step of 1 s, whatever contact has done in it. A way around the rim from
    # (0.9, 0.2) to (0.9, −0.2) takes 2 √(0.1² + 0.2²) = 0.45 m, of 2.1 m/s · 1 s; from (0.2, 0.2) 1.65 m, of 0.71.
    disc = DiscCollider(type="disc", radius=1.0, thickness=1e-3).record()
    assert passed(careful(continuous=[disc]), shot(*begin), shot(*end), np.float64(1)) == number


def test_swarms_pass_nothing() -> None:
    # 2 m and 20 m in a step, between sheets that are smaller, one of which turns.
    rng = np.random.default_rng(1)
    start, speed = rng.uniform(-0.95, 0.95, (300, 3)), rng.normal(0, 60, (300, 3))
    free = np.linalg.norm(start - [0.5, -0.6, -0.5], axis=1) > 0.12
    swarm = points(*map(tuple, start[free]), velocity=tuple(map(tuple, speed[free])), name="swarm")
    colliders = [
        {"type": "box", "size": [2, 2, 2], "inside": True},
        {"type": "rectangle", "size": [0.8, 0.8], "thickness": 0.001, "center": [0.3, 0.2, 0]},
        {
            "type": "rectangle",
            "size": [0.6, 0.6],
            "thickness": 0.002,
            "center": [0, -0.5, 0.3],
            "name": "door",
        },
        {"type": "sphere", "radius": 0.1, "center": [0.5, -0.6, -0.5]},
    ]
    motions = [{"collider": "door", "spin": {"axis": [1, 0, 0], "rate": 1.0}}]
    for dt in (0.02, 0.2):
        found = simulate(
            20 * dt, dt, particles=[swarm], colliders=colliders, motions=motions, output={"every": 1}
        )
        assert found.missed_crossings == 0
