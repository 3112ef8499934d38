"""Sums over all images by a mesh: errors as asked for against Ewald's sum, energy, pressure, momentum, the same bits."""

from __future__ import annotations

import itertools
import math
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erf, erfc
from simulate import points, table

import particlesim as ps
from particlesim.analysis.ewald import Ewald, ewald_sum
from particlesim.compiler import kernel
from particlesim.engine.interactions.interaction import lone
from particlesim.engine.interactions.mesh import calibration, fourier, influence, split
from particlesim.engine.interactions.mesh.mesh_pairs import MeshPairs
from particlesim.engine.interactions.mesh.plan import FLOOR, Task
from particlesim.engine.interactions.mesh.plan import uniform as of_uniform
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.errors import PsimError, UsageError
from particlesim.interactions.gravity import MutualGravity
from particlesim.laws.pair import Pair, central
from particlesim.process.preparing import told_of_preparing

Places = NDArray[np.float64]
SIZE = (1.0, 2.0, 1.5)
MADELUNG = 1.7475645946331822  # of rock salt: Y. Sakamoto, J. Chem. Phys. 28, 164 (1958)
CSCL = 1.76267477307099  # of CsCl, by the distance of unlike ions


def uniform(n: int, rng: np.random.Generator) -> Places:
    return rng.random((n, 3)) * SIZE


def clusters(n: int, rng: np.random.Generator) -> Places:
    """Clumps of sizes that differ a hundred times."""
    k = rng.integers(0, 12, n)
    spread = 10 ** rng.uniform(-2.5, -0.5, 12)
    return rng.random((12, 3))[k] * SIZE + spread[k][:, None] * rng.normal(size=(n, 3))


def told(x: Places, interaction: dict[str, Any], size: Any = SIZE, **group: Any) -> dict[str, Any]:
    layout = {"type": "points", "position": np.asarray(x).tolist()}
    scenario = table(
        1e-3,
        1e-3,
        particles=[{"name": "bodies", "layout": layout, "mass": 1 / len(x), **group}],
        interactions=[{"name": "pull", "type": "gravity", "constant": 1.0, **interaction}],
    )
    scenario["simulation"]["box"] = {"size": list(size)}
    return scenario


def begun(scenario: dict[str, Any]) -> tuple[Simulation, Any, NDArray[np.float64]]:
    simulation = Simulation(ps.from_table(scenario), threads=1)
    island = simulation.islands[0]
    island.begin(simulation.team)
    return simulation, island.interactions[0], np.asarray(island.forces(0.0), float).T


def rms(found: Places, exact: Ewald, weight: Places, volume: float) -> float:
    """The error that is promised."""
    size = np.linalg.norm(exact.force, axis=1)
    near = FLOOR * np.abs(weight) * math.sqrt((weight**2).mean()) * (len(weight) / volume) ** (2 / 3)
    need = np.maximum(size, np.maximum(calibration.LEAST_NEED * size.mean(), near))
    return float(np.sqrt(np.mean((np.linalg.norm(found - exact.force, axis=1) / need) ** 2)))


def test_ewald_has_the_madelung_constants() -> None:
    g = np.array(list(itertools.product(range(2), repeat=3)), float)
    salt = ewald_sum(g, np.where(g.sum(axis=1) % 2, -1.0, 1.0), box=(2, 2, 2), constant=1.0, error=1e-14)
    assert salt.energy == pytest.approx(-4 * MADELUNG, rel=1e-14)
    x = np.array([[0.0, 0, 0], [0.5, 0.5, 0.5]])
    cesium = ewald_sum(x, [1.0, -1.0], box=(1, 1, 1), constant=1.0, error=1e-14)
    assert -cesium.energy * math.sqrt(0.75) == pytest.approx(CSCL, rel=1e-13)
    assert np.abs(salt.force).max() < 1e-13


