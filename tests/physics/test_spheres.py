"""Balls that particles bounce off, bowls that they stay in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulate import EPS, G, energies, points, record, simulate
from support import careful, columns, position, program, run, velocity

import particlesim as ps
from particlesim.colliders import SphereCollider
from particlesim.engine.step.contacts import Careful, Simple
from particlesim.engine.step.records import contacts_record
from particlesim.groups.group import Particles

GRAVITY = [{"type": "gravity"}]


def ball(**options: Any) -> dict[str, Any]:
    return {"type": "sphere", "radius": 1.0, **options}


# Known answers


@pytest.mark.parametrize("e", [1.0, 0.6, 0.0])
@pytest.mark.parametrize("dt", [0.005, 0.25, 3.0])
def test_an_impact_mirrors_the_velocity_at_its_exact_time(e: float, dt: float) -> None:
    # Along x at height b = 0.6 R' towards a ball at the origin, R' = R + r = 1.25: it touches where x = −0.8 R', and the
    # normal is (−0.8, 0.6). v' = v − (1 + e)(v·n) n with v·n = −0.8 v. The step of 3 s flies through the ball.
    reach, speed, loss = 1.25, 2.0, 0.25
    hit = np.array([-0.8, 0.6, 0]) * reach
    final = simulate(
        3.0,
        dt,
        particles=[points((-3.031, hit[1], 0), velocity=[(speed, 0, 0)], radius=0.25)],
        colliders=[ball(restitution=e, tangential_loss=loss)],
    ).final
    n, v = hit / reach, np.array([speed, 0, 0])
    across = (v @ n) * n
    after = -e * across + (1 - loss) * (v - across)
    t = (hit[0] + 3.031) / speed
    assert final.velocity[0] == pytest.approx(after, abs=1e-13)
    assert final.position[0] == pytest.approx(hit + after * (3.0 - t), abs=1e-12)


@pytest.mark.parametrize("e", [1.0, 0.8])
def test_bounce_heights_on_top_of_a_ball(e: float) -> None:
    # As on a plane: the first apex is e² h, (1 + e) t0 after the start.
    h, radius, r = 2.0, 0.5, 0.1
    t0 = math.sqrt(2 * h / G)
    end = t0 * (1 + e)
    final = simulate(
        end,
        end / 311,
        particles=[points((1.0, 3 + radius + r + h, -2.0), radius=r)],
        forces=GRAVITY,
        colliders=[ball(center=[1, 3, -2], radius=radius, restitution=e)],
    ).final
    assert final.position[0] == pytest.approx([1, 3 + radius + r + e * e * h, -2], abs=1e-10)
    assert final.velocity[0] == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk45"])
def test_energy_is_kept_in_an_elastic_bowl(integrator: str) -> None:
    # Velocity Verlet is exact in uniform gravity and an impact mirrors: what is left is rounding, 40 impacts or so.
    r, radius = 0.1, 1.0
    result = simulate(
        20.0,
        0.01,
        integrator,
        particles=[points((0.3, 0.2, -0.1), velocity=[(0.7, 0.4, 1.1)], radius=r)],
        forces=GRAVITY,
        colliders=[ball(inside=True)],
    )
    x, v = result.final.position[0], result.final.velocity[0]
    before = 0.5 * (0.49 + 0.16 + 1.21) + G * 0.2
    assert 0.5 * v @ v + G * x[1] == pytest.approx(before, rel=1e-8)
    assert np.linalg.norm(x) <= radius - r + 1e-12
    # Angular momentum about the upright axis is kept too: neither weight nor the walls turn about it.
    assert x[2] * v[0] - x[0] * v[2] == pytest.approx(-0.1 * 0.7 - 0.3 * 1.1, rel=1e-8)


def test_a_billiard_in_a_bowl_keeps_its_angle() -> None:
    # Without forces all chords are alike: 2 √(R² − b²) long, b the distance of the path from the centre.
    b, speed = 0.6, 2.0
    chord = 2 * math.sqrt(1 - b * b)
    turn = math.pi - 2 * math.asin(b)  # of the point of impact, from one to the next
    bounces = 7
    end = chord / speed * bounces
    final = simulate(
        end,
        end / 13,
        particles=[points((0, b, 0), velocity=[(speed, 0, 0)], radius=0.0)],
        colliders=[ball(inside=True)],
    ).final
    middle = b * np.array([math.sin(turn * bounces), math.cos(turn * bounces), 0])
    assert final.position[0] == pytest.approx(middle, abs=1e-12)
    assert np.linalg.norm(final.velocity[0]) == pytest.approx(speed, rel=100 * EPS)


@pytest.mark.parametrize("detection", ["continuous", "discrete"])
def test_what_is_dropped_into_a_bowl_comes_to_rest_at_its_lowest_point(detection: str) -> None:
    dt = 0.005
    final = simulate(
        20.0,
        dt,
        particles=[points((0.2, 0.0, 0.1), radius=0.1)],
        forces=GRAVITY,
        colliders=[ball(inside=True, restitution=0.3, tangential_loss=0.02, detection=detection)],
    ).final
    speed = 1e-9 if detection == "continuous" else G * dt
    assert final.position[0] == pytest.approx([0, -0.9, 0], abs=max(1e-6, speed * dt))
    assert np.linalg.norm(final.velocity[0]) <= speed


def test_what_lies_on_top_of_a_ball_stays() -> None:
    final = simulate(
        2.0,
        0.01,
        particles=[points((0, 1.1, 0), radius=0.1)],
        forces=GRAVITY,
        colliders=[ball(restitution=0.5)],
    ).final
    assert final.position[0] == pytest.approx([0, 1.1, 0], abs=4 * EPS)
    assert final.velocity[0] == pytest.approx([0, 0, 0], abs=0)


def test_it_leaves_a_dome_where_the_weight_no_longer_holds_it() -> None:
    # A grain that slides without friction from rest at cos θ₀ leaves a sphere at cos θ = ⅔ cos θ₀, where v² = g R cos θ, and
    # falls in a parabola from there. The error is of second order, but for the step in which it leaves.
    start = 0.3

    def landing(dt: float) -> float:
        final = simulate(
            5.0,
            dt,
            particles=[points((start, math.sqrt(1 - start**2), 0), radius=0.0)],
            forces=GRAVITY,
            colliders=[ball(restitution=0.5), {"type": "plane", "contact": "stick", "point": [0, -1, 0]}],
        ).final
        return float(final.position[0, 0])

    cos = 2 / 3 * math.sqrt(1 - start**2)
    sin, v = math.sqrt(1 - cos**2), math.sqrt(G * cos)
    t = (-v * sin + math.sqrt((v * sin) ** 2 + 2 * G * (1 + cos))) / G
    coarse, fine = (landing(dt) - sin - v * cos * t for dt in (8e-3, 1e-3))
    assert abs(coarse) < 4e-5
    assert abs(fine) < 4e-5 / 16


def test_what_slides_down_a_dome_keeps_its_energy() -> None:
    # The free end of a step lies s²/2R less deep in a ball than forces alone would bring it, so that putting it back would
    # do more work than is lost along the normal; here none is gained, to rounding, in half a thousand steps on the ball.
    energy = energies(
        {
            "simulation": {"duration": 0.5, "dt": 1e-3, "integrator": "velocity_verlet"},
            "output": {"every": 50},
            "particles": [points((0.3, math.sqrt(1 - 0.09), 0), radius=0.0)],
            "forces": GRAVITY,
            "colliders": [ball(restitution=0.5)],
        }
    )
    assert np.ptp(energy) < 500 * 4 * EPS * energy[0]


def test_friction_on_a_dome_is_that_of_what_presses() -> None:
    # It slides over the top with v₀. At the angle θ from there N = m (g cos θ − v²/R), so that
    # dv²/dθ = 2 g R (sin θ − μ cos θ) + 2 μ v². Solved with a cos θ + b sin θ + c exp(2 μ θ); the error is of second order.
    mu, v = 0.2, 2.0
    a, b = G * (4 * mu**2 - 2) / (1 + 4 * mu**2), -6 * mu * G / (1 + 4 * mu**2)

    def error(dt: float) -> float:
        final = simulate(
            0.2,
            dt,
            particles=[points((0, 1, 0), velocity=[[v, 0, 0]], radius=0.0)],
            forces=GRAVITY,
            colliders=[ball(restitution=0.5, friction=mu)],
        ).final
        (x, y, _), speed = final.position[0], np.linalg.norm(final.velocity[0])
        assert math.hypot(x, y) == pytest.approx(1, abs=4 * EPS)
        theta = math.atan2(x, y)
        return speed**2 - (a * y + b * x + (v**2 - a) * math.exp(2 * mu * theta))

    coarse, fine = error(4e-3), error(1e-3)
    assert abs(fine) < min(abs(coarse) / 12, 5e-6)


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_a_method_of_first_order_slides_down_a_dome_as_fast_as_others(friction: float) -> None:
    # Its free end lies twice as deep as its speed tells. The work of lifting it from there, taken for energy gained, stopped
    # what slid slowly. The error is of first order: a fourth of the step leaves a fourth of it.
    v, mu = 0.5, friction
    a, b = 10 * G * (4 * mu**2 - 2) / (1 + 4 * mu**2), -60 * mu * G / (1 + 4 * mu**2)

    def error(dt: float) -> float:
        final = simulate(
            0.5,
            dt,
            method="symplectic_euler",
            particles=[points((0, 10, 0), velocity=[[v, 0, 0]], radius=0.0)],
            forces=GRAVITY,
            colliders=[ball(radius=10.0, friction=mu)],
        ).final
        theta, speed = math.atan2(*final.position[0, :2]), np.linalg.norm(final.velocity[0])
        return speed**2 - (a * math.cos(theta) + b * math.sin(theta) + (v**2 - a) * math.exp(2 * mu * theta))

    coarse, fine = error(4e-3), error(1e-3)
    assert abs(coarse) < 1e-2 * v**2
    assert abs(fine) < max(abs(coarse) / 3, 1e-10)  # without friction it is rounding


# Nothing gets through


@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.sampled_from([0.1, 5.0, 1e3, 1e6, 1e10]),
    e=st.sampled_from([0.0, 0.5, 1.0]),
)
@settings(max_examples=60)
def test_nothing_crosses_a_ball_or_a_bowl_at_any_speed(seed: int, speed: float, e: float) -> None:
    # Two balls in a bowl. Inside of it, where a chord is at most 2 m, a step at 10¹⁰ m/s is billions of impacts: more than
    # are followed, but none may get out.
    rng = np.random.default_rng(seed)
    walls = [
        SphereCollider(radius=1.0, inside=True, restitution=e),
        SphereCollider(center=(0.45, 0, 0), radius=0.3, restitution=e),
        SphereCollider(center=(-0.4, 0.2, 0.1), radius=0.25, restitution=e),
    ]
    contacts = careful(continuous=[w.record() for w in walls], reach=1.0, tolerance=16 * EPS)
    x = rng.normal(size=(12, 3))
    x *= 0.03 / np.linalg.norm(x, axis=1)[:, None]
    v = speed * rng.normal(size=(12, 3))
    c = columns(x, v, radius=0.05)
    p = program("velocity_verlet", (), contacts)
    before = np.linalg.norm(v, axis=1)
    for k in range(4):
        assert not run(p, c, 1, 0.05, first_step=k).any()
        for w in walls:
            d = np.linalg.norm(position(c) - w.center, axis=1)
            free = w.radius - 0.05 - d if w.inside else d - w.radius - 0.05
            assert free.min() >= -1e-13
        assert (np.linalg.norm(velocity(c), axis=1) <= before * (1 + 1e-10)).all()


@given(seed=st.integers(0, 2**32 - 1), speed=st.sampled_from([1.0, 1e3, 1e8, 1e100]))
@settings(max_examples=60)
def test_the_first_ball_on_the_way_is_hit(seed: int, speed: float) -> None:
    # A row of balls, most of them in the shadow of the first: whatever the step, the particle comes back from it.
    rng = np.random.default_rng(seed)
    places = np.sort(rng.uniform(1, 50, 5))
    radii = rng.uniform(0.1, 0.4, 5)
    offsets = rng.uniform(-0.05, 0.05, 5)
    first = np.argmin(places - np.sqrt(radii**2 - offsets**2))
    walls = [
        SphereCollider(center=(places[k], offsets[k], 0), radius=radii[k]).record()
        for k in rng.permutation(5)
    ]
    c = columns([[0, 0, 0]], [[speed, 0, 0]], radius=0.0)
    run(program("velocity_verlet", (), careful(continuous=walls, reach=51.0)), c, 1, 60 / speed)
    n = np.array([-math.sqrt(radii[first] ** 2 - offsets[first] ** 2), -offsets[first], 0]) / radii[first]
    back = np.array([1.0, 0, 0]) - 2 * n[0] * n
    if back[0] < -0.5:  # a flatter one may meet another ball on its way back
        np.testing.assert_allclose(velocity(c)[0] / speed, back, atol=1e-9)


# What else a collider does


def test_a_sphere_kills_and_the_record_says_so(tmp_path: Path) -> None:
    emitter = {
        "name": "e",
        "burst": {"count": 3, "at": 0.0},
        "shape": {"type": "point", "position": [0, 3, 0]},
        "direction": [0, -1, 0],
        "speed": 4.0,
    }
    with record(
        tmp_path / "k.vtkhdf",
        0.9,
        0.3,
        "symplectic_euler",
        emitters=[emitter],
        colliders=[ball(contact="kill")],
    ) as trajectory:
        deaths = trajectory.events("death")
        assert deaths["cause"].tolist() == ["collider"] * 3
        assert deaths["time"] == pytest.approx([0.5] * 3, abs=10 * EPS)


def test_what_sticks_to_a_ball_stays_where_it_touched() -> None:
    final = simulate(
        3.0,
        0.5,
        particles=[points((0, 3, 0), velocity=[(0, -50, 0)], radius=0.5)],
        colliders=[ball(contact="stick")],
    ).final
    assert final.position[0] == pytest.approx([0, 1.5, 0], abs=1e-13)
    assert not final.velocity[0].any()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("law", [{}, {"model": "linear", "stiffness": 1000.0}], ids=["impulse", "linear"])
def test_what_has_stuck_is_hit_like_a_wall(law: dict[str, Any]) -> None:
    final = simulate(
        2.4,
        0.004,
        particles=[points((0, 0.5, 0), (0, 2, 0), velocity=[(0, -1, 0)], radius=0.1)],
        planes=[{"contact": "stick"}],
        interactions=[{"type": "contact", "restitution": 0.5, **law}],
    ).final
    assert final.position[0] == pytest.approx([0, 0.1, 0], abs=1e-12)
    assert not final.velocity[0].any()
    assert final.velocity[1] == pytest.approx([0, 0.5, 0], abs=0.03)  # 0.61 off half of the mass


def test_a_collider_of_type_plane_is_a_plane() -> None:
    bounces: dict[str, Any] = {"restitution": 0.7, "normal": [0.1, 1, 0]}
    results = [
        simulate(2.0, 0.01, particles=[points((0, 1, 0), radius=0.1)], forces=GRAVITY, **tables).final
        for tables in ({"planes": [bounces]}, {"colliders": [{"type": "plane", **bounces}]})
    ]
    np.testing.assert_array_equal(results[0].position, results[1].position)
    np.testing.assert_array_equal(results[0].velocity, results[1].velocity)


def test_a_weight_on_a_spring_bounces_off_a_ball() -> None:
    # Two weights on a spring fall on two sides of a ball: neither of them ends inside, and energy is not gained.
    result = simulate(
        2.0,
        0.002,
        "velocity_verlet",
        particles=[
            {
                "name": "a",
                "mass": 1.0,
                "radius": 0.05,
                "layout": {"type": "points", "position": [[-0.3, 2, 0.1], [0.4, 2, 0]]},
            }
        ],
        springs=[{"on": "a", "pairs": [[0, 1]], "stiffness": 50.0}],
        forces=GRAVITY,
        colliders=[ball(restitution=0.5)],
    )
    assert (np.linalg.norm(result.final.position, axis=1) >= 1.05 - 1e-12).all()


def test_a_lone_discrete_sphere_needs_no_second_look() -> None:
    group = Particles.model_validate(points((0, 0, 0), name="a"))
    alone = SphereCollider(radius=1.0, detection="discrete")
    assert isinstance(contacts_record([alone], group, np.dtype(float)), Simple)
    assert isinstance(contacts_record([alone, alone], group, np.dtype(float)), Careful)


@pytest.mark.parametrize("detection", ["continuous", "discrete"])
def test_the_work_of_impacts_is_booked(detection: str) -> None:
    # A fall of 1 m on top of a ball, e = ½: the impact takes (1 − e²) m g h.
    result = simulate(
        0.6,
        0.001,
        particles=[points((0, 2, 0), mass=2.0, radius=0.0)],
        forces=GRAVITY,
        colliders=[ball(restitution=0.5, detection=detection)],
        output={"ledger": True, "work": True},
    )
    row = {name: float(values[-1]) for name, values in result.ledger.items()}
    assert row["work.contact"] == pytest.approx(
        -0.75 * 2 * G, rel=1e-9 if detection == "continuous" else 2e-2
    )
    assert row["balance"] == pytest.approx(0, abs=1e-8)


def test_particles_that_start_inside_a_ball_are_told() -> None:
    result = simulate(
        0.1,
        0.01,
        particles=[points((0, 0.5, 0), (0, 2, 0), radius=0.1)],
        colliders=[ball(name="dome")],
    )
    (told,) = [line for line in result.warnings if "inside" in line]
    assert "1 of 2" in told
    assert "start inside sphere dome, the deepest (id 0) by 0.6 m" in told


def test_a_spring_breaks_when_a_ball_kills_one_of_its_ends() -> None:
    # Two of 1 kg with k = 1 N/m, stretched from 1 m to 2 m, at rest: half of the stretch is cos ωt / 2 with ω² = 2/s². The
    # first meets the ball after a quarter of a metre, at ωt = π/3; the second keeps the speed that it has then.
    law = {"on": "pair", "pairs": [[0, 1]], "stiffness": 1.0, "rest_length": 1.0}
    scenario = {
        "simulation": {"duration": 1, "dt": 1e-3},
        "output": {"every": 50, "work": True},
        "particles": [points((0, 2, 0), (2, 2, 0), name="pair", radius=0.0)],
        "springs": [law],
    }
    hot = ball(center=[0.75, 2, 0], radius=0.5, contact="kill", name="hot")
    result = ps.run(ps.from_table({**scenario, "colliders": [hot]}))
    assert result.died == {"collider": 1}
    assert result.broken == {"springs": (1, 1)}
    half = math.pi / 3 / math.sqrt(2)
    speed = math.sin(math.pi / 3) / math.sqrt(2)
    there = 1.5 + math.cos(math.pi / 3) / 2
    np.testing.assert_allclose(result.final.velocity, [[-speed, 0, 0]], atol=1e-3)
    np.testing.assert_allclose(result.final.position, [[there - speed * (1 - half), 2, 0]], atol=2e-3)
    with pytest.raises(ps.ScenarioError, match="a sphere cannot kill particles that are joined by rods"):
        ps.from_table(
            {**scenario, "springs": [], "rods": [{"on": "pair", "pairs": [[0, 1]]}], "colliders": [hot]}
        )
    scenario["colliders"] = [{"type": "plane"}, ball(name="hot", radius=0.5)]
    with pytest.raises(ps.ScenarioError, match="unknown group 'pear'"):
        ps.from_table(scenario, {"colliders.hot.on": ["pear"], "colliders.hot.contact": "bounce"})
