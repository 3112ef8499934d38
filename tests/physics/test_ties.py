"""Springs from rigid bodies to particles, against closed forms, what is conserved, and what the books say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import EPS, record, simulate, table

import particlesim as ps
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.world import World
from particlesim.errors import ScenarioError
from particlesim.runs.validity import stiff

BALL = {"name": "ball", "shape": {"type": "sphere", "radius": 0.1}, "mass": 2.0}


def bead(position: Any, velocity: Any = (0.0, 0.0, 0.0), **other: Any) -> dict[str, Any]:
    layout = {"type": "points", "position": [list(position)], "velocity": [list(velocity)]}
    return {"name": "bead", "mass": 0.5, "layout": layout, **other}


def tie(**other: Any) -> dict[str, Any]:
    return {"between": ["ball", "bead"], "pairs": [[0, 0]], "stiffness": 40.0, **other}


def two(h: float, duration: float, **other: Any) -> ps.Result:
    """A ball and a bead at 1 m on a spring that is stretched by 0.2 m."""
    spring = tie(rest_length=0.8, **other)
    return simulate(duration, h, particles=[bead([1, 0, 0])], bodies=[BALL], springs=[spring])


def test_two_masses_on_a_spring_swing_about_their_centre() -> None:
    # The distance is L₀ + A cos ωt with ω² = k (1/m + 1/M); with damping A e^(−γt) (cos ωt + γ/ω sin ωt), γ = c/2μ.
    mu = 1 / (1 / 0.5 + 1 / 2.0)
    for c, time in ((0.0, 1.0), (1.6, 1.0)):
        gamma = c / (2 * mu)
        omega = math.sqrt(40.0 / mu - gamma**2)
        swing = math.exp(-gamma * time) * (math.cos(omega * time) + gamma / omega * math.sin(omega * time))
        errors = []
        for h in (1e-2, 5e-3):
            end = two(h, time, damping=c).final
            one, other = end.position[1], end.position[0]  # the bead comes first
            errors.append(abs(np.linalg.norm(one - other) - 0.8 - 0.2 * swing))
            centre = (2.0 * one + 0.5 * other) / 2.5
            assert centre == pytest.approx([0.2, 0, 0], abs=1e-14)
        assert 3.6 < errors[0] / errors[1] < 4.4
        assert errors[1] < 0.2 * (omega * 5e-3) ** 2 * omega


def hung(h: float, steps: int, **other: Any) -> dict[str, Any]:
    """A box that tumbles on an elastic rope of four beads, from a corner; nothing holds the rope."""
    rope = {
        "name": "rope",
        "layout": {"type": "rope", "start": [0.4, 0.3, 0.2], "end": [1.0, 0.3, 0.2], "count": 4},
        "mass": 0.1,
        "springs": {"structural": 300.0},
    }
    box = {
        "name": "box",
        "shape": {"type": "box", "size": [0.3, 0.2, 0.1]},
        "mass": 1.0,
        "velocity": [0.3, -0.5, 0.2],
        "angular_velocity": [1.0, 2.0, -3.0],
    }
    spring = {
        "between": ["rope", "box"],
        "pairs": [[0, 0]],
        "points": [[0, 0, 0], [0.15, 0.1, 0.05]],
        "stiffness": 60.0,
        "rest_length": 0.25,
        "damping": 0.1,
        "name": "tie",
        **other,
    }
    output = {"ledger": True, "work": True, "every": max(steps // 20, 1)}
    return table(steps * h, h, particles=[rope], bodies=[box], springs=[spring], output=output)


def test_momentum_and_angular_momentum_are_kept_and_all_energy_is_booked() -> None:
    balances = []
    for h, steps in ((2e-3, 200), (1e-3, 400)):
        rows = ps.run(ps.from_table(hung(h, steps))).ledger
        for name in ("momentum", "angular_momentum"):
            for axis in "xyz":
                values = np.asarray(rows[f"{name}.{axis}"])
                assert np.abs(values - values[0]).max() < 4 * EPS * steps, name  # each of size 1
        assert rows["potential.tie"].max() > 0.1
        assert rows["work.tie"][-1] == pytest.approx(-0.0557, abs=1e-4)  # as steps of a tenth have it
        balances.append(np.abs(rows["balance"]).max())
    assert 3.7 < balances[0] / balances[1] < 4.3  # what is left is the error of the steps, of second order


def test_springs_find_their_particles_in_any_order() -> None:
    # Springs to the second group come first: visitors are not in the order of their ids.
    beads = [bead([k, 0, 0]) | {"name": name} for k, name in ((1, "near"), (2, "far"))]
    springs = [tie(between=["ball", name], name=f"to_{name}") for name in ("far", "near")]
    world = World(ps.from_table(table(1, 1e-3, particles=beads, bodies=[BALL], springs=springs)))
    (island,) = (each for each in world.islands if isinstance(each, RigidIsland))
    visitors = island.ties.visitors()
    ends = [visitors.x[0, each.second[0] - 1] for each in island.ties.springs(visitors, 1)]
    assert ends == [2.0, 1.0]


def test_ties_break_for_good_and_what_they_held_is_booked(tmp_path: Path) -> None:
    # Pulled apart with 6 m/s it would come to F = 6 √(k μ) = 24 N; it breaks at 12 N, with F²/2k = 1.8 J in it.
    given = {
        "particles": [bead([1, 0, 0], [6, 0, 0])],
        "bodies": [BALL],
        "springs": [tie(break_force=12.0, name="tie"), tie(stiffness=0.0, name="idle", break_force=1.0)],
        "output": {"ledger": True, "work": True, "every": 10},
    }
    path = tmp_path / "broken.vtkhdf"
    frames = record(path, 0.2, 1e-3, **given)
    rows, tied = frames.ledger, frames.topology["tie"]
    lost = -rows["work.tie.breaking"][-1]
    assert lost == pytest.approx(1.8, rel=0.02)  # its force grows by 2 % in a step
    assert np.abs(rows["balance"]).max() < 1e-3
    # F = k (u/ω) sin ωt: the step in which it breaks begins within one of that time.
    omega = math.sqrt(40.0 / 0.4)
    assert tied.broke[0] == pytest.approx(math.asin(12.0 * omega / (40.0 * 6)) / omega, abs=1e-3)
    assert np.isinf(frames.topology["idle"].broke).all()
    assert tied.pairs.tolist() == [[1, 0]]
    assert tied.points.tolist() == [[[0, 0, 0], [0, 0, 0]]]
    end = frames[-1]["velocity"]
    assert (end == frames[-3]["velocity"]).all()  # nothing pulls any more
    assert end[0, 0] - end[1, 0] == pytest.approx(math.sqrt(36 - 2 * lost / 0.4), rel=1e-4)


def test_a_run_that_goes_on_from_a_snapshot_has_the_same_bits() -> None:
    scenario = ps.from_table(hung(2e-3, 200, break_force=4.0))
    whole, half, rest = (Simulation(scenario, threads=threads) for threads in (1, 2, 1))
    whole.advance_to(200)
    half.advance_to(90)
    restore(rest, snapshot(half))
    rest.step = half.step
    rest.advance_to(200)
    assert np.isfinite(whole.broke()["tie"]).all()
    assert (whole.broke()["tie"] == rest.broke()["tie"]).all()
    for one, other in zip(whole.states, rest.states, strict=True):
        assert (one.x == other.x).all()
        assert (one.v == other.v).all()
    # The forces of the spring on both ends, as frames would have them, cancel.
    assert rest.forces_on(rest.states[0]).sum(axis=0) == pytest.approx(-rest.forces_on(rest.states[1])[0])
    for each in (whole, half, rest):
        each.close()


def test_steps_too_long_for_ties_are_told() -> None:
    # ω² = k (1/m + 1/M) and h = 2/ω.
    longest = 2 / math.sqrt(40.0 * 2.5)
    given = {"particles": [bead([1, 0, 0])], "bodies": [BALL], "springs": [tie()]}
    assert stiff(World(ps.from_table(table(0.99 * longest, 0.99 * longest, **given)))) == ()
    (told,) = stiff(World(ps.from_table(table(1.01 * longest, 1.01 * longest, **given))))
    assert f"{longest:.3g} s" in told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"springs": [tie(points=[[0, 0, 0], [0, 1, 0]])]}, "a particle is a point"),
        ({"springs": [tie(pairs=[[0, 1]])]}, "'bead' has no particle 1"),
        ({"springs": [tie(within=0.5) | {"pairs": None}]}, "springs at bodies are listed"),
        (
            {"springs": [], "rods": [{"between": ["ball", "bead"], "pairs": [[0, 0]]}]},
            "rods join rigid bodies",
        ),
        (
            {"particles": [bead([1, 0, 0], dynamics={"type": "first_order", "drag": 1.0})]},
            "particles with inertia",
        ),
        ({"planes": [{"normal": [0, 1, 0], "contact": "kill", "on": ["bead"]}]}, "may die"),
    ],
)
def test_what_cannot_be_tied_is_refused(change: dict[str, Any], words: str) -> None:
    given = {"particles": [bead([1, 0, 0])], "bodies": [BALL], "springs": [tie()]} | change
    given["springs"] = [{k: v for k, v in each.items() if v is not None} for each in given["springs"]]
    with pytest.raises(ScenarioError, match=words):
        ps.from_table(table(0.1, 1e-3, **given))
