"""Rolling friction of hard grains: on slopes and floors, between two, in heaps, what is kept, and the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulate import EPS, Table, points, simulate, table

import particlesim as ps
from particlesim.colliders.response import FrictionRecord
from particlesim.compiler import kernel
from particlesim.engine.interactions.hard.friction import held_by
from particlesim.engine.interactions.hard.memory import Known, known_by, with_room
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.step.rubbing import limited, slowed

R, M, G, MU = 0.05, 0.1, 9.81, 0.2
PILE = ((0.0, R, 0.0), (2 * R, R, 0.0), (R, R + math.sqrt(3) * R, 0.0))
"""Two grains beside each other, and one on both."""


def rolling(
    angle: float,
    duration: float,
    *places: tuple[float, float, float],
    precision: str = "double",
    mu: float = MU,
    method: str = "velocity_verlet",
    **group: Any,
) -> ps.Result:
    """Grains on a plane, with gravity turned by an angle instead of the plane."""
    found = table(
        duration,
        1e-3,
        method,
        particles=[points(*(places or ((0, R, 0),)), mass=M, radius=R, **group)],
        interactions=[{"type": "contact", "restitution": 0.3, "friction": 0.5, "rolling_friction": mu}],
        forces=[{"type": "gravity", "acceleration": [G * math.sin(angle), -G * math.cos(angle), 0]}],
        planes=[{"restitution": 0.3, "friction": 0.5}],
    )
    found["simulation"]["precision"] = precision
    return ps.run(ps.from_table(found))


@pytest.mark.parametrize("model", [{}, {"model": "linear", "stiffness": 2e4}])
def test_what_has_stuck_turns_no_more(model: Table) -> None:
    # It had kept its spin, and driven the other one, which lies on it and at a wall, for ever.
    found = simulate(
        0.3,
        2e-4,
        particles=[
            points((0, 1.000001 * R, 0), mass=M, radius=R, angular_velocity=[0, 0, 20], name="stuck"),
            points((0.06, 0.1301, 0), mass=M, radius=R, name="other"),
        ],
        interactions=[{"type": "contact", "restitution": 0, "friction": 0.8, **model}],
        forces=[{"type": "gravity"}],
        planes=[
            {"on": ["stuck"], "contact": "stick"},
            {"on": ["other"], "point": [0.11, 0, 0], "normal": [-1, 0, 0], "restitution": 0},
        ],
    ).final
    assert (found["angular_velocity"][0] == 0).all()
    assert np.abs(found.velocity).max() < 1e-3
    assert R * np.abs(found["angular_velocity"]).max() < 1e-3


@pytest.mark.parametrize("precision", ["double", pytest.param("single", marks=pytest.mark.slow)])
def test_grains_rest_on_slopes_below_their_angle_and_roll_above_it(precision: str) -> None:
    # m v' = m g sin θ − f, 2/5 m r² ω' = f r − μ_r r m g cos θ and v = ω r: v' = 5/7 g (sin θ − μ_r cos θ). What rests
    # has nothing but rounding: a float of single precision next to 1 m has 6e-8 of it.
    noise = EPS if precision == "double" else float(np.finfo(np.float32).eps)
    held = [rolling(math.atan(0.95 * MU), duration, precision=precision).final for duration in (0.1, 1.0)]
    for final in held:
        assert np.abs(final.position - [0, R, 0]).max() < noise
        assert np.abs(final.velocity).max() < noise
        assert R * np.abs(final["angular_velocity"]).max() < noise
    angle = math.atan(1.25 * MU)
    v = 5 / 7 * G * (math.sin(angle) - MU * math.cos(angle)) * 0.5
    final = rolling(angle, 0.5, precision=precision).final
    assert final.velocity[0, 0] == pytest.approx(v, rel=500 * noise)
    assert final["angular_velocity"][0, 2] == pytest.approx(-v / R, rel=500 * noise)
    assert final.position[0, 0] == pytest.approx(v * 0.25, rel=500 * noise)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["symplectic_euler", "stormer_verlet", "rk4"])
def test_with_every_method(method: str) -> None:
    # Störmer's leaps begin with velocities of their own: friction had not told these, and balls slid without it.
    final = rolling(math.atan(0.95 * MU), 1.0, method=method).final
    assert np.abs(final.position - [0, R, 0]).max() < EPS
    angle = math.atan(1.25 * MU)
    v = 5 / 7 * G * (math.sin(angle) - MU * math.cos(angle)) * 0.5
    final = rolling(angle, 0.5, method=method).final
    assert final.velocity[0, 0] == pytest.approx(v, rel=1e-11)
    assert final.position[0, 0] == pytest.approx(
        v * 0.25, rel=3e-3 if method == "symplectic_euler" else 1e-11
    )


def test_a_pile_on_a_slope_stays_where_it_is() -> None:
    early, late = (rolling(math.atan(0.95 * MU), duration, *PILE).final for duration in (0.3, 2.0))
    assert np.abs(early.position - np.array(PILE)).max() < 1e-5 * R
    assert np.abs(late.position - early.position).max() < 1e-12 * R
    rounding = 1e-12 * G * 1e-3  # of what forces give in a step
    assert np.abs(late.velocity).max() < rounding
    assert R * np.abs(late["angular_velocity"]).max() < rounding


def test_a_grain_stands_on_another_as_steep_as_rolling_friction_holds_it() -> None:
    # At an angle φ from the top gravity turns it about the contact by m g r sin φ, and rolling friction by up to
    # μ_r r/2 m g cos φ. The contact holds it by what it has been given in the step before, so that nothing creeps.
    def stands(part: float, duration: float) -> Any:
        angle = math.atan(part * MU / 2)
        top = (2 * R * math.sin(angle), 2 * R * math.cos(angle), 0.0)
        final = simulate(
            duration,
            1e-3,
            particles=[points((0, 0, 0), top, mass=M, radius=R, pinned=[0])],
            interactions=[{"type": "contact", "restitution": 0.3, "friction": 0.5, "rolling_friction": MU}],
            forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        ).final
        return final.position[1] - top, final.velocity[1]

    (early, _), (late, speed) = stands(0.95, 0.2), stands(0.95, 1.0)
    assert np.abs(late - early).max() < 1e-12 * R
    assert np.abs(early).max() < 1e-3 * R
    assert np.abs(speed).max() < EPS
    assert stands(1.05, 1.0)[0][1] < -R


def test_a_grain_that_rolls_on_a_level_floor_stops_after_its_way() -> None:
    v, mu = 0.3, 0.1
    way, time = v * v / (2 * 5 / 7 * mu * G), v / (5 / 7 * mu * G)
    motion = {"velocity": [(v, 0.0, 0.0)], "angular_velocity": [0, 0, -v / R]}
    half, final = (rolling(0.0, round(part * time, 3), mu=mu, **motion).final for part in (0.5, 1.3))
    assert half.velocity[0, 0] == pytest.approx(v - 5 / 7 * mu * G * round(0.5 * time, 3), rel=1e-11)
    # it stops within a step, whose way is not known better than to the square of that
    assert final.position[0, 0] == pytest.approx(way, abs=5 / 7 * mu * G * 1e-3**2)
    assert abs(final.velocity[0, 0]) < EPS
    assert R * np.abs(final["angular_velocity"]).max() < EPS


@pytest.mark.parametrize("dt", [1e-4, 0.1])
def test_two_that_turn_against_each_other_are_slowed_as_far_as_their_blow_allows(dt: float) -> None:
    # Also in the midst of a step in which one comes 4 radii.
    # Spins of r₁ ω₁ = −r₂ ω₂ across the normal do not slide, also after opposite impulses on spheres of m₁ r₁ = m₂ r₂:
    # friction has no part. The angular impulse is μ_r R J with J = (1 + e) μ Δv and R = r₁ r₂/(r₁ + r₂), or ends ω₁ − ω₂.
    r1, r2, m1, m2, e, speed = 0.05, 0.08, 0.16, 0.1, 0.4, 2.0
    push, radius = (1 + e) * m1 * m2 / (m1 + m2) * speed, r1 * r2 / (r1 + r2)
    i1, i2 = 0.4 * m1 * r1**2, 0.4 * m2 * r2**2
    for w, mu in ((300.0, 0.2), (4.0, 0.2)):
        spins = np.array([[5.0, w, 0], [-3.0, -w * r1 / r2, 0]])
        grains = points(
            (0, 0, 0),
            (0.14, 0, 0),
            velocity=[(speed, 0.0, 0.0), (0.0, 0.0, 0.0)],
            radius=[r1, r2],
            mass=[m1, m2],
            angular_velocity=spins.tolist(),
        )
        law = {"type": "contact", "restitution": e, "friction": 0.5, "rolling_friction": mu}
        duration = max(0.02, dt)
        final = simulate(duration, dt, particles=[grains], interactions=[law]).final["angular_velocity"]
        turn = min(mu * radius * push, abs(spins[0, 1] - spins[1, 1]) / (1 / i1 + 1 / i2))
        expected = spins - turn * np.array([[0, 1 / i1, 0], [0, -1 / i2, 0]])
        assert final == pytest.approx(expected, rel=1e-12, abs=1e-12 * w)
        assert i1 * final[0] + i2 * final[1] == pytest.approx(i1 * spins[0] + i2 * spins[1], rel=1e-13)


def test_a_swift_grain_rolls_off_the_floor_within_a_step() -> None:
    """Head-on a bullet of 60 radii a step gives its velocity u to a grain beside the floor, which rebounds from that with
    J = (1 + e) u_y: u_x' = 5/7 (u_x − μ_r J), where friction holds and rolling friction is all that is allowed; it rolls."""
    e, mu, n, speed, dt = 0.6, 0.1, np.array([-0.6, 0.8, 0.0]), 300.0, 0.01
    target = np.array([0.0, 2 * R, 0.0])
    grains = points(
        tuple(target + 20 * R * n),
        tuple(target),
        velocity=[(-speed * n).tolist(), (0, 0, 0)],
        mass=M,
        radius=R,
    )
    grains["angular_velocity"] = [0.0, 0.0, 0.0]
    law = {"type": "contact", "restitution": 1.0, "friction": 1e-12, "rolling_friction": mu}
    floor = {"restitution": e, "friction": 5.0}
    final = simulate(dt, dt, particles=[grains], interactions=[law], planes=[floor]).final
    x, y = 0.6 * speed, 0.8 * speed
    after = 5 / 7 * (x - mu * (1 + e) * y)
    assert final.velocity[1] == pytest.approx([after, e * y, 0.0], rel=1e-9, abs=1e-9 * speed)
    assert final["angular_velocity"][1] * R == pytest.approx([0.0, 0.0, -after], rel=1e-9, abs=1e-9 * speed)


