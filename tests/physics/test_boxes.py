"""Periodic boxes: nearest images, wrapped frames, and what is refused."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import particlesim as ps
from particlesim.analysis.motion import mean_square_displacement
from particlesim.engine.simulation import Simulation
from particlesim.errors import ScenarioError, UsageError
from particlesim.interactions.lennard_jones import LennardJones
from particlesim.laws.pair import Pair, pair_force, pair_potential
from particlesim.runs.first_state import misplaced
from particlesim.trajectory.box import in_period

EPS = 2.0**-52
LAW: dict[str, Any] = {
    "type": "lennard_jones",
    "name": "law",
    "epsilon": 1.0,
    "sigma": 1.0,
    "cutoff": 2.5,
    "shift": "force",
}


def boxed(
    position: Any,
    velocity: Any = None,
    *,
    box: dict[str, Any] | None = None,
    method: str = "direct",
    duration: float = 1.0,
    law: dict[str, Any] = LAW,
    precision: str = "double",
    every: int = 50,
) -> ps.Scenario:
    """Atoms of mass 1 in a periodic box of 6 m to a side."""
    x = np.asarray(position, float)
    v = np.zeros_like(x) if velocity is None else np.asarray(velocity, float)
    return ps.from_table(
        {
            "simulation": {
                "duration": duration,
                "dt": 0.002,
                "integrator": "velocity_verlet",
                "precision": precision,
                "box": box or {"size": [6.0, 6.0, 6.0]},
            },
            "output": {"every": every, "precision": "double"},
            "particles": [
                {
                    "name": "atoms",
                    "mass": 1.0,
                    "layout": {"type": "points", "position": x.tolist(), "velocity": v.tolist()},
                }
            ],
            "interactions": [{**law, "method": method}],
        }
    )


def scattered(size: Any, count: int = 60, seed: int = 1, apart: float = 0.85) -> Any:
    """Places in a box, no two of them, nor their images, nearer than `apart`; each moved by some whole boxes."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        x = rng.uniform(0, size)
        d = np.array(found).reshape(-1, 3) - x
        d -= size * np.rint(d / size)
        if not len(d) or (d**2).sum(axis=1).min() > apart**2:
            found.append(x)
    return np.array(found)


def summed_over_images(x: Any, size: Any, periodic: Any) -> tuple[Any, float, Any]:
    """Forces, energy and virial from all pairs with all 27 images of the box."""
    law = LennardJones(**{k: v for k, v in LAW.items() if k != "type"}).cut_record()
    force, energy, virial = np.zeros_like(x), 0.0, np.zeros((3, 3))
    for steps in product((-1, 0, 1), repeat=3):
        for i, j in product(range(len(x)), repeat=2):
            d = x[i] - x[j] - np.array(steps) * size * periodic
            if (i == j) or (np.array(steps) * ~np.array(periodic)).any() or (d**2).sum() >= 2.5**2:
                continue
            p = Pair(*d, 0, 0, 0, 1, 1)
            f = np.array(pair_force(law, p))
            force[i] += f
            energy += 0.5 * pair_potential(law, p)
            virial += 0.5 * np.outer(d, f)
    return force, energy, virial


@pytest.mark.parametrize("method", ["direct", "neighbours"])
@pytest.mark.parametrize("periodic", [(True, True, True), (True, False, True)])
def test_nearest_images_are_those_of_brute_force(method: str, periodic: Any) -> None:
    size = np.array([5.5, 6.0, 7.0])
    x = scattered(size, 50)
    force, energy, virial = summed_over_images(x, size, periodic)
    away = x + np.random.default_rng(2).integers(-2, 3, x.shape) * size * periodic
    box = {"size": size.tolist(), "periodic": list(periodic), "origin": [-1.0, 2.0, 0.5]}
    simulation = Simulation(boxed(away, box=box, method=method), threads=1)
    (island,) = simulation.islands
    (each,) = island.interactions
    c = island.island_columns()
    # Positions away from the box by two of its sides have an error of 16 ε, which the steepest pair takes 10^4 times.
    near = 1e-12 * np.abs(force).max()
    np.testing.assert_allclose(island.forces(0.0).T, force, atol=near)
    np.testing.assert_allclose(each.force_on(c, 7, 0.0), force[7], atol=near)
    assert each.energy(c, 0.0) == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(each.virial(c, 0.0), virial, atol=1e-12 * np.abs(virial).max())
    assert np.abs(force.sum(axis=0)).max() < near
    simulation.close()


