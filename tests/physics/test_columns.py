"""Columns and rows of hard grains that rest on each other: they stand, on floors that move, too, whatever their length."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls
from simulate import G, points, table

import particlesim as ps
from particlesim.engine.diagnosis.sunk import sunk
from particlesim.engine.interactions.hard import at_once
from particlesim.engine.interactions.hard.apart import SLACK
from particlesim.engine.interactions.hard.at_once import (
    FIRST,
    GIVEN,
    NUMBER,
    RATE,
    SCALE,
    SECOND,
    Chosen,
    X,
    Z,
)
from particlesim.engine.interactions.hard.laws import Laws
from particlesim.engine.interactions.hard.turns import SETTLED
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R, DT = 0.1, 1e-3


def upright(n: int, speed: float = 0.0, precision: str = "double", **parts: Any) -> dict[str, Any]:
    """Grains that touch, one above the other, on a box whose top is at y = 0 and which moves up at a speed."""
    places = [(0.0, R + 2 * R * k, 0.0) for k in range(n)]
    law = parts.pop("law", {})
    group = {"mass": 1.0, "radius": R, **parts.pop("group", {})}
    output = {"every": 100, "ledger": True, "precision": precision}
    floor = {"name": "floor", "type": "box", "size": [4, 2, 4], "center": [0, -1, 0], "restitution": 0}
    led = {"motions": [{"collider": "floor", "path": ["x", f"y + {speed}*t", "z"]}]} if speed else {}
    scenario = table(
        0.6,
        DT,
        particles=[points(*places, velocity=[(0.0, speed, 0.0)] * n, **group)],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 0, **law}],
        colliders=[{**floor, **parts.pop("floor", {})}],
        output=output,
        **led,
        **parts,
    )
    scenario["simulation"]["precision"] = precision
    return scenario


def rests(scenario: dict[str, Any], n: int, speed: float = 0.0) -> None:
    """Every pair keeps an overlap of the slack, and of what a step of free fall brings, twice as that is halved in each; and
    approaches by at most the part of what gravity does in a step with which the search ends."""
    simulation = Simulation(ps.from_table(scenario), threads=1)
    small = 1e-6 if scenario["simulation"]["precision"] == "single" else 0.0
    for step in (200, 400, 600):
        simulation.advance_to(step)
        (state,) = simulation.states
        below = R * (1 + 2 * np.arange(n)) + speed * step * DT - state.x[1, :n]
        assert (np.diff(below) < SLACK * R + 2 * G * DT**2 + small).all()
        assert (np.abs(below) < (1 + np.arange(n)) * (SLACK * R + 2 * G * DT**2) + small).all()
        assert np.abs(state.v[1, :n] - speed).max() < n * SETTLED * G * DT + small
        assert np.abs(state.v[::2, :n]).max() <= small
    simulation.close()


@pytest.mark.parametrize("n", [3, 10, 30])
def test_a_column_stands(n: int) -> None:
    rests(upright(n), n)


@pytest.mark.parametrize("law", [{"friction": 0.5}, {"restitution": 0.5}], ids=["friction", "rebound"])
def test_it_stands_with_friction_and_with_rebound(law: dict[str, Any]) -> None:
    rests(upright(12, law=law), 12)


def test_heavy_grains_stand_on_light_ones() -> None:
    rests(upright(8, group={"mass": [1.0, 10.0] * 4}), 8)


def test_it_stands_in_single_precision() -> None:
    rests(upright(10, precision="single"), 10)


@pytest.mark.parametrize("n", [2, 10])
@pytest.mark.parametrize("speed", [-1.0, 1.0])
def test_it_stands_on_a_lift(n: int, speed: float) -> None:
    # The laws are the same for who moves along: turns had stopped what is at rest on a floor that goes down.
    rests(upright(n, speed), n, speed)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_a_row_on_a_slope_leans_on_its_end(friction: float) -> None:
    # Frictionless, or as rough as lets balls roll: either way the lowest carries all others along the slope.
    n, angle = 12, math.radians(30)
    law = {"friction": friction} if friction else {}
    scenario = table(
        0.4,
        DT,
        particles=[points(*((R + 2 * R * k, R, 0.0) for k in range(n)), mass=1.0, radius=R)],
        forces=[{"type": "gravity", "acceleration": [-G * math.sin(angle), -G * math.cos(angle), 0]}],
        interactions=[{"type": "contact", "restitution": 0, **law}],
        planes=[
            {"restitution": 0},
            {"restitution": 0, "normal": [1, 0, 0]},
        ],
    )
    final = ps.run(ps.from_table(scenario)).final
    assert np.abs(final.velocity).max() < n * SETTLED * G * DT
    below = R * (1 + 2 * np.arange(n)) - final.position[:, 0]
    assert (np.abs(below) < (1 + np.arange(n)) * (SLACK * R + 2 * G * DT**2)).all()


def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(upright(12, law={"friction": 0.5}))
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    for step in (100, 200):
        one.advance_to(step)
        two.advance_to(step)
        assert one.states[0].x.tobytes() == two.states[0].x.tobytes()
        assert one.states[0].v.tobytes() == two.states[0].v.tobytes()
        if step == 100:
            restore(other, snapshot(one))
    other.advance_to(200)
    assert one.states[0].x.tobytes() == other.states[0].x.tobytes()
    assert one.states[0].v.tobytes() == other.states[0].v.tobytes()


def test_what_has_sunk_is_told() -> None:
    # Deeper than a tenth of a radius, and not by what it moves in ten steps: 0.2 R, at less than 2 m/s.
    def told(speed: float, e: float = 0.0, apart: float = 1.8 * R) -> list[str]:
        scenario = upright(2, law={"restitution": e})
        scenario["particles"][0]["layout"]["position"][1][1] = R + apart
        scenario["particles"][0]["layout"]["velocity"][1][1] = speed
        simulation = Simulation(ps.from_table(scenario), threads=1)
        found = list(sunk(simulation))
        simulation.close()
        return found

    (text,) = told(-1.0)
    assert text.startswith("1 pair of contact has sunk into each other, by up to 0.02 m: 200 turns")
    assert "smaller dt, such as 0.00025 s" in text
    assert not told(-2.1)
    assert not told(-1.0, e=1.0)
    assert not told(-1.0, apart=1.91 * R)
    assert not told(0.0)  # as if both were pinned


def test_columns_do_not_tell_that_they_sink() -> None:
    assert not any("sunk" in text for text in ps.run(ps.from_table(upright(30))).warnings)


# The solution


class Posed:
    """Contacts of some particles in all directions, the last ones at walls, with velocities that approach and part."""

    def __init__(self, seed: int, particles: int = 7, pairs: int = 9, walls: int = 2) -> None:
        rng = np.random.default_rng(seed)
        self.w, self.v = 10.0 ** rng.uniform(-1, 1, particles), rng.normal(size=(3, particles))
        desk = at_once.new_desk(pairs + walls, particles)
        self.ends = np.array([rng.permutation(particles)[:2] for _ in range(pairs + walls)]).T
        n = rng.normal(size=(3, pairs + walls))
        n /= np.linalg.norm(n, axis=0)
        self.jacobian = np.zeros((pairs + walls, 3, particles))
        for k in range(pairs + walls):
            self.jacobian[k, :, self.ends[0, k]] = n[:, k]
            if k < pairs:
                self.jacobian[k, :, self.ends[1, k]] -= n[:, k]
        self.walls = slice(pairs, None)
        scale = 1 / np.sqrt((self.jacobian**2 * self.w).sum(axis=(1, 2)))
        desk.of[NUMBER], desk.of[FIRST], desk.of[SECOND] = np.arange(pairs + walls), *self.ends
        desk.contacts[SCALE], desk.contacts[X : Z + 1] = scale, n
        matrix = np.einsum("k,kai,i,lai,l->kl", scale, self.jacobian, self.w, self.jacobian, scale)
        self.desk, self.scale = desk, scale
        self.chosen = Chosen(pairs, walls, float(np.linalg.eigvalsh(matrix)[-1]))

    def given(self, change: np.ndarray) -> np.ndarray:
        """Velocities after impulses that change the speeds along the normals so."""
        return self.v + self.w * np.einsum("k,kai->ai", change * self.scale**2, self.jacobian)

    def energy(self, v: np.ndarray) -> float:
        return float((0.5 * v**2 / self.w).sum())

    def solved(self, most: int, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
        """Velocities after some iterations."""
        monkeypatch.setattr(at_once, "MOST", most)
        self.desk.contacts[GIVEN] = 0
        self.desk.contacts[RATE] = self.scale * np.einsum("kai,ai->k", self.jacobian, self.v)
        at_once.find(self.desk, self.w, self.chosen, 1e-12)
        assert (self.desk.contacts[GIVEN] >= 0).all()  # nothing pulls
        return self.given(self.desk.contacts[GIVEN])


@pytest.mark.parametrize("seed", range(8))
def test_velocities_are_those_of_least_energy(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # By an independent solver: the least |W^(−½) (v + W Jᵀ λ)| over λ ≥ 0. Rates are found to 1e-12,
    # velocities of masses from 0.1 to 10 kg to some hundred times that.
    posed = Posed(seed)
    root = np.sqrt(posed.w)
    count = len(posed.jacobian)
    columns = (posed.jacobian * root).reshape(count, -1).T
    pushes, _ = nnls(columns, -(posed.v / root).ravel(), maxiter=1000)
    right = posed.v + posed.w * np.einsum("k,kai->ai", pushes, posed.jacobian)
    found = posed.solved(400, monkeypatch)
    np.testing.assert_allclose(found, right, atol=1e-9)
    assert (np.einsum("kai,ai->k", posed.jacobian, found) > -1e-11).all()
    assert 0 < (pushes > 1e-9).sum() < count  # some push, some part


@pytest.mark.parametrize("seed", range(8))
def test_no_iteration_adds_energy_and_pairs_keep_momentum(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    posed = Posed(seed, walls=0)
    energies = [posed.energy(posed.v)]
    for most in range(1, 30):
        v = posed.solved(most, monkeypatch)
        energies.append(posed.energy(v))
        np.testing.assert_allclose((v / posed.w).sum(axis=1), (posed.v / posed.w).sum(axis=1), atol=1e-12)
    assert (np.diff(energies) <= 1e-14 * energies[0]).all()
    assert energies[-1] < 0.99 * energies[0]


def test_what_is_wedged_between_walls_that_leave_no_room_gains_nothing() -> None:
    """Four that touch a cone in nine places, seven of them one that is in its tip: pushes there against each other cost no
    energy. Directions that are conjugate to one along these had grown by 10⁹, and another one had gone up by 400 MJ."""
    w = np.array([2.529, 6.549, 4.209, 2.819])
    one, other = [0, 1, 0, 0, 1, 1, 1, 1, 1, 1, 2, 3], [3, 3, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    n = np.array(
        [
            *([-0.6267, 0.7084, 0.3248], [-0.2141, -0.9657, 0.1472], [-0.8523, -0.2707, 0.4476]),
            *([0.887, 0.2589, -0.3824], [0.4987, 0.2588, -0.8272], [-0.4987, 0.2588, 0.8272]),
            *([0.4759, 0.2588, 0.8406], [-0.962, 0.2588, -0.0873], [0.3073, 0.2588, -0.9157]),
            *([-0.1138, 0.2588, 0.9592], [-0.8238, 0.2588, 0.5043], [-0.7965, 0.2589, 0.5464]),
        ]
    ).T
    n /= np.linalg.norm(n, axis=0)
    rate = np.array([-37.41, -114.5, -35.16, 0, -42.06, 19.88, -32.13, -8.128, -33.09, 0, 0, 0]) * 1e-5
    given = np.array([1179, 2547, 1609, 879, 1386, 1363, 769, 437, 1843, 907, 862, 535]) * 1e-4
    jacobian = np.zeros((12, 3, 4))
    for k in range(12):
        jacobian[k, :, one[k]] = n[:, k]
        if k < 3:
            jacobian[k, :, other[k]] -= n[:, k]
    matrix = np.einsum("kai,i,lai->kl", jacobian, w, jacobian)
    scale = 1 / np.sqrt(np.diag(matrix))
    desk = at_once.new_desk(12, 4)
    desk.of[NUMBER], desk.of[FIRST], desk.of[SECOND] = np.arange(12), one, other
    desk.contacts[SCALE], desk.contacts[X : Z + 1] = scale, n
    desk.contacts[GIVEN], desk.contacts[RATE] = given, scale * rate
    at_once.find(desk, w, Chosen(3, 9, 8.527), 1e-5)
    pushes = (desk.contacts[GIVEN] - given) * scale**2
    assert rate @ pushes + 0.5 * pushes @ matrix @ pushes < 0
    assert (rate + matrix @ pushes > -1e-5).all()


def test_heaps_and_what_flies_are_left_to_turns() -> None:
    # A square lies on the floor, with two pairs for each of its grains with both diagonals; a row without a floor stands on
    # nothing; a row on the floor is solved.
    def chosen(pairs: list[tuple[int, int]], walls: list[int], n: int = 4) -> int:
        bench = SimpleNamespace(
            rows=np.array(pairs).T,
            table=np.zeros(len(pairs), int),
            normal=np.tile([[1.0], *[[0.0]] * 6, [0.5], [0.5], *[[0.0]] * 5], len(pairs)),
            wall=np.array(walls, int),
            wall_normal=np.tile([[0.0], [1.0], *[[0.0]] * 7], len(walls)),
            desk=at_once.new_desk(len(pairs) + len(walls), n),
        )
        c = SimpleNamespace(vx=np.array([-1.0, 0, 0, 0]), vy=np.zeros(n), vz=np.zeros(n))
        at_once.join(bench, np.ones(n), len(pairs), len(walls))
        heap = SimpleNamespace(bench=bench, a=np.ones(n), laws=Laws(np.zeros(1)))
        return int(at_once.choose(heap, c, len(pairs), len(walls), 1e-9).pairs)

    row = [(0, 1), (1, 2), (2, 3)]
    assert chosen(row, [1]) == 3
    assert chosen(row, []) == 0
    assert chosen([*row, (0, 2), (0, 3), (1, 3)], [1]) == 6  # 1.5 for each
    assert chosen([*row, (0, 2), (0, 3), (1, 3), (0, 1)], [1]) == 0
    assert chosen([(1, 2), (2, 3)], [1]) == 0  # at rest