def test_a_pinned_grain_that_turns_takes_along_what_hits_it() -> None:
    # Nearly without sliding friction by the angular impulse μ_r r/2 m v alone; with enough of both it ends as one body
    # that turns with the pinned one. That does the work: what others gain by it is not taken back.
    def after(friction: float, speed: float) -> tuple[Any, Any]:
        grains = points(
            (0, 0, 0),
            (2 * R + 1e-3 * speed, 0, 0),
            mass=M,
            radius=R,
            pinned=[0],
            velocity=[(0.0, 0.0, 0.0), (-speed, 0.0, 0.0)],
            angular_velocity=[[0, 0, 20.0], [0, 0, 0]],
        )
        law = {"type": "contact", "restitution": 0.0, "friction": friction, "rolling_friction": 5.0}
        simulation = Simulation(
            ps.from_table(table(0.02, 1e-4, particles=[grains], interactions=[law])), threads=1
        )
        simulation.advance_to(200)
        simulation.close()
        return simulation.states[0].v[:, 1], simulation.states[0].angular_velocity[:, 1]

    _, turning = after(1e-6, 0.1)
    assert turning[2] == pytest.approx(5.0 * (R / 2) * 0.1 / (0.4 * R**2), rel=1e-5)
    v, turning = after(5.0, 2.0)
    assert turning[2] == pytest.approx(20.0, rel=1e-9)
    assert v[1] == pytest.approx(2 * R * 20.0, rel=2e-3)


