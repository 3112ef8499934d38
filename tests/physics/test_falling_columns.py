"""Columns of hard grains that fall on the floor together: the blow goes through all of them within a step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, way

R = 0.01
"""The radius of all grains [m]."""
TUBE = {"type": "cylinder", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0.010066, "inside": True}
MASSES = {"equal": [1.0] * 8, "unlike": [0.3, 0.75, 0.4, 0.5, 0.7, 0.4, 7.0, 0.2]}


def fall(masses: list[float], wall: dict[str, Any], height: float, h: float, method: str) -> Any:
    """Heights and speeds in each step of a column whose grains are a hundredth of their size apart."""
    places = [(0.0, R + height + 2.02 * R * k, 0.0) for k in range(len(masses))]
    x, v = way(
        1,
        round((np.sqrt(2 * height / G) + 60 * h) / h) * h,
        h,
        method,
        particles=[points(*places, radius=R, mass=masses)],
        colliders=[wall],
        interactions=[{"type": "contact", "restitution": 0.6}],
        forces=[{"type": "gravity"}],
    )
    return x, v


@pytest.mark.sampled(96)
@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler", "rk4"])
@pytest.mark.parametrize(("height", "h"), [(0.02, 3.7e-3), (0.2, 3.7e-3), (0.1, 1e-3), (0.6, 1e-3)])
@pytest.mark.parametrize("e", [0.3, 0.9])
@pytest.mark.parametrize("kind", ["floor", "tube"])
@pytest.mark.parametrize("masses", ["equal", "unlike"])
def test_grains_that_fall_as_a_column_do_not_sink_into_each_other(
    masses: str, kind: str, e: float, height: float, h: float, method: str
) -> None:
    """A blow had gone on by one pair in each step, while all above came on by 5 to 90 % of a radius: eight grains lay as
    deep in each other as 0.2 to 1.9 radii, and were lifted out of that for nothing; in a tube two came into one place."""
    wall = ({"type": "plane"} if kind == "floor" else TUBE) | {"restitution": e}
    x, v = fall(MASSES[masses], wall, height, h, method)
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=3) + 2 * R * np.eye(8)
    # What comes nearer in a step by less than three hundredths of a diameter, or than what rests (4 g h), is left to its
    # end: in some steps, and where light grains bounce between heavy ones, that adds up to twice as much.
    left = 2 * max(0.06, 2 * G * h * h / R)
    assert (2 * R - apart.min()) / R < left
    weight = np.array(MASSES[masses])
    energy = (weight * (0.5 * (v**2).sum(2) + G * x[:, :, 1])).sum(1)
    lag = G * h / 2 * (weight * v[:, :, 1]).sum(1) if method == "symplectic_euler" else 0
    energy = energy - lag
    assert (energy - np.minimum.accumulate(energy)).max() < left * weight.sum() * G * R
