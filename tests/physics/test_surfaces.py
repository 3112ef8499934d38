"""Cloth, strands and grains that touch: nothing passes through, momentum stays, energy never grows, and the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from physics.test_contacts import bits
from simulate import EPS, points, table

import particlesim as ps
from particlesim.compiler import kernel
from particlesim.engine.interactions.interaction import lone
from particlesim.engine.interactions.surfaces import surface_contacts
from particlesim.engine.interactions.surfaces.candidates import find
from particlesim.engine.interactions.surfaces.record import BUILDS, CONTACTS, STALE
from particlesim.engine.interactions.surfaces.response import list_contacts, weigh
from particlesim.engine.interactions.surfaces.surface_contacts import SurfaceContacts
from particlesim.engine.shadow import swing
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.stability.limits import stability
from particlesim.runs.first_state import knotted

THIN = 0.012
TOUCH = {"type": "contact", "restitution": 0.0, "friction": 0.3}


def sheet(name: str, y: float = 0.0, n: int = 7, **layout: Any) -> dict[str, Any]:
    """A level square of cloth, a metre wide."""
    place = {"origin": [-0.5, y, 0.5], "size": [1.0, 1.0], "resolution": [n, n], "up": [0, 0, -1]}
    return {
        "name": name,
        "mass": 0.2,
        "radius": THIN / 2,
        "layout": {"type": "cloth", **place, **layout},
        "springs": {"structural": 100.0, "shear": 30.0, "damping_ratio": 0.1},
    }


def rope(name: str, start: Any, end: Any, count: int = 9) -> dict[str, Any]:
    layout = {"type": "rope", "start": start, "end": end, "count": count}
    return {
        "name": name,
        "mass": 0.1,
        "radius": THIN / 2,
        "layout": layout,
        "springs": {"structural": 50.0},
    }


def features(simulation: Simulation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, triangles and edges of all groups."""
    triangles, edges, first = [], [], 0
    for group, state in zip(simulation.scenario.particles, simulation.states, strict=True):
        found = group.layout.triangles()
        if len(found):
            triangles.append(found + first)
            edges += [found[:, [k, (k + 1) % 3]] + first for k in range(3)]
        elif group.layout.kinds:
            edges.append(group.layout.edges("structural") + first)
        first += state.count
    x = np.concatenate([state.position for state in simulation.states])
    return x, np.concatenate(triangles), np.unique(np.sort(np.concatenate(edges), axis=1), axis=0)


def crossings(x: np.ndarray, triangles: np.ndarray, edges: np.ndarray) -> int:
    """How many edges go through triangles of which they hold no corner, each with each."""
    a, b, c = (x[triangles[:, k]][None] for k in range(3))
    p, q = (x[edges[:, k]][:, None] for k in range(2))
    normal = np.cross(b - a, c - a)
    above, below = ((p - a) * normal).sum(axis=2), ((q - a) * normal).sum(axis=2)
    strange = ~(edges[:, None, :, None] == triangles[None, :, None, :]).any(axis=(2, 3))
    through = strange & (above * below < 0)
    part = above / np.where(through, above - below, 1)
    w = p + part[..., None] * (q - p) - a
    f = (np.cross(b - a, w) * normal).sum(axis=2)
    g = (np.cross(w, c - a) * normal).sum(axis=2)
    return int((through & (f >= 0) & (g >= 0) & (f + g <= (normal * normal).sum(axis=2))).sum())


def contacts_of(simulation: Simulation) -> Any:
    (each,) = (k for k in simulation.islands[0].interactions if isinstance(k, SurfaceContacts))
    return each


@kernel
def end_step(each: Any, c: Any, before: Any, share: Any, h: Any) -> None:
    type(each).conclude(each, (), c, before, share, 0.0, h)


