"""What trajectories tell: arrangements, displacements, temperatures and orbits against closed forms."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from simulate import points, record, table

import particlesim as ps
from particlesim.analysis import structure
from particlesim.analysis.motion import BOLTZMANN, mean_square_displacement, temperature, temperatures
from particlesim.analysis.orbits import orbital_elements
from particlesim.analysis.structure import densest_place, density_profile, power_spectrum, radial_distribution
from particlesim.trajectory.frame import Frame


def test_an_ideal_gas_has_no_structure() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 2, (4000, 3))
    g = radial_distribution(x, box=(2, 2, 2), bins=20)
    # Pairs in a shell scatter by their root.
    assert (np.abs(g.y - 1) < 5 / np.sqrt(np.maximum(g.samples, 1)) + 1e-3).all()
    assert g.samples.sum() == pytest.approx(4000 * 3999 / 2 * 4 / 3 * math.pi / 8, rel=5e-3)


def test_the_default_reach_of_many_particles_has_few_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(structure, "MANY", 1000)
    g = radial_distribution(np.random.default_rng(1).uniform(0, 2, (2000, 3)), box=(2, 2, 2), bins=20)
    # 60 of each within a sphere, each pair once; they scatter by their root
    assert g.samples.sum() == pytest.approx(2000 * 60 / 2, rel=0.02)


def test_a_lattice_has_its_shells() -> None:
    side = np.arange(6.0)
    x = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    g = radial_distribution(x, box=(6, 6, 6), reach=1.89, bins=19)
    assert len(np.flatnonzero(g.samples)) == 3
    assert g.samples.sum() == len(x) * (6 + 12 + 8) / 2


def test_places_a_rounding_outside_of_the_box_are_in_it() -> None:
    x = np.random.default_rng(1).uniform(0, 9, (50, 3))
    x[0, 0] = 0.0
    inside = radial_distribution(x, box=(9, 9, np.inf), bins=10)
    for outside in (-1e-16, -5e-324, 9.0):
        x[0, 0] = outside
        np.testing.assert_array_equal(radial_distribution(x, box=(9, 9, np.inf), bins=10).y, inside.y)


def test_boxes_that_are_too_small_are_told() -> None:
    with pytest.raises(ps.UsageError, match="half of the box"):
        radial_distribution(np.random.default_rng(1).uniform(0, 1, (10, 3)), box=(1, 1, 1), reach=0.6)
    with pytest.raises(ps.UsageError, match="too few"):
        radial_distribution(np.zeros((1, 3)))
    with pytest.raises(ps.UsageError, match="plane"):
        radial_distribution(np.eye(3) * [1, 1, 0])


def test_density_of_a_plummer_sphere() -> None:
    # ρ = 3 M/(4π a³) (1 + r²/a²)^(-5/2); mass within r: M r³/(r² + a²)^(3/2) (Plummer 1911).
    rng = np.random.default_rng(2)
    n = 40_000
    r = 1 / np.sqrt(rng.uniform(0, 1, n) ** (-2 / 3) - 1)
    u = rng.normal(size=(n, 3))
    x = r[:, None] * u / np.linalg.norm(u, axis=1)[:, None] + [1, 2, 3]
    found = density_profile(x, 1 / n, center=(1, 2, 3), bins=15, inner=0.2, outer=4.0)
    expected = 3 / (4 * math.pi) * (1 + found.x**2) ** -2.5
    assert (np.abs(found.y / expected - 1) < 5 / np.sqrt(found.samples) + 0.02).all()
    free = density_profile(x, 1 / n, bins=15, inner=0.2, outer=4.0)
    assert np.abs(free.y / expected - 1).max() < 0.15


def plummer(n: int, seed: int) -> np.ndarray:
    """Places of a Plummer sphere with a scale of 1 m about the origin, without what is beyond 4 m, [m, 3]."""
    rng = np.random.default_rng(seed)
    r = 1 / np.sqrt(rng.uniform(0, 1, n) ** (-2 / 3) - 1)
    u = rng.normal(size=(n, 3))
    return (r[:, None] * u / np.linalg.norm(u, axis=1)[:, None])[r < 4]


@pytest.mark.parametrize("corner", [(0, 0, 0), (10, 0, 3), (-5, 5, 5), (4, 6, 9.99)])
def test_a_density_profile_takes_nearest_images(corner: tuple[float, float, float]) -> None:
    """A sphere anywhere in a periodic box has the profile that it has in free space; along an open axis nothing is cut."""
    x = plummer(20_000, 5)
    for box in ((10, 10, 10), (10, 12, np.inf)):
        there = x + corner
        wrapped = np.where(np.isfinite(box), there % np.array(box), there)
        known: dict[str, float] = {"bins": 12, "inner": 0.2, "outer": 4.0}
        for center in (corner, None):
            alone = density_profile(there, 0.5, center=center, **known)
            found = density_profile(wrapped, 0.5, center=center, box=box, **known)
            if center is not None:  # one at the edge of a shell may be in the next by rounding
                assert np.abs(found.samples - alone.samples).sum() <= 4
            # and the place that is found is one in the core, where the density is even
            assert np.abs(found.y / alone.y - 1).max() < (1e-2 if center is not None else 0.1)
        place = densest_place(wrapped, np.ones(len(x)), box=box)
        away = place - corner - np.where(np.isfinite(box), box, 0) * np.rint((place - corner) / box)
        # within the sphere of the last 200, 1 % of all, where the density is even: r³ = 0.01 (r² + 1)^(3/2)
        assert np.linalg.norm(away) < 0.22
        assert (place[:2] >= 0).all()
        assert (place < box).all()


def test_a_density_profile_ends_at_half_of_the_box() -> None:
    rng = np.random.default_rng(6)
    x = rng.uniform(0, 1, (20_000, 3)) * (4, 4, 2)
    gas = density_profile(x, 2.0, box=(4, 4, 2), bins=10)
    assert 0.9 < gas.x[-1] < 1.0
    # uniform up to the last shell, where the sphere would be cut: numbers scatter by their root
    assert (np.abs(gas.y / (2 * 20_000 / 32) - 1) < 5 / np.sqrt(gas.samples)).all()
    with pytest.raises(ps.UsageError, match="half of the box, 1 m"):
        density_profile(x, box=(4, 4, 2), outer=1.1)
    for box in ((1, 1), (1, 0, 1), (1, np.nan, 1)):
        for of in (density_profile, radial_distribution):
            with pytest.raises(ps.UsageError, match="is no box"):
                of(x, box=box)


def test_a_plot_of_density_knows_the_box(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from particlesim.analysis.plot import arrangement

    x = 0.2 * plummer(400, 7)
    start = [{**points(*x.tolist()), "name": "ball", "mass": 3.0}]
    found = []
    for box in ({"size": [4.0] * 3}, {"size": [4.0] * 3, "origin": [-2.0] * 3}):
        path = tmp_path / f"{len(found)}.vtkhdf"
        scenario = table(1.0, 1.0, particles=start, output={"every": 1, "fields": ["mass"]})
        scenario["simulation"]["box"] = box
        ps.run(ps.from_table(scenario), path)
        with ps.open(path) as trajectory:
            found.append(arrangement(trajectory, "density_profile", None).curve)
    # the box is cut through the middle of the ball, or not at all
    np.testing.assert_allclose(found[0].x, found[1].x, rtol=1e-4)
    expected = density_profile(x, 3.0, box=(4, 4, 4))
    np.testing.assert_allclose(found[1].y, expected.y, rtol=0.05, atol=0.02 * expected.y.max())


def test_power_of_noise_and_of_a_wave() -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(0, 1, (30_000, 3)) * (2.0, 2.0, 2.0)
    raw = power_spectrum(x, box=(2, 2, 2), mesh=32, shot_noise=True)
    noise = 8 / 30_000
    half = len(raw.x) // 2  # waves beyond the Nyquist wave number add to it near this one
    scatter = 5 / np.sqrt(raw.samples[:half] / 2)
    assert (np.abs(raw.y[:half] / noise - 1) < scatter + 0.02).all()
    side = (np.arange(64) + 0.5) / 64 * 2
    grid = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    k, size = 2 * math.pi / 2 * 3, 1e-3
    grid[:, 0] += size * np.sin(
        k * grid[:, 0]
    )  # δ = −a k cos(k x): P = V (a k)²/4 at two of the waves of its shell
    wave = power_spectrum(grid, box=(2, 2, 2), mesh=32, shot_noise=True)
    row = int(np.argmax(wave.y))
    assert wave.x[row] == pytest.approx(k, rel=0.05)
    assert wave.y[row] * wave.samples[row] == pytest.approx(2 * 8 * (size * k) ** 2 / 4, rel=1e-2)


def test_displacement_of_straight_flights(tmp_path: Path) -> None:
    moving = points((0, 0, 0), (1, 0, 0), velocity=[(3, 0, 0), (0, 0, 4)])
    with record(tmp_path / "a.vtkhdf", 1.0, 0.25, particles=[moving], output={"every": 1}) as trajectory:
        t = trajectory.times
        assert mean_square_displacement(trajectory) == pytest.approx(t**2 * (9 + 16) / 2)


def test_temperature_over_time_is_of_a_group_about_its_centre(tmp_path: Path) -> None:
    # one degree of freedom of three moves: 2 · ½ m v² = 3 k_B T / 2; what all have in common does not count
    ends = [points((0, 0, 0), (1, 0, 0), velocity=[(9, 2, 0), (9, -2, 0)], mass=3.0, name="a")]
    ends.append(points((5, 5, 5), mass=1.0, name="b"))
    with record(
        tmp_path / "a.vtkhdf", 1.0, 0.25, particles=ends, output={"every": 1, "fields": ["velocity", "mass"]}
    ) as trajectory:
        found = temperatures(trajectory, group="a")
        assert found == pytest.approx(np.full(5, 2 * 12 / (3 * BOLTZMANN)))
        assert np.isnan(temperatures(trajectory, group="b")).all()
    with (
        record(tmp_path / "b.vtkhdf", 1.0, 0.25, particles=ends, output={"every": 1}) as trajectory,
        pytest.raises(ps.UsageError, match="has no mass"),
    ):
        temperatures(trajectory)


@pytest.mark.parametrize("what", ["free", "pinned", "group"])
def test_temperature_counts_what_can_move(tmp_path: Path, what: str) -> None:
    # Velocities of variance k_B T/m in each direction: T from n particles is off by √(2/(3 n)), 1.5 % of 3000.
    m, t = 6.63e-26, 300.0
    each = {"type": "normal", "mean": 0, "std": math.sqrt(BOLTZMANN * t / m)}
    layout = {"type": "lattice", "counts": [30, 10, 10], "spacing": 1e-9, "velocity": [each] * 3}
    gas = {"name": "gas", "mass": m, "layout": layout}
    if what != "free":
        gas["pinned"] = {"type": "box", "min": [-1e-9] * 3, "max": [14.5e-9, 1e-8, 1e-8]}  # half of them
    fields = {"every": 1, "fields": ["velocity", "mass"]}
    with record(tmp_path / "a.vtkhdf", 1e-13, 1e-13, particles=[gas], output=fields) as trajectory:
        found = temperatures(trajectory, group="gas" if what == "group" else None)
    assert found == pytest.approx(np.full(2, t), rel=4 * math.sqrt(2 / (3 * 1500)))


def test_rods_take_degrees_of_freedom(tmp_path: Path) -> None:
    """Dumb-bells in thermal motion: velocities of free particles without their part along the rod, 5 of 6 freedoms."""
    rng, n, t = np.random.default_rng(3), 2000, 300.0
    m = np.tile([2e-26, 6e-26], n)
    x = np.repeat(rng.random((n, 3)), 2, axis=0)
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    x[1::2] += 1e-3 * way
    v = rng.normal(size=(2 * n, 3)) * np.sqrt(BOLTZMANN * t / m)[:, None]
    w = 1 / m[:2]
    along = ((v[1::2] - v[::2]) * way).sum(axis=1)[:, None] * way / w.sum()
    v[::2] += w[0] * along
    v[1::2] -= w[1] * along
    layouts = [{"type": "points", "position": x[k::2].tolist(), "velocity": v[k::2].tolist()} for k in (0, 1)]
    groups = [
        {"name": name, "mass": float(m[k]), "layout": layouts[k]} for k, name in enumerate(("light", "heavy"))
    ]
    rods = [{"between": ["light", "heavy"], "pairs": [[k, k] for k in range(n)]}]
    output = {"every": 1, "fields": ["velocity", "mass"]}
    with record(tmp_path / "a.vtkhdf", 1e-9, 1e-9, particles=groups, rods=rods, output=output) as trajectory:
        for group in (None, "light", "heavy"):
            found = temperatures(trajectory, group=group)
            assert found == pytest.approx(np.full(2, t), rel=4 * math.sqrt(2 / (2.25 * n)))


def test_arrangements_of_a_recorded_frame_are_those_of_its_particles(tmp_path: Path) -> None:
    """Densities are of masses where frames have them, else of numbers; a group's are of its particles alone."""
    pytest.importorskip("matplotlib")
    from particlesim.analysis.plot import arrangement, plot

    x = np.random.default_rng(2).normal(size=(40, 3))
    groups = [points(*half, name=name, mass=3.0) for name, half in (("a", x[:20]), ("b", x[20:]))]
    for fields in ([], ["mass"]):
        output = {"every": 1, "fields": fields}
        path = tmp_path / f"{len(fields)}.vtkhdf"
        with record(path, 1.0, 1.0, particles=groups, output=output) as trajectory:
            found = arrangement(trajectory, "density_profile", "b")
            expected = density_profile(x[20:], 3.0 if fields else 1.0)
            np.testing.assert_allclose(found.curve.y, expected.y, rtol=1e-6)
            assert found.unit == ("kg/m³" if fields else "1/m³")
            plot(trajectory, "density_profile", tmp_path / f"{len(fields)}.png")