def test_steepness_is_that_of_direct_sums() -> None:
    # In so small a box lists hold two images of many particles.
    x, found = scattered(np.full(3, 5.01), 40), []
    for method in ("direct", "neighbours"):
        simulation = Simulation(boxed(x, box={"size": [5.01] * 3}, method=method), threads=1)
        (island,) = simulation.islands
        (each,) = island.interactions
        c = island.island_columns()
        tensors = each.linearise(c, 0.0)
        stiff, _ = (matrix.toarray() for matrix in tensors.jacobians(len(x)))
        (_, (bound, *_)) = next(iter(tensors.loads(1 / c.m, damping=False, rows=1)))
        found.append((stiff, bound))
        simulation.close()
    for direct, near in zip(*found, strict=True):
        np.testing.assert_allclose(near, direct, atol=1e-12 * np.abs(direct).max())


@pytest.mark.parametrize("method", ["direct", "neighbours"])
def test_two_that_meet_across_the_boundary_are_the_shifted_pair(method: str) -> None:
    inside = np.array([[2.0, 3.0, 3.0], [3.2, 3.1, 3.0]])
    across = inside + np.array(
        [[3.9, 0, 0], [-2.1, 0, 0]]
    )  # the same pair, 3.9 further, the second in the next box
    velocity = [[0.5, 0.0, 0.1], [0.7, 0.0, -0.1]]
    a, b = (ps.run(boxed(x, velocity, method=method, every=20)) for x in (inside, across))
    np.testing.assert_allclose(b.final.velocity, a.final.velocity, atol=1e-12)
    apart = np.subtract(*(run.final.unwrapped for run in (b, a)))
    np.testing.assert_allclose(apart, [[3.9, 0, 0], [-2.1, 0, 0]], atol=1e-12)
    assert not np.array_equal(b.final.image, a.final.image)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["direct", "neighbours"])
def test_crossing_the_boundary_keeps_energy_and_momentum(method: str) -> None:
    rng = np.random.default_rng(4)
    x = scattered(np.full(3, 6.0), 100)
    v = rng.normal(size=x.shape) + np.array([3.0, -2.0, 1.0])
    result = ps.run(boxed(x, v, method=method, duration=4.0, every=100))
    energy = result.ledger["kinetic"] + result.ledger["potential.law"]
    # dt² of a leapfrog with a curvature of 10^4 1/s² in collisions; what jumps at a boundary would cost 1 of 800.
    assert np.ptp(energy[1:]) < 2e-3 * result.ledger["kinetic"][0]
    for axis in "xyz":
        assert np.ptp(result.ledger[f"momentum.{axis}"]) < 1e-11
    assert (np.abs(result.final.image).max(axis=0) >= [1, 1, 0]).all()
    assert ((result.final.position >= 0) & (result.final.position <= 6)).all()


def test_pressure_is_in_the_ledger_and_follows_from_how_the_energy_changes() -> None:
    # dU = −P dV at rest: all lengths scaled by 1 ± e.
    x, e, energies = scattered(np.full(3, 6.0), 100), 1e-6, []
    for scale in (1 - e, 1 + e):
        simulation = Simulation(boxed(x * scale, box={"size": [6.0 * scale] * 3}), threads=1)
        energies.append(simulation.ledger()["potential.law"])
        simulation.close()
    slope = (energies[1] - energies[0]) / (2 * e) / (3 * 6.0**3)
    v = np.random.default_rng(5).normal(size=x.shape) + 2.0
    for velocity, kinetic in ((None, 0.0), (v, ((v - v.mean(axis=0)) ** 2).sum() / (3 * 6.0**3))):
        for method in ("direct", "neighbours"):
            simulation = Simulation(boxed(x, velocity, method=method), threads=1)
            assert simulation.ledger()["pressure"] == pytest.approx(kinetic - slope, rel=1e-6)
            simulation.close()


