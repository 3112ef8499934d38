"""The shipped scenarios of springs: their own checks hold, and what they show is true."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import particlesim as ps

from .test_scenarios import G, run, shipped


@pytest.mark.parametrize("name", ["rope", "pendulum_chain", "jelly_drop", "trampoline", "hanging_cloth"])
def test_the_checks_of_a_scenario_hold(name: str) -> None:
    result = run(name)
    assert result.checks
    assert all(check.passed for check in result.checks)


def test_the_cradle_hands_the_speed_on() -> None:
    # The first ball falls by the height h in a quarter of a pendulum's period and meets four that touch but for gaps of
    # 0.2 mm. After 0.6 s the last one has risen for 0.07 s; its energy is that of the first, and little is left elsewhere:
    # the struts join impacts that follow each other within 2 % of the speed.
    result = run("newtons_cradle", duration=0.6)
    final = result.final
    balls = final.of("balls")
    start = result.scenario.particles[0].layout.position  # type: ignore[union-attr]
    height = start[0][1]
    speed = np.linalg.norm(final.velocity[balls], axis=1)
    last = final.position[balls][-1]
    fast = math.sqrt(2 * G * (height - last[1]))
    assert speed[-1] == pytest.approx(fast, rel=0.02)
    assert speed[:-1].max() < 0.1 * fast
    assert final.position[balls][:-1, 0] == pytest.approx(np.array(start)[:, 0][1:] - 0.1002, abs=0.02)


def test_the_bridge_holds_until_it_breaks() -> None:
    before = run("bridge_collapse", duration=1.0)
    broken, bars = before.broken["bars"]
    assert broken == 0
    # 17 × 3 × 3 joints: neighbours along the axes, and the two diagonals of every square.
    edges = 16 * 9 + 17 * 6 * 2
    squares = 16 * 2 * 3 * 2 + 17 * 2 * 2
    assert bars == edges + 2 * squares
    free = before.final.position[:, 1] < 3.5
    assert before.final.position[free, 1].min() > 1.5, "still up"
    after = run("bridge_collapse")
    assert after.broken["bars"][0] > 100
    assert after.final.position[:, 1].min() == pytest.approx(0, abs=1e-9), "on the ground"
    ends = list(after.scenario.particles[0].pinned)  # type: ignore[arg-type]
    assert after.final.position[ends] == pytest.approx(before.final.position[ends], abs=0), "but not its ends"


def test_broken_bars_are_known_to_the_trajectory(tmp_path: Path) -> None:
    path = tmp_path / "bridge.vtkhdf"
    result = ps.run(shipped("bridge_collapse"), path)
    with ps.open(path) as trajectory:
        bars = trajectory.topology["bars"]
    assert np.isfinite(bars.broke).sum() == result.broken["bars"][0]
    assert bars.broke.min() > 1.0


def test_stiff_cloth_steps_far_beyond_the_explicit_limit() -> None:
    # Symplectic Euler needs h < 2/ω, with ω² ≥ 4 k/m of a single row of springs.
    scenario = shipped("stiff_cloth")
    cloth = scenario.particles[0]
    number = math.prod(cloth.layout.resolution)  # type: ignore[union-attr]
    assert cloth.springs is not None
    assert isinstance(cloth.mass, float)
    omega = math.sqrt(4 * cloth.springs.structural * number / cloth.mass)
    assert scenario.grid.dt > 10 * 2 / omega
    result = run("stiff_cloth", duration=1.0)
    assert np.isfinite(result.final.position).all()
    edge = result.final.position[: cloth.layout.resolution[0]]  # type: ignore[union-attr]
    assert edge[:, 1] == pytest.approx(np.full(len(edge), 0.15), abs=0.02)
