"""Soft grains that are so fast that they may pass through each other within a step are told; hard ones do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

R, DT = 0.005, 1e-3


def shot(speed: float, **law: Any) -> tuple[bool, list[str]]:
    """Two grains shot at each other: whether they have rebounded, and what the run tells of it."""
    grains = points((-0.1, 0, 0), (0.15, 0, 0), velocity=((speed, 0, 0), (-speed, 0, 0)), radius=R)
    found = simulate(0.3 / speed, DT, particles=[grains], interactions=[{"type": "contact", **law}])
    return found.final.velocity[0, 0] < 0, [
        text for text in found.warnings if "pass through each other" in text
    ]


SOFT = {"model": "linear", "stiffness": 1e4}


def test_grains_that_pass_through_each_other_are_told() -> None:
    rebounds, told = shot(50.0, **SOFT)
    assert not rebounds
    assert len(told) == 1
    assert "0.05 m in a step" in told[0]
    assert "dt = 0.0001 s" in told[0]


def test_slow_ones_and_hard_ones_are_not() -> None:
    assert shot(2.0, **SOFT)[1] == []
    assert shot(50.0, restitution=1) == (True, [])


def test_what_moves_together_is_not_told() -> None:
    grains = points((0, 0, 0), (0.1, 0, 0), velocity=((50.0, 0, 0), (51.0, 0, 0)), radius=R)
    found = simulate(0.01, DT, particles=[grains], interactions=[{"type": "contact", **SOFT}])
    assert not any("pass through" in text for text in found.warnings)


def test_those_that_become_fast_are_told_at_the_end() -> None:
    start = points((-0.5, 0, 0), (0.5, 0.02, 0), radius=R)
    pull = {"type": "point_spring", "stiffness": 1.6e5}
    found = simulate(
        0.02, DT / 10, particles=[start], forces=[pull], interactions=[{"type": "contact", **SOFT}]
    )
    told = [text for text in found.warnings if "pass through" in text]
    assert len(told) == 1
    assert "from t = 0.0" in told[0]


@pytest.mark.parametrize("radius", [[0.0, 0.1], [1e-30, 1e-30]])
def test_radii_of_any_size_are_looked_at(radius: list[float]) -> None:
    # In single precision squares of such sizes are 0, and those of such speeds infinite.
    pair = points((-1, 0, 0), (1, 0, 0), velocity=((1e15, 0, 0), (-1e15, 0, 0)), radius=radius)
    scenario = table(0.001, DT, particles=[pair], interactions=[{"type": "contact", **SOFT}])
    scenario["simulation"]["precision"] = "single"
    assert any("pass through each other" in text for text in ps.run(ps.from_table(scenario)).warnings)


def test_what_lies_has_no_leg_of_no_time_whose_pace_rounding_makes() -> None:
    # A thousand laps had been made of a step for it, and all swift grains looked at in each.
    r, rng = 0.003, np.random.default_rng(0)
    lie = [[x, r, z] for x in np.arange(-0.05, 0.05, 0.0065) for z in np.arange(-0.05, 0.05, 0.0065)]
    slide = np.insert(rng.normal(0, 0.05, (len(lie), 2)), 1, 0.0, axis=1)
    layout = {
        "type": "points",
        "position": [*lie, [0, 1.0, 0]],
        "velocity": [*slide.tolist(), [0, -3.0, 0]],
    }
    simulation = Simulation(
        ps.from_table(
            table(
                0.05,
                1e-3,
                "symplectic_euler",
                particles=[{"radius": r, "density": 2500.0, "layout": layout}],
                planes=[{"restitution": 0.3, "friction": 0.5}],
                forces=[{"type": "gravity"}],
                interactions=[{"type": "contact", "restitution": 0.4, "friction": 0.5}],
            )
        )
    )
    for step in range(1, 51):
        simulation.advance_to(step)
        (island,) = simulation.islands
        # None moves faster than 4 m/s, and places of 0.1 m are rounded by 10⁻¹⁷ m, which a leg of 10⁻⁹ makes 10⁻⁸ m.
        assert np.abs(island.interactions[-1].ways.go).max() < 0.1
