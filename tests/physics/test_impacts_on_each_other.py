"""Emitters that hear impacts of hard grains and rigid bodies on each other: `on_impact = { of = …, against = … }`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

TOUCH = {"type": "contact", "model": "impulse"}
END = 1.2


def sparks(of: str, against: str | None, **event: Any) -> dict[str, Any]:
    who = {"of": of.split()} | ({} if against is None else {"against": against.split()})
    values = {key: event.pop(key) for key in ("speed", "spread", "lifetime") if key in event}
    return {"name": "sparks", "direction": "outward", "radius": 0.01, "on_impact": who | event, **values}


def grains(speed: float, name: str = "ball", at: float = 0.0) -> dict[str, Any]:
    return points((at, 0.0, 0.0), velocity=((speed, 0.0, 0.0),), name=name, radius=0.1, mass=2.0)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_an_impact_of_two_grains_is_one_at_its_place_and_moment(speed: float) -> None:
    # A ball from 0 and one at rest at 1 touch after 0.8 m, at 0.9; the one with the lower id, the first, tells it: outward
    # is −x, and half of its velocity goes on. At 100 m/s it comes five diameters in a step.
    pair = points(
        (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), velocity=((speed, 0.01, 0.0), (0.0, 0.01, 0.0)), name="ball"
    )
    pair |= {"radius": 0.1, "mass": 2.0}
    heard = sparks("ball", "ball", count=2, inherit=0.5, speed=0.3)
    found = simulate(END, 0.01, particles=[pair], interactions=[TOUCH | {"on": ["ball"]}], emitters=[heard])
    left = END - 0.8 / speed
    assert found.born == 2
    for row in (2, 3):
        place = [0.9 - 0.01 - 0.3 * left, 0.01 * (0.8 / speed) + 0.5 * 0.01 * left, 0]
        assert found.final.position[row] == pytest.approx(place, abs=1e-12)
        assert found.final.velocity[row] == pytest.approx([-0.3, 0.005, 0], abs=1e-12)


BOX = {"name": "box", "shape": {"type": "box", "size": [1, 1, 1]}, "density": 1000, "position": [2, 0, 0]}
DIE = {"name": "die", "shape": {"type": "sphere", "radius": 0.1}, "density": 1000}


def thrown(kind: str, speed: float, *emitters: dict[str, Any], dt: float = 0.01, **parts: Any) -> ps.Result:
    """A grain or a ball, `die`, thrown at a box 1.4 m away."""
    if kind == "grain":
        parts |= {"particles": [grains(speed, "die")], "bodies": [BOX]}
        parts["interactions"] = [TOUCH | {"on": ["die", "box"]}]
    else:
        parts["bodies"] = [BOX, DIE | {"velocity": [speed, 0, 0]}]
    return simulate(1.5, dt, emitters=list(emitters), **parts)


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("kind", "speed"), [("grain", 1.0), ("grain", 50.0), ("body", 1.0), ("body", 50.0)])
def test_grains_and_bodies_hear_who_they_hit(kind: str, speed: float) -> None:
    # The face of the box is at 1.5. What counts in the middle of a step is found within half of its way.
    for who, side in (("die", -1), ("box", 1)):
        other = "box" if who == "die" else "die"
        found = thrown(kind, speed, sparks(who, other))
        assert found.born == 1
        x = found.final.position[-1, 0]
        assert x == pytest.approx(1.5 + side * 0.01, abs=0.5 * 0.01 * speed if speed == 1 else 1e-4)
    assert thrown(kind, speed, sparks("die box", "die box")).born == 1
    assert thrown(kind, speed, sparks("die", "box", above=0.9 * speed)).born == 1
    assert thrown(kind, speed, sparks("die", "box", above=1.1 * speed)).born == 0


@pytest.mark.slow
def test_colliders_are_heard_as_before_unless_others_are_named() -> None:
    # A ball falls on a floor at 0.45 s, and another one on that, which lies there, at 0.64 s.
    stack = points((0.0, 1.1, 0.0), (0.0, 3.3, 0.0), name="ball", radius=0.1)
    parts: dict[str, Any] = {
        "particles": [stack],
        "planes": [{"name": "floor", "on": ["ball"], "restitution": 0}],
        "forces": [{"type": "gravity", "on": ["ball"]}],
        "interactions": [TOUCH | {"on": ["ball"], "restitution": 0}],
    }

    def born(*who: Any, **event: Any) -> int:
        return simulate(1.5, 0.001, emitters=[sparks(*who, **event)], **parts).born

    assert born("ball", None) == 1
    assert born("ball", "ball") == 1
    assert born("ball", "ball", at=["floor"]) == 2


@pytest.mark.parametrize("kind", ["grains", "grain on body", "bodies"])
@pytest.mark.parametrize("e", [0.0, 0.8])
def test_what_lies_on_others_is_not_heard(kind: str, e: float) -> None:
    parts: dict[str, Any] = {
        "planes": [{"restitution": e}],
        "forces": [{"type": "gravity", "on": ["low", "high"]}],
    }
    low, high = ((points((0.0, y, 0.0), name=name, radius=0.1)) for y, name in ((0.1, "low"), (0.3, "high")))
    plate = {
        "name": "low",
        "shape": {"type": "box", "size": [1, 0.2, 1]},
        "density": 1000,
        "position": [0, 0.1, 0],
        "restitution": e,
    }
    if kind == "grains":
        parts["particles"] = [low, high]
    elif kind == "grain on body":
        parts |= {"particles": [high], "bodies": [plate]}
    else:
        parts["bodies"] = [plate, plate | {"name": "high", "position": [0, 0.3, 0]}]
    if kind != "bodies":
        parts["interactions"] = [TOUCH | {"on": ["low", "high"], "restitution": e}]
    assert simulate(1.0, 0.01, emitters=[sparks("high low", "high low")], **parts).born == 0


@pytest.mark.slow
def test_threads_frames_and_checkpoints_do_not_matter() -> None:
    rng = np.random.default_rng(2)
    places = [(0.25 * i, 0.2 + 0.25 * j, 0.25 * k) for i in range(5) for j in range(5) for k in range(5)]
    swarm = points(*places, velocity=tuple(map(tuple, rng.normal(0, 1.5, (125, 3)))), name="ball", radius=0.1)
    scene = table(
        0.5,
        0.01,
        particles=[swarm],
        bodies=[BOX | {"position": [0.5, -0.6, 0.5]}],
        interactions=[TOUCH],
        forces=[{"type": "gravity", "on": ["ball", "box"]}],
        emitters=[
            {
                **sparks("ball box", "ball box", count=2, speed=1.0, spread=60),
                "dynamics": {"type": "second_order"},
            }
        ],
    )
    scene["interactions"] = [TOUCH | {"on": ["ball", "box"]}]
    one = ps.run(ps.from_table(scene), threads=1)
    scene["output"]["every"] = 7
    two = ps.run(ps.from_table(scene), threads=2)
    assert one.born == two.born > 100
    assert one.state == two.state
    scenario = ps.from_table(scene)
    half = Simulation(scenario, threads=1)
    half.advance_to(20)
    saved = snapshot(half)
    again = Simulation(scenario, threads=1)
    restore(again, saved)
    for each in (half, again):
        each.advance_to(50)
        each.close()
    for mine, theirs in zip(half.states, again.states, strict=True):
        np.testing.assert_array_equal(mine.position, theirs.position)


SOFT = {"type": "contact", "model": "linear", "stiffness": 1e4, "on": ["dust"]}
BAD = {
    "unknown": (sparks("ball", "bal"), "unknown group 'bal'"),
    "never": (sparks("ball", "dust"), "do not touch each other by impulses"),
    "none": (sparks("ball", "ball") | {"on_impact": {"of": ["ball"], "against": []}}, "against"),
    "its own": (sparks("ball", "sparks"), "do not touch each other by impulses"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_heard_is_refused(name: str) -> None:
    emitter, words = BAD[name]
    parts = {
        "particles": [grains(1.0), grains(0.0, "dust", 3.0)],
        "interactions": [TOUCH | {"on": ["ball"]}, SOFT],
    }
    with pytest.raises(ps.ScenarioError, match=words):
        ps.from_table(table(1.0, 0.01, emitters=[emitter], **parts))