def gas(seed: int, n: int = 24, mu: float = 0.3, inside: bool = True, **more: Any) -> Table:
    """Grains of several sizes that fly and turn, in a box or drawn together by it not being there."""
    rng = np.random.default_rng(seed)
    x = (np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3)[:n] - 1) * 0.08
    v = rng.normal(size=(n, 3)) - (0 if inside else 12.0) * x
    wall = {"type": "box", "size": [0.3, 0.3, 0.3], "inside": True, "restitution": 0.5, "friction": 0.4}
    return table(
        0.2,
        2e-4,
        particles=[
            points(
                *map(tuple, x.tolist()),
                velocity=v.tolist(),
                angular_velocity=(30 * rng.normal(size=(n, 3))).tolist(),
                mass=rng.uniform(0.05, 0.2, n).tolist(),
                radius=rng.uniform(0.02, 0.035, n).tolist(),
            )
        ],
        interactions=[{"type": "contact", "restitution": 0.5, "friction": 0.4, "rolling_friction": mu}],
        **({"colliders": [{"name": "shell", **wall}]} if inside else {}),
        **more,
    )


def energy_of(simulation: Simulation) -> float:
    row = simulation.ledger()
    return float(row["kinetic"] + sum(v for k, v in row.items() if k.startswith("potential.")))


