"""The shipped scenarios of springs: their own checks hold, and what they show is true."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

import particlesim as ps
from particlesim.layouts.hair import Hair

from .test_scenarios import G, run, shipped

SHORTER = {"trampoline": {"duration": 2.0}, "hanging_cloth": {"duration": 4.0}}
"""The ball has been down in the mat and is thrown up again; the corners of the cloth are where they stay from 3 s on."""


@pytest.mark.parametrize(
    "name",
    [
        "rope",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("pendulum_chain", "jelly_drop", "trampoline", "hanging_cloth")
        ),
    ],
)
def test_the_checks_of_a_scenario_hold(name: str) -> None:
    result = run(name, **SHORTER.get(name, {}))
    assert result.checks
    assert all(check.passed for check in result.checks)


@pytest.mark.slow
def test_the_cradle_hands_the_speed_on() -> None:
    # The first ball falls by the height h in a quarter of a pendulum's period and meets four that touch but for gaps of
    # 0.2 mm. After 28 frames the last one has risen for 0.07 s; its energy is that of the first, and little is elsewhere:
    # the struts join impacts that follow each other within 2 % of the speed.
    result = run("newtons_cradle", duration=28 / 60)
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


@pytest.mark.slow
def test_the_bridge_holds_until_it_breaks(tmp_path: Path) -> None:
    path = tmp_path / "bridge.vtkhdf"
    result = ps.run(shipped("bridge_collapse"), path)
    with ps.open(path) as trajectory:
        sets = dict(trajectory.topology)
        start, early, end = (
            frame.position for frame in (trajectory[0], trajectory.frame_at(1.0), trajectory[-1])
        )
    pinned = (start == early).all(axis=1)
    broke = np.concatenate([each.broke for each in sets.values()])
    assert broke.min() > 1.0, "the load grows from nothing"
    assert early[:, 1].min() > 1.9
    assert np.isfinite(broke).sum() == sum(count for count, _ in result.broken.values()) > 30
    assert np.isfinite(broke).sum() < len(broke)
    assert end[:, 1].min() == pytest.approx(0, abs=1e-6), "on the ground"
    assert pinned.sum() == 4, "the ends of its deck"
    assert np.array_equal(end[pinned], early[pinned])


@pytest.mark.slow
def test_the_flag_flies_with_the_wind() -> None:
    # Its weight is 1.2 N/m²; a wind of 7 m/s presses on what stands across it with 1.2 · 30 N/m²: it flies nearly level.
    result = run("flag", duration=3.0)
    flag = result.final.position[result.final.of("flag")]
    middle = flag.mean(axis=0)
    assert middle[0] > 0.4, "away from the pole, with the wind"
    assert middle[1] == pytest.approx(1.7, abs=0.3), "it does not hang down"
    # Flat it is 1.5 m long, and its threads give little.
    assert np.linalg.norm(flag[:, [0, 2]], axis=1).max() < 1.65


@pytest.mark.slow
def test_strands_of_hair_keep_their_length() -> None:
    result = run("hair", duration=0.5)
    layout = result.scenario.particles[0].layout
    assert isinstance(layout, Hair)
    hair = result.final.position[result.final.of("hair")].reshape(*layout.shape(), 3)
    length = np.linalg.norm(np.diff(hair, axis=1), axis=2).sum(axis=1)
    # They are of all lengths between the shortest and the longest.
    longest, shortest = layout.length, layout.length * (1 - layout.variation)
    assert np.sort(length) == pytest.approx(np.linspace(shortest, longest, len(length)), rel=0.05)
    tip, root = hair[:, -1].mean(axis=0), hair[:, 0].mean(axis=0)
    assert tip[1] < root[1] - 0.2, "down"
    assert tip[0] > root[0], "and with the wind"


@pytest.mark.slow
def test_locks_of_hair_hold_each_other_off() -> None:
    # without contact some hundred are nearer than they are thick; what is so at the start moves apart
    result = run("head_of_hair", duration=0.4)
    strand = np.arange(len(result.final.position)) // 12
    near = KDTree(result.final.position).query_pairs(0.9 * 0.006, output_type="ndarray")
    assert (strand[near[:, 0]] != strand[near[:, 1]]).sum() < 30
    assert np.linalg.norm(result.final.position - (0, 0.5, 0), axis=1).min() > 0.1 + 0.003 * (1 - 1e-3)


@pytest.mark.slow
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
