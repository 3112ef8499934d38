"""Forces by multipoles: errors as asked for, whatever the particles look like; energy; the same bits by any threads."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import points, table

import particlesim as ps
from particlesim.engine.interactions.tree.calibration import ERROR, LEAST_NEED, TOLERANCE
from particlesim.engine.interactions.tree.field import with_height
from particlesim.engine.interactions.tree.form import field_columns
from particlesim.engine.interactions.tree.tree_pairs import TreePairs
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.errors import PsimError, UsageError

Places = NDArray[np.float64]


def uniform(n: int, rng: np.random.Generator) -> Places:
    return rng.random((n, 3))


def plummer(n: int, rng: np.random.Generator) -> Places:
    """A Plummer sphere of scale 1, cut off at half of a percent of its mass: r = (u^(−2/3) − 1)^(−1/2)."""
    r = 1 / np.sqrt(rng.uniform(0, 0.995, n) ** (-2 / 3) - 1)
    way = rng.normal(size=(n, 3))
    return r[:, None] * way / np.linalg.norm(way, axis=1)[:, None]


def clusters(n: int, rng: np.random.Generator) -> Places:
    """Clumps of sizes that differ a thousand times."""
    k = rng.integers(0, 12, n)
    return rng.random((12, 3))[k] + (10 ** rng.uniform(-4, -1, 12))[k][:, None] * rng.normal(size=(n, 3))


def with_outliers(n: int, rng: np.random.Generator) -> Places:
    """A ball and three particles ten thousand times as far."""
    x = plummer(n, rng)
    x[:3] *= 1e4
    return x


def in_one_place(n: int, rng: np.random.Generator) -> Places:
    """A third of the particles at one point, more than a leaf holds, and as many at two more."""
    x = rng.random((n, 3))
    x[: n // 3], x[n // 3 : n // 2], x[n // 2 : n // 2 + 20] = 0.5, 0.25, 0.75
    return x


SETS = (uniform, plummer, clusters, with_outliers, in_one_place)


def scenario(x: Places, interaction: dict[str, Any], **group: Any) -> dict[str, Any]:
    group = {"mass": 1 / len(x), **group}
    layout = {"type": "points", "position": x.tolist()}
    return table(
        1e-3,
        1e-3,
        particles=[{"name": "bodies", "layout": layout, **group}],
        interactions=[{"name": "pull", "type": "gravity", "constant": 1.0, **interaction}],
    )


def forces(told: dict[str, Any], *, begun: bool = True) -> tuple[Simulation, NDArray[np.float64]]:
    simulation = Simulation(ps.from_table(told))
    island = simulation.islands[0]
    if begun:
        island.begin(simulation.team)
    return simulation, np.asarray(island.forces(0.0), float)


def compare(x: Places, interaction: dict[str, Any], **group: Any) -> tuple[float, Simulation]:
    """The rms relative error of forces by a tree, each relative to no less than a part of the mean force."""
    accuracy = interaction.pop("accuracy")
    tree, found = forces(scenario(x, {**interaction, "method": "tree", "accuracy": accuracy}, **group))
    direct, exact = forces(scenario(x, {**interaction, "method": "direct"}, **group))
    size = np.linalg.norm(exact, axis=0)
    error = np.linalg.norm(found - exact, axis=0) / np.maximum(size, LEAST_NEED * size.mean())
    energies = [
        simulation.islands[0].interactions[0].energy(simulation.islands[0].island_columns(), 0.0)
        for simulation in (tree, direct)
    ]
    assert energies[0] == pytest.approx(energies[1], rel=accuracy)
    direct.close()
    return float(np.sqrt(np.mean(error**2))), tree


@pytest.mark.parametrize("place", SETS)
@pytest.mark.parametrize("accuracy", [1e-2, 1e-4])
def test_errors_of_gravity_are_as_asked_for(place: Any, accuracy: float) -> None:
    x = place(3000, np.random.default_rng(1))
    error, tree = compare(x, {"accuracy": accuracy, "softening": 0.01})
    # All particles are compared with a finer sum, whose own error is a tenth.
    assert error < 1.05 * accuracy
    found = tree.islands[0].interactions[0]
    assert isinstance(found, TreePairs)
    assert found.summary() is not None
    tree.close()


def test_the_error_that_is_told_is_the_one_that_there_is() -> None:
    """Of no more particles than are sampled, the error that the run tells is that of all of them, to the last digit."""
    x = plummer(1000, np.random.default_rng(4))
    error, tree = compare(x, {"accuracy": 1e-3, "softening": 0.01})
    told = tree.islands[0].interactions[0].summary()
    assert told is not None
    assert f"{error:.1e}" in told
    tree.close()


@pytest.mark.slow
def test_what_is_told_holds_where_a_few_have_most_of_the_error() -> None:
    """Ten bodies at the rim of a Plummer sphere may have most of the error, and a sample of a thousand none of them."""
    rng = np.random.default_rng(2)
    r = 1 / np.sqrt(rng.random(12_000) ** (-2 / 3) - 1)
    way = rng.normal(size=(len(r), 3))
    x = r[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    error, tree = compare(x, {"accuracy": 1e-4, "softening": 0.01})
    found = tree.islands[0].interactions[0]
    assert isinstance(found, TreePairs)
    assert error < 1.05e-4
    # The finer sum that others are compared with has errors of a tenth, which may have the same sign.
    assert float(found.limits[ERROR]) == pytest.approx(error, rel=0.12)
    tree.close()


@pytest.mark.slow
def test_leaves_at_the_rim_do_not_decide_how_exact_all_others_are() -> None:
    """A leaf is far from thousands of small cells in the middle, whose errors have one sign in it. Where such leaves are not
    cut further, they alone need a tolerance of 0.3 times the accuracy, and the others twice the work."""
    simulation, _ = forces(
        scenario(plummer(10_000, np.random.default_rng(5)), {"method": "tree", "accuracy": 1e-3})
    )
    limits = simulation.islands[0].interactions[0].limits
    assert np.sqrt(limits[TOLERANCE]) > 3e-3
    simulation.close()


@pytest.mark.parametrize("softening", [0.0, 0.02, 3.0])
def test_errors_hold_for_any_softening(softening: float) -> None:
    # 3 is more than the whole: far cells within one another's softening act by multipoles, too
    error, tree = compare(uniform(3000, np.random.default_rng(2)), {"accuracy": 1e-3, "softening": softening})
    assert error < 1.3e-3
    tree.close()


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [1e-1, 1e-2, pytest.param(1e-4, marks=pytest.mark.slow), 1e-5])
def test_charges_in_the_order_of_a_crystal_are_summed_as_exactly_as_asked(accuracy: float) -> None:
    """Low moments of its cells vanish, and tell nothing of higher ones; and forces are a thousandth of those of pairs."""
    index = np.stack(np.unravel_index(np.arange(15**3), (15, 15, 15)), axis=1)
    q = 1.0 - 2.0 * (index.sum(axis=1) % 2)
    error, tree = compare(
        index.astype(float), {"accuracy": accuracy, "type": "coulomb"}, charge=q.tolist(), mass=1.0
    )
    assert error < 1.3 * accuracy
    tree.close()


@pytest.mark.parametrize("charge", ["random", "alternating", "one_sign"])
def test_errors_of_charges_are_as_asked_for(charge: str) -> None:
    rng = np.random.default_rng(3)
    x = uniform(3000, rng)
    q = {
        "random": rng.normal(size=3000),
        "alternating": np.where(np.arange(3000) % 2, 1.0, -1.0),
        "one_sign": np.full(3000, -2.0),
    }[charge]
    error, tree = compare(x, {"accuracy": 1e-3, "type": "coulomb", "softening": 0.005}, charge=q.tolist())
    assert error < 1.3e-3
    tree.close()


@pytest.mark.parametrize("n", [1, 2, 10, 100])
def test_few_particles_are_near_each_other(n: int) -> None:
    x = uniform(n, np.random.default_rng(4))
    if n == 1:
        simulation, found = forces(scenario(x, {"method": "tree"}))
        assert np.abs(found).max() == 0
    else:
        error, simulation = compare(x, {"accuracy": 1e-4})
        assert error < (1e-7 if n <= 10 else 1.3e-4)  # of few, pairs alone, within the error of 1/√
    simulation.close()


def test_potentials_are_those_of_a_shell() -> None:
    # −G m M/R outside and inside of a shell; the sum over its own particles is −M²/(2R) within 1/√n of shot noise
    rng = np.random.default_rng(5)
    way = rng.normal(size=(4000, 3))
    x = way / np.linalg.norm(way, axis=1)[:, None]
    simulation, _ = forces(scenario(x, {"method": "tree"}))
    island = simulation.islands[0]
    assert island.interactions[0].energy(island.island_columns(), 0.0) == pytest.approx(-0.5, rel=0.03)
    simulation.close()


def test_groups_that_take_no_part_neither_pull_nor_are_pulled() -> None:
    rng = np.random.default_rng(6)
    x, y = uniform(500, rng), uniform(500, rng)
    told = scenario(x, {"method": "tree", "on": ["bodies"], "softening": 0.01})
    told["particles"].append(points(*map(tuple, y), name="others", mass=5.0))
    told["interactions"].append({"name": "weak", "type": "gravity", "constant": 1e-30, "softening": 1.0})
    simulation, found = forces(told)
    alone, exact = forces(scenario(x, {"method": "tree", "softening": 0.01}))
    assert np.abs(found[:, 500:]).max() < 1e-24
    np.testing.assert_allclose(found[:, :500], exact, rtol=1e-2, atol=1e-3 * np.abs(exact).max())
    simulation.close()
    alone.close()


def _moved(threads: int, steps: int = 6) -> tuple[bytes, bytes]:
    told = scenario(clusters(5000, np.random.default_rng(7)), {"method": "tree", "softening": 0.01})
    told["simulation"] |= {"duration": 0.01 * steps, "dt": 0.01}
    told["output"] |= {"every": 3}
    simulation = Simulation(ps.from_table(told), threads=threads)
    simulation.advance_to(steps)
    found = simulation.states[0].x[:, :5000].tobytes(), simulation.states[0].v[:, :5000].tobytes()
    simulation.close()
    return found


def test_threads_do_not_change_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 1)
    assert _moved(1) == _moved(2) == _moved(3)


def test_what_was_measured_goes_on_with_a_run_that_is_resumed() -> None:
    told = scenario(clusters(2000, np.random.default_rng(7)), {"method": "tree", "softening": 0.01})
    told["simulation"] |= {"duration": 0.06, "dt": 0.01}
    whole, first, again = (Simulation(ps.from_table(told)) for _ in range(3))
    whole.advance_to(3)
    whole.advance_to(6)
    first.advance_to(3)
    restore(again, snapshot(first))
    again.advance_to(6)
    for a, b in zip(whole.states[0].arrays(), again.states[0].arrays(), strict=True):
        assert a.tobytes() == b.tobytes()
    for simulation in (whole, first, again):
        simulation.close()


def test_momentum_drifts_by_the_error_and_no_more() -> None:
    x = plummer(3000, np.random.default_rng(8))
    _, found = forces(scenario(x, {"method": "tree", "softening": 0.05, "accuracy": 1e-3}))
    size = np.linalg.norm(found, axis=0)
    drift = np.linalg.norm(found.sum(axis=1))
    assert 0 < drift < 1e-3 * size.sum()


def test_auto_takes_a_tree_for_many() -> None:
    rng = np.random.default_rng(9)
    kinds = []
    for n, accuracy in ((100, 1e-3), (5000, 1e-3), (5000, 5e-5)):
        simulation, _ = forces(scenario(uniform(n, rng), {"accuracy": accuracy}), begun=False)
        kinds.append(isinstance(simulation.islands[0].interactions[0], TreePairs))
        simulation.close()
    assert kinds == [False, True, False]


@pytest.mark.parametrize(
    ("interaction", "words"),
    [
        ({"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0, "cutoff": 2.5}, "no multipoles"),
        ({"cutoff": 2.5}, "cutoff"),
    ],
)
def test_laws_without_multipoles_have_no_tree(interaction: dict[str, Any], words: str) -> None:
    told = scenario(uniform(10, np.random.default_rng(0)), {})
    entry = {"name": "pull", "type": "gravity", "method": "tree", **interaction}
    told["interactions"] = [entry]
    with pytest.raises(PsimError, match=words):
        ps.from_table(told)


@pytest.mark.parametrize(("accuracy", "method"), [(1e-12, "tree"), (1e-3, "direct"), (0.5, "auto")])
def test_accuracies_that_mean_nothing_are_refused(accuracy: float, method: str) -> None:
    with pytest.raises(PsimError, match="accuracy"):
        ps.from_table(
            scenario(uniform(10, np.random.default_rng(0)), {"method": method, "accuracy": accuracy})
        )


@pytest.mark.slow
def test_an_accuracy_out_of_reach_says_what_can_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    from particlesim.engine.interactions.tree import calibration

    monkeypatch.setattr(calibration, "ROUNDS", 1)
    monkeypatch.setattr(calibration, "FIRST", 1e4)
    with pytest.raises(UsageError, match="is reached"):
        forces(scenario(plummer(3000, np.random.default_rng(1)), {"method": "tree", "accuracy": 1e-6}))


@pytest.mark.slow
def test_the_first_frame_is_as_exact_as_all_others(tmp_path: Path) -> None:
    x, accuracy = uniform(4500, np.random.default_rng(2)), 1e-3
    charges = {"mass": 1e9, "charge": np.random.default_rng(3).normal(size=len(x)).tolist()}
    told = scenario(x, {"type": "coulomb", "method": "tree", "accuracy": accuracy}, **charges)
    told["output"] = {"fields": ["force"], "precision": "double"}
    ps.run(ps.from_table(told), tmp_path / "out.vtkhdf")
    direct, exact = forces(scenario(x, {"type": "coulomb", "method": "direct"}, **charges), begun=False)
    direct.close()
    with ps.open(tmp_path / "out.vtkhdf") as trajectory:
        off = np.linalg.norm(trajectory[0]["force"].T - exact, axis=0) / np.linalg.norm(exact, axis=0)
    assert np.sqrt(np.mean(off**2)) < 1.3 * accuracy


@pytest.mark.slow
def test_an_accuracy_out_of_reach_leaves_the_last_run_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from particlesim.engine.interactions.tree import calibration

    x = plummer(3000, np.random.default_rng(1))
    ps.run(ps.from_table(scenario(x, {"method": "tree", "accuracy": 1e-2})), tmp_path / "old.vtkhdf")
    there = (tmp_path / "old.vtkhdf").read_bytes()
    monkeypatch.setattr(calibration, "ROUNDS", 1)
    monkeypatch.setattr(calibration, "FIRST", 1e4)
    for name in ("old", "new"):
        with pytest.raises(UsageError, match="is reached"):
            ps.run(
                ps.from_table(scenario(x, {"method": "tree", "accuracy": 1e-6})),
                tmp_path / f"{name}.vtkhdf",
                overwrite=True,
            )
    assert (tmp_path / "old.vtkhdf").read_bytes() == there
    assert not (tmp_path / "new.vtkhdf").exists()


def test_the_inverse_root_is_as_exact_as_it_says() -> None:
    from particlesim.engine.interactions.tree.inverse_root import inverse_root

    x = np.geomspace(1, 16, 2000)
    for order, bound in ((7, 3e-8), (8, 3e-11)):
        worst = max(abs(inverse_root(float(each), order) * math.sqrt(each) - 1) for each in x)
        assert 0.5 * bound < worst < bound


def test_cells_without_room_are_told_and_change_no_force(monkeypatch: pytest.MonkeyPatch) -> None:
    from particlesim.engine.interactions.tree import field

    monkeypatch.setattr(field, "PARTICLES_PER_CELL", 10**6)
    monkeypatch.setattr(field, "room_for_wide", lambda count: 0)
    error, tree = compare(clusters(3000, np.random.default_rng(1)), {"accuracy": 1e-3, "softening": 0.01})
    assert error < 1.3e-3
    assert "no room" in tree.islands[0].interactions[0].summary()
    tree.close()


def test_particles_that_come_later_have_the_accuracy_too() -> None:
    # at the start there are two bodies, near each other: no tolerance makes an error, and none can be measured
    forces = []
    for method in ("direct", "tree"):
        parts = {
            "particles": [points((0, 0, 0), (1e-3, 0, 0), name="pair", mass=1.0)],
            "emitters": [
                {
                    "name": "cloud",
                    "mass": 1.0,
                    "burst": {"at": 0.01, "count": 3000},
                    "shape": {"type": "ball", "radius": 1},
                }
            ],
            "interactions": [{"type": "gravity", "constant": 1e-3, "softening": 0.01, "method": method}],
        }
        simulation = Simulation(ps.from_table(table(0.03, 0.01, **parts)), threads=1)
        simulation.advance_to(2)
        forces.append(np.hstack([state.velocity.T for state in simulation.states]))
        if method == "tree":
            (pull,) = simulation.islands[0].interactions
            size = pull.size.copy()
            simulation.islands[0].forces(0.02)  # for a frame: the tree remembers the sums of steps alone
            assert np.array_equal(pull.size, size)
            taller, _ = with_height(pull.tree)
            assert taller.room.fields.shape[2] == field_columns(taller.form)[-1]
        simulation.close()
    none_yet = Simulation(ps.from_table(table(0.03, 0.01, **{**parts, "particles": []})), threads=1)
    assert none_yet.ledger()["potential.gravity"] == 0
    none_yet.close()
    direct, tree = forces
    error = np.linalg.norm(tree - direct, axis=0) / np.linalg.norm(direct, axis=0)
    assert np.sqrt(np.mean(error[2:] ** 2)) < 1e-3
