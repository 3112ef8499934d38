"""Every scenario that is shipped: it loads, it runs, it is the same for any number of threads, and its physics is right."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import particlesim as ps
from particlesim.emitters import Emitter
from particlesim.forces.attractor import Attractor
from particlesim.groups.group import TracerMotion
from particlesim.layouts import Points
from particlesim.preflight.resources import needs
from particlesim.scenario.dump import dump

FOLDER = Path(__file__).parents[2] / "scenarios"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
G = 9.80665
MEGABYTE = 1 << 20


def shipped(name: str, **simulation: Any) -> ps.Scenario:
    """A shipped scenario, perhaps with another duration or step."""
    return ps.load(FOLDER / f"{name}.toml", {f"simulation.{key}": value for key, value in simulation.items()})


def run(name: str, **simulation: Any) -> ps.Result:
    return ps.run(shipped(name, **simulation))


def test_the_scenarios_of_the_gallery_are_here() -> None:
    assert set(NAMES) >= {
        *("projectile", "projectile_drag", "fountain", "terminal_velocity", "buoyant_ball"),
        *("rain_on_dome", "bouncing_box", "vortex", "harmonic_well", "rotating_habitat", "orbit"),
        *("hanging_cloth", "stiff_cloth", "rope", "pendulum_chain", "newtons_cradle"),
        *("slope", "stairs", "conveyor"),
        *("jelly_drop", "trampoline", "bridge_collapse", "flag", "hair", "head_of_hair"),
        *("cold_collapse", "galaxies"),
        *("cloth_over_sphere", "tablecloth", "folding_cloth", "balls_on_a_trampoline"),
        *("jelly_on_stairs",),
        *("tumbling_box", "dominoes", "wall_hit_by_a_ball", "balls_and_boxes"),
        *("spinning_top", "wrecking_ball"),
        *("argon_melt", "flock", "salt_crystal", "structure_formation", "solar_system", "figure_eight"),
        *("chain_of_rings", "dice", "sand_and_boxes", "afloat", "crate_on_a_rope"),
        *("bullet_and_paper", "marble_run", "sand_pile", "hourglass", "rotating_drum", "brazil_nut"),
        *("gas_in_a_box", "pool_break", "newtons_cradle_by_contact", "rain_on_hills", "sparks"),
    }


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_explains_itself_and_stays_small(name: str) -> None:
    scenario, text = shipped(name), (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    assert scenario.title
    assert scenario.description.endswith(".")
    assert scenario.render.camera.eye is not None, "a camera of its own"
    assert text.startswith("#:schema ./psim.schema.json\n# "), (
        "the schema for editors, then what there is to learn"
    )
    assert text.count("#") >= 4
    assert needs(scenario).disk < 100 * MEGABYTE


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_survives_dump_and_load(name: str) -> None:
    scenario = shipped(name).loaded_from(None, ())  # as if it had come from text, like its copies
    assert ps.loads(dump(scenario)) == scenario
    assert ps.loads(dump(scenario, defaults=True)) == scenario


FEWER = {
    "galaxies": {"near_stars": 1_500, "near_halo": 1_200, "far_stars": 1_500, "far_halo": 1_200},
    "cold_collapse": {"bodies": 6_000},
}
"""Still enough for trees on several threads: all of the bodies take seconds."""


ONE_OF_EACH_KIND = (
    *("fountain", "solar_system", "pendulum_chain"),
    *("bridge_collapse", "argon_melt"),
)
"""Of all ways to step; the others take as long, nearly all of it for compiling."""


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "name",
    [name if name in ONE_OF_EACH_KIND else pytest.param(name, marks=pytest.mark.slow) for name in NAMES],
)
def test_a_scenario_has_the_same_bits_for_any_number_of_threads(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("particlesim.engine.islands.independent.WORTH_THREADS", 1)
    grid = shipped(name).grid
    frame = grid.every * grid.dt
    frames = 2 + math.ceil(max((each.start for each in shipped(name).emitters), default=0.0) / frame)
    few = {"simulation.duration": frames * frame, "checks": []}  # some look at later times
    few |= {f"particles.{group}.layout.count": count for group, count in FEWER.get(name, {}).items()}
    few = ps.load(FOLDER / f"{name}.toml", few)
    one, two = ps.run(few, threads=1), ps.run(few, threads=2)
    for field in ("id", "position", "velocity"):
        assert one.final[field].tobytes() == two.final[field].tobytes()
    assert {k: v.tobytes() for k, v in one.ledger.items()} == {k: v.tobytes() for k, v in two.ledger.items()}


def start_of(scenario: ps.Scenario, group: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Positions and velocities of a listed group."""
    layout = next(g.layout for g in scenario.particles if g.name == group)
    assert isinstance(layout, Points)
    position, velocity = np.array(layout.position), np.array(layout.velocity)
    return position, np.broadcast_to(velocity, position.shape)


