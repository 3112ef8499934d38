"""Floors of tiles: what slides over a seam between two of them goes on as on one floor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from simulate import G, points, way
from support import careful, columns, position, program, run

from particlesim.colliders import BoxCollider, PlaneCollider
from particlesim.colliders.pose import Orientation
from particlesim.colliders.seams import closed
from particlesim.forces import Gravity

RNG = np.random.default_rng(3)
GRAVITY = [{"type": "gravity", "acceleration": [0, -G, 0]}]
BOXES = [{"type": "box", "center": [s, -0.05, 0], "size": [2, 0.1, 4]} for s in (-1, 1)]
SHEETS = [{"type": "rectangle", "center": [s, -5e-5, 0], "size": [2, 4], "thickness": 1e-4} for s in (-1, 1)]


def slid(
    tiles: list[dict[str, Any]],
    radius: float,
    x: NDArray[np.float64],
    v: NDArray[np.float64],
    h: float,
    steps: int,
    **response: Any,
) -> tuple[NDArray[np.float64], ...]:
    """All places and velocities of what lies at x on tiles that meet at 0, and slides along x with v."""
    zero = np.zeros(len(x))
    places = np.stack([x, np.full(len(x), radius), RNG.uniform(-1, 1, len(x))], axis=1)
    return way(
        1,
        steps * h,
        h,
        "velocity_verlet",
        particles=[
            points(*places.tolist(), velocity=np.stack([v, zero, zero], axis=1).tolist(), radius=radius)
        ],
        forces=GRAVITY,
        colliders=[{**each, "restitution": 0.0, **response} for each in tiles],
    )


@pytest.mark.parametrize(("h", "speed"), [(0.03, 0.01), (0.002, 0.1), (0.03, 1.0), (0.03, 10.0)])
@pytest.mark.parametrize("tiles", [BOXES, SHEETS], ids=["boxes", "sheets"])
def test_a_ball_goes_on_over_a_seam(tiles: list[dict[str, Any]], h: float, speed: float) -> None:
    """The end of a step that glides around the edge of one tile is below the next one: a ball met that at once, up to 1024
    times, and was late by up to a whole step."""
    n, steps = 60, 5
    x = -speed * h * RNG.uniform(0.05, 2, n)
    places, speeds = slid(tiles, 0.01, x, np.full(n, speed), h, steps, friction=0.0)
    assert np.abs(places[-1, :, 0] - (x + speed * h * steps)).max() < 1e-10
    assert np.abs(places[:, :, 1] - 0.01).max() < 1e-15
    assert speeds[-1, :, 0] == pytest.approx(speed, rel=1e-8)


def test_points_that_friction_holds_near_the_edge_of_a_box_stay_on_it() -> None:
    """Where a step ends nearer to a side of a box than it is deep in it, the point was put out there, and fell between two
    boxes. It stops after v²/(2 μ g)."""
    n, mu, h = 400, 0.1, 0.03
    x, v = RNG.uniform(-0.006, 0, n), RNG.uniform(0.05, 0.2, n)
    places, speeds = slid(BOXES, 0.0, x, v, h, 8, friction=mu)
    assert np.abs(places[..., 1]).max() < 1e-15
    assert np.all(speeds[-1] == 0)
    assert places[-1, :, 0] == pytest.approx(x + v * v / (2 * mu * G), abs=1e-12)


FLOORS: dict[str, dict[str, Any]] = {
    "plane": {"type": "plane"},
    "box": {"type": "box", "center": [0, -0.5, 0], "size": [20, 1, 20]},
    "sheet": {"type": "rectangle", "center": [0, -0.0005, 0], "size": [20, 20], "thickness": 0.001},
    "room": {"type": "box", "center": [0, 5, 0], "size": [20, 10, 20], "inside": True},
}
BLOCK = {"type": "box", "center": [2, 0.25, 0], "size": [1, 0.5, 3]}
WALLS: dict[str, dict[str, Any]] = {
    "box": BLOCK,
    "cylinder": {"type": "cylinder", "start": [2, 0, 0], "end": [2, 0.5, 0], "radius": 0.5},
    "cone": {
        "type": "cone",
        "start": [2, 0.5, 0],
        "end": [2, 0, 0],
        "radius": 0.5,
        "end_radius": 0.499999999,
    },
    "union": {"type": "union", "of": [BLOCK, {**BLOCK, "center": [3, 0.25, 0]}]},
    "difference": {
        "type": "difference",
        "of": [BLOCK, {**BLOCK, "center": [2, 0.5, 0], "size": [0.5, 0.5, 4]}],
    },
    "sunk": {**BLOCK, "center": [2, 0.2, 0], "size": [1, 0.6, 3]},
}


def turned(table: dict[str, Any], degrees: float) -> dict[str, Any]:
    """A collider turned about the z axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    found = dict(table)
    for key in ("center", "start", "end", "normal"):
        if key in table:
            x, y, z = table[key]
            found[key] = [c * x - s * y, s * x + c * y, z]
    if table["type"] in ("box", "rectangle"):
        found["orientation"] = {"axis": [0, 0, 1], "angle": degrees}
    if "of" in table:
        found["of"] = [turned(part, degrees) for part in table["of"]]
    return found


