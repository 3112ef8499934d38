"""Cloth and ropes at colliders: what lies between particles stays out, rebounds and rubs as particles do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from physics.test_contacts import bits
from physics.test_surfaces import contacts_of, energy, rope, sheet
from simulate import table

import particlesim as ps
from particlesim.colliders.gaps import gaps_of
from particlesim.engine.diagnosis.slits import slits
from particlesim.engine.interactions.surfaces.patches import THINNER
from particlesim.engine.interactions.surfaces.record import CONTACTS, ZONED
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R = 0.006
TOUCH = {"type": "contact", "restitution": 0.0, "friction": 0.3}
SHAPES: dict[str, dict[str, Any]] = {
    "bar": {"type": "capsule", "start": [-0.6, 0, 0.03], "end": [0.6, 0.05, -0.02], "radius": 0.01},
    "corner": {"type": "box", "size": [0.3, 0.3, 0.3], "orientation": {"axis": [1, 0.2, 1], "angle": 50}},
    "tip": {"type": "cone", "start": [0.03, -0.4, 0.04], "end": [0.03, 0.05, 0.04], "radius": 0.1},
    "edge": {"type": "rectangle", "size": [0.4, 0.2], "orientation": {"axis": [1, 0.1, 0.2], "angle": 85}},
    "ring": {"type": "torus", "radius": 0.15, "tube": 0.012, "axis": [0.1, 0.2, 1.0]},
    "both": {
        "type": "union",
        "of": [
            {"type": "sphere", "center": [0.05, 0, 0], "radius": 0.04},
            {"type": "box", "center": [-0.1, 0, 0], "size": [0.1, 0.08, 0.02]},
        ],
    },
}


def thrown(shape: dict[str, Any], group: dict[str, Any], dt: float = 1e-3, **parts: Any) -> ps.Scenario:
    """A group above a collider at the origin, with contact of surfaces."""
    collider = {"name": "it", "restitution": 0.0, "friction": 0.3, **shape}
    precision = parts.pop("precision", "double")
    given = {"forces": [{"type": "gravity"}], "colliders": [collider], "interactions": [TOUCH], **parts}
    made = table(1.0, dt, particles=[group], **given)
    made["simulation"]["precision"] = precision
    return ps.from_table(made)


def cloth(speed: float, n: int = 6, y: float = 0.4) -> dict[str, Any]:
    return sheet("cloth", y, n, velocity=[0.0, -speed, 0.0])


def line(speed: float, count: int = 9) -> dict[str, Any]:
    made = rope("line", [-0.37, 0.3, -0.21], [0.41, 0.31, 0.35], count)
    made["layout"]["velocity"] = [0.0, -speed, 0.0]
    return made


def depth(simulation: Simulation, shape: Any) -> float:
    """How deep the group is in a shape at most, as a part of its radius, at many points between its particles."""
    (group,), (state,) = simulation.scenario.particles, simulation.states
    x, points = state.position.astype(float), []
    corners = group.layout.triangles()
    if not len(corners):
        corners = group.layout.edges("structural")
    steps = np.arange(16) / 15
    for u in steps:
        for v in steps if corners.shape[1] == 3 else (0.0,):
            if u + v <= 1:
                weights = (1 - u - v, u, v)[: corners.shape[1]]
                points.append(sum(w * x[corners[:, k]] for k, w in enumerate(weights)))
    p = np.ascontiguousarray(np.concatenate(points).T)
    out = np.empty(p.shape[1])
    gaps_of(shape, p[0], p[1], p[2], np.full(out.size, R), simulation.time, out)
    return float(-out.min() / R)


@pytest.mark.sampled(36)
@pytest.mark.parametrize(
    ("shape", "what", "speed"),
    [
        (shape, what, speed)
        if (what == "line" and speed != 5.0) or (shape in ("corner", "ring") and speed == 200.0)
        else pytest.param(shape, what, speed, marks=pytest.mark.slow)
        for shape in SHAPES
        for what in ("cloth", "line")
        for speed in (0.0, 5.0, 200.0)
    ],
)
def test_nothing_gets_between_particles(shape: str, what: str, speed: float) -> None:
    # at 200 m/s a step of 1 ms is 33 radii long
    scenario = thrown(SHAPES[shape], cloth(speed) if what == "cloth" else line(speed))
    simulation, worst, touched = Simulation(scenario, threads=1), 0.0, 0
    for step in range(3, 301, 3) if speed <= 5 else range(1, 41):
        simulation.advance_to(step)
        worst = max(worst, depth(simulation, scenario.colliders[0].body()))
        touched += int(contacts_of(simulation).report[CONTACTS])
    simulation.close()
    assert touched > 0
    assert worst < 1.0  # the middle stays outside
    if speed == 0.0:
        assert worst < 1 - THINNER + (0.3 if shape in ("ring", "both") else 0.05)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("motion", ["path", "turn"])
def test_nothing_gets_between_particles_of_what_a_collider_meets(motion: str) -> None:
    moves = {"path": {"path": ["x", "y + 8*t", "z"]}, "turn": {"spin": {"axis": [0, 0, 1], "rate": 25.0}}}
    bar = {"type": "capsule", "start": [0, -0.1, 0.5], "end": [0, -0.1, -0.5], "radius": 0.01}
    if motion == "turn":
        bar = {"type": "box", "size": [0.9, 0.02, 0.3]}
    scenario = thrown(bar, cloth(0.0, 6), motions=[{"collider": "it", **moves[motion]}], forces=[])
    if motion == "turn":
        scenario = thrown(bar, cloth(2.0, 6), motions=[{"collider": "it", **moves[motion]}])
    simulation, worst = Simulation(scenario, threads=1), 0.0
    for step in range(1, 201):
        simulation.advance_to(step)
        worst = max(worst, depth(simulation, scenario.colliders[0].body()))
    v = simulation.states[0].velocity
    simulation.close()
    assert worst < 1.0  # the middle stays outside
    if motion == "path":
        assert v[:, 1].mean() > 1.0  # it is taken along


def stick(w: float, speed: float, along: float = 0.0) -> dict[str, Any]:
    """Two particles of 0.05 kg a metre apart on a soft spring, over the z axis, which divides them as w to 1 − w."""
    made = rope("stick", [-w, 0.03, 0], [1 - w, 0.03, 0], 2)
    made["layout"]["velocity"] = [along, -speed, 0.0]
    return {**made, "springs": {"structural": 1e-6}}


BAR = {"type": "capsule", "start": [0, 0, -0.5], "end": [0, 0, 0.5], "radius": 0.01}


@pytest.mark.parametrize("w", [0.5, 0.3, 0.1])
@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_an_edge_rebounds_by_the_closed_form(e: float, w: float) -> None:
    """n·x of the point x = Σ w_k x_k that touches is reversed: Δv_k = (1 + e) v w_k/Σ w²."""
    scenario = thrown({**BAR, "restitution": e, "friction": 0.0}, stick(w, 1.0), forces=[])
    simulation = Simulation(scenario, threads=1)
    simulation.advance_to(16)  # it falls 15.5 mm at 1 mm a step, until its thickness meets the bar
    v = simulation.states[0].velocity
    simulation.close()
    parts = np.array([1 - w, w])
    assert v[:, 1] == pytest.approx(-1.0 + (1 + e) * parts / (parts**2).sum(), abs=1e-9)
    assert np.abs(v[:, [0, 2]]).max() < 1e-9


def test_restitution_falls_with_the_speed_of_an_edge() -> None:
    falling = {"value": 0.8, "speed": 0.5, "exponent": 0.25}
    scenario = thrown({**BAR, "restitution": falling, "friction": 0.0}, stick(0.5, 2.0), forces=[])
    simulation = Simulation(scenario, threads=1)
    simulation.advance_to(15)
    v = simulation.states[0].velocity
    simulation.close()
    assert v[:, 1] == pytest.approx(2.0 * 0.8 * 4**-0.25, abs=1e-9)


@pytest.mark.parametrize("speed", [0.4, 8.0])
def test_restitution_falls_with_the_speed_of_sheets(speed: float) -> None:
    one, two = rope("one", [-0.5, 0.2, 0], [0.5, 0.2, 0], 2), rope("two", [0, 0, -0.5], [0, 0, 0.5], 2)
    one["layout"]["velocity"] = [0, -speed, 0]
    for each in (one, two):
        each["springs"] = {"structural": 1e-6}
    law = {**TOUCH, "restitution": {"value": 0.8, "speed": 0.5}, "friction": 0.0}
    simulation = Simulation(
        ps.from_table(table(1.0, 1e-3, particles=[one, two], interactions=[law])), threads=1
    )
    simulation.advance_to(int(0.25 / speed * 1000))
    u, v = (state.velocity[:, 1].mean() for state in simulation.states)
    simulation.close()
    assert (u - v) / speed == pytest.approx(0.8 * max(speed / 0.5, 1) ** -0.25, rel=1e-6)


@pytest.mark.parametrize("rubs", ["friction", "tangential_loss"])
def test_an_edge_rubs_by_the_closed_form(rubs: str) -> None:
    """Sliding at 1 m/s an impact at v takes μ (1 + e) v of that, or the part that is lost."""
    collider = {**BAR, "restitution": 0.5, "friction": 0.0, rubs: 0.2}
    simulation = Simulation(thrown(collider, stick(0.5, 1.0, along=1.0), forces=[]), threads=1)
    simulation.advance_to(30)
    v = simulation.states[0].velocity
    simulation.close()
    # the spot that touches has moved by 14 mm from the middle of a metre until then
    assert v.mean(axis=0)[1] == pytest.approx(0.5, abs=2e-3)
    left = 1.0 - 0.2 * 1.5 if rubs == "friction" else 0.8
    assert v[:, 0].mean() == pytest.approx(left, abs=2e-3)


def test_a_belt_takes_an_edge_along() -> None:
    collider = {**BAR, "friction": 0.5, "surface_velocity": [0.3, 0, 0]}
    simulation = Simulation(thrown(collider, stick(0.5, 0.0)), threads=1)
    simulation.advance_to(150)
    v = simulation.states[0].velocity.mean(axis=0)
    simulation.close()
    assert v[0] == pytest.approx(0.3, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_cloth_comes_to_rest_on_a_table_and_gains_nothing(precision: str) -> None:
    table_top = {"type": "box", "center": [0, -0.25, 0], "size": [0.37, 0.5, 0.29], "friction": 0.6}
    made = {**cloth(0.0, 10, 0.02), "springs": {"structural": 60.0, "shear": 20.0, "damping_ratio": 0.8}}
    scenario = thrown(
        table_top, made, dt=5e-4, forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": 0.02}]
    )
    simulation, highest = Simulation(scenario, threads=1), np.inf
    for step in range(0, 6001, 200):
        simulation.advance_to(step)
        assert energy(simulation) < highest + (1e-9 if precision == "double" else 1e-5)
        highest = min(highest, energy(simulation))
        assert depth(simulation, scenario.colliders[0].body()) < 1 - THINNER + 0.05
    v = simulation.states[0].velocity
    simulation.close()
    assert np.sqrt((v**2).mean()) < 0.02


def test_the_same_bits_with_any_threads_and_after_a_resume_at_colliders(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = thrown(SHAPES["corner"], cloth(3.0, 12), output={"every": 50})
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    for each in (one, two):
        for step in (50, 100):
            each.advance_to(step)
    assert contacts_of(one).report[CONTACTS] > 0
    assert bits(one) == bits(two)
    restore(other, snapshot(one))
    for each in (one, two, other):
        for step in (150, 200):
            each.advance_to(step)
        each.close()
    assert bits(one) == bits(two) == bits(other)


@pytest.mark.slow
def test_what_nothing_keeps_apart_goes_with_the_collider() -> None:
    # between a table and a press there is no place for the cloth
    press = {"type": "box", "center": [0.03, 0.24, 0.02], "size": [0.2, 0.4, 0.2]}
    top = {"type": "box", "name": "table", "center": [0, -0.5, 0], "size": [3, 1, 3]}
    motions = [{"collider": "it", "path": ["x", "y - 0.5*t", "z"]}]
    colliders = [{"name": "it", **press}, top]
    scenario = thrown(press, cloth(0.0, 6, 0.02), motions=motions, colliders=colliders)
    simulation = Simulation(scenario, threads=1)
    simulation.advance_to(150)
    x = simulation.states[0].position
    simulation.close()
    assert np.isfinite(x).all()
    assert x[:, 1].min() > -0.01


def test_a_start_close_to_a_bar_slides_off_it() -> None:
    # 0.2 mm above it, nearer than the contact keeps: it was held there for good
    made = rope("rope", [-0.42, 0.0302, 0], [0.78, 0.0302, 0], 14)
    bar = {"type": "capsule", "start": [0, 0, -0.5], "end": [0, 0, 0.5], "radius": 0.03, "friction": 0.0}
    simulation = Simulation(thrown(bar, made), threads=1)
    simulation.advance_to(1000)
    y = simulation.states[0].position[:, 1]
    simulation.close()
    assert y.max() < 0


def test_a_rope_hangs_by_static_friction_without_creep() -> None:
    """It holds up to a ratio e^(μ π) of the lengths at both sides, 23 with μ = 1; these are as 1.2 to 1."""
    made = {**rope("rope", [-0.45, 0.037, 0], [0.55, 0.037, 0], 31), "mass": 0.1}
    made["springs"] = {"structural": 500.0, "damping_ratio": 0.3}
    bar = {"type": "capsule", "start": [0, 0, -0.5], "end": [0, 0, 0.5], "radius": 0.03, "friction": 1.0}
    forces = [{"type": "gravity"}, {"type": "linear_drag", "coefficient": 0.03}]
    simulation = Simulation(thrown(bar, made, dt=5e-4, forces=forces), threads=1)
    simulation.advance_to(6000)
    then = simulation.states[0].position.copy()
    simulation.advance_to(8000)
    moved = np.abs(simulation.states[0].position - then).max()
    simulation.close()
    assert moved < 1e-4  # 5 to 7 mm a second, where friction was that of each turn by itself


def test_an_edge_rests_on_a_flat_side() -> None:
    box = {"type": "box", "size": [0.3, 0.3, 0.3], "friction": 0.5}
    simulation = Simulation(thrown(box, {**rope("stick", [-0.25, 0.16, 0], [0.25, 0.16, 0], 2)}), threads=1)
    simulation.advance_to(1000)
    v = simulation.states[0].velocity
    simulation.close()
    assert np.abs(v).max() < 1e-3  # a tenth of g dt; with one contact for both ends it was half of it


def test_what_comes_between_particles_is_told() -> None:
    def told(group: dict[str, Any], shape: dict[str, Any], *laws: Any) -> list[str]:
        collider = {"name": "it", **shape}
        return list(
            slits(
                Simulation(
                    ps.from_table(
                        table(1.0, 1e-3, particles=[group], colliders=[collider], interactions=list(laws))
                    )
                )
            )
        )

    ball = {"type": "sphere", "radius": 0.3, "center": [0, -1, 0]}
    assert not told(sheet("low"), ball, TOUCH)
    (text,) = told(sheet("low"), ball)
    # edges of 1/6 m: √(0.3² + 1/72) − 0.3 − 0.006
    assert "may reach into sphere it by up to 0.016 m" in text
    assert "contact" in text
    box = {"type": "box", "size": [0.1, 0.1, 0.1], "center": [0, -1, 0]}
    (text,) = told(sheet("low"), box)
    assert "only the particles of 'low' touch box it" in text
    assert not told(sheet("low"), {**box, "inside": True, "size": [9, 9, 9]})
    assert not told(sheet("low"), {**box, "contact": "kill"})
    for yields in ({"contact": "stick"}, {"contact": "penalty", "stiffness": 1e3}):
        (text,) = told(sheet("low"), {**box, **yields}, TOUCH)
        assert "only the particles of 'low' touch box it" in text
    (text,) = told(sheet("low"), {**box, "center": [0.03, 0, 0.02]}, TOUCH)
    assert "'low' goes through box it at the start, between its particles, the first time near (" in text


def test_bodies_that_come_between_particles_are_told() -> None:
    def told(shape: dict[str, Any], made: dict[str, Any]) -> list[str]:
        bodies = [{"name": "dice", "shape": shape, "density": 500, "position": [0, 1, 0]}]
        tables = table(1.0, 1e-3, particles=[made], bodies=bodies, interactions=[TOUCH])
        return list(slits(Simulation(ps.from_table(tables))))

    (text,) = told({"type": "box", "size": [0.1, 0.1, 0.1]}, sheet("low"))
    assert "only the particles of 'low' touch the bodies 'dice'" in text
    # edges of 1/6 m: √(R² + 1/72) − R is 0.006 m for R = 1.15 m
    assert len(told({"type": "sphere", "radius": 1.1}, sheet("low"))) == 1
    assert not told({"type": "sphere", "radius": 1.2}, sheet("low"))


def test_zones_are_the_exception(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.interactions.surfaces.surface_contacts.LOOKS", 1)
    scenario = thrown(SHAPES["corner"], cloth(150.0))
    simulation, worst = Simulation(scenario, threads=1), 0.0
    for step in range(1, 30):
        simulation.advance_to(step)
        worst = max(worst, depth(simulation, scenario.colliders[0].body()))
    zoned = contacts_of(simulation).report[ZONED]
    simulation.close()
    assert zoned > 0
    assert worst < 1.0  # the middle stays outside