def test_ewald_does_not_depend_on_where_it_is_cut() -> None:
    # a box of eight boxes has another splitting, and eight times the energy
    rng = np.random.default_rng(1)
    x, w = uniform(20, rng), rng.normal(size=20)
    for softening in (0.0, 0.1, 2.0):
        one = ewald_sum(x, w, box=SIZE, constant=1.0, softening=softening, error=1e-10)
        copies = [x + np.array(n) * SIZE for n in itertools.product(range(2), repeat=3)]
        eight = ewald_sum(
            np.concatenate(copies),
            np.tile(w, 8),
            box=2 * np.array(SIZE),
            constant=1.0,
            softening=softening,
            error=1e-10,
        )
        assert eight.energy == pytest.approx(8 * one.energy, rel=1e-8)
        np.testing.assert_allclose(eight.force[:20], one.force, atol=1e-8 * np.abs(one.force).max())


def test_ewald_of_two_far_from_their_images_is_coulombs_law() -> None:
    # a dipole of length d feels its images by the cube of d/L: (4π/3)(d/L)³ of its own energy at most
    x = np.array([[0.5, 0.5, 0.5], [0.51, 0.5, 0.5]])
    found = ewald_sum(x, [1.0, -1.0], box=(1, 1, 1), constant=2.0)
    assert found.force[0, 0] == pytest.approx(2 / 0.01**2, rel=1e-5)
    assert found.energy == pytest.approx(-2 / 0.01, rel=1e-5)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"box": (1, 1)}, "periodic"),
        ({"weight": [1.0]}, "shape"),
        ({"error": 1e-20}, "error"),
        ({"softening": -1.0}, "negative"),
        ({"position": [[0, 0, 0], [1, 0, 0]]}, "same place"),
        ({"position": [[0, 0, 0], [-1e-20, 0, 0]]}, "same place"),  # but for rounding at the edge of the box
    ],
)
def test_ewald_refuses_what_it_cannot_sum(given: dict[str, Any], words: str) -> None:
    known: dict[str, Any] = {"position": [[0, 0, 0], [0.5, 0, 0]], "weight": [1.0, -1.0], "box": (1, 1, 1)}
    with pytest.raises(UsageError, match=words):
        ewald_sum(**{**known, **given}, constant=1.0)


@pytest.mark.parametrize("place", [uniform, clusters])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-5])
def test_errors_of_gravity_are_as_asked_for(place: Any, accuracy: float) -> None:
    n = 400
    x, mass = place(n, np.random.default_rng(1)), np.full(n, 1 / n)
    simulation, each, found = begun(told(x, {"accuracy": accuracy, "softening": 0.004}))
    exact = ewald_sum(x, mass, box=SIZE, constant=-1.0, softening=0.004, error=1e-7)
    assert isinstance(each, MeshPairs)
    assert rms(found, exact, mass, 3.0) < 1.01 * accuracy  # all of them are the sample
    # errors of a pair's energy are like those of its force; they add up at random
    pairs = np.sqrt(n) * (n / 3) ** (1 / 3) / n**2
    assert each.energy(simulation.islands[0].island_columns(), 0.0) == pytest.approx(
        exact.energy, rel=accuracy, abs=10 * accuracy * pairs
    )
    assert np.abs(found.sum(axis=0)).max() < 1e-13 * np.abs(found).sum()
    simulation.close()


@pytest.mark.parametrize("softening", [0.0, 0.05, 0.6])
def test_errors_of_charges_hold_for_any_softening(softening: float) -> None:
    # 0.6 is more than half of the box: nothing is left of the near part
    rng, n = np.random.default_rng(3), 300
    x, q = uniform(n, rng), rng.normal(size=n)
    law = {"type": "coulomb", "accuracy": 1e-5, "softening": softening}
    simulation, each, found = begun(told(x, law, charge=q.tolist(), mass=1.0))
    exact = ewald_sum(x, q, box=SIZE, constant=1.0, softening=softening, error=1e-7)
    assert rms(found, exact, q, 3.0) < 1.01e-5
    c = simulation.islands[0].island_columns()
    assert each.energy(c, 0.0) == pytest.approx(exact.energy, rel=1e-4)
    assert "not neutral" in each.summary()
    np.testing.assert_allclose(each.force_on(c, 7, 0.0), found[7], rtol=1e-12)
    simulation.close()


