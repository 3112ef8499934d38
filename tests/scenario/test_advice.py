"""Doubtful choices are told, others are not."""

from __future__ import annotations

from typing import Any

import pytest

import particlesim as ps
from particlesim.advice import advice


def table(method: str, force: dict[str, Any], **plane: Any) -> dict[str, Any]:
    """A ball over a plane."""
    return {
        "simulation": {"duration": 1.0, "dt": 0.01, "integrator": method},
        "particles": [{"layout": {"type": "points", "position": [[0, 1, 0]]}, "radius": 0.1}],
        "forces": [force],
        "planes": [plane],
    }


@pytest.mark.parametrize(
    ("method", "force", "told"),
    [
        ("velocity_verlet", {"type": "drag", "fluid": "air"}, True),
        ("yoshida4", {"type": "field", "force": ["-vx", "0", "0"]}, True),
        ("velocity_verlet", {"type": "gravity"}, False),
        ("symplectic_euler", {"type": "drag", "fluid": "air"}, False),  # first order anyway
        ("rk4", {"type": "drag", "fluid": "air"}, False),
    ],
)
def test_order_lost_to_velocity(method: str, force: dict[str, Any], told: bool) -> None:
    said = advice(ps.from_table(table(method, force)))
    assert any("only first order" in line for line in said) is told


def test_lively_projection() -> None:
    gravity = {"type": "gravity"}
    lively = advice(ps.from_table(table("rk4", gravity, restitution=1.0, detection="discrete")))
    assert any("can add energy" in line for line in lively)
    assert advice(ps.from_table(table("rk4", gravity, restitution=0.5, detection="discrete"))) == ()
    assert advice(ps.from_table(table("rk4", gravity, restitution=1.0))) == ()