def test_frames_are_wrapped_and_paths_are_not(tmp_path: Path) -> None:
    # Two atoms that never meet: free flight, through the box and through it again.
    start, speed = (
        np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 0.2]]),
        np.array([[9.0, -7.0, 0.5], [9.0, -7.0, 0.5]]),
    )
    box = {"size": [6.0, 6.0, 6.0], "periodic": [True, True, False], "origin": [-1.0, 0.0, 0.0]}
    law = {**LAW, "cutoff": 1.5}
    result = ps.run(boxed(start, speed, box=box, law=law, duration=2.0), tmp_path / "box.vtkhdf")
    assert result.path is not None
    with ps.open(result.path) as trajectory:
        assert trajectory.box == ((-1.0, 0.0, 0.0), (6.0, 6.0, 6.0), (True, True, False))
        for frame in trajectory:
            path = start + speed * frame.time
            np.testing.assert_allclose(frame.unwrapped, path, atol=1e-12)
            assert ((frame.position[:, :2] >= [-1, 0]) & (frame.position[:, :2] <= [5, 6])).all()
            np.testing.assert_allclose(frame.position[:, 2], path[:, 2])
            assert frame.image.dtype == np.int32
        assert np.abs(trajectory[-1].image).max() == 3
        np.testing.assert_allclose(
            mean_square_displacement(trajectory), (speed[0] ** 2).sum() * trajectory.times**2, rtol=1e-12
        )
        np.testing.assert_array_equal(trajectory[-1].position, result.final.position)


def test_coordinates_are_put_into_a_period_in_all_roundings() -> None:
    for period in (1.0, 9.0, 0.3, 1e-9, 7e20):
        rng = np.random.default_rng(3)
        near = period * rng.integers(-3, 4, 1000) * (1 + rng.integers(-2, 3, 1000) * 2.0**-53)
        tiny = -period * 10.0 ** rng.uniform(-300, 0, 1000)
        x = np.concatenate([near, tiny, [0.0, -0.0, -5e-324, 5e-324, period, -period]])
        found = in_period(x, period)
        assert ((found >= 0) & (found < period)).all()
        # what is taken off is a whole number of periods, to rounding
        turns = (x - found) / period
        assert np.abs(turns - np.rint(turns)).max() < 4 * np.finfo(float).eps
    open_axes = in_period([[-3.0, 4.0, -0.5], [np.inf, np.nan, np.inf]], [np.inf, 0.0, 2.0])
    np.testing.assert_array_equal(open_axes, [[-3.0, 4.0, 1.5], [np.inf, np.nan, np.nan]])


def test_same_bytes_for_any_number_of_threads_and_after_a_resume() -> None:
    from particlesim.engine.snapshot import restore, snapshot

    rng, size = np.random.default_rng(6), 13.0
    grid = (np.stack(np.meshgrid(*[np.arange(11)] * 3), -1).reshape(-1, 3) + 0.5) * (size / 11)
    scenario = boxed(grid, rng.normal(size=grid.shape), box={"size": [size] * 3}, method="neighbours")
    found = set()
    for threads in (1, 2):
        simulation = Simulation(scenario, threads=threads)
        simulation.advance_to(20)
        saved = snapshot(simulation)
        simulation.advance_to(40)
        found.add(simulation.states[0].x.tobytes())
        simulation.close()
    resumed = Simulation(scenario, threads=2)
    restore(resumed, saved)
    resumed.advance_to(40)
    found.add(resumed.states[0].x.tobytes())
    resumed.close()
    assert len(found) == 1