def test_nothing_gains_energy_and_those_that_are_free_keep_their_momenta() -> None:
    for seed in range(4):
        simulation = Simulation(ps.from_table(gas(seed)), threads=1)
        found = [energy_of(simulation)]
        for step in range(50, 1001, 50):
            simulation.advance_to(step)
            found.append(energy_of(simulation))
        simulation.close()
        assert np.diff(found).max() <= 1e-12 * found[0]
        assert found[-1] < 0.2 * found[0]
    simulation = Simulation(ps.from_table(gas(5, inside=False)), threads=1)
    first = simulation.ledger()
    simulation.advance_to(500)
    last = simulation.ledger()
    simulation.close()
    assert last["kinetic"] < 0.5 * first["kinetic"]
    for axis in "xyz":
        assert abs(last[f"momentum.{axis}"] - first[f"momentum.{axis}"]) < 1e-13
        # what overlaps at the end of its step is put apart, which moves angular momentum by some thousandth of m v r
        assert abs(last[f"angular_momentum.{axis}"] - first[f"angular_momentum.{axis}"]) < 1e-4


@pytest.mark.slow
def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: pytest.MonkeyPatch) -> None:
    # in a shell that turns, under gravity
    for name in ("WORTH_SPRINGS", "WORTH_THREADS"):
        monkeypatch.setattr(f"particlesim.engine.islands.stepping.{name}", 0)
    scenario = ps.from_table(
        gas(
            1,
            forces=[{"type": "gravity", "acceleration": [0, -60, 0]}],
            motions=[{"collider": "shell", "spin": {"axis": [0, 0, 1], "rate": 5.0}}],
        )
    )
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    for each in (one, two):
        each.advance_to(600)
    assert one.islands[0].interactions[-1].known.rolled.any()
    restore(other, snapshot(one))
    found = []
    for each in (one, two, other):
        each.advance_to(1000)
        state = each.states[0]
        found.append(b"".join(getattr(state, name).tobytes() for name in ("x", "v", "angular_velocity")))
        each.close()
    assert found[0] == found[1] == found[2]


def test_rolling_friction_is_refused_where_nothing_rolls() -> None:
    def refused(group: Table, **more: Any) -> str:
        law = {"type": "contact", "friction": 0.4, "rolling_friction": 0.1, **more.pop("law", {})}
        with pytest.raises(ps.ScenarioError) as error:
            ps.from_table(table(0.1, 1e-3, particles=[group], interactions=[law], **more))
        return str(error.value)

    cloth = {"type": "cloth", "origin": [0, 0, 0], "size": [1, 1], "resolution": [5, 5]}
    assert "do not roll" in refused({"name": "sheet", "layout": cloth, "mass": M, "radius": 0.01})
    assert "needs friction" in refused(points((0, 0, 0), mass=M, radius=R), law={"friction": 0})
    die = {"name": "die", "shape": {"type": "box", "size": [1, 1, 1]}, "density": 100, "position": [0, 3, 0]}
    grain = points((0, 0, 0), name="grain", mass=M, radius=R)
    assert "do not turn, and have no rolling friction" in refused(
        grain, bodies=[die], law={"between": ["grain", "die"]}
    )


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    push=st.floats(1e-3, 3),
    static=st.floats(0.01, 2),
    part=st.floats(0.2, 1),
    most=st.floats(0.001, 2),
)
def test_friction_and_rolling_friction_of_a_sphere_stay_in_their_bounds_and_give_nothing(
    seed: int, push: float, static: float, part: float, most: float
) -> None:
    rng = np.random.default_rng(seed)
    v, s = rng.normal(size=(2, 3))
    v[1] = s[1] = 0
    friction = FrictionRecord(static, part * static)
    p, q = map(np.array, slowed(tuple(v - s), tuple(s), friction, most, push))
    after, turned = v + p, s + 2.5 * (q - p)
    assert np.linalg.norm(p) <= static * push * (1 + 4 * EPS)
    assert np.linalg.norm(q) <= most * push * (1 + 4 * EPS)
    energy = after @ after + 0.4 * turned @ turned
    assert energy <= (v @ v + 0.4 * s @ s) * (1 + 8 * EPS)
    if np.linalg.norm(p) < 0.999 * part * static * push:
        assert np.abs(after - turned).max() < 1e-9  # it does not slide


