"""Hard grains that move far in a step: nobody passes through another one, and impacts are those of exact events."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from physics.test_contacts import bits
from simulate import EPS, G, energies, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R, M = 0.05, 0.1
Floats = NDArray[np.float64]


def hard(**law: Any) -> dict[str, Any]:
    return {"type": "contact", "model": "impulse", **law}


# ---- against events one by one


class Balls:
    """Free spheres by exact events, in all images of a periodic unit cube, or between its walls: the slow and sure way."""

    def __init__(self, x: Floats, v: Floats, m: Floats, r: Floats, e: float, kind: str) -> None:
        self.x, self.v, self.m, self.r, self.e, self.walls = x.copy(), v.copy(), m, r, e, kind == "walls"
        reach = range(-2, 3) if kind == "periodic" else range(1)
        self.images = np.array(list(product(reach, repeat=3)), float)
        self.impacts = 0

    def next_of_pairs(self) -> tuple[float, int, int, Floats]:
        """When it is, of whom, and the difference of their places then."""
        i, j = np.triu_indices(len(self.x), 1)
        g = (self.v[i] - self.v[j])[:, None]
        d = (self.x[i] - self.x[j])[:, None] + self.images
        square, along = (g**2).sum(axis=2), (d * g).sum(axis=2)
        nearest = d - (along / square)[..., None] * g
        deep = (self.r[i] + self.r[j])[:, None] ** 2 - (nearest**2).sum(axis=2)
        meets = (along < 0) & (deep > 0)
        s = np.where(meets, -along / square - np.sqrt(np.maximum(deep, 0) / square), math.inf)
        pair, image = np.unravel_index(np.argmin(s), s.shape)
        when = max(float(s[pair, image]), 0.0)
        return (
            when,
            int(i[pair]),
            int(j[pair]),
            d[pair, image] + (when if meets[pair, image] else 0) * g[pair, 0],
        )

    def next_at_walls(self) -> tuple[float, int, int]:
        """When it is, of whom, and along which axis."""
        if not self.walls:
            return math.inf, 0, 0
        r = self.r[:, None]
        s = np.where(self.v > 0, 1 - r - self.x, r - self.x) / self.v
        ball, axis = np.unravel_index(np.argmin(s), s.shape)
        return max(float(s[ball, axis]), 0.0), int(ball), int(axis)

    def advance(self, duration: float) -> None:
        while True:
            s, i, j, d = self.next_of_pairs()
            at, ball, axis = self.next_at_walls()
            self.x += min(s, at, duration) * self.v
            if min(s, at) > duration:
                return
            duration -= min(s, at)
            self.impacts += 1
            if at < s:
                self.v[ball, axis] *= -self.e
                continue
            n = d / np.linalg.norm(d)
            push = -(1 + self.e) * ((self.v[i] - self.v[j]) @ n) / (1 / self.m[i] + 1 / self.m[j])
            self.v[i] += push / self.m[i] * n
            self.v[j] -= push / self.m[j] * n


WALLS = [
    {"type": "plane", "normal": np.roll([1.0 - 2 * s, 0, 0], k).tolist(), "point": [float(s)] * 3}
    for k in range(3)
    for s in (0, 1)
]
"""The sides of a unit cube."""


@pytest.mark.parametrize(
    ("e", "kind"),
    [(1.0, "free"), (0.6, "periodic"), (1.0, "walls"), pytest.param(0.8, "walls", marks=pytest.mark.slow)],
)
def test_impacts_are_those_of_exact_events(e: float, kind: str) -> None:
    """In a periodic box of two groups, with a contact of their own for each and one between both."""
    rng, n, duration = np.random.default_rng(4), 24, 0.2
    m, r, x = rng.uniform(0.5, 2, n), rng.uniform(0.03, 0.12, n), np.empty((0, 3))
    while len(x) < n:
        least = 1.01 * r[len(x)] if kind == "walls" else 0.0
        y = rng.uniform(least, 1 - least, 3)
        d = y - x
        if kind == "periodic":
            d -= np.rint(d)
        if (np.linalg.norm(d, axis=1) > r[: len(x)] + r[len(x)]).all():
            x = np.vstack([x, y])
    v = 3 * rng.normal(size=(n, 3)) + 4 * (0.5 - x)
    reference = Balls(x, v, m, r, e, kind)
    reference.advance(duration)
    assert reference.impacts > 10
    parts = [("a", slice(0, 10)), ("b", slice(10, n))] if kind == "periodic" else [("a", slice(n))]
    groups = [
        points(
            *map(tuple, x[own]),
            velocity=v[own].tolist(),
            mass=m[own].tolist(),
            radius=r[own].tolist(),
            name=name,
        )
        for name, own in parts
    ]
    some: list[Any] = [{"on": ["a"]}, {"on": ["b"]}, {"between": ["a", "b"]}] if kind == "periodic" else [{}]
    walls = [{**wall, "restitution": e} for wall in WALLS] if kind == "walls" else []
    scenario = table(
        duration,
        duration / 2,
        particles=groups,
        colliders=walls,
        interactions=[{**hard(restitution=e), **each} for each in some],
    )
    if kind == "periodic":
        scenario["simulation"]["box"] = {"size": [1.0, 1.0, 1.0], "periodic": [True, True, True]}
    found = ps.run(ps.from_table(scenario))
    assert not any("pass through" in text for text in found.warnings)
    away = found.final.position - reference.x
    away = away - np.rint(away) if kind == "periodic" else away
    # every impact multiplies rounding by the way between impacts over a radius, some 10
    assert np.abs(away).max() < 1e-10
    assert np.abs(found.final.velocity - reference.v).max() < 1e-8


@pytest.mark.parametrize("way", [30.0, 1e2, 1e5])
def test_a_bullet_hits_the_first_of_a_row_and_the_last_one_leaves(way: float) -> None:
    """In one step, from `way` radii off: the ball, touching ones, and one beyond a gap."""
    at = [-way * R / 2, 0.0, 2 * R, 4 * R, 4 * R + 2 * R + 0.3 * R]
    speed = way * R / 0.01
    balls = points(*((x, 0.0, 0.0) for x in at), velocity=[(speed, 0, 0), *[(0, 0, 0)] * 4], mass=M, radius=R)
    final = simulate(0.01, 0.01, particles=[balls], interactions=[hard()]).final
    assert final.velocity[:, 0] == pytest.approx([0, 0, 0, 0, speed], abs=16 * EPS * speed)
    # the blow jumps over the balls, each of which goes as far as the gap before it
    after = [-2 * R, 0.0, 2 * R, 4.3 * R, way * R / 2 + 8 * R]
    assert final.position[:, 0] == pytest.approx(after, abs=8 * EPS * way * R)


def test_blows_without_end_are_cut_off_and_told() -> None:
    """Inelastic blows in a lattice of touching balls follow each other ever faster."""
    at = [(2 * R * i, 2 * R * j, 2 * R * k) for i, j, k in product(range(8), repeat=3)]
    speed = [(1e4, 0, 0), *[(0, 0, 0)] * len(at)]
    balls = points((-50.0, 7 * R, 6.6 * R), *at, velocity=speed, mass=M, radius=R)
    found = simulate(0.02, 0.01, particles=[balls], interactions=[hard(restitution=0.1)])
    assert any("a hard grain had 64 impacts in a step" in text for text in found.warnings)
    v = found.final.velocity
    assert v.sum(axis=0) == pytest.approx([1e4, 0, 0], abs=1e-9)
    assert (v**2).sum() < 0.5e8


def test_impacts_on_spheres_that_turn_keep_what_there_is() -> None:
    """An oblique impact within one step of 40 radii by the closed form, with friction that stops sliding."""
    slip, approach = 0.35, math.sqrt(1 - 0.35**2)
    speed, dt = 200.0, 0.01
    balls = points((-0.7, 0.35 * 2 * R, 0), (0, 0, 0), velocity=[(speed, 0, 0), (0, 0, 0)], mass=M, radius=R)
    balls["angular_velocity"] = [0.0, 0.0, 3.0]
    final = simulate(dt, dt, particles=[balls], interactions=[hard(restitution=0.5, friction=50.0)]).final
    n = np.array([-approach, slip, 0.0])
    u = np.array([speed, 0, 0])
    # both surfaces turn: r₁ ω₁ + r₂ ω₂ = 2 R ω, and 2/7 of the slip is what stops it
    slide = u - (u @ n) * n - np.cross((0, 0, 2 * R * 3.0), n)
    change = -0.5 * 1.5 * (u @ n) * n - slide / 7
    assert final.velocity == pytest.approx(np.array([u + change, -change]), abs=64 * EPS * speed)
    spin = M * np.cross(final.position, final.velocity).sum(axis=0)
    turn = 0.4 * M * R**2 * final.angular_velocity.sum(axis=0)
    began = M * np.cross((-0.7, 0.7 * R, 0), u) + 0.4 * M * R**2 * np.array([0, 0, 6.0])
    assert spin + turn == pytest.approx(began, abs=64 * EPS * M * speed)


# ---- walls of balls, pinned and led


@pytest.mark.sampled(2)
@pytest.mark.parametrize("led", [0.0, -3.0])
def test_nobody_passes_a_wall_of_balls(led: float) -> None:
    """36 shots of 30 to 10⁴ radii a step at a thin wall of touching balls, which stands, or comes to meet them."""
    wall = [(0.0, 2 * R * (i + j % 2 / 2), math.sqrt(3) * R * j) for i in range(-7, 8) for j in range(-8, 9)]
    start = [(-1 - 0.01 * k, -0.45 + 0.18 * (k % 6), -0.45 + 0.18 * (k // 6)) for k in range(36)]
    motions = [{"on": "wall", "path": [f"x + {led}*t", "y", "z"]}]
    for way in (30.0, 1e4):
        speed = [(100 * way * R * (1 + 0.01 * k), 5 * way * R, 0.0) for k in range(36)]
        groups = [
            points(*start, velocity=speed, mass=M, radius=R, name="shot"),
            points(*wall, mass=M, radius=R, name="wall", pinned=True),
        ]
        final = simulate(0.03, 0.01, particles=groups, interactions=[hard()], motions=motions).final
        shots = final.position[:36, 0]
        assert (shots < final.position[36:, 0].max() - R).all()
        if led == 0:
            square = (final.velocity[:36] ** 2).sum()
            assert square == pytest.approx((np.array(speed) ** 2).sum(), rel=64 * EPS)


# ---- many, between colliders


def gas(
    way: float, n: int = 60, r: float = 0.02, steps: int = 200, e: float = 1.0, **more: Any
) -> dict[str, Any]:
    """A gas of hard spheres in a unit box of planes, that move by `way` radii in a step in the root mean square."""
    rng, x = np.random.default_rng(3), np.empty((0, 3))
    while len(x) < n:
        y = rng.uniform(1.01 * r, 1 - 1.01 * r, 3)
        if (np.linalg.norm(y - x, axis=1) > 2 * r).all():
            x = np.vstack([x, y])
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]  # all at 1 m/s
    dt, rubs, method = way * r, more.pop("friction", 0.0), more.pop("method", "velocity_verlet")
    balls = points(*map(tuple, x), velocity=v.tolist(), mass=1.0, radius=r)
    return table(
        steps * dt,
        dt,
        method,
        particles=[balls],
        colliders=[{**wall, "restitution": e} for wall in WALLS],
        interactions=[hard(restitution=e, friction=rubs)],
        output={"ledger": True, "every": max(steps // 10, 1)},
        **more,
    )


def energy(found: ps.Result) -> Floats:
    ledger = found.ledger
    return np.asarray(
        ledger["kinetic"] + sum(ledger[name] for name in ledger if name.startswith("potential."))
    )


def gaps(x: Floats, r: float) -> float:
    """The smallest gap of a state, in radii; at walls, too."""
    d = np.linalg.norm(x[:, None] - x, axis=2) + 10 * np.eye(len(x))
    return float(min(d.min() / r - 2, x.min() / r - 1, (1 - x.max()) / r - 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("precision", "most"), [("double", 1e-12), pytest.param("single", 1e-5, marks=pytest.mark.slow)]
)
def test_a_gas_keeps_its_energy_and_comes_to_maxwells_speeds(precision: str, most: float) -> None:
    """Impacts and walls in steps of some radii; the mean of v⁴ over that of v² squared goes from 1 to 5/3."""
    scenario = gas(5.0, n=300, r=0.03, steps=300)
    scenario["simulation"]["precision"] = precision
    found = ps.run(ps.from_table(scenario))
    assert np.abs(energy(found) / energy(found)[0] - 1).max() < most
    assert gaps(found.final.position, 0.03) > -0.01  # what is slow overlaps a little at the end of a step
    square = (found.final.velocity**2).sum(axis=1)
    # for n = 300 the ratio has a standard deviation of about √(8/3) · (2/3) · √(5/2)/√n, some 0.1
    assert (square**2).mean() / square.mean() ** 2 == pytest.approx(5 / 3, abs=0.4)


@pytest.mark.parametrize(
    ("method", "late", "most"),
    [
        ("velocity_verlet", 0.0, 1e-12),
        pytest.param("rk4", 0.0, 1e-12, marks=pytest.mark.slow),
        ("symplectic_euler", 0.5, 0.02),
    ],
)
def test_energy_is_kept_under_gravity(method: str, late: float, most: float) -> None:
    """Impacts take place within steps in which v changes by 0.2 m/s, of some 1, and is that of their time. Velocities of
    symplectic Euler are half a step late, and low hops cost it some energy.
    """
    g, scenario = 5.0, gas(2.0, method=method, forces=[{"type": "gravity", "acceleration": [0, -5.0, 0]}])
    kick = np.array([0, -late * g * scenario["simulation"]["dt"], 0])

    def total(x: Any, v: Any) -> float:
        return float((0.5 * (np.asarray(v) + kick) ** 2).sum() + g * np.asarray(x)[:, 1].sum())

    final, layout = ps.run(ps.from_table(scenario)).final, scenario["particles"][0]["layout"]
    began = total(layout["position"], layout["velocity"])
    assert total(final.position, final.velocity) == pytest.approx(began, rel=most)


@pytest.mark.slow
def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    spray = {
        "name": "spray",
        "shape": {"type": "point", "position": [0.5, 0.5, 0.5]},
        "rate": 100.0,
        "speed": 5.0,
        "direction": [1, 0.2, 0.1],
        "spread": 40.0,
        "radius": 0.015,
        "density": 500,
        "lifetime": 0.5,
    }
    pull = [{"type": "gravity", "acceleration": [0, -5.0, 0]}]
    scenario = ps.from_table(gas(1.5, e=0.8, friction=0.3, steps=40, forces=pull, emitters=[spray]))
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    one.advance_to(20)
    two.advance_to(20)
    assert bits(one) == bits(two)
    restore(other, snapshot(one))
    for each in (one, two, other):
        each.advance_to(40)
    assert bits(one) == bits(two) == bits(other)
    x = np.concatenate([state.x[:, : state.count].T for state in one.states])
    assert len(x) > 80
    assert x.min() > 0
    assert x.max() < 1


@pytest.mark.parametrize("dt", [1e-2, 2.5e-3])
def test_an_elastic_ball_that_is_thrown_down_beside_the_floor_gains_nothing(dt: float) -> None:
    # It had been put back on the floor at the end of the step, without having paid for the way up: 5 % at 10 ms.
    places = (-0.349807, -0.225485, -0.200417), (-0.28344, -0.39983, -0.11099)
    speeds = [(3.085902, -0.776561, 1.557953), (0.90323, -0.065309, -1.827422)]
    found = energies(
        table(
            0.03,
            dt,
            particles=[points(*places, velocity=speeds, radius=0.1, mass=1.0)],
            forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
            planes=[{"point": [0, -0.5, 0], "restitution": 1.0}],
            interactions=[{"type": "contact", "model": "impulse", "restitution": 1.0}],
            output={"every": 1},
        )
    )
    assert found == pytest.approx(found[0], rel=1e-13)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dt", [5e-3, 2.5e-3])
def test_elastic_balls_in_a_box_keep_their_energy_in_corners_too(dt: float) -> None:
    # What leaves one side of the box in a step had been taken past the next one, in its corner.
    rng, places = np.random.default_rng(3), []
    while len(places) < 10:
        x = rng.uniform(-0.4, 0.4, 3)
        if all(np.linalg.norm(x - y) > 0.2 for y in places):
            places.append(x)
    speeds = rng.normal(0, 1, (10, 3)).tolist()
    found = energies(
        table(
            20.0,
            dt,
            particles=[points(*(tuple(x) for x in places), velocity=speeds, radius=0.1, mass=1.0)],
            forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
            colliders=[{"type": "box", "inside": True, "size": [1, 1, 1], "restitution": 1.0}],
            interactions=[{"type": "contact", "model": "impulse", "restitution": 1.0}],
            output={"every": 10},
        )
    )
    assert found == pytest.approx(found[0], rel=1e-12)
