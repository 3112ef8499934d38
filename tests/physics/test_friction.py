"""Coulomb friction against closed forms: at impacts, at rest and sliding on slopes, on belts, alone and in islands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, G, points, simulate, table
from support import careful, columns, position, program, run, velocity

import particlesim as ps
from particlesim.colliders import SphereCollider
from particlesim.colliders.friction import Friction
from particlesim.engine.simulation import Simulation
from particlesim.forces import Gravity

GRAVITY = [{"type": "gravity"}]
STEPS = pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4])


def slope(angle: float, **plane: Any) -> dict[str, Any]:
    """A plane through the origin that falls towards +x; no rebound."""
    return {"normal": [math.sin(angle), math.cos(angle), 0], "restitution": 0.0} | plane


def downhill(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), -math.sin(angle), 0])


def slide(duration: float, dt: float, planes: list[Any], velocity: Any = (0, 0, 0), **more: Any) -> Any:
    """A block that begins at the origin: its last position and velocity."""
    block = points((0, 0, 0), velocity=[tuple(velocity)], radius=0.0)
    final = simulate(duration, dt, particles=[block], forces=GRAVITY, planes=planes, **more).final
    return final.position[0], final.velocity[0]


# On a slope


@STEPS
@pytest.mark.parametrize("share", [0.2, 0.999])
def test_a_block_holds_on_a_slope_below_its_friction_angle(dt: float, share: float) -> None:
    angle = 0.5
    position, velocity = slide(200 * dt, dt, [slope(angle, friction=math.tan(angle) / share)])
    assert position.tolist() == [0, 0, 0]
    assert velocity.tolist() == [0, 0, 0]


@STEPS
@pytest.mark.parametrize("method", ["velocity_verlet", "rk4", "stormer_verlet"])
def test_a_block_slides_on_a_slope_above_it(dt: float, method: str) -> None:
    # a = g (sin θ − μ_k cos θ): x = ½ a t², v = a t. Static friction lets it start.
    angle, static, kinetic = 0.6, 0.68, 0.4
    assert math.tan(angle) > static
    t = 200 * dt
    position, velocity = slide(
        t, dt, [slope(angle, friction={"static": static, "kinetic": kinetic})], method=method
    )
    a = G * (math.sin(angle) - kinetic * math.cos(angle))
    assert position == pytest.approx(a * t * t / 2 * downhill(angle), rel=1e-11, abs=1e-14)
    assert velocity == pytest.approx(a * t * downhill(angle), rel=1e-11, abs=1e-14)


@pytest.mark.parametrize("method", ["symplectic_euler", "backward_euler", "bdf2", "rk45"])
def test_methods_of_low_order_and_own_steps_slide_as_they_fall(method: str) -> None:
    # Euler's place is off by ½ a_free t dt; the velocity is right.
    angle, mu, dt, t = 0.6, 0.4, 1e-3, 0.5
    position, velocity = slide(t, dt, [slope(angle, friction=mu)], method=method)
    a = G * (math.sin(angle) - mu * math.cos(angle))
    assert velocity == pytest.approx(a * t * downhill(angle), rel=1e-6)
    assert position == pytest.approx(a * t * t / 2 * downhill(angle), abs=G * math.sin(angle) * t * dt)


def test_static_friction_holds_where_kinetic_would_not() -> None:
    angle = 0.5
    mu = {"static": math.tan(angle) * 1.01, "kinetic": 0.1}
    assert slide(1.0, 0.01, [slope(angle, friction=mu)])[0].tolist() == [0, 0, 0]
    started = slide(1.0, 0.01, [slope(angle, friction=mu)], velocity=1e-3 * downhill(angle))[0]
    a = G * (math.sin(angle) - 0.1 * math.cos(angle))
    assert started == pytest.approx((1e-3 + a / 2) * downhill(angle), rel=1e-10)


@STEPS
def test_a_block_slides_up_a_slope_stops_in_mid_step_and_stays(dt: float) -> None:
    # It stops after v²/(2 g (sin θ + μ cos θ)).
    angle, mu, v = 0.3, 0.5, 1.0
    position, velocity = slide(
        100 * dt if dt > 5e-3 else 0.3, dt, [slope(angle, friction=mu)], -v * downhill(angle)
    )
    up = v * v / (2 * G * (math.sin(angle) + mu * math.cos(angle)))
    assert velocity.tolist() == [0, 0, 0]
    assert position == pytest.approx(-up * downhill(angle), rel=1e-12)


@STEPS
def test_a_block_slides_up_a_slope_and_down_again(dt: float) -> None:
    angle, mu, v = 0.7, 0.3, 1.0
    rise, fall = (G * (math.sin(angle) + s * mu * math.cos(angle)) for s in (1, -1))
    position, velocity = slide(0.4, dt, [slope(angle, friction=mu)], -v * downhill(angle))
    s = 0.4 - v / rise
    assert velocity == pytest.approx(fall * s * downhill(angle), rel=1e-10)
    assert position == pytest.approx((-v * v / (2 * rise) + fall * s * s / 2) * downhill(angle), rel=1e-10)


def test_friction_never_works_for_a_puck_that_turns_within_a_step() -> None:
    # Uphill and a little aside, so that it turns round a bend: friction takes from the energy all along its way.
    angle, dt = 1.4, 1e-2
    uphill = np.linspace(0.01, 0.12, 12)
    start = [tuple(-u * downhill(angle) + (0, 0, 0.003)) for u in uphill]
    pucks = points(*[(0, 0, z) for z in range(12)], velocity=start, radius=0.0)
    final = simulate(dt, dt, particles=[pucks], forces=GRAVITY, planes=[slope(angle, friction=0.02)]).final
    energy = (final.velocity**2).sum(axis=1) / 2 + G * final.position[:, 1]
    gained = energy - (np.array(start) ** 2).sum(axis=1) / 2
    path = np.linalg.norm(final.position[:, :2], axis=1)
    assert (gained < -1e-3 * 0.02 * G * math.cos(angle) * path).all()


def test_a_puck_on_a_slope_curls_as_it_should() -> None:
    # On a slope at its friction angle (μ = tan θ), speed and downhill velocity change alike: v + v_x is kept, and a puck
    # that is pushed across ends downhill with half of its speed.
    angle, v = 0.4, 1.0
    mu = math.tan(angle)
    ends = []
    for dt in (4e-3, 2e-3, 1e-3):
        _, velocity = slide(4.0, dt, [slope(angle, friction=mu)], (0, 0, v))
        ends.append(float(velocity @ downhill(angle)))
        assert np.linalg.norm(velocity) + ends[-1] == pytest.approx(v, rel=3 * dt / 1e-1)
    assert ends[-1] == pytest.approx(v / 2, abs=5e-3)


# Impacts


@pytest.mark.parametrize(("mu", "left"), [(0.1, None), (5.0, 0.0), (0.0, None)])
def test_an_impact_takes_at_most_mu_times_its_impulse(mu: float, left: float | None) -> None:
    # v_t' = v_t (1 − μ (1 + e) |v_n|/|v_t|), not below zero
    e, v = 0.5, np.array([3.0, -2.0, 4.0])
    block = points((0, 1, 0), velocity=[tuple(v)], radius=0.0)
    final = simulate(1.0, 0.2, particles=[block], planes=[{"restitution": e, "friction": mu}]).final
    keep = max(0.0, 1 - mu * (1 + e) * 2 / 5) if left is None else left
    assert final.velocity[0] == pytest.approx([3 * keep, 1, 4 * keep], abs=1e-14)
    assert final.position[0] == pytest.approx([1.5 * (1 + keep), 0.5, 2 * (1 + keep)], abs=1e-13)


def test_bounces_slow_a_ball_as_lasting_contact_does() -> None:
    # The normal impulses of a fall and all its bounces add up to the weight times the time: in the end a ball that never
    # stopped sliding has lost μ g t, whatever its bounces, but for what is in the air.
    mu, v, e, height = 0.1, 5.0, 0.5, 0.05
    block = points((0, height, 0), velocity=[(v, 0, 0)], radius=0.0)
    final = simulate(
        2.0, 1e-3, particles=[block], forces=GRAVITY, planes=[{"restitution": e, "friction": mu}]
    ).final
    assert final.position[0, 1] == pytest.approx(0, abs=1e-12)
    assert final.velocity[0, 0] == pytest.approx(v - mu * G * 2.0, rel=1e-6)


def test_the_time_of_zeno() -> None:
    # All bounces end after t0 (1 + e)/(1 − e); before, the ball hops, and after, it lies.
    e, height = 0.8, 0.5
    t0 = math.sqrt(2 * height / G)
    zeno = t0 * (1 + e) / (1 - e)
    rested = []
    for t in (0.97 * zeno, 1.01 * zeno):
        final = simulate(
            t,
            t / 2000,
            particles=[points((0, height, 0), radius=0.0)],
            forces=GRAVITY,
            planes=[{"restitution": e}],
        ).final
        rested.append(final.position[0, 1] <= 1e-12 and final.velocity[0, 1] == 0)
    assert rested == [False, True]


@pytest.mark.parametrize(("v", "e"), [(0.5, 0.8), (1.0, 0.8), (16.0, 0.4), (1e4, 0.08)])
def test_restitution_falls_with_speed(v: float, e: float) -> None:
    # e = 0.8 up to 1 m/s, and 0.8 (v/1 m/s)^(−1/4) above
    falling = {"value": 0.8, "speed": 1.0}
    block = points((0, v / 2, 0), velocity=[(0, -v, 0)], radius=0.0)
    final = simulate(1.0, 0.1, particles=[block], planes=[{"restitution": falling}]).final
    assert final.velocity[0, 1] == pytest.approx(e * v, rel=1e-14)


# Surfaces that run


@STEPS
def test_a_belt_takes_a_block_along(dt: float) -> None:
    # It slips for u/(μ g), then rides.
    mu, u, t = 0.5, 1.0, 0.5
    position, velocity = slide(t, dt, [slope(0, friction=mu, surface_velocity=[u, 0, 0])])
    slip = u / (mu * G)
    assert velocity == pytest.approx([u, 0, 0], abs=1e-15)
    assert position == pytest.approx([u * t - u * slip / 2, 0, 0], rel=1e-12, abs=1e-15)


def test_a_belt_carries_a_block_uphill() -> None:
    angle, u = 0.2, 0.7
    belt = slope(angle, friction=0.5, surface_velocity=list(-u * downhill(angle)))
    position, velocity = slide(2.0, 0.01, [belt], velocity=-u * downhill(angle))
    assert position == pytest.approx(-2 * u * downhill(angle), rel=1e-12)
    assert velocity == pytest.approx(-u * downhill(angle), rel=1e-13)


# Several colliders


def test_what_slides_into_a_wall_rebounds_from_it() -> None:
    # Rest on the floor does not swallow the impact at the wall.
    planes = [slope(0), {"normal": [-1, 0, 0], "point": [1, 0, 0], "restitution": 1.0}]
    position, velocity = slide(0.88, 0.01, planes, (2.0, 0, 0))
    assert velocity.tolist() == [-2, 0, 0]
    assert position == pytest.approx([2 - 1.76, 0, 0], abs=1e-8)


@pytest.mark.parametrize(
    ("opening", "mu"), [(0.6, 0.0), (1.2, 0.0), (2.8, 0.0), (math.pi / 2, 0.1), (math.pi / 2, 0.3)]
)
def test_a_ball_slides_along_a_groove(opening: float, mu: float) -> None:
    # Two planes, a groove that falls along z by 0.3 rad: a = g (sin 0.3 − μ cos 0.3/sin(opening/2)), as each is pressed by
    # half of the weight over the sine; at a right angle, too.
    half, fall = opening / 2, 0.3

    def turned(x: float, y: float) -> list[float]:
        return [x, y * math.cos(fall), y * math.sin(fall)]

    planes = [
        {"normal": turned(s * math.cos(half), math.sin(half)), "restitution": 0.0, "friction": mu}
        for s in (1, -1)
    ]
    position, velocity = slide(0.5, 0.005, planes)
    a = max(G * (math.sin(fall) - mu * math.cos(fall) / math.sin(half)), 0)
    way = np.array([0, -math.sin(fall), math.cos(fall)])
    assert velocity == pytest.approx(a * 0.5 * way, rel=1e-6, abs=1e-9)
    assert position == pytest.approx(a * 0.125 * way, rel=1e-6, abs=1e-9)


# Islands of springs


@pytest.mark.sampled(2)
@pytest.mark.parametrize("integrator", ["velocity_verlet", "backward_euler"])
def test_a_block_of_springs_slides_and_holds_as_a_rigid_one(integrator: str) -> None:
    angle, dt, t = 0.5, 2e-4, 0.3
    for mu, a in ((0.3, G * (math.sin(angle) - 0.3 * math.cos(angle))), (0.8, 0.0)):
        base = np.array([[x, 0.0, z] for x in (0.0, 0.1) for z in (0.0, 0.1)])
        body = np.vstack([base, base + np.array([0, 0.1, 0])])
        turn = np.array(
            [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
        ).T
        pairs = [[i, j] for i in range(8) for j in range(i)]
        block = {
            "name": "block",
            "layout": {"type": "points", "position": (body @ turn.T).tolist()},
            "mass": 0.1,
            "radius": 0.0,
        }
        final = simulate(
            t,
            dt,
            particles=[block],
            forces=GRAVITY,
            springs=[{"on": "block", "pairs": pairs, "stiffness": 2e5, "damping": 5.0}],
            planes=[slope(angle, friction=mu)],
            method=integrator,
        ).final
        moved = (final.position - body @ turn.T).mean(axis=0) @ downhill(angle)
        speed = final.velocity.mean(axis=0) @ downhill(angle)
        # It sinks into its springs at the start: some 10 µm. Backward Euler goes on with the speed at the end of a step, and
        # solves its equations to 10⁻³: so well it knows what presses.
        euler = integrator == "backward_euler"
        first_order, pressed = (a * t * dt, 1e-3 * mu * G * math.cos(angle)) if euler else (0.0, 0.0)
        assert moved == pytest.approx(a * t * t / 2, abs=1e-4 + first_order + pressed * t * t)
        assert speed == pytest.approx(a * t, abs=2e-3 + pressed * t)


def test_kinetic_friction_at_rest_takes_energy_as_its_work_says() -> None:
    result = simulate(
        0.4,
        1e-3,
        particles=[points((0, 0, 0), velocity=[(3.0, 0, 0)], radius=0.0, mass=2.0)],
        forces=GRAVITY,
        planes=[slope(0, friction=0.3)],
    )
    v = 3 - 0.3 * G * 0.4
    assert result.final.velocity[0] == pytest.approx([v, 0, 0], rel=1e-12)


# What may be said


@pytest.mark.parametrize(
    ("plane", "said"),
    [
        ({"friction": -0.1}, "must be at least 0"),
        ({"restitution": 1.1}, "must be at most 1"),
        ({"restitution": {"value": 1.2, "speed": 1}}, "must be at most 1"),
        ({"friction": {"static": 0.4}}, "kinetic"),
        ({"friction": 0.3, "detection": "discrete"}, 'detection = "continuous"'),
        ({"friction": 0.3, "contact": "kill"}, "acts only with contact"),
        ({"surface_velocity": [1, 0, 0]}, "there is neither"),
    ],
)
def test_what_makes_no_sense_is_refused(plane: dict[str, Any], said: str) -> None:
    with pytest.raises(ps.ScenarioError) as refused:
        slide(0.1, 0.01, [plane])
    assert said in str(refused.value)


def test_what_slides_into_a_crease_of_thin_sheets_stays_on_their_side() -> None:
    # It slides along one sheet into another. Its free step ends 2 mm behind sheets of 0.2 mm, where gaps are positive again:
    # it may not lie on one of them and pass the other.
    sheet = {"type": "rectangle", "size": [2.2, 2.2], "thickness": 2e-4, "friction": 0.2, "restitution": 0.0}
    final = simulate(
        0.09,
        0.03,
        particles=[points((-0.13, 0.6, -1), velocity=[[63.0, -19.0, 0]], radius=0.0)],
        forces=[{"type": "gravity", "acceleration": [-7.97, 4.87, -4.63]}],
        colliders=[
            {"name": "x", "center": [1.0001, 0, 0], "orientation": {"axis": [0, 0, 1], "angle": 90}, **sheet},
            {
                "name": "z",
                "center": [0, 0, -1.0001],
                "orientation": {"axis": [1, 0, 0], "angle": 90},
                **sheet,
            },
        ],
    ).final
    assert final.position[0, 0] <= 1 + 1e-12
    assert final.position[0, 2] == pytest.approx(-1, abs=1e-12)


@pytest.mark.parametrize(("static", "kinetic"), [(0.3, 1.0), (0.5, 0.5)])
def test_what_friction_nearly_holds_on_a_ball_does_not_creep_up(static: float, kinetic: float) -> None:
    # In a step of 28 ms a free end is 8 mm deep in a ball of 0.35 m, and is put back along another normal than it began at:
    # 60 µm higher than it came from, where friction leaves no speed to pay for that.
    angle, pull = np.linspace(0.2, 0.9, 400), 22.0
    x = 0.4 * np.stack([np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    ball = SphereCollider(radius=0.35, restitution=0.0, friction=Friction(static=static, kinetic=kinetic))
    contacts = careful(continuous=[ball.record()], reach=1.0, tolerance=16 * EPS)
    falls = program("velocity_verlet", (Gravity(acceleration=(0, -pull, 0)).record(),), contacts)
    c = columns(x, np.zeros_like(x), radius=0.05, method="velocity_verlet")
    before = pull * x[:, 1]
    for k in range(20):
        run(falls, c, 1, 0.028, first_step=k)
        energy = 0.5 * (velocity(c) ** 2).sum(axis=1) + pull * position(c)[:, 1]
        assert (energy <= before + 64 * EPS * pull).all()
        before = energy


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_table_that_shakes_is_left_behind(precision: str) -> None:
    """A ω² of 7.2 m/s² is more than μ g. In single precision a step sinks into 6 m by less than numbers are rounded, and
    what was put back counted as having climbed, so that it stood on the table whatever its friction was."""
    told = {
        "simulation": {"duration": 0.5, "dt": 1e-3, "integrator": "symplectic_euler", "precision": precision},
        "output": {"every": 500},
        "particles": [points((0, 0.05, 0), velocity=[[0.6, 0, 0]], radius=0.05, mass=1.0)],
        "forces": [{"type": "gravity"}],
        "colliders": [
            {
                "name": "table",
                "type": "rectangle",
                "size": [6, 6],
                "thickness": 0.02,
                "center": [0, -0.01, 0],
                "restitution": 0.3,
                "friction": 0.3,
            }
        ],
        "motions": [{"collider": "table", "path": ["x + 0.05*sin(12*t)", "y", "z"]}],
    }
    # x'' = μ g sgn(v_table − v) by steps of 1 µs; one step of friction may be missed
    x, v, h = 0.0, 0.6, 1e-6
    for k in range(500_000):
        table = 0.6 * math.cos(12 * k * h)
        v += h * 0.3 * 9.80665 * math.copysign(1, table - v)
        x += h * v
    ended = ps.run(ps.from_table(told)).final
    assert ended.velocity[0, 0] == pytest.approx(v, abs=2 * 0.3 * 9.80665 * 1e-3)
    assert ended.position[0, 0] == pytest.approx(x, abs=2e-3)


@pytest.mark.parametrize("depth", [0.0, 4e-16, 1e-4])
@pytest.mark.parametrize("method", ["explicit_euler", "symplectic_euler", "velocity_verlet"])
def test_what_starts_at_rest_slides_whatever_its_method_does_first(method: str, depth: float) -> None:
    """The first step of `explicit_euler` goes nowhere; friction had taken it uphill, and it stayed for ever."""
    angle, mu, dt = math.radians(30), 0.2, 4e-3
    turned = {"axis": [0, 0, 1], "angle": 30}
    box = {"type": "box", "size": [20, 1, 4], "center": [0.25, -0.25 * 3**0.5, 0], "orientation": turned}
    far = {"type": "sphere", "center": [0, -5, 0], "radius": 1}
    told = {
        "simulation": {"duration": 0.2, "dt": dt, "integrator": method},
        "output": {"every": 50},
        "particles": [points((4 * math.cos(angle), 4 * math.sin(angle) - depth, 0), mass=1.0)],
        "forces": [{"type": "gravity"}],
        "colliders": [{"type": "union", "of": [box, far], "restitution": 0.5, "friction": mu}],
    }
    speed = np.linalg.norm(ps.run(ps.from_table(told)).final.velocity[0])
    pull = 9.80665 * (math.sin(angle) - mu * math.cos(angle))
    assert speed == pytest.approx(0.2 * pull, abs=2 * pull * dt)


LARGE: dict[str, dict[str, Any]] = {
    "box": {"type": "box", "size": [40, 1, 40], "center": [0, -0.5, 0]},
    "cube": {"type": "box", "size": [40, 40, 40], "center": [0, -20, 0]},
    "inside": {"type": "box", "size": [40, 40, 40], "center": [0, 20, 0], "inside": True},
    "rectangle": {"type": "rectangle", "size": [100, 100], "thickness": 0.02, "center": [0, -0.01, 0]},
    "cylinder": {"type": "cylinder", "start": [0, -1, 0], "end": [0, 0, 0], "radius": 3},
    "sphere": {"type": "sphere", "center": [0, -20, 0], "radius": 20},
    "union": {
        "type": "union",
        "of": [
            {"type": "box", "size": [40, 1, 40], "center": [0, -0.5, 0]},
            {"type": "sphere", "center": [0, -9, 0], "radius": 1},
        ],
    },
    "plane": {"type": "plane", "point": [0, 20, 0], "normal": [0, 1, 0]},
}
"""Colliders so large, or so far from the origin, that g h² is less than places are rounded in single precision."""


def on_large(shape: str, lean: float, steps: int, height: float = 0.0, **surface: Any) -> Any:
    """A ball on a large collider in single precision, under gravity that leans by an angle [degrees]; frames of 7 steps."""
    turn = math.radians(lean)
    told = {
        "simulation": {"duration": steps * 1e-4, "dt": 1e-4, "precision": "single"},
        "output": {"every": 7},
        "particles": [points((0, 0.01 + height, 0), radius=0.01, mass=1.0)],
        "forces": [
            {"type": "gravity", "acceleration": [9.80665 * math.sin(turn), -9.80665 * math.cos(turn), 0]}
        ],
        "colliders": [{**LARGE[shape], "restitution": 0, **surface}],
    }
    return ps.run(ps.from_table(told))


@pytest.mark.parametrize("shape", LARGE)
def test_friction_holds_in_single_precision_on_what_is_large(shape: str) -> None:
    """20° is less than arctan μ. A step that ended inside by less than rounding errors was free, and so was the next: the
    ball fell by 5e-5 m until it was caught, and slid by mm."""
    ended = on_large(shape, 20, 2800, height=20.0 if shape == "plane" else 0.0, friction=0.5)
    assert (ended.ledger["kinetic"] == 0).all()
    assert abs(ended.final.position[0, 0]) == 0


@pytest.mark.parametrize("shape", ["box", "cube", "plane"])
def test_friction_acts_evenly_in_single_precision_on_what_is_large(shape: str) -> None:
    """A belt takes a ball along with μ g, v = μ g t; but for one step, and rounding of v, 2⁻²⁴ in each step. It had been
    pulled six times as much in every sixth step."""
    ended = on_large(
        shape, 0, 700, height=20.0 if shape == "plane" else 0.0, friction=0.5, surface_velocity=[9, 0, 0]
    )
    speed = np.sqrt(2 * ended.ledger["kinetic"])
    pull = 0.5 * 9.80665
    assert np.abs(speed - pull * ended.times).max() <= 1.01 * pull * 1e-4 + 700 * 2.0**-24


RESTS: dict[str, tuple[dict[str, Any], tuple[float, float, float]]] = {
    "on a box": ({"type": "box", "center": [0, -1, 0], "size": [8, 2, 8]}, (0.3, 0.01, -0.7)),
    "in a box": ({"type": "box", "inside": True, "center": [0, 4, 0], "size": [8, 8, 8]}, (0.3, 0.01, -0.7)),
    "on a cylinder": (
        {"type": "cylinder", "start": [0, -1, 0], "end": [0, 0, 0], "radius": 3},
        (0.3, 0.01, -0.7),
    ),
    "on a slope": (
        {"type": "box", "size": [8, 2, 8], "orientation": {"axis": [0, 0, 1], "angle": 10}, "friction": 0.5},
        (0.3, 1.1, -0.7),
    ),
    "in a bowl": (
        {"type": "sphere", "inside": True, "center": [0, 3, 0], "radius": 3, "friction": 0.5},
        (0.3, 0.02, -0.2),
    ),
    "on a dome": ({"type": "sphere", "center": [0, -3, 0], "radius": 3, "friction": 0.5}, (0.3, 0.0, -0.2)),
}


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("where", RESTS)
def test_what_rests_stays_to_the_last_bit(where: str, precision: str) -> None:
    """Places had gone to and fro by a rounding error on a box, where each step was looked at anew: four times the cost."""
    collider, x = RESTS[where]
    scenario = table(
        1.6,
        1e-3,
        particles=[points(x, mass=1.0, radius=0.0)],
        forces=[{"type": "gravity"}],
        colliders=[{**collider, "restitution": 0.2}],
    )
    scenario["simulation"]["precision"] = precision
    simulation = Simulation(ps.from_table(scenario))
    simulation.advance_to(1500)
    state = simulation.states[0]
    start = state.x[:, 0].copy()
    for step in (1501, 1502, 1505, 1600):
        simulation.advance_to(step)
        assert (state.v[:, 0] == 0).all()
        assert (state.x[:, 0] == start).all()
    simulation.close()


@pytest.mark.sampled(6)
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("slope", [20.0, 45.0, 70.0])
def test_a_ball_that_rolls_off_a_slope_is_rubbed_by_the_floor_alone(slope: float, first: int) -> None:
    """It leaves the slope as it hits the floor, about which its angular momentum stays: v' = (5 v cos θ + 2 v)/7. The slope
    had rubbed it once more, by what the floor has given: at 45° that took 13 % of the energy, however short the step."""
    angle, r, v, way = math.radians(slope), 0.05, 2.0, 0.1
    cos, sin = math.cos(angle), math.sin(angle)
    begin = (r * (1 - cos) / sin - way * cos, r + way * sin, 0.0)
    planes = [
        {"normal": [sin, cos, 0], "restitution": 0, "friction": 1.5},
        {"normal": [0, 1, 0], "restitution": 0, "friction": 1.5},
    ]
    for dt in (2e-3, 5e-4):
        final = simulate(
            0.2,
            dt,
            particles=[
                points(
                    begin,
                    velocity=[[v * cos, -v * sin, 0]],
                    radius=r,
                    mass=1.0,
                    angular_velocity=[[0, 0, -v / r]],
                )
            ],
            interactions=[{"type": "contact", "friction": 0.5, "restitution": 0.5}],
            planes=planes[first:] + planes[:first],
        ).final
        assert final.velocity[0] == pytest.approx([(5 * cos + 2) * v / 7, 0, 0], abs=1e-6)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("slope", [30.0, 3.0])
def test_a_slope_beside_which_a_ball_passes_does_not_rub_it(slope: float, first: int) -> None:
    """It slides on a smooth floor, 0.3 mm beside a rough slope, which had stopped its surface if it came first."""
    angle, r = math.radians(slope), 0.05
    begin = (0.0, r, -(r + 3e-4 - r * math.cos(angle)) / math.sin(angle))
    planes = [
        {"normal": [0, 1, 0], "restitution": 0.0},
        {"normal": [0, math.cos(angle), -math.sin(angle)], "restitution": 0.0, "friction": 1.0},
    ]
    final = simulate(
        0.2,
        1e-3,
        particles=[points(begin, velocity=[[1.0, 0, 0]], radius=r, mass=1.0)],
        forces=GRAVITY,
        interactions=[{"type": "contact", "friction": 0.5}],
        planes=planes[first:] + planes[:first],
    ).final
    assert final.velocity[0] == pytest.approx([1.0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("spin", [400.0, -400.0])
def test_a_ball_that_starts_to_roll_while_it_turns_about_its_normal_gains_nothing(spin: float) -> None:
    """In a hollow ball its normal n turns by Δn a step; that is a slip of G = r ω_n n × Δn more. If it slid by −½ G before,
    friction that stops all of it at once gives ¹⁄₂₈ G² of energy per mass: 4·10⁻⁵ of it."""
    r, hollow, v, dt = 0.05, 0.8, 1.0, 1e-2
    turned = r * abs(spin) * v * dt / (hollow - r)
    for lead in (-0.5, 0.5):
        ball = points(
            (0, r - hollow, 0),
            velocity=[[v, 0, 0]],
            radius=r,
            mass=1.0,
            angular_velocity=[[lead * turned / r, spin, -v / r]],
        )
        wall = {"type": "sphere", "radius": hollow, "inside": True, "restitution": 0, "friction": 2.0}
        simulation = Simulation(
            ps.from_table(
                table(
                    0.2,
                    dt,
                    particles=[ball],
                    interactions=[{"type": "contact", "friction": 0.5, "restitution": 0.5}],
                    colliders=[wall],
                )
            )
        )
        energies = []
        for step in range(21):
            simulation.advance_to(step)
            energies.append(simulation.ledger()["kinetic"])
        simulation.close()
        assert np.diff(energies).max() < 1e-8 * energies[0]
