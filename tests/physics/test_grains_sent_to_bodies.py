"""Hard grains that others, or colliders, send to rigid bodies within a step: they rebound there as by events one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from physics.test_contacts import bits
from simulate import EPS, energies, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

H, R = 1e-3, 0.01
BOX = {"type": "box", "size": [0.4, 0.2, 0.6]}
"""Its side of x = −0.2 m is hit."""


def grains(position: Any, velocity: Any, **other: Any) -> dict[str, Any]:
    layout = {"type": "points", "position": position, "velocity": velocity}
    return {"name": "grains", "radius": R, "mass": 0.5, "layout": layout, **other}


def contacts(**law: Any) -> list[dict[str, Any]]:
    return [{"type": "contact", "on": ["grains", "body"], "model": "impulse", **law}]


def body(**other: Any) -> dict[str, Any]:
    return {"name": "body", "shape": BOX, "mass": 2.0, **other}


def totals(result: ps.Result) -> np.ndarray:
    names = [f"{name}.{axis}" for name in ("momentum", "angular_momentum") for axis in "xyz"]
    return np.array([result.ledger[name] for name in names])


def on_a_line(u: list[float], m: list[float], e: float) -> list[float]:
    """What a row has in the end whose last one comes to the others: each pair in turn, until none approaches."""
    u = list(u)
    while (k := next((k for k in range(len(u) - 1) if u[k] > u[k + 1] + 1e-12), None)) is not None:
        p = (1 + e) * (u[k] - u[k + 1]) * m[k] * m[k + 1] / (m[k] + m[k + 1])
        u[k], u[k + 1] = u[k] - p / m[k], u[k + 1] + p / m[k + 1]
    return u


@pytest.mark.parametrize(
    ("e", "mass", "speed"),
    [(1.0, 0.5, 10.0), (0.6, 0.5, 10.0), (1.0, 0.5, 1e3), (1.0, 20.0, 1e3), (0.6, 20.0, 1e3)],
)
def test_a_row_that_is_driven_to_a_body_ends_as_in_events_one_by_one(
    e: float, mass: float, speed: float
) -> None:
    # Impacts of a row take place in one order, so what comes of them depends on no times. It is one radius, or
    # 100, in a step.
    result = simulate(
        0.05 if speed < 100 else 0.01,
        H,
        particles=[grains([[-0.25, 0, 0], [-0.215, 0, 0]], [[speed, 0, 0], [0, 0, 0]])],
        bodies=[body(mass=mass)],
        interactions=contacts(restitution=e),
        output={"ledger": True, "every": 1},
    )
    found = np.array(result.final["velocity"])
    assert found[:, 0] == pytest.approx(on_a_line([speed, 0, 0], [0.5, 0.5, mass], e), abs=1e-12 * speed)
    assert np.abs(found[:, 1:]).max() < 1e-12 * speed
    rows = totals(result)[:3]
    assert np.abs(rows - rows[:, :1]).max() < 64 * EPS * 0.5 * speed
    assert np.diff(result.ledger["kinetic"]).max() < 64 * EPS * 0.5 * speed**2
    assert result.missed_crossings == 0


@pytest.mark.parametrize("rolling", [0.0, 0.2])
@pytest.mark.parametrize("seed", range(4))
def test_friction_of_such_an_impact_keeps_momentum_and_angular_momentum(seed: int, rolling: float) -> None:
    # One is sent to the box askew, off its middle, and turns. The box rests until then: it counts as hit where it is at the
    # end of the step.
    rng = np.random.default_rng(seed)
    place = np.array([-0.22, *rng.uniform(-0.08, 0.08, 2)])
    way = np.array([1.0, *rng.uniform(-0.6, 0.6, 2)])
    law = {"restitution": 0.5, "friction": {"static": 0.5, "kinetic": 0.3}, "rolling_friction": rolling}
    result = simulate(
        2 * H,
        H,
        particles=[
            grains([place.tolist(), (place - 0.021 * way).tolist()], [[0, 0, 0], (60 * way).tolist()])
            | {"angular_velocity": [0, 900, -400]}
        ],
        bodies=[body()],
        interactions=contacts(**law),
        output={"ledger": True, "every": 1},
    )
    rows = totals(result)
    assert result.final["velocity"][2, 0] > 1
    assert np.abs(rows - rows[:, :1]).max() < 256 * EPS * 0.5 * 60
    assert result.ledger["kinetic"][1] < result.ledger["kinetic"][0]


def test_a_grain_between_a_wall_and_a_body_goes_to_and_fro_within_a_step() -> None:
    # A box of 10¹² kg stays where it is: with e = 1 the grain keeps its speed, and it is where the folded way between both
    # says.
    speed, gap = 700.0, 0.08
    start, steps = 0.03, 40
    simulation = Simulation(
        ps.from_table(
            table(
                steps * H,
                H,
                particles=[grains([[-0.2 - gap + start, 0, 0]], [[speed, 0, 0]])],
                bodies=[body(mass=1e12)],
                planes=[{"normal": [1, 0, 0], "point": [-0.2 - gap, 0, 0], "on": ["grains"]}],
                interactions=contacts(restitution=1.0),
            )
        )
    )
    free = gap - 2 * R
    for step in range(1, steps + 1):
        simulation.advance_to(step)
        x, v = simulation.states[0].x[0, 0] + 0.2 + gap - R, simulation.states[0].v[0, 0]
        way = (start - R + speed * step * H) % (2 * free)
        assert abs(v) == pytest.approx(speed, rel=1e-7)
        assert x == pytest.approx(min(way, 2 * free - way), abs=3e-6)
    assert simulation.missed_crossings() == 0
    simulation.close()


def test_what_rebounds_from_a_thin_body_hits_nobody_behind_it() -> None:
    # The state that a guest gets at the beginning of its step is behind the body, where another one lies.
    thin = {"type": "box", "size": [0.02, 1, 1]}
    result = simulate(
        3 * H,
        H,
        particles=[grains([[-0.22, 0, 0], [0.06, 0, 0]], [[400, 0, 0], [0, 0, 0]])],
        bodies=[body(shape=thin, mass=1e9)],
        interactions=contacts(restitution=1.0),
    )
    assert result.final["velocity"][:2].tolist() == [[pytest.approx(-400, rel=1e-6), 0, 0], [0, 0, 0]]
    assert result.final["position"][1].tolist() == [0.06, 0, 0]


def test_where_emitters_hear_of_it_a_grain_waits_for_its_impact_in_the_next_step() -> None:
    dust = {
        "name": "dust",
        "radius": 0.001,
        "mass": 1e-6,
        "lifetime": 1.0,
        "on_impact": {"of": ["grains"], "against": ["body"], "count": 1},
    }
    result = simulate(
        10 * H,
        H,
        particles=[grains([[-0.25, 0, 0], [-0.215, 0, 0]], [[30, 0, 0], [0, 0, 0]])],
        bodies=[body(mass=20.0)],
        interactions=contacts(restitution=1.0),
        emitters=[dust],
        output={"ledger": True, "every": 1},
    )
    found = [result.final["velocity"][k, 0] for k in (0, 1)]
    assert found == pytest.approx(on_a_line([30, 0, 0], [0.5, 0.5, 20.0], 1.0)[:2], abs=1e-9)
    assert result.missed_crossings == 0
    assert result.born == 1


@pytest.mark.parametrize("h", [1e-3, 1e-5])
@pytest.mark.parametrize(("mass", "x"), [(4.0, 0.6), (0.1, 0.6), (0.1, 0.1)])
def test_a_swift_grain_on_a_door_rebounds_as_its_hinge_says(mass: float, x: float, h: float) -> None:
    # At a distance x from the hinge the door is a mass I/x²: v' = v (I/x² − m)/(I/x² + m), I = M/12 (0.8² + 0.05²) + M 0.4²
    met = mass * ((0.8**2 + 0.05**2) / 12 + 0.4**2) / x**2
    result = simulate(
        2e-3,
        h,
        particles=[grains([[x, 0, 0.06]], [[0, 0, -60]])],
        bodies=[body(shape={"type": "box", "size": [0.8, 2, 0.05]}, mass=mass, position=[0.4, 0, 0])],
        joints=[
            {
                "name": "hinge",
                "type": "hinge",
                "between": ["body", "world"],
                "anchor": [0, 0, 0],
                "axis": [0, 1, 0],
            }
        ],
        interactions=contacts(restitution=1.0),
    )
    assert result.final["velocity"][0, 2] == pytest.approx(-60 * (0.5 - met) / (0.5 + met), rel=1e-6)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("mass", [5.0, 0.005])
def test_a_box_on_the_ground_that_is_hit_stays_there(mass: float) -> None:
    # A light one had been moved by the impulse of the grain alone, to 2 m under the ground.
    result = simulate(
        4 * H,
        H,
        particles=[grains([[0, 0.15, 0]], [[0, -80, 0]])],
        bodies=[
            body(
                shape={"type": "box", "size": [0.1, 0.1, 0.1]},
                mass=mass,
                position=[0, 0.05, 0],
                restitution=1.0,
            )
        ],
        planes=[{"normal": [0, 1, 0], "restitution": 1.0}],
        interactions=contacts(restitution=1.0),
    )
    assert result.final["velocity"][0, 1] == pytest.approx(80, rel=1e-9)
    assert result.final["position"][1, 1] == pytest.approx(0.05, abs=1e-5)
    assert np.abs(result.final["velocity"][1]).max() < 1e-6


@pytest.mark.parametrize("spin", [0.0, 100.0])
@pytest.mark.parametrize("mass", [0.05, 5.0])
def test_a_moving_body_that_is_hit_keeps_momentum_and_angular_momentum(mass: float, spin: float) -> None:
    cube = {"type": "box", "size": [0.2, 0.2, 0.2]}
    flies = {"position": [-0.25, 0, 0], "velocity": [60, 5, 0], "angular_velocity": [0, 0, spin]}
    result = simulate(
        6 * H,
        H,
        particles=[grains([[0, 0.05, 0], [0.3, 0.02, 0]], [[0, 3, 0], [-40, 0, 2]])],
        bodies=[body(shape=cube, mass=mass, **flies)],
        interactions=contacts(restitution=0.5, friction=0.4),
        output={"ledger": True, "every": 1},
    )
    rows = totals(result)
    assert np.abs(rows - rows[:, :1]).max() < 256 * EPS * 60 * max(mass, 0.5)
    assert np.diff(result.ledger["kinetic"]).max() < 256 * EPS * 1800 * mass + 1e-9


def test_a_grain_that_grazes_a_large_face_meets_it_when_it_comes_to_it() -> None:
    plate = {"type": "box", "size": [40, 0.1, 2]}
    simulation = Simulation(
        ps.from_table(
            table(
                3 * H,
                H,
                particles=[grains([[-15, 0.06 + 1e-3, 0]], [[1e3, -0.55, 0]])],
                bodies=[body(shape=plate, mass=1e12)],
                interactions=contacts(restitution=1.0),
            )
        )
    )
    for step, gap in enumerate([0.45e-3, 0.1e-3, 0.65e-3], 1):
        simulation.advance_to(step)
        assert simulation.states[0].x[1, 0] - 0.06 == pytest.approx(gap, abs=2e-6)
    simulation.close()


def cloud(mass: float, e: float, steps: int, n: int = 60, **law: Any) -> dict[str, Any]:
    """Grains that fly 3 to 30 radii a step in a cube of 1 m, in whose middle is a box."""
    rng, x = np.random.default_rng(3), np.empty((0, 3))
    while len(x) < n:
        y = rng.uniform(-0.47, 0.47, 3)
        if np.abs(y).max() > 0.15 and (np.linalg.norm(x - y, axis=1) > 0.05).all():
            x = np.vstack([x, y])
    v = rng.normal(size=(n, 3)) * 10 ** rng.uniform(1.5, 2.5, (n, 1))
    sides = [np.roll([1.0 - 2 * s, 0, 0], k).tolist() for k in range(3) for s in (0, 1)]
    planes = [{"normal": n, "point": [-0.5 * a for a in n], "restitution": e} for n in sides]
    cube = {"type": "box", "size": [0.2, 0.2, 0.2]}
    return table(
        steps * H,
        H,
        particles=[grains(x.tolist(), v.tolist(), radius=0.02)],
        bodies=[body(shape=cube, mass=mass, angular_velocity=[3, 5, 1], restitution=e)],
        planes=planes,
        interactions=contacts(restitution=e, **law),
        output={"every": 1, "ledger": True},
    )


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_beads_on_springs_that_hit_a_body_keep_momentum(method: str) -> None:
    """Springs pull on at a bead that a body throws back within a step; where that was forgotten, action was no reaction."""
    x = [[0, 0.2, 0], [0.01, 0.18, 0], [0.01, 0.195, 0.005], [0, 0.17, 0.01]]
    beads = {**grains(x, [[0, 0, 0]] * 4), "radius": 0.004, "mass": 3e-4}
    box = {"shape": {"type": "box", "size": [0.1] * 3}, "mass": 1.0}
    pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    result = simulate(
        0.06,
        2e-4,
        method,
        particles=[beads],
        bodies=[{"name": "body", "position": [0, 0.3, 0], "velocity": [0, -8, 0], **box}],
        springs=[{"on": "grains", "pairs": pairs, "stiffness": 600.0}],
        interactions=contacts(restitution=1.0),
        output={"every": 10, "ledger": True},
    )
    assert np.abs(totals(result)[:3] - totals(result)[:3, :1]).max() < 1e3 * EPS
    assert np.array(result.final["velocity"])[:, 1].min() < -7.9  # they have met it


@pytest.mark.slow
@pytest.mark.parametrize("e", [1.0, 0.5])
@pytest.mark.parametrize("mass", [50.0, 2000.0])
def test_a_cloud_about_a_body_gains_nothing_and_passes_nothing(e: float, mass: float) -> None:
    scenario = cloud(mass, e, 40)
    found = energies(scenario)
    assert np.diff(found).max() < 1e-12 * found[0]
    if e == 1:
        assert np.abs(found / found[0] - 1).max() < 1e-12
    result = ps.run(ps.from_table(scenario))
    assert result.missed_crossings == 0


def test_rolling_friction_gives_nothing_where_a_box_drives_grains_to_and_fro() -> None:
    # A box of 20 m/s throws two grains at the floor, at it and at each other, dozens of times in a step.
    law = {"restitution": 0.3, "friction": 0.4}
    sand = {
        "name": "sand",
        "radius": [0.0098, 0.0092],
        "density": 2600.0,
        "layout": {"type": "points", "position": [[-0.0124, 0.012, -0.0352], [0.0126, 0.0121, -0.0124]]},
    }
    box = {
        "name": "box",
        "shape": {"type": "box", "size": [0.06, 0.04, 0.08]},
        "density": 90.0,
        "position": [-0.0015, 0.0826, 0.0018],
        "velocity": [0, -20.0, 0],
        **law,
    }
    rows = simulate(
        6e-3,
        H,
        particles=[sand],
        bodies=[box],
        planes=[law],
        forces=[{"type": "gravity"}],
        interactions=[
            {"type": "contact", "on": ["sand", "box"], "model": "impulse", "rolling_friction": 0.1, **law}
        ],
        output={"every": 1, "ledger": True},
    ).ledger
    energy = rows["kinetic"] + rows["potential.gravity"]
    assert np.diff(energy).max() < 1e-5 * energy[0]


@pytest.mark.slow
def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(cloud(20.0, 0.8, 40, friction=0.3))
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    one.advance_to(20)
    two.advance_to(20)
    assert bits(one) == bits(two)
    restore(other, snapshot(one))
    for each in (one, two, other):
        each.advance_to(40)
    assert bits(one) == bits(two) == bits(other)