QUICK = ("bullet_and_paper", "slope")
"""Some of all kinds; the others take four minutes together. Those of springs and sand are in tests of their own."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in NAMES]
)
def test_the_checks_of_a_scenario_hold(name: str) -> None:
    assert [check.message for check in run(name).checks if not check.passed] == []


def test_projectile_lands_at_its_range() -> None:
    # Level ground at the height of the throw: 2 v_x v_y / g. Velocity Verlet and the time of impact are exact.
    result = run("projectile")
    x, v = start_of(result.scenario, "balls")
    ranges = 2 * v[:, 0] * v[:, 1] / G
    assert result.final.position[:, 0] == pytest.approx(ranges, abs=1e-9)
    assert result.final.position[:, 1] == pytest.approx(x[:, 1], abs=1e-12)
    assert ranges.argmax() == 2
    assert ranges[[0, 1]] == pytest.approx(ranges[[4, 3]], rel=1e-6)


def landing(mass: float, radius: float, velocity: NDArray[Any], height: float, drag: float) -> float:
    """Where a ball lands, by an integrator of order 8 that stops at the ground; ½ ρ c_d = drag."""
    k = drag * math.pi * radius**2 / mass

    def rate(t: float, y: NDArray[Any]) -> list[float]:
        speed = math.hypot(y[2], y[3])
        return [y[2], y[3], -k * speed * y[2], -G - k * speed * y[3]]

    def ground(t: float, y: NDArray[Any]) -> float:
        return float(y[1] - radius)

    ground.terminal = True  # type: ignore[attr-defined]
    start = [0.0, height, velocity[0], velocity[1]]
    return float(solve_ivp(rate, (0, 20), start, "DOP853", events=ground, rtol=1e-11, atol=1e-11).y[0, -1])


@pytest.mark.slow
def test_drag_shortens_the_throw() -> None:
    # RK4 with h ω ~ 0.002 · g/v_t: 1e-10 of the way; the reference is as good.
    result = run("projectile_drag")
    found = result.final.position[:, 0]
    for k, group in enumerate(result.scenario.particles):
        assert isinstance(group.mass, float)
        assert isinstance(group.radius, float)
        x, v = start_of(result.scenario, group.name)
        drag = 0.0 if group.name == "vacuum" else 0.5 * 1.225 * 0.47
        assert found[k] == pytest.approx(landing(group.mass, group.radius, v[0], x[0, 1], drag), rel=1e-8)
    assert found[2] < 0.2 * found[1] < 0.2 * found[0]


@pytest.mark.slow
def test_fountain_keeps_ten_thousand_drops_in_the_air_and_above_the_basin() -> None:
    result = run("fountain")
    final, scenario = result.final, result.scenario
    assert len(final) == result.born - sum(result.died.values())
    assert len(final) >= 10_000
    assert len(scenario.forces) == 2
    assert np.all(final.position[:, 1] >= final["radius"] * (1 - 1e-12))
    (emitter,) = scenario.emitters
    assert isinstance(emitter, Emitter)
    assert result.born == emitter.rate * scenario.simulation.duration
    # No drop rises higher than its speed lifts it without drag; five standard deviations hold 36 000 of them.
    fastest = emitter.speed.mean + 5 * emitter.speed.std  # type: ignore[union-attr]
    assert final.position[:, 1].max() < 0.05 + fastest**2 / (2 * G)


@pytest.mark.slow
def test_beads_sink_with_their_terminal_velocity() -> None:
    # v = v_t tanh(g' t / v_t) with g' = g (1 − ρ_f/ρ_s) and v_t² = 8 r ρ_s g' / (3 ρ_f c_d), still on their way at 1.2 s.
    # With τ = g' h / v_t < 0.02 for the smallest, RK4 errs by less than τ⁵ a step of v_t, and forgets it.
    t = 1.2
    result = run("terminal_velocity", duration=t)
    radius, speed = result.final["radius"], -result.final.velocity[:, 1]
    weight = G * (1 - 997 / 1190)
    v_t = np.sqrt(8 * radius * 1190 * weight / (3 * 997 * 0.44))
    assert len(set(radius.tolist())) == 6
    assert speed == pytest.approx(v_t * np.tanh(weight * t / v_t), rel=1e-7)
    assert np.all(speed > 0.99 * v_t)


def test_balls_float_as_deep_as_they_are_heavy() -> None:
    # h² (3 r − h) = 4 r³ ρ/ρ_f. The slowest motion (ice, 13 kg) fades as e^(−0.9 t): nothing is left after 30 s.
    result = run("buoyant_ball", duration=30.0)
    balls = [g for g in result.scenario.particles if g.name != "water"]
    for group in balls:
        s, r = float(group.density or 0) / 997, 0.15
        h = brentq(lambda h, s=s, r=r: h * h * (3 * r - h) - 4 * r**3 * s, 0, 2 * r, xtol=1e-15)
        y = result.final.position[result.final.of(group.name), 1]
        assert r - y == pytest.approx([h], abs=1e-10)


@pytest.mark.slow
def test_elastic_walls_keep_the_energy_and_the_balls() -> None:
    # Velocity Verlet keeps ½ m v² + m g y exactly under gravity, and an elastic impact at its exact moment changes nothing:
    # what is left is rounding, some ten operations in each of 2400 steps, and adds up like a random walk.
    result = run("bouncing_box")
    energy, final = result.energy, result.final
    assert np.ptp(energy) / energy[0] < 2400 * 1e-15
    low, high = np.array([-1.8, 0, -1]), np.array([1.8, 2, 1])
    r = final["radius"][:, None]
    assert np.all(final.position - r >= low - 1e-12)
    assert np.all(final.position + r <= high + 1e-12)


@pytest.mark.slow
def test_tracers_circle_and_grains_leave_the_vortex(tmp_path: Path) -> None:
    # Tracers: ρ constant, angle ω(ρ) t with ω = Γ/2πρ² (1 − e^(−ρ²/a²)), clockwise seen from −y. RK4: N (ωh)⁵/120.
    # Grains: m (v_ρ' − v_θ²/ρ) = −k v_ρ, so they drift outwards with v_ρ = τ (v_θ²/ρ − v_ρ'); far out, where v_ρ falls as
    # ρ⁻³, v_ρ' = −3 v_ρ²/ρ, and what is left is of second order in τω < 0.2.
    gamma, core, lag, t = 4.0, 0.5, 0.5, 10.0
    path = tmp_path / "vortex.vtkhdf"
    scenario = ps.load(FOLDER / "vortex.toml", {"output.precision": "double", "output.fps": 1})
    assert isinstance(scenario.particles[0].dynamics, TracerMotion)
    ps.run(scenario, path)
    with ps.open(path) as trajectory:
        first, last = trajectory[0], trajectory[-1]
        before, after = (frame.position[frame.of("tracers")][:, [2, 0]] for frame in (first, last))
        grains = last.of("grains")
        start, x, v = first.position[grains], last.position[grains], last["velocity"][grains]
    distance = np.linalg.norm(before, axis=1)
    assert np.linalg.norm(after, axis=1) == pytest.approx(distance, rel=1e-6)
    angle = gamma / (2 * np.pi * distance**2) * -np.expm1(-((distance / core) ** 2)) * t
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.stack(
        [cos * before[:, 0] - sin * before[:, 1], sin * before[:, 0] + cos * before[:, 1]], axis=1
    )
    assert after == pytest.approx(turned, abs=1e-6)
    rho = np.linalg.norm(x, axis=1)
    assert np.median(rho) > 2 * np.median(np.linalg.norm(start, axis=1))
    outward = (v * x).sum(axis=1) / rho
    around = (v[:, 0] * x[:, 2] - v[:, 2] * x[:, 0]) / rho
    assert outward == pytest.approx(lag * (around**2 + 3 * outward**2) / rho, rel=0.2**2)
    assert np.all(around > 0)


def test_the_cube_in_the_well_turns_inside_out_and_comes_back() -> None:
    # x(T/2) = −x(0), x(T) = x(0). Yoshida with ωh = 0.013 errs by 0.1 (ωh)⁴ ωt of the amplitude, 2e-8; k is given to 1e-8.
    start = -0.55 + 0.1 * np.stack(np.meshgrid(*[np.arange(12)] * 3, indexing="ij"), axis=-1)
    corner = start.transpose(2, 1, 0, 3).reshape(-1, 3)
    assert run("harmonic_well", duration=2.0).final.position == pytest.approx(-corner, abs=2e-7)
    assert run("harmonic_well", duration=4.0).final.position == pytest.approx(corner, abs=2e-7)


@pytest.mark.slow
def test_the_crew_sees_curves_where_outside_sees_lines() -> None:
    # Seen from outside x = x0 + v t; the wheel has turned by ωt: the crew sees that line turned back by ωt. All throws reach
    # the rim after 1.25 s, as 2 R v_r/|v|² says. The file's velocities have six digits after the point.
    result = run("rotating_habitat")
    final, t, omega = result.final, 1.25, 0.8
    inside, outside = final.position[final.of("crew")], final.position[final.of("outside")]
    x, v = start_of(result.scenario, "outside")
    assert outside == pytest.approx(x + v * t, abs=1e-12)
    cos, sin = math.cos(omega * t), math.sin(omega * t)
    turned = np.stack(
        [cos * outside[:, 0] + sin * outside[:, 1], cos * outside[:, 1] - sin * outside[:, 0]], axis=1
    )
    assert inside[:, :2] == pytest.approx(turned, abs=1e-5)
    assert np.linalg.norm(inside, axis=1) == pytest.approx(np.full(5, 15.3), abs=1e-5)


def kepler(r: float, v: float, mu: float, t: float) -> NDArray[Any]:
    """Place in the orbit's plane, perihelion ahead, after t from the perihelion at distance r with speed v."""
    a = 1 / (2 / r - v * v / mu)
    e, mean = 1 - r / a, math.sqrt(mu / a**3) * t
    anomaly = brentq(lambda x: x - e * math.sin(x) - mean, mean - 1, mean + 1, xtol=1e-14)
    return np.array([a * (math.cos(anomaly) - e), a * math.sqrt(1 - e * e) * math.sin(anomaly)])


