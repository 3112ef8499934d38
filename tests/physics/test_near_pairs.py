"""Pair laws on neighbour lists: the forces of direct sums, the same bits whatever happens, and what is conserved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import EPS

import particlesim as ps
from particlesim.engine.interactions.near_pairs import NearPairs
from particlesim.engine.interactions.neighbours.record import BUILDS, OVERFLOW, new_neighbours
from particlesim.engine.interactions.pairs import DirectPairs
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

LENNARD_JONES = {"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0, "cutoff": 2.5}
LAWS: dict[str, dict[str, Any]] = {
    "lennard_jones": LENNARD_JONES,
    "force_shifted": {**LENNARD_JONES, "shift": "force"},
    "mixed": {**LENNARD_JONES, "epsilon": {"a": 1.0, "b": 0.3}, "sigma": {"a": 1.0, "b": 0.8}},
    "on_one": {**LENNARD_JONES, "on": ["b"]},
    "between": {**LENNARD_JONES, "between": ["b", "a"]},
    "charges": {"type": "coulomb", "constant": 2.0, "cutoff": 3.0, "shift": "force"},
    "morse": {"type": "morse", "depth": 1.0, "width": 2.0, "distance": 1.1, "cutoff": 2.0, "shift": "energy"},
    "soft_spheres": {"type": "soft_sphere", "epsilon": 30.0, "sigma": 1.3},
    "soft_by_radius": {"type": "soft_sphere", "epsilon": 30.0},
    "soft_hertz": {"type": "soft_sphere", "epsilon": 30.0, "exponent": 2.5, "cutoff": 0.9},
}


def liquid(
    law: dict[str, Any], edge: int = 8, method: str = "neighbours", spread: float = 0.08, **simulation: Any
) -> ps.Scenario:
    """Two groups of atoms on a lattice of edge³ places, somewhat beside them, at density 0.8 and temperature 1."""
    rng = np.random.default_rng(edge)
    spacing = 0.8 ** (-1 / 3)
    x = spacing * np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), -1).reshape(-1, 3)
    x += rng.normal(0, spread, x.shape)
    v = rng.normal(0, 1, x.shape)
    v -= v.mean(axis=0)
    part = rng.random(len(x)) < 0.3
    groups = [
        {
            "name": name,
            "mass": mass,
            "charge": charge,
            "radius": {"type": "uniform", "low": 0.3, "high": 0.75},
            "layout": {"type": "points", "position": x[who].tolist(), "velocity": v[who].tolist()},
        }
        for name, who, mass, charge in (("a", part, 1.0, 0.5), ("b", ~part, 1.5, -0.4))
    ]
    return ps.from_table(
        {
            "simulation": {"duration": 1.0, "dt": 0.005, "integrator": "velocity_verlet", **simulation},
            "output": {"every": 20},
            "particles": groups,
            "interactions": [{"name": "law", "method": method, **law}],
        }
    )


def started(scenario: ps.Scenario, threads: int = 1) -> tuple[Simulation, Any, Any]:
    """A simulation, the island of the interaction, and the interaction."""
    simulation = Simulation(scenario, threads=threads)
    (island,) = [each for each in simulation.islands if getattr(each, "interactions", ())]
    return simulation, island, island.interactions[0]


def bits(simulation: Simulation) -> bytes:
    return b"".join(state.x.tobytes() + state.v.tobytes() for state in simulation.states)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_forces_and_energies_are_those_of_direct_sums(name: str, precision: str) -> None:
    found = []
    for method, kind in (("direct", DirectPairs), ("neighbours", NearPairs)):
        simulation, island, each = started(liquid(LAWS[name], method=method, precision=precision))
        assert type(each) is kind
        c = island.island_columns()
        row = 37
        found.append(
            (island.forces(0.0), each.energy(c), np.stack([each.force_on(c, row + k, 0.0) for k in range(3)]))
        )
        simulation.close()
    (force, energy, some), (near_force, near_energy, near_some) = found
    # Both sums have the same terms, in another order: some 60 neighbours, of forces below the largest.
    eps = EPS if precision == "double" else 1.2e-7
    np.testing.assert_allclose(near_force, force, atol=200 * eps * np.abs(force).max())
    np.testing.assert_allclose(near_some, some, atol=200 * eps * np.abs(force).max())
    assert near_energy == pytest.approx(energy, rel=500 * eps)
    assert np.abs(near_force).max() > 1


def test_steepness_is_that_of_direct_sums() -> None:
    found = []
    for method in ("direct", "neighbours"):
        simulation, island, each = started(liquid(LENNARD_JONES, edge=5, method=method))
        c = island.island_columns()
        n = c.x.size
        tensors = each.linearise(c, 0.0)
        stiff, damped = (matrix.toarray() for matrix in tensors.jacobians(n))
        (rows, (bound, *_)) = next(iter(tensors.loads(1 / c.m.astype(float), damping=False, rows=1)))
        found.append((stiff, damped, rows, bound))
        simulation.close()
    for direct, near in zip(*found, strict=True):
        np.testing.assert_allclose(near, direct, atol=1e-12 * np.abs(direct).max())


def test_lists_are_chosen_where_they_pay() -> None:
    for law, edge, kind in (
        (LENNARD_JONES, 8, NearPairs),
        (LENNARD_JONES, 6, DirectPairs),
        ({"type": "gravity", "constant": 1.0, "softening": 0.1}, 8, DirectPairs),
        (LAWS["soft_by_radius"], 8, NearPairs),
    ):
        simulation, _, each = started(liquid(law, edge, "auto"))
        assert type(each) is kind
        simulation.close()


@pytest.mark.parametrize("name", ["force_shifted", "soft_by_radius"])
def test_same_bits_for_any_number_of_threads(name: str) -> None:
    found = set()
    for threads in (1, 2, 3):
        simulation, _, each = started(liquid(LAWS[name], edge=15, spread=0.05), threads)
        simulation.advance_to(14)
        assert each.near.report[BUILDS] > 1 or name != "force_shifted"
        found.add(bits(simulation))
        simulation.close()
    assert len(found) == 1


def test_same_bits_with_too_little_room_for_lists() -> None:
    scenario = liquid(LENNARD_JONES)
    found = []
    for little in (False, True):
        simulation, island, each = started(scenario)
        if little:
            near = each.near._replace(candidates=np.zeros(7000, np.uint32))
            island.interactions, island._shares = (each._replace(near=near),), {}
        simulation.advance_to(20)
        if little:
            assert near.report[OVERFLOW]
            assert (near.count < 0).any()
            assert (near.count > 0).any()
            simulation.advance_to(21)
            assert island.interactions[0].near.candidates.size > 7000
        else:
            simulation.advance_to(21)
        found.append(bits(simulation))
        simulation.close()
    assert found[0] == found[1]


def test_same_bits_after_a_resume() -> None:
    scenario = liquid(LENNARD_JONES)
    simulation, _, _ = started(scenario)
    simulation.advance_to(20)
    saved = snapshot(simulation)
    simulation.advance_to(40)
    other, _, _ = started(scenario)
    restore(other, saved)
    other.ledger()  # looks at the lists, but does not change what follows
    other.advance_to(40)
    assert bits(other) == bits(simulation)
    simulation.close()
    other.close()


def test_leapfrog_sums_forces_once_a_step() -> None:
    # The second kick of a step and the first of the next are at the same places.
    simulation, _, each = started(liquid(LENNARD_JONES))
    simulation.advance_to(4)
    each.pull[:] = np.nan
    c = simulation.islands[0].island_columns()
    assert not np.isfinite(simulation.islands[0].forces(simulation.time)).any()
    each.energy(c)
    assert np.isfinite(simulation.islands[0].forces(simulation.time)).all()
    simulation.close()


def melt(edge: int, density: float, temperature: float, law: dict[str, Any], dt: float = 0.005) -> Any:
    """A simulation of atoms in a periodic box, the length of the box, and the interaction."""
    spacing = (4 / density) ** (1 / 3)
    cells = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    x = spacing * (cells + basis).reshape(-1, 3)
    v = np.random.default_rng(edge).normal(size=x.shape)
    v -= v.mean(axis=0)
    v *= np.sqrt(temperature * 3 * (len(x) - 1) / (v * v).sum())
    scenario = ps.from_table(
        {
            "simulation": {"duration": 200.0, "dt": dt, "integrator": "velocity_verlet"},
            "particles": [
                {
                    "name": "atoms",
                    "mass": 1.0,
                    "layout": {"type": "points", "position": x.tolist(), "velocity": v.tolist()},
                }
            ],
            "interactions": [{**law, "name": "law", "method": "neighbours"}],
        }
    )
    simulation, island, each = started(scenario)
    length = edge * spacing
    near = new_neighbours(each.near.members, len(x), law["cutoff"], box=(length,) * 3)
    each = each._replace(near=near)
    island.interactions, island._shares = (each,), {}
    return simulation, length, each


def test_energy_and_momentum_of_a_melt() -> None:
    # The energy of a leapfrog oscillates by a term in dt²: a quarter for half the step, and does not drift. Where forces
    # end at the cutoff without a jump, nothing else is left.
    error = []
    for dt in (0.005, 0.0025):
        simulation, _, _ = melt(6, 0.8442, 1.5, {**LENNARD_JONES, "shift": "force"}, dt)
        found = []
        for k in range(20):
            simulation.advance_to(round((0.25 + 0.025 * k) / dt))
            row = simulation.ledger()
            found.append(row["kinetic"] + row["potential.law"])
        momentum = [row[f"momentum.{axis}"] for axis in "xyz"]
        error.append(np.std(found) / 864)
        half = len(found) // 2
        assert abs(np.mean(found[:half]) - np.mean(found[half:])) < 3e-4 * 864
        assert np.abs(momentum).max() < 1e-11
        simulation.close()
    assert error[0] < 1e-3
    assert 2.5 < error[0] / error[1] < 6.5


def test_virial_is_how_the_energy_changes_with_the_size_of_the_box() -> None:
    # Scaling all lengths by 1 + e changes the energy by e Σ ∂U/∂l · l = −e Σ l · f.
    simulation, length, each = melt(5, 0.8442, 1.5, {**LENNARD_JONES, "shift": "force"})
    simulation.advance_to(20)
    c = simulation.islands[0].island_columns()
    virial = each.virial(c, 0.0)
    h, energies = 1e-6, []
    for e in (h, -h):
        near = new_neighbours(each.near.members, c.x.size, 2.5, box=(length * (1 + e),) * 3)
        scaled = c._replace(x=c.x * (1 + e), y=c.y * (1 + e), z=c.z * (1 + e))
        energies.append(each._replace(near=near).energy(scaled))
    assert np.trace(virial) == pytest.approx(-(energies[0] - energies[1]) / (2 * h), rel=1e-6)
    np.testing.assert_allclose(virial, virial.T, atol=1e-10 * np.abs(virial).max())
    simulation.close()
