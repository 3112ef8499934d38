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


@pytest.mark.sampled(8)
@pytest.mark.parametrize(
    ("method", "restitution", "gain"),
    [
        ("backward_euler", 0.0, 1e-7),
        ("backward_euler", 0.9, 1e-7),
        ("bdf2", 0.0, 1e-9),
        ("bdf2", 0.9, 1e-5),
        ("implicit_midpoint", 0.0, 1e-9),
        ("implicit_midpoint", 0.9, 1e-4),
        ("trapezoidal", 0.0, 1e-9),
        ("trapezoidal", 0.7, 1e-4),
    ],
)
def test_jelly_that_lands_on_the_floor_gains_nothing_and_lies(
    method: str, restitution: float, gain: float
) -> None:
    # Put back on the floor alone, the lowest layer had been pressed into the next one, which gave up to 14 J, three times of
    # what there was; jelly that bounced gained as much where springs drew particles in within a step, and they were thrown
    # back faster than they had come.
    given = jelly(method, restitution)
    found = energies(given)
    assert (found - np.minimum.accumulate(found)).max() < gain
    simulation = Simulation(ps.from_table(given), threads=1)
    simulation.advance_to(400)
    assert restitution > 0.5 or np.abs(simulation.states[0].velocity).max() < 0.1
    assert simulation.states[0].position[:, 1].min() == pytest.approx(0, abs=1e-5)
    simulation.close()


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("method", "stiffness", "h", "restitution", "friction", "along"),
    [
        ("bdf2", 1e4, 5e-3, 0.0, 0.4, 0.0),
        ("bdf2", 1e5, 1e-3, 0.5, 0.0, 0.0),
        ("bdf2", 1e4, 5e-3, 0.0, 0.0, 30.0),
        ("backward_euler", 1e5, 5e-3, 0.9, 0.0, 0.0),
    ],
)
def test_jelly_that_is_too_stiff_for_its_step_gains_nothing(
    method: str, stiffness: float, h: float, restitution: float, friction: float, along: float
) -> None:
    """Steps are 8 to 50 times as long as springs and masses would allow an explicit method. Under bdf2, which went on after
    a landing as if the force had acted before, it gained 0.05 to 2.6 of 4.4 J. How it goes along the floor is all one."""
    given = jelly(method, restitution, h)
    given["particles"][0]["layout"]["velocity"] = [along, 0.0, 0.0]
    given["particles"][0]["springs"].update(structural=stiffness, shear=stiffness)
    given["colliders"][0]["friction"] = friction
    given["simulation"]["duration"] = 1.0
    found = energies(given)
    assert (found - np.minimum.accumulate(found)).max() < 1e-3


@pytest.mark.parametrize(
    ("method", "stiffness"),
    [("trapezoidal", 300.0), pytest.param("implicit_midpoint", 1e3, marks=pytest.mark.slow)],
)
def test_stiff_jelly_gains_nothing_on_an_elastic_floor(method: str, stiffness: float) -> None:
    """It had gained 1.4 of 4.4 J at 300 N/m, and found no solution at 1000."""
    given = jelly(method, 1.0)
    given["particles"][0]["springs"].update(structural=stiffness, shear=stiffness)
    given["colliders"][0]["friction"] = 0.0
    found = energies(given)
    assert found.max() <= found[0] * (1 + 1e-12)
    assert (found - np.minimum.accumulate(found)).max() < (1e-3 if stiffness < 1e3 else 0.02)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["implicit_midpoint", "trapezoidal"])
def test_books_do_not_stop_jelly_that_lands(method: str) -> None:
    # Its dampers were booked with 0.7 J more than they had taken, and the run was stopped for that as a gain.
    given = jelly(method, 0.0)
    given["simulation"]["duration"] = 0.5
    given["output"]["work"] = True
    ledger = ps.run(ps.from_table(given)).ledger
    energy = ledger["kinetic"] + sum(ledger[name] for name in ledger if name.startswith("potential."))
    assert energy.max() <= energy[0] * (1 + 1e-12)
    assert sum(ledger[name][-1] for name in ledger if name.startswith("work.")) < 0


@pytest.mark.parametrize(
    ("method", "h", "collider"),
    [
        ("backward_euler", 1 / 250, TABLE),
        ("backward_euler", 1 / 250, BALL),
        ("bdf2", 1e-3, TABLE),
        pytest.param("bdf2", 2e-3, BALL, marks=pytest.mark.slow),
        pytest.param("implicit_midpoint", 1e-3, BALL, marks=pytest.mark.slow),
    ],
)
def test_stiff_cloth_lies_on_things(method: str, h: float, collider: dict[str, Any]) -> None:
    # It had danced on the table under bdf2 with 3 m/s, until it fell off, and under backward Euler it had gained a quarter
    # of its energy as it landed.
    given = cloth(method, h, collider)
    found = energies(given)
    assert found.max() <= found[0] * (1 + 1e-12)
    assert (found - np.minimum.accumulate(found)).max() < 1e-5 * found[0]
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


