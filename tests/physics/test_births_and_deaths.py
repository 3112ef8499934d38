"""Births and deaths of particles that act on each other, against closed forms, balances, and runs cut differently.

What acts here is a kind of the test's own: every particle is drawn to every other by k times their distance, so that n equal
ones move around their centre with ω² = n k/m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest

import particlesim as ps
from particlesim.compiler import kernel
from particlesim.engine.interactions import bond_layout, registry
from particlesim.engine.interactions.interaction import Floats, Interaction, Site, give
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.state.columns import presence
from particlesim.graph import graph
from particlesim.scenario.tables import Labels, Tables

FIRST_ORDER = ("symplectic_euler", "stormer_verlet")
"""At births and deaths also the second: it takes two steps together, as if no force jumped between them."""
METHODS = ["symplectic_euler", "velocity_verlet", "stormer_verlet", "rk4", "rk45", "implicit_midpoint"]


@dataclass(frozen=True)
class TieSet:
    name: str
    groups: tuple[str, ...]
    k: float
    feeds: bool = False

    def needs_velocity(self) -> bool:
        return False


class TieColumns(NamedTuple):
    k: float
    count: int


class Ties(Interaction, TieColumns):
    __slots__ = ()

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        for i in range(first, last):
            for j in range(c.x.size):
                k = self.k * presence(c.clock, j)
                x, y, z = c.x[j] - c.x[i], c.y[j] - c.y[i], c.z[j] - c.z[i]
                give(total, i, first, last, k * x, k * y, k * z)

    @property
    def number(self) -> int:
        return self.count * (self.count - 1) // 2

    @property
    def effort(self) -> int:
        return 100_000_000  # so that it is worth several threads

    def energy(self, c: Any, t: float) -> float:
        return float(sum_ties(self, c))

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        x = np.stack([c.x, c.y, c.z])
        return self.k * (x - x[:, row : row + 1]).sum(axis=1)


@kernel
def sum_ties(each: Any, c: Any) -> float:
    total = 0.0
    for i in range(c.x.size):
        for j in range(i):
            x, y, z = c.x[j] - c.x[i], c.y[j] - c.y[i], c.z[j] - c.z[i]
            total += 0.5 * each.k * (x * x + y * y + z * z)
    return total


def ties_of(site: Site, ties: TieSet) -> Ties:
    return Ties(ties.k, site.whole.count)


@pytest.fixture(autouse=True)
def ties(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ties among all groups that are named in a scenario's description, behind k."""
    ordinary, labels = graph.interactions_of, Tables.labels
    monkeypatch.setitem(registry.KINDS, TieSet, ties_of)

    def with_label(scenario: Tables) -> Labels:
        found = labels.fget(scenario)  # type: ignore[attr-defined]
        return found._replace(hinges_of_groups=(*found.hinges_of_groups, "ties"))

    monkeypatch.setattr(Tables, "labels", property(with_label))

    def with_ties(scenario: ps.Scenario) -> tuple[Any, ...]:
        k, *names = (scenario.description or "0").split()
        return (*ordinary(scenario), *((TieSet("ties", tuple(names), float(k)),) if names else ()))

    monkeypatch.setattr(graph, "interactions_of", with_ties)


def pair(method: str, dt: float = 0.01, **emitter: Any) -> Simulation:
    """A particle at rest at x = −1 m, and one that is born at x = 1 m."""
    table = {
        "format": 1,
        "description": "4.0 first second",
        "simulation": {"duration": 2.0, "dt": dt, "integrator": method},
        "particles": [{"name": "first", "mass": 2.0, "layout": {"type": "points", "position": [[-1, 0, 0]]}}],
        "emitters": [
            {
                "name": "second",
                "mass": 2.0,
                "shape": {"type": "point", "position": [1, 0, 0]},
                "burst": {"at": 0.5, "count": 1},
                "speed": 0.0,
                **emitter,
            }
        ],
    }
    return Simulation(ps.from_table(table), threads=1)


