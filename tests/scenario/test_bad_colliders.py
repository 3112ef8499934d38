"""Colliders that make no sense are refused where they are stated, or told before a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from simulate import points, simulate, table

import particlesim as ps
from particlesim.compiler import uncompiled
from particlesim.engine.world import World
from particlesim.preflight.advice import advice
from particlesim.runs.first_state import doubtful, misplaced

GRAIN = {"particles": [points((0, 5, 0), name="grain", radius=0.05)]}
MIDDLE = {"of": [{"type": "sphere", "radius": 1.0}]}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "restitution above 1": ({"type": "plane", "restitution": 1.1}, "restitution"),
    "restitution below 0": ({"type": "plane", "restitution": -0.1}, "restitution"),
    "restitution of impacts": ({"type": "plane", "restitution": {"value": 2, "speed": 1}}, "value"),
    "friction": ({"type": "plane", "friction": -0.1}, "friction"),
    "kinetic friction": ({"type": "plane", "friction": {"static": 0.1, "kinetic": -1}}, "kinetic"),
    "loss": ({"type": "plane", "tangential_loss": 1.5}, "tangential_loss"),
    "no normal": ({"type": "plane", "normal": [0, 0, 0]}, "normal"),
    "no sphere": ({"type": "sphere", "radius": 0}, "radius"),
    "negative sphere": ({"type": "sphere", "radius": -1}, "radius"),
    "flat box": ({"type": "box", "size": [1, 0, 1]}, "size"),
    "no capsule": ({"type": "capsule", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0}, "radius"),
    "no cylinder": ({"type": "cylinder", "start": [0, 1, 0], "end": [0, 1, 0], "radius": 1}, "start|end"),
    "no cone": ({"type": "cone", "start": [0, 1, 0], "end": [0, 1, 0], "radius": 1}, "start|end"),
    "pointless cone": ({"type": "cone", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0}, "radius"),
    "full torus": ({"type": "torus", "radius": 1, "tube": 1}, "tube"),
    "line": ({"type": "rectangle", "size": [1, 0]}, "size"),
    "no sheet": ({"type": "disc", "radius": 1, "thickness": 0}, "thickness"),
    "no disc": ({"type": "disc", "radius": 0}, "radius"),
    "union of one": ({"type": "union", **MIDDLE}, "of"),
    "no axis": ({"type": "torus", "radius": 1, "tube": 0.1, "axis": [0, 0, 0]}, "axis"),
    "not a number": ({"type": "sphere", "radius": float("nan")}, "radius"),
    "no end": ({"type": "sphere", "radius": float("inf")}, "radius"),
    "grid of no size": ({"type": "distance_grid", "path": "a.npy", "spacing": 0}, "spacing"),
    "no stiffness": ({"type": "plane", "contact": "penalty", "stiffness": 0}, "stiffness"),
    "a word for true": ({"type": "box", "size": [1, 1, 1], "inside": "yes"}, "true or false"),
    "no time": ({"type": "plane", "detection": "discrete", "recovery": 0}, "recovery"),
}


def test_two_colliders_of_one_name_are_refused_where_they_are_named() -> None:
    """A motion had led both, as planes and other colliders share their names."""
    text = """format = 1