@pytest.mark.sampled(8)
@pytest.mark.parametrize("part", [1.1, 0.9])
@pytest.mark.parametrize("method", ["backward_euler", "bdf2", "implicit_midpoint", "trapezoidal"])
def test_friction_of_jelly_on_a_slope_is_that_of_all_its_weight(method: str, part: float) -> None:
    # All layers weigh on the lowest one: with friction of a tenth more than the slope asks for it stays, in long steps, too,
    # and with a tenth less it slides with a tenth of the pull down the slope. What presses is known to a hundredth: the
    # middle rules swing about it.
    slope = 0.3
    block = jelly(method, 0.0)
    block["particles"][0]["layout"]["origin"] = [-0.15, 0, -0.15]
    block["particles"][0]["springs"] = {"structural": 3000.0, "shear": 3000.0, "damping": 0.5}
    force = [f"m * {G * np.sin(slope)}", f"-m * {G * np.cos(slope)}", "0"]
    block["forces"] = [{"type": "field", "force": force}]
    block["colliders"][0]["friction"] = part * np.tan(slope)
    simulation = Simulation(ps.from_table(block), threads=1)
    speeds = []
    for step in (100, 200):
        simulation.advance_to(step)
        speeds.append(simulation.states[0].velocity[:, 0].mean())
    simulation.close()
    if part > 1:
        assert abs(speeds[1]) < 1e-3
    else:
        assert speeds[1] - speeds[0] == pytest.approx((1 - part) * G * np.sin(slope) * 0.5, rel=0.08)


def pair(method: str, collider: dict[str, Any], **start: Any) -> dict[str, Any]:
    """Two particles on a spring, on something smooth but for what is said."""
    group = {"mass": 0.5, "radius": 0.01, "layout": {"type": "points", **start}}
    return table(
        0.6,
        5e-3,
        method,
        particles=[{"name": "pair", **group}],
        forces=[{"type": "gravity"}],
        colliders=[{"restitution": 0, **collider}],
        springs=[{"on": "pair", "pairs": [[0, 1]], "stiffness": 1000.0}],
    )


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["backward_euler", "bdf2", "implicit_midpoint", "trapezoidal"])
def test_what_slides_down_a_ball_leaves_it(method: str) -> None:
    # Of the radius R at cos θ = 2/3 + v²/(3 g R), 0.33 m off at 0.6 s. Held by its normal alone it had run around the ball.
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1.0}
    start = {"position": [[0, 1.01, -0.1], [0, 1.01, 0.1]], "velocity": [[2.0, 0, 0]]}
    final = ps.run(ps.from_table(pair(method, ball, **start))).final
    gap = np.linalg.norm(final.position, axis=1) - 1.01
    assert gap == pytest.approx(0.33, abs=0.05 if method == "backward_euler" else 0.01)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["backward_euler", "bdf2", "implicit_midpoint", "trapezoidal"])
def test_what_lies_on_a_platform_flies_on_as_it_slows_down(method: str) -> None:
    # y = a sin(ω t) with ω² a = 2.9 g: it leaves where that is −g, sin(ω t) = g/(ω² a), at a known speed.
    a, w = 0.2, 12.0
    platform = {"type": "box", "name": "platform", "center": [0, -0.5, 0], "size": [4, 1, 4]}
    given = pair(method, platform, position=[[0, 0.01, 0], [0.3, 0.01, 0]])
    given["motions"] = [{"collider": "platform", "path": ["x", f"y + {a} * sin({w} * t)", "z"]}]
    simulation = Simulation(ps.from_table(given), threads=1)
    simulation.advance_to(40)
    leaves = np.arcsin(G / (w * w * a)) / w
    t = 0.2 - leaves
    flown = a * np.sin(w * leaves) + a * w * np.cos(w * leaves) * t - 0.5 * G * t * t
    height = simulation.states[0].position[:, 1] - 0.01
    simulation.close()
    assert height == pytest.approx(flown, abs=0.07 if method == "backward_euler" else 0.02)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("method", ["backward_euler", "bdf2", "implicit_midpoint", "trapezoidal"])
def test_a_belt_takes_jelly_along(method: str) -> None:
    belt = jelly(method, 0.0)
    belt["particles"][0]["layout"]["origin"] = [-0.15, 0, -0.15]
    belt["colliders"][0]["surface_velocity"] = [0.5, 0, 0]
    final = ps.run(ps.from_table(belt)).final
    assert final.velocity[:, 0].mean() == pytest.approx(0.5, abs=1e-4 if method == "backward_euler" else 0.02)


@pytest.mark.parametrize("method", ["backward_euler", pytest.param("bdf2", marks=pytest.mark.slow)])
def test_jelly_that_slides_stops_where_a_block_does(method: str) -> None:
    # v²/(2 μ g), less the half step by which backward Euler is ahead where it slows down; the jelly rocks a little.
    v, friction, h = 1.0, 0.4, 0.01
    ahead = 0.5 * h * v if method == "backward_euler" else 0.0
    block = jelly(method, 0.0, h)
    block["particles"][0]["layout"] |= {"origin": [-0.15, 0, -0.15], "velocity": [v, 0, 0]}
    state = ps.run(ps.from_table(block)).final
    way = state.position[:, 0].mean()
    assert way == pytest.approx(v * v / (2 * friction * G) - ahead, abs=0.4 * h * v)
    assert np.abs(state.velocity.mean(axis=0)).max() < 1e-4


@pytest.mark.parametrize("method", ["backward_euler", "bdf2"])
def test_what_passes_a_thin_wall_unseen_is_counted_once(method: str) -> None:
    sheet = {"type": "box", "center": [0, 0, 0], "size": [2, 0.05, 2], "detection": "discrete"}
    given = pair(method, sheet, position=[[0, 0.5, 0], [0.3, 0.5, 0]], velocity=[[0, -60, 0]])
    simulation = Simulation(ps.from_table(given), threads=1)
    simulation.advance_to(20)
    assert simulation.missed_crossings() == 2
    simulation.close()