def against_walls(
    floor: str, wall: str, degrees: float, restitution: float, method: str
) -> tuple[NDArray[np.float64], ...]:
    """Places and velocities along the floor of points that slide on it to a wall at 1.5 m, and where they must be."""
    n, h, steps = 100, 0.01, 20
    x, v = RNG.uniform(0, 1.4, n), 10 ** RNG.uniform(-0.3, 1.5, n)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    along = np.array([c, s, 0.0])
    level = {**FLOORS[floor], "normal": [0, 1, 0]} if floor == "plane" else FLOORS[floor]
    response = {"restitution": restitution, "friction": 0.0}
    level, other = ({**turned(each, degrees), **response} for each in (level, WALLS[wall]))
    planes = [{key: value for key, value in level.items() if key != "type"}] if floor == "plane" else []
    places, speeds = way(
        1,
        steps * h,
        h,
        method,
        particles=[
            points(*np.outer(x, along).tolist(), velocity=np.outer(v, along).tolist(), radius=0.0, mass=1.0)
        ],
        forces=[{"type": "gravity", "acceleration": [s * G, -c * G, 0]}],
        planes=planes,
        colliders=[other] if planes else [level, other],
    )
    until = (1.5 - x) / v
    after = np.maximum(steps * h - until, 0)
    ends = np.where(after > 0, 1.5 - restitution * v * after, x + v * steps * h)
    return places @ along, speeds @ along, ends, places @ np.array([-s, c, 0.0])


@pytest.mark.sampled(18)
@pytest.mark.parametrize("degrees", [0, 27])
@pytest.mark.parametrize(
    ("floor", "wall"),
    [("plane", wall) for wall in WALLS] + [(floor, "box") for floor in FLOORS if floor != "plane"],
)
def test_points_that_slide_on_a_floor_rebound_from_what_stands_on_it(
    floor: str, wall: str, degrees: float
) -> None:
    """A point on the floor is in the plane of the base of a box that stands there, inside of neither: all slid under it."""
    for restitution in (0.5, 1.0):
        x, v, ends, height = against_walls(floor, wall, degrees, restitution, "velocity_verlet")
        assert np.abs(x[-1] - ends).max() < 1e-8
        assert x.max() <= 1.5 + 1e-11
        assert np.abs(height).max() < 1e-9
        assert np.all((v[-1] > 0) == (x[0] + 0.2 * v[0] < 1.5))


@pytest.mark.slow
def test_points_rebound_from_a_mesh_that_stands_on_a_floor(tmp_path: Path) -> None:
    trimesh.creation.box(BLOCK["size"]).export(tmp_path / "block.obj")
    n, h, steps = 60, 0.01, 20
    x, v = RNG.uniform(0, 1.4, n), 10 ** RNG.uniform(-0.3, 1.5, n)
    zero = np.zeros(n)
    mesh = {
        "type": "mesh",
        "path": str(tmp_path / "block.obj"),
        "origin": BLOCK["center"],
        "restitution": 0.5,
    }
    places, _ = way(
        steps,
        steps * h,
        h,
        "velocity_verlet",
        particles=[
            points(
                *np.stack([x, zero, zero], axis=1).tolist(),
                velocity=np.stack([v, zero, zero], axis=1).tolist(),
                radius=0.0,
                mass=1.0,
            )
        ],
        forces=GRAVITY,
        planes=[{"normal": [0, 1, 0], "restitution": 0.5}],
        colliders=[mesh],
    )
    after = np.maximum(steps * h - (1.5 - x) / v, 0)
    ends = np.where(after > 0, 1.5 - 0.5 * v * after, x + v * steps * h)
    assert np.abs(places[-1, :, 0] - ends).max() < 1e-8


