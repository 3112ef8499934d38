"""Springs on several threads: the same bytes for any number of them, and the same forces as one spring after another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import particlesim as ps
from particlesim.engine.interactions.bond_layout import (
    FIRST,
    LENGTH,
    OWNS_FIRST,
    OWNS_SECOND,
    SECOND,
    chunk_size,
    in_slots,
    order_of,
    owned,
    shares,
)
from particlesim.engine.simulation import Simulation
from particlesim.integrators import METHODS

STEPS = 12


def island(method: str, precision: str = "double", **springs: Any) -> ps.Scenario:
    """A cloth, a cloud tied together wherever it is near, and threads from one to the other; planes, pins, a kick."""
    normal = {"type": "normal", "mean": 0, "std": 0.3}
    return ps.from_table(
        {
            "simulation": {"duration": 0.012, "dt": 0.001, "integrator": method, "precision": precision},
            "output": {"every": STEPS},
            "particles": [
                {
                    "name": "cloth",
                    "layout": {
                        "type": "cloth",
                        "size": [1, 1],
                        "resolution": [67, 41],
                        "pinned": ["left", "top_right"],
                    },
                    "mass": 0.5,
                    "springs": {
                        "structural": 60.0,
                        "shear": 20.0,
                        "bend": 3.0,
                        "dihedral": 1e-4,
                        "damping": 0.01,
                        **springs,
                    },
                },
                {
                    "name": "cloud",
                    "layout": {
                        "type": "random",
                        "count": 1500,
                        "shape": {"type": "box", "min": [0, 0, 0.05], "max": [1, 1, 0.3]},
                        "velocity": [normal, normal, normal],
                    },
                    "mass": {"type": "uniform", "low": 1e-4, "high": 3e-4},
                },
            ],
            "springs": [
                {"name": "near", "on": "cloud", "within": 0.06, "frequency": 8.0, "damping_ratio": 0.1},
                {
                    "name": "threads",
                    "between": ["cloud", "cloth"],
                    "within": 0.07,
                    "stiffness": 2.0,
                    "break_strain": 0.02,
                },
                {
                    "name": "strings",
                    "between": ["cloth", "cloud"],
                    "within": 0.06,
                    "stiffness": 1.0,
                    "tension_only": True,
                },
            ],
            "angles": [
                {
                    "on": "cloud",
                    "triples": [[k, (k + 700) % 1500, (k + 53) % 1500] for k in range(0, 1500, 7)],
                    "stiffness": 1e-6,
                }
            ],
            "forces": [
                {"type": "gravity"},
                {"type": "linear_drag", "coefficient": 1e-5},
                {"type": "sheet_drag", "fluid": "air", "flow": [{"type": "uniform", "velocity": [3, 1, 5]}]},
            ],
            "motions": [{"on": "cloth", "path": ["x + 0.002*sin(700*t)", "y", "z - 0.1*t*y"]}],
            "planes": [{"normal": [0, 0, 1], "on": ["cloud"], "restitution": 0.5}],
            "impulses": [{"at": 0.0041, "impulse": [1e-5, 0, 0], "on": ["cloud"]}],
        }
    )


def left(scenario: ps.Scenario, threads: int) -> dict[str, bytes]:
    """What a run leaves in memory, as bytes."""
    simulation = Simulation(scenario, threads=threads)
    simulation.advance_to(STEPS)
    found = {"ledger": repr(simulation.ledger()).encode(), "broken": repr(simulation.broken()).encode()}
    for state in simulation.states:
        found[f"{state.name}.x"] = np.ascontiguousarray(state.x[:, : state.count]).tobytes()
        found[f"{state.name}.v"] = np.ascontiguousarray(state.v[:, : state.count]).tobytes()
    simulation.close()
    return found


@pytest.fixture(autouse=True)
def _threads_are_always_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 1)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 1)


@pytest.mark.parametrize(
    ("method", "precision"),
    [
        ("symplectic_euler", "single"),
        pytest.param("stormer_verlet", "double", marks=pytest.mark.slow),
        pytest.param("rk45", "double", marks=pytest.mark.slow),
    ],
)
def test_any_number_of_threads_leaves_the_same_bytes(method: str, precision: str) -> None:
    assert len(shares(67 * 41 + 1500, 8, chunk_size(67 * 41 + 1500))) == 5, (
        "as many threads as chunks at most"
    )
    reference = left(island(method, precision), 1)
    assert b"(0, " not in reference["broken"], "some threads break"
    for threads in (2, 3, 8):
        other = left(island(method, precision), threads)
        assert [name for name, value in reference.items() if other[name] != value] == [], f"{threads} threads"


@pytest.mark.slow
def test_a_run_that_diverges_stops_at_the_same_place_for_any_number_of_threads() -> None:
    scenario = island("symplectic_euler", "single", structural=3e9)  # whose kernel another test needs, too
    messages = []
    for threads in (1, 3):
        simulation = Simulation(scenario, threads=threads)
        with pytest.raises(ps.DivergenceError) as caught:
            simulation.advance_to(4000)  # every step multiplies the amplitude by thousands
        messages.append(str(caught.value))
        simulation.close()
    assert messages[0] == messages[1]


@pytest.mark.sampled(17)
@pytest.mark.parametrize("method", [name for name in METHODS if name != "whfast"])
def test_forces_are_those_of_one_spring_after_another(method: str) -> None:
    # The kernel against the formula in NumPy; the sums are in another order, of a few dozen terms.
    scenario = ps.from_table(
        {
            "simulation": {"duration": 0.1, "dt": 0.1, "integrator": method},
            "output": {"every": 1},
            "particles": [
                {
                    "name": "cloth",
                    "layout": {"type": "cloth", "size": [1, 1], "resolution": [50, 30]},
                    "mass": 1.0,
                    "springs": {"structural": 300.0, "shear": 80.0, "bend": 9.0, "damping": 0.5},
                }
            ],
        }
    )
    simulation = Simulation(scenario, threads=1)
    (state,) = simulation.states
    rng = np.random.default_rng(3)
    rest = {}
    layout = scenario.particles[0].layout
    for kind in layout.kinds:
        i, j = layout.edges(kind).T
        rest[kind] = np.linalg.norm(state.position[i] - state.position[j], axis=1)
    state.x[:, : state.count] += rng.normal(0, 0.01, (3, state.count))
    state.v[:, : state.count] = rng.normal(0, 1, (3, state.count))
    expected = np.zeros((state.count, 3))
    x, v = state.position, state.velocity
    for kind, k in {"structural": 300.0, "shear": 80.0, "bend": 9.0}.items():
        i, j = layout.edges(kind).T
        line = x[i] - x[j]
        length = np.linalg.norm(line, axis=1)
        e = line / length[:, None]
        pull = -(k * (length - rest[kind]) + 0.5 * ((v[i] - v[j]) * e).sum(axis=1))
        np.add.at(expected, i, pull[:, None] * e)
        np.add.at(expected, j, -pull[:, None] * e)
    assert simulation.forces_on(state) == pytest.approx(expected, abs=1e-12)
    simulation.close()


def test_pieces_cover_every_spring_once_and_every_end_has_one_owner() -> None:
    rng = np.random.default_rng(5)
    count = 5000
    i, j = rng.integers(0, count, (2, 20_000))
    grid = np.arange(count - 70)
    grid = grid[grid % 50 > 1]  # rows of 48, with holes of two between them
    i, j = np.concatenate([i[i != j], grid]), np.concatenate([j[i != j], grid + 70])
    chunk = chunk_size(count)
    slots = in_slots(i, j, chunk)
    assert sorted(zip(slots.i[slots.slot], slots.j[slots.slot], strict=True)) == sorted(
        zip(i, j, strict=True)
    )
    assert (slots.spread(i) == np.where(slots.i < 0, 0, slots.i)).all()
    assert (np.delete(slots.i, slots.holes) >= 0).all()
    assert 0 < len(slots.holes) == (slots.i == -1).sum()
    seen = np.zeros(len(slots.i), int)
    for a, b, n, o, first, last in slots.table.tolist():
        spring = slots.i[o : o + n] >= 0
        assert (slots.i[o : o + n] == np.where(spring, np.arange(a, a + n), -1)).all()
        assert (slots.j[o : o + n] == np.where(spring, np.arange(b, b + n), -1)).all()
        assert slots.holes[first:last].tolist() == (o + np.flatnonzero(~spring)).tolist()
        assert a // chunk == (a + n - 1) // chunk
        assert b // chunk == (b + n - 1) // chunk
        seen[o : o + n] += 1
    assert (seen == 1).all()
    for threads in (1, 2, 5):
        ends = np.zeros(2, int)
        for first, last in shares(count, threads, chunk_size(count)):
            mine, begin = owned(slots.table, first, last, chunk, -(-count // chunk))
            ends += [(mine[:, column] * mine[:, 2]).sum() for column in (OWNS_FIRST, OWNS_SECOND)]
            assert begin[0] == 0
            assert begin[-1] == len(mine)
        assert (ends == len(slots.i)).all()


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_particles_move_only_when_no_bond_needs_them_any_more(threads: int) -> None:
    rng = np.random.default_rng(6)
    count = 20_000
    near = rng.integers(0, count - 300, 30_000)
    i, j = near, near + rng.integers(1, 300, near.size)
    i, j = np.append(i, [19_000, 100]), np.append(j, [2500, 7000])  # backwards, and far
    chunk = chunk_size(count)
    chunks = -(-count // chunk)
    table = in_slots(i, j, chunk).table
    early = 0
    for first, last in shares(count, threads, chunk_size(count)):
        mine, _ = owned(table, first, last, chunk, chunks)
        order = order_of([mine], first, last, chunk, chunks)
        assert sorted(order.ready) == list(range(first, last, chunk))
        at = mine[:, FIRST] // chunk
        inside = [(mine[:, end] >= first) & (mine[:, end] < last) for end in (FIRST, SECOND)]
        for k in range(chunks):
            moved = set(order.ready[: order.after[k]] // chunk)
            for end, own in zip((FIRST, SECOND), inside, strict=True):
                touched = mine[:, end] // chunk
                assert moved.isdisjoint(touched[own & (at > k)]), "a later bond needs them"
                assert moved.isdisjoint(touched[own & ~(inside[0] & inside[1])]), "another thread needs them"
                begun = mine[(at == k) & own, end] + mine[(at == k) & own, LENGTH]
                assert (begun <= order.front[k]).all(), "one-particle forces would overwrite those of bonds"
            assert all(min((m + 1) * chunk, last) <= order.front[k] for m in moved), "they have no forces yet"
        early += order.after[-1]
        assert order_of([mine], first, last, chunk, chunks, wait=True).after[-1] == 0
    assert early >= chunks - 2 * threads - 4, "most move early"