def test_splines_are_points_from_their_reach_on() -> None:
    # the near part ends beyond the spline, so only pairs within 2.8 ε differ from points, by the law of the pair
    n, softening = 300, 0.03
    x, mass = uniform(n, np.random.default_rng(4)), np.full(n, 1 / n)
    law = {"accuracy": 1e-5, "softening": softening, "softened": "spline"}
    simulation, each, found = begun(told(x, law))
    exact = ewald_sum(x, mass, box=SIZE, constant=-1.0, error=1e-7)
    spline, point = MutualGravity(**law, constant=1.0), MutualGravity(constant=1.0)
    for i, j in itertools.permutations(range(n), 2):
        d = x[i] - x[j]
        d -= SIZE * np.rint(d / SIZE)
        if (s := float(d @ d)) < (2.8 * softening) ** 2:
            p = Pair(*d, 0, 0, 0, 1 / n, 1 / n)
            exact.force[i] += (central(spline.record(), p, s)[1] - central(point.record(), p, s)[1]) * d
    assert rms(found, exact, mass, 3.0) < 1.05e-5
    assert each.made.cutoff >= 2.8 * softening
    simulation.close()


def salt(cells: int, accuracy: float, spacing: float = 0.7, **given: Any) -> dict[str, Any]:
    """Rock salt of unit charges, `spacing` between unlike neighbours, moved off the nodes."""
    g = np.array(list(itertools.product(range(2 * cells), repeat=3)), float)
    law = {"type": "coulomb", "accuracy": accuracy, **given}
    q = np.where(g.sum(axis=1) % 2, -1.0, 1.0)
    return told(spacing * (g + 0.123), law, [2 * cells * spacing] * 3, charge=q.tolist(), mass=1.0)


@pytest.mark.parametrize(("cells", "accuracy"), [(1, 1e-6), (3, 1e-6)])
def test_a_mesh_has_the_madelung_constant(cells: int, accuracy: float) -> None:
    scenario = salt(cells, accuracy)
    scenario["output"] |= {"ledger": True}
    result = ps.run(ps.from_table(scenario), threads=1)
    pairs = 4 * cells**3
    first = {name: column[0] for name, column in result.ledger.items()}
    assert -0.7 * first["potential.pull"] / pairs == pytest.approx(MADELUNG, abs=1e-6)
    # U is of the degree −1 in lengths: 3 P V = U for ions at rest
    assert 3 * first["pressure"] * (2 * cells * 0.7) ** 3 == pytest.approx(first["potential.pull"], rel=1e-5)


def test_virials_are_slopes_of_the_energy() -> None:
    # −∂U/∂strain, by differences of Ewald sums in boxes that are stretched along one axis
    rng, n = np.random.default_rng(5), 100
    x, q = uniform(n, rng), rng.normal(size=n)
    law = {"type": "coulomb", "accuracy": 1e-6, "softening": 0.1}
    simulation, each, _ = begun(told(x, law, charge=q.tolist(), mass=1.0))
    found = each.virial(simulation.islands[0].island_columns(), 0.0)
    for axis in range(3):
        energies = []
        for sign in (1, -1):
            stretch = np.ones(3)
            stretch[axis] += sign * 1e-4
            size = (np.array(SIZE) * stretch).tolist()
            energies.append(
                ewald_sum(x * stretch, q, box=size, constant=1.0, softening=0.1, error=1e-9).energy
            )
        assert found[axis, axis] == pytest.approx((energies[1] - energies[0]) / 2e-4, rel=1e-4)
    np.testing.assert_allclose(found, found.T, atol=1e-5 * np.abs(found).max())
    simulation.close()


