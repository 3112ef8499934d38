"""Hard contacts: what impulses keep and take, chains of them, rest on each other, and the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from physics.test_contacts import bits, heap
from simulate import EPS, energies, points, rows, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R, M = 0.05, 0.1
HARD = {"type": "contact", "model": "impulse"}


def struck(beside: float = 0.0, masses: tuple[float, float] = (0.1, 0.3), **law: Any) -> np.ndarray:
    """Velocities after a sphere at 1 m/s has struck another one."""
    groups = [
        points((-0.13, 0, 0), velocity=[(1, 0, 0)], name="cue", mass=masses[0], radius=R),
        points((0, beside, 0), name="ball", mass=masses[1], radius=R),
    ]
    final = simulate(0.1, 1e-4, particles=groups, interactions=[{**HARD, **law}]).final
    return final.velocity


@pytest.mark.parametrize("e", [1.0, 0.7, 0.0])
def test_head_on_by_the_closed_form(e: float) -> None:
    m, n = 0.1, 0.3
    centre = m / (m + n)
    v = struck(restitution=e)
    assert np.abs(v[:, 0] - (centre - e * n / (m + n), centre + e * m / (m + n))).max() < 8 * EPS
    assert not v[:, 1:].any()


@pytest.mark.parametrize("speed", [0.4, 0.5, 3.0, 40.0])
def test_restitution_falls_with_the_speed_of_an_impact(speed: float) -> None:
    """e = 0.8 up to 0.5 m/s, and 0.8 (v/v₀)^(−1/4) above."""
    balls = points(
        (0, 0, 0), (0.2, 0, 0), velocity=((speed / 2, 0, 0), (-speed / 2, 0, 0)), radius=0.05, mass=0.1
    )
    falls = {"value": 0.8, "speed": 0.5}
    u = simulate(0.3, 1e-3, particles=[balls], interactions=[{**HARD, "restitution": falls}]).final.velocity[
        :, 0
    ]
    assert u.sum() == pytest.approx(0, abs=EPS)
    assert (u[1] - u[0]) / speed == pytest.approx(0.8 * max(speed / 0.5, 1) ** -0.25, rel=1e-12)


def test_restitution_that_falls_is_refused_where_it_has_no_meaning() -> None:
    balls = points((0, 0, 0), radius=0.05)
    falls = {"type": "contact", "restitution": {"value": 0.8, "speed": 0.5}}
    with pytest.raises(ps.ScenarioError, match="restitution that falls with speed belongs to impulses"):
        ps.from_table(
            table(1.0, 1e-3, particles=[balls], interactions=[{**falls, "model": "linear", "stiffness": 1.0}])
        )


def test_oblique_elastic_impacts_keep_momentum_energy_and_angular_momentum() -> None:
    v = struck(beside=0.7 * R)
    m = np.array([[0.1], [0.3]])
    assert np.abs((m * v).sum(axis=0) - (0.1, 0, 0)).max() < 8 * EPS
    assert abs((m * v**2).sum() - 0.1) < 16 * EPS
    u = struck(beside=0.7 * R, masses=(0.1, 0.1))
    assert abs(u[0] @ u[1]) < 16 * EPS  # equal masses part at a right angle


def test_friction_takes_what_coulomb_allows_and_no_more_than_there_is() -> None:
    # 2/7 of the slip is what stops surfaces that are free to turn; overlaps of v dt are a thousandth of the radius
    slip, approach = 0.35, math.sqrt(1 - 0.35**2)
    most = 2 / 7 * slip / (2 * approach)
    for mu in (0.05, 0.1):
        v = struck(beside=0.7 * R, masses=(0.1, 0.1), friction=mu)
        n = v[1] - struck(beside=0.7 * R, masses=(0.1, 0.1))[1]
        line = struck(beside=0.7 * R, masses=(0.1, 0.1))[1]
        assert np.linalg.norm(n) / np.linalg.norm(line) == pytest.approx(min(mu, most), rel=3e-3)
    v = struck(beside=0.7 * R, masses=(0.1, 0.1), friction=50.0, restitution=0.0)
    # 2/7 of the slip goes into spin, and nothing is left along the normal
    assert np.linalg.norm(v[0] - v[1]) == pytest.approx(5 / 7 * slip, rel=3e-3)


@pytest.mark.parametrize("order", [1, -1])
def test_a_row_of_touching_balls_passes_the_blow_on(order: int) -> None:
    at = [(-0.06, 0.0, 0.0), *((2 * R * k, 0.0, 0.0) for k in range(1, 9))]
    velocity = [(1.0, 0.0, 0.0), *[(0.0, 0.0, 0.0)] * 8]
    group = points(*at[::order], velocity=velocity[::order], mass=M, radius=R)
    v = simulate(0.2, 1e-4, particles=[group], interactions=[HARD]).final.velocity[::order]
    assert np.abs(v[-1] - (1, 0, 0)).max() < 1e-14
    assert np.abs(v[:-1]).max() < 1e-14


def test_impulses_act_across_the_sides_of_a_periodic_box() -> None:
    """What happens across a corner is what happens in the middle, and all momentum is kept."""
    rng = np.random.default_rng(6)
    place, speed = rng.uniform(-0.16, 0.16, (40, 3)), rng.uniform(-1, 1, (40, 3))
    law = {**HARD, "restitution": 0.8, "friction": 0.3}
    box = {"size": [1.0, 1.0, 1.0], "periodic": [True, True, True]}
    found = []
    for middle in (0.5, 0.0):
        at = (place + middle) % 1.0 if middle == 0 else place + middle
        group = points(*map(tuple, at), velocity=speed.tolist(), mass=M, radius=0.02)
        scenario = table(0.1, 1e-3, particles=[group], interactions=[law])
        scenario["simulation"]["box"] = box
        final = ps.run(ps.from_table(scenario)).final
        assert np.abs((final.velocity - speed).sum(axis=0)).max() < 1e-13
        found.append(final.velocity)
    assert np.abs(found[0] - speed).max() > 0.1
    # the first overlaps at the start are the same to rounding, and what it does grows from impact to impact
    assert np.abs(found[1] - found[0]).max() < 1e-8
    cloth = {"type": "contact", "model": "impulse"}
    sheet = {
        "name": "cloth",
        "layout": {"type": "cloth", "resolution": [3, 3], "size": [0.1, 0.1]},
        "radius": 0.001,
    }
    scenario = table(0.1, 1e-3, particles=[sheet], interactions=[cloth])
    scenario["simulation"]["box"] = box
    with pytest.raises(ps.ScenarioError, match="surfaces = false"):
        ps.from_table(scenario)


def test_a_gas_keeps_momentum_and_energy() -> None:
    rng = np.random.default_rng(1)
    x = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), -1).reshape(-1, 3)
    group = points(*map(tuple, x), velocity=rng.normal(0, 1, x.shape).tolist(), mass=M, radius=0.35)
    scenario = table(2.0, 1e-3, particles=[group], interactions=[HARD], output={"every": 200})
    energy = energies(scenario)
    assert np.abs(energy / energy[0] - 1).max() < 1e-13


def test_a_heap_comes_to_rest_and_gains_nothing() -> None:
    table = heap("impulse", n=60)
    table["simulation"] |= {"duration": 3.0, "dt": 1e-3}
    table["output"]["every"] = 200
    simulation = Simulation(ps.from_table(table))
    highest = []
    for step in range(200, 3001, 200):
        simulation.advance_to(step)
        highest.append(simulation.ledger()["kinetic"])
    # what rolls on a floor has nothing that stops it
    assert highest[-1] < 1e-3 * max(highest)
    x, r = simulation.states[0].position, simulation.states[0].radius[:60]
    apart = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1)) - r[:, None] - r[None]
    np.fill_diagonal(apart, 0)
    assert apart.min() > -0.02 * r.min()
    assert (x[:, 1] - r).min() > -1e-12


def test_a_start_that_overlaps_comes_apart_gently() -> None:
    group = points((0, 0, 0), (0.02, 0, 0), (0.02, 0, 0), mass=M, radius=R)
    final = simulate(1.0, 1e-3, particles=[group], interactions=[HARD]).final
    assert not final.velocity.any()
    x = final.position
    apart = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1))[np.triu_indices(3, 1)]
    assert apart.min() > 2 * R * (1 - 1e-3)


def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(heap("impulse", n=500))
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    one.advance_to(250)
    two.advance_to(250)
    assert bits(one) == bits(two)
    restore(other, snapshot(one))
    for each in (one, two, other):
        each.advance_to(500)
    assert bits(one) == bits(two) == bits(other)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [{}, {"model": "hertz", "young_modulus": 1e5}, {"model": "linear", "stiffness": 500.0}]
)
def test_births_and_deaths_leave_the_contacts_of_others_alone(law: dict[str, Any]) -> None:
    emitter = {
        "name": "tap",
        "shape": {"type": "point", "position": [0, 0.3, 0]},
        "rate": 60.0,
        "speed": 1.0,
        "direction": [0.1, -1, 0],
        "radius": {"type": "uniform", "low": 0.02, "high": 0.03},
        "density": 500,
        "lifetime": 0.7,
    }
    scenario = ps.from_table(
        table(
            1.2,
            5e-4,
            emitters=[emitter],
            forces=[{"type": "gravity", "acceleration": [0, -9.81, 0]}],
            planes=[{"restitution": 0.2, "friction": 0.4}],
            interactions=[{**HARD, "restitution": 0.3, "friction": 0.4, **law}],
            output={"every": 300},
        )
    )
    one, two = Simulation(scenario, threads=1), Simulation(scenario, threads=2)
    one.advance_to(1500)
    restore(two, snapshot(one))
    one.advance_to(2400)
    two.advance_to(2400)
    assert bits(one) == bits(two)
    state = one.states[0]
    assert 20 < state.count < 60
    assert np.isfinite(state.x[:, : state.count]).all()
    assert state.x[1, : state.count].min() > 0
    assert np.abs(state.v[:, : state.count]).max() < 8  # births in the midst of others store energy


def test_points_of_springs_touch_as_spheres() -> None:
    # Two dumbbells across their way meet with both ends at once: elastic, they swap their speeds, and no spring is strained.
    def dumbbell(x: float, v: float, name: str) -> dict[str, Any]:
        rope = {"type": "rope", "start": [x, 0, 0], "end": [x, 1, 0], "count": 2, "velocity": [v, 0, 0]}
        return {"name": name, "radius": 0.1, "mass": 2.0, "layout": rope, "springs": {"structural": 50.0}}

    final = simulate(
        1.0,
        1e-2,
        particles=[dumbbell(0, 1.0, "a"), dumbbell(1, -0.5, "b")],
        interactions=[{"type": "contact", "on": ["a", "b"], "surfaces": False, "restitution": 1.0}],
    ).final
    assert final.velocity == pytest.approx(rows(*[(-0.5, 0, 0)] * 2, *[(1, 0, 0)] * 2), abs=1e-12)
    assert final.position[1] - final.position[0] == pytest.approx([0, 1, 0], abs=1e-12)
    # 0.8 m apart at 1.5 m/s
    assert final.position[[0, 2], 0] == pytest.approx([8 / 15 - 0.5 * 7 / 15, 1 - 4 / 15 + 7 / 15], abs=1e-2)


@pytest.mark.parametrize("restitution", [0.5, 1.0])
@pytest.mark.parametrize("every", [1, 7, 160])
def test_grains_that_are_not_born_yet_touch_nobody(every: int, restitution: float) -> None:
    """A jet of grains that never touch: y = y₀ − v age. All that are born in an interval wait at its mouth; they had been
    put apart there, by up to 0.3 m, the more the fewer frames there were."""
    dt, steps, rate, speed = 1e-3, 160, 200.0, 3.0
    simulation = Simulation(
        ps.from_table(
            table(
                steps * dt,
                dt,
                emitters=[
                    {
                        "name": "jet",
                        "rate": rate,
                        "shape": {"type": "point", "position": [0, 0.9, 0]},
                        "speed": speed,
                        "direction": [0, -1, 0],
                        "radius": 0.004,
                        "density": 1000.0,
                    }
                ],
                interactions=[{"type": "contact", "restitution": restitution}],
            )
        )
    )
    for step in (*range(every, steps, every), steps):
        simulation.advance_to(step)
    state = simulation.states[0]
    x = np.sort(state.x[1, : state.count])
    ages = steps * dt - np.arange(state.count) / rate
    assert state.count == 32
    assert x == pytest.approx(0.9 - speed * ages, abs=1e-14 * steps)
    simulation.close()
