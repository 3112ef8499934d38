"""Creases of one shape: what lies in them slides along, and rests at the bottom."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from simulate import EPS, G, points, simulate, way

import particlesim as ps

RADIUS, RATIO = 0.04, math.sqrt(2)
SPEEDS = (1.0, -2.1, 3.0)


def slab(side: int) -> dict[str, Any]:
    """A thick board whose upper face rises by 45° to one side from the z axis."""
    x = side * (0.5 + 0.25) / RATIO
    turned = {"axis": [0, 0, 1], "angle": 45 * side}
    return {"type": "box", "center": [x, 0.25 / RATIO, 0], "size": [2, 0.5, 2], "orientation": turned}


TURNED = {"axis": [0, 0, 1], "angle": 45}
CUBE = {"type": "box", "center": [0, RATIO, 0], "size": [2, 2, 4], "orientation": TURNED}
GROOVES: dict[str, dict[str, Any]] = {
    "container": {**CUBE, "inside": True},
    "union": {"type": "union", "of": [slab(1), slab(-1)]},
    "difference": {
        "type": "difference",
        "of": [{"type": "box", "center": [0, 0.25, 0], "size": [2, 1.5, 2]}, CUBE],
    },
    "height_field": {"type": "height_field", "path": "groove.npy", "size": [2, 2]},
    "formula": {"type": "formula", "distance": "y - abs(x)", "size": [2, 2, 2]},
    "steep_formula": {"type": "formula", "distance": "min(y - x, 3*(y + x))", "size": [2, 2, 2]},
}
"""Grooves of 90° along the z axis, made of one shape each."""


def thrown(
    tmp_path: Path,
    collider: dict[str, Any],
    x: Any,
    v: Any,
    duration: float,
    gravity: tuple[float, float, float] = (0, -G, 0),
    every: int = 50,
    radius: float = RADIUS,
    integrator: str = "velocity_verlet",
    **response: float,
) -> ps.Result:
    """Balls at x with velocities v on a collider, of a file in the folder, if it has one."""
    placed = {**collider, **response}
    if "path" in placed:
        placed["path"] = str(tmp_path / placed["path"])
    return ps.run(
        ps.from_table(
            {
                "simulation": {"duration": duration, "dt": 2e-3, "integrator": integrator},
                "output": {"every": every, "precision": "double"},
                "particles": [points(*x, velocity=list(v), radius=radius, mass=1.0)],
                "forces": [{"type": "gravity", "acceleration": list(gravity)}],
                "colliders": [placed],
            }
        )
    )


@pytest.mark.sampled(36)
@pytest.mark.parametrize("friction", [0.0, 0.1])
@pytest.mark.parametrize("restitution", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("groove", GROOVES)
def test_what_lies_in_a_groove_slides_along_it(
    groove: str, restitution: float, friction: float, tmp_path: Path
) -> None:
    # Both sides press with √2/2 g per mass, and both rub. The second starts off the rows of the height field.
    np.save(tmp_path / "groove.npy", np.abs(np.linspace(-1, 1, 21))[None, :] * np.ones((21, 1)))
    starts = [(0, RATIO * RADIUS, z) for z in (0.3, -0.35, 0.1)]
    velocity = [(0, 0, v) for v in SPEEDS]
    t = 0.2
    ended = thrown(
        tmp_path, GROOVES[groove], starts, velocity, t, restitution=restitution, friction=friction
    ).final
    lost = friction * RATIO * G * t
    expected = [math.copysign(abs(v) - lost, v) for v in SPEEDS]
    along = [math.copysign(abs(v) - lost / 2, v) * t for v in SPEEDS]
    assert ended.velocity[:, 2] == pytest.approx(expected, rel=1e-9)
    assert ended.position[:, 2] - [z for *_, z in starts] == pytest.approx(along, rel=1e-9)
    assert np.abs(ended.position[:, :2] - [0, RATIO * RADIUS]).max() < 1e-12


@pytest.mark.parametrize("angle", [20, 30, 60])
def test_what_meets_the_end_of_a_groove_bounces_off_it(angle: float, tmp_path: Path) -> None:
    """Its glide ended a rounding too deep in what closes the groove, and the impact had no restitution."""
    z, x = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41), indexing="ij")
    np.save(tmp_path / "groove.npy", np.maximum(np.abs(x), z * math.tan(math.radians(angle))))
    for restitution, least, most in ((1.0, 1 - 1e-9, 1 + 1e-9), (0.5, 0.2, 0.95)):
        start, speed = [0, RATIO * RADIUS, -0.3], 2.0
        result = thrown(
            tmp_path,
            GROOVES["height_field"],
            [start],
            [(0, 0, speed)],
            0.2,
            every=10,
            restitution=restitution,
        )
        end = result.final
        energy = 0.5 * (end.velocity[0] ** 2).sum() + G * (end.position[0, 1] - start[1])
        assert end.velocity[0, 1] > 0 or end.position[0, 1] > 1.2 * start[1]
        assert least <= energy / (0.5 * speed**2) <= most


@pytest.mark.sampled(3)
@pytest.mark.parametrize("integrator", ["symplectic_euler", "velocity_verlet"])
@pytest.mark.parametrize("groove", GROOVES)
def test_points_without_a_size_are_as_fast_along_a_groove_as_free(
    groove: str, integrator: str, tmp_path: Path
) -> None:
    """Whether a point sees one side or both is rounding: that bent its way, and took all of a small speed."""
    np.save(tmp_path / "groove.npy", np.abs(np.linspace(-1, 1, 21))[None, :] * np.ones((21, 1)))
    t, pull = 0.3, 0.1 * G
    starts = [(0, 1e-3, z) for z in (-0.43, 0.0, 0.31)]
    ended = thrown(
        tmp_path,
        GROOVES[groove],
        starts,
        [(0, 0, v) for v in (0.0, -0.1, 0.9)],
        t,
        (0, -G, pull),
        radius=0.0,
        integrator=integrator,
        restitution=0.0,
    ).final
    assert ended.velocity[:, 2] == pytest.approx([v + pull * t for v in (0.0, -0.1, 0.9)], rel=1e-9)
    assert np.abs(ended.position[:, :2]).max() < 1e-12
    assert (
        np.abs(ended.velocity[:, :2]).max() < 1e-7
    )  # the normal of a crease is rounded as places are, over depths of 1e-9


@pytest.mark.parametrize("groove", GROOVES)
def test_what_slides_into_a_groove_keeps_its_speed_along_it(groove: str, tmp_path: Path) -> None:
    # What both sides take is across.
    np.save(tmp_path / "groove.npy", np.abs(np.linspace(-1, 1, 21))[None, :] * np.ones((21, 1)))
    starts = [(0.02, 0.03 + RATIO * RADIUS, z) for z in (0.3, -0.35, 0.1)]
    velocity = [(0, 0, v) for v in SPEEDS]
    ended = thrown(tmp_path, GROOVES[groove], starts, velocity, 0.2, restitution=0.0).final
    assert ended.velocity[:, 2] == pytest.approx(SPEEDS, rel=1e-9)
    assert ended.velocity[:, :2] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_what_slides_in_a_pit_comes_to_rest_at_its_bottom_alone(restitution: float, tmp_path: Path) -> None:
    # A block with a pit of four faces of 45°, their apex in the origin. Nothing but its bottom is a place to stop.
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    vertices = [(x, 1, z) for x, z in corners] + [(0, 0, 0)] + [(x, -0.5, z) for x, z in corners]
    faces = [(k, 4, (k + 1) % 4) for k in range(4)]
    faces += [f for k in range(4) for f in ((k, (k + 1) % 4, 5 + (k + 1) % 4), (k, 5 + (k + 1) % 4, 5 + k))]
    block = trimesh.Trimesh(vertices, [*faces, (5, 6, 7), (5, 7, 8)], process=False)
    block.fix_normals()
    block.export(tmp_path / "pit.stl")
    starts = [(q, abs(q) + RATIO * RADIUS, q) for q in np.linspace(-0.6, 0.6, 9)]
    starts += [(0.5, 0.8, 0.45), (-0.3, 0.7, 0.1)]
    pit = {"type": "mesh", "path": "pit.stl"}
    ended = thrown(
        tmp_path, pit, starts, [(0, 0, 0)] * len(starts), 3.0, restitution=restitution, friction=0.0
    )
    still = (ended.final.velocity == 0).all(axis=1)
    assert np.abs(ended.final.position[still] - [0, RATIO * RADIUS, 0]).max(initial=0.0) < 1e-6
    assert still.sum() > (9 if restitution == 0 else 0)
    assert np.diff(ended.energy).max() < 100 * EPS * ended.energy[0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_what_lies_in_an_inclined_groove_by_formula_slides_down(friction: float, tmp_path: Path) -> None:
    # Both sides press with √2/2 g cos θ per mass: a = g (sin θ − √2 μ cos θ).
    angle, t = math.radians(30), 0.4
    groove = {**GROOVES["formula"], "orientation": {"axis": [1, 0, 0], "angle": 30}}
    up = np.array([0, math.cos(angle), math.sin(angle)])
    down = np.array([0, -math.sin(angle), math.cos(angle)])
    start = RATIO * RADIUS * up - 0.7 * down
    ended = thrown(tmp_path, groove, [start], [-0.5 * down], t, restitution=0.0, friction=friction)
    pull, rub = G * math.sin(angle), RATIO * friction * G * math.cos(angle)
    turn = 0.5 / (pull + rub)
    speed = (pull - rub) * (t - turn)
    way = -0.7 - 0.25 * turn + speed * (t - turn) / 2
    assert ended.final.velocity[0] == pytest.approx(speed * down, abs=1e-9)
    assert ended.final.position[0] == pytest.approx(RATIO * RADIUS * up + way * down, abs=1e-9)


PITS = {"equal": "y - max(abs(x), abs(z))", "steeper": "min(y - abs(x), 2*(y - abs(z)))"}
"""Pits of four faces of 45° about the origin, by formulas."""


@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize("pit", PITS)
def test_what_slides_in_a_pit_by_formula_rests_at_its_bottom(
    pit: str, restitution: float, tmp_path: Path
) -> None:
    # It lies on all four faces, and nothing gains energy on its way there.
    collider = {"type": "formula", "distance": PITS[pit], "size": [2, 2, 2]}
    starts = [(q, abs(q) + RATIO * RADIUS, q) for q in np.linspace(-0.6, 0.6, 9)]
    starts += [(0.5, 0.8, 0.45), (-0.3, 0.7, 0.1)]
    ended = thrown(
        tmp_path, collider, starts, [(0, 0, 0)] * len(starts), 3.0, restitution=restitution, friction=0.0
    )
    x = ended.final.position
    sides = np.abs(x[:, [0, 2]])
    assert ((x[:, 1, None] - sides) / RATIO).min() > RADIUS - 1e-12
    still = (ended.final.velocity == 0).all(axis=1)
    assert np.abs(x[still] - [0, RATIO * RADIUS, 0]).max(initial=0.0) < 1e-6
    assert still.sum() > (9 if restitution == 0 else 0)
    assert np.diff(ended.energy).max() < 100 * EPS * ended.energy[0]


def test_what_slides_over_an_edge_by_formula_does_as_at_a_box(tmp_path: Path) -> None:
    # The edge at x = 0 of a formula that is no distance, which has no foot on either face there.
    table = {"type": "formula", "distance": "max(y, 3*x)", "size": [2, 2, 2]}
    box = {"type": "box", "center": [-0.5, -0.5, 0], "size": [1, 1, 2]}
    start, velocity = [(-0.2, RADIUS, 0), (-0.1, RADIUS, 0.5)], [(1.3, 0, 0), (0.2, 0, 0)]
    one, other = (thrown(tmp_path, each, start, velocity, 0.4, restitution=0.0) for each in (table, box))
    assert one.final.position == pytest.approx(other.final.position, abs=1e-9)
    assert one.final.velocity == pytest.approx(other.final.velocity, abs=1e-9)
    assert np.diff(one.energy).max() < 100 * EPS * one.energy[0]


@pytest.mark.parametrize("groove", ["union", "difference", "height_field", "formula"])
def test_what_slides_out_of_a_groove_flies_on(groove: str, tmp_path: Path) -> None:
    # The groove ends at z = 1, and the ball is fast enough to leave the rim, which it may graze.
    np.save(tmp_path / "groove.npy", np.abs(np.linspace(-1, 1, 21))[None, :] * np.ones((21, 1)))
    starts = [(0, RATIO * RADIUS, 0.437), (0, RATIO * RADIUS, -0.31)]
    t, velocity = 0.4, [(0, 0, 2.0), (0, 0, -3.0)]
    ended = thrown(tmp_path, GROOVES[groove], starts, velocity, t, restitution=0.0, friction=0.0)
    x, v = ended.final.position, ended.final.velocity
    assert x[:, 2] == pytest.approx(
        [z + w * t for (*_, z), (*_, w) in zip(starts, velocity, strict=True)], abs=2e-5
    )
    assert v[:, 2] == pytest.approx([2, -3], abs=2e-5)
    assert (x[:, 1] < RATIO * RADIUS).all()
    assert ended.energy == pytest.approx(ended.energy[0], rel=2e-5)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("groove", ["union", "formula", "mesh"])
def test_what_climbs_out_of_a_groove_falls_off_or_slides_back(groove: str, tmp_path: Path) -> None:
    # Gravity is turned by 20°, so that the groove rises towards its end at z = −1. Beyond it the ball lies on two rims, and
    # its centre is at y = √2 √(r² − s²), s beyond the end: with tan φ = tan 20°/√2 and s = r sin φ that is highest, by
    # g r (√2 cos 20° (cos φ − 1) + sin 20° sin φ).
    corners = [(-1, 1), (0, 0), (1, 1), (1, -1), (-1, -1)]
    faces = [(k, 5 + k, (k + 1) % 5) for k in range(5)] + [
        (5 + k, 5 + (k + 1) % 5, (k + 1) % 5) for k in range(5)
    ]
    ends = [(0, 1, 4), (1, 3, 4), (1, 2, 3)]
    faces += [*ends, *((5 + a, 5 + c, 5 + b) for a, b, c in ends)]
    block = trimesh.Trimesh([(x, y, z) for z in (-1, 1) for x, y in corners], faces, process=False)
    block.fix_normals()
    block.export(tmp_path / "block.stl")
    shapes = {**GROOVES, "mesh": {"type": "mesh", "path": "block.stl"}}
    lean, rise = math.radians(20), 0.5
    phi = math.atan(math.tan(lean) / RATIO)
    barrier = G * RADIUS * (RATIO * math.cos(lean) * (math.cos(phi) - 1) + math.sin(lean) * math.sin(phi))
    left = (-0.1, 0.1, 0.8, 1.8, 10.0)  # energy at the end of the groove, over that barrier
    speeds = [math.sqrt(2 * (G * math.sin(lean) * rise + each * barrier)) for each in left]
    velocity = [(0, 0, -v) for v in speeds]
    starts = [(0, RATIO * RADIUS, rise - 1)] * len(left)
    gravity = (0, -G * math.cos(lean), G * math.sin(lean))
    ended = thrown(
        tmp_path, shapes[groove], starts, velocity, 1.2, gravity, every=1, restitution=0.0, friction=0.0
    )
    x, v = ended.final.position, ended.final.velocity
    assert (x[:, 1] < 0).tolist() == [False, False, False, True, True]
    # what slides back has hardly lost anything
    energy = 0.5 * v[:3, 2] ** 2 - gravity[2] * (x[:3, 2] + 1)
    assert energy == pytest.approx([each * barrier for each in left[:3]], abs=0.02 * barrier)
    assert np.diff(ended.energy).max() < 1e-9


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("shape", ["box", "mesh"])
def test_what_rests_in_a_corner_wakes_when_forces_change(shape: str, friction: float, tmp_path: Path) -> None:
    # A step that leads nowhere is remembered until the interval ends, or the force changes: here in the midst of one, by a
    # wind that blows upwards. The same without anything remembered, as every step is an interval of its own.
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "box.stl")
    box: dict[str, Any] = {
        "box": {"type": "box", "center": [0, 0, 0], "size": [2, 2, 2], "inside": True},
        "mesh": {"type": "mesh", "path": str(tmp_path / "box.stl"), "inside": True},
    }[shape]
    starts = np.random.default_rng(3).uniform(0.7, 0.9, (20, 3)) * [1, -1, 1]
    calm, ended = [], []
    for every in (1, 300):
        for duration, found in ((0.9, calm), (1.2, ended)):
            table: dict[str, Any] = {
                "simulation": {"duration": duration, "dt": 2e-3, "integrator": "velocity_verlet"},
                "output": {"every": every, "precision": "double"},
                "particles": [points(*starts.tolist(), radius=RADIUS, mass=1.0)],
                "forces": [
                    {"type": "gravity", "acceleration": [3, -G, 2]},
                    {"type": "linear_drag", "coefficient": 4.0},
                    {"type": "field", "force": ["0", "30 if t > 1 else 0", "0"]},
                ],
                "colliders": [{**box, "restitution": 0.0, "friction": friction}],
            }
            found.append(ps.run(ps.from_table(table)).final)
    assert not calm[0].velocity.any()
    assert (ended[0].position[:, 1] > -0.95).all()
    assert ended[0].position.tobytes() == ended[1].position.tobytes()
    assert ended[0].velocity.tobytes() == ended[1].velocity.tobytes()


def glass(inner: str) -> dict[str, Any]:
    """A glass with a flat bottom, of radius 0.5."""
    room = {"type": "cylinder", "start": [0, 0, 0], "end": [0, 2, 0], "radius": 0.5}
    if inner == "container":
        return {**room, "inside": True}
    whole = {"type": "cylinder", "start": [0, -0.2, 0], "end": [0, 1, 0], "radius": 0.7}
    return {"type": "difference", "of": [whole, room]}


@pytest.mark.parametrize("friction", [0.0, 0.1])
@pytest.mark.parametrize("inner", ["container", "difference"])
def test_what_circles_in_a_glass_follows_its_rim(inner: str, friction: float, tmp_path: Path) -> None:
    # The floor presses with g, the wall with v²/ρ: v' = −μ (g + v²/ρ), of which
    # v = √(g ρ) tan(atan(v₀/√(g ρ)) − μ √(g/ρ) t). The normal of a step is that at its end: first order in dt.
    reach, t = 0.5 - RADIUS, 0.5
    ended = thrown(
        tmp_path, glass(inner), [(reach, RADIUS, 0)], [(0, 0, 1)], t, restitution=0.0, friction=friction
    )
    scale = math.sqrt(G * reach)
    speed = scale * math.tan(math.atan(1 / scale) - friction * math.sqrt(G / reach) * t) if friction else 1.0
    x, v = ended.final.position[0], ended.final.velocity[0]
    assert np.linalg.norm(v) == pytest.approx(speed, abs=1e-12 if friction == 0 else 2e-4)
    assert np.hypot(x[0], x[2]) == pytest.approx(reach, abs=1e-12)
    assert x[1] == pytest.approx(RADIUS, abs=1e-12)
    assert v[1] == 0
    if friction == 0:
        assert math.atan2(x[2], x[0]) == pytest.approx(t / reach, rel=1e-4)
    assert np.diff(ended.energy).max() < 1e-12


ROCKS = [
    [0.787, 0.192, 0.802, 0.191, 0.082, 0.855],
    [0.639, 0.805, 0.964, 0.151, 0.482, 0.895],
    [0.212, 0.831, 0.063, 0.825, 0.165, 0.375],
    [0.725, 0.654, 0.431, 0.867, 0.632, 0.810],
    [0.129, 0.376, 0.421, 0.665, 0.456, 0.587],
    [0.577, 0.972, 0.775, 0.791, 0.759, 0.597],
]
"""Heights drawn at random."""


@pytest.mark.parametrize("duration", [0.05, 0.06, 0.08])
def test_a_ball_in_a_pit_of_three_faces_rests(duration: float, tmp_path: Path) -> None:
    # Faces of different slopes, of which only the nearest is known at a time. It had hopped from one to another for ever,
    # at up to a fifth of g h, with a thousand impacts in some steps.
    np.save(tmp_path / "rocks.npy", np.array(ROCKS))
    rocks = {"type": "height_field", "path": str(tmp_path / "rocks.npy"), "size": [0.2, 0.2], "height": 0.1}
    ball = points((-0.020761, 0.03788, -0.013176), radius=0.015, mass=1.0)
    ended = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": duration, "dt": 1e-3},
                "output": {"every": 5, "precision": "double"},
                "particles": [ball],
                "forces": [{"type": "gravity"}],
                "colliders": [{**rocks, "restitution": 0.5, "friction": 0.0}],
            }
        )
    ).final
    assert (ended.velocity == 0).all()
    assert ended.position[0] == pytest.approx([-0.0207593, 0.0378813, -0.0131747], abs=1e-6)


def test_a_ball_that_slides_down_a_groove_keeps_to_its_bottom(tmp_path: Path) -> None:
    # With a method of first order it had come nearer to the other side by ever smaller parts of a step, a thousand in each,
    # and had gone on beside the bottom, at 2 mm/s. It reaches that in a step: 6e-7 m at g/4 take 0.7 ms.
    along = np.linspace(0, 1, 41)
    np.save(tmp_path / "groove.npy", np.abs(along - 0.5)[None, :] + 0.5 * along[:, None])
    groove = {"type": "height_field", "path": str(tmp_path / "groove.npy"), "size": [2, 2], "height": 1}
    off = 6.42285632e-07
    velocity = [(2000 * off, -0.154569774, -0.618022181)]
    ball = points((off, 0.396776905 + off, 0.128850177), velocity=velocity, radius=0.1, mass=1.0)
    ended = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": 0.006, "dt": 1e-3, "integrator": "symplectic_euler"},
                "output": {"every": 6, "precision": "double"},
                "particles": [ball],
                "forces": [{"type": "gravity"}],
                "interactions": [{"type": "contact", "restitution": 0.5, "friction": 0.3}],
                "colliders": [{**groove, "restitution": 0.5, "friction": 0.3}],
            }
        )
    ).final
    assert np.abs(ended.position[0, 0]) < 1e-10
    assert np.abs(ended.velocity[0, 0]) < 1e-7  # as above


PILLARS = {
    "cylinder": {"type": "cylinder", "start": [0, -0.5, 0], "end": [0, 0.4, 0], "radius": 0.3},
    "capsule": {"type": "capsule", "start": [0, -0.5, 0], "end": [0, 0.4, 0], "radius": 0.3},
}


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("pillar", PILLARS)
def test_what_slides_on_the_floor_of_a_room_glances_off_a_pillar(pillar: str, restitution: float) -> None:
    """At a distance b from its axis, s = b/(R + r): v √(s² + e² (1 − s²)) are left. Two places on the pillar and the floor
    had been taken for the three parts of a pit, and 98 % of all balls had stopped for good."""
    n, h, r = 40, 0.05, 0.02
    rng = np.random.default_rng(8)
    b = rng.uniform(0.02, 0.2, n)
    places = np.stack([-1 + rng.uniform(0, 0.3, n), np.full(n, r), b], axis=1)
    _, speeds = way(
        20,
        20 * h,
        h,
        "velocity_verlet",
        particles=[points(*places.tolist(), velocity=[[1.0, 0, 0]] * n, radius=r, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        colliders=[
            {**PILLARS[pillar], "restitution": restitution},
            {"type": "box", "center": [0, 2.5, 0], "size": [20, 5, 20], "inside": True, "restitution": 0.0},
        ],
    )
    s = b / (0.3 + r)
    left = np.sqrt(s**2 + restitution**2 * (1 - s**2))
    np.testing.assert_allclose(np.linalg.norm(speeds[-1], axis=1), left, rtol=1e-6)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("floor", ["first", "last"])
def test_a_bead_that_is_pressed_to_a_pillar_slides_around_it_with_its_energy(floor: str) -> None:
    """Whichever the file names first. The lift out of the pillar had been paid by the fall into the floor, too, which ends
    there anyhow: 0.14 % of the energy were gained."""
    g = np.array([G, -G, 0])
    pillar = {
        "type": "cylinder",
        "start": [0, -0.5, 0],
        "end": [0, 0.5, 0],
        "radius": 0.5,
        "restitution": 0.5,
    }
    ground = {"type": "plane", "restitution": 0.5}
    x, v = way(
        1,
        0.5,
        0.02,
        "velocity_verlet",
        particles=[points([-0.51740216, 0.02, 0.05191337], radius=0.02, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": g.tolist()}],
        colliders=[ground, pillar] if floor == "first" else [pillar, ground],
    )
    energy = (v[:, 0] ** 2).sum(-1) / 2 - x[:, 0] @ g
    assert np.linalg.norm(v[-1]) > 0.9
    np.testing.assert_allclose(energy, energy[0], atol=1e-11)


FLOOR = {"type": "box", "center": [0, -1, 0], "size": [6, 1, 6]}
WALL = {"type": "box", "center": [0, 0, -1], "size": [6, 6, 1]}
ROOM = {"type": "box", "size": [1, 1, 1]}
ROOMS: dict[str, dict[str, Any]] = {
    "container": {**ROOM, "inside": True},
    "union": {"type": "union", "of": [FLOOR, WALL]},
    "difference": {"type": "difference", "of": [{**ROOM, "size": [2, 2, 2]}, ROOM]},
    "formula": {"type": "formula", "distance": "min(y + 0.5, z + 0.5)", "size": [3, 3, 3]},
    "moving": {**ROOM, "inside": True, "name": "room"},
}
"""Rooms with a floor at y = -0.5 m and a wall at z = -0.5 m, each of one shape."""


@pytest.mark.sampled(30)
@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize(("radius", "touches"), [(0.0, False), (0.1, False), (0.1, True)])
@pytest.mark.parametrize("e", [0.3, 1.0])
def test_what_slides_on_one_side_of_a_shape_rebounds_from_another(
    room: str, radius: float, touches: bool, e: float
) -> None:
    # Rest on the floor does not swallow the impact at the wall, as it had: v_z' = -e v_z, and v_x stays.
    tables: dict[str, Any] = {"colliders": [{**ROOMS[room], "restitution": e}]}
    if room == "moving":
        tables["motions"] = [{"collider": "room", "path": ["x + 0.5*t", "y", "z"]}]
    if touches:
        tables["interactions"] = [{"type": "contact", "model": "impulse"}]
    grain = points((0, -0.5 + radius, -0.3), velocity=[(1, 0, -3.5)], radius=radius, mass=1.0)
    gravity = {"type": "gravity", "acceleration": [0, -G, 0]}
    final = simulate(0.08, 1e-3, particles=[grain], forces=[gravity], **tables).final
    hit = (0.2 - radius) / 3.5
    place = [0.08, -0.5 + radius, -0.5 + radius + 3.5 * e * (0.08 - hit)]
    assert final.velocity[0] == pytest.approx([1, 0, 3.5 * e], abs=1e-9)
    assert final.position[0] == pytest.approx(place, abs=1e-9)


def test_balls_that_turn_back_at_the_edge_of_a_box_on_their_floor_stop_no_higher_than_they_come_from() -> (
    None
):
    """Put back on the rounded edge, they stopped where they had not the energy to be: 2·10⁻⁶ J/kg above."""
    rng, n, radius, h = np.random.default_rng(5), 400, 0.05, 0.0093
    turn, corner, gap = rng.uniform(0, np.pi / 2, n), rng.integers(0, 4, n), rng.uniform(0, 0.002, n)
    x = np.array([1, -1, -1, 1])[corner] * (0.3 + (radius + gap) * np.cos(turn))
    z = np.array([1, 1, -1, -1])[corner] * (0.3 + (radius + gap) * np.sin(turn))
    places = np.stack([x, np.full(n, radius), z], axis=1)
    velocity = rng.uniform(-0.2, 0.2, (n, 3)) * (1, 0, 1)
    pull = (0.8, -28.7, -8.6)
    places, speeds = way(
        1,
        20 * h,
        h,
        "velocity_verlet",
        particles=[points(*places.tolist(), velocity=velocity.tolist(), radius=radius)],
        forces=[{"type": "gravity", "acceleration": list(pull)}],
        planes=[{"restitution": 0.0}],
        colliders=[{"type": "box", "center": [0, 0.3, 0], "size": [0.6, 0.6, 0.6], "restitution": 0.0}],
    )
    energy = 0.5 * (speeds**2).sum(axis=-1) - places @ np.array(pull)
    assert np.diff(energy, axis=0).max() < 1e-12
