"""Elastic hard grains that begin at rest on each other stay there: their hops do not end, but they have none."""

from __future__ import annotations

import numpy as np
import pytest
from simulate import points, table

import particlesim as ps

R = 0.01
"""Radius [m]."""


@pytest.mark.sampled(48)
@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler", "rk4", "stormer_verlet"])
@pytest.mark.parametrize("upper", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("floor", [0.0, 1.0])
@pytest.mark.parametrize("dt", [1e-3, 1e-4])
def test_two_grains_on_each_other_stay(method: str, upper: float, floor: float, dt: float) -> None:
    """The upper one had been thrown up at 2 mm/s, and the run stopped: the lower one was moved up by impulses, against a
    weight that the floor had taken up before, and that was not counted."""
    run = ps.run(
        ps.from_table(
            table(
                200 * dt,
                dt,
                method,
                particles=[points([0, R, 0], [0, 3 * R, 0], mass=[1.0, upper], radius=R)],
                forces=[{"type": "gravity"}],
                planes=[{"restitution": floor}],
                interactions=[{"type": "contact", "model": "impulse"}],
                output={"every": 1},
            )
        )
    )
    np.testing.assert_allclose(run.final["position"][:, 1], [R, 3 * R], atol=1e-4 * R)
    assert np.abs(run.final["velocity"]).max() < 1e-3 * 9.81 * dt
    assert run.energy.max() - run.energy[0] < 1e-4 * R * 9.81 * (1 + upper)


def test_a_lift_within_what_contacts_leave_is_no_gain() -> None:
    """A light grain that topples off another one is lifted by 10 nm while it hardly moves: the run had been stopped."""
    grains = points([0, R, 0], [1e-4, 3 * R, 0], mass=[1.0, 0.1], radius=R)
    run = ps.run(
        ps.from_table(
            table(
                0.3,
                1e-3,
                "velocity_verlet",
                particles=[grains],
                forces=[{"type": "gravity"}],
                planes=[{"friction": 0.5}],
                interactions=[{"type": "contact", "model": "impulse", "friction": 0.5}],
                output={"every": 1},
            )
        )
    )
    assert run.final["position"][1, 1] < 2.9 * R
    assert run.energy.max() - run.energy[0] < 1e-2 * 2 * R * 9.81 * 0.1