def test_planets_are_where_kepler_says() -> None:
    # Fourth order: half the step leaves a sixteenth of the error, which is largest for Mercury: 352 steps a turn.
    day, misses = 86400.0, []
    for hours in (6, 3):
        result = run("orbit", dt=f"{hours} hour")
        (law,) = result.scenario.forces
        assert isinstance(law, Attractor)
        planets = [g.name for g in result.scenario.particles if g.name != "sun"]
        miss = {}
        for name in planets:
            x, v = start_of(result.scenario, name)
            exact = kepler(x[0, 0], -v[0, 2], law.mu, 730 * day)
            found = result.final.position[result.final.of(name)][0]
            miss[name] = math.dist((found[0], -found[2]), exact) / x[0, 0]
        misses.append(miss)
    assert misses[0]["mercury"] < 1e-4
    assert misses[0]["mercury"] / misses[1]["mercury"] == pytest.approx(16, rel=0.1)
    assert max(misses[0].values()) == misses[0]["mercury"]


def test_the_year_is_a_year() -> None:
    # Sidereal year: 365.2564 days. The file's numbers have seven digits and more.
    scenario = shipped("orbit")
    x, v = start_of(scenario, "earth")
    (law,) = scenario.forces
    assert isinstance(law, Attractor)
    a = 1 / (2 / x[0, 0] - v[0, 2] ** 2 / law.mu)
    assert 2 * math.pi * math.sqrt(a**3 / law.mu) / 86400 == pytest.approx(365.2564, abs=2e-3)