[simulation]
duration = 0.1
dt = 1e-3
[[particles]]
layout = { type = "points", position = [[0, 1, 0]] }
radius = 0.1
[[planes]]
name = "c"
[[colliders]]
type = "sphere"
radius = 0.1
name = "c"
"""
    with pytest.raises(ps.ScenarioError, match="two colliders are called 'c'") as caught:
        ps.loads(text)
    place = caught.value.diagnostics[0]
    assert place.span is not None
    assert (place.span.line, place.span.column) == (13, 8)


@pytest.mark.parametrize("name", REFUSED)
def test_numbers_that_no_collider_has_are_refused(name: str) -> None:
    collider, key = REFUSED[name]
    with pytest.raises(ps.ScenarioError, match=key):
        ps.from_table(table(1, 0.01, colliders=[collider], **GRAIN))


BALL, FAR_BALL = {"type": "sphere", "radius": 1.0}, {"type": "sphere", "radius": 1.0, "center": [1.9, 0, 0]}
LARGE, AWAY = {"type": "box", "size": [3, 3, 3]}, {**FAR_BALL, "center": [3, 3, 1e5]}


@pytest.mark.parametrize(
    ("kind", "of", "message"),
    [
        ("intersection", [BALL, AWAY], "a sphere and a sphere have nothing in common"),
        ("intersection", [BALL, LARGE, FAR_BALL, AWAY], "have nothing in common"),
        (
            "intersection",
            [{**LARGE, "center": [1e4, 0, 0]}, {**BALL, "center": [1e4, 2.6, 0]}],
            "nothing in common",
        ),
        ("difference", [BALL, LARGE], "nothing is left of a sphere without a box"),
        ("difference", [BALL, FAR_BALL, LARGE], "nothing is left of a sphere without a sphere and a box"),
        ("intersection", [BALL, FAR_BALL], None),
        ("intersection", [{**AWAY, "radius": 0.01}, {**AWAY, "radius": 0.02}], None),
        ("intersection", [BALL, {**BALL, "center": [2, 0, 0]}], "only touch"),  # in one point
        ("intersection", [LARGE, {**LARGE, "center": [3, 1, 0]}], "only touch"),  # in a face
        ("intersection", [BALL, {**BALL, "center": [2 - 1e-6, 0, 0]}], None),
        ("intersection", [BALL, {**BALL, "center": [2 - 1e-12, 0, 0]}], None),
        ("intersection", [LARGE, {**LARGE, "center": [3 - 1e-12, 1, 0]}], None),
        (
            "union",
            [{**BALL, "center": [k, 0, 0]} for k in range(81)],
            "must have at most 80 elements, got 81",
        ),
        (
            "difference",
            [BALL, {"type": "plane", "point": [0, 1, 0]}],
            "nothing is left of a sphere without a plane",
        ),
        ("difference", [LARGE, BALL], None),
        ("intersection", [{**BALL, "radius": 1e300}, {**BALL, "center": [1e299, 0, 0]}], None),
        ("difference", [BALL, {**BALL, "radius": 0.9999}], None),
        ("union", [BALL, AWAY], None),
    ],
)
def test_solids_with_nothing_in_them_are_refused(kind: str, of: list[Any], message: str | None) -> None:
    scenario = table(1, 0.01, colliders=[{"type": kind, "name": "block", "of": of}], **GRAIN)
    if message is None:
        ps.from_table(scenario)
        return
    with pytest.raises(ps.ScenarioError, match=message) as error:
        ps.from_table(scenario)
    (told,) = error.value.diagnostics
    assert told.path == "colliders.block.of"
    assert told.allowed


def test_a_solid_without_itself_is_refused() -> None:
    scenario = table(
        1, 0.01, colliders=[{"type": "difference", "name": "block", "of": [BALL, FAR_BALL, BALL]}]
    )
    with pytest.raises(
        ps.ScenarioError, match="nothing is left of a sphere without the same sphere"
    ) as error:
        ps.from_table(scenario)
    (told,) = error.value.diagnostics
    assert told.path == "colliders.block.of.2"
    assert told.allowed == "solids that take off a part of the first"


RING = {"type": "torus", "radius": 1, "tube": 0.2}


@pytest.mark.parametrize(
    ("kind", "of", "told"),
    [
        ("difference", [LARGE, {"type": "box", "size": [3, 4, 4]}], "a box without a box"),
        ("intersection", [RING, {**BALL, "radius": 0.8}], "the intersection of a torus and a sphere"),
        ("intersection", [RING, {**BALL, "radius": 0.8001}], None),
        ("difference", [BALL, {**BALL, "radius": 1 - 1e-8}], None),
        ("difference", [LARGE, {"type": "box", "size": [3, 4, 4], "center": [1e-3, 0, 0]}], None),
    ],
)
def test_solids_in_which_no_place_is_found_are_told(kind: str, of: list[Any], told: str | None) -> None:
    block = {"type": kind, "name": "block", "of": of}
    for colliders, name in (
        ([block], f"{kind} block"),
        ([{"type": "union", "name": "all", "of": [AWAY, {"type": kind, "of": of}]}], "union all"),
    ):
        scenario = ps.from_table(table(1, 0.01, colliders=colliders, **GRAIN))
        assert [text for text in advice(scenario) if "no place" in text] == (
            [f"{name}: no place was found in {told}: it seems to be empty, or is too thin to be met"]
            if told
            else []
        )


def test_what_takes_nothing_off_is_told() -> None:
    holes = [BALL, FAR_BALL, AWAY]
    scenario = table(1, 0.01, colliders=[{"type": "difference", "name": "block", "of": holes}], **GRAIN)
    assert [text for text in advice(ps.from_table(scenario)) if "takes nothing off" in text] == [
        "difference block: the sphere of[2] takes nothing off, as it is apart from the sphere"
    ]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("y - 0.3*sqrt(abs(x))", "0, 0, 0"),
        ("y - 0.3*sqrt(abs(x - 0.0123))", "0.0123, 0, 0"),
        ("y - 0.3*abs(x)**0.8", "0, 0, 0"),
        ("y - sqrt(max(0.25 - x**2 - z**2, 0))", ""),
        ("y - 0.3*sqrt(abs(x) + 1e-4)", None),
        ("y - sqrt(max(x, 0)*0.2 + 1e-4)", None),
        ("y - 0.3*abs(x)**1.5", None),
        ("y - 0.05*tanh(1000*x) + 0*sqrt(z*z)", None),
        ("sqrt(x**2 + y**2 + z**2) - 0.5", None),
        ("y - 0.5 + sqrt(x**2 + z**2)", None),
    ],
)
def test_formulas_that_are_infinitely_steep_are_told(text: str, place: str | None) -> None:
    ground = {"type": "formula", "name": "ground", "distance": text, "size": [2.6, 1.4, 2.6]}
    told = [
        each
        for each in advice(ps.from_table(table(1, 0.01, colliders=[ground], **GRAIN)))
        if "infinitely steep" in each
    ]
    assert len(told) == (0 if place is None else 1)
    assert place is None or f"formula ground: its formula is infinitely steep at ({place}" in told[0]


def test_walls_that_overlap_are_refused() -> None:
    low, high = {"point": [0, 1, 0]}, {"normal": [0, -2, 0], "point": [0, 0.5, 0]}
    with pytest.raises(ps.ScenarioError, match=r"overlap by 0\.5 m"):
        ps.from_table(table(1, 0.01, planes=[low, high], **GRAIN))
    with pytest.raises(ps.ScenarioError, match=r"0\.06 m apart, and particles of 'grain' 0\.1 m thick"):
        ps.from_table(table(1, 0.01, planes=[low, {**high, "point": [0, 1.06, 0]}], **GRAIN))
    # those that hold different particles may, and walls that touch are a closed door
    both = [points((0, 2, 0), name="up"), points((0, 0, 0), name="down")]
    ps.from_table(table(1, 0.01, planes=[{**low, "on": ["up"]}, {**high, "on": ["down"]}], particles=both))
    ps.from_table(table(1, 0.01, planes=[low, {**high, "point": [0, 1, 0]}], particles=both))


def test_what_finds_no_room_is_told() -> None:
    def told(*colliders: dict[str, Any]) -> str:
        # the largest of them start inside, and the smallest fits everywhere
        places = [(0, 0, 0)] * 20
        size = {"type": "uniform", "low": 0.001, "high": 0.05}
        grain = [points(*places, name="grain", radius=size)]
        with uncompiled():
            return " ".join(
                misplaced(World(ps.from_table(table(1, 1, particles=grain, colliders=colliders))))
            )

    small = {"type": "sphere", "radius": 0.04, "inside": True, "name": "shell"}
    floor, slope = {"type": "plane"}, {"type": "plane", "normal": [1, -1, 0], "point": [0, 0.07, 0]}
    assert "does not fit into sphere shell" in told(small)
    # between two planes at an angle there is some, and it comes there by their sides in turn
    assert "start inside" in told(floor, slope)
    assert "no room" not in told(floor, slope)
    box = {"type": "box", "size": [1, 1, 1], "center": [0, 0.46, 0], "inside": True}
    assert "does not fit between plane colliders.0 and box colliders.1" in told(
        {**floor, "normal": [0, -1, 0]}, box
    )


def test_what_is_doubtful_is_told(tmp_path: Any) -> None:
    found = simulate(0.1, 0.01, planes=[{"friction": {"static": 0.1, "kinetic": 0.5}}], **GRAIN)
    assert any("kinetic friction 0.5 is above static friction 0.1" in text for text in found.warnings)
    inside = [points((0, -0.2, 0), name="grain", radius=0.05)]
    found = simulate(0.1, 0.01, planes=[{}], particles=inside)
    assert any("by 0.25 m" in text for text in found.warnings)
    # a triangle without area
    ball = trimesh.creation.icosphere(subdivisions=1)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    a, b, c = faces[0]
    vertices = np.concatenate([vertices, [(vertices[a] + vertices[b]) / 2]])
    m = len(vertices) - 1
    # the middle of an edge as a corner of a flat triangle: the surface stays closed
    faces = np.concatenate([[[a, m, c], [m, b, c], [a, b, m]], faces[1:]])
    path = tmp_path / "ball.ply"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    found = simulate(0.1, 0.01, colliders=[{"type": "mesh", "path": str(path)}], **GRAIN)
    assert any("1 of its triangles has no area and is left out" in text for text in found.warnings)


def test_bodies_are_counted_in_their_group() -> None:
    """The second body of the second group is number 1, however many there are in the groups before it."""
    ball = {"shape": {"type": "sphere", "radius": 0.5}, "density": 1000}
    groups = [
        {**ball, "name": "a", "layout": {"type": "points", "position": [[10 * k, 0, 0] for k in range(3)]}},
        {**ball, "name": "b", "layout": {"type": "points", "position": [[5, 0, 0], [10, 0.6, 0]]}},
    ]
    dust = points((5, 0.1, 0), (10, 0.8, 0), name="dust", radius=0.01, mass=1e-3)
    touch = {"type": "contact", "model": "impulse", "between": ["dust", "b"]}
    scenario = table(1, 0.01, bodies=groups, particles=[dust], interactions=[touch])
    told = " ".join(doubtful(World(ps.from_table(scenario))))
    assert "body 1 of 'a' and body 1 of 'b'" in told or "body 1 of 'b' and body 1 of 'a'" in told
    assert "in body 0 of 'b' by 0.41 m" in told


def _held(walls: dict[str, Any]) -> dict[str, Any]:
    return {
        "simulation": {"duration": 0.1, "dt": 1e-3},
        "emitters": [
            {"name": "e", "rate": 100, "radius": 0.05, "shape": {"type": "point", "position": [0, 2, 0]}}
        ],
        **walls,
    }


def test_walls_without_a_common_place_are_refused() -> None:
    # Two cubes of 5 m whose centres are 10 m apart, and three planes whose allowed sides have no place in common: above the
    # third y ≤ −3 − x/5, of the second x ≤ −1 + 1.5 y and of the first x ≥ 1, so that y ≥ 4/3.
    cube = {"type": "box", "size": [5, 5, 5], "inside": True}
    planes = [
        {"point": [1, 0, 0], "normal": [1, 0, 0]},
        {"point": [-1, 0, 0], "normal": [-1, 1.5, 0]},
        {"point": [0, -3, 0], "normal": [-0.2, -1, 0]},
    ]
    for walls in ({"colliders": [cube, cube | {"center": [10, 0, 0]}]}, {"planes": planes}):
        with pytest.raises(ps.ScenarioError, match="no position is on the allowed side of all"):
            ps.from_table(_held(walls))
    # Cubes that have a slice in common, and planes any two of which leave room, are taken.
    ps.from_table(_held({"colliders": [cube, cube | {"center": [4.9, 0, 0]}]}))
    ps.from_table(_held({"planes": planes[:2]}))


SHELL = {"type": "sphere", "radius": 1, "inside": True, "name": "shell"}
BLOCK = {"type": "box", "size": [4, 4, 4]}
ROOM = [{"point": [-x, -y, -z], "normal": [x, y, z]} for k in (1, -1) for x, y, z in (np.eye(3) * k).tolist()]
SOLID_EGG = {"type": "formula", "distance": "x*x + y*y/3 + z*z - 1", "size": [3, 5, 3]}
EGG = {**SOLID_EGG, "inside": True}
NOWHERE, TOO_LARGE = "no position is on the allowed side", "no particle of 'e' fits between these walls"


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("colliders", "planes", "message"),
    [
        # a plane beyond a container, and one that leaves a cap of it 3 cm high, then 9 cm
        ([SHELL], [{"point": [0, 2, 0]}], NOWHERE),
        ([SHELL], [{"point": [0, 0.97, 0]}], TOO_LARGE),
        ([SHELL], [{"point": [0, 0.88, 0]}], None),
        # a solid that covers a container, one that fills it but for 4 cm, and for 12 cm
        ([SHELL, BLOCK], [], NOWHERE),
        ([SHELL, {"type": "sphere", "radius": 0.96}], [], TOO_LARGE),
        ([SHELL, {"type": "sphere", "radius": 0.88}], [], None),
        # six planes about a cube of 2 m, and the same solids; and four of them, that lie beside each other
        ([BLOCK], ROOM, NOWHERE),
        ([{"type": "box", "size": [1.95, 1.95, 1.95]}], ROOM, TOO_LARGE),
        ([{"type": "box", "size": [1.7, 1.7, 1.7]}], ROOM, None),
        ([{"type": "box", "size": [1, 3, 3], "center": [x, 0, 0]} for x in (-0.9, 0, 0.9)], ROOM, NOWHERE),
        # containers whose gap is no distance
        ([EGG, {"type": "box", "size": [1, 1, 1], "inside": True, "center": [9, 0, 0]}], [], NOWHERE),
        ([EGG, {"type": "box", "size": [1, 1, 1], "inside": True, "center": [1.4, 0, 0]}], [], None),
        ([{**EGG, "orientation": {"axis": [0, 0, 1], "angle": 90}}], [{"point": [0, 1.3, 0]}], NOWHERE),
        ([EGG], [{"point": [0, 1.3, 0]}], None),
        ([{"type": "union", "of": [SOLID_EGG, {"type": "sphere", "radius": 1}], "inside": True}, BLOCK], [], NOWHERE),
        ([{"type": "union", "of": [SOLID_EGG, {"type": "sphere", "radius": 2.2}], "inside": True}, BLOCK], [], None),
        # soft walls let particles in, and planes without an end leave room
        ([SHELL], [{"point": [0, 0.93, 0], "contact": "penalty", "stiffness": 1e3}], None),
        ([BLOCK], ROOM[:5], None),
    ],
)  # fmt: skip
def test_walls_that_leave_no_room_are_refused(colliders: Any, planes: Any, message: str | None) -> None:
    scenario = _held({"colliders": colliders, "planes": planes})
    if message is None:
        ps.from_table(scenario)
        return
    with pytest.raises(ps.ScenarioError, match=message):
        ps.from_table(scenario)


def test_what_fits_but_for_rounding_is_taken() -> None:
    at = (0.1, 0.2, 0.3)
    for wall in (
        {"type": "sphere", "radius": 0.05},
        {"type": "box", "size": [0.1, 0.1, 0.1]},
        {
            "type": "cylinder",
            "start": [at[0], at[1] - 0.05, at[2]],
            "end": [at[0], at[1] + 0.05, at[2]],
            "radius": 0.05,
        },
    ):
        place = {} if wall["type"] == "cylinder" else {"center": at}
        ps.from_table(_held({"colliders": [wall | place | {"inside": True}]}))
    for k in range(40):
        low = 0.05 * k
        faces = [{"point": [0, low, 0]}, {"point": [0, low + 0.1, 0], "normal": [0, -1, 0]}]
        ps.from_table(_held({"planes": faces}))


def test_walls_do_not_matter_to_what_never_moves() -> None:
    faces = [{"point": [0, 0.5, 0]}, {"point": [0, 0.1, 0], "normal": [0, -1, 0]}]
    for pinned in (True, [0]):
        grain = [points((0, 0.3, 0), name="grain", radius=0.05, pinned=pinned)]
        ps.from_table(table(1, 0.01, particles=grain, planes=faces, colliders=[{**SHELL, "radius": 0.01}]))


def test_the_walls_that_leave_no_room_are_told_and_no_others() -> None:
    others = [{"type": "sphere", "radius": 0.1, "center": [k, 0, 0]} for k in range(3)]
    with pytest.raises(ps.ScenarioError, match=NOWHERE) as caught:
        ps.from_table(_held({"colliders": [*others, SHELL], "planes": [{}, {"point": [0, 2, 0]}]}))
    text = str(caught.value)
    assert "shell" in text
    assert "planes.1" in text
    assert "planes.0" not in text
    assert "colliders.0" not in text
    with pytest.raises(
        ps.ScenarioError, match="no particle of 'e' fits into this wall: the smallest has a radius"
    ):
        ps.from_table(_held({"colliders": [{**SHELL, "radius": 0.04}]}))


def test_walls_in_files_that_leave_no_room_are_refused(tmp_path: Path) -> None:
    # known when the file is read: before the run, with the place in the scenario
    trimesh.creation.icosphere(subdivisions=2, radius=1.0).export(tmp_path / "shell.ply")
    text = """
