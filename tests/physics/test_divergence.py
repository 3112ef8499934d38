"""Runs that go wrong stop soon, and say which particle was the first, under which force, and what to try."""

from __future__ import annotations

import gc
import math
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import energies, points, table

import particlesim as ps
from particlesim.bonds.hinge import Harmonic, angles_at, harmonic_energy, wrapped
from particlesim.engine.interactions.hinges import Angles, Dihedrals
from particlesim.engine.interactions.triangles import Triangles
from particlesim.engine.simulation import Simulation
from particlesim.engine.state.columns import Columns
from particlesim.forces.sheet_drag import SheetDrag


def post_mortem(scenario: dict[str, Any]) -> tuple[ps.DivergenceError, Any]:
    with pytest.raises(ps.DivergenceError) as caught:
        ps.run(ps.from_table(scenario))
    assert caught.value.post_mortem is not None
    return caught.value, caught.value.post_mortem


def chain(dt: float, steps: int, **more: Any) -> dict[str, Any]:
    """Eleven particles in a row, and one spring, between 6 and 7, that is a hundred times as stiff as the others."""
    row = [(0.1 * k * (1 + 1e-3 * (k % 3)), 0.0, 0.0) for k in range(11)]
    soft = [[k, k + 1] for k in range(10) if k != 6]
    springs = [
        {"name": "soft", "on": "row", "pairs": soft, "stiffness": 100.0, "rest_length": 0.1},
        {"name": "hard", "on": "row", "pairs": [[6, 7]], "stiffness": 1e4, "rest_length": 0.1},
    ]
    return table(
        steps * dt,
        dt,
        "symplectic_euler",
        particles=[points(*row, name="row")],
        springs=springs,
        **more,
    )


HARD = math.sqrt(2e4)  # ω of the hard spring alone, with masses of 1 kg


@pytest.mark.parametrize(("ledger", "work"), [(True, False), (True, True), (False, False)])
def test_the_first_sign_is_at_the_spring_that_is_too_stiff(ledger: bool, work: bool) -> None:
    # At hω = 2.05 the hard spring's stretch grows by 1.56 in a step. With the ledger, energies show it at the first frame;
    # without, in one interval, numbers overflow. Either way the first to run away is an end of that spring.
    dt = 2.05 / HARD
    steps = 100 if ledger else 3000
    error, found = post_mortem(chain(dt, 10 * steps, output={"ledger": ledger, "work": work, "every": steps}))
    assert found.cause == ("energy" if ledger else "not finite")
    assert found.particle in (6, 7)
    assert found.group == "row"
    assert found.force == "hard"
    assert found.newtons > 0
    assert found.stable_dt == pytest.approx(2 / HARD, rel=0.02)
    assert found.dt == pytest.approx(dt)
    assert found.time < 60 * dt
    assert found.noticed <= steps * dt * (1 + 1e-9)
    assert (found.frame, found.frame_time) == (0, 0.0)
    assert "hard" in str(error)
    assert "simulation.dt = 0.012" in str(error)


def test_what_is_stable_raises_no_alarm() -> None:
    # At 99 % of the limit the energy of the hard spring swings by a factor of 1/(1 − 0.98) = 50. A run that ends at a
    # moment when all of it is given back is well.
    def scenario(steps: int) -> dict[str, Any]:
        return chain(0.985 * 2 / HARD, steps, output={"ledger": True, "every": 10})

    energy = energies(scenario(4000))
    calm = int(np.flatnonzero(energy < energy[0])[-1])
    assert energy.max() > 10 * energy[0]
    assert calm > 300
    assert len(ps.run(ps.from_table(scenario(10 * calm))).times) == calm + 1


def test_energy_that_is_given_raises_no_alarm() -> None:
    # At rest at the start: the well gives all energy there is; then a kick brings a million times as much.
    scenario = table(
        2.0,
        0.01,
        particles=[points((0.1, 0, 0))],
        forces=[{"type": "point_spring", "stiffness": 1.0, "anchor": [0, 0, 0]}],
        impulses=[{"impulse": [100, 0, 0], "at": 1.0}],
        output={"ledger": True, "every": 1},
    )
    assert len(ps.run(ps.from_table(scenario)).times) == 201


