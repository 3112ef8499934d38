"""Impacts of bodies in joints on colliders: what joints carry is part of what an impulse does, and nothing is gained."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import G, energies, table

LENGTH, WIDTH, MASS, H = 1.0, 0.1, 3.0, 2e-3
INERTIA = MASS * ((LENGTH**2 + WIDTH**2) / 12 + LENGTH**2 / 4)


def bar(name: str, length: float, hinge: tuple[float, float], angle: float) -> dict[str, Any]:
    """A bar that goes from a hinge away at an angle [rad]."""
    place = [hinge[0] + 0.5 * length * math.cos(angle), hinge[1] + 0.5 * length * math.sin(angle), 0]
    turned = {"axis": [0, 0, 1], "angle": math.degrees(angle)}
    shape = {"type": "box", "size": [length, WIDTH, WIDTH]}
    return {"name": name, "shape": shape, "mass": MASS, "position": place, "orientation": turned}


def hinge(one: str, two: str, at: tuple[float, float]) -> dict[str, Any]:
    return {"type": "hinge", "between": [one, two], "anchor": [*at, 0], "axis": [0, 0, 1]}


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("restitution", "friction", "h"),
    [(0.6, 0.0, H), (0.6, 0.3, H), (1.0, 0.0, H), (1.0, 0.3, H), (1.0, 1.0, 3e-3), (0.5, 1.0, 5e-4)],
)
def test_a_bar_falls_flush_on_the_ground_beside_its_hinge(
    restitution: float, friction: float, h: float
) -> None:
    # It comes down with ω² = 2 m g d sin θ₀ / I and goes up with e ω. The corner below the hinge comes to the ground on a
    # circle about it, and does not press. The lever there goes to zero: sweeps without joints lost 4 J, and gained 0.6 J.
    wall = {"type": "plane", "point": [0, -0.5 * WIDTH, 0], "restitution": restitution, "friction": friction}
    found = energies(
        table(
            0.54,
            h,
            bodies=[bar("bar", LENGTH, (0, 0), math.pi / 3)],
            joints=[hinge("bar", "world", (0, 0))],
            forces=[{"type": "gravity"}],
            colliders=[{"name": "ground", **wall}],
            output={"every": 1, "ledger": True},
        )
    )
    start = found[0]
    speed = math.sqrt(2 * start / INERTIA)
    # The step of the impact begins up to ω h before it, and what is potential then is left.
    left = (1 - restitution**2) * MASS * G * 0.5 * LENGTH * speed * h
    assert np.diff(found).max() < 1e-6 * start
    assert found[-1] == pytest.approx(restitution**2 * start, abs=left + 1e-4 * start)


def test_a_chain_of_bars_that_rebounds_gains_no_energy() -> None:
    # Rebounds with friction can gain, and have to yield that. What joints took of the kick of forces had been counted as
    # work of contact: 6 mJ in a step. Joints bend the ways of bodies, by a h²/8 in each half of a step, before and after:
    # so much of the work of their weight is not in the balance of an impact.
    angle, width, h = math.radians(-40.0), 0.05, H
    middle = (0.46 * math.cos(angle), 0.46 * math.sin(angle))
    found = energies(
        table(
            0.8,
            h,
            bodies=[bar("upper", 0.5, (0, 0), angle), bar("lower", 0.45, middle, angle)],
            joints=[hinge("upper", "world", (0, 0)), hinge("lower", "upper", middle)],
            forces=[{"type": "gravity"}],
            colliders=[
                {
                    "name": "ground",
                    "type": "plane",
                    "point": [0, -0.8, 0],
                    "restitution": 1.0,
                    "friction": 0.3,
                }
            ],
            output={"every": 1, "ledger": True},
        )
    )
    drop = 0.8 - width
    bend = 2 * G * drop / 0.46  # ω² r of the end that falls so far, or less
    assert found.max() - found.min() > 1.0  # it has hit, and friction has taken its part
    assert np.diff(found).max() < 2 * MASS * G * 2 * bend * h**2 / 8


def test_a_brake_gives_no_energy_to_what_rebounds() -> None:
    # What a motor turns had counted as not gaining: with a brake, and friction, contact gave 10 % of all energy in a step.
    angle, one = math.radians(30.0), 0.2 * math.cos(math.radians(30.0))
    elbow = (one, 0.5)
    start = (0.0, 0.5 - 0.2 * math.sin(angle))
    bars = [
        {"name": "one", "position": [*start, 0], "orientation": {"axis": [0, 0, 1], "angle": 30.0}},
        {"name": "two", "position": [elbow[0] + 0.2, elbow[1], 0]},
    ]
    shared = {"shape": {"type": "box", "size": [0.4, 0.08, 0.08]}, "velocity": [1, -4, 0]}
    brake = hinge("one", "two", elbow) | {"motor": {"speed": 0, "torque": 2.0}}
    found = energies(
        table(
            0.2,
            H,
            bodies=[each | shared for each in bars],
            joints=[brake],
            forces=[{"type": "gravity"}],
            colliders=[{"name": "ground", "type": "plane", "restitution": 1.0, "friction": 1.0}],
            output={"every": 1, "ledger": True},
        )
    )
    assert found[0] - found[-1] > 0.1 * found[0]
    assert np.diff(found).max() < 1e-4 * found[0]
