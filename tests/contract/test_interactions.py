"""The face of every kind of interaction: what it says in Python is what its kernels do; a new kind needs nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest

import particlesim as ps
from particlesim.engine.interactions import registry
from particlesim.engine.interactions.interaction import Interaction, Site, give, lone
from particlesim.engine.simulation import Simulation
from particlesim.graph import graph

CLOTH = {
    "format": 1,
    "simulation": {"duration": 0.1, "dt": 0.001, "integrator": "velocity_verlet"},
    "particles": [
        {
            "name": "sail",
            "mass": 0.4,
            "charge": 0.2,
            "layout": {"type": "cloth", "size": [1, 1], "resolution": [4, 4]},
            "springs": {"structural": 30.0, "damping": 0.2},
        },
        {
            "name": "arm",
            "mass": 0.1,
            "charge": -0.3,
            "layout": {"type": "rope", "start": [0, 0, 0.1], "end": [1, 0, 0.1], "count": 5},
        },
    ],
    "forces": [{"type": "sheet_drag", "density": 1.2, "flow": [{"type": "uniform", "velocity": [3, 0, 1]}]}],
    "angles": [{"name": "elbow", "on": "arm", "triples": [[0, 1, 2], [1, 2, 3]], "stiffness": 2.0}],
    "dihedrals": [{"name": "fold", "on": "arm", "quadruples": [[0, 1, 2, 3]], "stiffness": 0.7}],
    "interactions": [
        {"name": "swarm", "type": "gravity", "constant": 3.0},
        {"name": "ions", "type": "coulomb", "constant": 2.0, "between": ["arm", "sail"], "cutoff": 0.6},
        {
            "name": "atoms",
            "type": "lennard_jones",
            "epsilon": 0.1,
            "sigma": 0.2,
            "cutoff": 0.45,
            "shift": "force",
            "method": "neighbours",
        },
    ],
}


def shaken(table: dict[str, Any] = CLOTH) -> Simulation:
    """A simulation of all kinds with particles somewhat beside their places."""
    simulation = Simulation(ps.from_table(table), threads=1)
    rng = np.random.default_rng(5)
    for state in simulation.states:
        state.x[:, : state.count] += rng.normal(0, 0.03, (3, state.count))
        state.v[:, : state.count] = rng.normal(0, 0.3, (3, state.count))
    return simulation


def forces_of(each: Any, c: Any) -> np.ndarray:
    """Forces of one set on all particles [3, n], in plain Python; springs have them chunk by chunk in kernels."""
    n = c.x.size
    if each.by_chunks:
        return np.array([each.force_on(c, row, 0.0) for row in range(n)]).T
    total = np.zeros((3, n))
    if each.prepares:
        with np.errstate(all="ignore"):  # as kernels in plain Python: those who are nowhere are far away
            type(each).prepare(each, c, lone(n), 0.0)
    type(each).add_forces(each, c, total, 0, n, 0.0)
    return total


def beside(c: Any, name: str, row: int, step: float) -> Any:
    """Columns with one number changed."""
    column = getattr(c, name).copy()
    column[row] += step
    return c._replace(**{name: column})


def interactions() -> list[tuple[str, Any, Any]]:
    found = []
    for island in shaken().islands:
        c = island.island_columns()
        found += [(name, each, c) for name, each in zip(island.names, island.interactions, strict=True)]
    return found


ALL = interactions()
kinds = pytest.mark.parametrize(("name", "each", "c"), ALL, ids=[name for name, _, _ in ALL])


def test_every_kind_is_here() -> None:
    made = {type(each) for _, each, _ in ALL}
    assert {kind.__name__ for kind in made} == {
        "Bonds",
        "Angles",
        "Dihedrals",
        "Triangles",
        "DirectPairs",
        "NearPairs",
    }
    assert len(registry.KINDS) == 4, "a new kind needs a case here"


def test_forces_one_by_one_are_those_of_the_kernel() -> None:
    (island,) = shaken().islands
    c = island.island_columns()
    expected = island.forces(0.0)
    found = np.array(
        [sum(each.force_on(c, row, 0.0) for each in island.interactions) for row in range(c.x.size)]
    )
    np.testing.assert_allclose(found.T, expected, atol=1e-12 * np.abs(expected).max())


@kinds
def test_forces_are_those_of_the_energy_and_the_rest_is_spent(name: str, each: Any, c: Any) -> None:
    total = forces_of(each, c)
    power = float((total * np.stack([c.vx, c.vy, c.vz])).sum())
    change = 0.0
    if each.energy(c, 0.0) is not None:
        h = 1e-6
        ahead, behind = (
            c._replace(**{x: getattr(c, x) + s * getattr(c, f"v{x}") for x in "xyz"}) for s in (h, -h)
        )
        change = (each.energy(ahead, 0.0) - each.energy(behind, 0.0)) / (2 * h)
    spent = each.power(c, 0.0) if each.spends else 0.0
    scale = float((np.abs(total) * np.abs(np.stack([c.vx, c.vy, c.vz]))).sum())
    assert power == pytest.approx(spent - change, abs=1e-7 * scale)
    assert each.spends == (name not in ("elbow", "fold", "swarm", "ions", "atoms"))


@kinds
def test_linearised_damping_is_how_forces_change_with_velocity(name: str, each: Any, c: Any) -> None:
    n, h = c.x.size, 1e-6
    _, by_velocity = (matrix.toarray() for matrix in each.linearise(c, 0.0).jacobians(n))
    scale = max(np.abs(by_velocity).max(), 1e-3)
    for row, axis in ((0, 0), (n // 2, 1), (n - 1, 2)):
        ahead, behind = (forces_of(each, beside(c, ("vx", "vy", "vz")[axis], row, s)) for s in (h, -h))
        slope = (ahead - behind) / (2 * h)
        np.testing.assert_allclose(by_velocity[:, 3 * row + axis], slope.T.ravel(), atol=1e-5 * scale)


@kinds
def test_shares_add_up(name: str, each: Any, c: Any) -> None:
    if each.by_chunks:
        return
    n, total = c.x.size, np.zeros((3, c.x.size))
    whole = forces_of(each, c)  # which finds the pairs, too, if no other test has
    for first, last in ((0, n // 3), (n // 3, n)):
        part = each.between(first, last)
        type(part).add_forces(part, c, total, first, last, 0.0)
    assert np.array_equal(total, whole)


# A kind that psim does not have: every particle attracts every other.


@dataclass(frozen=True)
class SwarmSet:
    name: str
    groups: tuple[str, ...]
    strength: float
    feeds: bool = False

    def needs_velocity(self) -> bool:
        return False


class SwarmColumns(NamedTuple):
    strength: float
    count: int


class Swarm(Interaction, SwarmColumns):
    __slots__ = ()

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        for i in range(first, last):
            for j in range(c.x.size):
                x, y, z = c.x[j] - c.x[i], c.y[j] - c.y[i], c.z[j] - c.z[i]
                square = x * x + y * y + z * z
                k = self.strength * c.m[i] * c.m[j] / (square * np.sqrt(square)) if square > 0 else square
                give(total, i, first, last, k * x, k * y, k * z)

    @property
    def number(self) -> int:
        return self.count * (self.count - 1) // 2


def swarm_of(site: Site, swarm: SwarmSet) -> Swarm:
    return Swarm(swarm.strength, site.whole.count)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk4", "rk45"])
def test_a_new_kind_is_a_record_and_a_line(monkeypatch: pytest.MonkeyPatch, integrator: str) -> None:
    # Two bodies of mass 1 kg at a distance of 2 m, G = 4 m³/(kg s²): circles of 1 m at 1 m/s, with a period of 2π s.
    monkeypatch.setitem(registry.KINDS, SwarmSet, swarm_of)
    monkeypatch.setattr(graph, "interactions_of", lambda scenario: (SwarmSet("swarm", ("pair",), 4.0),))
    simulation = Simulation(
        ps.from_table(
            {
                "format": 1,
                "simulation": {"duration": math.tau, "dt": math.tau / 500, "integrator": integrator},
                "particles": [
                    {
                        "name": "pair",
                        "mass": 1.0,
                        "layout": {
                            "type": "points",
                            "position": [[1, 0, 0], [-1, 0, 0]],
                            "velocity": [[0, 1, 0], [0, -1, 0]],
                        },
                    }
                ],
            }
        ),
        threads=1,
    )
    assert simulation.graph.islands[0].coupled
    simulation.advance_to(125)
    np.testing.assert_allclose(simulation.states[0].position, [[0, 1, 0], [0, -1, 0]], atol=2e-3)
    simulation.advance_to(500)
    np.testing.assert_allclose(simulation.states[0].position, [[1, 0, 0], [-1, 0, 0]], atol=2e-3)
    simulation.close()
