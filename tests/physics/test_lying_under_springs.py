"""What springs press on colliders: it keeps its energy where nothing rubs, and comes to rest where friction acts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import G, energies, points, table, way

import particlesim as ps
from particlesim.engine.simulation import Simulation

R = 0.2
SHAPES: dict[str, dict[str, Any]] = {
    "outside": {"type": "sphere", "radius": R},
    "inside": {"type": "sphere", "radius": R, "inside": True},
    "cylinder": {"type": "cylinder", "start": [0, 0, -1], "end": [0, 0, 1], "radius": R},
    "formula": {"type": "formula", "distance": f"sqrt(x*x + y*y + z*z) - {R}", "size": [1, 1, 1]},
    "union": {
        "type": "union",
        "of": [
            {"type": "sphere", "radius": R},
            {"type": "box", "size": [0.1, 0.1, 0.1], "center": [0, 0, 0.25]},
        ],
    },
}


def speeds(method: str, shape: str, ratio: float) -> NDArray[np.float64]:
    """The speed of a mass on a smooth surface, pressed there by a spring to its centre with ω h = ratio."""
    h = 1e-3
    rest_length = R + (0.01 if shape == "inside" else -0.01)
    _, v = way(
        1,
        1.0,
        h,
        method,
        particles=[
            points((0, R, 0), velocity=[(0.5, 0, 0)], name="bead", mass=1.0, radius=0.0),
            points((0, 0, 0), name="centre", mass=1.0, radius=0.0, pinned=True),
        ],
        springs=[
            {
                "between": ["bead", "centre"],
                "stiffness": (ratio / h) ** 2,
                "rest_length": rest_length,
                "pairs": [[0, 0]],
            }
        ],
        colliders=[{**SHAPES[shape], "restitution": 0}],
    )
    return np.linalg.norm(v[:, 0], axis=1)


@pytest.mark.sampled(60)
@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("ratio", [0.1, 0.4, 1.1])
@pytest.mark.parametrize("method", ["symplectic_euler", "stormer_verlet", "velocity_verlet", "rk4"])
def test_what_a_spring_presses_on_a_round_surface_glides_on(method: str, ratio: float, shape: str) -> None:
    """What pressed it at the beginning of a step pulled it along at the end, by h N θ with the angle θ = h v/R between: its
    speed grew by exp(h N/(m R) t), with ω h = 0.1 by a quarter and 0.4 thirtyfold in 1 s, and inside it lost as much.
    Methods that look at the end of a step find it (ω h)²/2 too deep, or so, and lose (ω h)² v/8 times h N/(m R) by that.
    """
    found = speeds(method, shape, ratio)
    h, pressed = 1e-3, (ratio / 1e-3) ** 2 * 0.01
    if method in ("symplectic_euler", "stormer_verlet"):
        # Störmer's rule tells velocities that are ½ h N θ late
        told = h * pressed / R * h / 2 * 1.1 if method == "stormer_verlet" else 1e-9
        assert np.abs(found / 0.5 - 1).max() <= told
        assert np.ptp(found[10:]) <= 1e-3 * 0.5
    else:
        assert found.max() <= 0.5 * (1 + 1e-9)
        assert found[-1] >= 0.5 * np.exp(-(ratio**2) * h * pressed / R / 4)


def jelly(method: str, restitution: float, friction: float, colliders: list[dict[str, Any]]) -> Any:
    """A soft jelly without damping, that crumples on what it falls on; ω h = 0.7 as it begins."""
    response = {"restitution": restitution, "friction": friction}
    return table(
        3.0,
        1e-3,
        method,
        output={"every": 100},
        particles=[
            {
                "name": "jelly",
                "mass": 0.5,
                "radius": 0.01,
                "layout": {
                    "type": "jelly",
                    "origin": [0, 0.35, 0],
                    "size": [0.4, 0.4, 0.4],
                    "resolution": [6, 6, 6],
                },
                "springs": {"structural": 300},
            }
        ],
        forces=[{"type": "gravity"}],
        planes=[response],
        colliders=[{**each, **response} for each in colliders],
    )


BALL = {"type": "sphere", "radius": 0.2, "center": [0.1, 0.05, 0.1]}
RING = {"type": "torus", "center": [0.2, 0.05, 0.2], "radius": 0.2, "tube": 0.07, "axis": [0, 1, 0]}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("collider", [BALL, pytest.param(RING, marks=pytest.mark.slow)])
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_a_crumpled_jelly_comes_to_rest(method: str, collider: dict[str, Any]) -> None:
    """With symplectic Euler, whose velocities are half a step late, friction had worked for what it should hold: it shook
    for ever, with up to ten times the energy that it had come down to. It has fallen at 2 m/s."""
    simulation = Simulation(ps.from_table(jelly(method, 0.5, 0.3, [collider])), threads=1)
    simulation.advance_to(3000)
    (state,) = simulation.states
    assert np.abs(state.velocity).max() < 0.01
    simulation.close()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("collider", [BALL, RING])
def test_a_crumpled_jelly_on_smooth_ground_gains_nothing(collider: dict[str, Any]) -> None:
    """Where some landed, the velocities of those around had been half a step late under other forces: the energy doubled
    or more within two seconds."""
    found = energies(jelly("symplectic_euler", 0.0, 0.0, [collider]))
    assert found[-5:].mean() < 1.03 * found[12:17].mean()
    assert (found <= found[0] * (1 + 1e-9)).all()


@pytest.mark.parametrize("ratio", [0.1, 0.7, 1.2])
@pytest.mark.parametrize("method", ["symplectic_euler", "stormer_verlet", "velocity_verlet"])
def test_dry_friction_takes_as_much_from_each_swing(method: str, ratio: float) -> None:
    """Each half swing ends 2 μ g/ω² nearer, and the last one within μ g/ω². With the first two methods what had stopped
    went on as with the velocity ½ h a: with ω h = 0.7 amplitudes grew tenfold in a few swings, and with Störmer's rule at
    0.2, too. Swings are sampled to (ω h)²/8 of their width."""
    omega, friction, wide = 10.0, 0.1, 0.2
    h = ratio / omega
    x, v = way(
        1,
        48 * h * round(4 / 48 / h),
        h,
        method,
        particles=[points((wide, 0, 0), mass=1.0, radius=0.0)],
        forces=[{"type": "point_spring", "stiffness": omega**2, "anchor": [0, 0, 0]}, {"type": "gravity"}],
        planes=[{"restitution": 0, "friction": friction}],
    )
    reach = friction * G / omega**2
    at, half = np.abs(x[:, 0, 0]), np.pi / ratio
    for k in range(1, 8):
        most = at[round((k - 0.5) * half) : round((k + 0.5) * half) + 1].max()
        assert most == pytest.approx(wide - 2 * k * reach, abs=wide * ratio**2 / 6 + 1e-4)
    assert at.max() <= wide * (1 + 1e-12)
    assert at[-1] <= reach * (1 + 1e-9)
    assert v[-1, 0, 0] == 0


@pytest.mark.parametrize("method", ["symplectic_euler", "stormer_verlet", "velocity_verlet"])
def test_a_swing_on_a_smooth_floor_is_one_in_flight(method: str) -> None:
    """Störmer's rule had begun anew in each step there, with √(1 + (ω h)²) times the swing."""
    x, _ = way(
        1,
        20.0,
        0.02,
        method,
        particles=[points((0.2, 0, 0), mass=1.0, radius=0.0)],
        forces=[{"type": "point_spring", "stiffness": 100.0, "anchor": [0, 0, 0]}, {"type": "gravity"}],
        planes=[{"restitution": 0}],
    )
    assert np.abs(x[:, 0, 0]).max() < 0.2 * 1.03  # (ω h)²/2, as symplectic Euler swings by itself
    assert np.abs(x[-40:, 0, 0]).max() > 0.2 * 0.97