def test_the_noise_of_uneven_masses_is_taken_off() -> None:
    """Particles at random have P = V Σm²/(Σm)² in the mean of all waves, and nothing is left of it."""
    rng = np.random.default_rng(7)
    m = np.repeat([1.0, 20.0], 500)
    x = rng.uniform(0, 1, (1000, 3))
    spectrum, raw = (
        power_spectrum(x, m, box=(1, 1, 1), mesh=32, shot_noise=noise) for noise in (False, True)
    )
    modes, noise = spectrum.samples, (m**2).sum() / m.sum() ** 2
    taken = raw.y - spectrum.y
    # Each wave scatters by P; a wave and its opposite are one.
    assert abs(np.average(spectrum.y, weights=modes)) < 5 * taken.max() / math.sqrt(modes.sum() / 2)
    # Waves beyond the Nyquist wave number, k_N, add to it: the least of them is at 2 k_N − k, and its window is
    # (k/(2 k_N − k))⁶ of that of k.
    ratio = spectrum.x / (2 * math.pi * 32 - spectrum.x)
    assert (taken >= noise * (1 - 1e-12)).all()
    assert (taken <= noise * (1 + 3 * ratio**6 + 1e-3)).all()


@pytest.mark.parametrize("box", [(1.0, 1.0, 1.0), (1.0, 2.0, 4.0)])
def test_nothing_is_left_of_noise_up_to_the_nyquist_wave_number(box: tuple[float, float, float]) -> None:
    n, mesh = 20_000, 64
    x = np.random.default_rng(8).uniform(0, 1, (n, 3)) * box
    raw, spectrum = (power_spectrum(x, box=box, mesh=mesh, shot_noise=noise) for noise in (True, False))
    assert spectrum.x[-1] > 0.94 * math.pi * mesh / max(box)
    # |δ_k|² of a wave scatters by its mean, and a wave and its opposite are one: √(2/modes) of what is taken off. A sixth of
    # the noise was left in the last shell of a cube, where that is 1.3 %.
    assert (np.abs(spectrum.y) < 4.5 * (raw.y - spectrum.y) * np.sqrt(2 / spectrum.samples)).all()