def test_what_is_known_of_rolling_follows_its_particles() -> None:
    known = Known(
        np.array([0, 2, 3, 3]),
        np.array([1, -1, 2, 0], np.int32),
        np.arange(12.0).reshape(4, 3),
        -np.arange(12.0).reshape(4, 3),
    )
    found = known_by(known, np.array([2, 0, 1]), 3, 4)
    assert found.rolled is not None
    assert np.array_equal(found.rolled[:3], -found.push[:3])
    more = with_room(found, 9)
    assert np.array_equal(more.rolled[:3], found.rolled[:3])
    assert more.rolled.shape == (9, 3)


@pytest.mark.optimised
def test_what_hardly_moves_in_single_precision_stays_finite() -> None:
    # Below 10⁻¹⁹ m/s squares are denormal, of which processors take inverse roots to be infinite.
    @kernel
    def hold(held: Any, out: Any, speed: Any, push: Any) -> None:
        slip = (speed, speed, speed)
        for k, each in enumerate(held_by(held, 0, slip, speed / speed, push, push / push, push / push)):
            out[k] = each
        for k, each in enumerate(limited(slip, push)):
            out[3 + k] = each

    for speed in (1e-17, 1e-19, 1e-20, 1e-22):
        for push in (1e-19, 1e-22):
            held, out = np.zeros((4, 1), np.float32), np.zeros(6, np.float32)
            hold(held, out, np.float32(speed), np.float32(push))
            assert np.isfinite(out).all()
            assert np.isfinite(held).all()


# ---- on rigid bodies


@pytest.mark.slow
def test_a_grain_that_rolls_on_a_rigid_body_is_slowed_and_rests_on_its_slope() -> None:
    # On a block as heavy as a house, v' = 5/7 (g sin θ − μ_r g cos θ), and rest up to tan θ = μ_r.
    law = {
        "type": "contact",
        "restitution": 0.0,
        "friction": 0.8,
        "rolling_friction": MU,
        "on": ["grain", "block"],
    }
    block = {
        "name": "block",
        "shape": {"type": "box", "size": [10.0, 1.0, 10.0]},
        "mass": 1e9,
        "position": [0.0, -0.5, 0.0],
        "friction": 0.8,
    }
    speed, h, t = 1.0, 1e-3, 0.3
    grains = points((0, R, 0), (0, R, 1), mass=M, radius=R, name="grain", velocity=[(speed, 0, 0), (0, 0, 0)])
    grains["angular_velocity"] = [[0.0, 0.0, -speed / R], [0.0, 0.0, 0.0]]
    for slope, moves in ((0.95 * MU, False), (1.2 * MU, True)):
        a = math.atan(slope)
        pull = {"type": "gravity", "acceleration": [G * math.sin(a), -G * math.cos(a), 0], "on": ["grain"]}
        found = simulate(t, h, particles=[grains], bodies=[block], interactions=[law], forces=[pull]).final
        v, change = found.velocity[:2, 0], 5 / 7 * G * (math.sin(a) - MU * math.cos(a)) * t
        assert v[0] == pytest.approx(speed + change, abs=2 * G * h)
        assert v[1] == pytest.approx(change if moves else 0.0, abs=2 * G * h if moves else 1e-9)
        assert R * found["angular_velocity"][1, 2] == pytest.approx(-v[1], abs=1e-9)


def test_a_blow_on_a_round_body_has_the_rolling_friction_of_two_spheres() -> None:
    # As between two grains: an angular impulse of μ_r r₁ r₂/(r₁ + r₂) J, where both surfaces turn alike.
    r1, r2, m1, m2, speed, w, mu = 0.05, 0.08, 0.16, 0.1, 2.0, 300.0, 0.2
    push = m1 * m2 / (m1 + m2) * speed
    spins = np.array([[0.0, w, 0], [0.0, -w * r1 / r2, 0]])
    grain = points((0, 0, 0), velocity=[(speed, 0, 0)], radius=r1, mass=m1, name="grain")
    grain["angular_velocity"] = [spins[0].tolist()]
    ball = {"name": "ball", "shape": {"type": "sphere", "radius": r2}, "mass": m2, "position": [0.14, 0, 0]}
    ball["angular_velocity"] = spins[1].tolist()
    law = {
        "type": "contact",
        "restitution": 0.0,
        "friction": 0.5,
        "rolling_friction": mu,
        "on": ["grain", "ball"],
    }
    final = simulate(0.01, 1e-4, particles=[grain], bodies=[ball], interactions=[law]).final
    turn = mu * r1 * r2 / (r1 + r2) * push
    after = [spins[0, 1] - turn / (0.4 * m1 * r1**2), spins[1, 1] + turn / (0.4 * m2 * r2**2)]
    # what hits it before the end of a step turns by that time, and slides
    assert final["angular_velocity"][:, 1] == pytest.approx(after, rel=1e-4)
