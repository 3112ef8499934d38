"""The triangles of what is put together, which pictures show and by which psim tells where balls meet too early."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from particlesim.colliders.combination import (
    DifferenceCollider,
    IntersectionCollider,
    UnionCollider,
    distances_from_surface,
)
from particlesim.colliders.triangulation import Triangles

COLLIDERS = {"difference": DifferenceCollider, "intersection": IntersectionCollider, "union": UnionCollider}


def box(center: list[float], size: list[float]) -> dict[str, Any]:
    return {"type": "box", "center": center, "size": size}


def house(wall: float) -> list[dict[str, Any]]:
    """A box with three rooms side by side, and walls of a thickness [m]."""
    rooms = [box([k * (1 + wall), 0, 0], [1, 1, 1]) for k in (-1, 0, 1)]
    return [box([0, 0, 0], [3 + 4 * wall, 1 + 2 * wall, 1 + 2 * wall]), *rooms]


def surface_of(kind: str, of: list[dict[str, Any]]) -> Triangles:
    return COLLIDERS[kind].model_validate({"type": kind, "of": of}).triangles()


def area_and_volume(surface: Triangles) -> tuple[float, float]:
    t: NDArray[np.float64] = surface.corners[surface.faces]
    front = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return float(0.5 * np.linalg.norm(front, axis=1).sum()), float(np.einsum("ij,ij->", t[:, 0], front) / 6)


@pytest.mark.parametrize("wall", [1e-3, 0.01, 0.1])
def test_flat_walls_near_each_other_stay_whole(wall: float) -> None:
    """They had been divided until no edge was longer than a 128th of the house: 1.3 million triangles, for which a run with
    balls waited 50 s."""
    surface = surface_of("difference", house(wall))
    a, b = 3 + 4 * wall, 1 + 2 * wall
    assert len(surface.faces) < 500
    np.testing.assert_allclose(
        area_and_volume(surface), [4 * a * b + 2 * b * b + 18, a * b * b - 3], rtol=1e-12
    )


@pytest.mark.parametrize("wall", [0.02, 0.2])
def test_shells_are_no_finer_than_their_edges_need(wall: float) -> None:
    pair = [box([0, 0, 0], [1, 1, 1]), box([0.6, 0.2, 0.1], [1, 1, 1])]
    shells = [box(each["center"], [1 + 2 * wall] * 3) for each in pair]
    outer = surface_of("difference", [{"type": "union", "of": shells}, *pair])
    assert len(outer.faces) < 30_000

    def both(size: float) -> float:
        return 2 * size**3 - (size - 0.6) * (size - 0.2) * (size - 0.1)

    assert area_and_volume(outer)[1] == pytest.approx(both(1 + 2 * wall) - both(1), rel=0.01)


def test_faces_that_lie_on_each_other_are_seen_once() -> None:
    """They had been left out of both, so that the ceiling of two rooms of one height had a hole."""
    side_by_side = [box([0, 0, 0], [2, 1, 1]), box([0.8, 0, 0.5], [1, 1, 2])]
    corner = surface_of("difference", [box([0, 0, 0], [9, 9, 9]), {"type": "union", "of": side_by_side}])
    overlap = 0.7 * 1  # in plan
    plan, around = 2 + 2 - overlap, 2 * (2 + 1) + 2 * (1 + 2) - 2 * (0.7 + 1)
    area, volume = area_and_volume(corner)
    assert volume == pytest.approx(9**3 - plan, rel=1e-4)
    assert area == pytest.approx(6 * 81 + 2 * plan + around, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "of", "volume"),
    [
        ("intersection", [box([0, 0, 0], [2, 1, 1]), box([0.5, 0, 0], [2, 1, 1])], 1.5),
        ("intersection", [box([0, 0, 0], [1, 1, 1]), box([0, 0, 0], [1, 1, 1])], 1.0),
        ("difference", [box([0, 0, 0], [2, 1, 2]), box([0, 0.3, 0], [1, 0.4, 1])], 3.6),  # an open tray
        ("difference", [box([0, 0, 0], [1, 1, 1]), box([0.9, 0, 0], [1, 1, 1])], 0.9),
    ],
)
def test_flush_faces_leave_no_holes(kind: str, of: list[dict[str, Any]], volume: float) -> None:
    assert area_and_volume(surface_of(kind, of))[1] == pytest.approx(volume, rel=1e-3)


def test_distances_to_a_surface_are_those_to_its_nearest_triangle() -> None:
    from trimesh.triangles import closest_point

    surface = surface_of("difference", [{"type": "sphere", "radius": 1.0}, box([0, 1, 0], [3, 1, 3])])
    places = np.random.default_rng(1).normal(0, 1, (20, 3))
    corners = surface.corners[surface.faces]
    for x, d in zip(places, distances_from_surface(surface, places), strict=True):
        near = closest_point(corners, np.broadcast_to(x, (len(corners), 3)))  # type: ignore[no-untyped-call]
        assert d == np.linalg.norm(near - x, axis=1).min()