def test_two_particles_make_one_pair() -> None:
    """g of the shell with the pair is V over the shell's volume: two have one pair, n (n − 1)/2, not n²/2."""
    g = radial_distribution([[0, 0, 0], [0.5, 0, 0]], box=(2, 3, 4), reach=0.9, bins=9)
    shells = 4 / 3 * math.pi * np.diff(np.linspace(0, 0.9, 10) ** 3)
    assert (g.y * shells).max() == pytest.approx(24, rel=1e-12)
    assert g.samples.sum() == np.count_nonzero(g.y) == 1


def test_the_densest_place_is_where_the_mass_is() -> None:
    rng = np.random.default_rng(5)
    light, heavy = rng.normal(0, 0.1, (700, 3)), rng.normal((3, 0, 0), 0.1, (300, 3))
    mass = np.repeat([1.0, 10.0], [700, 300])
    found = densest_place(np.concatenate([light, heavy]), mass)
    # The last sphere holds at least ten particles: their centre is within 0.1 of that of the cluster.
    assert np.linalg.norm(found - [3, 0, 0]) < 0.1


def test_displacements_follow_particles_by_their_ids() -> None:
    """Rows are in no order of ids, and change when particles die and are born."""

    def frame(ids: list[int], x: list[float]) -> Frame:
        columns = {"id": np.array(ids), "position": np.array([[each, 0, 0] for each in x], float)}
        return Frame(
            index=0,
            time=0,
            step=0,
            count=len(ids),
            fields=("id", "position"),
            groups=(),
            load=columns.__getitem__,
        )

    seen = [frame([5, 2, 9], [50, 20, 90]), frame([9, 5, 2], [91, 52, 23]), frame([11, 2], [0, 26])]
    found = mean_square_displacement(seen)  # type: ignore[arg-type]
    assert found == pytest.approx([0, (1 + 4 + 9) / 3, 36])


