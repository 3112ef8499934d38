"""Shapes of rigid bodies: what they enclose, against closed forms, and how they stand, roll and fall."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from simulate import G, simulate, table

import particlesim as ps
from particlesim.bodies import BODY_SHAPES, BodyShape
from particlesim.bodies.clump import ClumpBody
from particlesim.bodies.mass import enclosed_by, principal
from particlesim.bodies.mesh import MeshBody, hull_volume
from particlesim.bodies.pieces import BOX, CONE, CYLINDER, HULL, SPHERE, Piece, union_of
from particlesim.bodies.shape import BallBody, BoxBody, CapsuleBody, ConeBody, CylinderBody, TorusBody
from particlesim.compiler import kernel
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.convex import separation
from particlesim.engine.rigid.pieces import pieces_of, solid_of
from particlesim.engine.simulation import Simulation

Array = NDArray[np.float64]
GRAVITY = [{"type": "gravity"}]
FLOOR = {"normal": [0, 1, 0], "friction": 0.5, "restitution": 0.0}
ROUND = [
    BallBody(radius=0.3),
    CapsuleBody(radius=0.2, length=0.7),
    CylinderBody(radius=0.2, length=0.7),
    ConeBody(radius=0.2, length=0.7),
    TorusBody(radius=0.5, tube=0.1),
]


def mesh_of(surface: Any, **other: Any) -> MeshBody:
    made = MeshBody(path="some.obj", **other)
    made.take((np.array(surface.vertices), np.array(surface.faces, np.int64)))
    return made


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.obj"
    trimesh.creation.box([0.1, 0.1, 0.1]).export(path)
    return path


# ---- what they enclose


@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: shape.type)
def test_round_shapes_enclose_what_their_closed_forms_say(shape: BodyShape) -> None:
    # Polygons with 192 corners around differ by (2π/192)²/6 = 2e-4 in area, at most twice around.
    found, expected = enclosed_by(*shape.surface(192)), shape.solid()
    assert found.volume == pytest.approx(expected.volume, rel=1e-3)
    assert found.second == pytest.approx(expected.second, abs=2e-3 * expected.second.max())
    assert np.abs(found.center).max() < 1e-12
    assert enclosed_by(*shape.skin()).volume == pytest.approx(expected.volume, rel=1e-12)
    # Turned and moved, the same lines through its pieces find it; a ring touches as a chain of capsules.
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    moved = [piece.placed(np.array([1.0, 2.0, 3.0]), turn) for piece in shape.pieces()]
    union = union_of(moved)
    rough = 5e-3 if shape.type == "torus" else 1e-4
    assert union.volume == pytest.approx(expected.volume, rel=rough)
    assert union.center == pytest.approx(np.array([1.0, 2.0, 3.0]), abs=1e-6)
    assert union.second == pytest.approx(
        turn @ expected.second @ turn.T, abs=2 * rough * expected.second.max()
    )


def test_a_mesh_has_the_mass_of_what_its_triangles_enclose() -> None:
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    brick = trimesh.creation.box([1.0, 2.0, 3.0])
    brick.vertices = brick.vertices @ turn.T + [5.0, -4.0, 7.0]
    shape = mesh_of(brick, scale=0.1)
    frame = shape.frame()
    assert shape.volume() == pytest.approx(6e-3, rel=1e-12)
    assert frame.center == pytest.approx([0.5, -0.4, 0.7], rel=1e-12)
    # the principal moments are those of the brick, and its axes are principal
    assert sorted(shape.spread()) == pytest.approx([6e-3 * a * a / 12 for a in (0.1, 0.2, 0.3)], rel=1e-9)
    assert np.abs(frame.axes.T @ turn).max(axis=0) == pytest.approx([1, 1, 1], abs=1e-9)
    assert np.linalg.det(frame.axes) == pytest.approx(1)
    ball = mesh_of(trimesh.creation.icosphere(4, 0.3))
    # An icosphere of 5120 triangles is inside of its ball: by its volume, 0.2 %.
    assert ball.volume() == pytest.approx(4 / 3 * math.pi * 0.3**3, rel=3e-3)
    assert ball.spread() == pytest.approx([4 / 15 * math.pi * 0.3**5] * 3, rel=5e-3)
    assert hull_volume(*ball.hulls()) == pytest.approx(ball.volume(), rel=1e-9)


def test_axes_that_are_principal_stay() -> None:
    spread, axes = principal(np.diag([3.0, 1.0, 2.0]))
    assert spread.tolist() == [3, 1, 2]
    assert (axes == np.eye(3)).all()
    turn = Rotation.from_rotvec([0.0, 0.1, 0.0]).as_matrix()
    spread, axes = principal(turn @ np.diag([3.0, 1.0, 1.0]) @ turn.T)
    assert spread == pytest.approx([3, 1, 1])
    assert axes[:, 0] == pytest.approx(turn[:, 0])


def test_parts_that_overlap_count_once() -> None:
    # Two balls at a distance d share a lens of π (4 r + d)(2 r − d)²/12.
    r, d = 0.1, 0.12
    parts = [{"type": "sphere", "radius": r, "offset": [x, 0, 0]} for x in (0, d)]
    clump = ClumpBody.model_validate({"parts": parts})
    lens = math.pi * (4 * r + d) * (2 * r - d) ** 2 / 12
    assert clump.volume() == pytest.approx(8 / 3 * math.pi * r**3 - lens, rel=1e-4)
    assert clump.frame().center == pytest.approx([d / 2, 0, 0], abs=1e-9)
    assert "10" in clump.remarks()[0]
    # Halves of a brick that only touch are the brick, to rounding.
    halves = [{"type": "box", "size": [0.1, 0.3, 0.2], "offset": [x, 1, 2]} for x in (0.05, 0.15)]
    brick, whole = ClumpBody.model_validate({"parts": halves}), BoxBody(size=(0.2, 0.3, 0.2))
    assert brick.volume() == pytest.approx(whole.volume(), rel=1e-14)
    assert brick.spread() == pytest.approx(whole.spread(), rel=1e-12)
    assert brick.remarks() == ()
    assert brick.reach() == pytest.approx(whole.reach())


def test_hulls_have_faces_not_triangles() -> None:
    (piece,) = mesh_of(trimesh.creation.box([0.1, 0.2, 0.3])).pieces()
    assert piece.hull is not None
    assert len(piece.hull.planes) == 6
    assert np.diff(piece.hull.first).tolist() == [4] * 6
    assert len(piece.hull.edges) == 12
    assert piece.fineness() == pytest.approx(0.05)


def test_a_hollow_mesh_is_told() -> None:
    ring = mesh_of(trimesh.creation.torus(0.3, 0.1))
    # The hole of a ring of tube r in a ring of radius a: its innermost place is r below the flat sides of the hull.
    assert "convex hull" in ring.remarks()[0]
    assert "dents 0.1 m deep" in ring.remarks()[0]
    assert mesh_of(trimesh.creation.icosphere(2)).remarks() == ()


def test_a_file_of_closed_parts_touches_with_each_of_them(tmp_path: Path) -> None:
    # An angle of two boxes, and one with a hollow: a surface with its front inwards is no part.
    boxes = [trimesh.creation.box([1.0, 0.2, 0.4]), trimesh.creation.box([0.2, 1.0, 0.4])]
    boxes[1].apply_translation([0.4, 0.601, 0])
    angle = mesh_of(trimesh.util.concatenate(boxes))
    assert [len(piece.hull.corners) for piece in angle.pieces() if piece.hull is not None] == [8, 8]
    assert angle.filled() == pytest.approx(1.0)
    assert angle.remarks() == ()
    assert angle.volume() == pytest.approx(2 * 0.08)
    hollow = trimesh.creation.box([0.5, 0.1, 0.2])
    hollow.invert()
    shell = mesh_of(trimesh.util.concatenate([boxes[0], hollow]))
    assert len(shell.pieces()) == 1
    assert shell.volume() == pytest.approx(0.08 - 0.01)
    # Convex parts that overlap count once, as they do in a clump.
    boxes[1].apply_translation([0, -0.1, 0])
    both = mesh_of(trimesh.util.concatenate(boxes))
    # One of 256 lines, at an edge, is half inside: in 1.1 m of height, at a face of 0.8 x 0.4 m.
    assert both.volume() == pytest.approx(2 * 0.08 - 0.2 * 0.099 * 0.4, abs=0.5 * 1.1 / 256 * 0.8 * 0.4)
    assert "parts share 4." in both.remarks()[0]
    boxes[1].apply_translation([0, 0.1, 0])
    # A ball lies in the angle, 0.2 m above the floor, where the convex hull of both parts would hold it up.
    trimesh.util.concatenate(boxes).export(tmp_path / "angle.obj")
    bodies = [
        {
            "name": "angle",
            "shape": {"type": "mesh", "path": str(tmp_path / "angle.obj")},
            "position": [0.2, 0.4005, 0],
        },
        {"name": "ball", "shape": {"type": "sphere", "radius": 0.1}, "position": [0, 0.3, 0]},
    ]
    end = simulate(0.2, 2e-3, bodies=bodies, forces=GRAVITY, planes=[FLOOR]).final
    assert end.position[1] == pytest.approx([0, 0.3, 0], abs=1e-4)
    assert end.position[0] == pytest.approx([0.2, 0.4005, 0], abs=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("open", "is open"),
        ("inside out", "inside out"),
        ("flat", "has an area|is open|in a plane"),
        ("back to back", "no volume"),
    ],
)
def test_meshes_that_are_no_bodies(change: str, message: str, tmp_path: Path) -> None:
    box = trimesh.creation.box([1, 1, 1])
    faces = np.array(box.faces)
    faces = {
        "open": faces[:-1],
        "inside out": faces[:, ::-1],
        "flat": faces[:2],
        "back to back": [*faces[:1], faces[0][::-1]],
    }[change]
    trimesh.Trimesh(box.vertices, faces, process=False).export(tmp_path / "bad.obj")
    shape = {"type": "mesh", "path": str(tmp_path / "bad.obj")}
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.1, bodies=[{"name": "b", "shape": shape}])


def test_triangles_without_area_are_dropped_and_told(tmp_path: Path) -> None:
    box = trimesh.creation.box([1, 1, 1])
    a, b, _ = box.faces[0]
    # A corner in the middle of an edge, with a triangle of no area on it, and the two beside it cut there.
    middle = len(box.vertices)
    vertices = np.concatenate([box.vertices, [(box.vertices[a] + box.vertices[b]) / 2]])
    rest = [face.tolist() for face in box.faces]
    other = next(f for f in rest if b in f and a in f and f[(f.index(b) + 1) % 3] == a)
    rest.remove(other)
    rest += [[b, middle, other[(other.index(a) + 1) % 3]], [middle, a, other[(other.index(a) + 1) % 3]]]
    rest.append([b, a, middle])
    trimesh.Trimesh(vertices, rest, process=False).export(tmp_path / "sliver.obj")
    shape = {"type": "mesh", "path": str(tmp_path / "sliver.obj")}
    result = simulate(
        0.1,
        0.1,
        bodies=[{"name": "b", "shape": shape, "position": [0, 5, 0]}],
        forces=GRAVITY,
        planes=[FLOOR],
    )
    assert any("1 of its triangles has no area" in text for text in result.warnings)


# ---- the least distance


@kernel
def _separation(p: Any, x: Any, r: Any, y: Any, q: Any, found: Any) -> float:
    one = solid_of(p, 0, (x[0], x[1], x[2]), (r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]))
    two = solid_of(p, 1, (y[0], y[1], y[2]), (q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8]))
    return separation(p, one, two, np.inf, found)


def boxes_apart(ha: Array, xa: Array, ra: Array, hb: Array, rb: Array) -> float:
    """The largest distance along the fifteen directions that separate two boxes, the second in the origin."""
    best = -np.inf
    for n in (*ra.T, *rb.T, *(np.cross(a, b) for a in ra.T for b in rb.T)):
        if (length := np.linalg.norm(n)) > 1e-6:
            n = n / length
            apart = abs(n @ xa) - np.abs(ra.T @ n) @ ha - np.abs(rb.T @ n) @ hb
            best = max(best, float(apart))
    return best


def test_hulls_overlap_as_deep_as_boxes_do() -> None:
    rng = np.random.default_rng(3)
    still = np.zeros(3), np.eye(3)
    cone = Piece(CONE, (1.0, 1.0, 0.0), *still)
    for trial in range(24):
        ha, hb = rng.uniform(0.05, 0.5, (2, 3))
        ra, rb = Rotation.random(2, random_state=rng).as_matrix()
        if trial % 3 == 0:
            rb = ra  # faces that are parallel
        (one,), (two,) = (mesh_of(trimesh.creation.box(2 * half)).pieces() for half in (ha, hb))
        assert one.kind == two.kind == HULL
        direction = rng.normal(size=3)
        fine = min(ha.min(), hb.min())
        depth = fine * 10 ** rng.uniform(-6, -2) * (trial % 4 > 0)
        near, far = 0.0, 10.0
        for _ in range(45):
            middle = 0.5 * (near + far)
            within = boxes_apart(ha, middle * direction, ra, hb, rb) < -depth
            near, far = (middle, far) if within else (near, middle)
        x = far * direction
        found = np.zeros((1, 9))
        pieces = pieces_of([[one], [two], [cone]])
        flat = (np.ascontiguousarray(r.reshape(9)) for r in (ra, rb))
        first, second = flat
        apart = _separation(pieces, x, first, np.zeros(3), second, found)
        assert apart == pytest.approx(boxes_apart(ha, x, ra, hb, rb), abs=1e-7 * fine)


def corners_of(piece: Piece) -> Array:
    """Places of the core of a piece whose convex hull it is; of circles 720 each."""
    a, b, _ = piece.size
    turn = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    ring = np.stack([a * np.cos(turn), a * np.sin(turn), np.zeros(720)], axis=1)
    if piece.kind == HULL:
        assert piece.hull is not None
        return piece.hull.corners
    if piece.kind == BOX:
        return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * piece.size
    if piece.kind == CYLINDER:
        return np.concatenate([ring + np.array([0, 0, b]), ring - np.array([0, 0, b])])
    if piece.kind == CONE:
        return np.concatenate([ring - np.array([0, 0, 0.25 * b]), [[0, 0, 0.75 * b]]])
    return np.array([[0, 0, b], [0, 0, -b]])  # a capsule, or for b = 0 a sphere


def width(own: Array, others: Array, ways: Array) -> Array:
    """How far a body is to be moved along directions [k, 3] to be free of another one, both given by corners."""
    return (own @ -ways.T).max(axis=0) + (others @ ways.T).max(axis=0)


def test_deep_overlaps_are_the_shortest_ways_out() -> None:
    # How far A is to be moved along n to be free of B is h_A(−n) + h_B(n) − n·x, with the support functions h. No direction
    # of many may be shorter than the way found, and along that it is as long as is said. Circles of 720 corners reach
    # 1 − cos(π/720) = 1e-5 less far.
    rng = np.random.default_rng(7)
    k = np.arange(3000) + 0.5
    polar, around = np.arccos(1 - k / 1500), math.pi * (1 + math.sqrt(5)) * k
    ways = np.stack([np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)], axis=1)
    still = np.zeros(3), np.eye(3)

    def of(kind: int) -> Piece:
        a, b, c = rng.uniform(0.05, 0.5, 3)
        if kind == HULL:
            cloud = trimesh.PointCloud(rng.normal(size=(12, 3)) * [a, b, c])
            return mesh_of(trimesh.convex.convex_hull(cloud)).pieces()[0]._replace(at=np.zeros(3))
        return Piece(kind, {BOX: (a, b, c), SPHERE: (a, 0.0, 0.0)}.get(kind, (a, b, 0.0)), *still)

    deep = 0
    pairs = [(one, two) for one in (CONE, CYLINDER, HULL) for two in range(6)]
    for trial, kinds in enumerate(4 * pairs):
        one, two = map(of, kinds)
        ra, rb = Rotation.random(2, random_state=rng).as_matrix() if trial % 3 else (np.eye(3),) * 2
        x = rng.normal(size=3) * 0.1 * (trial % 4)

        own, others = corners_of(one) @ ra.T, corners_of(two) @ rb.T - x
        found = np.zeros((1, 9))
        pieces = pieces_of([[one], [two]])
        turns = (np.ascontiguousarray(r.reshape(9)) for r in (ra, rb))
        first, second = turns
        depth = -_separation(pieces, x, first, np.zeros(3), second, found)
        if depth > 0:
            deep += 1
            assert depth == pytest.approx(width(own, others, found[:, :3])[0], abs=2e-5), (kinds, trial)
            assert depth < width(own, others, ways).min() + 2e-5, (kinds, trial)
    assert deep > 50


def test_cones_at_the_same_place_are_told_how_deep_they_are() -> None:
    # Of cones with base radius r and length l at the same place, h(n) + h(−n) is 2 r across, l along, and
    # 2 r l/√(r² + l²) along the normal of their slope, which is the least for r/l between 0 and 1/√3.
    r, length = 0.2, 0.5
    cone = {"shape": {"type": "cone", "radius": r, "length": length}}
    result = simulate(1e-3, 1e-3, bodies=[cone | {"name": "a"}, cone | {"name": "b"}])
    (told,) = (text for text in result.warnings if "start inside" in text)
    assert f"by {2 * r * length / math.hypot(r, length):.3g} m" in told


# ---- how they move


def upright(shape: dict[str, Any], height: float, **other: Any) -> dict[str, Any]:
    """A body whose z axis points upwards, a little over the floor."""
    turn = {"axis": [1, 0, 0], "angle": -90}
    return {"name": "b", "shape": shape, "position": [0, height + 0.01, 0], "orientation": turn, **other}


STANDING = [
    ({"type": "cylinder", "radius": 0.1, "length": 0.3}, 0.15),
    ({"type": "cone", "radius": 0.1, "length": 0.3}, 0.075),
    ({"type": "mesh", "path": "cube.obj"}, 0.05),
    (
        {
            "type": "clump",
            "parts": [
                {"type": "box", "size": [0.1, 0.2, 0.02]},
                {"type": "cylinder", "radius": 0.02, "length": 0.2, "offset": [0, 0, 0.11]},
            ],
        },
        None,
    ),
]


@pytest.mark.parametrize(("shape", "height"), STANDING, ids=lambda each: str(each)[:20])
def test_bodies_stand_on_planes_and_on_each_other(
    shape: dict[str, Any], height: float | None, cube: Path
) -> None:
    if shape["type"] == "mesh":
        shape = {**shape, "path": str(cube)}
    if height is None:  # the centre of mass of a slab with a post over the bottom of the slab
        slab, post = 0.1 * 0.2 * 0.02, math.pi * 0.02**2 * 0.2
        height = 0.01 + post * 0.11 / (slab + post)
    plate = {"name": "plate", "shape": {"type": "box", "size": [1, 0.1, 1]}, "position": [2, 0.05, 0]}
    above = {**upright(shape, height + 0.1), "name": "above"}
    above["position"] = [2, height + 0.11, 0]
    result = simulate(
        1.0, 2e-3, bodies=[upright(shape, height), plate, above], forces=GRAVITY, planes=[FLOOR]
    )
    final = result.final
    assert final["position"][0] == pytest.approx([0, height, 0], abs=1e-4 * height + 1e-6)
    assert final["position"][2] == pytest.approx([2, height + 0.1, 0], abs=1e-4 * height + 1e-5)
    assert np.abs(final["velocity"]).max() < 1e-6
    w, x, y, z = final["orientation"][0]
    assert [w, x, y, z] == pytest.approx([math.sqrt(0.5), -math.sqrt(0.5), 0, 0], abs=1e-4)


def test_a_ring_rolls_as_on_a_circle_and_rests_on_its_side() -> None:
    # a = g sin θ/(1 + I/(m R²)) with I = m (a² + ¾ r²) and R = a + r: it rolls on a torus, not on a polygon.
    a, r, tilt = 0.5, 0.1, math.radians(10)
    gravity = {"type": "gravity", "acceleration": [G * math.sin(tilt), -G * math.cos(tilt), 0]}
    ring = {"name": "ring", "shape": {"type": "torus", "radius": a, "tube": r}, "position": [0, a + r, 0]}
    floor = {"restitution": 0.0, "friction": 0.6}
    end = simulate(0.5, 2e-3, bodies=[ring], planes=[floor], forces=[gravity]).final
    speed = 0.5 * G * math.sin(tilt) / (1 + (a * a + 0.75 * r * r) / (a + r) ** 2)
    assert end["velocity"][0] == pytest.approx([speed, 0, 0], abs=1e-9)
    assert end["angular_velocity"][0] == pytest.approx([0, 0, -speed / (a + r)], abs=1e-9)
    # On its side it touches all around, and neither sinks nor turns, also where it leans by a hair at first.
    lying = ring | {"position": [0, r, 0], "orientation": {"axis": [1, 0, 0], "angle": 90}}
    end = simulate(0.2, 2e-3, bodies=[lying], planes=[floor], forces=[{"type": "gravity"}]).final
    assert end["position"][0] == pytest.approx([0, r, 0], abs=1e-12)
    assert np.abs(end["angular_velocity"]).max() < 1e-9


def test_a_cylinder_rolls_down_a_slope() -> None:
    # Solid cylinders roll with 2/3 g sin θ: here the floor is level and gravity leans.
    angle, r = 0.3, 0.1
    pull = [{"type": "gravity", "acceleration": [G * math.sin(angle), -G * math.cos(angle), 0]}]
    shape = {"type": "cylinder", "radius": r, "length": 0.3}
    body = {"name": "b", "shape": shape, "position": [0, r, 0]}
    final = simulate(0.5, 1e-3, bodies=[body], forces=pull, planes=[FLOOR | {"friction": 1.0}]).final
    assert final["velocity"][0, 0] == pytest.approx(2 / 3 * G * math.sin(angle) * 0.5, rel=1e-9)
    assert final["position"][0, 1] == pytest.approx(r, abs=1e-12)


def test_a_tetrahedron_comes_to_rest_on_a_face(tmp_path: Path) -> None:
    # A regular tetrahedron of edge a rests with its centre a √6/12 over the floor.
    a = 0.2
    corners = a / math.sqrt(8) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    hull = trimesh.convex.convex_hull(trimesh.PointCloud(corners))
    hull.export(tmp_path / "tetra.stl")
    body = {
        "name": "b",
        "shape": {"type": "mesh", "path": str(tmp_path / "tetra.stl")},
        "orientation": "random",
        "position": [0, 0.4, 0],
        "angular_velocity": [3, 4, 5],
    }
    final = simulate(3.0, 2e-3, bodies=[body], forces=GRAVITY, planes=[FLOOR]).final
    assert final["position"][0, 1] == pytest.approx(a * math.sqrt(6) / 12, rel=1e-4)
    assert np.abs(final["velocity"]).max() < 1e-6


def test_the_orientation_is_that_of_the_axes_of_the_file(tmp_path: Path) -> None:
    # A brick that is turned within its file: its principal axes are not those of the file.
    brick = trimesh.creation.box([0.1, 0.2, 0.4])
    turn = Rotation.from_rotvec([0.4, 0.5, -0.3])
    brick.vertices = turn.apply(brick.vertices)
    brick.export(tmp_path / "brick.ply")
    shape = {"type": "mesh", "path": str(tmp_path / "brick.ply")}
    spin = [0.3, 2.0, -1.0]
    body = {
        "name": "b",
        "shape": shape,
        "orientation": {"axis": [1, 2, 3], "angle": 40},
        "angular_velocity": spin,
    }
    start = Rotation.from_rotvec(np.deg2rad(40) * np.array([1, 2, 3]) / math.sqrt(14))
    first = simulate(
        1e-3, 1e-3, bodies=[body | {"position": [0, 5, 0]}], forces=GRAVITY, planes=[FLOOR]
    ).final
    w, x, y, z = first["orientation"][0]
    after = Rotation.from_quat([x, y, z, w]) * start.inv()
    assert after.as_rotvec() == pytest.approx(1e-3 * np.array(spin), abs=1e-5)


def test_all_shapes_are_tried_here() -> None:
    tried = {shape.type for shape in ROUND} | {"box", "mesh", "clump"}
    assert {each.model_fields["type"].default for each in BODY_SHAPES} == tried


def test_a_cone_tumbles_over_a_mesh_without_a_gain(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=1, radius=0.4).export(tmp_path / "ball.ply")
    cone = {
        "shape": {"type": "cone", "radius": 0.08, "length": 0.15},
        "position": [0.03, 0.5, 0.02],
        "velocity": [0, -2, 0],
        "orientation": {"axis": [1, 0, 1], "angle": 20},
        "angular_velocity": [2, 1, 0],
    }
    ball = {"type": "mesh", "path": str(tmp_path / "ball.ply"), "friction": 0.5, "restitution": 0.2}
    rows = simulate(
        0.3,
        5e-4,
        bodies=[cone],
        colliders=[ball],
        forces=GRAVITY,
        output={"every": 4, "ledger": True},
    ).ledger
    rise = np.diff(rows["kinetic"] + rows["potential.gravity"])
    assert rise.min() < -0.1  # it strikes
    # What has sunk in within a step, and lost that in the impact, is put back up, and has its potential energy again.
    assert rise[rise > 0].sum() < 0.003 * -rise[rise < 0].sum()


@pytest.mark.sampled(6)
@pytest.mark.parametrize("shape", [{"type": "cylinder"}, {"type": "capsule"}])
@pytest.mark.parametrize("turn", [0.0, 0.4, 4.0])
def test_a_log_lies_along_two_others(shape: dict[str, Any], turn: float) -> None:
    # Side by side and turned a little it is nearest to each of them in one place, and rests on the whole stretch.
    radius, length, h = 0.03, 0.12, 1e-3
    shape = {**shape, "radius": radius, "length": length}
    aside = 0.5 * length * math.sin(math.radians(turn))  # of its ends at most, and as far down
    high = radius + math.sqrt(4 * radius**2 - (radius - aside) ** 2) + aside + 2e-4
    lie = {"axis": [0, 1, 0], "angle": 0}
    logs = [
        {"name": name, "shape": shape, "position": [x, y, 0.0], "orientation": each, "restitution": 0.0}
        for name, x, y, each in (
            ("left", -radius, radius, lie),
            ("right", radius, radius, lie),
            ("upper", 0.0, high, {"axis": [1, 1, 0], "angle": turn}),
        )
    ]
    well = [{"point": [-x * 2 * radius, 0, 0], "normal": [x, 0, 0], "restitution": 0.0} for x in (1, -1)]
    world = Simulation(ps.from_table(table(0.5, h, bodies=logs, planes=[FLOOR, *well], forces=GRAVITY)))
    (island,) = (each for each in world.islands if isinstance(each, RigidIsland))
    deepest = 0.0
    for step in range(1, 501):
        world.advance_to(step)
        k = island._contacts
        deepest = min(deepest, k.gap[: k.number[0]].min(initial=0.0))
    world.close()
    assert deepest > -1e-4 * radius - 4 * G * h**2
    assert max(np.abs(state.velocity).max() for state in world.states) < 1e-4
