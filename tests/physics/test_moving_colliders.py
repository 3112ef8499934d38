"""Colliders that motions lead: their surface velocity is felt, what lies on them rides along, and nothing gets past them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, simulate, table, way

import particlesim as ps

GRAVITY = [{"type": "gravity"}]


def box(**options: Any) -> dict[str, Any]:
    return {"type": "box", "name": "piston", "size": [1.0, 1.0, 1.0], **options}


@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
@pytest.mark.parametrize("dt", [0.01, 2.0])
def test_a_piston_gives_its_speed(e: float, dt: float) -> None:
    # v' = u + e (u − v) along the way of the piston, from the time of contact on: gap 0.4 m at 3 − (−1) m/s.
    u, v = 3.0, -1.0
    final = simulate(
        2.0,
        dt,
        particles=[points((1.0, 0, 0), velocity=[(v, 0, 0)], radius=0.1)],
        colliders=[box(restitution=e)],
        motions=[{"collider": "piston", "path": ["x + 3*t", "y", "z"]}],
    ).final
    t = 0.4 / (u - v)
    after = u + e * (u - v)
    assert final.velocity[0] == pytest.approx([after, 0, 0], abs=1e-9)
    assert final.position[0] == pytest.approx([1 + v * t + after * (2 - t), 0, 0], abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.05, 0.06, 0.1])
@pytest.mark.optimised
def test_balls_bounce_off_what_swings_from_any_height(radius: float) -> None:
    # Elastic, relative to a surface at 0.2 sin 5t: v' = 2 u − v. Where a gap at one place was rounded otherwise than at the
    # next, a ball in four had touched and not touched, and lay down.
    heights = np.linspace(0.9, 1.5, 200)
    run = simulate(
        0.45,
        1e-3,
        particles=[points(*((0, y, 0) for y in heights), velocity=[(0, -1, 0)], radius=radius)],
        forces=GRAVITY,
        colliders=[box(size=[1, 0.6, 1], restitution=1.0)],
        motions=[{"collider": "piston", "path": ["x", "0.2*sin(5*t)", "z"]}],
    )
    v = run.final.velocity[:, 1]
    surface = np.cos(5 * 0.45)
    # what has bounced flies up from the surface, what has not falls at more than 1 m/s
    assert ((v > surface + 1) | (v < -1)).all()
    assert (v > 0).sum() > 50


def test_a_paddle_gives_the_speed_of_its_surface() -> None:
    # A bar turns about z at ω; at the distance r of the particle its upper side moves at ω r across itself. Hit when the bar
    # stands at φ: elastic, the particle at rest gets 2 ω r cos(..) along the normal of the bar.
    omega, r, half = 2.0, 0.8, 0.05
    final = simulate(
        1.0,
        0.01,
        particles=[points((0.0, r, 0), radius=0.02)],
        colliders=[{"type": "box", "name": "bar", "size": [2.0, 2 * half, 0.5]}],
        motions=[{"collider": "bar", "spin": {"axis": [0, 0, 1], "rate": omega}}],
    ).final
    # its side is half + radius from the centre line: the foot of the particle is at the distance s from the axis
    reach = half + 0.02
    s = np.sqrt(r * r - reach * reach)
    angle = np.arctan2(r, 0) - np.arcsin(reach / r)
    normal = np.array([-np.sin(angle), np.cos(angle), 0])
    assert final.velocity[0] == pytest.approx(2 * omega * s * normal, abs=1e-9)
    t = angle / omega
    assert final.position[0] == pytest.approx(
        np.array([0, r, 0]) + 2 * omega * s * normal * (1 - t), abs=1e-8
    )


@pytest.mark.parametrize("shape", ["box", "rectangle", "mesh"])
def test_what_lies_on_a_table_rides_along(shape: str, tmp_path: Any) -> None:
    # y = a sin ωt with a ω² < g: it never lifts off, without rebound. And the table's sideways swing does not take it along
    # without friction.
    table: dict[str, Any] = {"type": shape, "name": "table", "restitution": 0.0}
    top = 0.0
    if shape == "box":
        table |= {"size": [4, 0.2, 4]}
        top = 0.1
    elif shape == "rectangle":
        table |= {"size": [4, 4], "thickness": 1e-3}
        top = 5e-4
    else:
        import trimesh

        trimesh.creation.box(extents=(4, 0.2, 4)).export(tmp_path / "table.stl")
        table |= {"path": str(tmp_path / "table.stl")}
        top = 0.1
    final = simulate(
        1.0,
        1e-3,
        particles=[points((0.2, top + 0.05, 0.1), radius=0.05)],
        forces=GRAVITY,
        colliders=[table],
        motions=[
            {
                "collider": "table",
                "path": ["x + 0.1*sin(3*t)", "y + a*(1 - cos(w*t))", "z"],
                "constants": {"a": 0.05, "w": 6},
            }
        ],
    ).final
    y = top + 0.05 + 0.05 * (1 - np.cos(6.0))
    assert final.position[0] == pytest.approx([0.2, y, 0.1], abs=2e-6)
    assert final.velocity[0] == pytest.approx([0, 0.3 * np.sin(6.0), 0], abs=1e-3)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("rate", [100.0, 1e3, 1e6])
@pytest.mark.parametrize("shape", ["cylinder", "box"])
def test_a_turntable_takes_along_by_no_more_than_friction_has(shape: str, rate: float) -> None:
    # At rest 1 m off the axis, where the surface runs along −z at ω r: v_z = −μ g t, and as the way bends by z/r the surface
    # does, v_x = −∫ μ g |z|/r dt = −(μ g)² t³/6. The place by which it bends may be that of the step before.
    size: dict[str, Any] = {"size": [6, 1, 6], "center": [0, 0.4, 0]}
    if shape == "cylinder":
        size = {"start": [0, -0.1, 0], "end": [0, 0.9, 0], "radius": 3}
    t, dt, pull = 0.1, 1e-3, 0.3 * G
    final = simulate(
        t,
        dt,
        particles=[points((1, 1, 0), radius=0.1)],
        forces=GRAVITY,
        colliders=[{"type": shape, "name": "table", "friction": 0.3, "restitution": 0.5, **size}],
        motions=[{"collider": "table", "spin": {"axis": [0, 1, 0], "rate": rate}}],
    ).final
    vx, vy, vz = final.velocity[0]
    bend = pull * pull * t * t * dt / 2
    assert np.hypot(vx, vz) <= pull * t * (1 + 1e-9)
    assert abs(vy) < 1e-9
    assert vz == pytest.approx(-pull * t, abs=bend)
    # the surface turns in the world by 1/ω r of the speed that the particle has, and that much of friction goes astray
    assert vx == pytest.approx(-(pull**2) * t**3 / 6, abs=bend + pull * t * (pull * t / rate))


def test_a_drum_takes_along_what_lies_in_it_at_any_rate() -> None:
    # s'' = μ N − g sin θ with N = g cos θ + s'²/R, by steps of 1 µs; a step of dt is off by the friction of one step
    radius, mu, dt, t = 0.48, 0.3, 1e-4, 0.1
    angle, turn, h = 0.0, 0.0, 1e-6
    for _ in range(round(t / h)):
        turn += h * (mu * (G * np.cos(angle) + radius * turn**2) - G * np.sin(angle)) / radius
        angle += h * turn
    for rate in (10.0, 1e3, 5e3):
        final = simulate(
            t,
            dt,
            "velocity_verlet",
            particles=[points((0, -radius, 0), radius=0.02)],
            forces=GRAVITY,
            colliders=[
                {
                    "type": "cylinder",
                    "name": "drum",
                    "start": [0, 0, -1],
                    "end": [0, 0, 1],
                    "radius": 0.5,
                    "inside": True,
                    "friction": mu,
                    "restitution": 0.0,
                }
            ],
            motions=[{"collider": "drum", "spin": {"axis": [0, 0, 1], "rate": rate}}],
        ).final
        x, y, _ = final.position[0]
        assert np.hypot(*final.velocity[0, :2]) == pytest.approx(radius * turn, abs=mu * G * dt)
        assert np.arctan2(x, -y) == pytest.approx(angle, abs=mu * G * dt * t / radius)


def test_friction_takes_along_what_lies_on_a_turntable() -> None:
    # At r = 0.3 m a turn of 1 rad/s asks for ω² r = 0.3 m/s² of friction, and μ g is 4.9: it goes round with the table.
    final = simulate(
        2.0,
        1e-3,
        particles=[points((0.3, 0.15, 0), radius=0.05, velocity=[(0, 0, -0.3)])],
        forces=GRAVITY,
        colliders=[box(size=[2, 0.2, 2], restitution=0.0, friction=0.5)],
        motions=[{"collider": "piston", "spin": {"axis": [0, 1, 0], "rate": 1.0}}],
    ).final
    assert final.position[0] == pytest.approx([0.3 * np.cos(2), 0.15, -0.3 * np.sin(2)], abs=1e-3)


@pytest.mark.parametrize("speed", [1.0, 1e3, 1e5])
def test_a_swatter_leaves_nothing_behind_it(speed: float) -> None:
    # A sheet sweeps through a cloud of points at rest, in steps of many cloud sizes: all are before it in the end.
    rng = np.random.default_rng(2)
    x = np.column_stack([rng.uniform(0.5, 1.5, 40), rng.uniform(-0.4, 0.4, (40, 2))])
    final = simulate(
        4.0 / speed,
        4.0 / speed / 3,
        particles=[points(*(tuple(row) for row in x), radius=0.0)],
        colliders=[
            {
                "type": "rectangle",
                "name": "swatter",
                "size": [1, 1],
                "orientation": {"axis": [0, 0, 1], "angle": 90},
            }
        ],
        motions=[{"collider": "swatter", "path": [f"x + {speed}*t", "y", "z"]}],
    ).final
    assert (final.position[:, 0] > 4).all()
    np.testing.assert_allclose(final.velocity[:, 0], 2 * speed, rtol=1e-9)


def between_a_wall_and_a_piston(
    x: float, v: float, length: float, u: float, until: float
) -> tuple[float, float]:
    """Place and velocity of an elastic point between 0 and a piston at L − u t: each of its impacts adds 2 u."""
    t = 0.0
    while True:
        wall = -x / v if v < 0 else np.inf
        piston = (length - u * t - x) / (v + u) if v > -u else np.inf
        if t + min(wall, piston) >= until:
            return x + v * (until - t), v
        t += min(wall, piston)
        x, v = (0.0, -v) if wall < piston else (length - u * t, -v - 2 * u)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("degrees", [0, 31])
def test_a_plane_that_moves_is_a_piston(degrees: float) -> None:
    rng = np.random.default_rng(2)
    n, h, until, u = 100, 0.01, 2.0, 0.3
    x, v = rng.uniform(0.1, 0.9, n), rng.uniform(-30, 30, n)
    d = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    places, speeds = way(
        round(until / h),
        until,
        h,
        "velocity_verlet",
        particles=[points(*np.outer(x, d).tolist(), velocity=np.outer(v, d).tolist(), radius=0.0, mass=1.0)],
        planes=[
            {"normal": d.tolist(), "restitution": 1.0},
            {"name": "piston", "point": d.tolist(), "normal": (-d).tolist(), "restitution": 1.0},
        ],
        motions=[
            {"collider": "piston", "path": [f"x - {float(u * d[0])}*t", f"y - {float(u * d[1])}*t", "z"]}
        ],
    )
    ends = np.array([between_a_wall_and_a_piston(a, b, 1.0, u, until) for a, b in zip(x, v, strict=True)])
    np.testing.assert_allclose(places[-1] @ d, ends[:, 0], atol=1e-11)
    np.testing.assert_allclose(speeds[-1] @ d, ends[:, 1], atol=1e-11)


@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler"])
def test_what_lands_on_a_plane_that_rises_goes_with_it(method: str) -> None:
    """The first lies on it, the second falls onto it; both slide on as fast as before. With symplectic_euler the second had
    been given 7 %, as a part of the velocity of the lift was taken for one along it."""
    places, speeds = way(
        100,
        1.0,
        0.01,
        method,
        particles=[
            points([0, 0.1, 0], [1, 0.5, 0], velocity=[[0.3, 0.5, 0], [0.3, 0, 0]], radius=0.1, mass=1.0)
        ],
        forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        planes=[{"name": "lift", "restitution": 0.0}],
        motions=[{"collider": "lift", "path": ["x", "y + 0.5*t", "z"]}],
    )
    np.testing.assert_allclose(places[-1], [[0.3, 0.6, 0], [1.3, 0.6, 0]], atol=1e-12)
    np.testing.assert_allclose(speeds[-1], [[0.3, 0.5, 0]] * 2, atol=1e-12)


def test_the_work_of_a_moving_collider_is_booked() -> None:
    # A particle at rest of 2 kg is hit elastically at 3 m/s: it gets ½ m (2u)².
    result = simulate(
        1.0,
        0.01,
        particles=[points((1, 0, 0), mass=2.0, radius=0.0)],
        colliders=[box()],
        motions=[{"collider": "piston", "path": ["x + 3*t", "y", "z"]}],
        output={"ledger": True, "work": True},
    )
    row = {name: float(values[-1]) for name, values in result.ledger.items()}
    assert row["work.contact"] == pytest.approx(0.5 * 2 * 36, rel=1e-9)
    assert row["balance"] == pytest.approx(0, abs=1e-8)


def test_what_a_motion_may_lead() -> None:
    table: dict[str, Any] = {
        "simulation": {"duration": 1, "dt": 0.01},
        "particles": [points((0, 3, 0), name="a")],
        "colliders": [box()],
    }
    path = ["x + t", "y", "z"]
    for motion, why in (
        ({"collider": "pistol", "path": path}, "unknown collider 'pistol'"),
        ({"path": path}, "a group or a collider"),
        ({"on": "a", "collider": "piston", "path": path}, "a group or a collider"),
        ({"on": "a", "spin": {"axis": [0, 1, 0], "rate": 1}, "path": path}, "spin is for colliders"),
        ({"collider": "piston", "particles": [0], "path": path}, "particles is for groups"),
        ({"collider": "piston"}, "needs a spin, a path or waypoints"),
    ):
        with pytest.raises(ps.ScenarioError, match=why):
            ps.from_table({**table, "motions": [motion]})
    twice = [
        {"collider": "piston", "path": path},
        {"collider": "piston", "spin": {"axis": [0, 1, 0], "rate": 1}},
    ]
    with pytest.raises(ps.ScenarioError, match="is led already"):
        ps.from_table({**table, "motions": twice})


def test_gravity_is_what_it_was() -> None:
    # A ball dropped on a table that rises at 1 m/s: relative to the table it is thrown down at 1 m/s.
    h, u = 1.0, 1.0
    final = simulate(
        1.0,
        1e-3,
        "velocity_verlet",
        particles=[points((0, 0.5 + h, 0), radius=0.0)],
        forces=GRAVITY,
        colliders=[box()],
        motions=[{"collider": "piston", "path": ["x", "y + t", "z"]}],
    ).final
    t = (-u + np.sqrt(u * u + 2 * G * h)) / G
    after = u + (u + G * t)
    left = 1.0 - t
    y = 0.5 + u * t + after * left - G / 2 * left**2
    assert final.position[0, 1] == pytest.approx(y, abs=1e-8)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "floor",
    [
        {"type": "plane", "name": "floor"},
        {"type": "box", "name": "floor", "inside": True, "size": [8, 4, 8], "center": [0, 2, 0]},
    ],
)
def test_what_closes_on_particles_is_told_with_who_and_when(floor: dict[str, Any]) -> None:
    # The box, whose lower side is at 1 − t, leaves no room for balls of 0.1 m from t = 0.8 s on; that at 3 m is beside it.
    def warnings(end: float, contact: str = "bounce") -> list[str]:
        ended = simulate(
            end,
            0.01,
            particles=[points((0, 0.1, 0), (0.2, 0.3, 0), (3, 0.1, 0), radius=0.1, name="balls")],
            colliders=[
                {"contact": contact, **each} for each in (box(center=[0, 1.5, 0]), {**floor, "friction": 0.1})
            ],
            motions=[{"collider": "piston", "path": ["x", "y - t", "z"]}],
            output={"every": 1, "ledger": False},
        )
        return [text for text in ended.warnings if "no room" in text and "balls" in text]

    (text,) = warnings(0.95)
    assert text.startswith("in the frame at t = 0.81 s there is no room between box piston and")
    assert "of 'balls', with a radius of 0.1 m, which is 0.01 m inside of box piston there" in text
    assert not warnings(0.79)
    assert warnings(0.95, "slide")


@pytest.mark.parametrize("far", [1.0, 20.0])
def test_a_thin_sheet_that_moves_holds_points_in_single_precision(far: float) -> None:
    """Of a sheet of 0.4 mm at 20 m the search had gone four rounding errors deep at once, past its middle and on."""
    rng, n, dt, steps = np.random.default_rng(0), 100, 5e-3, 40
    x = np.stack([far - rng.uniform(0.01, 0.2, n), *rng.uniform(-0.5, 0.5, (2, n))], axis=1)
    v = rng.normal(size=(n, 3))
    v[:, 0] = np.abs(v[:, 0])
    v *= 9.5 / np.linalg.norm(v, axis=1, keepdims=True)
    layout = {"type": "points", "position": x.tolist(), "velocity": v.tolist()}
    upright = {"axis": [0, 0, 1], "angle": 90}
    sheet = {
        "name": "sheet",
        "type": "rectangle",
        "center": [far, 0, 0],
        "size": [4, 4],
        "orientation": upright,
    }
    given = table(
        steps * dt,
        dt,
        particles=[{"layout": layout}],
        colliders=[sheet],
        motions=[{"collider": "sheet", "path": ["x + 0.003*sin(80*t)", "y", "z"]}],
    )
    given["simulation"]["precision"] = "single"
    run = ps.run(ps.from_table(given))
    assert run.final["position"][:, 0].max() < far + 0.003 * np.sin(80 * steps * dt)
    assert not run.warnings
