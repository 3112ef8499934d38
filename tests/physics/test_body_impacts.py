"""Impacts of rigid bodies that nothing else takes part in are at their own time and place, however far they come in a
step."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, simulate, table

import particlesim as ps
from particlesim.engine.rigid.kernel import look_for_contacts
from particlesim.engine.simulation import Simulation

H, R = 2e-3, 0.02
"""Step [s]; radius of the balls [m]."""
GAP = 1e-7
"""Gap at which the first impact of a body in a drift is given, in units of its inner radius."""
ELASTIC = {"restitution": 1.0, "friction": 0.0}
SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"type": "sphere", "radius": 0.03},
    "box": {"type": "box", "size": [0.06, 0.05, 0.04]},
    "capsule": {"type": "capsule", "radius": 0.02, "length": 0.06},
    "cylinder": {"type": "cylinder", "radius": 0.03, "length": 0.05},
}


def ball(name: str, x: Any, v: Any) -> dict[str, Any]:
    return {"name": name, "shape": {"type": "sphere", "radius": R}, "position": x, "velocity": v, **ELASTIC}


@pytest.mark.parametrize("floor", [False, True])
@pytest.mark.parametrize("way", [0.05, 0.4, 1.5])
def test_balls_that_hit_off_centre_go_along_their_line_of_centres(way: float, floor: bool) -> None:
    """The one at rest gets v cos θ along it, with sin θ = b/2R; so do billiard balls. It had been the line ahead of the
    impact: up to 0.4 v off. At a gap of γ, sin θ = b/(2R + γ)."""
    speed = way * R / H
    up = [{"type": "gravity"}] if floor else []
    planes = [{"normal": [0, 1, 0], **ELASTIC, "restitution": 0.5}] if floor else []
    for k, off in enumerate((0.0, 0.3, 1.0, 1.6, 1.9)):
        x = -0.08 - 0.37 * k * speed * H
        steps = math.ceil(-x / speed / H) + 1
        bodies = [ball("one", [x, R, off * R], [speed, 0, 0]), ball("two", [0, R, 0], [0, 0, 0])]
        got = simulate(steps * H, H, bodies=bodies, forces=up, planes=planes).final.velocity
        sine = off / 2
        expected = speed * math.sqrt(1 - sine**2) * np.array([math.sqrt(1 - sine**2), 0.0, -sine])
        gap = (
            1e-4 if floor and way > 1 else GAP
        )  # what is swift and touches the ground is not seen to be alone
        most = 2 * gap * sine / math.sqrt(1 - sine**2) + 100 * EPS
        assert abs(got[1] - expected).max() < most * speed
        assert abs(got.sum(axis=0) - [speed, 0, 0]).max() < 100 * EPS * speed


@pytest.mark.parametrize("part", [0.1, 0.3, 0.45, 0.6, 0.9])
def test_the_first_step_meets_what_is_near_at_its_beginning(part: float) -> None:
    """No step before has foreseen an impact in its first half; those rebounded in the middle only."""
    way = 0.006
    floor = {"normal": [0, 1, 0], **ELASTIC}
    got = simulate(
        H, H, bodies=[ball("ball", [0, R + part * way, 0], [0, -way / H, 0])], planes=[floor]
    ).final
    assert got.position[0, 1] - R == pytest.approx((1 - part) * way, abs=2 * GAP * R)
    assert got.velocity[0, 1] == pytest.approx(way / H, rel=100 * EPS)


def test_an_impact_has_its_rolling_friction() -> None:
    """P = (1 + e) m v takes μ_r R P from the spin about an axis along the floor, here without sliding friction."""
    mass, rolling, v, spin, e = 1.0, 0.01, 2.0, 8.0, 0.5
    law = {"mass": mass, "restitution": e, "rolling_friction": rolling, "angular_velocity": [0, 0, spin]}
    floor = {"normal": [0, 1, 0], "restitution": e, "friction": 0.0}
    falls = ball("ball", [0, 1.3 * R, 0], [0, -v, 0]) | law
    got = simulate(5 * H, H, bodies=[falls], planes=[floor]).final
    inertia = 2 / 5 * mass * R**2
    assert got.velocity[0, 1] == pytest.approx(e * v)
    assert got.angular_velocity[0, 2] == pytest.approx(spin - rolling * R * (1 + e) * mass * v / inertia)


@pytest.mark.parametrize(
    ("speed", "free"), [(1.0, True), (3.5, True), (6.0, True), (3.5, False), (6.0, False)]
)
def test_an_impact_has_the_friction_of_motion(speed: float, free: bool) -> None:
    """What slides at u is stopped by 2/7 u, or slowed by μ_k (1 + e) v_n where that is less: 0.64 m/s. The friction at rest
    would stop up to 1.6 m/s, that is a ball of 3.5 m/s with its 1 m/s. With rolling friction, of next to nothing here, an
    impact is in the middle of the step."""
    thrown = {
        "shape": {"type": "sphere", "radius": 0.05},
        "position": [0, 0.25, 0],
        "velocity": [speed, -2.0, 0],
    }
    floor = {"restitution": 0.6, "friction": {"static": 0.5, "kinetic": 0.2}}
    more = {} if free else {"rolling_friction": 1e-12}
    final = simulate(0.3, 1e-3, bodies=[{"name": "ball", **thrown, **more}], planes=[floor]).final
    assert final.velocity[0, 0] == pytest.approx(speed - min(2 / 7 * speed, 0.2 * 1.6 * 2.0), abs=1e-9)


@pytest.mark.parametrize("shape", ["sphere", "capsule"])
def test_what_passes_edges_without_touching_goes_straight_on(shape: str) -> None:
    """Past the edges of two boxes, by 0.1 to 1 mm: contacts ahead of an impact had thrown back one in thirty."""
    boxes = [
        ([0, -0.1, 0], [2, 0.2, 2]),
        ([0.5, 0.05, 0], [0.2, 0.1, 0.3]),
        ([-0.5, 0.15, 0], [0.1, 0.3, 0.4]),
    ]
    colliders = [{"type": "union", "of": [{"type": "box", "center": c, "size": s} for c, s in boxes]}]
    size = {"type": shape, "radius": R} | ({"length": 0.1} if shape == "capsule" else {})
    rng = np.random.default_rng(2)
    for clear, speed in itertools.product((1e-4, 1e-3), (1.0, 4.0, 9.0, 20.0)):
        # Along x + y over an edge of the second box that is along z, and beside it: the ball is nearest in the middle.
        half = np.array([0.4, 0.1, 0.0]) + (R + clear) * np.array([-1, 1, 0]) / math.sqrt(2)
        v = speed * np.array([1, 1, 0]) / math.sqrt(2)
        x = half - rng.uniform(4, 5) * H * v
        body = {"name": "body", "shape": size, "position": x.tolist(), "velocity": v.tolist(), **ELASTIC}
        got = simulate(10 * H, H, bodies=[body], colliders=colliders).final
        assert (got.velocity[0] == v).all()


def gas(shape: str, *, room: bool) -> Simulation:
    """27 bodies that fly and turn, 0.8 cm in a step, and rebound from each other, or from a room too."""
    rng, bodies = np.random.default_rng(4), []
    for k, place in enumerate(itertools.product((-0.12, 0.0, 0.12), repeat=3)):
        motion = {"velocity": rng.normal(0, 2, 3).tolist(), "angular_velocity": rng.normal(0, 10, 3).tolist()}
        bodies += [{"name": f"body{k}", "shape": SHAPES[shape], "position": list(place), **motion, **ELASTIC}]
    walls = (
        [{"type": "box", "center": [0, 0, 0], "size": [0.45] * 3, "inside": True, **ELASTIC}] if room else []
    )
    return Simulation(ps.from_table(table(400 * H, H, bodies=bodies, colliders=walls)))


@pytest.mark.sampled(8)
@pytest.mark.parametrize("room", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_gas_of_elastic_bodies_keeps_what_there_is(shape: str, room: bool) -> None:
    """Energy, and momentum and angular momentum without a room. Impacts of several at once had taken 5 to 22 % of the energy
    in so long; that of balls is kept to rounding. That of what turns swings by the square of a turn, and bodies with edges
    may overlap a little where one of them comes to two others in a step."""
    simulation, rows = gas(shape, room=room), []
    for step in range(0, 401, 10):
        simulation.advance_to(step)
        row = simulation.ledger()
        names = [f"{name}.{axis}" for name in ("momentum", "angular_momentum") for axis in "xyz"]
        rows.append([row["kinetic"], *(row[name] for name in names)])
    simulation.close()
    kept = np.array(rows)
    assert abs(kept[:, 0] / kept[0, 0] - 1).max() < (1e-12 if shape == "sphere" else 1e-3)
    if not room:
        scale = abs(kept[0, 1:]).max()
        assert abs(kept[:, 1:4] - kept[0, 1:4]).max() < 1e-12 * scale
        assert abs(kept[:, 4:] - kept[0, 4:]).max() < (1e-3 if shape == "box" else 1e-11) * scale


def test_boxes_that_meet_at_edges_and_corners_do_not_overlap() -> None:
    """Two boxes turned at random that turn, 8 mm in a step: momentum and angular momentum are kept to rounding. Of boxes
    that were nearest beside the face that parts them best nothing was known until they overlapped, and edges within 14
    degrees of a face counted as that: they came into each other by up to a fifth of their size, and were pushed apart."""
    rng, speed, bodies = np.random.default_rng(7), 4.0, list[dict[str, Any]]()
    for k in range(60):
        way = rng.uniform(0.2, 0.25)
        for side in (-1, 1):
            x = [side * 0.5 * way, 0.5 * k + side * rng.uniform(0, 0.02), side * rng.uniform(0, 0.02)]
            turn = {"axis": rng.normal(size=3).tolist(), "angle": float(rng.uniform(0, 180))}
            motion = {"velocity": [-0.5 * side * speed, 0, 0]}
            motion |= {"angular_velocity": (30.0 * rng.normal(size=3)).tolist()}
            place = {"name": f"b{k}{side}", "shape": SHAPES["box"], "position": x, "orientation": turn}
            bodies.append(place | motion | ELASTIC)
    simulation = Simulation(ps.from_table(table(80 * H, H, bodies=bodies)))
    island: Any = simulation.islands[0]
    before, deepest = simulation.ledger(), 0.0
    for step in range(1, 81):
        simulation.advance_to(step)
        k = island._contacts
        look_for_contacts(island._scene, island.bodies(), k, island._motion, island.memory, step * H)
        deepest = max(deepest, -k.gap[: k.number[0]].min(initial=0.0))
    after = simulation.ledger()
    hits = sum(abs(state.v[0, 0]) != 0.5 * speed for state in simulation.states)
    simulation.close()
    assert hits > 60
    assert deepest < 1e-6
    for name, scale in (("momentum", 1.0), ("angular_momentum", 30.0)):  # they are up to 30 m from the origin
        for axis in "xyz":
            gained = after[f"{name}.{axis}"] - before[f"{name}.{axis}"]
            assert abs(gained) < 1e-13 * scale * before["kinetic"]
    assert abs(after["kinetic"] / before["kinetic"] - 1) < 1e-4
