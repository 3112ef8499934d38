"""Energies of pairs by law in the ledger and in checks, momentum under laws of all sorts, equipartition."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from contract.pair_cases import PAIR_CASES
from simulate import EPS, Table, table

import particlesim as ps

LAWS = {
    "attraction": {"type": "gravity", "constant": 0.3, "softening": 0.2},
    "argon": {"type": "lennard_jones", "epsilon": 0.7, "sigma": 0.8, "cutoff": 1.9, "method": "neighbours"},
    "ions": {"type": "coulomb", "constant": 0.5, "between": ["a", "b"]},
}


def groups(count: int, seed: int = 3, speed: float = 0.3) -> list[Table]:
    """Two groups on a lattice a metre wide that is a little off, at rest as a whole, of different masses and charges."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(count)] * 3), -1).reshape(-1, 3) + rng.normal(
        0, 0.05, (count**3, 3)
    )
    v = rng.normal(0, speed, grid.shape)
    m = np.where(np.arange(len(grid)) % 2, 1.0, 4.0)
    v -= m @ v / m.sum()
    return [
        {
            "name": name,
            "mass": mass,
            "charge": charge,
            "radius": 0.3,
            "layout": {"type": "points", "position": grid[k::2].tolist(), "velocity": v[k::2].tolist()},
        }
        for k, (name, mass, charge) in enumerate((("a", 4.0, 0.5), ("b", 1.0, -0.5)))
    ]


def test_every_law_has_its_energy_in_the_ledger_and_in_checks() -> None:
    laws = [{"name": name, **law} for name, law in LAWS.items()]
    checks = [{"quantity": f"potential.{name}", "at": "end", "max": 1e9} for name in LAWS]
    scenario = table(
        0.1, 0.01, particles=groups(3), interactions=laws, checks=checks, output={"every": 5, "ledger": True}
    )
    result = ps.run(ps.from_table(scenario))
    frame = result.final
    x, m = frame.position, np.concatenate([np.full(14, 4.0), np.full(13, 1.0)])
    q = np.where(m > 2, 0.5, -0.5)
    i, j = np.triu_indices(len(x), 1)
    r = np.linalg.norm(x[i] - x[j], axis=1)
    s6 = (0.8 / r) ** 6
    expected = {
        "attraction": (-0.3 * m[i] * m[j] / np.hypot(r, 0.2)).sum(),
        "argon": np.where(r < 1.9, 4 * 0.7 * (s6 * s6 - s6), 0.0).sum(),
        "ions": np.where(m[i] != m[j], 0.5 * q[i] * q[j] / r, 0.0).sum(),
    }
    for check, (name, energy) in zip(result.checks, expected.items(), strict=True):
        assert result.ledger[f"potential.{name}"][-1] == pytest.approx(energy, rel=1e-12)
        assert check.value == pytest.approx(energy, rel=1e-12)


def test_momentum_is_kept_to_rounding_under_all_sorts_of_laws() -> None:
    # The two forces of a pair are opposite to the bit, so only sums round: those of 27 particles and five laws, in 20 steps.
    models = {
        name: PAIR_CASES[name]
        for name in ("gravity_soft", "lennard_jones_force", "friction", "flocking", "formula")
    }
    laws = [
        model.model_dump(mode="json", exclude_none=True, exclude_unset=True)
        | {"type": model.type, "name": name}
        for name, model in models.items()
    ]
    every = {"every": 1, "ledger": True}
    result = ps.run(ps.from_table(table(0.02, 0.001, particles=groups(3), interactions=laws, output=every)))
    v, m = result.final.velocity, np.concatenate([np.full(14, 4.0), np.full(13, 1.0)])
    size = float((m * np.linalg.norm(v, axis=1)).sum())
    assert size > 10
    for axis in "xyz":
        assert np.ptp(result.ledger[f"momentum.{axis}"]) < 27 * 10 * EPS * size


def test_light_and_heavy_atoms_share_the_energy() -> None:
    # A Lennard-Jones liquid of two masses, where all motion begins in the heavy ones: ½ m v² per atom comes to be the same
    # in both. In 4 τ velocities forget their past some 20 times; the mean over 32 atoms then has an error of
    # √(2/(3 · 32 · 20)) = 3 %, and the ratio of two √2 times that.
    atoms = groups(4, seed=5, speed=1.0)
    atoms[1]["layout"]["velocity"] = np.zeros((32, 3)).tolist()
    law: dict[str, Any] = {
        "type": "lennard_jones",
        "epsilon": 1.0,
        "sigma": 0.95,
        "cutoff": 1.9,
        "shift": "force",
    }
    scenario = table(12.0, 0.005, particles=atoms, interactions=[law], output={"every": 40, "ledger": True})
    scenario["simulation"]["box"] = {"size": [4.0, 4.0, 4.0]}
    energies: dict[str, list[float]] = {"a": [], "b": []}
    simulation = ps.from_table(scenario)
    result = _frames(simulation)
    for v in result[len(result) // 3 :]:
        energies["a"].append(2.0 * float(np.square(v[:32]).sum(axis=1).mean()))
        energies["b"].append(0.5 * float(np.square(v[32:]).sum(axis=1).mean()))
    ratio = np.mean(energies["a"]) / np.mean(energies["b"])
    assert abs(math.log(ratio)) < 4 * math.sqrt(2) * 0.03


def _frames(scenario: ps.Scenario) -> list[np.ndarray]:
    """Velocities of all particles at every frame."""
    from particlesim.engine.simulation import Simulation

    simulation, found = Simulation(scenario, threads=1), []
    for step in scenario.grid.frame_steps():
        simulation.advance_to(step)
        found.append(np.concatenate([state.velocity.copy() for state in simulation.states]))
    simulation.close()
    return found
