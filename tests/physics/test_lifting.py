"""What overlaps at the start is moved apart, and that is no energy from nothing; what is one is still found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, Table, points, simulate, table

import particlesim as ps
from particlesim.engine.interactions.hard.apart import SLACK
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R, M, STEP = 0.1, 1.0, 1e-3
FLOOR: Table = {"forces": [{"type": "gravity"}], "planes": [{"restitution": 0}]}
HARD = {"type": "contact", "restitution": 0}


def stack(duration: float, dt: float, overlap: float, **more: Any) -> Table:
    """Two grains on each other, so much in each other at the start."""
    two = points((0, R, 0), (0, 3 * R - overlap, 0), radius=R, mass=M)
    parts: Table = {"particles": [two], "interactions": [HARD], **FLOOR, **more}
    return table(duration, dt, output={"ledger": True, "every": 10}, **parts)


def fed_and_gained(scenario: Table) -> tuple[float, float]:
    """What moving apart has given in a run [J], and by how much its energy has grown."""
    simulation = Simulation(ps.from_table(scenario))

    def energy() -> float:
        row = simulation.ledger()
        return row["kinetic"] + sum(value for name, value in row.items() if name.startswith("potential."))

    start = energy()
    simulation.advance_to(simulation.scenario.grid.steps)
    gained = energy() - start
    (island,) = simulation.islands
    fed = island.interactions[-1].given
    simulation.close()
    return float(fed), gained


@pytest.mark.parametrize("friction", [{}, {"friction": 0.3}], ids=["smooth", "rough"])
@pytest.mark.parametrize("overlap", [1e-5, 1e-4, 0.02])
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 1e-2])
def test_grains_that_overlap_at_the_start_come_apart(
    dt: float, overlap: float, friction: dict[str, float]
) -> None:
    # By a fiftieth of the radius in a step at most, of which the floor gives back the half of the lower one: so 20 steps at
    # least. A slack is left, and a step's fall is put back in it and the next ones.
    result = ps.run(ps.from_table(stack(60 * dt, dt, overlap, interactions=[{**HARD, **friction}])))
    assert result.final.position[1, 1] == pytest.approx(3 * R, abs=2 * G * dt * dt + SLACK * R + 1e-9)


@pytest.mark.parametrize("overlap", [0.0, 1e-4, 0.02])
def test_what_moving_apart_gives_is_known(overlap: float) -> None:
    fed, gained = fed_and_gained(stack(0.2, STEP, overlap))
    # both hang on where the first step ends, to the fall of a step
    apart = max(overlap - SLACK * R, 0.0)
    assert gained == pytest.approx(M * G * apart, abs=M * G * G * STEP * STEP)
    assert fed == pytest.approx(M * G * apart, abs=M * G * G * STEP * STEP)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_what_turns_pays_for_what_moving_apart_lifts(precision: str) -> None:
    # both spin about the line of their centres, as fast: nothing slides
    rate, overlap, law = 16.0, 0.02, {**HARD, "friction": 0.3}
    two = points((0, R, 0), (0, 3 * R - overlap, 0), radius=R, mass=M, angular_velocity=[0, rate, 0])
    scenario = stack(0.2, STEP, overlap, particles=[two], interactions=[law])
    scenario["simulation"]["precision"] = precision
    fed, gained = fed_and_gained(scenario)
    fall, lift, spin = M * G * G * STEP * STEP, M * G * (overlap - SLACK * R), 0.4 * M * (R * rate) ** 2
    assert abs(gained) < 2 * fall
    assert abs(fed) < 2 * fall
    kinetic = ps.run(ps.from_table(scenario)).ledger["kinetic"]
    assert kinetic[-1] == pytest.approx(spin - lift, abs=2 * fall + 1e-2 * M * G * SLACK * R)


@pytest.mark.parametrize("friction", [{}, {"friction": 0.3}], ids=["smooth", "rough"])
def test_what_slides_on_a_smooth_floor_keeps_its_speed_as_it_comes_apart(friction: dict[str, float]) -> None:
    # the floor does not push along itself, so nothing there can pay
    overlap = 0.02
    two = points((0, R, 0), (0, 3 * R - overlap, 0), velocity=[(1.0, 0, 0)] * 2, radius=R, mass=M)
    scenario = stack(0.2, STEP, overlap, particles=[two], interactions=[{**HARD, **friction}])
    fed, gained = fed_and_gained(scenario)
    assert fed == pytest.approx(gained, abs=2 * M * G * G * STEP * STEP)
    assert ps.run(ps.from_table(scenario)).final.velocity[:, 0] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("radii", [(0.01, 0.01, 0.01), (0.01, 0.006, 0.008)])
def test_what_swings_in_a_drum_goes_on(radii: tuple[float, ...]) -> None:
    """Smooth grains that touch: each step sinks them a little into the wall and into each other, and is put back. To pay for
    that once more had taken a twelfth of the energy in four seconds, in steps of 2 ms."""
    drum, at, places = 0.1, 0.6, []
    for k, r in enumerate(radii):
        if k:
            q, p, d = drum - r, drum - radii[k - 1], r + radii[k - 1]
            at -= np.arccos((q * q + p * p - d * d) / (2 * q * p)) + 1e-7
        places.append(((drum - r) * np.sin(at), -(drum - r) * np.cos(at), 0.0))
    wall = {"type": "cylinder", "start": [0, 0, -0.05], "end": [0, 0, 0.05], "radius": drum, "inside": True}
    scenario = table(
        4.0,
        2e-3,
        particles=[points(*places, radius=list(radii), mass=[1e4 * r**3 for r in radii])],
        forces=[{"type": "gravity"}],
        colliders=[{**wall, "restitution": 0.3}],
        interactions=[{"type": "contact", "restitution": 0.3}],
        output={"ledger": True, "every": 5},
    )
    kinetic = ps.run(ps.from_table(scenario)).ledger["kinetic"]
    assert kinetic[300:].max() == pytest.approx(kinetic[:100].max(), rel=0.02)


def test_what_rests_or_bounces_is_fed_next_to_nothing() -> None:
    # Impulses end with approaches of a thousandth of g dt, which is put back in every step; falls of a step, g dt², are not.
    time = 2.0
    fed, _ = fed_and_gained(stack(time, STEP, 0.0))
    assert fed < 1e-3 * M * G * (G * STEP) * time + M * G * G * STEP * STEP
    lively = {"planes": [{"restitution": 0.9}], "interactions": [{"type": "contact", "restitution": 0.9}]}
    fed, _ = fed_and_gained(stack(time, STEP, -R, **lively))
    assert fed < 1e-3 * M * G * (G * STEP) * time + M * G * G * STEP * STEP


def test_energy_from_nothing_is_found_beside_what_comes_apart() -> None:
    # a swing of ω dt = 2.2, beyond the limit of 2, and two grains that come apart
    well = {"type": "point_spring", "stiffness": M * (2.2 / STEP) ** 2}
    three = points((0, 0, 0), (0, R, 0), (3, 0, 0), radius=R, mass=M)
    with pytest.raises(ps.DivergenceError):
        simulate(
            0.2,
            STEP,
            particles=[three],
            forces=[well],
            interactions=[HARD],
            output={"ledger": True, "every": 1},
        )


def test_cloths_that_are_too_close_at_the_start_come_apart() -> None:
    layout = {"type": "cloth", "size": [0.6, 0.6], "resolution": [9, 9], "up": [0, 0, 1], "right": [1, 0, 0]}
    cloth = {"mass": 0.1, "radius": 0.01, "springs": {"structural": 100, "shear": 50}}
    sheets = [
        {**cloth, "name": name, "layout": {**layout, "origin": [-0.3, height, -0.3]}}
        for name, height in (("low", 0.01), ("high", 0.025))
    ]
    scenario = table(
        0.1, STEP, particles=sheets, interactions=[HARD], output={"ledger": True, "every": 20}, **FLOOR
    )
    final = ps.run(ps.from_table(scenario)).final
    # contacts are as wide as they should be to a thousandth of their thickness
    assert final.position[81:, 1] == pytest.approx(0.03, abs=2e-3 * 0.02)
    fed, gained = fed_and_gained(scenario)
    assert fed == pytest.approx(gained, rel=0.02)


def test_what_was_fed_goes_on_after_a_resume() -> None:
    scenario = ps.from_table(stack(0.02, STEP, 0.02))
    one, other = Simulation(scenario), Simulation(scenario)
    one.advance_to(10)
    restore(other, snapshot(one))
    for each in (one, other):
        each.advance_to(20)
    fed = [each.islands[0].interactions[-1].fed[0] for each in (one, other)]
    assert fed[0] == fed[1] > 0
    assert np.array_equal(one.states[0].x, other.states[0].x)
