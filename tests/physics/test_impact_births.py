"""Emitters that hear of impacts: who is born where and when, and that it depends on nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

BALL = {"name": "ball", "radius": 0.1, "mass": 2.0}
SPARKS = {"name": "sparks", "direction": "outward", "radius": 0.01}


def scene(*emitters: dict[str, Any], **parts: Any) -> dict[str, Any]:
    """Two balls dropped by 1 m on a plane, at x = 0 and x = 3, and emitters that hear of it."""
    balls = points((0.0, 1.1, 0.0), (3.0, 1.6, 0.0), velocity=((2.0, 0.0, 0.0), (0.0, 0.0, 0.0)), **BALL)
    return table(
        0.5,
        0.01,
        **{
            "particles": [balls],
            "emitters": list(emitters),
            "forces": [{"type": "gravity", "on": ["ball"]}],
            "planes": [{"name": "floor", "on": ["ball"]}],
            **parts,
        },
    )


def emitter(**values: Any) -> dict[str, Any]:
    event = {"of": ["ball"], **values.pop("on_impact", {})}
    return {**SPARKS, "on_impact": event, **values}


def born(scenario: dict[str, Any], **options: Any) -> Any:
    return ps.run(ps.from_table(scenario), **options)


def test_births_are_at_the_place_and_moment_of_the_impact() -> None:
    # The first ball falls 1 m, for 0.4515 s, and goes 2 m/s along x; the other one is still in the air.
    found = born(scene(emitter(on_impact={"count": 3, "inherit": 0.5}, speed=1.5)))
    t = np.sqrt(2 / G)
    assert found.born == 3
    rest = 0.5 - t
    place = [2 * t + (0.5 * 2) * rest, 0.01 + 1.5 * rest, 0]
    for row in range(2, 5):
        assert found.final.position[row] == pytest.approx(place, abs=1e-12)
        assert found.final.velocity[row] == pytest.approx([1, 1.5, 0], abs=1e-12)


def test_what_hits_may_die_and_directions_may_be_mirrored() -> None:
    floor = [{"name": "floor", "on": ["ball"], "contact": "kill"}]
    found = born(scene(emitter(direction="mirrored", speed=1.0, on_impact={"at": ["floor"]}), planes=floor))
    assert (found.born, found.died) == (1, {"plane": 1})
    v = np.array([2, np.sqrt(2 * G), 0])
    assert found.final.velocity[1] == pytest.approx(v / np.linalg.norm(v), abs=1e-12)


@pytest.mark.parametrize("above", [4.4, 4.5])
def test_slow_impacts_are_not_heard(above: float) -> None:
    # v = √(2 g h) = 4.43 m/s
    assert born(scene(emitter(on_impact={"above": above}))).born == int(above < 4.43)


@pytest.mark.parametrize("case", ["discrete", "springs", "rk45", "moving", "again"])
def test_all_ways_to_collide_are_heard(case: str) -> None:
    parts: dict[str, Any] = {"planes": [], "colliders": []}
    ground = {"name": "floor", "on": ["ball"], "type": "box", "size": [20, 2, 20], "center": [0, -1, 0]}
    if case == "discrete":
        parts["planes"] = [{"name": "floor", "on": ["ball"], "detection": "discrete"}]
    elif case == "moving":
        parts["colliders"] = [ground]
        parts["motions"] = [{"collider": "floor", "path": ["x", "y + 0*t", "z"]}]
    else:
        parts["colliders"] = [ground]
    if case == "springs":
        parts["springs"] = [{"on": "ball", "pairs": [[0, 1]], "stiffness": 1e-9}]
    scenario = scene(emitter(), **parts)
    if case == "rk45":
        scenario["simulation"]["integrator"] = "rk45"
    if case == "again":
        scenario["simulation"]["duration"] = 1.5  # 1 m: at 0.45 and 1.35 s; 1.5 m: at 0.55 and 1.66 s
        assert born(scenario).born == 3
        return
    found = born(scenario)
    assert found.born == 1
    assert found.final.position[2, 1] >= 0.01 - 1e-12  # on the surface, also where the ball is found inside


def test_frames_threads_and_checkpoints_do_not_matter() -> None:
    event = emitter(on_impact={"count": 5}, spread=50, speed={"type": "uniform", "low": 1, "high": 2})
    many = {
        "name": "ball",
        "radius": 0.02,
        "layout": {
            "type": "random",
            "count": 300,
            "shape": {"type": "box", "min": [0, 0.1, 0], "max": [1, 1, 1]},
        },
    }
    scenario = scene({**event, "lifetime": 0.2}, particles=[many])
    one = born(scenario, threads=1)
    scenario["output"]["every"] = 7
    two = born(scenario, threads=2)
    assert one.born == two.born > 1000
    assert one.state == two.state
    half = Simulation(ps.from_table(scenario))
    half.advance_to(20)
    from particlesim.engine.snapshot import restore, snapshot

    saved = snapshot(half)
    again = Simulation(ps.from_table(scenario))
    restore(again, saved)
    again.step = half.step
    for each in (half, again):
        each.advance_to(50)
        each.close()
    for mine, theirs in zip(half.states, again.states, strict=True):
        np.testing.assert_array_equal(mine.position, theirs.position)


POINT = {"type": "point", "position": [0, 0, 0]}
BAD = {
    "rate": (emitter(rate=5.0), "rate has no meaning"),
    "shape": (emitter(shape=POINT), "shape has no meaning"),
    "group": (emitter(on_impact={"of": ["balls"]}), "balls"),
    "place": (emitter(on_impact={"at": ["flor"]}), "unknown collider 'flor'"),
    "itself": (emitter(on_impact={"of": ["sparks"]}), "the same"),
    "mirror": (
        {**SPARKS, "rate": 1.0, "shape": POINT, "direction": "mirrored"},
        "mirrored directions need on_impact",
    ),
    "no shape": ({"name": "sparks", "rate": 1.0}, "shape"),
    "count": (emitter(on_impact={"count": 0}), "must be at least 1"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_heard_is_refused(name: str) -> None:
    table_, words = BAD[name]
    with pytest.raises(ps.ScenarioError, match=words):
        ps.from_table(scene(table_))


def test_contacts_that_last_have_no_moment_that_could_be_heard() -> None:
    table_ = scene(emitter())
    table_["interactions"] = [{"type": "contact", "model": "linear", "stiffness": 1000.0, "on": ["ball"]}]
    with pytest.raises(
        ps.ScenarioError, match="contacts of contact last, so that 'ball' has no moment of impact"
    ):
        ps.from_table(table_)


def test_circles_are_refused() -> None:
    one = {**emitter(on_impact={"of": ["other"]}), "name": "one"}
    other = {**emitter(on_impact={"of": ["one"]}), "name": "other"}
    with pytest.raises(ps.ScenarioError, match="that its own births cause"):
        ps.from_table(scene(one, other, planes=[{"name": "floor"}]))
    soft = [{"name": "floor", "contact": "penalty", "stiffness": 100.0}]
    with pytest.raises(ps.ScenarioError, match="hit nothing"):
        ps.from_table(scene(emitter(), planes=soft))


def test_what_may_leave_a_region_is_heard_too() -> None:
    away = {"outside": [[-9, -9, -9], [9, 9, 9]]}
    drops = {
        "name": "drops",
        "burst": {"count": 5, "at": 0},
        "die": away,
        "direction": [0, -1, 0],
        "speed": 2.0,
    }
    drops |= {"shape": {"type": "point", "position": [0, 0.5, 0]}}
    sparks = emitter(on_impact={"of": ["drops"]}, speed=1.0, die=away)
    found = born(scene(drops, sparks, planes=[{"on": ["drops"]}], forces=[], particles=[]))
    assert found.born == 10


def dropped(*, restitution: float = 0.5, dt: float = 1e-3, **parts: Any) -> dict[str, Any]:
    """A die dropped by 1 m on its face, from x = 1 at 2 m/s along x, and dust that hears of it."""
    die = {
        "name": "die",
        "shape": {"type": "box", "size": [0.2, 0.2, 0.2]},
        "density": 500,
        "position": [1, 1.1, 0],
        "velocity": [2, 0, 0],
        "restitution": restitution,
    }
    dust = {**SPARKS, "name": "dust", "on_impact": {"of": ["die"], "count": 2, "inherit": 0.5}, "speed": 1.5}
    return table(
        1.2,
        dt,
        **{
            "bodies": [die],
            "emitters": [dust],
            "forces": [{"type": "gravity", "on": ["die"]}],
            "planes": [{"name": "floor", "on": ["die"], "restitution": restitution}],
            **parts,
        },
    )


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dt", [1e-3, 0.1])  # 0.1 s are 4 sizes of the die: it is swift
def test_impacts_of_bodies_are_heard(dt: float) -> None:
    # It falls for √(2 h/g) = 0.4515 s, and comes down again after as long, and half of that. Of its four corners one counts.
    found = born(dropped(dt=dt))
    # Impacts count as in the middle of a step; those of what is swift when half a drift at the speed of its beginning ends.
    t, late = np.sqrt(2 / G), dt / 2 if dt < 0.01 else G * dt**2 / 8 / np.sqrt(2 * G)
    assert found.born == 6
    place, velocity = found.final.position[1:3], found.final.velocity[1:3]
    assert velocity == pytest.approx(np.tile([1, 1.5, 0], (2, 1)), abs=1e-9)
    rest = (place[:, 1] - 0.01) / 1.5  # since then
    assert rest == pytest.approx(1.2 - t, abs=1.01 * late)
    assert abs(place[:, 0] - (1 + 2 * (1.2 - rest)) - rest) == pytest.approx(0.1, abs=2 * late)


def test_what_lies_is_not_heard_and_colliders_are_told_apart() -> None:
    assert born(dropped(restitution=0.0)).born == 2
    ramp = {"type": "box", "name": "ramp", "size": [1, 0.4, 1], "center": [1.9, 0, 0], "on": ["die"]}
    event = {"of": ["die"], "at": ["floor"]}
    parts: dict[str, Any] = {"colliders": [ramp], "emitters": [{**SPARKS, "on_impact": event}]}
    assert born(dropped(restitution=0.0, **parts)).born == 0


def test_every_bounce_of_a_lone_ball_is_heard() -> None:
    ball = {
        "name": "die",
        "shape": {"type": "sphere", "radius": 0.1},
        "density": 500,
        "position": [0, 0.6, 0],
    }
    floor = [{"name": "floor", "on": ["die"], "restitution": 0.8}]
    # √(2 h/g) = 0.319 s, and 0.511, 0.409, 0.327 s between the next ones: four by 1.6 s
    assert born(dropped(bodies=[ball], planes=floor, simulation={"duration": 1.6, "dt": 1e-3})).born == 8


def test_births_at_bodies_that_they_touch_are_refused() -> None:
    touch = {"type": "contact", "on": ["die", "dust"]}
    with pytest.raises(ps.ScenarioError, match="act on each other in every step"):
        ps.from_table(dropped(interactions=[touch]))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("room", ["still", "moving"])
def test_what_slides_into_another_side_of_a_shape_is_heard(room: str) -> None:
    # The ball slides on the floor of a box, whose hops are nothing, and hits its side at 2 m/s, within a step.
    box = {"name": "room", "type": "box", "inside": True, "size": [2, 2, 2], "restitution": 0.5}
    motions = [{"collider": "room", "path": ["x", "y", "z + 0.2*t"]}] if room == "moving" else []
    ball = points((0.307, -0.9, 0.0), velocity=((2.0, 0.0, 0.0),), **BALL)
    found = born(
        scene(
            emitter(on_impact={"at": ["room"], "count": 1, "above": 1.0}, speed=1.0),
            particles=[ball],
            planes=[],
            colliders=[box],
            motions=motions,
        )
    )
    assert found.born == 1
