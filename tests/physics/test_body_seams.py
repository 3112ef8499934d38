"""Rigid bodies go on over faces of colliders that lie flush, as over one, and still meet what is in their way."""

from __future__ import annotations

import math
from typing import Any

import pytest
from simulate import G, simulate

H, R = 1e-3, 0.1
FAR = ([100.0, -0.5, 0.0], [1.0, 1.0, 1.0])
"""Centre and size of a box that nothing comes to: all scenes have four, and share kernels."""
TILES = [([0.5 * k - 0.5, -0.5, 0.0], [0.5, 1.0, 8.0]) for k in range(4)]
"""Tops from x = −0.75 to 1.25 m."""


def side_by_side(overlap: float = 0.0, width: float = 80.0) -> list[Any]:
    """Two boxes with their tops at y = 0, with the seam at x = 0."""
    size = width + overlap
    return [([-width / 2, -0.5, 0.0], [size, 1.0, 80.0]), ([width / 2, -0.5, 0.0], [size, 1.0, 80.0])]


def run(
    boxes: list[Any], body: dict[str, Any], duration: float, dt: float = H, e: float = 0.0, mu: float = 0.0
) -> Any:
    """Place and velocity of a body after a time, and its greatest height."""
    boxes = [*boxes, *[FAR] * (4 - len(boxes))]
    result = simulate(
        duration,
        dt,
        bodies=[{"name": "body", "mass": 1.0, "friction": mu, "restitution": e, **body}],
        forces=[{"type": "gravity"}],
        colliders=[
            {
                "type": "box",
                "name": f"b{k}",
                "center": c,
                "size": size,
                "friction": mu,
                "restitution": e,
            }
            for k, (c, size) in enumerate(boxes)
        ],
    )
    return result.final


def block(x: float, speed: float, angle: float = 0.0) -> dict[str, Any]:
    a = math.radians(angle)
    return {
        "shape": {"type": "box", "size": [0.2, 0.2, 0.2]},
        "position": [x * math.cos(a), 0.1, x * math.sin(a)],
        "velocity": [speed * math.cos(a), 0.0, speed * math.sin(a)],
    }


def ball(x: Any, v: Any) -> dict[str, Any]:
    return {"shape": {"type": "sphere", "radius": R}, "position": x, "velocity": v}


@pytest.mark.parametrize("angle", [0.0, 30.0, 80.0])
@pytest.mark.parametrize("overlap", [0.0, 0.3])
@pytest.mark.parametrize(("x", "speed"), [(-0.15, 0.5), (-0.5, 3.0)])
def test_a_block_slides_over_a_seam(x: float, speed: float, overlap: float, angle: float) -> None:
    """As far as friction lets it, v²/(2 μ g), and without friction for good. It had tumbled, or stopped.

    A step ends up to h v/2 beyond or short of where the speed would be zero."""
    mu = 0.1
    way = speed * speed / (2 * mu * G)
    got = run(side_by_side(overlap), block(x, speed, angle), math.ceil(10 * speed / (mu * G)) / 10, mu=mu)
    place = got.position[0]
    assert math.hypot(place[0], place[2]) == pytest.approx(abs(x + way), abs=1e-3 * way)
    assert abs(place[1] - 0.1) < 1e-4
    assert abs(got.orientation[0, 0]) == pytest.approx(1, abs=1e-6)
    got = run(side_by_side(overlap), block(x, speed, angle), 0.6)
    assert math.hypot(got.velocity[0, 0], got.velocity[0, 2]) == pytest.approx(speed, rel=1e-6)
