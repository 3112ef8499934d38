"""What slides along one wall of what is put together does not pass another one, however thin that is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import table

import particlesim as ps
from particlesim.colliders.combination import DifferenceCollider, distances
from particlesim.colliders.parts import IntersectionRecord, UnionRecord

Floats = NDArray[np.float64]
Solid = dict[str, Any]

HALF = 1.0
"""Half of the length of the boxes [m]."""
BOX = {"type": "box", "size": [2 * HALF] * 3}
BALL = {"type": "sphere", "radius": 0.8}
PIPE = {"type": "cylinder", "start": [0, -0.7, 0], "end": [0, 0.7, 0], "radius": 0.9}
PAIR = [{"type": "sphere", "center": [x, 0, 0], "radius": 0.6} for x in (-0.4, 0.4)]


def thicker(solid: Solid, by: float) -> Solid:
    """A solid whose surface is farther out."""
    found = dict(solid)
    if "size" in solid:
        found["size"] = [length + 2 * by for length in solid["size"]]
    if "radius" in solid:
        found["radius"] = solid["radius"] + by
    if "start" in solid:
        found["start"], found["end"] = [0, -0.7 - by, 0], [0, 0.7 + by, 0]
    return found


def out_of(kind: str, x: Floats) -> Floats:
    """How far places are outside of a room [m]."""
    if kind == "box":
        return np.abs(x).max(axis=1) - HALF
    if kind == "ball":
        return np.asarray(np.linalg.norm(x, axis=1)) - 0.8
    if kind == "pipe":
        return np.maximum(np.hypot(x[:, 0], x[:, 2]) - 0.9, np.abs(x[:, 1]) - 0.7)
    far = [np.linalg.norm(x - [s, 0, 0], axis=1) - 0.6 for s in (-0.4, 0.4)]
    return np.asarray(np.minimum(*far))


def shell(kind: str, thick: float) -> Solid:
    """What is left of a solid around a room."""
    if kind == "two balls":
        return {
            "type": "difference",
            "of": [{"type": "union", "of": [thicker(each, thick) for each in PAIR]}, *PAIR],
        }
    room = {"box": BOX, "ball": BALL, "pipe": PIPE}[kind]
    return {"type": "difference", "of": [thicker(room, thick), room]}


def ends(x: Floats, v: Floats, collider: Solid, *, steps: int, g: list[float], **more: Any) -> Floats:
    """Where points are after steps of 10 ms."""
    layout = {"type": "points", "position": x.tolist(), "velocity": v.tolist()}
    forces = [{"type": "gravity", "acceleration": g}]
    given = table(
        steps * 0.01, 0.01, particles=[{"layout": layout}], forces=forces, colliders=[collider], **more
    )
    return np.array(ps.run(ps.from_table(given)).final["position"])


@pytest.mark.sampled(24)
@pytest.mark.parametrize("thick", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("kind", ["box", "ball", "pipe", "two balls"])
@pytest.mark.parametrize("response", [{"restitution": 0.0, "friction": 0.1}, {"contact": "slide"}])
def test_what_slides_in_a_room_stays_in_it(kind: str, response: Solid, thick: float) -> None:
    """Of 120 points 49 had left the box. In the ball and the pipe a step ends in the wall, or behind it, by s²/2R."""
    rng, n = np.random.default_rng(5), 40
    x = rng.uniform(-0.3, 0.3, (n, 3)) + np.array([0.2, 0, 0])
    v = rng.normal(0, 5, (n, 3))
    end = ends(x, v, {**shell(kind, thick), **response}, steps=80, g=[4, -9, 2])
    assert out_of(kind, end).max() < 1e-10


@pytest.mark.parametrize("thick", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize(
    ("x", "v"),
    [
        pytest.param([0.5, -1, 0], [3, 0, 0], id="along the floor to a wall"),
        pytest.param(
            [1, -0.5, 0], [0, -3, 0], id="down a wall to the floor, which it touches without pressing"
        ),
        pytest.param([0.5, -0.9, 0], [3, 0, 0], id="through the air to the floor, and on"),
    ],
)
def test_what_slides_comes_to_rest_in_the_edge_of_a_room(
    x: list[float], v: list[float], thick: float
) -> None:
    """As in a container of one shape."""
    solid = {**shell("box", thick), "restitution": 0.0}
    end = ends(np.array([x]), np.array([v], float), solid, steps=100, g=[0, -9.8, 0])
    np.testing.assert_allclose(end, [[1, -1, 0]], atol=1e-7)  # nearer than that hops take no time


def turned_back(x: Floats, axis: Floats, angle: float) -> Floats:
    """Places as a frame has them that is turned by an angle."""
    a, b, c = axis
    k = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    return np.asarray(x @ (np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k))


@pytest.mark.sampled(6)
@pytest.mark.parametrize("thick", [1e-6, 1e-8])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_nothing_passes_thin_blades_in_a_room_that_turns(restitution: float, thick: float) -> None:
    """The way in its frame bends otherwise than the parabola through its ends: one of 2400 points had met the second of two
    blades that meet before the first. And what has had too many impacts went through what came upon it."""
    rng, n, rate, steps = np.random.default_rng(1), 200, 3.0, 3
    axis = np.array([0.3, 1, 0.2]) / np.linalg.norm([0.3, 1, 0.2])
    blades = [{"type": "box", "size": [thick if k == j else 3 for k in range(3)]} for j in range(3)]
    room = {"type": "difference", "inside": True, "of": [{"type": "box", "size": [2 + thick] * 3}, *blades]}
    x = rng.uniform(0.02, 0.95, (n, 3)) * rng.choice([-1, 1], (n, 3))
    v = rng.normal(size=(n, 3))
    v *= 10 ** rng.uniform(0, 3, (n, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
    x[0], v[0] = (-0.137094110788485, 0.2280586079561533, -0.4731160258478798), (211.8, -89.8, 730.9)
    end = ends(
        x,
        v,
        {**room, "name": "room", "restitution": restitution},
        steps=steps,
        g=[-3, -300, 50],
        motions=[{"collider": "room", "spin": {"axis": axis.tolist(), "rate": rate}}],
    )
    end = turned_back(end, axis, rate * steps * 0.01)
    np.testing.assert_array_equal(np.sign(end), np.sign(x))
    assert np.abs(end).max() < 1 + thick


@pytest.mark.slow
def test_what_slides_in_a_corner_of_plates_that_turn_stays_there() -> None:
    """It had come ever nearer to the second plate in ever shorter glides, and out when they were too many."""
    thick, rng, n, rate, steps = 1.5e-4, np.random.default_rng(2), 40, 2.0, 120
    plates = []
    for k in range(3):
        for side in (-1, 1):
            center, size = np.zeros(3), np.full(3, 2.2)
            center[k], size[k] = side * (1 + 0.5 * thick), thick
            plates.append({"type": "box", "center": center.tolist(), "size": size.tolist()})
    axis = np.array([0.0, 0.0, 1.0])
    end = ends(
        rng.uniform(-0.9, 0.9, (n, 3)),
        rng.normal(0, 1.5, (n, 3)),
        {"type": "union", "name": "room", "of": plates, "restitution": 0.0},
        steps=steps,
        g=[30, -60, 20],
        motions=[{"collider": "room", "spin": {"axis": axis.tolist(), "rate": rate}}],
    )
    pivot = np.array([-1 - 0.5 * thick, 0, 0])
    end = pivot + turned_back(end - pivot, axis, rate * steps * 0.01)
    assert np.abs(end).max() < 1 + 1e-9


def test_solids_put_together_are_pieces_of_convex_ones_with_the_same_gaps() -> None:
    ground = {"type": "plane"}
    both = {"type": "union", "of": [BOX, {**BALL, "center": [1, 0, 0]}]}
    cut = {"type": "difference", "of": [{**BOX, "center": [0, 1, 0]}, PIPE]}
    lens = {"type": "intersection", "of": PAIR}
    rng = np.random.default_rng(0)
    x = rng.uniform(-2, 2, (500, 3))

    def of(**given: Any) -> Any:
        return DifferenceCollider(**{"type": "difference", **given})

    box, ball, pipe = (of(of=[each, ground]).of[0].geometry() for each in (BOX, BALL, PIPE))
    far = {"box": distances(box, x), "pipe": distances(pipe, x)}
    far["ball"] = distances(ball, x - [1, 0, 0])
    far["cut"] = np.maximum(distances(box, x - [0, 1, 0]), -far["pipe"])
    far["lens"] = np.maximum(*(np.linalg.norm(x - each["center"], axis=1) - 0.6 for each in PAIR))
    shape = of(of=[both, cut, lens]).geometry()
    assert isinstance(shape, UnionRecord)
    assert all(isinstance(part, IntersectionRecord) for part in shape.parts)
    expected = np.maximum.reduce([np.minimum(far["box"], far["ball"]), -far["cut"], -far["lens"]])
    np.testing.assert_allclose(distances(shape, x), expected, atol=1e-14)
    inside = of(of=[both, cut, lens], inside=True).shape()
    np.testing.assert_allclose(distances(inside, x), -expected, atol=1e-14)


@pytest.mark.parametrize(
    ("dt", "friction"),
    [pytest.param(0.005, 0.0, marks=pytest.mark.slow), (0.005, 0.05), (0.02, 0.0), (0.02, 0.05)],
)
def test_what_slides_along_an_edge_stays_in_its_room_beside_another_one(dt: float, friction: float) -> None:
    """Three of 20 had passed a wall of a nanometre: of the wall and the floor of the next room the farther one was met."""
    thick, n = 1e-9, 20
    rooms = [{"type": "box", "center": [x, 0, 0], "size": [1, 1, 1]} for x in (0.5, 1.5 + thick)]
    x = np.stack([np.random.default_rng(1).uniform(0.1, 0.9, n), *np.full((2, n), -0.2)], axis=1)
    layout = {"type": "points", "position": x.tolist(), "velocity": [[0.5, 0.0, 0.0]] * n}
    block = {"type": "box", "center": [1, 0, 0], "size": [6, 6, 6]}
    given = table(
        1.0,
        dt,
        particles=[{"layout": layout}],
        forces=[{"type": "gravity", "acceleration": [3.0, -8.0, -9.0]}],
        colliders=[{"type": "difference", "of": [block, *rooms], "restitution": 0.0, "friction": friction}],
    )
    end = np.array(ps.run(ps.from_table(given)).final["position"])
    assert end[:, 0].max() < 1 + 0.5 * thick
    assert np.abs(end[:, 1:]).max() < 0.5 + 1e-12


def test_what_falls_along_a_wall_hits_the_floor_of_a_room_straight() -> None:
    """As in a container of one shape: a glide that ended a little under the floor had a normal between both, and led off
    from the wall with half of the speed."""
    x = np.stack([np.random.default_rng(1).uniform(0.1, 0.9, 20), *np.full((2, 20), -0.2)], axis=1)
    room = {"type": "box", "center": [0.5, 0, 0], "size": [1, 1, 1]}
    block = {"type": "box", "center": [1, 0, 0], "size": [6, 6, 6]}
    given = table(
        1.0,
        0.005,
        particles=[
            {"layout": {"type": "points", "position": x.tolist(), "velocity": [[0.5, 0.0, 0.0]] * 20}}
        ],
        forces=[{"type": "gravity", "acceleration": [3.0, -8.0, -9.0]}],
        colliders=[{"type": "difference", "of": [block, room], "restitution": 0.0}],
    )
    end = np.array(ps.run(ps.from_table(given)).final["position"])
    np.testing.assert_allclose(end, np.tile([1, -0.5, -0.5], (20, 1)), atol=1e-9)
