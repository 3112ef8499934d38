"""Blows that go through rigid bodies which touch, from pair to pair, as through a cradle of balls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import G, energies, table, way

R = 0.05
SPHERE = {"type": "sphere", "radius": R}
CUBE = {"type": "box", "size": [2 * R, 2 * R, 2 * R]}
SHAPES: dict[str, dict[str, Any]] = {
    "balls": SPHERE,
    "cubes": CUBE,
    "cylinders": {"type": "cylinder", "radius": R, "length": 2 * R},
    "capsules": {"type": "capsule", "radius": R, "length": 2 * R},
}
FLOOR = {"type": "plane", "point": [0, -R, 0]}
GRAVITY = [{"type": "gravity"}]


def bodies(
    x: list[list[float]], v: list[list[float]], density: list[float] | None = None, **group: Any
) -> list[dict[str, Any]]:
    density = density or [1000.0] * len(x)
    made = [
        {"name": f"b{k}", "shape": SPHERE, "restitution": 1, "friction": 0, "position": at, "velocity": u}
        for k, (at, u) in enumerate(zip(x, v, strict=True))
    ]
    return [each | {"density": rho} | group for each, rho in zip(made, density, strict=True)]


def row(
    resting: int, moving: int = 1, speed: float = 1.0, gap: float = 0.0, **group: Any
) -> list[dict[str, Any]]:
    """Bodies along x that touch, and others that come in together."""
    x = [-0.2 - 2 * R * k for k in reversed(range(moving))] + [(2 * R + gap) * k for k in range(resting)]
    v = [speed] * moving + [0.0] * resting
    return bodies([[at, 0, 0] for at in x], [[u, 0, 0] for u in v], **group)


def after(made: list[dict[str, Any]], duration: float = 0.6, h: float = 1e-3, **parts: Any) -> NDArray[Any]:
    """Velocities of bodies at the end [n, 3]."""
    steps = round(duration / h)
    return np.asarray(way(steps, duration, h, "velocity_verlet", bodies=made, **parts)[1][-1])


def one_by_one(v: list[float], m: list[float], e: float) -> NDArray[np.float64]:
    """Velocities of a row after impacts of pairs, all that close in turn."""
    u = np.array(v)
    while (close := u[:-1] - u[1:]).max() > 1e-10:
        for k in np.flatnonzero(close > 1e-10):
            p = (1 + e) * close[k] / (1 / m[k] + 1 / m[k + 1])
            u[k], u[k + 1] = u[k] - p / m[k], u[k + 1] + p / m[k + 1]
    return u


@pytest.mark.parametrize(("resting", "moving", "speed", "gap"), [
    (2, 1, 1.0, 0.0), (5, 2, 1.0, 0.0), (4, 3, 1.0, 0.0), (5, 2, 1.0, 1e-6), (5, 2, 30.0, 0.0)
])  # fmt: skip
def test_as_many_balls_leave_a_row_as_come_in(resting: int, moving: int, speed: float, gap: float) -> None:
    # (−0.43, −0.43, 0.57, …) of two that come to five: impulses of all contacts had been found together.
    v = after(row(resting, moving, speed, gap), 0.6 / speed, 1e-3 / max(speed / 3, 1))
    assert v[:, 0] == pytest.approx([0.0] * resting + [speed] * moving, abs=1e-15 * speed)
    assert np.abs(v[:, 1:]).max() == 0


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_so_it_is_with_other_shapes(kind: str, friction: float) -> None:
    v = after(row(3, shape=SHAPES[kind], friction=friction))
    assert v == pytest.approx(np.array([[0, 0, 0]] * 3 + [[1, 0, 0]]), abs=1e-13)


@pytest.mark.parametrize("e", [1.0, 0.9, 0.6])
def test_each_impact_acts_on_its_own_pair(e: float) -> None:
    rho = [1000.0, 2000.0, 500.0, 4000.0, 100.0]
    v = after(row(4, density=rho, restitution=e), 0.4)[:, 0]
    assert v == pytest.approx(one_by_one([1.0, 0, 0, 0, 0], rho, e), abs=1e-8)
    assert np.dot(rho, v) == pytest.approx(rho[0], rel=1e-14)
    if e == 1:
        assert np.dot(rho, v**2) == pytest.approx(rho[0], rel=1e-14)


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_row_on_the_ground_passes_a_blow_on(friction: float) -> None:
    # The balls do not turn yet when the first one slides in on ground without friction.
    ground = FLOOR | {"friction": 0.0, "restitution": 0.3}
    v = after(row(4, 2, friction=friction), 0.4, forces=GRAVITY, colliders=[ground])
    assert v == pytest.approx(np.array([[0, 0, 0]] * 4 + [[1, 0, 0]] * 2), abs=1e-14)


@pytest.mark.parametrize("hung", ["joints", "rods"])
def test_a_cradle_swings(hung: str) -> None:
    # The first ball comes down, and the last one goes up as high; then that one comes back, and the first one goes up.
    n, length, angle = 5, 0.3, 0.6
    x = [[2 * R * k, 0, 0] for k in range(n)]
    x[0] = [-length * math.sin(angle), length - length * math.cos(angle), 0]
    ball = {"name": "ball", "shape": SPHERE, "restitution": 1, "friction": 0}
    ball["layout"] = {"type": "points", "position": x}
    held: dict[str, Any] = {"type": "ball"} if hung == "joints" else {}
    ends = [
        held
        | {"between": ["ball", "world"], "pairs": [[k, 0]]}
        | (
            {"anchor": [2 * R * k, length, 0]}
            if hung == "joints"
            else {"points": [[0, 0, 0], [2 * R * k, length, 0]]}
        )
        for k in range(n)
    ]
    scene: dict[str, Any] = {"bodies": [ball], "forces": GRAVITY, hung: ends}
    places, speeds = way(1, 1.2, 1e-3, "velocity_verlet", **scene)
    speeds, high = speeds[:, :, 0], places[:, :, 1]
    hit = int(np.flatnonzero(speeds[:, 4] > 0.5)[0])
    assert speeds[hit, 4] == pytest.approx(speeds[hit - 1, 0], rel=1e-3)
    assert np.abs(speeds[hit, :4]).max() < 1e-3
    first, last = high[0, 0], high[hit : hit + 500, 4].max()
    assert last == pytest.approx(first, rel=0.02)
    assert high[hit + 500 :, 0].max() == pytest.approx(first, rel=0.02)
    assert high[hit:, 1:4].max() < 1e-4 * first
    found = energies(table(1.2, 1e-3, output={"every": 1}, **scene))
    mass = 1000 * 4 / 3 * math.pi * R**3
    assert np.abs(found - found[0]).max() < 1e-3 * mass * G * first


def test_two_balls_that_fall_on_each_other() -> None:
    # The lower one, three times as heavy, turns around first: −1 and 1 become 2 and 0. Found together both rise with 1.
    x, v = [[0.0, 0.3, 0.0], [0.0, 0.4, 0.0]], [[0.0, -1.0, 0.0]] * 2
    ground = {"type": "plane", "restitution": 1, "friction": 0}
    found = after(bodies(x, v, [3000.0, 1000.0]), 0.5, colliders=[ground])
    assert found[:, 1] == pytest.approx([0, 2], abs=1e-14)


def test_what_is_symmetric_stays_so() -> None:
    rack = [[R * math.sqrt(3) * i, (2 * k - i) * R, 0.0] for i in range(3) for k in range(i + 1)]
    made = bodies([[-0.3, 0.0, 0.0], *rack], [[1.0, 0.0, 0.0]] + [[0.0, 0.0, 0.0]] * 6)
    _, speeds = way(1, 0.25, 1e-3, "velocity_verlet", bodies=made)
    v = speeds[np.flatnonzero(np.abs(speeds[:, 6]).max(axis=1) > 0)[0]]
    assert (v**2).sum() == pytest.approx(1, rel=1e-13)
    assert v.sum(axis=0) == pytest.approx([1, 0, 0], abs=1e-14)
    mirror = [0, 1, 3, 2, 6, 5, 4]
    assert v[mirror] == pytest.approx(v * [1, -1, 1], abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_blows_on_heaps_give_no_energy(seed: int) -> None:
    # Some ten bodies of several shapes that touch, in free flight, and one that comes in.
    rng = np.random.default_rng(seed)
    x = [[2 * R * i, 2 * R * j, 2 * R * k] for i in range(3) for j in range(2) for k in range(2)]
    v = [[0.0, 0.0, 0.0] for _ in x]
    x.append([-0.3, *rng.uniform(0, 0.1, 2).tolist()])
    v.append([2.0, *rng.normal(0, 0.1, 2).tolist()])
    made = bodies(x, v, rng.uniform(300, 3000, len(x)).tolist())
    for each in made:
        shape = list(SHAPES)[rng.integers(3)]
        each |= {"shape": SHAPES[shape], "restitution": rng.uniform(0.5, 1), "friction": rng.uniform(0, 0.5)}
    found = energies(table(0.4, 1e-3, bodies=made, output={"every": 1}))
    assert np.diff(found).max() < 1e-6 * found[0]
    assert found[-1] < 0.99 * found[0]


def test_a_ball_on_balls_that_lie_on_each_other_comes_back_from_all() -> None:
    # Gravity presses them on each other: impulses are found together, and the ball rises again.
    ground = {"type": "plane", "restitution": 1, "friction": 0}
    fall, x = 0.3, [[0.0, R, 0.0], [0.0, 3 * R, 0.0], [0.0, 5 * R + 0.3, 0.0]]
    time = 1e-3 * round(2e3 * math.sqrt(2 * fall / G))
    places, _ = way(
        1,
        time,
        1e-3,
        "velocity_verlet",
        bodies=bodies(x, [[0.0, 0.0, 0.0]] * 3),
        colliders=[ground],
        forces=GRAVITY,
    )
    assert places[:, :2, 1] == pytest.approx(np.array([[R, 3 * R]] * len(places)), abs=1e-9)
    assert places[-1, 2, 1] == pytest.approx(x[2][1], abs=1e-3)