def test_swift_points_do_not_come_under_a_box_on_their_floor() -> None:
    """They glided on for a part of a step that was too short to be looked at, to behind its side: one of 1000 at 30 km/s."""
    n, size = 20000, 3.0
    rng = np.random.default_rng(3)
    orientation = Orientation(axis=rng.normal(size=3).tolist(), angle=float(rng.uniform(0, 180)))
    axes = np.array(orientation.rotation())
    plane = PlaneCollider(normal=axes[:, 1].tolist(), restitution=0.3, tangential_loss=0.1)
    box = BoxCollider(
        center=(0.5 * axes[:, 1]).tolist(), size=(1, 1, 1), orientation=orientation, restitution=0.0
    )
    records = [each.record() for each in (plane, box)]
    shapes = closed([each.shape for each in records], size, np.dtype(float))
    records = [each._replace(shape=shape) for each, shape in zip(records, shapes, strict=True)]
    contacts = careful(continuous=records, tolerance=16 * np.finfo(float).eps, reach=size)
    zero, slope, speed = np.zeros(n), rng.uniform(-1.2, 1.2, n), 10.0 ** rng.uniform(4.38, 4.54, n)
    x = np.stack([-0.5 - 10.0 ** rng.uniform(-10, -1, n), zero, rng.uniform(-0.3, 0.3, n)], axis=1)
    v = np.stack([speed * np.cos(slope), zero, speed * np.sin(slope)], axis=1)
    c = columns(x @ axes.T, v @ axes.T, radius=0.0, method="velocity_verlet")
    gravity = Gravity(acceleration=(-G * axes[:, 1]).tolist()).record()
    run(program("velocity_verlet", (gravity,), contacts), c, 3, 0.009)
    there = position(c) @ axes
    depth = (0.5 - np.abs(there[:, [0, 2]])).min(axis=1)
    assert depth[there[:, 1] < 0.99].max() < 1e-11