def test_a_particle_alone() -> None:
    # hω = 3: μ² + 7 μ + 1 = 0, the amplitude grows by 6.85 in a step; numbers end after 370 steps or 3.7 s.
    well = {"type": "point_spring", "name": "well", "stiffness": 9e4, "anchor": [0, 0, 0]}
    calm = points(*[(0.0, 0.1 * k, 0.0) for k in range(5)], name="calm")
    scenario = table(
        10.0,
        0.01,
        "symplectic_euler",
        particles=[calm, points((0.0, 0, 0), (0.1, 0, 0), name="wild")],
        forces=[{**well, "on": ["wild"]}, {"type": "gravity", "acceleration": [0, -1e-3, 0], "on": ["wild"]}],
        output={"ledger": False},
    )
    error, found = post_mortem(scenario)
    assert (found.group, found.particle, found.force) == ("wild", 6, "well")
    assert found.stable_dt == pytest.approx(2 / 300, rel=1e-6)
    # Explained at the start are 9e3 m/s² · t: x grows by 6.85 a step, so that 100 times as much is passed within 6 steps.
    assert 0.02 <= found.time <= 0.06
    assert "simulation.dt = 0.006" in error.hint
    assert found.noticed == pytest.approx(3.7, abs=0.1)


def test_speeds_beyond_light_end_a_run_that_is_fed() -> None:
    # A field that pushes outwards, f = 1e4 x: x = 0.1 cosh 100 t passes c at t = 0.17 s; the ledger cannot know.
    push = {"type": "field", "force": ["1e4*x", "0", "0"]}
    scenario = table(
        5.0,
        1e-3,
        "rk4",
        particles=[points((0.1, 0, 0))],
        forces=[push],
        output={"ledger": True, "every": 100},
    )
    _, found = post_mortem(scenario)
    assert found.cause == "speed"
    assert found.noticed == pytest.approx(0.2) or found.noticed == pytest.approx(0.3)
    assert found.frame_time == pytest.approx(found.noticed - 0.1)


def test_frames_before_are_kept(tmp_path: Any) -> None:
    path = tmp_path / "chain.vtkhdf"
    scenario = ps.from_table(chain(2.05 / HARD, 1000, output={"ledger": True, "every": 5}))
    with pytest.raises(ps.DivergenceError) as caught:
        ps.run(scenario, path)
    with ps.open(path) as trajectory:
        assert trajectory.status == "diverged"
        assert len(trajectory) == caught.value.post_mortem.frame + 1
        assert trajectory.times[-1] == caught.value.post_mortem.frame_time
        assert np.isfinite(trajectory[-1].position).all()


@pytest.mark.parametrize("name", ["projectile", "rope"])
def test_nothing_keeps_a_simulation_that_has_ended(name: str) -> None:
    """Its arrays are free at once: runs in a row take the memory of one."""
    path = Path(__file__).parents[2] / "scenarios" / f"{name}.toml"
    simulation = Simulation(ps.load(path), threads=1)
    simulation.check()
    simulation.close()
    known = weakref.ref(simulation)
    gc.disable()
    try:
        del simulation
        assert known() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("ledger", [True, False])
def test_a_path_that_ends_is_named(ledger: bool) -> None:
    # √(0.05 − t) has no slope at 0.05 s, and no value later.
    scenario = table(
        0.1,
        0.01,
        particles=[points((0, 0, 0), (1, 0, 0), name="pins", pinned=True)],
        motions=[{"name": "lift", "on": "pins", "particles": [1], "path": ["sqrt(0.05 - t)", "y", "z"]}],
        output={"ledger": ledger, "every": 3},
    )
    error, found = post_mortem(scenario)
    assert "the path that lift gives particle 1 of 'pins' is not finite at t = 0.05 s" in str(error)
    assert (found.cause, found.particle, found.time, found.frame) == ("path", 1, pytest.approx(0.05), 1)
    assert error.exit_code == 3


def test_hinges_and_surfaces_can_be_the_strongest() -> None:
    # A hinge's forces are −∇U, by central differences here; a plate across the wind feels ½ ρ c A u², its corners a third.
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, (4, 3))
    for kind, number in ((Angles, 3), (Dihedrals, 4)):
        rows = np.arange(number)[:, None]
        hinge = kind(Harmonic(2.0), rows, np.array([0.3]))
        here = Columns(*x[:number].T, *np.zeros((3, number)), np.ones(number), None, None, None, ())
        forces = np.array([hinge.force_on(here, k, 0.0) for k in range(number)])

        def energy(y: Any, rows: Any = rows) -> float:
            return harmonic_energy(Harmonic(2.0), wrapped(angles_at(y.T, rows.T)[0] - 0.3))

        for k, axis in np.ndindex(number, 3):
            step = np.zeros((number, 3))
            step[k, axis] = 1e-6
            slope = (energy(x[:number] + step) - energy(x[:number] - step)) / 2e-6
            assert forces[k, axis] == pytest.approx(-slope, abs=1e-7 * np.abs(forces).max())
    law = SheetDrag(density=1.2, normal_coefficient=1.5).surface_record(False)
    plate = Triangles(law, np.arange(3)[:, None])
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0.0]])
    moving = Columns(*flat.T, *np.outer([0, 0, 5.0], np.ones(3)), np.ones(3), None, None, None, ())
    assert plate.force_on(moving, 1, 0.0) == pytest.approx([0, 0, -0.5 * 1.2 * 1.5 * 25 / 3])