format = 1
[simulation]
duration = 0.1
dt = 0.01
[[emitters]]
name = "e"
rate = 10
shape = { type = "point", position = [0, 0, 0] }
[[colliders]]
type = "mesh"
path = "shell.ply"
inside = true
[[colliders]]
type = "box"
size = [SIZE, SIZE, SIZE]
"""
    path = tmp_path / "a.toml"
    path.write_text(text.replace("SIZE", "1"))
    World(
        ps.load(path)
    )  # keeps the kernels that make a tree of a mesh, so that the order of tests does not matter
    for size, full in (("4", True), ("1", False)):
        path.write_text(text.replace("SIZE", size))
        with uncompiled():
            if not full:
                World(ps.load(path))
                continue
            with pytest.raises(ps.ScenarioError, match=NOWHERE) as caught:
                World(ps.load(path))
        assert {each.span.line for each in caught.value.diagnostics if each.span} == {14}


def test_a_sheet_that_is_thinner_than_places_are_exact_is_told() -> None:
    def told(precision: str, thickness: float) -> list[str]:
        sheet = {"type": "rectangle", "size": [4, 4], "thickness": thickness}
        made = table(0.1, 1e-2, colliders=[sheet], particles=[points((0, 2, 0), radius=0.0)])
        made["simulation"] |= {"precision": precision}
        made["output"] |= {"precision": "single"}
        return [each for each in doubtful(World(ps.from_table(made))) if "thick" in each]

    # numbers at 2 m are 2.4e-7 m apart, in single precision; 64 of those are 1.5e-5 m
    (sentence,) = told("single", 1e-6)
    assert "rectangle" in sentence
    assert "1.5e-05 m thick at least" in sentence
    assert told("single", 2e-5) == told("double", 1e-6) == []


AXIS = {"start": [0, 0, 0], "end": [0, 1, 0]}
SLAB = {"type": "box", "size": [4, 1e-15, 4]}
CUBE = {"type": "box", "size": [1, 1, 1]}
NEEDLE = {"type": "capsule", **AXIS, "radius": 1e-15}


@pytest.mark.parametrize(
    ("shape", "thick"),
    [
        (SLAB, "1e-15"),
        ({**SLAB, "size": [4, 1e-12, 4]}, None),
        ({"type": "cylinder", "start": [0, 0, 0], "end": [0, 1e-14, 0], "radius": 1}, "1e-14"),
        ({"type": "cone", **AXIS, "radius": 1e-15}, "2e-15"),
        (NEEDLE, "2e-15"),
        ({"type": "torus", "radius": 1, "tube": 1e-14}, "2e-14"),
        ({"type": "union", "of": [CUBE, NEEDLE]}, "2e-15"),
        ({"type": "difference", "of": [SLAB, NEEDLE]}, "1e-15"),
        ({"type": "difference", "of": [CUBE, SLAB]}, None),
        ({**SLAB, "inside": True}, None),
    ],
)
def test_solids_that_are_thinner_than_places_are_exact_are_told(
    shape: dict[str, Any], thick: str | None
) -> None:
    def told(radius: float) -> list[str]:
        grain = points((0, 2, 0), radius=radius)
        made = table(0.1, 1e-2, colliders=[{**shape, "name": "c"}], particles=[grain])
        return [each for each in doubtful(World(ps.from_table(made))) if "thick," in each]

    if thick is None:
        assert told(0.0) == []
        return
    (sentence,) = told(0.0)
    assert sentence.startswith(f"{shape['type']} c is {thick} m thick")
    assert told(0.1) == []  # balls are found by their own thickness


def cut(*of: dict[str, Any]) -> dict[str, Any]:
    return {"type": "difference", "of": list(of)}


def block(size: list[float], *center: float) -> dict[str, Any]:
    return {"type": "box", "size": size, "center": list(center or (0, 0, 0))}


RING = {"type": "torus", "center": [0, 0, 0], "axis": [0, 1, 0], "radius": 1.0, "tube": 0.5}
ROOMS = cut(block([6, 6, 6], 1, 0, 0), block([1, 1, 1], 0.5, 0, 0), block([1, 1, 1], 1.5 + 1e-5, 0, 0))
BALLS = [{"type": "sphere", "center": [0, y, 0], "radius": 1.0} for y in (0.9, -0.9)]


@pytest.mark.parametrize(
    ("shape", "single", "told"),
    [
        (cut(block([3, 1.00002, 3]), RING), False, True),  # 10 µm over the tube, steps of 50 µm
        (cut(block([3, 1.2, 3]), RING), False, False),
        (ROOMS, False, False),
        (ROOMS, True, True),
        (cut({"type": "sphere", "radius": 1.00001}, {"type": "sphere", "radius": 1.0}), True, True),
        ({"type": "intersection", "of": BALLS}, True, False),  # sharp edges are no walls
        (
            cut(block([2, 1, 2]), {"type": "cone", "start": [0, 0.6, 0], "end": [0, -0.4, 0], "radius": 0.6}),
            True,
            False,
        ),
    ],
)
def test_walls_that_parts_leave_are_told_where_they_are_too_thin(
    shape: dict[str, Any], single: bool, told: bool
) -> None:
    """Where impacts are searched in steps, and in single precision on what moves, half of all points had passed, unseen."""

    def about(radius: float) -> list[str]:
        made = table(
            0.1, 1e-2, colliders=[{**shape, "name": "c"}], particles=[points((0, 5, 0), radius=radius)]
        )
        if single:
            made["simulation"] |= {"precision": "single"}
            made["output"] |= {"precision": "single"}
            made["motions"] = [{"collider": "c", "path": ["x + 0.1*t", "y", "z"]}]
        return [each for each in doubtful(World(ps.from_table(made))) if "has a wall of" in each]

    assert len(about(0.0)) == told
    assert about(0.01) == []


def test_what_is_swift_needs_more_to_be_met_by() -> None:
    """A point at 1000 m/s had passed a box of 30 fm without a word: gaps are rounded by a part of its way, too."""

    def told(speed: float) -> bool:
        ball = points((0, 0.5, 0), radius=0.0) | {
            "layout": {"type": "points", "position": [[0, 0.5, 0]], "velocity": [[0, -speed, 0]]}
        }
        made = table(0.1, 1e-3, colliders=[{"type": "box", "size": [2, 5e-14, 2]}], particles=[ball])
        return any("thick," in each for each in doubtful(World(ps.from_table(made))))

    assert [told(speed) for speed in (0, 1, 1000)] == [False, False, True]


def test_coordinates_of_meshes_beyond_all_measure_are_refused(tmp_path: Path) -> None:
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "cube.obj")
    huge = {"type": "mesh", "path": str(tmp_path / "cube.obj"), "scale": 1e200}
    with pytest.raises(ps.ScenarioError, match="coordinates go up to 5e"):
        simulate(0.1, 1e-2, colliders=[huge], **GRAIN)


BODY = {"name": "a", "shape": {"type": "box", "size": [1, 1, 1]}}
ROD = {"type": "capsule", "name": "bar", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0.1}
HEARS = {"name": "dust", "direction": "outward", "speed": 1}
ALLOWED: dict[str, tuple[dict[str, Any], str, str]] = {
    "a list for a turn": (
        {"bodies": [BODY | {"orientation": [0, 0, 1]}]},
        "orientation",
        'axis, angle; or "random"',
    ),
    "a word for a turn": (
        {"bodies": [BODY | {"orientation": "up"}]},
        "orientation",
        'axis, angle; or "random"',
    ),
    "a number for a turn": (
        {"colliders": [SLAB | {"orientation": 30}]},
        "orientation",
        "a table with axis, angle",
    ),
    "no number": ({"planes": [{"point": [0, float("nan"), 0]}]}, "point.1", "a length, in m"),
    "two of three": ({"planes": [{"point": [0, 0]}]}, "point", "a list of 3, each one a length, in m"),
    "no normal": ({"planes": [{"normal": "up"}]}, "normal", "a list of 3, each one a number"),
    "no solid": (
        {"colliders": [{"type": "union", "of": ["a", "b"]}]},
        "of.0",
        'a table with type = "plane", "sphere"',
    ),
    "no spin": (
        {"colliders": [ROD], "motions": [{"collider": "bar", "spin": 3}]},
        "spin",
        "a table with axis, rate",
    ),
    "no way": (
        {"colliders": [ROD], "motions": [{"collider": "bar", "particles": [0], "path": ["x", "y", "t"]}]},
        "particles",
        "with on =",
    ),
    "time runs back": (
        {
            "colliders": [ROD],
            "motions": [{"collider": "bar", "waypoints": [{"time": t, "offset": [0, 0, 0]} for t in (1, 0)]}],
        },
        "waypoints.1.time",
        "a time after 1 s",
    ),
    "two masses": ({"bodies": [BODY | {"mass": 1, "density": 3}]}, "density", "one of the two"),
    "no group": ({"emitters": [HEARS | {"on_impact": {"of": ["grian"]}}]}, "of.0", "grain"),
    "no impact": (
        {"emitters": [HEARS | {"on_impact": "grain"}]},
        "on_impact",
        "a table with of, and if need be at",
    ),
    "itself": ({"emitters": [HEARS | {"on_impact": {"of": ["dust"]}}], "planes": [{}]}, "of.0", "grain"),
    "nothing to hit": (
        {"emitters": [HEARS | {"on_impact": {"of": ["grain"]}}]},
        "of",
        "planes or colliders hold back",
    ),
    "no pairs": (
        {"bodies": [BODY], "joints": [{"type": "ball", "between": ["a", "world"], "pairs": "all"}]},
        "pairs",
        "a list, each one a list of 2, each one a whole number ≥ 0",
    ),
    "thick ring": (
        {"bodies": [BODY | {"shape": {"type": "torus", "radius": 1, "tube": 2}}]},
        "tube",
        "less than 1 m",
    ),
    "one twice": (
        {"bodies": [BODY], "joints": [{"type": "ball", "on": "a", "pairs": [[0, 0]]}]},
        "pairs.0",
        "two different indices",
    ),
    "rate of impacts": (
        {"emitters": [HEARS | {"rate": 3, "on_impact": {"of": ["grain"]}}], "planes": [{}]},
        "rate",
        "count of on_impact",
    ),
    "pairs twice": (
        {"interactions": [{"type": "contact", "on": ["grain"], "between": ["grain", "grain"]}]},
        "between",
        'between = ["one", "other"]',
    ),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_what_is_refused_in_contact_is_told_with_what_is_allowed(name: str) -> None:
    parts, path, allowed = ALLOWED[name]
    with pytest.raises(ps.ScenarioError) as error:
        ps.from_table(table(1, 0.01, **{**GRAIN, **parts}))
    told = {
        each.path.rpartition(path)[1]: each for each in error.value.diagnostics if each.path.endswith(path)
    }
    assert allowed in str(told[path].allowed)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (np.zeros(5), "has 1 axis of float64"),
        (np.zeros((4, 4, 4)), "has the shape"),
        (np.zeros((1, 5)), "has the shape"),
    ],
)
def test_arrays_that_are_no_height_field_are_told_with_what_is_one(
    tmp_path: Path, numbers: Any, message: str
) -> None:
    np.save(tmp_path / "ground.npy", numbers)
    ground = {"type": "height_field", "path": str(tmp_path / "ground.npy"), "size": [1, 1]}
    with pytest.raises(ps.UsageError, match=message) as error:
        World(ps.from_table(table(1, 0.01, colliders=[ground], **GRAIN)))
    assert "two axes, [rows, columns]" in str(error.value)


def test_what_nothing_dies_of_is_told_with_what_there_is() -> None:
    lid = {"type": "sphere", "radius": 1, "name": "lid", "contact": "kill"}
    check = {"quantity": "died.ceiling", "max": 1}
    for colliders, hint in (([], "nothing here"), ([lid], "died.collider")):
        with pytest.raises(ps.ScenarioError) as error:
            ps.from_table(table(1, 0.01, colliders=colliders, checks=[check], **GRAIN))
        assert error.value.diagnostics[0].hint == f"particles die of: {hint}"


@pytest.mark.parametrize(("key", "value"), [("mass", 1e-320), ("mass", 1e308), ("density", 1e-320)])
def test_masses_of_bodies_that_no_number_inverts_are_refused(key: str, value: float) -> None:
    """The inverse of such a mass had been infinite, and places were no numbers."""
    text = f"""format = 1