def after_moving(
    simulation: Simulation, velocity: np.ndarray, h: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Let all particles of an island move on straight lines for a step; where they were, and the velocities they get."""
    island = simulation.islands[0]
    c = island.island_columns()
    before = np.concatenate([np.stack([c.x, c.y, c.z]), velocity.T])
    for k, (x, v) in enumerate(((c.x, c.vx), (c.y, c.vy), (c.z, c.vz))):
        v[:] = velocity[:, k]
        x += h * velocity[:, k]
    each = contacts_of(simulation).renewed()
    end_step(each, c, before, lone(c.x.size), h)
    return before[:3].T, np.stack([c.vx, c.vy, c.vz]).T


def all_kinds(seed: int) -> Simulation:
    """Two cloths, two ropes and some balls near each other, crumpled, none through another."""
    groups = [
        sheet("low", -0.1),
        sheet("high", 0.1, right=[0.8, 0, 0.6], up=[0.6, 0, -0.8]),
        rope("one", [-0.6, 0.2, 0.02], [0.6, 0.2, 0.05]),
        rope("other", [0.02, 0.25, -0.6], [0.01, 0.25, 0.6]),
        points((0.2, 0.4, 0.2), (-0.2, 0.45, 0.1), (0, -0.3, 0), name="balls", mass=0.05, radius=0.08),
    ]
    simulation = Simulation(
        ps.from_table(table(1.0, 1e-3, particles=groups, interactions=[TOUCH])), threads=1
    )
    rng = np.random.default_rng(seed)
    for state in simulation.states:
        state.x[:, : state.count] += rng.normal(0, 0.01, (3, state.count))
    assert not crossings(*features(simulation))
    return simulation


@pytest.mark.parametrize("speed", [0.06, 0.5, 5.0])
def test_nothing_passes_through_on_the_way_of_a_step(speed: float) -> None:
    # every particle goes its own way, up to many times as far as things are apart; twenty places of the way are looked at
    for seed in range(2):
        simulation = all_kinds(seed)
        rng = np.random.default_rng(100 + seed)
        m = np.concatenate([state.mass[: state.count] for state in simulation.states])[:, None]
        velocity = speed * rng.normal(0, 1, (len(m), 3))
        velocity[:, 1] -= speed * np.sign(simulation.islands[0].island_columns().y)  # towards each other
        start, v = after_moving(simulation, velocity)
        x, triangles, edges = features(simulation)
        assert sum(crossings(start + s * (x - start), triangles, edges) for s in np.linspace(0, 1, 21)) == 0
        size = np.abs(m * velocity).sum()
        assert np.abs((m * (v - velocity)).sum(axis=0)).max() < 8 * EPS * size
        assert np.abs((m * (x - start - velocity)).sum(axis=0)).max() < 8 * EPS * (size + m.sum())
        assert (m * v**2).sum() <= (m * velocity**2).sum()
        assert np.abs(v - velocity).max() > 0  # they did meet
        simulation.close()


def test_a_meeting_without_contacts_changes_nothing() -> None:
    simulation = all_kinds(0)
    velocity = np.tile([3.0, -2.0, 1.0], (len(simulation.islands[0].island_columns().x), 1))
    start, v = after_moving(simulation, velocity)
    x, _, _ = features(simulation)
    assert (v == velocity).all()
    assert (x == start + velocity).all()


@kernel
def look(each: Any, c: Any, before: Any, share: Any, h: Any) -> None:
    find(each, c, before, share, 0.0, h)
    weigh(each.simplices, c.m, c.clock, each.desk)
    x = (c.x, c.y, c.z)
    list_contacts(each.simplices, each.found, each.touches, each.desk, each.report, each.tune, c.r, x, before)


def test_whoever_is_not_looked_at_does_not_touch() -> None:
    # particles on smooth ways of their own through each other: what lists of earlier steps find, and what new ones do
    simulation, h, rng = all_kinds(0), 1e-3, np.random.default_rng(5)
    c = simulation.islands[0].island_columns()
    start, kept, new = np.stack([c.x, c.y, c.z]), contacts_of(simulation).renewed(), contacts_of(all_kinds(0))
    speed, bend, phase = (rng.normal(0, size, start.shape) for size in (1.0, 0.2, 3.0))
    speed[1] -= np.sign(start[1])
    speed[:, -3:] *= 6.0  # the balls are much faster than most
    there, met = start, set()
    for step in range(1, 40):
        t = step * h
        way = start + t * speed + bend * (np.sin(30 * t + phase) - np.sin(phase))
        before = np.concatenate([there, (way - there) / h])
        c.x[:], c.y[:], c.z[:] = there = way
        new.report[STALE] = 1
        for each in (kept, new):
            look(each, c, before, lone(c.x.size), h)
        found = [
            set(map(tuple, each.touches.rows[:, : each.report[CONTACTS]].T.tolist())) for each in (kept, new)
        ]
        assert found[0] == found[1]
        met |= found[0]
    assert len(met) > 200
    assert kept.report[BUILDS] < 20
    simulation.close()


def falling(dt: float = 1e-3, speed: float = 0.0, n: int = 7, **law: Any) -> dict[str, Any]:
    """A sheet that falls on one held at two sides."""
    low = sheet("low", 0.0, n, pinned=["left", "right"])
    high = sheet("high", 0.1, n, velocity=[0, -speed, 0])
    high["layout"]["origin"] = [-0.47, 0.1, 0.52]
    return table(
        1.0,
        dt,
        particles=[low, high],
        forces=[{"type": "gravity"}],
        interactions=[{**TOUCH, **law}],
        output={"every": 50},
    )


def energy(simulation: Simulation) -> float:
    row = simulation.ledger()
    return row["kinetic"] + sum(row[name] for name in row if name.startswith("potential."))


@pytest.mark.parametrize("speed", [0.0, 150.0])
def test_a_sheet_does_not_fall_through_another_and_gains_nothing(speed: float) -> None:
    # at 150 m/s a step is longer than both are apart
    simulation, highest = Simulation(ps.from_table(falling(speed=speed)), threads=1), np.inf
    for step in range(0, 241, 20):
        simulation.advance_to(step)
        assert not crossings(*features(simulation))
        now = energy(simulation)
        assert now < highest
        highest = now
    low, high = (state.position[:, 1] for state in simulation.states)
    assert high.mean() > low.mean()
    simulation.close()


def test_implicit_steps_let_nothing_through_and_gain_nothing() -> None:
    scene = falling(dt=5e-3, speed=4.0, n=5)
    scene["simulation"]["integrator"] = "backward_euler"
    simulation, highest = Simulation(ps.from_table(scene), threads=1), np.inf
    for step in range(0, 61, 10):
        simulation.advance_to(step)
        assert not crossings(*features(simulation))
        now = energy(simulation)
        assert now < highest
        highest = now
    assert contacts_of(simulation).report[CONTACTS] > 0  # they lie on each other
    simulation.close()


def test_the_same_bits_with_any_threads_and_after_a_resume(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(falling(n=19, speed=3.0))
    one, two, other = (Simulation(scenario, threads=k) for k in (1, 2, 2))
    one.advance_to(100)
    two.advance_to(100)
    assert contacts_of(one).report[CONTACTS] > 0  # contacts
    assert bits(one) == bits(two)
    restore(other, snapshot(one))
    for each in (one, two, other):
        each.advance_to(200)
        each.close()
    assert bits(one) == bits(two) == bits(other)


def test_an_interval_without_room_is_done_again(monkeypatch: Any) -> None:
    scenario, found = ps.from_table(falling(speed=3.0)), []
    for least in (4096, 8):
        monkeypatch.setattr("particlesim.engine.interactions.surfaces.record.AT_LEAST", least)
        monkeypatch.setattr("particlesim.engine.interactions.surfaces.record.PER_SIMPLEX", least // 1000)
        found.append(Simulation(scenario, threads=1))
        room = contacts_of(found[-1]).touches.rows.shape[1]
        found[-1].advance_to(100)
    assert room < contacts_of(found[1]).touches.rows.shape[1]
    assert contacts_of(found[1]).report[CONTACTS] > 0
    assert bits(found[0]) == bits(found[1])
    for each in found:
        each.close()


def test_what_rests_on_a_sheet_neither_sinks_nor_moves() -> None:
    # a ball on a sheet too heavy to move: it falls by g h² in every step, and is put where both touch
    ground = {**sheet("low", 0.0), "mass": 1e18}
    ball = points((0.013, 0.0575, 0.021), name="ball", mass=0.1, radius=0.05)
    simulation = Simulation(
        ps.from_table(table(1.0, 1e-3, particles=[ground, ball], interactions=[TOUCH])), threads=1
    )
    h, velocity = 1e-3, np.zeros((50, 3))
    for _ in range(80):
        velocity[-1, 1] -= 9.8 * h
        _, velocity = after_moving(simulation, velocity, h)
    x = simulation.states[1].position[0]
    assert abs(x[1] - 0.05 - THIN / 2) < 2e-3 * (0.05 + THIN / 2)  # a search ends a thousandth before
    assert np.abs(velocity[-1]).max() < 1e-12
    assert np.abs(x[[0, 2]] - (0.013, 0.021)).max() < 1e-12
    simulation.close()


def test_what_crosses_or_is_too_close_at_the_start_is_told() -> None:
    def told(*groups: dict[str, Any], **more: Any) -> tuple[str, ...]:
        world = Simulation(
            ps.from_table(table(1.0, 1e-3, particles=list(groups), interactions=[TOUCH], **more))
        )
        return knotted(world)

    assert not told(sheet("low", 0.0), sheet("high", 0.1))
    (text,) = told(sheet("low", 0.0), rope("pole", [0.03, -0.5, 0.02], [0.03, 0.5, 0.02], 4))
    assert "'low' and 'pole' cross at the start in 1 place, the first near" in text
    (text,) = told(sheet("low", 0.0), sheet("high", 0.5 * THIN))
    assert "touch at the start" in text
    assert "0.006 m apart instead of 0.012 m" in text
    (text,) = told({**sheet("thick"), "radius": 0.07})
    assert "'thick' touches itself" in text
    assert "smaller radii" in text


def test_who_touches_with_what() -> None:
    groups = [sheet("low"), rope("line", [0, 1, 0], [1, 1, 0]), points((0, 2, 0), name="balls", radius=0.1)]

    def simplices(**law: Any) -> Any:
        made = Simulation(ps.from_table(table(1.0, 1e-3, particles=groups, interactions=[{**TOUCH, **law}])))
        return contacts_of(made).simplices

    found = simplices()
    assert (found.face.sum(), (found.face == 0).sum()) == (72, 8 + 1)
    assert found.edges.shape[1] == 2 * 6 * 7 + 36 + 8 + 1
    assert sorted(found.vertices[found.vertices >= 0]) == list(range(49 + 9 + 1))
    assert simplices(on=["line", "low"]).face.size == 72 + 8
    found = simplices(between=["balls", "low"])
    assert (found.split, found.face[0], found.face.size) == (1, 0, 73)
    with pytest.raises(ps.ScenarioError, match="surfaces touch by impulses"):
        simplices(model="linear", stiffness=10.0, surfaces=True)


def test_the_dead_leave_and_others_go_on_touching() -> None:
    # a wall takes a column of the sheet; an emitter sends balls on the rest
    emitter = {
        "name": "tap",
        "shape": {"type": "point", "position": [0, 0.3, 0]},
        "rate": 40.0,
        "speed": 1.0,
        "direction": [0.1, -1, 0],
        "radius": 0.03,
        "mass": 0.01,
        "lifetime": 0.3,
    }
    low = sheet("low", 0.0, pinned=["left", "top", "bottom"])
    scenario = ps.from_table(
        table(
            0.6,
            1e-3,
            particles=[low],
            emitters=[emitter],
            forces=[{"type": "gravity"}],
            planes=[{"point": [0.4, 0, 0], "normal": [-1, 0, 0], "contact": "kill", "on": ["low"]}],
            interactions=[TOUCH],
            output={"every": 100},
        )
    )
    one, two = Simulation(scenario, threads=1), Simulation(scenario, threads=2)
    one.advance_to(300)
    restore(two, snapshot(one))
    one.advance_to(600)
    two.advance_to(600)
    assert bits(one) == bits(two)
    cloth, balls = one.states
    assert 40 < cloth.count < 49
    assert balls.count > 5
    found = contacts_of(one).simplices
    assert found.rows.size == found.rows.max() + 1 == cloth.count + balls.count
    one.close()
    two.close()


@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
def test_balls_and_ropes_rebound_by_the_closed_form(e: float) -> None:
    # a ball hits another one, and a rope falls across another one: both relative velocities are turned around, times e
    groups = [
        points((-0.11, 0, 0), (0.0, 0, 0), name="balls", mass=[0.1, 0.3], radius=0.05),
        rope("lower", [-0.5, 1.0, 0], [0.5, 1.0, 0], 2),
        rope("upper", [0, 1.02, -0.5], [0, 1.02, 0.5], 2),
    ]
    law = {**TOUCH, "restitution": e, "friction": 0.3}
    simulation = Simulation(ps.from_table(table(1.0, 1e-3, particles=groups, interactions=[law])), threads=1)
    velocity = np.zeros((6, 3))
    velocity[0, 0], velocity[4:, 1] = 1.0, -3.0
    start, v = after_moving(simulation, velocity, 0.05)
    assert np.abs(v[:2, 0] - (0.25 - 0.75 * e, 0.25 + 0.25 * e)).max() < 8 * EPS
    assert abs((v[4:, 1].mean() - v[2:4, 1].mean()) - 3 * e) < 32 * EPS
    x = np.stack([simulation.islands[0].island_columns().y])[0]
    assert x[4:].mean() - x[2:4].mean() > THIN * (1 - 1e-9)
    assert np.abs(start[4:, 1] - 1.02).max() == 0
    simulation.close()


def test_crumpling_cloth_loses_its_energy_near_the_largest_stable_step() -> None:
    # a sheet with hardly any damping is thrown on its edge at a floor; contact and friction take nearly all that it brings
    cloth = sheet("cloth", n=9, up=[0, 1, 0.05], origin=[-0.5, 1.02, 0], velocity=[0, -6.0, 0])
    cloth["springs"]["damping_ratio"] = 0.01
    parts = {
        "particles": [cloth],
        "planes": [{"restitution": 0, "friction": 0.4}],
        "interactions": [TOUCH],
    }
    (island,) = stability(Simulation(ps.from_table(table(0.6, 1e-3, "symplectic_euler", **parts)))).islands
    stable = island.step
    assert island.warning(0.7 * stable) is None
    assert "crumple" in str(island.warning(0.72 * stable))
    steps = round(0.6 / (0.95 * stable)) + 1
    simulation, found = Simulation(ps.from_table(table(0.6, 0.6 / steps, "symplectic_euler", **parts))), []
    for step in range(0, steps + 1, 4):
        simulation.advance_to(step)
        row = simulation.ledger()
        energy = row["kinetic"] + sum(row[name] for name in row if name.startswith("potential."))
        swung = swing(simulation.islands[0], simulation.graph.islands[0], simulation.time, 0.6 / steps)
        found.append(energy - swung)
    simulation.close()
    assert max(found) < 1.001 * found[0]
    assert found[-1] < 0.25 * found[0]


@pytest.mark.slow
def test_hair_that_flies_apart_is_told_long_before_the_next_frame() -> None:
    # speeds grow six times in a step of 2.1 times the largest stable one, and then each step costs a second: all strands are
    # in each other's way; 25 of them, to the only frame, had taken a minute
    roots = {"type": "sphere", "center": [0, 0.8, 0], "radius": 0.2}
    layout = {"type": "hair", "strands": 60, "count": 14, "length": 0.5, "roots": roots}
    springs = {"structural": 200.0, "bend": 1.0, "damping_ratio": 0.3}
    hair = {"name": "hair", "mass": 0.02, "radius": 0.004, "layout": layout, "springs": springs}
    parts = {"particles": [hair], "interactions": [{"type": "contact", "restitution": 0}]}
    parts["forces"] = [{"type": "gravity"}]
    scenario = ps.from_table(
        table(0.0125, 5e-4, "symplectic_euler", **parts, output={"ledger": True, "every": 25})
    )
    told = []
    for threads in (1, 2):
        with pytest.raises(ps.DivergenceError, match="gained") as caught:
            ps.run(scenario, threads=threads)
        assert caught.value.post_mortem is not None
        assert caught.value.post_mortem.cause == "energy"
        assert caught.value.post_mortem.noticed < 0.0075
        assert caught.value.post_mortem.frame == 0
        told.append(str(caught.value))
    assert told[0] == told[1]


@pytest.mark.parametrize("method", ["symplectic_euler", "backward_euler"])
def test_pauses_change_no_bit(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ropes = [rope("a", [-0.5, 0.1, 0], [0.5, 0.1, 0]), rope("b", [0, 0, -0.5], [0, 0, 0.5])]
    ropes[1]["layout"]["velocity"] = [0, 1.0, 0]
    scenario = ps.from_table(table(0.2, 1e-3, method, particles=ropes, interactions=[TOUCH]))
    whole, steps = ps.run(scenario), set[int]()
    monkeypatch.setattr(surface_contacts, "MANY", 1)
    paused = ps.run(scenario, progress=lambda now: steps.add(now.step))
    assert len(steps) == 201  # so progress shows, and Ctrl-C is heard, between frames
    assert paused.state == whole.state
