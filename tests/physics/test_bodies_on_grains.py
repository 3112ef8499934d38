"""Rigid bodies on hard grains on colliders: all of these take part in what a body rests on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from physics.test_contacts import bits
from simulate import G, simulate, table, way

import particlesim as ps
from particlesim.engine.islands import meetings
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

H, R = 1e-3, 0.01
HALF = 0.05
"""Half of the height of the box."""


def sand(*position: tuple[float, float, float], **other: Any) -> dict[str, Any]:
    layout = {"type": "points", "position": [list(x) for x in position]}
    return {"name": "sand", "radius": R, "density": 2600.0, "layout": layout, **other}


def nine(y: float = R) -> list[tuple[float, float, float]]:
    return [(x, y, z) for x in (-0.06, 0.0, 0.06) for z in (-0.06, 0.0, 0.06)]


def box(y: float, **other: Any) -> dict[str, Any]:
    shape = {"type": "box", "size": [0.2, 2 * HALF, 0.2]}
    return {"name": "box", "shape": shape, "density": 500.0, "position": [0, y, 0], **other}


def scene(e: float = 0.0, friction: float = 0.5, **other: Any) -> dict[str, Any]:
    law = {"restitution": e, "friction": friction}
    return {
        "particles": [sand(*nine())],
        "bodies": [box(2 * R + HALF, **law)],
        "planes": [law],
        "interactions": [{"type": "contact", "on": ["sand", "box"], "model": "impulse", **law}],
        "forces": [{"type": "gravity"}],
        **other,
    }


@pytest.mark.sampled(18)
@pytest.mark.parametrize("h", [2.5e-4, H, 5e-3])
@pytest.mark.parametrize("density", [50.0, 500.0, 20e3])
@pytest.mark.parametrize("e", [0.0, 0.6])
def test_a_box_on_grains_on_a_floor_rests(e: float, density: float, h: float) -> None:
    # The heaviest has 8 000 times the mass of a grain. Along the floor it is free to roll, with what sweeps leave of g h.
    given = scene(e, bodies=[box(2 * R + HALF, density=density, restitution=e)])
    places, speeds = way(1000, 1000 * h, h, "velocity_verlet", **given)
    assert np.abs(places[-1] - places[0])[:, 1].max() < 1e-9
    assert np.abs(places[-1] - places[0]).max() < 1000 * h * 1e-6 * G * h
    assert np.abs(speeds[-1]).max() < 1e-6 * G * h


@pytest.mark.slow
@pytest.mark.parametrize("name", ["symplectic_euler", "stormer_verlet", "rk4"])
def test_it_rests_with_any_method(name: str) -> None:
    places, speeds = way(1000, 1.0, H, name, **scene())
    assert np.abs(places[-1] - places[0]).max() < 1e-8
    assert np.abs(speeds[-1]).max() < 1e-8


@pytest.mark.slow
def test_grains_that_do_not_touch_each_other_carry_a_box() -> None:
    between = {"type": "contact", "between": ["sand", "box"], "model": "impulse"}
    places, _ = way(1000, 1.0, H, "velocity_verlet", **scene(interactions=[between]))
    assert np.abs(places[-1] - places[0]).max() < 1e-9


def slit(layers: int, name: Any = lambda row: "sand") -> dict[str, Any]:
    """Columns of grains that just fit between walls, a group for each name, and a box on them."""
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for row in range(layers):
        rows.setdefault(name(row), []).extend((x, (2 * row + 1) * R, 0.0) for x in (-2 * R, 0.0, 2 * R))
    walls = [
        {"point": [-3 * R * x, 0, -R * z], "normal": [x, 0, z], "on": list(rows)}
        for x, z in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    shape = {"type": "box", "size": [6 * R, 2 * HALF, 6 * R]}
    return {
        "particles": [sand(*places, name=each) for each, places in rows.items()],
        "planes": [{}, *walls],
        "bodies": [box(2 * R * layers + HALF, shape=shape)],
    }


@pytest.mark.sampled(2)
@pytest.mark.parametrize("layers", [2, 6])
def test_a_box_on_columns_of_grains_rests(layers: int) -> None:
    places, speeds = way(500, 0.5, H, "velocity_verlet", **scene(**slit(layers)))
    assert np.abs(places[-1] - places[0]).max() < 1e-7
    assert np.abs(speeds[-1]).max() < 1e-7


@pytest.mark.slow
def test_grains_of_groups_that_touch_no_body_carry_one() -> None:
    # The box touches the upper ones alone.
    given = slit(2, lambda row: ("lower", "upper")[row])
    contacts = [
        {"type": "contact", "between": ["box", "upper"], "model": "impulse"},
        {"type": "contact", "on": ["upper", "lower"], "model": "impulse"},
    ]
    places, _ = way(300, 0.3, H, "velocity_verlet", **scene(interactions=contacts, **given))
    assert np.abs(places[-1] - places[0]).max() < 1e-8


def test_a_box_rolls_down_a_slope_on_balls() -> None:
    # Balls between slope and box roll on both, so their centres go half as fast, V/2, and turn with V/(2r):
    # V' = g sin θ (M + n m/2)/(M + n m (1 + 2/5)/4).
    tilt, n = 0.1, 9
    pull = {"type": "gravity", "acceleration": [float(G * np.sin(tilt)), float(-G * np.cos(tilt)), 0.0]}
    given = scene(friction=1.0, forces=[pull])
    m, mass = 2600.0 * 4 / 3 * np.pi * R**3, 500.0 * 0.2 * 0.2 * 2 * HALF
    a = G * np.sin(tilt) * (mass + n * m / 2) / (mass + 0.35 * n * m)
    _, speeds = way(100, 0.1, H, "velocity_verlet", **given)
    assert speeds[-1, -1, 0] == pytest.approx(0.1 * a, rel=1e-3)
    assert speeds[-1, :-1, 0] == pytest.approx(np.full(n, 0.05 * a), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.3, 2.0])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_what_falls_on_grains_comes_to_rest_on_them_and_gains_nothing(e: float, speed: float) -> None:
    given = scene(e, bodies=[box(2 * R + HALF + 0.01, density=3e3, velocity=[0, -speed, 0], restitution=e)])
    result = simulate(0.5, H, output={"every": 1, "ledger": True}, **given)
    found = sum(np.array(result.ledger[name]) for name in ("kinetic", "potential.gravity"))
    assert np.diff(found).max() < 1e-5 * found[0]
    assert result.missed_crossings == 0
    assert np.array(result.final["position"])[:, 1] == pytest.approx([*9 * [R], 2 * R + HALF], abs=2e-5)
    speeds = np.abs(result.final["velocity"])
    assert speeds[:, 1].max() < 1e-6
    assert speeds.max() < 0.01  # along the floor it rolls on, with what is left of 2 m/s


@pytest.mark.parametrize("h", [H, 4e-3])
@pytest.mark.parametrize("e", [1.0, 0.5])
def test_a_plank_rebounds_from_grains_on_a_floor_as_from_the_floor(e: float, h: float) -> None:
    # It comes half a radius in the longer step. Its height is known to second order in g h/v.
    given = scene(e, bodies=[box(2 * R + HALF + 0.1, restitution=e)], friction=0.0)
    places, _ = way(1, 0.4, h, "velocity_verlet", **given)
    rises = np.diff(places[:, -1, 1]) > 0
    apex = (places[1:, -1, 1][rises] - (2 * R + HALF)).max()
    v = np.sqrt(2 * G * 0.1)
    assert apex == pytest.approx(0.1 * e * e, rel=4 * (G * h / v) ** 2 + 1e-5)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("density", [1e3, 2e4])
def test_a_box_that_comes_down_on_an_edge_gains_nothing(density: float) -> None:
    turned = {"axis": [1, 0, 1], "angle": 20}
    given = scene(0.0, bodies=[box(0.12, density=density, orientation=turned)])
    result = simulate(0.4, H, output={"every": 1, "ledger": True}, **given)
    found = sum(np.array(result.ledger[name]) for name in ("kinetic", "potential.gravity"))
    assert np.diff(found).max() < 1e-5 * found[0]
    assert result.missed_crossings == 0


@pytest.mark.slow
def test_grains_may_die_below_a_box() -> None:
    # All of a group die in one step, in which it lies on them.
    trap = {
        "name": "trap",
        "type": "box",
        "center": [0, 0, 0],
        "size": [0.4, 0.02, 0.4],
        "contact": "kill",
        "on": ["sand"],
    }
    result = simulate(0.1, H, **scene(planes=[], colliders=[trap]))
    assert len(result.final["position"]) == 1


def test_grains_that_stick_to_the_floor_carry_a_box() -> None:
    # They stick in the first step, in which the box falls by g h²/2.
    between = {"type": "contact", "between": ["sand", "box"], "model": "impulse"}
    mud = {"contact": "stick", "on": ["sand"]}
    places, speeds = way(300, 0.3, H, "velocity_verlet", **scene(planes=[mud], interactions=[between]))
    assert np.abs(places[-1] - places[0]).max() < 1e-6
    assert np.abs(speeds[-1]).max() < 1e-6


@pytest.mark.slow
def test_a_floor_that_moves_takes_grains_and_what_lies_on_them_along() -> None:
    floor = {"name": "floor", "type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0], "restitution": 0.0}
    lift = {"collider": "floor", "path": ["0", "0.1*t", "0"]}
    given = scene(planes=[], colliders=[floor], motions=[lift])
    places, _ = way(500, 0.5, H, "velocity_verlet", **given)
    assert (places[-1] - places[0])[:, 1] == pytest.approx(np.full(10, 0.05), abs=1e-5)


def heap(n: int = 6, layers: int = 3) -> dict[str, Any]:
    """Grains in a bin, and a box that falls on them."""
    side = n * 2.05 * R
    lattice = {
        "type": "lattice",
        "spacing": 2.05 * R,
        "counts": [n, layers, n],
        "origin": [1.025 * R - side / 2, 1.001 * R, 1.025 * R - side / 2],
    }
    law = {"restitution": 0.2, "friction": 0.5}
    return {
        "particles": [
            {"name": "sand", "radius": R, "density": 2600.0, "layout": {**lattice, "jitter": 2e-4}}
        ],
        "bodies": [
            {
                "name": "box",
                "shape": {"type": "box", "size": [5 * R, 4 * R, 5 * R]},
                "density": 4e3,
                "position": [0.1 * R, 2.1 * layers * R + 2.5 * R, 0],
                "orientation": {"axis": [0, 0, 1], "angle": 20},
                **law,
            }
        ],
        "colliders": [
            {
                "name": "bin",
                "type": "box",
                "size": [side, 1.0, side],
                "center": [0, 0.5, 0],
                "inside": True,
                **law,
            }
        ],
        "interactions": [{"type": "contact", "on": ["sand", "box"], "model": "impulse", **law}],
        "forces": [{"type": "gravity"}],
    }


def deepest(final: Any, n: int) -> float:
    """How deep spheres are in the box, in radii, whose frame is that of the last row."""
    x, half = np.array(final["position"]), np.array([2.5 * R, 2 * R, 2.5 * R])
    w, *v = np.array(final["orientation"])[-1]
    away = x[:n] - x[n]
    own = away - 2 * w * np.cross(v, away) + 2 * np.cross(v, np.cross(v, away))
    beyond = np.abs(own) - half
    out = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    return float((1 - out / R).max())


@pytest.mark.slow
def test_no_box_sinks_into_a_heap_of_grains() -> None:
    result = simulate(0.5, H, **heap())
    assert result.missed_crossings == 0
    assert deepest(result.final, 108) < 0.05


@pytest.mark.slow
def test_a_heap_larger_than_what_is_looked_at_carries_a_box(monkeypatch: Any) -> None:
    monkeypatch.setattr(meetings, "ENOUGH", 40)
    result = simulate(0.3, H, **heap())
    assert result.missed_crossings == 0
    assert deepest(result.final, 108) < 0.2


def test_what_was_lain_on_is_forgotten_once_nothing_touches() -> None:
    # The box is thrown up, and no contact is left, while the grains are still near: a run that is resumed there knows
    # nothing of the last step either.
    throw = {"on": ["box"], "impulse": [0, 1.0, 0], "at": 0.05}
    scenario = ps.from_table(table(0.1, H, **scene(impulses=[throw])))
    whole, again = Simulation(scenario), Simulation(scenario)
    whole.advance_to(54)
    restore(again, snapshot(whole))
    again.step = 54
    for simulation in (whole, again):
        simulation.advance_to(70)
    assert bits(whole) == bits(again)
    sand = whole.states[0]
    assert np.abs(sand.v[:, : sand.count]).max() < 1e-12


@pytest.mark.slow
def test_the_same_bits_after_a_stop_and_for_any_number_of_threads(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(table(0.2, H, **heap()))
    one, two = Simulation(scenario, threads=1), Simulation(scenario, threads=2)
    for step in (120, 200):
        one.advance_to(step)
        two.advance_to(step)
        if step == 120:
            again = Simulation(scenario)
            restore(again, snapshot(one))
            again.advance_to(200)
    assert bits(one) == bits(two) == bits(again)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param("symplectic_euler", marks=pytest.mark.slow), "velocity_verlet"]
)
def test_a_heap_under_a_box_finds_its_rest(name: str) -> None:
    """Bodies' impulses and those of grains see the same gaps, and the same places at the end of a step: where they did not,
    the heap crept by half a millimetre in half a second, with velocities of next to nothing."""
    law = {"restitution": 0.5, "friction": 0.4}
    start = {"type": "lattice", "origin": [-0.033, 0.0105, -0.033], "counts": [4, 3, 4], "spacing": 0.021}
    tilted = {"orientation": {"axis": [0, 0, 1], "angle": 20}, "restitution": 0.3, "friction": 0.4}
    shape = {"type": "box", "size": [0.06, 0.05, 0.06]}
    walls = {"type": "box", "inside": True, "center": [0, 1, 0], "size": [0.09, 2, 0.09]}
    given = scene(
        particles=[{"name": "sand", "radius": R, "density": 2000.0, "layout": {**start, "jitter": 3e-4}}],
        bodies=[{"name": "box", "shape": shape, "density": 2000.0, "position": [0.004, 0.12, 0], **tilted}],
        interactions=[{"type": "contact", "model": "impulse", "rolling_friction": 0.2, **law}],
        colliders=[{"name": "room", **walls, **law}],
        planes=[],
    )
    run = Simulation(ps.from_table(table(2.0, H, name, **given)))
    grains, body = run.states
    run.advance_to(1500)
    before, was = grains.x[:, :48].copy(), body.x[:, 0].copy()
    run.advance_to(2000)
    assert np.median(np.linalg.norm(grains.x[:, :48] - before, axis=0)) < 5e-5
    assert np.linalg.norm(body.x[:, 0] - was) < 1e-4