def moved(threads: int, steps: int = 6) -> tuple[bytes, bytes]:
    x = clusters(3000, np.random.default_rng(7))
    scenario = told(x, {"accuracy": 1e-2, "softening": 0.02})
    scenario["simulation"] |= {"duration": 0.01 * steps, "dt": 0.01}
    scenario["output"] |= {"every": 3}
    simulation = Simulation(ps.from_table(scenario), threads=threads)
    simulation.advance_to(steps)
    found = simulation.states[0].x[:, :3000].tobytes(), simulation.states[0].v[:, :3000].tobytes()
    simulation.close()
    return found


def test_threads_do_not_change_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 1)
    monkeypatch.setattr("particlesim.engine.interactions.mesh.mesh_pairs.WORTH_THREADS", 1)
    assert moved(1) == moved(2) == moved(3)


def test_a_plan_goes_on_with_a_run_that_is_resumed() -> None:
    scenario = told(clusters(600, np.random.default_rng(7)), {"accuracy": 1e-2, "softening": 0.02})
    scenario["simulation"] |= {"duration": 0.06, "dt": 0.01}
    whole, first, again = (Simulation(ps.from_table(scenario), threads=1) for _ in range(3))
    whole.advance_to(3)
    whole.advance_to(6)
    first.advance_to(3)
    restore(again, snapshot(first))
    again.advance_to(6)
    for a, b in zip(whole.states[0].arrays(), again.states[0].arrays(), strict=True):
        assert a.tobytes() == b.tobytes()
    assert again.islands[0].interactions[0].made == whole.islands[0].interactions[0].made
    for simulation in (whole, first, again):
        simulation.close()


def test_energy_is_kept_with_the_square_of_the_step() -> None:
    # Velocity Verlet at h, h/2 and h/4: errors of 16, 4 and 1 parts. What forces of finite accuracy do to the energy is the
    # same for all three, and much less than the energy of a pair, 4.
    g = np.array(list(itertools.product(range(4), repeat=3)), float)
    x = 0.25 * (g + np.random.default_rng(8).uniform(-0.1, 0.1, g.shape))
    q = np.where(g.sum(axis=1) % 2, -1.0, 1.0)
    law = {"type": "coulomb", "accuracy": 1e-5, "softening": 0.2}
    ends = []
    for steps in (20, 40, 80):
        scenario = told(x, law, (1, 1, 1), charge=q.tolist(), mass=1.0)
        scenario["simulation"] |= {"duration": 0.08, "dt": 0.08 / steps}
        scenario["output"] |= {"every": steps, "ledger": True}
        ledger = ps.run(ps.from_table(scenario), threads=1).ledger
        energy = ledger["kinetic"] + ledger["potential.pull"]
        ends.append(energy[-1] - energy[0])
        assert ledger["kinetic"][-1] > 0.5
        assert max(abs(ledger[f"momentum.{axis}"][-1]) for axis in "xyz") < 1e-12
    assert (ends[0] - ends[2]) / (ends[1] - ends[2]) == pytest.approx(5, rel=0.05)
    assert abs(ends[2]) < 1e-3


def test_births_and_deaths_are_followed() -> None:
    # a plan for two becomes one for many; the dead do not act
    x = uniform(200, np.random.default_rng(9))
    scenario = told(x, {"accuracy": 1e-2, "softening": 0.05})
    scenario["simulation"] |= {"duration": 0.03, "dt": 0.01}
    scenario["emitters"] = [
        {
            "name": "cloud",
            "mass": 0.01,
            "burst": {"at": 0.01, "count": 100},
            "lifetime": 0.015,
            "shape": {"type": "box", "min": [0, 0, 0], "max": list(SIZE)},
        }
    ]
    simulation = Simulation(ps.from_table(scenario), threads=1)
    simulation.advance_to(2)
    island = simulation.islands[0]
    assert island.layout.count == 300
    for step in (2, 3):
        simulation.advance_to(step)
        place = np.concatenate([state.position for state in simulation.states])
        mass = np.concatenate([state.mass[: state.count] for state in simulation.states])
        exact = ewald_sum(place, mass, box=SIZE, constant=-1.0, softening=0.05, error=1e-5)
        assert rms(np.asarray(island.forces(simulation.time)).T, exact, mass, 3.0) < 2e-2
    assert island.layout.count == 200
    simulation.close()