[simulation]
duration = 0.1
dt = 1e-3
[[bodies]]
shape = {{ type = "box", size = [1, 1, 1] }}
{key} = {value!r}
"""
    with pytest.raises(ps.ScenarioError, match="moments of inertia from") as error:
        World(ps.loads(text))
    (told,) = error.value.diagnostics
    assert told.span is not None
    assert (told.span.line, told.span.column) == (7, len(key) + 4)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [[1e-320, 1, 1], [1e-320] * 3, [1e308] * 3])
def test_boxes_of_any_size_are_made_ready(size: list[float]) -> None:
    """A size of which no half is a number, or no multiple, had ended with a mistake of psim."""
    box = {"type": "box", "size": size, "center": [0, -1, 0]}
    doubtful(World(ps.from_table(table(1, 0.01, colliders=[box], **GRAIN))))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("distance", "size", "message"),
    [("1e200*x", 1, "no number holds the square of its slope"), ("x", 1e-320, "no slope")],
)
def test_formulas_beyond_all_numbers_are_refused(distance: str, size: float, message: str) -> None:
    ground = {"type": "formula", "distance": distance, "size": [size] * 3}
    with pytest.raises(ps.ScenarioError, match=message):
        ps.from_table(table(1, 0.01, colliders=[ground], **GRAIN))


@pytest.mark.filterwarnings("ignore:.*encountered")
def test_the_surface_of_what_no_square_holds_is_found() -> None:
    """Its triangles had been halved for ever."""
    cut = {
        "type": "difference",
        "of": [{"type": "box", "size": [1e200, 1, 1]}, {"type": "sphere", "radius": 0.1}],
    }
    (made,) = ps.from_table(table(1, 0.01, colliders=[cut], **GRAIN)).colliders
    assert len(made.triangles().faces)