def test_a_path_of_a_collider_that_ends_between_frames_is_named() -> None:
    """What lies on it has no place then, either: that had been told, with the advice to take a smaller step."""
    scenario = table(
        0.1,
        1e-3,
        particles=[points((0, 1, 0), radius=0.1)],
        forces=[{"type": "gravity"}],
        colliders=[{"name": "box", "type": "box", "size": [5, 1, 5], "center": [0, 0.4, 0]}],
        motions=[{"name": "lift", "collider": "box", "path": ["sqrt(0.05 - t)", "y", "z"]}],
        output={"every": 100},
    )
    with pytest.raises(
        ps.DivergenceError, match=r"lift gives the collider 'box' is not finite at t = 0\.05 s"
    ):
        ps.run(ps.from_table(scenario))


@pytest.mark.parametrize(
    ("x", "when", "error"),
    [
        ("sqrt(0.05 - t)", "0.05", ps.DivergenceError),
        ("x + 1/t", "0", ps.UsageError),
        ("t/x", "0", ps.UsageError),
    ],
)
def test_a_path_of_a_collider_that_ends_is_named(x: str, when: str, error: type[ps.PsimError]) -> None:
    scenario = table(
        0.1,
        0.01,
        particles=[points((0, 5, 0))],
        colliders=[{"name": "ball", "type": "sphere", "radius": 1.0}],
        motions=[{"name": "lift", "collider": "ball", "path": [x, "y", "z"]}],
        output={"every": 1},
    )
    with pytest.raises(error, match=f"lift gives the collider 'ball' is not finite at t = {when} s"):
        ps.run(ps.from_table(scenario))


@pytest.mark.parametrize(
    ("more", "place"),
    [
        ('[[bodies]]\nshape = { type = "sphere", radius = 1e-200 }', "8:9"),
        (
            "[[colliders]]\nname = 'lid'\ntype = 'sphere'\nradius = 1\n"
            '[[motions]]\ncollider = "lid"\npath = ["x", "y", "1/t"]',
            "13:8",
        ),
        ('[[motions]]\non = "ball"\nparticles = [0]\npath = ["x", "y", "1/t"]', "7:1"),
    ],
    ids=["body", "collider", "particle"],
)
def test_what_cannot_begin_is_told_with_its_place(more: str, place: str) -> None:
    text = f"""[simulation]
duration = 1.0
dt = 0.1
[[particles]]
name = "ball"
layout = {{ type = "points", position = [[0, 5, 0]] }}
{more}
"""
    with pytest.raises(ps.ScenarioError) as caught:
        ps.run(ps.loads(text))
    (told,) = caught.value.diagnostics
    assert told.span is not None
    assert f"{told.span.line}:{told.span.column}" == place


def test_what_diverges_between_deaths_has_a_post_mortem() -> None:
    """After a death in the middle of an interval there was no beginning to go back to."""
    scenario = table(
        2.0,
        0.0005,
        "velocity_verlet",
        output={"every": 200, "ledger": True, "work": True},
        particles=[
            points(
                (1, 0, 0), (1.3, 0.2, 0), (0, 2, 0.3), velocity=[[0, 6, 0], [0, 6, 0], [-4, 0, 0]], name="b"
            )
        ],
        interactions=[
            {"type": "lennard_jones", "epsilon": 1.0, "sigma": 0.4, "cutoff": 1.2, "shift": "force"}
        ],
        emitters=[
            {
                "name": "e",
                "mass": 0.7,
                "rate": 7.3,
                "shape": {"type": "ball", "center": [0, 0, 3], "radius": 0.5},
                "speed": 1.0,
                "spread": 180,
                "lifetime": {"type": "uniform", "low": 0.3, "high": 0.9},
            }
        ],
    )
    error, found = post_mortem(scenario)
    assert "gained" in str(error)
    assert found.group == "e"
