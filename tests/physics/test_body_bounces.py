"""Heights of rigid bodies that bounce off colliders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

SHAPES = {"ball": {"type": "sphere", "radius": 0.1}, "box": {"type": "box", "size": [0.2, 0.2, 0.2]}}
FLOORS: dict[str, dict[str, Any]] = {
    "plane": {"planes": [{}]},
    "block": {"colliders": [{"type": "box", "size": [2, 2, 2], "center": [0, -1, 0]}]},
    "slab": {"planes": [{"point": [0, -0.2, 0]}]},
}
SLAB = {
    "name": "slab",
    "shape": {"type": "box", "size": [2, 0.2, 2]},
    "mass": 1e9,
    "friction": 0.0,
    "position": [0, -0.1, 0],
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("drop", [0.1, 0.1027, 0.1055])
@pytest.mark.parametrize("e", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_hops_of_bodies_have_the_heights_of_their_restitution(
    shape: str, e: float, drop: float, floor: str
) -> None:
    """e²ⁿ of the first, whatever the phases of impacts. A body is known to half a kick, g h/2, where it turns around: that
    is g h²/8 of height, of which the next hops keep e². They turned around before contact as if that were the floor, and
    did not lose the part 1 − e of half a kick: the fourth hop at e = 0.5 was 25 to 57 % too high. So they did on a body that
    lies on a floor, which the kick of the step does not move."""
    h, parts = (
        1e-3,
        {name: [each | {"restitution": e} for each in made] for name, made in FLOORS[floor].items()},
    )
    body = {
        "shape": SHAPES[shape],
        "mass": 5.0,
        "friction": 0.0,
        "restitution": e,
        "position": [0, 0.1 + drop, 0],
    }
    bodies = [body] if floor != "slab" else [body, SLAB | {"restitution": e}]
    simulation = Simulation(
        ps.from_table(table(1.0, h, forces=[{"type": "gravity"}], bodies=bodies, **parts))
    )
    y, v = [], []
    for step in range(1, 1001):
        simulation.advance_to(step)
        y.append(float(simulation.states[0].x[1, 0]) - 0.1)
        v.append(float(simulation.states[0].v[1, 0]))
    simulation.close()
    up = np.array(v)
    reach, met = np.array(y) + up**2 / (2 * G), np.flatnonzero((up[1:] > 0) & (up[:-1] < 0)) + 1
    expected = drop * e ** (2 * np.arange(1, len(met) + 1))
    above = expected > 2e-4  # those below rest soon: their speed is a few times what gravity gives in a step
    assert above.sum() >= 3
    error = np.abs(reach[met] - expected)[above]
    most = G * h**2 / 8 * (1 / (1 - e**2) if e < 1 else 1)
    assert error.max() <= most
    assert min(y) >= -1e-9


@pytest.mark.parametrize("h", [5e-4, 2e-3])
def test_a_row_of_elastic_dice_hands_on_a_velocity(h: float) -> None:
    # The face of each comes exactly to the next one at the end of a step, but for rounding: its corners hit together.
    dice = {
        "name": "dice",
        "shape": {"type": "box", "size": [0.1, 0.1, 0.1]},
        "mass": 1.0,
        "restitution": 1.0,
        "friction": 0.0,
        "layout": {
            "type": "points",
            "position": [[0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]],
            "velocity": [[2, 0, 0], [0, 0, 0], [0, 0, 0]],
        },
    }
    final = simulate(0.6, h, bodies=[dice]).final
    np.testing.assert_allclose(final.velocity, [[0, 0, 0], [0, 0, 0], [2, 0, 0]], atol=1e-6)
