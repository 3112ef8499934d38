"""Jelly and cloth that colliders hold back under implicit methods: they come to rest, and gain nothing, in steps that are
long for their springs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, energies, table

import particlesim as ps
from particlesim.engine.simulation import Simulation


def jelly(method: str, restitution: float, h: float = 5e-3) -> dict[str, Any]:
    """A cube of jelly that falls by its own size on a floor. Explicit methods could take steps of 4 ms."""
    cube = {
        "mass": 1.0,
        "layout": {"type": "jelly", "origin": [-0.15, 0.3, -0.15], "size": [0.3] * 3, "resolution": [5] * 3},
        "springs": {"structural": 1000.0, "shear": 1000.0, "damping": 0.2},
    }
    return table(
        2.0,
        h,
        method,
        particles=[cube],
        forces=[{"type": "gravity"}],
        colliders=[{"type": "plane", "restitution": restitution, "friction": 0.4}],
        output={"every": 2, "ledger": True},
    )


def cloth(method: str, h: float, collider: dict[str, Any], duration: float = 1.0) -> dict[str, Any]:
    """A square of stiff cloth that falls on something."""
    sheet = {
        "mass": 0.3,
        "radius": 0.006,
        "layout": {
            "type": "cloth",
            "origin": [-0.5, 1.01, 0.5],
            "size": [1, 1],
            "resolution": [21, 21],
            "up": [0, 0, -1],
        },
        "springs": {"structural": 2000.0, "shear": 500.0, "bend": 4.0, "damping": 0.01},
    }
    return table(
        duration,
        h,
        method,
        particles=[sheet],
        forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": 1e-4}],
        colliders=[{"restitution": 0, "friction": 0.3, **collider}],
        output={"every": 5, "ledger": True},
    )


BALL = {"type": "sphere", "center": [0, 0.5, 0], "radius": 0.4}
TABLE = {"type": "box", "center": [0, 0.4, 0], "size": [0.5, 1, 0.5]}


@pytest.mark.sampled(1)  # each has its own equations
@pytest.mark.parametrize(
    ("method", "restitution", "gain"),
    [
        ("bdf2", 0.0, 1e-9),
        ("implicit_midpoint", 0.0, 1e-9),
        pytest.param("implicit_midpoint", 0.5, 2e-3, marks=pytest.mark.slow),
        ("trapezoidal", 0.5, 1e-9),
    ],
)
def test_jelly_that_lands_on_the_floor_gains_nothing_and_lies(
    method: str, restitution: float, gain: float
) -> None:
    # Put back on the floor alone, the lowest layer had been pressed into the next one, which gave up to 14 J, three times of
    # what there was. Velocities of the midpoint rule are those of the middles of steps: 10⁻⁴ of the fall.
    given = jelly(method, restitution)
    found = energies(given)
    assert (found - np.minimum.accumulate(found)).max() < gain
    simulation = Simulation(ps.from_table(given), threads=1)
    simulation.advance_to(400)
    assert np.abs(simulation.states[0].velocity).max() < 0.1
    assert simulation.states[0].position[:, 1].min() == pytest.approx(0, abs=1e-5)
    simulation.close()


@pytest.mark.parametrize(
    ("method", "h", "collider"),
    [
        ("bdf2", 1e-3, TABLE),
        pytest.param("bdf2", 2e-3, BALL, marks=pytest.mark.slow),
        pytest.param("implicit_midpoint", 1e-3, BALL, marks=pytest.mark.slow),
    ],
)
def test_stiff_cloth_lies_on_things(method: str, h: float, collider: dict[str, Any]) -> None:
    # It had danced on the table under bdf2 with 3 m/s, until it fell off; now it gains a thousandth where it goes round an
    # edge.
    given = cloth(method, h, collider)
    found = energies(given)
    assert found.max() <= found[0] * (1 + 1e-12)
    assert (found - np.minimum.accumulate(found)).max() < 2e-3 * found[0]
    final = ps.run(ps.from_table(given)).final
    assert final.position[:, 1].max() == pytest.approx(0.906, abs=0.05)  # with folds that still move


@pytest.mark.parametrize(
    "method", ["backward_euler", pytest.param("implicit_midpoint", marks=pytest.mark.slow)]
)
def test_threads_and_stops_leave_no_trace(method: str) -> None:
    # On a ball that moves, which takes the cloth along.
    given = cloth(method, 1e-3, {**BALL, "name": "ball"}, 0.4)
    given["motions"] = [{"collider": "ball", "path": ["x + 0.3 * sin(3 * t)", "y", "z"]}]
    ends = []
    for threads, stops in ((1, (300,)), (2, (300,)), (2, (170, 220, 300))):
        simulation = Simulation(ps.from_table(given), threads=threads)
        for stop in stops:
            simulation.advance_to(stop)
        (state,) = simulation.states
        ends.append(state.x.tobytes() + state.v.tobytes())
        simulation.close()
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("method", ["backward_euler", "bdf2", "implicit_midpoint", "trapezoidal"])
def test_jelly_on_a_slope_is_held_by_friction(method: str) -> None:
    # All layers weigh on the lowest one: with friction of a tenth more than the slope asks for it stays, in long steps, too.
    slope = 0.3
    block = jelly(method, 0.0)
    block["particles"][0]["layout"]["origin"] = [-0.15, 0, -0.15]
    block["particles"][0]["springs"] = {"structural": 3000.0, "shear": 3000.0, "damping": 0.5}
    force = [f"m * {G * np.sin(slope)}", f"-m * {G * np.cos(slope)}", "0"]
    block["forces"] = [{"type": "field", "force": force}]
    block["colliders"][0]["friction"] = 1.1 * np.tan(slope)
    block["simulation"]["duration"] = 1.0
    final = ps.run(ps.from_table(block)).final
    # backward Euler lets it creep: its springs are damped while the lowest layer is put back
    assert np.abs(final.velocity.mean(axis=0)).max() < (0.05 if method == "backward_euler" else 2e-3)
