"""Rigid bodies against closed forms and conservation laws: how they turn, roll, slide, bounce, and stand on each other."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import ellipk
from simulate import EPS, G, record, simulate, table

import particlesim as ps
from particlesim.bodies import Bodies
from particlesim.bodies.shape import BallBody, BodyShape, BoxBody, CapsuleBody
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.bodies import WORLD
from particlesim.engine.rigid.rolling import Rolling, radius
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.simulation import Simulation
from particlesim.engine.world import World
from particlesim.runs.first_state import misplaced
from particlesim.scenario.dump import dump

Array = NDArray[np.float64]
GRAVITY = [{"type": "gravity"}]
FLOOR = {"normal": [0, 1, 0]}
BRICK = {"type": "box", "size": [0.1, 0.2, 0.4]}


def body(shape: Any = BRICK, **other: Any) -> dict[str, Any]:
    return {"name": "body", "shape": shape, **other}


def ball(radius: float = 0.1, **other: Any) -> dict[str, Any]:
    return body({"type": "sphere", "radius": radius}, **other)


def ledger(result: ps.Result) -> dict[str, Array]:
    return {name: np.asarray(values) for name, values in result.ledger.items()}


# ---- shapes


@pytest.mark.parametrize(
    "shape",
    [BallBody(radius=0.3), BoxBody(size=(0.1, 0.5, 0.3)), CapsuleBody(radius=0.2, length=0.7)],
    ids=lambda shape: shape.type,
)
def test_volume_and_inertia_are_those_of_the_surface(shape: BodyShape) -> None:
    # Integrals over a solid from its triangles: ∫ x_k² dV = Σ det/60 (Σ c_k² + Σ_{a<b} c_k^a c_k^b) over tetrahedra from 0.
    surface = shape.triangles()
    corners = surface.corners[surface.faces]
    sizes = np.linalg.det(corners)
    volume = sizes.sum() / 6
    a, b, c = corners.transpose(1, 0, 2)
    spread = (sizes[:, None] * (a * a + b * b + c * c + a * b + b * c + c * a)).sum(axis=0) / 60
    # The polygons of a round surface, 48 about and 24 along, are inside of it: by about (2π/48)²/6 = 0.3 % in area.
    rough = 1e-12 if shape.type == "box" else 0.015
    assert volume == pytest.approx(shape.volume(), rel=rough)
    assert spread == pytest.approx(shape.spread(), rel=2 * rough)
    assert np.linalg.norm(surface.corners, axis=1).max() == pytest.approx(shape.reach(), rel=1e-12)


def test_a_body_has_the_mass_of_its_density() -> None:
    made = Bodies.model_validate({"shape": BRICK, "density": 500})
    assert made.weight == pytest.approx(500 * 0.1 * 0.2 * 0.4)
    assert made.inertia() == pytest.approx(made.weight / 12 * np.array([0.2, 0.17, 0.05]))


# ---- free rotation


def spun(tmp_path: Path, h: float, duration: float = 4.0) -> ps.Trajectory:
    """A brick that turns about its intermediate axis, nearly."""
    brick = body(angular_velocity=[0.05, 5.0, 0.0], mass=12.0)
    every = {"every": round(0.02 / h), "ledger": True}
    return record(tmp_path / f"{h}.vtkhdf", duration, h, bodies=[brick], output=every)


def test_the_ledger_counts_spin_and_orbit() -> None:
    """A ball away from the origin: L = r × m v + 2/5 m R² ω, K = ½ m v² + ½ · 2/5 m R² ω², U = m g y."""
    m, radius, x, v, w = 3.0, 0.2, [1.0, -2, 0.5], [0.3, 0.7, -1.1], [2.0, -5, 11]
    result = simulate(
        0.01,
        0.01,
        bodies=[ball(radius, mass=m, position=x, velocity=v, angular_velocity=w)],
        forces=GRAVITY,
        output={"ledger": True},
    )
    told = {name: values[0] for name, values in ledger(result).items()}
    inertia = 0.4 * m * radius**2
    expected = m * np.cross(x, v) + inertia * np.array(w)
    assert [told[f"angular_momentum.{axis}"] for axis in "xyz"] == pytest.approx(expected, rel=1e-14)
    assert told["potential.gravity"] == pytest.approx(m * G * x[1], rel=1e-14)
    assert told["kinetic"] == pytest.approx(0.5 * m * np.dot(v, v) + 0.5 * inertia * np.dot(w, w), rel=1e-14)


def test_the_energy_of_rotation_is_a_column_and_can_be_checked() -> None:
    # ½ ω·I ω of a box, I = m/12 (b² + c²) and so on in its own axes, which keep their directions while it turns about one.
    m, (a, b, c), w = 3.0, (0.1, 0.2, 0.4), 5.0
    leaning = np.array([2.0, -5.0, 11.0])
    inertia = m / 12 * np.array([b * b + c * c, c * c + a * a, a * a + b * b])
    turn = Rotation.from_rotvec([0.3, -0.7, 0.4])
    frame = {"axis": turn.as_rotvec().tolist(), "angle": math.degrees(turn.magnitude())}
    told = simulate(
        0.01,
        0.01,
        bodies=[body(mass=m, velocity=[1, 2, 3], angular_velocity=leaning.tolist(), orientation=frame)],
        output={"ledger": True},
    ).ledger
    own = turn.inv().apply(leaning)
    assert told["kinetic.rotation"][0] == pytest.approx(0.5 * inertia @ own**2, rel=1e-12)
    assert told["kinetic"][0] - told["kinetic.rotation"][0] == pytest.approx(0.5 * m * 14, rel=1e-12)

    energy = 0.5 * inertia[1] * w * w
    checks = [
        {"quantity": "kinetic.rotation", "equals": energy, "tolerance": 1e-12 * energy, "at": "always"},
        {
            "quantity": "angular_velocity.y",
            "statistic": "max",
            "equals": w,
            "tolerance": 1e-12,
            "at": "always",
        },
    ]
    result = simulate(0.5, 0.01, bodies=[body(mass=m, angular_velocity=[0, w, 0])], checks=checks)
    assert all(check.passed for check in result.checks)
    checks[0]["equals"] = 1.001 * energy
    result = simulate(0.5, 0.01, bodies=[body(mass=m, angular_velocity=[0, w, 0])], checks=checks)
    assert [check.passed for check in result.checks] == [False, True]
    # Grains that turn: ½ · 2/5 m r² ω². Where nothing turns there is no such quantity.
    grain = {"layout": {"type": "points", "position": [[0, 0, 0]]}, "radius": 0.1, "mass": 2.0}
    grain["angular_velocity"] = [0, 0, w]
    rough = {"type": "contact", "model": "impulse", "friction": 0.5}
    told = simulate(0.01, 0.01, particles=[grain], interactions=[rough], output={"ledger": True}).ledger
    assert told["kinetic.rotation"] == pytest.approx([0.2 * 2.0 * 0.1**2 * w * w] * 2, rel=1e-14)
    del grain["angular_velocity"]
    assert "kinetic.rotation" not in simulate(0.01, 0.01, particles=[grain], output={"ledger": True}).ledger
    with pytest.raises(ps.ScenarioError, match=r"kinetic\.rotation"):
        ps.from_table(table(0.01, 0.01, particles=[grain], checks=checks[:1]))


def test_free_rotation_keeps_angular_momentum_and_swings_in_energy(tmp_path: Path) -> None:
    swings = []
    for h in (5e-3, 2.5e-3):
        rows = spun(tmp_path, h).ledger
        kinetic = np.asarray(rows["kinetic"])
        for axis in "xyz":
            spin = np.asarray(rows[f"angular_momentum.{axis}"])
            assert (spin == spin[0]).all()  # nothing touches it
        assert kinetic[0] == pytest.approx(0.5 * (0.2 * 0.05**2 + 0.17 * 5**2))
        swings.append(np.abs(kinetic / kinetic[0] - 1).max())
        assert swings[-1] < (5 * h) ** 2  # (ω h)² times less than one
    assert 3.8 < swings[0] / swings[1] < 4.2


def test_the_flip_about_the_intermediate_axis_has_its_period(tmp_path: Path) -> None:
    # Landau and Lifshitz, Mechanics, § 37, with I₁ < I₂ < I₃ and L² > 2 E I₂: T = 4 K(k) √(I₁I₂I₃/((I₃−I₂)(L²−2EI₁))),
    # k² = (I₂−I₁)(2EI₃−L²)/((I₃−I₂)(L²−2EI₁)); L along the intermediate axis changes its sign twice in a period.
    i3, i2, i1 = 0.2, 0.17, 0.05
    energy, square = 0.05**2 * i3 + 25 * i2, (0.05 * i3) ** 2 + (5 * i2) ** 2
    assert square > energy * i2
    under = (i3 - i2) * (square - energy * i1)
    m = (i2 - i1) * (energy * i3 - square) / under
    period = 4 * ellipk(m) * math.sqrt(i1 * i2 * i3 / under)
    errors = []
    for h in (5e-3, 2.5e-3):
        frames = spun(tmp_path, h, 8.0)
        spin = np.array([0.05 * i3, 5 * i2, 0.0])
        times, turns = zip(*((frame.time, frame["orientation"][0]) for frame in frames), strict=True)
        along = np.array([np.reshape(matrix(q), (3, 3))[:, 1] @ spin for q in turns])
        at = np.flatnonzero(along[:-1] * along[1:] < 0)
        crossings = np.array(times)[at] + along[at] / (along[at] - along[at + 1]) * np.diff(times)[at]
        assert len(crossings) >= 2
        errors.append(abs(2 * (crossings[-1] - crossings[0]) / (len(crossings) - 1) / period - 1))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3  # second order


def test_rotation_is_of_second_order(tmp_path: Path) -> None:
    ends = [spun(tmp_path, h, 1.0)[-1]["orientation"][0] for h in (5e-3, 2.5e-3, 1.25e-3)]
    first, second = np.linalg.norm(ends[0] - ends[1]), np.linalg.norm(ends[1] - ends[2])
    assert 3.7 < first / second < 4.3


# ---- slopes


@pytest.mark.sampled(6)
@pytest.mark.parametrize("mu", [0.1, 0.5])
@pytest.mark.parametrize(
    "shape",
    [
        {"type": "box", "size": [0.2, 0.2, 0.2]},
        {"type": "box", "size": [0.4, 0.1, 0.2]},
        {"type": "cylinder", "radius": 0.1, "length": 0.1},
    ],
    ids=["cube", "brick", "cylinder"],
)
def test_what_slides_askew_is_slowed_against_its_way(shape: dict[str, Any], mu: float) -> None:
    """v t − μ g t²/2 along its way, to rounding, and it turns nowhere: friction presses at the centre of what bears it,
    which is ahead along the way. Each of two directions had its own mass, which took a brick aside by a tenth of its way."""
    height = shape["size"][1] if shape["type"] == "box" else 0.1
    upright = {"axis": [1, 0, 0], "angle": 90.0} if shape["type"] == "cylinder" else None
    for yaw, heading in ((0.0, 30.0), (20.0, 30.0), (45.0, -70.0)):
        way = np.array([math.cos(math.radians(heading)), 0.0, math.sin(math.radians(heading))])
        facing = upright or {"axis": [0, 1, 0], "angle": yaw}
        slides = body(shape, mass=1.0, friction=mu, restitution=0.0, orientation=facing)
        slides |= {"position": [0, height / 2, 0], "velocity": (3.0 * way).tolist()}
        time = 0.5
        floor = FLOOR | {"friction": mu, "restitution": 0.0}
        got = simulate(time, 1e-3, bodies=[slides], planes=[floor], forces=GRAVITY).final
        expected = (3.0 * time - mu * G * time**2 / 2) * way + [0, height / 2, 0]
        # a rim stands on places that change with its way
        rounds = 1e-8 if shape["type"] == "cylinder" else 1e-9
        assert np.abs(got.position[0] - expected).max() < rounds
        assert np.abs(got.velocity[0] - (3.0 - mu * G * time) * way).max() < rounds
        assert np.abs(got.angular_velocity[0]).max() < rounds


def slope(
    angle: float, thing: dict[str, Any], mu: float | dict[str, float], duration: float = 0.5
) -> tuple[Array, Array, Array]:
    """Direction down a slope, and velocity and angular velocity of a body that starts on it at rest."""
    c, s = math.cos(angle), math.sin(angle)
    plane = {"normal": [-s, c, 0], "restitution": 0.0, "friction": mu}
    result = simulate(duration, 1e-3, bodies=[thing], forces=GRAVITY, planes=[plane])
    return np.array([-c, -s, 0.0]), result.final["velocity"][0], result.final["angular_velocity"][0]


@pytest.mark.parametrize("part", [0.5, 0.95, 1.05, 2.0])
def test_a_ball_rolls_as_long_as_friction_holds_it(part: float) -> None:
    # Solid balls roll with 5/7 g sin θ up to tan θ = 7/2 μ; above they slide with g (sin θ − μ cos θ) and spin up with
    # 5 μ g cos θ/(2 r).
    angle, r, time = 0.4, 0.1, 0.5
    mu = math.tan(angle) / (3.5 * part)
    place = [-r * math.sin(angle), r * math.cos(angle), 0]
    down, v, w = slope(angle, ball(r, position=place), mu, time)
    if part < 1:
        speed, turning = 5 / 7 * G * math.sin(angle) * time, 5 / 7 * G * math.sin(angle) * time / r
    else:
        speed = G * (math.sin(angle) - mu * math.cos(angle)) * time
        turning = 2.5 * mu * G * math.cos(angle) * time / r
    assert v @ down == pytest.approx(speed, rel=1e-6)
    assert w[2] == pytest.approx(turning, rel=1e-6)


def test_rolling_friction_brings_balls_to_rest_and_holds_them() -> None:
    # With the moment μ_r r N a ball is braked by 5/7 μ_r g, on a floor and on a heavy slab, and rests for good after
    # 7 v²/(10 μ_r g); down a slope it rolls with 5/7 g (sin θ − μ_r cos θ), or not at all up to tan θ = μ_r.
    r, mu, time = 0.1, 0.1, 0.8
    slab = body({"type": "box", "size": [9, 0.2, 1]}, position=[0, 0.1, 5], density=1e6, friction=2.0)
    parts = [slab | {"name": "slab"}]
    planes = [FLOOR | {"friction": 0.8, "on": ["slab", "floor"]}]
    for name, place in (("floor", [0, r, 0]), ("on_slab", [0, 0.2 + r, 5])):
        rolling = ball(r, position=place, velocity=[0.5, 0, 0], angular_velocity=[0, 0, -0.5 / r])
        parts.append(rolling | {"name": name, "rolling_friction": mu, "density": 1.0, "friction": 2.0})
    for name, slant in (("held", 0.9 * mu), ("rolls", 1.5 * mu)):
        n = np.array([slant, 1, 0]) / math.hypot(slant, 1)
        parts.append(
            ball(r, position=(r * n + [0, 0, 90 * slant]).tolist()) | {"name": name, "rolling_friction": mu}
        )
        planes.append({"normal": n.tolist(), "friction": 0.8, "on": [name]})
    output = {"ledger": True, "work": True}
    result = simulate(time, 2e-3, bodies=parts, planes=planes, forces=GRAVITY, output=output)
    speed, way = np.linalg.norm(result.final.velocity, axis=1), result.final.position[:, 0]
    stop = 7 * 0.5**2 / (10 * mu * G)
    assert way[1:3] == pytest.approx([stop, stop], rel=1e-5)
    assert speed[1:4] == pytest.approx([0, 0, 0], abs=1e-9)
    theta = math.atan(1.5 * mu)
    down = 5 / 7 * G * (math.sin(theta) - mu * math.cos(theta)) * time
    assert speed[4] == pytest.approx(down, rel=1e-9)
    assert abs(result.ledger["balance"][-1]) < 1e-7 * abs(result.ledger["work.contact"][-1])


def test_the_radius_of_rolling_is_the_reduced_one_of_round_bodies() -> None:
    rolling = Rolling(np.array([0.1, 0.0]), np.array([0.0, 1.0]))
    b = SimpleNamespace(group=np.array([0, 0, 1]), x=np.array([[0, 0, 0], [0.1, -0.3, 5.0], [0, 0, 0]]))
    k = SimpleNamespace(first=[0, 0, 0], second=[WORLD, 1, 2], point=np.zeros((3, 3)))
    k.normal = np.array([[0, 0, 0], [1.0, 1.0, 1.0], [0, 0, 0]])
    k.gap = [0.0, 0.0, 0.0]
    assert [radius(rolling, b, k, c) for c in range(3)] == pytest.approx([0.1, 0.1 * 0.3 / 0.4, 0.1])
    k.gap = [0.02, 0.02, 0.0]  # as they are once it is closed
    assert [radius(rolling, b, k, c) for c in range(2)] == pytest.approx([0.08, 0.09 * 0.29 / 0.38])


@pytest.mark.parametrize("kept", [1.0, 0.5], ids=["one", "less in motion"])
@pytest.mark.parametrize("part", [0.9, 0.999, 1.001, 1.5])
def test_a_block_holds_up_to_its_friction_angle(part: float, kept: float) -> None:
    # It holds with all of its friction at rest, and slides from then on with that in motion: a = g (sin θ − μ_k cos θ).
    static, time = 0.5, 0.5
    angle = math.atan(static * part)
    block = body(
        {"type": "box", "size": [0.4, 0.1, 0.3]},
        position=[-0.05 * math.sin(angle), 0.05 * math.cos(angle), 0],
        orientation={"axis": [0, 0, 1], "angle": math.degrees(angle)},
    )
    kinetic = kept * static
    down, v, w = slope(angle, block, {"static": static, "kinetic": kinetic}, time)
    expected = G * (math.sin(angle) - kinetic * math.cos(angle)) * time if part > 1 else 0.0
    assert v @ down == pytest.approx(expected, abs=1e-9)
    assert np.abs(w).max() < 1e-9


SHAKEN = {"level": ["x + a*sin(w*t)", "y", "z"], "up and down": ["x", "y + a*sin(w*t)", "z"]}


@pytest.mark.parametrize("dt", [1e-3, 4e-3])
@pytest.mark.parametrize("way", SHAKEN)
def test_a_block_keeps_its_place_on_a_table_that_is_shaken(way: str, dt: float) -> None:
    # It is held with up to 0.39 g by a friction of 0.4, and pressed on by 0.2 g at least; it begins as fast as the table.
    # A step may leave it off by what a steady acceleration does in a quarter of it, a h²/8; none of that adds up.
    most, w = (0.39 if way == "level" else 0.8) * G, 6 * math.pi
    a = most / w**2
    start = [a * w, 0, 0] if way == "level" else [0, a * w, 0]
    block = body({"type": "box", "size": [0.2, 0.1, 0.2]}, position=[0, 0.1, 0], velocity=start)
    table_top = {
        "type": "box",
        "size": [2, 0.1, 2],
        "restitution": 0.0,
        "friction": {"static": 0.4, "kinetic": 0.2},
    }
    led = {"collider": "table", "path": SHAKEN[way], "constants": {"a": a, "w": w}}
    parts = {"colliders": [{"name": "table", **table_top}], "motions": [led], "forces": GRAVITY}
    simulation = Simulation(ps.from_table(table(1.0, dt, bodies=[block], **parts)))
    (state,) = simulation.states
    for step in range(1, simulation.scenario.grid.steps + 1):
        simulation.advance_to(step)
        place = a * math.sin(w * step * dt)
        at = [place, 0.1, 0] if way == "level" else [0, 0.1 + place, 0]
        assert np.abs(state.x[:, 0] - at).max() < 1.01 * most * dt**2 / 8 + 1e-9


def test_a_block_keeps_its_place_on_a_turntable_as_long_as_friction_holds_it() -> None:
    # It needs ω² r, and has up to μ_s g; in two turns at 0.98 of that its radius does not change.
    r, static = 0.5, 0.5
    w = math.sqrt(0.98 * static * G / r)
    block = body(
        {"type": "box", "size": [0.05, 0.02, 0.05]},
        position=[r, 0.06, 0],
        velocity=[0, 0, -w * r],
        angular_velocity=[0, w, 0],
    )
    disc = {
        "type": "cylinder",
        "start": [0, -0.05, 0],
        "end": [0, 0.05, 0],
        "radius": 1.0,
        "restitution": 0.0,
    }
    turns = {"collider": "disc", "spin": {"axis": [0, 1, 0], "rate": w}}
    final = simulate(
        4.0,
        1e-3,
        bodies=[block],
        colliders=[{"name": "disc", **disc, "friction": {"static": static, "kinetic": 0.4}}],
        motions=[turns],
        forces=GRAVITY,
    ).final
    assert np.hypot(*final.position[0, [0, 2]]) == pytest.approx(r, abs=1e-7)
    assert final.angular_velocity[0, 1] == pytest.approx(w, abs=1e-7)


@pytest.mark.parametrize("dt", [5e-3, 1e-3])
def test_a_ball_rolls_on_a_turntable_in_circles_at_two_sevenths_of_its_rate(dt: float) -> None:
    # v' = 2/7 W × v for a solid ball that does not slip (K. Weltner, Am. J. Phys. 47, 984 (1979)): with a constant speed.
    rate, r, time, start = 3.0, 0.05, 6.0, np.array([0.0, 0.0, 0.25])
    place = np.array([0.3, r, 0.0])
    slip = np.cross([0, rate, 0], place) - start
    rolls = ball(
        r,
        position=place.tolist(),
        velocity=start.tolist(),
        angular_velocity=np.cross([0, 1, 0], -slip / r).tolist(),
    )
    disc = {"name": "disc", "type": "plane", "friction": 2.0, "restitution": 0.0}
    led = {"collider": "disc", "spin": {"axis": [0, 1, 0], "rate": rate}}
    v = simulate(time, dt, bodies=[rolls], colliders=[disc], motions=[led], forces=GRAVITY).final.velocity[0]
    turned = 2 / 7 * rate * time
    # The speed is kept to second order, and so is the rate: off by (ω h)²/12 or so of the angle.
    assert np.linalg.norm(v) == pytest.approx(0.25, rel=0.1 * (rate * dt) ** 2)
    expected = 0.25 * np.array([math.sin(turned), 0, math.cos(turned)])
    assert np.abs(v - expected).max() < 0.25 * turned * (rate * dt) ** 2


# ---- bounces


def test_heights_of_bounces_fall_with_the_square_of_restitution(tmp_path: Path) -> None:
    e, height, r = 0.8, 1.0, 0.1
    frames = record(
        tmp_path / "bounces.vtkhdf",
        2.2,
        1e-4,
        bodies=[ball(r, position=[0, height + r, 0])],
        forces=GRAVITY,
        planes=[FLOOR | {"restitution": e}],
        output={"every": 50},  # tops are missed by up to g (h every)²/8 = 3e-5 m
    )
    y = np.array([frame.position[0, 1] for frame in frames]) - r
    tops = y[1:-1][(y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:])]
    assert len(tops) >= 2
    # An impact is taken at a step, up to h early: a height is off by up to about 2 v h = 9e-4 m.
    assert tops[:2] == pytest.approx([e**2, e**4], abs=2e-3)


@pytest.mark.parametrize("beside", [0.0, 0.07])
def test_two_balls_keep_momentum_angular_momentum_and_energy(beside: float) -> None:
    one = ball(name="one", position=[-0.5, 0, 0], velocity=[2, 0, 0], restitution=1.0, friction=0.0)
    two = ball(name="two", position=[0.5, beside, 0], density=3000.0, restitution=1.0, friction=0.0)
    result = simulate(
        1.0, 1e-3, bodies=[one | {"name": "one"}, two | {"name": "two"}], output={"ledger": True}
    )
    rows = ledger(result)
    size = {"kinetic": rows["kinetic"][0]} | {
        f"{name}.{axis}": 2 * 4.2 for name in ("momentum", "angular_momentum") for axis in "xyz"
    }
    for name, scale in size.items():
        assert rows[name][-1] == pytest.approx(rows[name][0], abs=200 * EPS * scale), name
    v = result.final["velocity"]
    if beside == 0:  # masses 1 : 3
        assert v[:, 0] == pytest.approx([-1.0, 1.0], abs=1e-12)
    else:
        assert v[1, 1] > 0.1


# ---- stacks


@pytest.mark.optimised
@pytest.mark.parametrize("seconds", [30, pytest.param(100, marks=pytest.mark.slow)])
def test_a_stack_of_ten_boxes_stands(seconds: int) -> None:
    n, side = 10, 0.1
    stack = body(
        {"type": "box", "size": [side] * 3},
        layout={"type": "lattice", "spacing": side, "counts": [1, n, 1], "origin": [0, side / 2, 0]},
    )
    floor = FLOOR | {"restitution": 0.0, "friction": 0.5}
    parts: dict[str, Any] = {"bodies": [stack], "forces": GRAVITY, "planes": [floor]}
    world = Simulation(ps.from_table(table(2.0 + seconds, 1e-3, **parts)), threads=1)
    world.advance_to(2_000)
    early = world.states[0].position.copy()
    world.advance_to(2_000 + 1_000 * seconds)
    late = world.states[0].position
    assert np.abs(late - early).max() < 1e-11 * seconds  # m; 2e-10 seen in 10⁵ steps
    # Impulses are found from nothing in the first step: what is wrong with them then sets the stack in motion.
    assert np.abs(late - [[0, side * (k + 0.5), 0] for k in range(n)]).max() < 2e-6


def test_boxes_that_fall_on_each_other_do_not_sink_in() -> None:
    # Planks that fall nearly flat: one point, where two edges cross, would let them rock through each other.
    planks = body(
        {"type": "box", "size": [0.4, 0.05, 0.2]},
        layout={"type": "points", "position": [[0.02 * k, 0.05 + 0.15 * k, 0.03 * k] for k in range(6)]},
        orientation={"axis": [0.3, 0.1, 1], "angle": 4},
    )
    planks["layout"]["velocity"] = [[0, -4, 0]] * 6
    scenario = ps.from_table(
        table(1.0, 2e-3, bodies=[planks], forces=GRAVITY, planes=[FLOOR | {"restitution": 0.0}])
    )
    world = Simulation(scenario, threads=1)
    island = world.islands[0]
    assert isinstance(island, RigidIsland)
    deepest = 0.0
    for step in range(10, 500, 10):
        world.advance_to(step)
        deepest = max(deepest, max((each.depth for each in island.intrusions()), default=0.0))
    # They fall 8 mm in a step. 0.05 mm are seen; it is 2 mm with edges in place of faces.
    assert deepest < 5e-4


@pytest.mark.parametrize("large", [0.0, 1.5])
def test_all_bodies_that_touch_are_found(large: float) -> None:
    # Against all pairs; a large one among small ones makes the strips wide.
    rng = np.random.default_rng(5)
    place = rng.uniform(0, 3, (300, 3)) * [2.0, 1.0, 3.0]
    balls = [
        ball(0.15, layout={"type": "points", "position": place.tolist()}),
        ball(0.05, layout={"type": "points", "position": (place[::2] + np.array([0.1, 0.0, 0.12])).tolist()}),
    ]
    if large:
        balls.append(ball(large, position=[3.0, 1.0, 4.0]))
    groups = [each | {"name": name} for each, name in zip(balls, "abc", strict=False)]
    world = Simulation(ps.from_table(table(1.0, 1e-3, bodies=groups)), threads=1)
    island = world.islands[0]
    assert isinstance(island, RigidIsland)
    b = island.bodies()
    found = {tuple(sorted((each.body, each.other))) for each in island.intrusions()}  # type: ignore[type-var]
    apart = np.linalg.norm(b.x[:, :, None] - b.x[:, None], axis=0)
    i, j = np.nonzero(np.triu(apart < b.reach[:, None] + b.reach - 1e-3, 1))
    names = [(state.name, k) for state in world.states for k in range(state.count)]
    wanted = {tuple(sorted((names[m], names[n]))) for m, n in zip(i, j, strict=True)}
    assert len(wanted) > 150
    assert wanted <= found


# ---- energy


@pytest.mark.parametrize(("restitution", "friction"), [(0.8, 0.4), (1.0, 0.4), (0.9, 1.0)])
def test_an_impact_gives_nothing_back_of_the_kick_before_it(restitution: float, friction: float) -> None:
    """A box lands nearly flat on an edge, where rebounds with friction would gain (Kane and Levinson): what is left has the
    energy of the step, and not that of the middle of it, into which gravity has taken it down and from which it goes up."""
    box = body(
        {"type": "box", "size": [0.2, 0.2, 0.2]},
        mass=50.0,
        position=[0.2955495458637407, 0.10655700929973974, -0.10397795703321458],
        velocity=[0.4873027996250753, -0.3079937342378355, 0.08226918634192462],
        angular_velocity=[13.096513764285243, 1.249367267798801, 9.855051190697],
        orientation={
            "axis": [-0.01660161221992018, 0.006917708457967669, -0.6945589879839007],
            "angle": 88.02125858756489,
        },
    )
    floor = FLOOR | {"restitution": restitution, "friction": friction}
    output = {"every": 1, "ledger": True}
    ended = simulate(0.01, 2.5e-4, bodies=[box], forces=GRAVITY, planes=[floor], output=output)
    assert np.diff(ended.energy).max() < 1e-12 * ended.energy[0]


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 6))])
def test_energy_is_never_gained(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes: list[dict[str, Any]] = [
        {"type": "sphere", "radius": 0.15},
        {"type": "box", "size": rng.uniform(0.1, 0.4, 3).tolist()},
        {"type": "capsule", "radius": 0.1, "length": 0.3},
    ]
    groups = [
        {
            "name": shape["type"],
            "shape": shape,
            "density": float(rng.uniform(200, 4000)),
            "restitution": float(rng.uniform(0, 1)),
            "friction": float(rng.uniform(0, 1)),
            "orientation": "random",
            "angular_velocity": rng.uniform(-10, 10, 3).tolist(),
            "layout": {
                "type": "points",
                "position": [[0.6 * k, 0.4 + 0.6 * row, 0.6 * j] for k in range(2) for j in range(2)],
                "velocity": rng.uniform(-3, 3, (4, 3)).tolist(),
            },
        }
        for row, shape in enumerate(shapes)
    ]
    walls = [
        {
            "normal": normal,
            "point": at,
            "restitution": float(rng.uniform(0, 1)),
            "friction": float(rng.uniform(0, 1)),
        }
        for normal, at in (
            ([0, 1, 0], [0, 0, 0]),
            ([1, 0, 0], [-0.5, 0, 0]),
            ([-1, 0, 0], [1.1, 0, 0]),
            ([0, 0, 1], [0, 0, -0.5]),
            ([0, 0, -1], [0, 0, 1.1]),
        )
    ]
    result = simulate(
        1.5, 1e-3, seed=seed, bodies=groups, forces=GRAVITY, planes=walls, output={"every": 1, "ledger": True}
    )
    rows = ledger(result)
    energy = rows["kinetic"] + rows["potential.gravity"]
    # Free rotation swings by (ω h)² of its energy, and what is pushed apart is lifted by less than the slop.
    assert np.diff(energy).max() < 1e-4 * energy[0]
    assert energy[-1] < energy[0]


# ---- what moves them


def test_a_collider_that_moves_takes_bodies_along() -> None:
    plate = {
        "name": "plate",
        "type": "box",
        "center": [0, -0.1, 0],
        "size": [4, 0.2, 4],
        "friction": 2.0,
        "restitution": 0,
    }
    lift = {"collider": "plate", "path": ["0.5*t**2", "-0.1 + 0.3*t", "0"]}
    block = body({"type": "box", "size": [0.4, 0.1, 0.4]}, position=[0, 0.05, 0])
    result = simulate(
        1.0, 1e-3, bodies=[block], forces=GRAVITY, colliders=[plate | {"on": ["body"]}], motions=[lift]
    )
    assert result.final["velocity"][0] == pytest.approx([1.0, 0.3, 0.0], abs=2e-3)
    assert result.final["position"][0] == pytest.approx([0.5, 0.35, 0.0], abs=2e-3)


def test_a_box_falls_flat_on_the_tip_of_a_collider() -> None:
    # The round tip of a post meets the middle of a face, which no corner and no edge of the box sees.
    post = {
        "name": "post",
        "type": "capsule",
        "start": [0, -1, 0],
        "end": [0, 0, 0],
        "radius": 0.02,
        "restitution": 0.0,
    }
    plate = body({"type": "box", "size": [0.4, 0.04, 0.4]}, position=[0, 0.3, 0])
    result = simulate(1.0, 1e-3, bodies=[plate], forces=GRAVITY, colliders=[post])
    assert result.final["position"][0] == pytest.approx([0, 0.04, 0], abs=1e-4)


def test_a_gyroscope_keeps_its_axis_and_precesses_under_a_torque() -> None:
    # The field m k z along y has no force on a wheel with its axis along z, but the torque −k ∫ z² dm about x. Of a fast one
    # that turns the axis by k ∫ z² dm/(I ω) a second towards −x; nutation, at ω I₃/I₁ = 320/s, adds 2e-4.
    wheel = body({"type": "box", "size": [0.2, 0.2, 0.1]}, mass=3.0, angular_velocity=[0, 0, 200.0])
    free = simulate(1.0, 1e-4, bodies=[wheel]).final
    assert free["angular_velocity"][0] == pytest.approx([0, 0, 200], rel=1e-12, abs=1e-10)
    k, mass = 50.0, 3.0
    inertia, spread = mass / 12 * 0.08, mass / 12 * 0.01
    field = {"type": "field", "force": ["0", f"m*{k}*z", "0"]}
    end = simulate(0.5, 1e-4, bodies=[wheel], forces=[field]).final
    axis = np.reshape(matrix(end["orientation"][0]), (3, 3))[:, 2]
    turned = k * spread / (inertia * 200.0) * 0.5
    assert turned == pytest.approx(0.0156, abs=1e-4)
    assert axis[:2] == pytest.approx([-turned, 0.0], abs=2e-4)
    assert np.abs(end["velocity"]).max() < 1e-12


# ---- the same bits


def heap() -> dict[str, Any]:
    boxes = body(
        BRICK,
        orientation="random",
        layout={"type": "lattice", "spacing": 0.45, "counts": [2, 3, 2], "origin": [0, 0.4, 0]},
    )
    return table(
        1.0,
        1e-3,
        bodies=[boxes],
        forces=GRAVITY,
        planes=[FLOOR | {"restitution": 0.3, "friction": 0.5}],
        output={"every": 50, "ledger": True},
    )


def test_the_same_bits_for_any_number_of_threads() -> None:
    scenario = ps.from_table(heap())
    one, two = (ps.run(scenario, threads=n) for n in (1, 2))
    for field in ("position", "orientation", "angular_velocity"):
        assert one.final[field].tobytes() == two.final[field].tobytes()
    assert ps.loads(dump(scenario)) == scenario


# ---- mistakes


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"motions": [{"on": "body", "path": ["t", "0", "0"]}]}, "motions lead"),
        ({"interactions": [{"type": "gravity", "on": ["body"]}]}, "acts between particles"),
        ({"planes": [FLOOR | {"contact": "kill"}]}, "do not die"),
        ({"planes": [FLOOR | {"contact": "stick"}]}, "do not stick"),
        ({"planes": [FLOOR | {"detection": "discrete"}]}, "ahead of time"),
        ({"planes": [FLOOR | {"tangential_loss": 0.1}]}, "friction"),
    ],
)
def test_what_bodies_cannot_do_is_refused(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.ScenarioError, match=message):
        ps.from_table(table(1.0, 1e-2, bodies=[body()], **parts))


@pytest.mark.parametrize("key", ["radius", "integrator", "springs", "cooling"])
def test_bodies_have_no_properties_of_particles(key: str) -> None:
    values: dict[str, Any] = {
        "radius": 0.1, "integrator": "rk4", "springs": {"structural": 1.0}, "cooling": {"rate": 1.0, "ambient": 0.0}
    }  # fmt: skip
    with pytest.raises(ps.ScenarioError, match=f"bodies have no {key}"):
        ps.from_table(table(1.0, 1e-2, bodies=[body(**{key: values[key]})]))


@pytest.mark.parametrize(("length", "at", "fits"), [(0.9, 0.3, True), (1.2, 0.0, False), (1.2, 0.4, False)])
def test_a_body_too_long_for_its_container_is_told(length: float, at: float, fits: bool) -> None:
    # Where it could be shifted until it fits it is only told how deep it is; off the middle it meets one wall at first.
    long = body({"type": "box", "size": [length, 0.5, 0.5]}, position=[at, 0, 0])
    crate = {"type": "box", "name": "crate", "center": [0, 0, 0], "size": [1, 1, 1], "inside": True}
    told = misplaced(World(ps.from_table(table(1e-3, 1e-3, bodies=[long], colliders=[crate]))))
    assert "start inside of others" in told[0]
    assert ["does not fit into box crate" in each for each in told[1:]] == ([] if fits else [True])


def test_bodies_that_start_inside_of_others_are_told_with_their_depth() -> None:
    pair = [body(name="a", position=[0, 0, 0]), body(name="b", position=[0.07, 0, 0])]
    pair = [each | {"name": name} for each, name in zip(pair, "ab", strict=True)]
    result = simulate(0.01, 1e-3, bodies=pair)
    assert any("0.03 m" in warning and "'a'" in warning for warning in result.warnings)


@pytest.mark.parametrize("radius", [1e-70, 1e70])
def test_sizes_that_no_inertia_has_are_refused(radius: float) -> None:
    with pytest.raises(ps.UsageError, match="no number holds"):
        simulate(0.01, 1e-3, bodies=[body({"type": "sphere", "radius": radius})])


def test_a_force_that_is_not_a_number_ends_the_run() -> None:
    bad = {"type": "field", "force": ["sqrt(0.5 - t)", "0", "0"]}
    with pytest.raises(ps.DivergenceError, match="body"):
        simulate(1.0, 1e-2, bodies=[body()], forces=[bad])


@pytest.mark.parametrize("speed", [0.3, 0.31, 0.317])
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_a_block_that_stops_on_its_way_up_a_slope_gains_nothing(speed: float, h: float) -> None:
    # Friction holds it, and stops it in a step in which its weight would turn it around.
    pull = {"type": "gravity", "acceleration": [float(-G * np.sin(0.4)), float(-G * np.cos(0.4)), 0.0]}
    block = body({"type": "box", "size": [0.1] * 3}, position=[0, 0.05, 0], velocity=[speed, 0, 0])
    floor = FLOOR | {"restitution": 0.0, "friction": 1.0}
    ledger = {"every": 1, "ledger": True}
    result = simulate(0.4, h, bodies=[block], forces=[pull], planes=[floor], output=ledger)
    energies = sum(np.array(result.ledger[name]) for name in ("kinetic", "potential.gravity"))
    assert np.diff(energies).max() < 1e-10 * energies[0]
    assert np.abs(result.final.velocity).max() < 1e-12


@pytest.mark.parametrize("rise", [0.2, 0.5, 0.8])
def test_what_parts_more_slowly_than_forces_turn_it_around_gains_nothing(rise: float) -> None:
    # It goes up by less than g h, and so would be on the floor again at the end of the step, with less than g h.
    h = 1e-2
    ball = body({"type": "sphere", "radius": 0.1}, position=[0, 0.1, 0], velocity=[0, rise * G * h, 0])
    floor, ledger = FLOOR | {"restitution": 0.0}, {"every": 1, "ledger": True}
    result = simulate(0.1, h, bodies=[ball], forces=GRAVITY, planes=[floor], output=ledger)
    energies = sum(np.array(result.ledger[name]) for name in ("kinetic", "potential.gravity"))
    assert np.diff(energies).max() < 1e-12 * energies[0]
    assert np.abs(result.final.velocity).max() < 1e-12
