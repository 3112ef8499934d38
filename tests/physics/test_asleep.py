"""Hard grains that only tremble come to rest, and wake up as soon as something changes; what moves slowly goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, table, way

import particlesim as ps

R = 0.01
"""The radius of the marbles [m]."""
WEIGHT = ("0", f"-m*{G}", "0")


def planes(*normals: tuple[float, float, float], friction: float = 0.0) -> list[dict[str, Any]]:
    rubs = {"friction": friction} if friction else {}
    return [{"type": "plane", "normal": list(n), "restitution": 0.3, **rubs} for n in normals]


def pyramid(sides: int, friction: float = 0.0) -> list[dict[str, Any]]:
    """One that stands on its tip, whose sides are 50° steep."""
    up, out = np.cos(np.radians(50)), np.sin(np.radians(50))
    around = 2 * np.pi * np.arange(sides) / sides + 0.3
    return planes(*((out * np.cos(a), up, out * np.sin(a)) for a in around.tolist()), friction=friction)


def marbles(*places: tuple[float, float, float], **more: Any) -> dict[str, Any]:
    return points(*places, radius=R, density=2500.0, name="marbles", **more)


def touching(friction: float = 0.0) -> list[dict[str, Any]]:
    rubs = {"friction": friction} if friction else {}
    return [{"type": "contact", "on": ["marbles"], "model": "impulse", "restitution": 0.3, **rubs}]


def fallen(
    duration: float, sides: int, friction: float, force: tuple[str, ...], method: str, every: int
) -> Any:
    """Frames of two marbles that fall into a pyramid."""
    return ps.run(
        ps.from_table(
            table(
                duration,
                1e-3,
                method,
                particles=[marbles((0.004, 0.05, 0.003), (-0.006, 0.08, 0.002))],
                colliders=pyramid(sides, friction),
                interactions=touching(friction),
                forces=[{"type": "field", "force": list(force)}],
                output={"every": every},
            )
        )
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler", "stormer_verlet"])
@pytest.mark.parametrize(("sides", "friction"), [(4, 0.0), (4, 0.4)])
def test_marbles_in_the_tip_of_a_pyramid_come_to_rest_to_the_last_bit(
    sides: int, friction: float, method: str
) -> None:
    """They had trembled there by 10⁻⁷ m with 0.05 to 0.2 g h for ever."""
    found = fallen(2.5, sides, friction, WEIGHT, method, 50)
    late = found.final.position
    # what comes to rest by itself does so to rounding
    rounding = 1e-15
    assert np.abs(found.final.velocity).max() <= rounding
    before = fallen(2.4, sides, friction, WEIGHT, method, 50)
    assert np.abs(before.final.position - late).max() <= rounding


@pytest.mark.slow
def test_they_wake_up_as_soon_as_their_weight_changes() -> None:
    """From 1.5 s on it fades, and after 2.5 s it lifts them: by G a³/6 a later, as nothing holds them."""
    force = f"-m*{G}*(1 - max(t - 1.5, 0))"
    found = fallen(2.7, 4, 0.0, ("0", force, "0"), "velocity_verlet", 2700)
    begun = fallen(1.5, 4, 0.0, ("0", force, "0"), "velocity_verlet", 1500)
    assert np.abs(begun.final.velocity).max() == 0
    rise = found.final.position[:, 1] - begun.final.position[:, 1]
    # What lies lags behind by a few steps at most, and rises by what holds it loosely at the end: R/1000.
    assert rise == pytest.approx(np.full(2, G * 0.2**3 / 6), rel=0.03, abs=1e-3 * R)


GROOVE = planes((0, 0.5**0.5, 0.5**0.5), (0, 0.5**0.5, -(0.5**0.5)))
"""One along x, whose two sides press marbles that lie side by side on each other."""


def groove(pull: str, duration: float = 3.0, every: int = 10) -> Any:
    """Places and velocities along it of two marbles that touch each other, and what pulls them."""
    x, v = way(
        every,
        duration,
        1e-3,
        "velocity_verlet",
        particles=[marbles((0, (1 + 2**0.5) * R, -R), (0, (1 + 2**0.5) * R, R))],
        colliders=GROOVE,
        interactions=touching(),
        forces=[{"type": "field", "force": [pull, f"-m*{G}", "0"]}],
    )
    return x[:, :, 0], v[:, :, 0]


@pytest.mark.parametrize("part", [1e-5, 1e-3])
def test_what_is_pulled_ever_so_little_goes_off(part: float) -> None:
    """From 1 s on, with less than what a cluster that sleeps notices of its steps: another force wakes it up."""
    x, _ = groove(f"{part}*m*{G}*min(max((t - 1)*1e6, 0), 1)")
    assert x[-1] == pytest.approx(np.full(2, 0.5 * part * G * 2.0**2), rel=2e-3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("steps", [20, 40])
def test_what_is_shaken_goes_as_far_as_free(steps: int) -> None:
    """By a force that changes with time, to and fro: put to rest at any time, it would drift from then on."""
    part, turn = 0.1, 2 * np.pi / (steps * 1e-3)
    _, v = groove(f"{part}*m*{G}*cos({turn}*t)", every=1)
    assert np.abs(v).max() == pytest.approx(part * G / turn, rel=2e-2)


def test_what_creeps_goes_on() -> None:
    """In honey, by a tenth of a micrometre a second."""
    n = (np.sin(1e-3), np.cos(1e-3), 0.0)
    honey = 6 * np.pi * 1000.0 * R
    x, _ = way(
        100,
        2.0,
        1e-3,
        "backward_euler",
        particles=[marbles((R * n[0], R * n[1], 0), (R * n[0], R * n[1], 2 * R - 1e-6))],
        colliders=planes(n),
        interactions=touching(),
        forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": honey}],
    )
    mass = 2500.0 * 4 / 3 * np.pi * R**3
    assert x[-1, :, 0] - x[-11, :, 0] == pytest.approx(np.full(2, mass * G * n[0] * n[1] / honey), rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(("height", "steps"), [(1e-5, 600), (4e-3, 24), (4e-3, 60)])
def test_what_swings_swings_on(height: float, steps: int) -> None:
    """Two that touch in a trough, as far as 10⁻⁵ m from its middle, where the speed is 0.01 g h. They come back once in each
    swing of so many steps."""
    trough = {"type": "cylinder", "start": [0, 0, -1], "end": [0, 0, 1], "radius": 0.1, "inside": True}
    low, angle = 0.09, height / 0.09
    place, period = (low * np.sin(angle), -low * np.cos(angle)), 2 * np.pi * np.sqrt(low / G)
    x, _ = way(
        1,
        20 * period,
        period / steps,
        "velocity_verlet",
        particles=[marbles((*place, 0.0), (*place, 2 * R))],
        colliders=[{**trough, "restitution": 0.3}],
        interactions=touching(),
        forces=[{"type": "gravity"}],
    )
    late = x[-steps - 1 :, :, 0]  # of the largest place (π/steps)²/2 is missed between two steps
    assert np.abs(late).max() == pytest.approx(height, rel=0.5 * (np.pi / steps) ** 2 + 1e-3)
    assert late.min() < 0 < late.max()


def test_one_that_falls_on_them_wakes_them_up() -> None:
    """A heavy one throws out what lies in the pyramid; it had to be noticed on the first touch."""
    found = ps.run(
        ps.from_table(
            table(
                1.6,
                1e-3,
                particles=[
                    marbles((0.004, 0.05, 0.003), (-0.006, 0.08, 0.002), (0.002, 7.5, 0.001)),
                ],
                colliders=pyramid(4),
                interactions=touching(),
                forces=[{"type": "gravity"}],
                output={"every": 40},
            )
        )
    )
    assert found.final.velocity is not None
    speeds = np.linalg.norm(found.final.velocity, axis=1)
    assert np.all(speeds > 0)
