"""Balls, as rigid bodies, on colliders of every form: where they come to rest, and how fast they leave again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import G, energies, simulate, table

R = 0.1
CYLINDER = {"type": "cylinder", "start": [0.2, -2, 0], "end": [0.2, 2, 0]}
BOX = {"type": "box", "size": [2, 2, 2], "center": [0, -1, 0]}
SOLIDS: dict[str, tuple[dict[str, Any], float]] = {
    "rectangle": ({"type": "rectangle", "size": [2, 2], "thickness": 2e-3}, R + 1e-3),
    "disc": ({"type": "disc", "radius": 1.0, "thickness": 2e-3}, R + 1e-3),
    "height field": ({"type": "height_field", "path": "flat.npy", "size": [2, 2]}, R),
    "distance grid": (
        {"type": "distance_grid", "path": "grid.npy", "spacing": 0.1, "origin": [-1, -1, -1]},
        R,
    ),
    # in the hole of a lying ring of radius a and tube t, smaller than it: (y)² + a² = (t + R)²
    "torus": (
        {"type": "torus", "radius": 0.12, "tube": 0.06, "axis": [0, 1, 0]},
        math.sqrt((0.06 + R) ** 2 - 0.12**2),
    ),
    "union": ({"type": "union", "of": [BOX, {"type": "sphere", "radius": 0.3}]}, 0.3 + R),
    # beside the hole: edges of cuts are sharp for balls, too
    "difference": ({"type": "difference", "of": [BOX, {**CYLINDER, "radius": 0.06}]}, R),
    "sphere": ({"type": "sphere", "radius": 0.5, "inside": True}, R - 0.5),
    "box": ({"type": "box", "size": [1, 1, 1], "inside": True}, R - 0.5),
}

LEDGER = {"every": 1, "ledger": True}


@pytest.mark.sampled(9)
@pytest.mark.parametrize("solid", SOLIDS)
def test_a_ball_rests_at_the_height_of_its_contact_and_keeps_e_of_its_speed(
    solid: str, tmp_path: Path
) -> None:
    # It falls by d onto its place of rest; e of its speed is left, which is e² d of height.
    # A step knows speeds to g h, and so heights to e v h.
    shape, rest = SOLIDS[solid]
    np.save(tmp_path / "flat.npy", np.zeros((9, 9)))
    level = np.linspace(-1, 1, 21)
    np.save(tmp_path / "grid.npy", np.broadcast_to(level[None, :, None], (21, 21, 21)).copy())
    collider = {key: str(tmp_path / each) if key == "path" else each for key, each in shape.items()}
    drop, h, e = 0.05, 1e-3, 0.6
    ball = {"shape": {"type": "sphere", "radius": R}, "position": [0, rest + drop, 0]}
    parts: dict[str, Any] = {"bodies": [ball], "forces": [{"type": "gravity"}]}
    lies = simulate(0.5, h, colliders=[{**collider, "restitution": 0.0, "friction": 0.5}], **parts).final
    assert lies.position[0] == pytest.approx([0, rest, 0], abs=2e-6)
    assert np.abs(lies.velocity[0]).max() < 1e-6

    if solid == "torus":  # on all of which it lands
        return
    speed = math.sqrt(2 * G * drop)
    flight = speed / G
    up = h * round((flight + e * speed / G) / h)  # about where it turns around
    top = simulate(up, h, colliders=[{**collider, "restitution": e, "friction": 0.0}], **parts).final
    assert top.position[0, 1] - rest == pytest.approx(e**2 * drop, abs=e * speed * h)
    assert np.abs(top.position[0, [0, 2]]).max() < 1e-6


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "shape", [{"type": "sphere", "radius": R}, {"type": "capsule", "radius": R, "length": R}]
)
def test_a_ball_in_the_corner_of_a_room_rests_on_all_of_its_sides(shape: dict[str, Any]) -> None:
    # On the first of ten steps it comes to two walls and the floor, 0.3 mm away; forces press it on all of them.
    room = {"type": "box", "size": [1, 1, 1], "inside": True, "restitution": 0.0, "friction": 0.0}
    push = [{"type": "gravity"}, {"type": "gravity", "acceleration": [3.0, 0.0, 2.0]}]
    away, turned = R - 0.5 + 3e-4, {"axis": [1, 0, 0], "angle": 0}
    place = [-away, away + (0.5 * R if shape["type"] == "capsule" else 0.0), -away]
    if shape["type"] == "capsule":  # which stands on its end
        turned = {"axis": [1, 0, 0], "angle": 90}
    body = {"shape": shape, "position": place, "orientation": turned}
    result = simulate(0.5, 1e-3, bodies=[body], forces=push, colliders=[room], output=LEDGER)
    touch = 0.5 - R
    lowest = -touch + (0.5 * R if shape["type"] == "capsule" else 0.0)
    assert result.final.position[0] == pytest.approx([touch, lowest, touch], abs=2e-6)
    assert np.abs(result.final.velocity[0]).max() < 1e-9
    energies = sum(
        column for name, column in result.ledger.items() if name.startswith(("kinetic", "potential"))
    )
    assert np.diff(energies).max() < 1e-12 * np.abs(energies).max()


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize(
    "shape",
    [
        {"type": "cone", "radius": 0.06, "length": 0.12},
        {"type": "cylinder", "radius": 0.05, "length": 0.1},
        {"type": "box", "size": [0.1, 0.06, 0.14]},
    ],
    ids=lambda shape: shape["type"],
)
@pytest.mark.parametrize("seed", [1, 6])
def test_what_tumbles_over_the_edges_of_a_box_gains_no_energy(
    shape: dict[str, Any], inside: bool, seed: int
) -> None:
    # Edges cross edges: neither of the two faces beside an edge says how deep another edge is in it.
    size = [0.3, 1.2, 0.3] if inside else [0.3, 0.4, 0.3]
    block = {"type": "box", "size": size, "center": [0, 0.4 if inside else -0.4, 0], "inside": inside}
    body = {
        "shape": shape,
        "orientation": "random",
        "density": 800.0,
        "position": [0.02, 0.35, 0.01],
        "velocity": [0.15, 0, 0.1],
        "angular_velocity": [1, 2, -1.5],
    }
    collider = {**block, "restitution": 0.5, "friction": 0.4}
    result = simulate(
        1.0, 1e-3, bodies=[body], forces=[{"type": "gravity"}], colliders=[collider], output=LEDGER, seed=seed
    )
    energies = sum(np.array(result.ledger[name]) for name in ("kinetic", "potential.gravity"))
    assert np.diff(energies).max() < 1e-6 * np.ptp(energies)
    assert result.missed_crossings == 0


ROOM = {
    "type": "union",
    "inside": True,
    "of": [
        {"type": "sphere", "radius": 0.4},
        {**CYLINDER, "start": [-0.6, 0, 0], "end": [0.6, 0, 0], "radius": 0.3},
    ],
}
PIERCED = {
    "type": "difference",
    "of": [{"type": "sphere", "radius": 0.5}, {"type": "box", "size": [0.4, 2, 0.4]}],
}


@pytest.mark.parametrize(
    ("shape", "place", "speed"),
    [
        (ROOM, [0.2341, -0.2441, 0.018], [1.69, 0.69, 1.74]),
        (PIERCED, [0.01744993, 0.51156487, 0.139249], [-0.57494901, -1.49314451, 1.57937265]),
    ],
)
def test_surfaces_of_parts_do_not_push_where_they_are_none(
    shape: dict[str, Any], place: list[float], speed: list[float]
) -> None:
    # Beside the wall of one part, where that of the other one would be without it, a ball had been lifted by 4 % of its
    # depth in that in every step: by 1 % of its energy within 6 ms.
    ball = {"shape": {"type": "sphere", "radius": 0.06}, "mass": 1, "position": place, "velocity": speed}
    parts = {"bodies": [ball], "forces": [{"type": "gravity"}], "colliders": [{**shape, "restitution": 1.0}]}
    for h in (1e-3, 2.5e-4):
        found = energies(table(6e-3, h, output={"every": 1}, **parts))
        assert found == pytest.approx(np.full(len(found), found[0]), rel=1e-13)


def test_a_cylinder_meets_edges_beside_its_lowest_places() -> None:
    # The rim crosses an edge of the room's step between two of the places around it, and had come 2 mm into that before
    # one of these did; put back, it had gained 1.1·10⁻³ of the largest kinetic energy, at any dt.
    boxes = [{"type": "box", "size": [0.8, 0.8, 0.8]}, {"type": "box", "size": [1.6, 0.4, 0.4]}]
    body = {
        "shape": {"type": "cylinder", "radius": 0.05, "length": 0.1},
        "mass": 1,
        "position": [0.00283719, 0.10811129, -0.08540169],
        "velocity": [-1.95473585, 1.3580338, 0.66956186],
        "angular_velocity": [-0.53695324, 0.5811181, 0.3645724],
    }
    room = {"type": "union", "inside": True, "of": boxes, "restitution": 1.0}
    found = energies(
        table(0.3, 1e-3, output={"every": 1}, bodies=[body], forces=[{"type": "gravity"}], colliders=[room])
    )
    assert found.max() - found[0] < 1e-5 * found[0]
