"""Floors of tiles: what slides over a seam between two of them goes on as on one floor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import G, points, way

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