@pytest.mark.parametrize("method", METHODS)
def test_a_particle_acts_from_its_birth_to_its_death(method: str) -> None:
    # Two of 2 kg with k = 4 N/m: x = ∓cos ωt with ω² = 2 k/m = 4/s², from the birth at 0.5 s to the death at 1.25 s.
    simulation = pair(method, 0.0025, lifetime=0.75)
    simulation.advance_to(200)
    first, second = simulation.states
    assert second.count == 0
    assert np.array_equal(first.position, [[-1, 0, 0]])
    assert not first.velocity.any()
    simulation.advance_to(400)
    assert second.count == 1
    phase = 2.0 * 0.5
    close = 0.006 if method in FIRST_ORDER else 1e-4
    np.testing.assert_allclose(first.position[0], [-math.cos(phase), 0, 0], atol=close)
    np.testing.assert_allclose(second.position[0], [math.cos(phase), 0, 0], atol=close)
    simulation.advance_to(600)
    assert second.count == 0
    speed = 2 * math.sin(2 * 0.75)
    np.testing.assert_allclose(first.velocity[0], [speed, 0, 0], atol=3 * close)
    there = -math.cos(1.5) + speed * 0.25
    np.testing.assert_allclose(first.position[0], [there, 0, 0], atol=3 * close)
    events = simulation.take_events()
    assert [each.times.tolist() for each in events.births] == [[0.5]]
    assert [(each.times.tolist(), each.causes.tolist()) for each in events.deaths] == [([1.25], [1])]
    simulation.close()


@pytest.mark.parametrize("method", METHODS)
def test_births_in_mid_step_cost_an_error_of_first_order(method: str) -> None:
    def miss(dt: float) -> float:
        simulation = pair(method, dt, burst={"at": 0.5 + dt / 3, "count": 1})
        simulation.advance_to(round(1.5 / dt))
        phase = 2 * (1.0 - dt / 3)
        found = [state.position[0, 0] for state in simulation.states]
        simulation.close()
        return float(np.abs(np.array(found) - [-math.cos(phase), math.cos(phase)]).max())

    errors = [miss(dt) for dt in (0.02, 0.01, 0.005)]
    assert errors[0] < 0.05
    assert errors[2] < 0.3 * errors[0]


@pytest.mark.parametrize("method", ["rk45", "dop853", "ias15"])
def test_adaptive_methods_end_a_step_at_every_birth_and_death(method: str) -> None:
    # The first moves along y, at 1 m/s. From the birth on their distance r and its rate w turn by ω, for the time of a life.
    birth, life = 0.5034, 0.7177
    simulation = pair(method, 0.1, burst={"at": birth, "count": 1}, lifetime=life)
    first, second = simulation.states
    first.v[1] = 1.0
    simulation.advance_to(10)
    r, w = np.array([-2.0, birth, 0.0]), np.array([0.0, 1.0, 0.0])

    def apart(t: float) -> tuple[np.ndarray, np.ndarray]:
        c, s = math.cos(2 * t), math.sin(2 * t)
        return r * c + w * s / 2, -2 * r * s + w * c

    def centre(t: float) -> np.ndarray:
        return np.array([0.0, (birth + t) / 2, 0.0])

    distance, _ = apart(1.0 - birth)
    np.testing.assert_allclose(first.position[0], centre(1.0 - birth) + distance / 2, atol=1e-6)
    np.testing.assert_allclose(second.position[0], centre(1.0 - birth) - distance / 2, atol=1e-6)
    simulation.advance_to(20)
    assert second.count == 0
    distance, rate = apart(life)
    velocity = np.array([0.0, 0.5, 0.0]) + rate / 2
    there = centre(life) + distance / 2 + velocity * (2.0 - birth - life)
    np.testing.assert_allclose(first.position[0], there, atol=1e-6)
    simulation.close()


def crowd(method: str = "velocity_verlet", **changes: Any) -> ps.Scenario:
    """Springs, ties and an emitter whose particles die of age, are recycled, and are killed by a plane."""
    return ps.from_table(
        {
            "format": 1,
            "description": "0.005 cloth drops",
            "simulation": {"duration": 0.1, "dt": 0.001, "integrator": method, "seed": 5},
            "output": {"every": 10, **changes.pop("output", {})},
            "particles": [
                {
                    "name": "cloth",
                    "mass": 1.6,
                    "layout": {
                        "type": "cloth",
                        "size": [1, 1],
                        "resolution": [12, 10],
                        "velocity": [0, 0, -1],
                    },
                    "springs": {"structural": 30.0, "bend": 3.0, "dihedral": 1e-3, "damping": 0.02},
                }
            ],
            "emitters": [
                {
                    "name": "drops",
                    "mass": 0.01,
                    "shape": {"type": "sphere", "center": [0.5, 0.5, 0.3], "radius": 0.2},
                    "rate": 2000,
                    "lifetime": {"type": "uniform", "low": 0.01, "high": 0.06},
                    "speed": 1.0,
                    "limit": 60,
                    "when_full": "recycle",
                }
            ],
            "planes": [{"point": [0, 0, -0.01], "normal": [0.1, 0, 1], "contact": "kill"}],
            "forces": [{"type": "sheet_drag", "density": 1.2}],
            **changes,
        }
    )


