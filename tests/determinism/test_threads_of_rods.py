"""Rods on several threads: the same bytes for any number of them, and lengths right to the rounding of single precision."""

from __future__ import annotations

import numpy as np
import pytest

import particlesim as ps
from particlesim.engine.interactions.bond_layout import chunk_size, shares
from particlesim.engine.simulation import Simulation

STRANDS, COUNT, STEPS = 150, 16, 24


@pytest.fixture(autouse=True)
def _threads_are_always_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 1)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 1)


def scene() -> ps.Scenario:
    """Hair of rods whose roots are led, tied at its tips, with drag, a floor and a kick; yoshida4, single precision."""
    tips = [COUNT * (k + 1) - 1 for k in range(STRANDS)]
    return ps.from_table(
        {
            "simulation": {
                "duration": 0.002 * STEPS,
                "dt": 0.002,
                "integrator": "yoshida4",
                "precision": "single",
            },
            "output": {"every": STEPS},
            "particles": [
                {
                    "name": "hair",
                    "layout": {
                        "type": "hair",
                        "strands": STRANDS,
                        "count": COUNT,
                        "length": 0.5,
                        "roots": {"type": "disc", "center": [0, 0.02, 0], "radius": 0.2, "normal": [0, 1, 0]},
                        "direction": [1, 0.02, 0.3],
                    },
                    "mass": 0.3,
                    "springs": {"rigid": True, "bend": 0.5},
                }
            ],
            # Some pairs of strands hang together: their components close loops through the roots, which are held.
            "rods": [
                {"name": "ties", "on": "hair", "pairs": list(zip(tips[:20:2], tips[1:20:2], strict=True))}
            ],
            "forces": [{"type": "gravity"}, {"type": "linear_drag", "coefficient": 1e-4}],
            "motions": [{"on": "hair", "path": ["x + 0.02*(1 - cos(60*t))", "y", "z"]}],
            "planes": [{"restitution": 0.5}],
            "impulses": [{"at": 0.01, "impulse": [0, -1e-4, 0]}],
        }
    )


def left(threads: int) -> tuple[bytes, Simulation]:
    simulation = Simulation(scene(), threads=threads)
    simulation.advance_to(STEPS)
    (state,) = simulation.states
    found = state.x.tobytes() + state.v.tobytes() + repr(simulation.ledger()).encode()
    simulation.close()
    return found, simulation


def test_any_number_of_threads_leaves_the_same_bytes() -> None:
    assert len(shares(STRANDS * COUNT, 8, chunk_size(STRANDS * COUNT))) == 3, (
        "as many threads as chunks at most"
    )
    reference, simulation = left(1)
    for threads in (2, 3):
        assert left(threads)[0] == reference, f"{threads} threads"
    (state,) = simulation.states
    apart = np.diff(state.position.astype(float).reshape(STRANDS, COUNT, 3), axis=1)
    # Coordinates up to 1 m, each rounded to 2⁻²⁴ of itself, at both ends.
    rounding = 2 * 2**-24 * np.sqrt(3)
    assert np.linalg.norm(apart, axis=2) == pytest.approx(
        np.full((STRANDS, COUNT - 1), 0.5 / 15), abs=2 * rounding
    )
    assert state.velocity[:, 1].max() > 0.1, "the floor throws some back"
