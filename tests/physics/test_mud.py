"""Particles that stick to colliders which move keep their place in the frame of theirs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

RATE, SPEED = 3.0, 0.5
WHEEL = {"type": "sphere", "radius": 1, "name": "wheel", "contact": "stick"}
ROLLS = {"collider": "wheel", "path": [f"x + {SPEED}*t", "y", "z"], "spin": {"axis": [0, 0, 1], "rate": RATE}}
GLUE = {"type": "box", "size": [1, 1, 1], "center": [0, -4, 0], "contact": "stick"}
SHOTS = points(
    (3.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, -2.5, 0.0), (0.2, 0.3, 9.0),
    velocity=((-2.0, 0.0, 0.0), (SPEED, -2.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 0.0)),
    name="mud", radius=0.0,
)  # fmt: skip
PARTS: dict[str, Any] = {"particles": [SHOTS], "colliders": [WHEEL, GLUE], "motions": [ROLLS]}


def led(begun: tuple[float, float], since: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a place (x, y) from the axis is taken from a time to another one, and its velocity."""
    angle = RATE * (until - since)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    arm = turn @ begun
    return np.add(arm, [SPEED * until, 0]), RATE * np.array([-arm[1], arm[0]]) + [SPEED, 0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["velocity_verlet", "rk45"])
def test_mud_goes_along_with_a_wheel(method: str) -> None:
    # The first is met at 3 − 2 t = 1 + t/2, t = 0.8 s, at the angle 0; the second at 2 − 2 t = 1, t = 0.5 s, at 90°.
    # Both then keep their places on the wheel: 5 m/s by angles of 6 rad, to rounding. The third sticks to a box at rest.
    end = 2.0
    found = simulate(end, 0.01, method, **PARTS).final
    for row, (arm, since) in enumerate((((1.0, 0.0), 0.8), ((0.0, 1.0), 0.5))):
        place, speed = led(arm, since, end)
        assert found.position[row, :2] == pytest.approx(place, abs=1e-8)
        assert found.velocity[row, :2] == pytest.approx(speed, abs=1e-8)
    assert found.position[2] == pytest.approx([0, -3.5, 0], abs=1e-12)
    assert (found.velocity[2] == 0).all()
    assert found.position[3].tolist() == [0.2, 0.3, 9.0]


def crowd(**more: Any) -> ps.Scenario:
    rng = np.random.default_rng(4)
    start = rng.normal(0, 1, (400, 3))
    start *= (1.5 + rng.uniform(0, 1, (400, 1))) / np.linalg.norm(start, axis=1)[:, None]
    swarm = points(*map(tuple, start), velocity=tuple(map(tuple, -start)), name="mud", radius=0.01)
    return ps.from_table(
        table(2.0, 0.01, **{**PARTS, "particles": [swarm], "forces": [{"type": "gravity"}]} | more)
    )


def ended(scenario: ps.Scenario, *, threads: int = 1, every: int = 200, block: int | None = None) -> bytes:
    simulation = Simulation(scenario, threads=threads, block=block)
    for step in range(every, 201, every):
        simulation.advance_to(step)
    state = simulation.states[0]
    simulation.close()
    assert state.stuck().sum() > 100
    return state.x.tobytes() + state.v.tobytes()


@pytest.mark.slow
def test_same_bits_however_it_is_cut() -> None:
    scenario = crowd()
    whole = ended(scenario)
    assert ended(scenario, threads=2, block=32) == whole
    assert ended(scenario, every=1) == whole
    simulation = Simulation(scenario, threads=1)
    simulation.advance_to(77)
    saved = snapshot(simulation)
    simulation.close()
    other = Simulation(scenario, threads=1)
    restore(other, saved)
    other.advance_to(200)
    assert other.states[0].x.tobytes() + other.states[0].v.tobytes() == whole
    other.close()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["velocity_verlet", "rk45"])
def test_the_wheel_pays_for_what_it_lifts(method: str) -> None:
    # What it holds has the energy of its place and speed, all of which contact gives: 400 kg by 1 m and 3 m/s.
    options = {"duration": 2.0, "dt": 0.01, "integrator": method}
    run = ps.run(crowd(simulation=options, output={"ledger": True, "work": True, "every": 20}))
    assert np.abs(run.ledger["work.contact"]).max() > 100
    assert np.abs(run.ledger["balance"]).max() < 1e4 * EPS * np.abs(run.ledger["kinetic"]).max() * 200


def test_mud_that_dies_leaves_nothing_behind() -> None:
    # One is born every 0.1 s and hits the wheel 0.4 s later, which has taken it 0.2 s and 0.6 rad further when it dies.
    hose = {
        "name": "hose",
        "rate": 10,
        "shape": {"type": "point", "position": [0, 3, 0]},
        "direction": [0, -1, 0],
        "speed": 5,
        "lifetime": 0.6,
    }
    turns = {"collider": "wheel", "spin": {"axis": [0, 0, 1], "rate": RATE}}
    found = simulate(5.0, 0.01, emitters=[hose], colliders=[WHEEL], motions=[turns]).final
    age = 5.0 - np.arange(50)[-len(found.position) :] / 10
    held = age > 0.4
    assert held.sum() == 2
    angle = np.pi / 2 + RATE * (age - 0.4)
    place = np.where(held, [np.cos(angle), np.sin(angle)], [0 * age, 3 - 5 * age]).T
    assert found.position[:, :2] == pytest.approx(place, abs=1e-7)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"interactions": [{"type": "contact", "model": "impulse"}]}, "act on others"),
        ({"springs": [{"on": "mud", "pairs": [[0, 1]], "stiffness": 1.0}]}, "act on others"),
    ],
)
def test_what_moves_holds_on_to_single_particles_alone(more: dict[str, Any], why: str) -> None:
    parts = {**PARTS, "particles": [{**SHOTS, "radius": 0.01}]}
    with pytest.raises(ps.ScenarioError, match=why):
        ps.from_table(table(1.0, 0.01, **parts, **more))
    free = {**WHEEL, "on": ["dust"]}
    dust = points((5.0, 0.0, 0.0), name="dust")
    more = {key: [{"on": ["mud"], **each} for each in listed] for key, listed in more.items()}
    parts = {**parts, "colliders": [free], "particles": [*parts["particles"], dust]}
    ps.from_table(table(1.0, 0.01, **parts, **more))