def test_auto_takes_the_mesh_in_a_periodic_box() -> None:
    simulation = Simulation(ps.from_table(told(uniform(3, np.random.default_rng(0)), {})), threads=1)
    assert isinstance(simulation.islands[0].interactions[0], MeshPairs)
    simulation.close()


def test_one_particle_alone_feels_nothing() -> None:
    simulation, each, found = begun(told([[0.3, 0.2, 0.1]], {"accuracy": 1e-2, "softening": 1e-9}))
    assert np.abs(found).max() == 0
    # its images and the background: −½ m² 2.8373/L for a cube (M. P. Tosi, Solid State Phys. 16, 1 (1964)); here for a box
    assert each.energy(simulation.islands[0].island_columns(), 0.0) == pytest.approx(
        ewald_sum([[0.3, 0.2, 0.1]], [1.0], box=SIZE, constant=-1.0).energy, rel=1e-3
    )
    simulation.close()


@pytest.mark.parametrize(
    ("interaction", "box", "words"),
    [
        ({"method": "mesh"}, None, "there is none"),
        ({"method": "mesh"}, {"size": [1, 1, 1], "periodic": [True, True, False]}, "not along z"),
        ({}, {"size": [1, 1, 1], "periodic": [True, False, False]}, "not along y and z"),
        ({"method": "mesh", "cutoff": 0.3}, {"size": [1, 1, 1]}, "cutoff"),
        ({"method": "direct"}, {"size": [1, 1, 1]}, "only a mesh"),
        ({"method": "tree"}, {"size": [1, 1, 1]}, "does not see the images"),
        ({"softening": 0.3, "softened": "spline"}, {"size": [1, 1, 1]}, "spline"),
        ({"softening": 0.3, "softened": "spline", "accuracy": 1e-4}, None, "no error to allow"),
        (
            {"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0, "method": "mesh", "constant": None},
            {"size": [1, 1, 1]},
            "not that of 1/r",
        ),
        ({"accuracy": 1e-12}, {"size": [1, 1, 1]}, "accuracy"),
    ],
)
def test_what_a_mesh_cannot_sum_is_refused(interaction: dict[str, Any], box: Any, words: str) -> None:
    scenario = told(uniform(4, np.random.default_rng(0)), interaction)
    scenario["interactions"] = [{k: v for k, v in scenario["interactions"][0].items() if v is not None}]
    scenario["simulation"].pop("box")
    if box is not None:
        scenario["simulation"]["box"] = box
    with pytest.raises(PsimError, match=words):
        ps.from_table(scenario)


def test_an_accuracy_out_of_reach_says_what_can_be_had() -> None:
    scenario = told(uniform(200, np.random.default_rng(0)), {"accuracy": 1e-7})
    scenario["simulation"]["precision"] = "single"
    with pytest.raises(PsimError, match="is reached"):
        begun(scenario)


@pytest.mark.parametrize("method", ["mesh", "auto"])
def test_an_accuracy_below_rounding_is_refused(method: str) -> None:
    scenario = told(uniform(20, np.random.default_rng(0)), {"accuracy": 2e-8, "method": method})
    ps.from_table(scenario)
    scenario["simulation"]["precision"] = "single"
    with pytest.raises(PsimError, match=r"accuracy: forces in single precision .*1e-07 or more"):
        ps.from_table(scenario)


def test_an_accuracy_is_given_up_only_after_a_much_finer_cut() -> None:
    # On a lattice errors of a coarse mesh need not follow its plan: a slightly finer one may be no better.
    task = Task(SIZE, 0.0, 6, 40, 0.3, of_uniform(SIZE, 40))
    ones = np.ones(4)
    sample = calibration.Sample(np.arange(4), np.ones((3, 4)), ones, ones)

    def found(errors: list[float]) -> float:
        return calibration.calibrated(task, 1e-3, sample, 40.0, lambda plan: errors.pop(0))[1]

    assert found([1.2e-3, 1.1e-3, 8e-5]) == 8e-5
    assert found([1.2e-2, 1.1e-1, 1.1e-2, 8e-5]) == 8e-5
    with pytest.raises(UsageError, match=r"1\.1e-03 is reached"):
        found([1.2e-3, 1.1e-3, 1.1e-3, 1.1e-3])


@pytest.mark.parametrize("accuracy", [3e-3, 1e-3])
def test_a_clump_in_a_thin_background_has_the_accuracy_asked_for(accuracy: float) -> None:
    """The first plan is for particles without order; the second, ten times as exact, has a coarser mesh and more errors."""
    rng, n, size = np.random.default_rng(0), 600, (10.0, 10.0, 10.0)
    way = rng.normal(size=(n, 3))
    clump = 3 + 0.3 * rng.random(n)[:, None] ** (1 / 3) * way / np.linalg.norm(way, axis=1)[:, None]
    x = np.concatenate([10 * rng.random((60, 3)), clump])
    mass = np.full(len(x), 0.1)
    law = {"method": "mesh", "accuracy": accuracy, "softening": 0.2}
    simulation, _, found = begun(told(x, law, size, mass=0.1))
    exact = ewald_sum(x, mass, box=size, constant=-1.0, softening=0.2, error=1e-6)
    assert rms(found, exact, mass, 1000.0) < 1.01 * accuracy  # all of them are the sample
    simulation.close()


@pytest.mark.parametrize(
    ("side", "precision", "words"),
    [
        (1e-80, "double", "size.0.*1e-50 to 1e[+]29 m"),
        (1e80, "double", "size.0.*1e-50 to 1e[+]29 m"),
        (1e120, "double", "size.0.*1e-50 to 1e[+]29 m"),
        (1e25, "single", "single precision holds no squares"),
        (1e-49, "double", None),
        (1e28, "double", None),
    ],
)
def test_boxes_beyond_numbers_are_refused(side: float, precision: str, words: str | None) -> None:
    """Forces are as 1/side² in any box that is taken."""
    x = side * np.array([[0.1, 0, 0], [0.4, 0, 0]])
    scenario = told(x, {"softening": 0}, (side,) * 3, mass=1.0)
    scenario["simulation"]["precision"] = precision
    if words is None:
        simulation, _, found = begun(scenario)
        own = begun(told(x / side, {"softening": 0}, (1, 1, 1), mass=1.0))[2]
        assert found * side**2 == pytest.approx(own, rel=1e-3, abs=1e-3 * np.abs(own).max())
        simulation.close()
    else:
        with pytest.raises(PsimError, match=words):
            begun(scenario)


def test_two_in_one_place_are_told() -> None:
    with pytest.raises(PsimError, match="particles 0 and 1 of 'bodies' are at the same place"):
        begun(told([[0.25, 0.1, 0.1], [1.25, 0.1, 0.1]], {}))


def waves(n: int, **given: Any) -> dict[str, Any]:
    layout = {"type": "waves", "counts": [n, n, n], "size": [2.0, 2.0, 2.0], **given}
    scenario = told([[0.0, 0.0, 0.0]], {"accuracy": 1e-2, "softening": 0.02}, (2, 2, 2), mass=8 / n**3)
    scenario["particles"][0]["layout"] = layout
    return scenario


@pytest.mark.slow
def test_a_wave_grows_as_jeans_says() -> None:
    # γ² = 4π G ρ in a medium; a lattice of 16 bodies in the wave differs by (k d)²/12 in the sines of its own waves, 1 %
    rate = math.sqrt(4 * math.pi)
    scenario = waves(12, contrast=0.01, wave=(0, 1, 0), rate=rate)
    scenario["simulation"] |= {"duration": 0.3, "dt": 0.01}
    scenario["output"] |= {"every": 30}
    with closing(Simulation(ps.from_table(scenario), threads=1)) as simulation:
        k = np.array([0.0, np.pi, 0.0])
        state = simulation.states[0]
        before = np.exp(-1j * state.position @ k).mean()
        simulation.advance_to(30)
        after = np.exp(-1j * state.position @ k).mean()
        assert abs(before) == pytest.approx(0.01 / math.sqrt(2), rel=1e-3)  # √2 · contrast · cos has ±k
        assert after / before == pytest.approx(math.exp(0.3 * rate), rel=0.02)
        assert np.abs(state.velocity[:, [0, 2]]).max() < 1e-2 * np.abs(state.velocity[:, 1]).max()


def test_random_waves_have_the_contrast_and_the_slope_asked_for() -> None:
    with closing(
        Simulation(ps.from_table(waves(16, contrast=1e-3, slope=-2, shortest=3)), threads=1)
    ) as simulation:
        x = simulation.states[0].position
    numbers = np.array(list(itertools.product(range(-3, 4), repeat=3)))
    found = np.abs(np.exp(-1j * np.pi * x @ numbers.T).mean(axis=0)) ** 2
    square = (numbers**2).sum(axis=1)
    some = square > 0
    assert found[some].sum() == pytest.approx(1e-6, rel=2e-2)
    # power times k² is the same for all; means of so many squares of Gauss's numbers differ by 11 %, three times
    flat = found[some] * square[some]
    low, high = square[some] <= 9, square[some] > 9
    assert flat[low].mean() == pytest.approx(flat[high].mean(), rel=0.35)


# The parts


@kernel
def transformed(mesh: Any, count: int, waves: Any, lines: Any, factor: Any, share: Any, back: bool) -> None:
    fourier.to_waves(mesh, count, waves, lines, share)
    fourier.filter_waves(mesh, waves, lines, factor, share, back)
    if back:
        fourier.from_waves(mesh, count, waves, lines, share)


@pytest.mark.parametrize("shape", [(16, 32, 48), (48, 16, 64)])
def test_transforms_are_those_of_numpy(shape: tuple[int, int, int]) -> None:
    rng, half = np.random.default_rng(0), fourier.half_of(shape[2])
    a = rng.normal(size=shape)
    mesh = np.zeros((*shape[:2], 2 * half))
    factor = rng.random((shape[0] // 2 + 1, shape[1] // 2 + 1, half))
    waves, lines, last = fourier.new_waves(shape), fourier.new_lines(shape, 1)[0], shape[2] // 2 + 1
    spectrum = np.fft.rfftn(a, axes=(0, 1, 2))
    for back in (False, True):
        mesh[..., : shape[2]] = a
        transformed(mesh, shape[2], waves, lines, factor, lone(1), back)
        if not back:
            found = mesh[..., :last] + 1j * mesh[..., half : half + last]
            np.testing.assert_allclose(found, spectrum, atol=1e-12 * np.abs(spectrum).max())
    index = [np.minimum(np.arange(n), n - np.arange(n)) for n in shape[:2]]
    wanted = (
        np.fft.irfftn(spectrum * factor[index[0]][:, index[1]][..., :last], shape, axes=(0, 1, 2)) * a.size
    )
    np.testing.assert_allclose(mesh[..., : shape[2]], wanted, atol=1e-12 * np.abs(wanted).max())


def test_the_cut_of_a_law_is_that_of_the_error_function() -> None:
    alpha, c = 2.0, 3.0
    far = split.far_of(alpha, 0.0, c, 4.0, 1e-13)
    law = split.Near(MutualGravity(constant=c).record(), split.ByMass(), far)
    for r in (1e-3, 0.2, 1.0, 1.9):
        u, k, q = central(law, Pair(r, 0, 0, 0, 0, 0, 2.0, 5.0), r * r)
        bell = 2 * alpha / math.sqrt(math.pi) * math.exp(-((alpha * r) ** 2))
        near = erfc(alpha * r) / r
        # what is left of the law is a difference of what has the size of the law
        most = 1e-12 * 10 * c
        assert u == pytest.approx(-10 * c * near, abs=most * (1 / r + alpha))
        assert k == pytest.approx(-10 * c * (near + bell) / r**2, abs=most * (1 / r**3 + alpha**3))
        slope = -10 * c * (-3 * (near + bell) / r**3 - 2 * alpha**2 * bell / r) / r
        assert q == pytest.approx(slope, abs=most * (3 / r**5 + alpha**5))


def test_softened_waves_are_the_transform_of_the_far_part() -> None:
    # ∫ 4π r² erf(αR)/R sin(kr)/(kr) dr less that of points, whose transform is known: the difference ends soon
    alpha, softening = 2.0, 0.7
    far = influence.transform(alpha, softening)
    r = np.linspace(1e-6, 60, 400_001)
    big = np.hypot(r, softening)
    for k in (2.0, 5.0):
        # beyond 60 the difference is ε²/2r³ with an oscillating factor: ε²/(2·60²) of 1/k², 1e-4
        rest = (erf(alpha * big) / big - erf(alpha * r) / r) * r * np.sin(k * r) / k
        wanted = 4 * np.pi * (np.trapezoid(rest, r) + math.exp(-(k**2) / (4 * alpha**2)) / k**2)
        assert float(far.values(np.array([k * k]))[0]) == pytest.approx(wanted, rel=2e-3)
        step = np.array([k - 1e-4, k + 1e-4]) ** 2
        slope = np.diff(far.values(step))[0] / 2e-4
        assert float(far.slopes(np.array([k * k]))[0]) == pytest.approx(
            slope / (k * float(far.values(np.array([k * k]))[0])), rel=1e-6
        )


def test_a_burst_of_two_groups_between_which_nothing_acts_is_refused() -> None:
    scenario = told(uniform(4, np.random.default_rng(0)), {"method": "mesh", "between": ["bodies", "others"]})
    scenario["particles"].append(points((0.5, 0.5, 0.5), name="others", mass=1.0))
    with pytest.raises(PsimError, match="between two groups"):
        ps.from_table(scenario)


def test_a_box_too_long_for_a_mesh_is_told_as_such() -> None:
    """300 times as long as wide: 1024 nodes along it are cells as wide as a third of its width."""
    x = np.random.default_rng(3).random((300, 3)) * (300, 1, 1)
    said: list[str | None] = []
    with (
        closing(Simulation(ps.from_table(told(x, {"method": "mesh"}, (300, 1, 1))), threads=1)) as simulation,
        told_of_preparing(said.append),
        pytest.raises(PsimError, match="a box that is not as long: a mesh has 1024 nodes along an axis"),
    ):
        simulation.advance_to(1)
    assert said == ["measuring the errors of forces by a mesh", None]


@pytest.mark.parametrize(("size", "mass"), [((1e5, 1, 1), 1.0), ((1000, 1000, 1), 1.0), (SIZE, 1e300)])
def test_what_a_mesh_cannot_do_is_refused_at_once(size: tuple[float, ...], mass: float) -> None:
    """No minutes go into waves of a box that is too long for a mesh, and no traceback comes of masses beyond numbers."""
    x = np.random.default_rng(3).random((30, 3))
    scenario = told(x, {"method": "mesh", "softening": 0.1}, size, mass=mass)
    message = (
        "is not finite|times as long as it is wide"
        if mass == 1.0
        else "not finite|no finite|beyond|more than double precision holds"
    )
    with pytest.raises(PsimError, match=message):
        ps.run(ps.from_table(scenario), threads=1)