@pytest.mark.slow
@pytest.mark.optimised
def test_births_and_deaths_in_a_box_are_those_of_direct_sums() -> None:
    found = []
    for method, threads in (("direct", 1), ("neighbours", 1), ("neighbours", 2)):
        scenario = ps.from_table(
            {
                "simulation": {
                    "duration": 0.3,
                    "dt": 0.002,
                    "integrator": "velocity_verlet",
                    "seed": 3,
                    "box": {"size": [6.0] * 3, "origin": [-3.0] * 3},
                },
                "output": {"every": 25},
                "particles": [
                    {
                        "name": "block",
                        "mass": 1.0,
                        "layout": {
                            "type": "lattice",
                            "counts": [5, 5, 5],
                            "spacing": 1.2,
                            "origin": [-3, -3, -3],
                        },
                    }
                ],
                "emitters": [
                    {
                        "name": "drops",
                        "mass": 0.5,
                        "shape": {"type": "sphere", "center": [0, 0, 3], "radius": 1.0},
                        "rate": 500,
                        "lifetime": {"type": "uniform", "low": 0.02, "high": 0.2},
                        "speed": 4.0,
                    }
                ],
                "interactions": [
                    {"name": "law", "type": "soft_sphere", "epsilon": 40.0, "sigma": 1.2, "method": method}
                ],
            }
        )
        simulation = Simulation(scenario, threads=threads)
        simulation.advance_to(140)
        row = simulation.ledger()
        found.append((np.concatenate([state.position.astype(float) for state in simulation.states]), row))
        simulation.close()
    (direct, row), (near, near_row), (again, _) = found
    assert len(direct) == len(near) > 140
    np.testing.assert_allclose(near, direct, atol=1e-9)
    np.testing.assert_array_equal(near, again)
    assert near_row["pressure"] == pytest.approx(row["pressure"], rel=1e-9)


def test_checks_follow_the_path_and_regions_are_in_the_box() -> None:
    table = boxed(
        [[1.0, 2.0, 3.0], [4.0, 5.0, 0.2]], [[9.0, 0, 0]] * 2, law={**LAW, "cutoff": 1.5}
    ).model_dump(exclude_unset=True)
    # At rest along the path of its ends, longer than half of the box: to the nearest image it would be far from that.
    table["springs"] = [{"on": "atoms", "pairs": [[0, 1]], "stiffness": 1.0}]
    table["checks"] = [
        {"quantity": "position.x", "expression": "x0 + vx0*t", "tolerance": 1e-9},
        {"quantity": "count", "region": {"type": "box", "min": [0, 0, 0], "max": [6, 6, 6]}, "min": 2},
    ]
    assert ps.run(ps.from_table(table)).passed


HEAD = """
[simulation]
duration = 1
dt = 0.01
box = { size = [6, 8, 8] }

[[particles]]
name = "atoms"
mass = 1
charge = 1
radius = 0.1
layout = { type = "points", position = [[1, 1, 1], [3, 3, 3]] }
"""
LJ = '[[interactions]]\ntype = "lennard_jones"\nepsilon = 1\nsigma = 1\n'


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (HEAD + LJ + "cutoff = 3.5\n", 17, ("beyond half of the box", "up to 3 m")),
        (HEAD + LJ, 13, ("has no end", "cutoff = 3 (m)")),
        (
            HEAD.replace("8, 8]", "8, 8], periodic = [true, true, false]")
            + '[[interactions]]\ntype = "coulomb"\n',
            13,
            ("has no end", "not along z", "cutoff = 3 (m)"),
        ),
        (
            HEAD + '[[interactions]]\ntype = "coulomb"\nmethod = "direct"\n',
            13,
            ("only a mesh", 'method = "mesh"'),
        ),
        (HEAD + '[[interactions]]\ntype = "gravity"\nmethod = "tree"\n', 15, ("does not see the images",)),
        (HEAD + "[[planes]]\nnormal = [0, 1, 0]\n", 13, ("cuts a periodic box",)),
        (HEAD + '[[colliders]]\ntype = "sphere"\nradius = 1\n', 13, ("stands in one image",)),
        (HEAD + '[[bodies]]\nshape = { type = "sphere", radius = 0.1 }\n', 13, ("not across the boundary",)),
        (HEAD.replace("size = [6, 8, 8]", "size = [6, 0, 8]"), 5, ("greater than 0",)),
        (HEAD.replace("8, 8]", "8, 8], periodic = [false, false, false]"), 5, ("periodic along no axis",)),
        (HEAD.replace("[1, 1, 1]", "[9, 3, 3]") + LJ + "cutoff = 2\n", 13, ("are at the same place",)),
        (
            HEAD.replace("box = { size = [6, 8, 8] }\n", "").replace(
                "[[particles]]", '[output]\nfields = ["image"]\n[[particles]]'
            ),
            7,
            ("no images without a periodic box",),
        ),
        (
            HEAD
            + "[[emitters]]\nname = 'e'\nmass = 1\nrate = 1\nspeed = 1\nshape = { type = 'point', position = [0, 0, 0] }\n"
            "die = { outside = [[0, 0, 0], [1, 1, 1]] }\n",
            19,
            ("nothing gets outside",),
        ),
        (
            HEAD + "[[emitters]]\nname = 'e'\nmass = 1\nrate = 1\nspeed = 1\n"
            "shape = { type = 'disc', center = [3, 11, 4], radius = 2, normal = [0, 0, 1] }\n",
            18,
            ("gives birth outside of the periodic box along y", "y from 0 to 8 m"),
        ),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_place(
    tmp_path: Path, text: str, line: int, words: tuple[str, ...]
) -> None:
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        Simulation(ps.load(path), threads=1)
    message = str(caught.value)
    assert f"s.toml:{line}:" in message
    for each in words:
        assert each in message