def final(simulation: Simulation) -> list[np.ndarray]:
    return [
        column.copy() for state in simulation.states for column in state.columns_by_name().values()
    ] + list(simulation.broke().values())


@pytest.mark.sampled(7)
@pytest.mark.parametrize(
    "method", [*METHODS, pytest.param("ias15", marks=[pytest.mark.optimised, pytest.mark.slow])]
)
def test_threads_and_checkpoints_change_no_bit(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        bond_layout, "LEAST", 64
    )  # particles per chunk, so that there is something for three threads
    whole = Simulation(crowd(method), threads=1)
    shared = Simulation(crowd(method), threads=3)
    for frame in range(1, 11):
        whole.advance_to(10 * frame)
        shared.advance_to(10 * frame)
        if frame == 6:
            saved = snapshot(whole)
    assert 20 < whole.states[0].count < 100, "some of the cloth should be dead"
    assert whole.states[1].count > 10
    for mine, theirs in zip(final(whole), final(shared), strict=True):
        assert np.array_equal(mine, theirs)
    resumed = Simulation(crowd(method), threads=1)
    resumed.step = 60
    restore(resumed, saved)
    for frame in range(7, 11):
        resumed.advance_to(10 * frame)
    for mine, theirs in zip(final(whole), final(resumed), strict=True):
        assert np.array_equal(mine, theirs)
    for each in (whole, shared, resumed):
        each.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["velocity_verlet", "rk45", pytest.param("implicit_midpoint", marks=pytest.mark.slow)]
)
def test_work_balances_what_births_and_deaths_bring_and_take(method: str) -> None:
    def rest(dt: float) -> tuple[float, float]:
        clock = {"duration": 0.05, "dt": dt, "integrator": method}
        simulation = Simulation(crowd(method, output={"work": True}, simulation=clock))
        simulation.ledger()
        simulation.advance_to(round(0.05 / dt))
        row = simulation.ledger()
        simulation.close()
        turned = abs(row["work.births"]) + abs(row["work.deaths"])
        return abs(row["balance"]) / turned, turned

    (coarse, turned), (fine, _) = rest(1e-3), rest(5e-4)
    assert turned > 10  # J; what is left falls as dt, as energies at births are those of places nearby
    assert coarse < 2e-4
    assert fine < max(0.65 * coarse, 5e-5)


def test_momentum_is_kept_in_steps_with_births_and_deaths() -> None:
    simulation = pair("velocity_verlet", 0.01, burst={"at": 0.503, "count": 1}, lifetime=0.7)
    simulation.advance_to(110)
    first, second = (state.velocity[0, 0] for state in simulation.states)
    assert abs(first) > 0.5
    assert first + second == pytest.approx(0, abs=1e-12)
    simulation.close()


def test_groups_that_step_together_cool_each_by_its_own_law() -> None:
    # f = T: m v = ∫ T dt = T_a t + (T₀ − T_a)(1 − exp(−r t))/r. The third group does not cool.
    laws = {"fast": (400.0, 300.0, 5.0), "slow": (350.0, 250.0, 0.5), "never": (280.0, 0.0, 0.0)}
    places = {"type": "points", "position": [[0, 0, 0], [1, 0, 0]]}
    group = {"mass": 2.0, "layout": places}
    table = {
        "format": 1,
        "description": "0.0 fast slow never",
        "simulation": {"duration": 1.0, "dt": 0.01, "integrator": "rk4"},
        "particles": [
            {
                **group,
                "name": name,
                "temperature": hot,
                **({"cooling": {"ambient": ambient, "rate": rate}} if rate else {}),
            }
            for name, (hot, ambient, rate) in laws.items()
        ],
        "forces": [{"type": "field", "force": ["T", "0", "0"]}],
    }
    simulation = Simulation(ps.from_table(table), threads=1)
    assert len(simulation.islands) == 1
    simulation.advance_to(100)
    for state, (hot, ambient, rate) in zip(simulation.states, laws.values(), strict=True):
        impulse = ambient + (hot - ambient) * (-math.expm1(-rate) / rate) if rate else hot
        np.testing.assert_allclose(state.velocity[:, 0], impulse / 2, rtol=1e-9)
        np.testing.assert_allclose(state.temperature(1.0), ambient + (hot - ambient) * math.exp(-rate))
    simulation.close()
