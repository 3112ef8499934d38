"""Pins chosen by name, index and region, and pins that move: springs and dampers see where they are, and how fast."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, simulate

import particlesim as ps
from particlesim.groups.motion import Motion
from particlesim.integrators import METHODS
from particlesim.laws.registry import Particle, path

K, C, M, OMEGA, A = 50.0, 1.5, 0.8, 6.0, 0.1
REST = 1.0


def shaken(t: float, steps: int, method: str, **simulation: Any) -> ps.Result:
    """A mass on a spring-damper whose other end is led as A sin Ωt."""
    return simulate(
        t,
        t / steps,
        method,
        particles=[points((0, 0, 0), (REST, 0, 0), mass=M, name="line")],
        springs=[{"on": "line", "pairs": [[0, 1]], "stiffness": K, "damping": C}],
        motions=[
            {
                "on": "line",
                "particles": [0],
                "path": ["x + a*sin(w*t)", "y", "z"],
                "constants": {"a": A, "w": OMEGA},
            }
        ],
        **simulation,
    )


def exact(t: float) -> float:
    """m u″ = −k (u − A sin Ωt) − c (u′ − AΩ cos Ωt), from rest: the stationary swing, and what brings it there."""
    amplitude = A * (K + 1j * C * OMEGA) / (K - M * OMEGA**2 + 1j * C * OMEGA)
    roots = np.roots([M, C, K])
    stationary = amplitude * np.exp(1j * OMEGA * t)
    # u = Im(stationary) + b₁ e^{r₁ t} + b₂ e^{r₂ t} with u(0) = u′(0) = 0
    b = np.linalg.solve([[1, 1], list(roots)], [-amplitude.imag, -(1j * OMEGA * amplitude).imag])
    return float(stationary.imag + (b * np.exp(roots * t)).sum().real)


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet", "stormer_verlet", "rk4"])
def test_a_shaken_oscillator_follows_theory_in_every_method(method: str) -> None:
    # A method of order p, whose stages see the pin where and as fast as it is at their own times, misses by C hᵖ. With a
    # damper, the kicks of velocity Verlet see the velocity of before them: it is of order 1 there.
    order = METHODS[method].order
    if method == "velocity_verlet":
        order = 1
    t, steps = 0.9, {1: 2000, 2: 300, 3: 200, 4: 100}[order]
    coarse, fine = (
        float(shaken(t, n, method).final.position[1, 0]) - REST - exact(t) for n in (steps, 2 * steps)
    )
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.12)
    assert abs(fine) < A * OMEGA * t * (OMEGA * t / steps) ** order


def test_a_led_pin_is_where_its_path_is_with_its_velocity() -> None:
    result = shaken(0.7, 100, "velocity_verlet")
    assert result.final.position[0] == pytest.approx([A * math.sin(OMEGA * 0.7), 0, 0], abs=4 * EPS)
    assert result.final.velocity[0] == pytest.approx(
        [A * OMEGA * math.cos(OMEGA * 0.7), 0, 0], abs=OMEGA * EPS
    )


def test_a_damper_on_a_pin_that_moves_away_drags() -> None:
    # Without a stiffness, a damper to a pin at constant speed u: v = u (1 − e^(−ct/m)).
    u, t = 2.0, 0.5
    result = simulate(
        t,
        t / 200,
        "rk4",
        particles=[points((0, 0, 0), (1, 0, 0), mass=M, name="line")],
        springs=[{"on": "line", "pairs": [[0, 1]], "stiffness": 0.0, "damping": C}],
        motions=[{"on": "line", "particles": [0], "path": [f"{u}*t", "0", "0"]}],
    )
    assert result.final.velocity[1, 0] == pytest.approx(-u * math.expm1(-C * t / M), rel=1e-10)


def test_a_motion_leads_particles_that_nothing_joins() -> None:
    # All three turn about the y axis; the one that is killed must not shift their rows.
    spin = {"path": ["x*cos(t) + z*sin(t)", "y", "z*cos(t) - x*sin(t)"]}
    result = simulate(
        1.0,
        0.1,
        particles=[
            points((9, 0.5, 0), (1, 5, 0), (0, 5, 1), (0, 5, 0), velocity=[(0, -1, 0)] + 3 * [(0, 0, 0)])
        ],
        motions=[{"on": "particles", "particles": [1, 2, 3], **spin}],
        planes=[{"contact": "kill"}],
    )
    assert result.died == {"plane": 1}
    c, s = math.cos(1), math.sin(1)
    assert result.final.position == pytest.approx(np.array([[c, 5, -s], [s, 5, c], [0, 5, 0]]), abs=4 * EPS)
    assert result.final.velocity == pytest.approx(np.array([[-s, 0, -c], [c, 0, -s], [0, 0, 0]]), abs=4 * EPS)


def test_the_pinned_particles_of_a_group_are_led_together() -> None:
    flag = {
        "name": "flag",
        "layout": {"type": "cloth", "size": [3, 2], "resolution": [4, 3], "pinned": "left"},
        "springs": {"structural": 100.0},
    }
    final = simulate(0.5, 0.01, particles=[flag], motions=[{"on": "flag", "path": ["x", "y + t", "z"]}]).final
    left = final.position[::4]
    assert left == pytest.approx(np.array([[0, 0.5, 0], [0, 1.5, 0], [0, 2.5, 0]]), abs=4 * EPS)


@pytest.mark.parametrize("smooth", [True, False])
def test_waypoints_are_met_and_the_velocity_is_that_of_the_path(smooth: bool) -> None:
    waypoints = [(0.5, (0, 0, 0)), (1.0, (1, 0, 2)), (2.5, (1, -1, 0)), (3.0, (0, 0, 0))]
    record = Motion(
        on="a",
        waypoints=[{"time": t, "offset": x} for t, x in waypoints],
        interpolation="smooth" if smooth else "linear",
    ).record()

    def at(t: float) -> Any:
        return np.array(path(record, Particle(5.0, 6.0, 7.0, 0, 0, 0, 1, 0, 0, t)))

    for t, x in waypoints:
        np.testing.assert_allclose(at(t)[:3], np.add(x, (5, 6, 7)), atol=1e-14)
    for t in (0.0, 0.4, 3.0, 9.0):
        np.testing.assert_allclose(at(t), (5, 6, 7, 0, 0, 0), atol=1e-14)
    h = 1e-5
    for t in (0.55, 0.9, 1.3, 2.2, 2.7):
        np.testing.assert_allclose(at(t)[3:], (at(t + h) - at(t - h))[:3] / (2 * h), atol=1e-8)
    for t in (0.5, 1.0, 2.5, 3.0):
        jump = np.abs(at(t + 1e-9)[3:] - at(t - 1e-9)[3:]).max()
        assert jump < 1e-6 if smooth else jump > 0.1


@pytest.mark.parametrize(
    ("pinned", "which"),
    [
        ([1, 5], [1, 5]),
        ("left", [0, 4, 8]),
        (["top_left", "bottom"], [0, 1, 2, 3, 8]),
        ({"type": "box", "min": [1.5, -1, 0], "max": [3, 1, 0]}, [2, 3, 6, 7]),
        ({"type": "ball", "center": [3, 2, 0], "radius": 1}, [7, 10, 11]),
        ({"type": "shell", "inner": 1, "outer": 1.5}, [1, 4, 5]),
    ],
)
def test_pins_by_index_name_and_region(pinned: Any, which: list[int]) -> None:
    body = {
        "layout": {"type": "cloth", "size": [3, 2], "resolution": [4, 3]},
        "springs": {"structural": 100.0},
        "pinned": pinned,
    }
    final = simulate(0.1, 0.01, particles=[body], forces=[{"type": "gravity"}]).final
    assert np.flatnonzero((final.velocity == 0).all(axis=1)).tolist() == which


CLOTH = {"name": "flag", "layout": {"type": "cloth", "size": [3, 2], "resolution": [4, 3]}}
DUST = {"name": "dust", "rate": 10, "shape": {"type": "point", "position": [0, 0, 0]}}
STILL = ["x", "y", "z"]


@pytest.mark.parametrize(
    ("motions", "message"),
    [
        ([{"on": "flag", "path": STILL}], "It pins none"),
        ([{"on": "flg", "path": STILL}], "unknown group 'flg'"),
        ([{"on": "dust", "path": STILL}], "'dust' is emitted"),
        ([{"on": "flag", "particles": [12], "path": STILL}], "there is no particle 12"),
        ([{"on": "flag", "particles": "lefft", "path": STILL}], "no part called 'lefft'"),
        ([{"on": "flag", "particles": [0], "path": ["x", "vy", "z"]}], "cannot depend on vy"),
        ([{"on": "flag", "particles": [0], "path": ["x", "w", "z"]}], "unknown name 'w'"),
        ([{"on": "flag", "particles": [0], "path": ["x", "1/t", "z"]}], "not finite at t = 0"),
        ([{"on": "flag", "particles": [0]}], "a path or waypoints"),
        (
            [
                {"on": "flag", "particles": [0], "path": STILL},
                {"on": "flag", "particles": "left", "path": STILL},
            ],
            "led by two motions",
        ),
        (
            [{"on": "flag", "particles": {"type": "ball", "center": [9, 9, 9], "radius": 1}, "path": STILL}],
            "none is in its region",
        ),
        (
            [
                {
                    "on": "flag",
                    "particles": [0],
                    "waypoints": [{"time": t, "offset": [0, 0, 0]} for t in (1, 1)],
                }
            ],
            "1 s is not after 1 s",
        ),
    ],
)
def test_motions_that_cannot_be(motions: list[Any], message: str) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.05, particles=[CLOTH], emitters=[DUST], motions=motions)


@pytest.mark.parametrize(
    ("pinned", "message"),
    [
        ([0, 12], "there is no particle 12"),
        ("lfet", "did you mean 'left'|no part called 'lfet'"),
        ({"type": "disc", "radius": 1}, "unknown type"),
        (["left", 99], "there is no particle 99"),
        ([-1], "pinned"),
    ],
)
def test_pins_that_cannot_be(pinned: Any, message: str) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.05, particles=[{**CLOTH, "pinned": pinned}])


def test_emitted_particles_cannot_be_pinned() -> None:
    with pytest.raises(ps.UsageError, match="emitted particles cannot be pinned"):
        simulate(0.1, 0.05, emitters=[{**DUST, "pinned": True}])
