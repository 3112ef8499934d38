"""Implicit steps: decay by the amplification factor, the rest shape of a hanging net, momentum, stiff springs, threads.

Kernels take long to compile, so that all islands here are of two kinds: one group with a pinned particle, one set of
springs, one of angles, gravity and linear drag (and the same for the method that remembers); or a cloth with dihedrals in
the wind.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.integrators import METHODS, ImplicitMethod
from particlesim.laws.registry import GENERICS, force_dx, triangle_force_dv

IMPLICIT = [name for name, method in METHODS.items() if isinstance(method, ImplicitMethod)]
K, M = 50.0, 2.0
OMEGA = math.sqrt(K / M)


def body(
    layout: dict[str, Any],
    spring: dict[str, Any],
    angle: dict[str, Any] | None = None,
    *,
    g: float = 0.0,
    drag: float = 0.0,
    **group: Any,
) -> dict[str, Any]:
    """A group with springs, angles (without stiffness unless given), gravity and drag, as parts of a scenario."""
    return {
        "particles": [{"name": "body", "layout": layout, **group}],
        "springs": [{"on": "body", **spring}],
        "angles": [{"on": "body", "triples": [[0, 1, 2]], "stiffness": 0.0, **(angle or {})}],
        "forces": [
            {"type": "gravity", "acceleration": [0, -g, 0]},
            {"type": "linear_drag", "coefficient": drag},
        ],
    }


def pinned_spring(method: Any, h: float, steps: int) -> ps.Result:
    """A mass on a spring to a pinned point, 0.1 m out of rest, along an axis: a linear oscillator."""
    layout = {"type": "points", "position": [[0, 0, 0], [0, 1, 0], [1.1, 0, 0]]}
    spring = {"pairs": [[0, 2]], "stiffness": K, "rest_length": 1.0}
    return simulate(steps * h, h, method, **body(layout, spring, mass=M, pinned=[0, 1]))


def well(method: Any, h: float, steps: int) -> ps.Result:
    """The same oscillator without a spring, stepped alone."""
    field = {"type": "field", "force": ["-k*(x - 1)", "0", "0"], "constants": {"k": K}}
    return simulate(steps * h, h, method, particles=[points((1.1, 0, 0), mass=M)], forces=[field])


@pytest.mark.parametrize(
    ("name", "scene"),
    [(name, scene) for name in IMPLICIT for scene in (pinned_spring, well)],
)
def test_oscillators_decay_by_the_amplification_factor(name: str, scene: Any) -> None:
    # ζ = x + v/(iω) obeys ζ' = iω ζ, and for real x and v the one-step map of a method acts on it as R(iωh). A two-step
    # method comes to its larger root when the other, about 1/3, is gone: 3⁻⁴⁰ is below rounding.
    method = METHODS[name]
    assert isinstance(method, ImplicitMethod)
    options = {} if name == "backward_euler" else {"tolerance": 1e-14}
    h, steps = 0.3 / OMEGA, 40
    states = []
    for n in (steps, steps + 1):
        final = scene({"method": name, **options}, h, n).final
        states.append(final.position[-1, 0] - 1.0 - 1j * final.velocity[-1, 0] / OMEGA)
    assert states[1] / states[0] == pytest.approx(complex(method.amplification(0.3j)), abs=100 * steps * EPS)


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8])
def test_a_first_step_with_a_past_gains_nothing_however_stiff_what_pulls_is(stiffness: float) -> None:
    """Begun with a past under the force that acts at first, (ω h)²/16 times the energy was there after it: 7 times at
    ω h = 10."""
    h = 1e-2
    spring = [{"type": "point_spring", "stiffness": stiffness}]
    ledger = simulate(
        20 * h,
        h,
        "bdf2",
        particles=[points((0.1, 0, 0), mass=1.0)],
        forces=spring,
        output={"every": 1, "ledger": True},
    ).ledger
    energy = ledger["kinetic"] + ledger["potential.point_spring"]
    assert energy[1] == pytest.approx(energy[0], rel=1e-9)
    assert (np.diff(energy[1:]) < 0).all()


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_a_stretched_body_of_stiff_springs_gains_nothing_as_bdf2_begins(speed: float) -> None:
    """Its first step had no solution."""
    cube = {
        "mass": 1.0,
        "layout": {"type": "jelly", "origin": [0, 0, 0], "size": [0.3] * 3, "resolution": [4] * 3},
        "springs": {"structural": 1e5, "shear": 1e5},
    }
    scenario = ps.from_table(table(0.1, 5e-3, "bdf2", particles=[cube], forces=[]))
    simulation = Simulation(scenario)
    (state,) = simulation.states
    rng = np.random.default_rng(0)
    state.x[0] *= 1.1 if speed == 0 else 1.0
    state.v[:] = speed * rng.normal(size=state.v.shape)
    energies = []
    for step in range(21):
        simulation.advance_to(step)
        row = simulation.ledger()
        energies.append(row["kinetic"] + sum(row[name] for name in row if name.startswith("potential.")))
    simulation.close()
    assert np.diff(energies).max() <= 1e-8 * energies[0]
    assert energies[-1] < 0.1 * energies[0]  # it goes on, and turns


@pytest.mark.parametrize("name", IMPLICIT)
@pytest.mark.parametrize("rest", [180.0, 90.0])
def test_an_arm_held_by_an_angle_decays_by_the_amplification_factor(rest: float, name: str) -> None:
    # ω = √(k/m)/L, as for a spring, to both sides: a straight angle has no plane. The swing of 10⁻⁶ changes ω by its square,
    # and the length, which the spring would feel, likewise. A square angle holds in its plane alone.
    method = METHODS[name]
    assert isinstance(method, ImplicitMethod)
    small, length, stiffness = 1e-6, 0.5, 3.0
    omega = math.sqrt(stiffness / M) / length
    h, steps = 0.3 / omega, 40
    foot = [-1.0, 0.0, 0.0] if rest == 180 else [0.0, -1.0, 0.0]
    arms = []
    for axis in (1, 2) if rest == 180 else (1,):
        end = [length, 0.0, 0.0]
        end[axis] = small * length
        layout = {"type": "points", "position": [foot, [0, 0, 0], end]}
        spring = {"pairs": [[1, 2]], "stiffness": 1.0, "rest_length": length}
        angle = {"stiffness": stiffness, "rest_angle": rest}
        parts = body(layout, spring, angle, mass=M, pinned=[0, 1])
        options = {} if name == "backward_euler" else {"tolerance": 1e-12}
        arms.append((axis, {"method": name, **options}, parts))
    for axis, stepper, parts in arms:
        states = []
        for n in (steps, steps + 1):
            final = simulate(n * h, h, stepper, **parts).final
            states.append(final.position[-1, axis] - 1j * final.velocity[-1, axis] / omega)
        expected = complex(method.amplification(0.3j))
        assert states[1] / states[0] == pytest.approx(expected, rel=1e-4), "xyz"[axis]


def hanging(method: Any, duration: float, dt: float) -> ps.Result:
    """A net that hangs by two corners, strongly damped."""
    layout = {"type": "lattice", "counts": [7, 6, 1], "spacing": 0.08}
    spring = {"within": 0.12, "stiffness": 40.0, "damping": 0.05}
    return simulate(
        duration, dt, method, **body(layout, spring, g=9.8, drag=0.01, mass=2e-3, pinned=[35, 41])
    )


def test_a_hanging_net_comes_to_the_same_rest_as_with_an_explicit_method() -> None:
    # At rest every method solves f = 0. Drag of 0.01 kg/s on 2 g leaves e^(−5 t/2) of what swings, e^(−25) here.
    explicit = hanging("symplectic_euler", 10.0, 1e-3)
    assert np.abs(explicit.final.velocity).max() < 1e-8
    for method in ("backward_euler", {"method": "backward_euler", "converged": True}):
        implicit = hanging(method, 10.0, 0.02)
        assert implicit.final.position == pytest.approx(explicit.final.position, abs=1e-7)


def block(method: Any, stiffness: float = 2e3, dt: float = 0.02, count: int = 5) -> dict[str, Any]:
    """A block of springs, turning and falling, and a particle far away that nothing touches."""
    grid = np.stack(np.meshgrid(*[np.arange(count) * 0.1] * 3), axis=-1).reshape(-1, 3)
    turning = np.cross((0.0, 0.5, 1.0), grid - grid.mean(axis=0)) + np.array((0.3, 0.1, 0.0))
    layout = {
        "type": "points",
        "position": [[9, 9, 9], *grid.tolist()],
        "velocity": [[0, 0, 0], *turning.tolist()],
    }
    number = len(grid)
    triples = [[k, 1 + (k + 70) % number, 1 + (k + 31) % number] for k in range(1, number, 5)]
    parts = body(
        layout,
        {"within": 0.15, "stiffness": stiffness},
        {"triples": triples, "stiffness": 1e-3 * stiffness},
        g=9.8,
        mass=0.01,
    )
    return table(10 * dt, dt, method, **parts, output={"ledger": True})


def test_momentum_is_kept_whatever_the_tolerance_of_the_solution() -> None:
    # Springs push both ends alike in the matrix, too: what a step adds to M g h is the sum of its residual: taken out.
    scenario = ps.from_table(block({"method": "backward_euler", "tolerance": 1e-2}))
    ledger = ps.run(scenario).ledger
    mass, fallen = 1.26, 9.8 * 0.2
    gained = ledger["momentum.y"][-1] - ledger["momentum.y"][0] + mass * fallen
    assert abs(gained) < 1e4 * EPS
    assert abs(ledger["momentum.x"][-1] - ledger["momentum.x"][0]) < 1e4 * EPS


@pytest.mark.parametrize("method", IMPLICIT)
@pytest.mark.parametrize("layout", ["points", "rope"])
@pytest.mark.parametrize(("precision", "height", "dt"), [("single", 100.0, 1e-3), ("double", 6.371e6, 1e-5)])
def test_what_moves_less_in_a_step_than_places_are_rounded_is_accelerated(
    method: str, layout: str, precision: str, height: float, dt: float
) -> None:
    # a h² is a hundredth of what places are rounded to: it had stood still, with no energy lost
    at = [0.0, height, 0.0]
    placed: dict[str, Any] = points(at, mass=1.0)
    if layout == "rope":
        rope = {"type": "rope", "start": at, "end": [1.0, height, 0.0], "count": 4}
        placed = {"mass": 1.0, "layout": rope, "springs": {"structural": 1.0}}
    scenario = table(100 * dt, dt, method, particles=[placed], forces=[{"type": "gravity"}])
    scenario["simulation"]["precision"] = precision
    simulation = Simulation(ps.from_table(scenario))
    simulation.advance_to(100)
    assert simulation.states[0].velocity[:, 1] == pytest.approx(-9.80665 * 100 * dt, rel=1e-4)
    simulation.close()


def test_stiff_springs_do_not_limit_the_step() -> None:
    # 2·10⁷ N/m between 10 g: ω = √(24 k/m) is 2·10⁵/s at most, and ωh = 4000. Motion gains what the fall gives, ½ M (g t)².
    for method in ("backward_euler", {"method": "backward_euler", "converged": True}):
        result = ps.run(ps.from_table(block(method, stiffness=2e7)))
        size = np.linalg.norm(result.final.position[1] - result.final.position[-1])
        assert size == pytest.approx(0.4 * math.sqrt(3), rel=0.05)
        assert result.ledger["kinetic"][-1] < result.ledger["kinetic"][0] + 0.5 * 1.26 * (9.8 * 0.2) ** 2


def test_a_solution_that_is_not_found_ends_the_run() -> None:
    scenario = ps.from_table(block({"method": "backward_euler", "max_linear_iterations": 1}, stiffness=2e7))
    with pytest.raises(
        ps.DivergenceError, match=r"no solution of the step from t = 0 s: .* was \d\.\d+ times the first one"
    ) as caught:
        ps.run(scenario)
    assert caught.value.exit_code == 3
    lonely = {"method": "backward_euler", "converged": True, "max_iterations": 1, "tolerance": 1e-15}
    wavy = {"type": "field", "force": ["9*sin(9*x)", "0", "0"]}
    with pytest.raises(ps.DivergenceError, match="after 1 Newton iterations"):
        simulate(1.0, 1.0, lonely, particles=[points((1.1, 0, 0))], forces=[wavy])


def test_rest_turns_in_a_rotating_frame() -> None:
    # Coriolis forces make the equations unsymmetric. What rests in an inertial frame turns by −Ω t; the midpoint rule turns
    # it by 2 atan(Ω h/2) in a step, which is (Ω h)³/12 less. In the middle of a step the rod is shorter by (Ω h)²/8, as
    # chords are, and pushes a little.
    rate, steps = 0.8, 40
    for h in (0.05, 0.025):
        number = round(steps * 0.05 / h)
        group = points(
            (1, 0, 0), (2, 0.5, 0), velocity=[[0, -rate, 0], [0.5 * rate, -2 * rate, 0]], name="rod"
        )
        final = simulate(
            number * h,
            h,
            {"method": "implicit_midpoint", "tolerance": 1e-12},
            particles=[group | {"mass": M}],
            springs=[{"on": "rod", "pairs": [[0, 1]], "stiffness": K}],
            forces=[{"type": "rotating_frame", "angular_velocity": [0, 0, rate]}],
        ).final
        turned = (final.position[:, 0] + 1j * final.position[:, 1]) * np.exp(1j * rate * number * h)
        start = np.array([1, 2 + 0.5j])
        error = np.abs(turned - start) / np.abs(start)
        assert error == pytest.approx(np.full(2, number * (rate * h) ** 3 / 12), rel=0.15)


def sail(
    dt: float,
    steps: int,
    resolution: tuple[int, int],
    wind: tuple[float, float, float],
    *,
    mass: float,
    g: float = 0.0,
    dihedral: float = 0.01,
    converged: bool = False,
    tolerance: float = 1e-10,
) -> dict[str, Any]:
    """A cloth of 1 m² in the wind, by backward Euler."""
    layout = {"type": "cloth", "origin": [0, 0, 0], "size": [1, 1], "resolution": list(resolution)}
    springs = {"structural": 50.0, "dihedral": dihedral}
    return table(
        steps * dt,
        dt,
        {"method": "backward_euler", "converged": converged, "tolerance": tolerance},
        particles=[{"name": "sail", "layout": layout, "mass": mass, "springs": springs}],
        forces=[
            {"type": "gravity", "acceleration": [0, 0, -g]},
            {
                "type": "sheet_drag",
                "density": 1.3,
                "normal_coefficient": 1.1,
                "flow": [{"type": "uniform", "velocity": list(wind)}],
            },
        ],
    )


def test_a_sheet_falls_with_its_terminal_velocity_in_long_steps() -> None:
    # M g = ½ ρ A c v², and h = 0.5 s is 17 times M/(ρ A c v), the time of the drag. A fold of 10⁴ J, 10⁵ times what explicit
    # methods would stand, keeps the sheet flat to M g · 1 m/10⁴ J ~ 10⁻⁵. Nothing keeps it from being sheared by the
    # 10⁻⁶ N that this leaves in its plane: by 10⁻³ in 6 s, and the area changes by the square.
    mass, g = 0.02, 9.8
    for converged in (False, True):
        scenario = sail(0.5, 12, (2, 2), (0, 0, 1.0), g=g, mass=mass, converged=converged, dihedral=1e4)
        final = ps.run(ps.from_table(scenario)).final
        terminal = math.sqrt(2 * mass * g / (1.3 * 1.1))
        assert final.velocity[:, 2] == pytest.approx(np.full(4, 1.0 - terminal), rel=3e-6)


def test_a_fold_decays_by_the_amplification_factor() -> None:
    # Corners are √½ m from the diagonal, the fold: φ = z·(1, −1, −1, 1)/√½, and along that ω² = k |∇φ|²/m = 8 k/m. The wind
    # is none.
    small, stiffness = 1e-6, 3.0
    omega = math.sqrt(8 * stiffness / M)
    h = 0.3 / omega
    states = []
    for n in (40, 41):
        scenario = sail(h, n, (2, 2), (0, 0, 0), dihedral=stiffness, mass=4 * M)
        scenario["forces"][1]["density"] = 1e-12
        simulation = Simulation(ps.from_table(scenario), threads=1)
        mode = np.array([1.0, -1.0, -1.0, 1.0])
        for edge in simulation.islands[0].interactions[1].rows[1:3]:
            assert sorted([mode[edge[0]], mode[edge[-1]]]) in ([-1.0, -1.0], [1.0, 1.0])
        simulation.states[0].x[2, :4] = small * mode
        simulation.advance_to(n)
        state = simulation.states[0]
        z, vz = (part[2, :4] @ mode for part in (state.x, state.v))
        states.append(z - 1j * vz / omega)
        simulation.close()
    assert states[1] / states[0] == pytest.approx(complex(1 / (1 - 0.3j)), rel=1e-4)


@pytest.mark.parametrize(
    "scenario",
    [
        block("backward_euler", count=14),
        block("bdf2", count=14),
        sail(0.02, 10, (60, 45), (3.0, 1.0, 5.0), mass=0.2, tolerance=1e-3),
    ],
    ids=["springs and angles", "with a memory", "folds and wind"],
)
def test_any_number_of_threads_leaves_the_same_bytes(
    scenario: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 1)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 1)
    left = []
    for threads in (1, 2, 3):
        simulation = Simulation(ps.from_table(scenario), threads=threads)
        simulation.advance_to(3)
        left.append(simulation.states[0].x.tobytes() + simulation.states[0].v.tobytes())
        simulation.close()
    assert left[0] == left[1] == left[2]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "greater than 0"),
        ({"tolerance": 1.0}, "less than 1"),
        ({"max_linear_iterations": 0}, "at least 1"),
        ({"max_iterations": 0, "converged": True}, "at least 1"),
        ({"max_iterations": 5}, "nothing to count"),
        ({"tolerence": 1e-3}, "unknown key"),
    ],
)
def test_options_that_cannot_be(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.ScenarioError, match=message):
        well({"method": "backward_euler", **options}, 0.1, 1)


def test_forces_without_derivatives_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from particlesim.forces.field import FieldRecord
    from particlesim.forces.sheet_drag import SheetDragRecord

    monkeypatch.delitem(GENERICS[force_dx].laws, FieldRecord)
    with pytest.raises(
        ps.ScenarioError, match="bdf2 needs the derivatives of every force, and field has no law"
    ) as caught:
        well("bdf2", 0.1, 1)
    assert caught.value.diagnostics[0].path == "forces.field"
    monkeypatch.delitem(GENERICS[triangle_force_dv].laws, SheetDragRecord)
    with pytest.raises(ps.ScenarioError, match="and sheet_drag has no law"):
        ps.from_table(sail(0.1, 1, (2, 2), (0, 0, 0), mass=1.0))


def test_forces_that_jump_are_refused() -> None:
    # Dry friction has no balance that Newton's method could find; v |v| has, however it is written.
    def stepped(force: str, method: str) -> ps.Scenario:
        field = {"type": "field", "name": "rub", "force": ["0", force, "0"]}
        return ps.from_table(table(1.0, 0.1, method, particles=[points((0, 0, 0))], forces=[field]))

    with pytest.raises(ps.ScenarioError, match=r"and rub has none where it jumps \(sign\)") as caught:
        stepped("-5*sign(vy)", "trapezoidal")
    assert caught.value.diagnostics[0].path == "forces.rub.force.1"
    stepped("-5*sign(vy)", "rk4")
    stepped("-5*sign(vy)*vy**2", "trapezoidal")