@pytest.mark.slow
def test_a_cold_ball_collapses_in_the_time_of_free_fall() -> None:
    # A fifth of the bodies, up to the moment of greatest density, pi/2 (R^3/(2 G M))^(1/2) = 1.11; until then r = r0
    # cos^2(psi).
    changes = {"simulation.duration": 1.2, "simulation.dt": 0.008, "particles.bodies.mass": 5e-4}
    result = ps.run(
        ps.load(FOLDER / "cold_collapse.toml", {**changes, "particles.bodies.layout.count": 2000})
    )
    t, kinetic = result.times, result.ledger["kinetic"]
    psi = np.array(
        [brentq(lambda p, t=t: p + np.sin(2 * p) / 2 - t * math.sqrt(2), 0, math.pi / 2) for t in t[:21]]
    )
    # Places at random differ by 1/sqrt(n) from an even ball, and softening takes some: 3 %.
    np.testing.assert_allclose(kinetic[5:21], 0.6 * np.tan(psi[5:]) ** 2, rtol=0.04)
    assert t[kinetic.argmax()] == pytest.approx(math.pi / 2 / math.sqrt(2), abs=0.06)
    assert "multipoles" in result.methods["gravity"]


@pytest.mark.slow
def test_tides_draw_a_tail_from_the_disc_that_turns_with_the_other_galaxy() -> None:
    # A fiftieth of the bodies. The disc that turns against it is drawn less.
    parts = ("near_stars", "near_halo", "far_stars", "far_halo")
    changes = {f"particles.{name}.layout.count": 600 if "stars" in name else 400 for name in parts}
    softer = {"interactions.gravity.softening": 0.1, "simulation.dt": 0.06}
    result = ps.run(ps.load(FOLDER / "galaxies.toml", {**changes, **softer}))
    x, group = result.final.position, np.repeat(np.arange(4), (600, 400, 600, 400))
    far_away = [
        (np.linalg.norm(x[group == k] - np.median(x[group == k], axis=0), axis=1) > 2.5).mean()
        for k in (0, 2)
    ]
    assert far_away[1] > 0.05
    assert far_away[1] > 1.5 * far_away[0]