def test_the_motion_of_the_centre_takes_three_degrees_of_freedom() -> None:
    """Two particles of 1 kg that part at ±1 m/s beside any drift: 3 k T/2 = 1 J, as only (6 − 3) directions are left."""
    v = [[6.0, 2, 3], [4.0, 2, 3]]
    assert temperature(v, 1.0) == pytest.approx(2 / (3 * BOLTZMANN), rel=1e-14)


def test_temperature_is_that_of_the_motion_about_the_centre() -> None:
    rng = np.random.default_rng(4)
    m = 6.6e-26
    v = rng.normal(scale=math.sqrt(BOLTZMANN * 300 / m), size=(20_000, 3)) + np.array([500.0, 0, 0])
    assert temperature(v, m) == pytest.approx(300, rel=5 * math.sqrt(2 / 3 / 20_000))


def test_elements_come_back() -> None:
    # From elements to a state by the usual rotations, and back.
    a, e, i, node, peri, anomaly, mu = 2.0, 0.3, 0.4, 1.1, 5.2, 2.5, 3.0
    p = a * (1 - e * e)
    r = p / (1 + e * math.cos(anomaly))
    flat = np.array([math.cos(anomaly), math.sin(anomaly), 0]) * r
    fast = np.array([-math.sin(anomaly), e + math.cos(anomaly), 0]) * math.sqrt(mu / p)

    def turn(angle: float, axis: int) -> np.ndarray:
        c, s = math.cos(angle), math.sin(angle)
        return np.array(
            [[c, -s, 0], [s, c, 0], [0, 0, 1]] if axis == 2 else [[1, 0, 0], [0, c, -s], [0, s, c]]
        )

    q = turn(node, 2) @ turn(i, 0) @ turn(peri, 2)
    found = orbital_elements(q @ flat, q @ fast, mu)
    for value, expected in zip(
        (found.semi_major_axis, found.eccentricity, found.inclination, found.ascending_node),
        (a, e, i, node),
        strict=True,
    ):
        assert value[0] == pytest.approx(expected, rel=1e-13)
    assert found.pericentre[0] == pytest.approx(peri, rel=1e-13)
    assert found.true_anomaly[0] == pytest.approx(anomaly, rel=1e-13)
    assert found.period[0] == pytest.approx(2 * math.pi * math.sqrt(a**3 / mu), rel=1e-13)


