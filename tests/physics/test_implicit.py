"""Implicit steps: decay by the amplification factor, the rest shape of a hanging net, momentum, stiff springs, threads.

All islands here are one group with a pinned particle, one set of springs, gravity and linear drag: one kernel, and another
one for the method that remembers.
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
from particlesim.laws import GENERICS, force_dx

IMPLICIT = [name for name, method in METHODS.items() if isinstance(method, ImplicitMethod)]
K, M = 50.0, 2.0
OMEGA = math.sqrt(K / M)


def body(
    layout: dict[str, Any], spring: dict[str, Any], *, g: float = 0.0, drag: float = 0.0, **group: Any
) -> dict[str, Any]:
    """A group with springs, gravity and drag, as parts of a scenario."""
    return {
        "particles": [{"name": "body", "layout": layout, **group}],
        "springs": [{"on": "body", **spring}],
        "forces": [
            {"type": "gravity", "acceleration": [0, -g, 0]},
            {"type": "linear_drag", "coefficient": drag},
        ],
    }


def pinned_spring(method: Any, h: float, steps: int) -> ps.Result:
    """A mass on a spring to a pinned point, 0.1 m out of rest, along an axis: a linear oscillator."""
    layout = {"type": "points", "position": [[0, 0, 0], [1.1, 0, 0]]}
    spring = {"pairs": [[0, 1]], "stiffness": K, "rest_length": 1.0}
    return simulate(steps * h, h, method, **body(layout, spring, mass=M, pinned=[0]))


def well(method: Any, h: float, steps: int) -> ps.Result:
    """The same oscillator without a spring, stepped alone."""
    field = {"type": "field", "force": ["-k*(x - 1)", "0", "0"], "constants": {"k": K}}
    return simulate(steps * h, h, method, particles=[points((1.1, 0, 0), mass=M)], forces=[field])


@pytest.mark.parametrize("scene", [pinned_spring, well])
@pytest.mark.parametrize("name", IMPLICIT)
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
    """A block of springs, turning and falling, and a pinned particle far away that nothing touches."""
    grid = np.stack(np.meshgrid(*[np.arange(count) * 0.1] * 3), axis=-1).reshape(-1, 3)
    turning = np.cross((0.0, 0.5, 1.0), grid - grid.mean(axis=0)) + np.array((0.3, 0.1, 0.0))
    layout = {
        "type": "points",
        "position": [[9, 9, 9], *grid.tolist()],
        "velocity": [[0, 0, 0], *turning.tolist()],
    }
    parts = body(layout, {"within": 0.15, "stiffness": stiffness}, g=9.8, mass=0.01, pinned=[0])
    return table(10 * dt, dt, method, **parts, output={"ledger": True})


@pytest.mark.parametrize("tolerance", [1e-4, 1e-12])
def test_momentum_is_kept_to_the_tolerance_of_the_solution(tolerance: float) -> None:
    # Springs push both ends alike in the matrix, too: what a step adds to M g h is the sum of its residual.
    scenario = ps.from_table(block({"method": "backward_euler", "tolerance": tolerance}))
    ledger = ps.run(scenario).ledger
    mass, fallen = 1.25, 9.8 * 0.2
    gained = ledger["momentum.y"][-1] - ledger["momentum.y"][0] + mass * fallen
    assert abs(gained) < 10 * tolerance * mass * fallen + 1e4 * EPS


def test_stiff_springs_do_not_limit_the_step() -> None:
    # 2·10⁷ N/m between 10 g: ω = √(24 k/m) is 2·10⁵/s at most, and ωh = 4000. Motion gains what the fall gives, ½ M (g t)².
    for method in ("backward_euler", {"method": "backward_euler", "converged": True}):
        result = ps.run(ps.from_table(block(method, stiffness=2e7)))
        size = np.linalg.norm(result.final.position[1] - result.final.position[-1])
        assert size == pytest.approx(0.4 * math.sqrt(3), rel=0.05)
        assert result.ledger["kinetic"][-1] < result.ledger["kinetic"][0] + 0.5 * 1.25 * (9.8 * 0.2) ** 2


def test_a_solution_that_is_not_found_ends_the_run() -> None:
    scenario = ps.from_table(block({"method": "backward_euler", "max_linear_iterations": 1}, stiffness=2e7))
    with pytest.raises(
        ps.DivergenceError, match=r"no solution of the step from t = 0 s: .* residual of 0\.\d+"
    ) as caught:
        ps.run(scenario)
    assert caught.value.exit_code == 3
    lonely = {"method": "backward_euler", "converged": True, "max_iterations": 1, "tolerance": 1e-15}
    wavy = {"type": "field", "force": ["9*sin(9*x)", "0", "0"]}
    with pytest.raises(ps.DivergenceError, match="after 1 Newton iterations"):
        simulate(1.0, 1.0, lonely, particles=[points((1.1, 0, 0))], forces=[wavy])


def test_any_number_of_threads_leaves_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.coupled_island.WORTH_SPRINGS", 1)
    monkeypatch.setattr("particlesim.engine.coupled_island.WORTH_THREADS", 1)
    for method in ("backward_euler", "bdf2"):
        left = []
        for threads in (1, 2, 3):
            simulation = Simulation(ps.from_table(block(method, count=14)), threads=threads)
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

    monkeypatch.delitem(GENERICS[force_dx].laws, FieldRecord)
    with pytest.raises(
        ps.ScenarioError, match="bdf2 needs the derivatives of every force, and field has no law"
    ) as caught:
        well("bdf2", 0.1, 1)
    assert caught.value.diagnostics[0].path == "forces.field"