def test_planes_along_open_axes_are_allowed() -> None:
    table = boxed(
        [[1.0, 2.0, 3.0], [4.0, 5.0, 0.2]], box={"size": [6.0] * 3, "periodic": [True, True, False]}
    )
    ps.from_table({**table.model_dump(exclude_unset=True), "planes": [{"normal": [0, 0, 1]}]})


def test_pictures_and_plots_know_the_box(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from particlesim.analysis.plot import plot
    from particlesim.render.scene.box_edges import BoxEdges
    from particlesim.render.scene.trails import collect_trails
    from particlesim.trajectory.box import Box

    edges = BoxEdges(Box((1.0, 2.0, 3.0), (2.0, 4.0, 6.0), (True, True, True)))
    assert set(map(tuple, edges.corners.tolist())) == set(product((1.0, 3.0), (2.0, 6.0), (3.0, 9.0)))
    lengths = np.linalg.norm(edges._points[:, -1] - edges._points[:, 0], axis=1)
    assert sorted(lengths) == pytest.approx([2.0] * 4 + [4.0] * 4 + [6.0] * 4)
    start = [[1.0, 2.0, 3.0], [4.0, 5.0, 0.2]]
    result = ps.run(
        boxed(start, [[9.0, 0, 0], [-9.0, 0, 0]], law={**LAW, "cutoff": 1.5}, every=20), tmp_path / "a.vtkhdf"
    )
    assert result.path is not None
    with ps.open(result.path) as trajectory:
        for quantity in ("rdf", "displacement", "pressure", "power_spectrum"):
            plot(trajectory, quantity, tmp_path / f"{quantity}.png")
        with pytest.raises(UsageError, match="no shells"):  # two particles are as far from the middle
            plot(trajectory, "density_profile", tmp_path / "density_profile.png")
        trails = collect_trails(trajectory, lambda frame: np.zeros(len(frame.position), np.int32))
    assert trails.jumps is not None
    step = np.abs(np.diff(trails.points[..., 0], axis=0))
    np.testing.assert_array_equal(trails.jumps[1:], step > 1.0)  # 0.36 a frame, or almost the whole box back
    assert trails.jumps.any()


def test_large_particles_that_touch_are_refused_in_a_small_box() -> None:
    scenario = {
        "simulation": {"duration": 1.0, "dt": 0.01, "box": {"size": [4.0, 4.0, 4.0]}},
        "particles": [
            {
                "name": "balls",
                "mass": 1.0,
                "radius": 1.1,
                "layout": {"type": "points", "position": [[1, 1, 1], [3, 3, 3]]},
            }
        ],
        "interactions": [{"type": "soft_sphere", "epsilon": 1.0}],
    }
    with pytest.raises(UsageError, match="touch over more than half of the box"):
        Simulation(ps.from_table(scenario), threads=1)


def test_forces_by_place_are_told() -> None:
    from particlesim.preflight.advice import advice

    table = boxed([[1.0, 2.0, 3.0], [4.0, 5.0, 0.2]]).model_dump(exclude_unset=True)
    spring = {"type": "point_spring", "stiffness": 1.0}
    told = advice(ps.from_table({**table, "forces": [spring]}))
    assert any("not of images" in each for each in told)


def test_particles_outside_of_the_box_are_told() -> None:
    told = misplaced(Simulation(boxed([[1.0, 2.0, 3.0], [4.0, -5.0, 0.2], [6.0, 0.0, 0.0]]), threads=1))
    assert told == (
        "1 of 3 particles of 'atoms' start outside of the periodic box: their images inside of it are used",
    )