def test_circles_in_the_plane_have_angles_too() -> None:
    found = orbital_elements((0, 2, 0), (-1 / math.sqrt(2), 0, 0), 1.0)
    assert found.eccentricity[0] < 1e-15
    assert found.ascending_node[0] == found.pericentre[0] == 0
    assert found.true_anomaly[0] == pytest.approx(math.pi / 2)
    hyperbola = orbital_elements((1, 0, 0), (0, 2, 0), 1.0)
    assert hyperbola.semi_major_axis[0] == -0.5
    assert hyperbola.eccentricity[0] == 3
    assert math.isinf(hyperbola.period[0])


def test_shapes_that_do_not_fit_are_told() -> None:
    x, v = np.eye(3)[:2], np.eye(3)[1:]
    for wrong in ([1.0, 2.0, 3.0], [[1.0], [2.0]], []):
        with pytest.raises(ps.UsageError, match="mu has the shape") as told:
            orbital_elements(x, v, wrong)
        assert told.value.hint == "one number, or [2], is needed"
        for of in (
            partial(temperature, v),
            partial(density_profile, x),
            partial(power_spectrum, x, box=(1, 1, 1)),
        ):
            with pytest.raises(ps.UsageError, match="mass has the shape"):
                of(wrong)
            for none in (0.0, [-1.0, 1.0], [np.nan, 1.0]):
                with pytest.raises(ps.UsageError, match="masses are not all 0"):
                    of(none)
    with pytest.raises(ps.UsageError, match=r"body 1 is at \[ *0\. +nan +0\. *\] with velocity"):
        orbital_elements([[1, 0, 0], [0, np.nan, 0]], v, 1.0)
    for one, other in ((x, v[:1]), (x[:, :2], v[:, :2]), (np.eye(3)[None], np.eye(3)[None])):
        with pytest.raises(ps.UsageError, match="positions have the shape"):
            orbital_elements(one, other, 1.0)
    with pytest.raises(ps.UsageError, match="centre has the shape"):
        density_profile(x, center=(1, 2))
    both = orbital_elements(x, v, [1.0, 4.0])
    assert both.period[0] == pytest.approx(orbital_elements(x[0], v[0], 1.0).period[0])
    assert both.period[1] == pytest.approx(orbital_elements(x[1], v[1], [4.0]).period[0])