def test_fast_points_on_a_tilted_floor_rebound_from_a_wall() -> None:
    """What they lay on put them back by a rounding error, out of the wall; as they approached it for ever, they stopped: one
    of 70 at 60 to 3000 m/s."""
    n, h = 1000, 0.01
    x, v = RNG.uniform(1, 1.45, n), RNG.uniform(60, 3000, n)
    degrees = 31.0
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    _, speeds = way(
        1,
        h,
        h,
        "velocity_verlet",
        particles=[
            points(*np.outer(x, along).tolist(), velocity=np.outer(v, along).tolist(), radius=0.0, mass=1.0)
        ],
        forces=[{"type": "gravity", "acceleration": [G * along[1], -G * along[0], 0]}],
        colliders=[{**turned(each, degrees), "restitution": 0.5} for each in (FLOORS["box"], WALLS["sunk"])],
    )
    assert speeds[-1] @ along == pytest.approx(-0.5 * v, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("tiles", ["boxes", "union"])
def test_points_dropped_on_the_line_where_two_boxes_touch_do_not_fall_through(tiles: str) -> None:
    n, h = 60, 0.01
    x = np.stack([np.zeros(n), RNG.uniform(0.01, 0.3, n), RNG.uniform(-1, 1, n)], axis=1)
    v = np.stack([np.zeros(n), -(10 ** RNG.uniform(-1, 4, n)), RNG.uniform(-0.1, 0.1, n)], axis=1)
    response = {"restitution": 0.0, "friction": 0.0}
    floor = [{**each, **response} for each in BOXES]
    places, speeds = way(
        1,
        60 * h,
        h,
        "velocity_verlet",
        particles=[points(*x.tolist(), velocity=v.tolist(), radius=0.0, mass=1.0)],
        forces=GRAVITY,
        colliders=floor if tiles == "boxes" else [{"type": "union", "of": BOXES, **response}],
    )
    assert np.abs(places[-1, :, 1]).max() < 1e-11
    assert np.abs(places[:, :, 0]).max() < 1e-11
    assert places[-1, :, 2] == pytest.approx(x[:, 2] + 0.6 * v[:, 2], abs=1e-9)
    assert speeds[-1, :, 2] == pytest.approx(v[:, 2], abs=2e-11)  # rounding of 10 km/s


@pytest.mark.sampled(2)
@pytest.mark.parametrize("which", ["gate", "lift"])
def test_points_rebound_from_a_gate_that_has_come_down(which: str) -> None:
    """It is 0.1 m above the floor at first, or the floor below it, and lies on it from 0.1 s on, exactly. What is there
    later rebounds."""
    n, h, steps = 60, 0.01, 100
    x = RNG.uniform(0, 1.2, n)
    v = (1.5 - x) / RNG.uniform(0.2, 1.5, n)
    zero = np.zeros(n)
    gate = {**BLOCK, "name": "gate", "center": [2, 0.35, 0] if which == "gate" else [2, 0.25, 0]}
    wide = {"type": "box", "size": [40, 1, 9], "restitution": 0.0, "name": "floor"}
    floor = {**wide, "center": [0, -0.5 if which == "gate" else -0.6, 0]}
    path = "max(y - t, 0.25)" if which == "gate" else "min(y + t, -0.5)"
    places, _ = way(
        steps,
        steps * h,
        h,
        "velocity_verlet",
        particles=[
            points(
                *np.stack([x, zero if which == "gate" else zero - 0.1, zero], axis=1).tolist(),
                velocity=np.stack([v, zero, zero], axis=1).tolist(),
                radius=0.0,
                mass=1.0,
            )
        ],
        forces=GRAVITY,
        colliders=[{**gate, "restitution": 0.5}, floor],
        motions=[{"collider": "gate" if which == "gate" else "floor", "path": ["x", path, "z"]}],
    )
    after = np.maximum(steps * h - (1.5 - x) / v, 0)
    ends = np.where(after > 0, 1.5 - 0.5 * v * after, x + v * steps * h)
    assert np.abs(places[-1, :, 1]).max() < 1e-9
    assert np.abs(places[-1, :, 0] - ends).max() < 1e-8


@pytest.mark.parametrize(("axis", "degrees"), [((0, 0, 1), 30), ((1, 2, 3), 40)])
@pytest.mark.parametrize("overlap", [0.0, 1e-3])
def test_points_slide_over_seams_of_turned_boxes(
    axis: tuple[float, float, float], degrees: float, overlap: float
) -> None:
    """Where a step ends at the seam, to rounding, a point is on the edge of the next box, whose side no one sees: it had
    been taken to lie against that, and lost its speed across the seam (20 of 40)."""
    rng = np.random.default_rng(3)
    n, h, steps = 100, 0.02, 20
    rows, base = np.array(Orientation(axis=axis, angle=degrees).rotation()), np.array([13.0, -7, 2])
    boxes: list[dict[str, Any]] = [
        {
            "type": "box",
            "center": (rows @ [k + 0.5, -0.5, 0] + base).tolist(),
            "size": [1 + overlap, 1, 4],
            "restitution": 0.5,
            "orientation": {"axis": axis, "angle": degrees},
        }
        for k in range(-1, 3)
    ]
    side, speed = np.where(np.arange(n) % 2, 1, -1), rng.uniform(0.5, 2, n)
    near = rng.choice([0.0, 0.5, 1e-12, -1e-12], n)
    x = (side > 0) - side * speed * h * (rng.integers(1, steps, n) + near)
    zero = np.zeros(n)
    start = np.stack([x, zero, rng.uniform(-1, 1, n)], axis=1) @ rows.T + base
    velocity = np.stack([side * speed, zero, zero + 0.3], axis=1) @ rows.T
    places, speeds = way(
        1,
        steps * h,
        h,
        "velocity_verlet",
        particles=[points(*start.tolist(), velocity=velocity.tolist(), radius=0.0, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": (rows @ [0, -G, 0]).tolist()}],
        colliders=boxes,
    )
    found = (places[-1] - base) @ rows
    np.testing.assert_allclose(speeds[-1], velocity, atol=1e-9)
    np.testing.assert_allclose(found[:, 0], x + side * speed * steps * h, atol=1e-10)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler"])
def test_friction_takes_the_same_on_four_boxes_as_on_one(method: str) -> None:
    """v = v₀ − μ g t. With symplectic_euler each seam had taken μ g dt/2 more: late velocities were put right as in
    flight."""
    boxes = [
        {"type": "box", "center": [k, -0.5, 0], "size": [1, 1, 1], "friction": 0.1, "restitution": 0.0}
        for k in range(4)
    ]
    x, v = way(
        100,
        1.0,
        0.01,
        method,
        particles=[points([0.0, 0.02, 0], velocity=[[3.0, 0, 0]], radius=0.02, mass=1.0)],
        forces=GRAVITY,
        colliders=boxes,
    )
    np.testing.assert_allclose(v[-1], [[3 - 0.1 * G, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(x[-1], [[3 - 0.05 * G, 0.02, 0]], atol=1e-6)
