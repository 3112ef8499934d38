"""Springs and rods from rigid bodies to particles, against closed forms, what is conserved, and what the books say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from simulate import EPS, G, points, record, simulate, table

import particlesim as ps
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.ledger.work import total_energy
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.world import World
from particlesim.errors import ScenarioError, UsageError
from particlesim.runs.first_state import stiff

BALL = {"name": "ball", "shape": {"type": "sphere", "radius": 0.1}, "mass": 2.0}


SHEET = {"type": "rectangle", "size": [40, 40], "thickness": "0.2 mm"}


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


def hung(h: float, steps: int, rods: str = "", **other: Any) -> dict[str, Any]:
    """A box that tumbles on an elastic rope of four beads, from a corner; nothing holds the rope. `rods` instead of springs:
    for the "tie" from the rope to the box, or for "all"."""
    rope = {
        "name": "rope",
        "layout": {"type": "rope", "start": [0.4, 0.3, 0.2], "end": [1.0, 0.3, 0.2], "count": 4},
        "mass": 0.1,
        "springs": {"rigid": True} if rods == "all" else {"structural": 300.0},
    }
    box = {
        "name": "box",
        "shape": {"type": "box", "size": [0.3, 0.2, 0.1]},
        "mass": 1.0,
        "velocity": [0.3, -0.5, 0.2],
        "angular_velocity": [1.0, 2.0, -3.0],
    }
    ends = {"between": ["rope", "box"], "points": [[0, 0, 0], [0.15, 0.1, 0.05]], "name": "tie"}
    output = {"ledger": True, "work": True, "every": max(steps // 20, 1)}
    parts = {"particles": [rope], "bodies": [box], "output": output}
    if rods:  # which begins across the rod
        box |= {"velocity": [0.3, -0.5, 1 / 6], "angular_velocity": [5.0, 4.0, 3.0]}
        return table(steps * h, h, rods=[ends], **parts)
    spring = {"stiffness": 60.0, "rest_length": 0.25, "damping": 0.1, **ends, **other}
    return table(steps * h, h, springs=[spring], **parts)


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


@pytest.mark.parametrize("h", [1e-3, 2.5e-4])
@pytest.mark.parametrize("method", ["velocity_verlet", "stormer_verlet"])
def test_a_chain_on_a_body_keeps_its_energy_and_momentum(method: str, h: float) -> None:
    """Störmer's rule began again in each step with the bead that is tied, and went on with the other one: 8e7 J at 1 ms."""
    tie = {"name": "tie", "between": ["beads", "ball"], "pairs": [[0, 0]], "points": [[0, 0, 0], [0, 0, 0]]}
    layout = {"type": "points", "position": [[0, 0, 0], [0.1, 0, 0]], "velocity": [[0, 0.3, 0], [0, 0, 0]]}
    result = simulate(
        0.5,
        h,
        method,
        particles=[{"name": "beads", "mass": 0.003, "layout": layout}],
        bodies=[
            {
                "name": "ball",
                "shape": {"type": "sphere", "radius": 0.05},
                "mass": 1.0,
                "position": [-0.1, 0, 0],
            }
        ],
        springs=[{**tie, "stiffness": 500.0}, {"on": "beads", "pairs": [[0, 1]], "stiffness": 500.0}],
        output={"every": 10, "ledger": True},
    )
    totals = np.array([result.ledger[f"momentum.{axis}"] for axis in "xyz"])
    energies = ("kinetic", "potential.tie", "potential.springs")
    energy = np.sum([np.array(result.ledger[name]) for name in energies], axis=0)
    assert np.abs(totals - totals[:, :1]).max() < 1e3 * EPS * 9e-4
    assert np.abs(energy / energy[0] - 1).max() < 0.25 * 500 / 0.003 * h**2


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rods", ["tie", "all"])
def test_rods_keep_momentum_energy_and_their_lengths(rods: str) -> None:
    # A chain of springs, or of rods that are solved for together with the one at the box.
    balances = []
    for h, steps in ((4e-3, 100), (2e-3, 200)):
        simulation = Simulation(ps.from_table(hung(h, steps, rods)), threads=1)
        start = simulation.ledger()
        for last in range(10, steps + 1, 10):
            simulation.advance_to(last)
            rope, box = simulation.states
            corner = box.x[:, 0] + np.reshape(matrix(box.turn[:, 0]), (3, 3)) @ [0.15, 0.1, 0.05]
            assert np.linalg.norm(rope.x[:, 0] - corner) == pytest.approx(math.sqrt(0.125), abs=1e-14)
            if rods == "all":
                lengths = np.linalg.norm(np.diff(rope.x[:, :4], axis=1), axis=0)
                assert lengths == pytest.approx([0.2] * 3, abs=1e-14)
        now = simulation.ledger()
        for name in ("momentum", "angular_momentum"):
            for axis in "xyz":
                key = f"{name}.{axis}"
                assert abs(now[key] - start[key]) < 4 * EPS * steps, key  # each of size 1
        balances.append(abs(now["balance"]))
        simulation.close()
    assert balances[1] < 1e-6
    assert 3.6 < balances[0] / balances[1] < 4.4


def test_a_bead_below_a_bar_swings_in_its_modes() -> None:
    # A bar on a ball joint, and a bead on a rod from its lower end. For small angles θ of the bar and φ of the rod
    # T = ½ (I + m l²) θ'² + m l b θ'φ' + ½ m b² φ'², V = ½ (M d + m l) g θ² + ½ m g b φ²: two modes, each begun at its
    # greatest angles, and seen after a whole period.
    l, b, mass, m = 1.0, 0.5, 2.0, 0.5  # noqa: E741
    inertia = mass * ((0.1**2 + l**2) / 12 + l**2 / 4)
    kinetic = np.array([[inertia + m * l * l, m * l * b], [m * l * b, m * b * b]])
    stored = np.diag([(mass * l / 2 + m * l) * G, m * G * b])
    squares, modes = eigh(stored, kinetic)
    for square, mode in zip(squares, modes.T, strict=True):
        theta, phi = 1e-4 * mode / np.abs(mode).max()
        end = np.array([math.sin(theta), -math.cos(theta), 0.0])
        bar = {
            "name": "bar",
            "shape": {"type": "box", "size": [0.1, l, 0.1]},
            "mass": mass,
            "position": (0.5 * end).tolist(),
            "orientation": {"axis": [0, 0, 1], "angle": math.degrees(theta)},
        }
        start = end + b * np.array([math.sin(phi), -math.cos(phi), 0.0])
        period, errors = 2 * math.pi / math.sqrt(square), []
        for steps in (40, 80):
            after = simulate(
                period,
                period / steps,
                particles=[bead(start.tolist())],
                bodies=[bar],
                joints=[{"type": "ball", "between": ["bar", "world"], "anchor": [0, 0, 0]}],
                rods=[{"between": ["bead", "bar"], "points": [[0, 0, 0], [0, -l / 2, 0]], "length": b}],
                forces=[{"type": "gravity"}],
            ).final
            errors.append(np.abs(after.velocity[:, 0]).max() / math.sqrt(square))
        assert errors[1] < 1e-4 * (2 * math.pi / 80) ** 2  # the phase is late by (ω h)²/24 of 2π
        assert 3.5 < errors[0] / errors[1] < 4.5


def test_a_box_that_lies_holds_a_bead_below_it() -> None:
    # The solver of contacts knows what hangs on the box: it neither sinks nor slides nor tilts.
    box = {
        "name": "box",
        "shape": {"type": "box", "size": [0.4, 0.2, 0.4]},
        "position": [0, 0.1, 0],
        "mass": 2.0,
    }
    simulation = Simulation(
        ps.from_table(
            table(
                0.4,
                2e-3,
                particles=[bead([0.1, -0.5, 0])],
                bodies=[box],
                rods=[{"between": ["box", "bead"], "points": [[0.1, -0.1, 0], [0, 0, 0]]}],
                planes=[{"normal": [0, 1, 0], "friction": 0.5, "on": ["box"]}],
                forces=[{"type": "gravity"}],
            )
        ),
        threads=1,
    )
    simulation.advance_to(100)
    hanging, lying = (state.x[:, 0].copy() for state in simulation.states)
    simulation.advance_to(200)
    assert simulation.states[0].x[:, 0] == pytest.approx(hanging, abs=2e-6)
    assert simulation.states[1].x[:, 0] == pytest.approx(lying, abs=1e-7)
    assert lying == pytest.approx([0, 0.1, 0], abs=2e-5)
    simulation.close()


def test_dampers_of_light_beads_take_nothing_from_a_load_at_rest() -> None:
    # 1 kg on a bead of 10 g, which gets Δv = M g h/m in every step and gives it to its own spring: at rest for its damper.
    k, m, load = 400.0, 0.01, 1.0
    springs = [
        {
            "on": "bead",
            "pairs": [[0, 1]],
            "name": "own",
            "rest_length": 0.5 - (m + load) * G / k,
            "damping": 1.0,
        },
        {"between": ["ball", "bead"], "pairs": [[0, 1]], "rest_length": 0.3 - load * G / k},
    ]
    beads = {"type": "points", "position": [[0, 0, 0], [0, -0.5, 0]]}
    rows = simulate(
        0.1,
        1e-3,
        particles=[{"name": "bead", "mass": m, "layout": beads, "pinned": [0]}],
        bodies=[BALL | {"mass": load, "position": [0, -0.8, 0]}],
        springs=[each | {"stiffness": k} for each in springs],
        forces=[{"type": "gravity"}],
        output={"ledger": True, "work": True},
    ).ledger
    taken = 1.0 * (load * G * 1e-3 / m) ** 2 / 3 * 0.1  # by a damper on the way from Δv to 0
    assert abs(rows["work.own"][-1]) < 0.01 * taken
    assert abs(rows["balance"][-1]) < 0.05 * taken


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


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rods", ["", "tie"])
def test_a_run_that_goes_on_from_a_snapshot_has_the_same_bits(rods: str) -> None:
    scenario = ps.from_table(hung(2e-3, 200, rods, break_force=4.0))
    whole, half, rest = (Simulation(scenario, threads=threads) for threads in (1, 2, 1))
    whole.advance_to(200)
    half.advance_to(90)
    restore(rest, snapshot(half))
    rest.step = half.step
    rest.advance_to(200)
    if not rods:
        assert np.isfinite(whole.broke()["tie"]).all()
        assert (whole.broke()["tie"] == rest.broke()["tie"]).all()
    for one, other in zip(whole.states, rest.states, strict=True):
        assert (one.x == other.x).all()
        assert (one.v == other.v).all()
    # The forces of the spring on both ends, as frames would have them, cancel.
    assert rest.forces_on(rest.states[0]).sum(axis=0) == pytest.approx(
        -rest.forces_on(rest.states[1])[0], abs=1e-12
    )
    for each in (whole, half, rest):
        each.close()


def test_steps_too_long_for_ties_are_told() -> None:
    # ω² = k (1/m + 1/M) and h = 2/ω.
    longest = 2 / math.sqrt(40.0 * 2.5)
    given = {"particles": [bead([1, 0, 0])], "bodies": [BALL], "springs": [tie()]}
    assert stiff(World(ps.from_table(table(0.99 * longest, 0.99 * longest, **given)))) == ()
    (told,) = stiff(World(ps.from_table(table(1.01 * longest, 1.01 * longest, **given))))
    assert f"{longest:.3g} s" in told
    # ω² times itself is infinite here: it had been said that any step would do.
    given["springs"] = [tie(stiffness=1e300)]
    (told,) = stiff(World(ps.from_table(table(1e-3, 1e-3, **given))))
    assert f"{2 / math.sqrt(1e300 * 2.5):.3g} s" in told


def test_the_work_of_a_motion_that_leads_an_end_is_refused() -> None:
    led = {
        "particles": [bead([1, 0, 0], pinned=[0])],
        "bodies": [BALL],
        "rods": [{"between": ["ball", "bead"]}],
        "motions": [{"on": "bead", "path": ["0.1 * sin(t)", "0", "0"]}],
    }
    with pytest.raises(UsageError, match="the work of such a motion is not recorded"):
        World(ps.from_table(table(0.1, 1e-3, output={"work": True, "ledger": True}, **led)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"springs": [tie(points=[[0, 0, 0], [0, 1, 0]])]}, "a particle is a point"),
        ({"springs": [tie(pairs=[[0, 1]])]}, "'bead' has no particle 1"),
        ({"springs": [tie(within=0.5) | {"pairs": None}]}, "springs at bodies are listed"),
        (
            {"joints": [{"type": "ball", "between": ["ball", "bead"], "anchor": [0, 0, 0]}]},
            "joints join rigid bodies",
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


def energies(run: Simulation) -> tuple[Any, float]:
    """Kinetic energy, and all that is stored, at all steps [J]; and the largest kinetic energy."""
    rows = []
    for step in range(run.scenario.grid.steps + 1):
        run.advance_to(step)
        rows.append(run.ledger())
    kinetic = [row["kinetic"] for row in rows]
    return np.array([total_energy(row) for row in rows]), max(kinetic)


SWINGING = {
    "bodies": [
        {"name": "box", "shape": {"type": "box", "size": [0.3] * 3}, "mass": 5.0, "position": [0, 1.2, 0]}
    ],
    "springs": [
        {
            "between": ["box", "bead"],
            "points": [[0.1, 0, 0], [0, 0, 0]],
            "stiffness": 200.0,
            "rest_length": 0.5,
        }
    ],
    "forces": [{"type": "gravity"}],
}
OMEGA = math.sqrt(200.0 * (1 / 0.5 + 1 / 5.0))
"""Of the bead against the box [1/s]."""


@pytest.mark.parametrize(
    "collider",
    [
        {"type": "plane"},
        {"type": "box", "inside": True, "center": [0, 1.2, 0], "size": [1.6, 2.4, 1.6]},
        {"type": "sphere", "inside": True, "center": [0, 1.2, 0], "radius": 1.2},
    ],
)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_particle_on_a_spring_bounces_without_gain_or_loss(collider: dict[str, Any], seed: int) -> None:
    # A particle bounces with all that its spring gives it in the step, also with what comes after the impact, −2 r f·n |v·n|
    # with r left of the step: that had been up to 4·10⁻² of the kinetic energy in these two seconds, and 8·10⁻³ in steps of
    # 0.5 ms. The energy of a leapfrog swings by (ω h)²/4, with the spring from one side to the other by twice that.
    rng = np.random.default_rng(seed)
    velocity = (2 * rng.normal(size=3)).tolist()
    parts = SWINGING | {"colliders": [{"restitution": 1.0, **collider}]}
    for h in (2e-3, 5e-4):
        swarm = [points((0.05, 0.6, 0.02), velocity=[velocity], name="bead", mass=0.5, radius=0.04)]
        energy, most = energies(Simulation(ps.from_table(table(2.0, h, particles=swarm, **parts))))
        assert np.abs(energy - energy[0]).max() < 0.5 * (OMEGA * h) ** 2 * most


def test_particles_on_springs_that_hit_each_other_keep_energy_and_momentum() -> None:
    # Six beads around a body, which hit each other: that gave up to 3·10⁻² of the kinetic energy in three seconds.
    angle = np.arange(6) * math.tau / 6
    around = np.stack([0.5 * np.cos(angle), 0.02 * np.sin(3 * angle), 0.5 * np.sin(angle)], axis=1)
    speeds = 2 * np.random.default_rng(3).normal(size=(6, 3))
    beads = points(*around.tolist(), velocity=speeds.tolist(), name="bead", mass=0.5, radius=0.08)
    pairs = [[0, k] for k in range(6)]
    spring = {"between": ["box", "bead"], "pairs": pairs, "stiffness": 200.0, "rest_length": 0.5}
    box = {"name": "box", "shape": {"type": "box", "size": [0.1] * 3}, "mass": 5.0}
    touch = {"type": "contact", "on": ["bead"], "restitution": 1.0}
    parts = {"bodies": [box], "springs": [spring], "interactions": [touch], "particles": [beads]}
    for h in (2e-3, 5e-4):
        run = Simulation(ps.from_table(table(3.0, h, **parts)))
        energy, most = energies(run)
        assert np.abs(energy - energy[0]).max() < 0.5 * (OMEGA * h) ** 2 * most
        momentum = sum((state.mass[:, None] * state.velocity).sum(axis=0) for state in run.states)
        assert momentum == pytest.approx(0.5 * speeds.sum(axis=0), abs=1e-12)


def test_a_damper_to_a_particle_that_bounces_gives_nothing() -> None:
    # It acts against the velocity before the impact, and after it, against the one that is turned around: in steps of 2 ms
    # the energy had risen by 4·10⁻³ of the kinetic one.
    swarm = [points((0.05, 0.6, 0.02), velocity=[[1.0, -4.0, 0.5]], name="bead", mass=0.5, radius=0.04)]
    spring = {**SWINGING["springs"][0], "damping": 1.0}
    parts = SWINGING | {"springs": [spring], "planes": [{"restitution": 1.0}], "particles": swarm}
    energy, most = energies(Simulation(ps.from_table(table(2.0, 2e-3, **parts))))
    rise = energy - np.minimum.accumulate(energy)
    assert rise.max() < 1e-5 * most
    assert energy[-1] < energy[0] - 0.1 * most


def test_what_a_collider_takes_of_a_particle_on_a_spring_is_booked() -> None:
    # The spring pulls on where the impact has put the particle, not on where it would have come without: f·d of the work
    # of contact. Half of the impulse times what the spring gave had been booked, and 2·10⁻³ of the largest kinetic energy
    # was lacking.
    bead = points((0.05, 0.6, 0.02), velocity=[[1.0, -2.0, 0.5]], name="bead", mass=0.5, radius=0.04)
    parts = SWINGING | {"particles": [bead], "planes": [{"restitution": 1.0}]}
    output = {"ledger": True, "work": True, "every": 10}
    rows = ps.run(ps.from_table(table(2.0, 2e-3, output=output, **parts))).ledger
    assert np.abs(rows["balance"]).max() < 5e-4 * rows["kinetic"].max()
    assert np.abs(rows["work.contact"]).max() < 5e-5 * rows["kinetic"].max()


@pytest.mark.parametrize("radius", [0.03, 0.0])
@pytest.mark.parametrize("restitution", [1.0, 0.5, 0.0])
@pytest.mark.parametrize("angle", [0.0, 30.0, 75.0])
def test_a_rod_passes_an_impact_on_at_once(angle: float, restitution: float, radius: float) -> None:
    # Two masses on a rod at an angle to the vertical fall onto a floor, the bead first. At the bead the pair has the inverse
    # mass 1/m − (cos θ/m)²/(1/m + 1/M) along the vertical; an impulse (1 + e) u over that turns it around, and the rod
    # shares it out: Δv of the ball is along the rod. Before, the bead bounced alone, and the rod passed that on without
    # rebound.
    theta, m, big, u = math.radians(angle), 0.5, 2.0, 3.0
    rod = np.array([math.sin(theta), math.cos(theta), 0.0])
    inverse = 1 / m - (rod[1] / m) ** 2 / (1 / m + 1 / big)
    blow = (1 + restitution) * u / inverse
    pull = blow * rod[1] / m / (1 / m + 1 / big)
    expected = [
        -u * np.array([0, 1, 0]) + (blow * np.array([0, 1, 0]) - pull * rod) / m,
        [0, -u, 0] + pull * rod / big,
    ]
    start = np.array([0, radius + 0.02, 0])
    bead = points(start.tolist(), velocity=[[0, -u, 0]], name="bead", mass=m, radius=radius)
    ball = BALL | {"position": (start + rod).tolist(), "velocity": [0, -u, 0], "mass": big}
    rods = [{"between": ["ball", "bead"], "pairs": [[0, 0]], "name": "rod"}]
    floor = {"restitution": restitution}
    end = simulate(0.008, 1e-3, particles=[bead], bodies=[ball], rods=rods, planes=[floor]).final
    # It comes there in the step from 0.006 s on, and turns until 0.008 s at up to ω = 2 u/L: velocities change by ω² L t.
    assert np.allclose(end.velocity, expected, atol=4 * u**2 * 0.002)


@pytest.mark.parametrize("radius", [0.04, 0.0])
@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_bead_on_a_rod_that_bounces_gains_nothing(restitution: float, radius: float) -> None:
    # An elastic one had lost half of its energy, as it bounced alone; and as repeated impacts were awaited like a force, the
    # energy had risen again by up to 0.4 of the kinetic one. In steps of 2 ms it meets two faces in one, which took 0.2.
    velocity = np.array([1.0, -2.0, 0.5])
    along = np.array([-0.05, -0.6, 0.02])
    velocity -= along * (velocity @ along) / (along @ along)
    bead = points((0.05, 0.6, 0.02), velocity=[velocity.tolist()], name="bead", mass=0.5, radius=radius)
    rods = [
        {"between": ["box", "bead"], "points": [[0.1, 0, 0], [0, 0, 0]], "pairs": [[0, 0]], "name": "rod"}
    ]
    room = {
        "type": "box",
        "inside": True,
        "center": [0, 1.2, 0],
        "size": [1.6, 2.4, 1.6],
        "restitution": restitution,
    }
    parts = SWINGING | {"springs": [], "rods": rods, "colliders": [room], "particles": [bead]}
    energy, most = energies(Simulation(ps.from_table(table(3.0, 2e-3, **parts))))
    assert (energy - np.minimum.accumulate(energy)).max() < 5e-4 * most
    if restitution == 1:
        assert energy[-1] > energy[0] - 5e-4 * most


def test_a_chain_that_falls_upright_onto_an_elastic_floor_gains_nothing() -> None:
    # Two beads below a ball, nearly one above the other: repeated impacts of the lower one, awaited like a force, gave 220
    # times the energy at the start.
    rng = np.random.default_rng(29)
    speed, lean, length = rng.uniform(1, 15), rng.uniform(-1.4, 1.4), rng.uniform(0.1, 0.5)
    rng.integers(1, 4)
    rod = np.array([math.sin(lean), math.cos(lean), 0.1 * rng.normal()])
    rod *= length / np.linalg.norm(rod)
    top = 2 * rod + [0, rng.uniform(0.05, 0.3), 0]
    rng.normal()
    big, small = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-2, 0.5)
    places = [(top - (k + 1) * rod).tolist() for k in range(2)]
    beads = points(*places, velocity=[[0, -speed, 0]] * 2, name="bead", mass=small, radius=0.03)
    ball = {
        "name": "ball",
        "shape": {"type": "sphere", "radius": 0.05},
        "mass": big,
        "position": top.tolist(),
    }
    rods = [
        {"between": ["ball", "bead"], "pairs": [[0, 0]], "name": "rod"},
        {"on": "bead", "pairs": [[0, 1]], "name": "link"},
    ]
    floor = {"restitution": 1.0, "friction": 0.4}
    parts = {
        "particles": [beads],
        "bodies": [ball | {"velocity": [0, -speed, 0]}],
        "rods": rods,
        "planes": [floor],
    }
    energy, most = energies(Simulation(ps.from_table(table(0.3, 1e-3, **parts))))
    assert energy.max() < energy[0] + 1e-3 * most


@pytest.mark.parametrize("radius", [0.03, 0.0])
@pytest.mark.parametrize("step", [8e-3, 1e-3])
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_a_bead_that_slides_on_a_rod_rubs_by_what_presses_it(method: str, step: float, radius: float) -> None:
    # The impulse of friction is μ times that along the normal, of the bead and the ball together. What a rod left 10⁻⁸ m
    # over the ground had landed there in each step, with a velocity that was half a step late: half as much again.
    bead = points((0.2, radius, 0), velocity=[[8.0, 0, 0]], name="bead", mass=1.0, radius=radius)
    ball = BALL | {"mass": 0.5, "position": [-0.1, 0.37 + radius, 0], "velocity": [8.0, 0, 0]}
    parts = {
        "particles": [bead],
        "bodies": [ball],
        "rods": [{"between": ["ball", "bead"], "pairs": [[0, 0]], "name": "rod"}],
        "planes": [{"friction": 0.4, "on": ["bead"], "restitution": 0.0}],
        "forces": [{"type": "gravity", "on": ["bead"]}],
    }
    end = simulate(0.096, step, method, **parts).final
    mass = np.array([1.0, 0.5])
    lost = 8.0 * mass.sum() - (mass * end.velocity[:, 0]).sum()
    pressed = G * 0.096 + (mass * end.velocity[:, 1]).sum()
    assert lost == pytest.approx(0.4 * pressed, rel=1e-3)


def hanging_chain(seed: int, fastest: float, radius: float) -> dict[str, Any]:
    """One to three beads on rods below a ball, at any angle, that fall onto a sheet at up to so many m/s."""
    rng = np.random.default_rng(seed)
    speed, lean, length, count = (
        rng.uniform(1, fastest),
        rng.uniform(-1.4, 1.4),
        rng.uniform(0.1, 0.5),
        rng.integers(1, 4),
    )
    rod = np.array([math.sin(lean), math.cos(lean), 0.1 * rng.normal()])
    rod *= length / np.linalg.norm(rod)
    top = count * rod + [0, rng.uniform(0.05, 0.3), 0]
    places = [(top - (k + 1) * rod).tolist() for k in range(count)]
    big, small = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-2, 0.5)
    beads = points(*places, velocity=[[0, -speed, 0]] * count, name="bead", mass=small, radius=radius)
    shape = {"type": "sphere", "radius": 0.05}
    ball = {"name": "ball", "shape": shape, "mass": big, "position": top.tolist(), "velocity": [0, -speed, 0]}
    rods: list[dict[str, Any]] = [{"between": ["ball", "bead"], "pairs": [[0, 0]], "name": "rod"}]
    if count > 1:
        rods.append({"on": "bead", "pairs": [[k, k + 1] for k in range(count - 1)], "name": "link"})
    sheet = SHEET | {"restitution": (seed % 3) / 2}
    return {"particles": [beads], "bodies": [ball], "rods": rods, "colliders": [sheet]}


@pytest.mark.parametrize("radius", [0.03, 0.0])
@pytest.mark.parametrize("fastest", [3.0, 40.0])
@pytest.mark.parametrize("seed", range(8))
def test_chains_on_rods_do_not_pass_a_thin_sheet(seed: int, fastest: float, radius: float) -> None:
    # Of points at up to 3 m/s, 19 in 40 had come behind it, and elastic ones had gained up to 340 times their energy: what
    # is swift for its radius bounced for itself, and its rods drew it on. Elastic ones keep their energy, but for its swings
    # as they turn, which follow the square of the angle that they turn by in a step.
    run = Simulation(ps.from_table(table(0.15, 1e-3, **hanging_chain(seed, fastest, radius))))
    energy, most = energies(run)
    for state in run.states:
        assert state.position[:, 1].min() > 0
    assert energy.max() < energy[0] + 5e-3 * most
    if seed % 3 == 2:
        assert energy[-1] > energy[0] - 2e-2 * most


def test_what_rods_would_draw_through_a_sheet_is_told() -> None:
    told = []
    for seed in (7, 8, 13):
        run = ps.run(ps.from_table(table(0.3, 2e-3, **hanging_chain(seed, 3.0, 0.0))))
        assert run.final.position[:, 1].min() > 0
        told.append(any("would have drawn a particle through a collider" in each for each in run.warnings))
    assert told == [True, False, True]


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_a_sheet_that_rises_to_points_on_rods_is_not_passed(restitution: float) -> None:
    # What a rod would draw through it waits before it, and goes with it.
    for seed in range(6):
        rng = np.random.default_rng(seed)
        speed, rod = rng.uniform(0, 10), 0.6 * rng.normal(size=3) - [0, 1, 0]
        top = np.array([0, 0.3, 0])
        place = (top + 0.2 * rod / np.linalg.norm(rod)).tolist()
        bead = points(place, velocity=[[0, -speed, 0]], name="bead", mass=0.2)
        shape = {"type": "sphere", "radius": 0.02}
        ball = {"name": "ball", "shape": shape, "mass": 1.0, "velocity": [0, -speed, 0]}
        sheet = SHEET | {"name": "sheet", "on": ["bead"], "restitution": restitution}
        parts = {
            "particles": [bead],
            "bodies": [ball | {"position": top.tolist()}],
            "rods": [{"between": ["ball", "bead"], "pairs": [[0, 0]]}],
            "colliders": [sheet],
            "motions": [{"collider": "sheet", "path": ["0", "5*t", "0"]}],
        }
        run = Simulation(ps.from_table(table(0.1, 1e-3, **parts)))
        for step in range(101):
            run.advance_to(step)
            at = next(state.position for state in run.states if state.name == "bead")
            assert at[0, 1] > 5 * step * 1e-3


@pytest.mark.parametrize("radius", [0.02, 0.0])
def test_a_light_bead_that_lies_under_a_load_gains_nothing(radius: float) -> None:
    # A ball of 48 times its mass hangs below it. Its rebounds in its own step were awaited like forces, and grew by 1 + e in
    # each step: there were 10⁵ J and more within 0.08 s.
    bead = points((0, radius + 1e-4, 0), name="bead", mass=0.125, radius=radius)
    shape = {"type": "sphere", "radius": 0.05}
    ball = {"name": "ball", "shape": shape, "mass": 6.0, "position": [0, -0.3, 0], "velocity": [0.5, 0, 0]}
    parts = {
        "particles": [bead],
        "bodies": [ball],
        "rods": [{"between": ["ball", "bead"], "pairs": [[0, 0]]}],
        "colliders": [SHEET | {"on": ["bead"], "restitution": 1.0}],
        "forces": [{"type": "gravity"}],
    }
    energy, most = energies(Simulation(ps.from_table(table(0.2, 5e-4, **parts))))
    assert energy.max() < energy[0] + 5e-2 * most  # it swings with the step


def test_what_keeps_beads_before_colliders_looks_at_beads_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    # Grains that touch the body were among them: their numbers were written beyond the end of an array.
    looks: list[tuple[int, ...]] = []

    def look(walls: Any, kind: Any, radius: Any, x: Any, y: Any, gain: Any, *more: Any) -> None:
        looks.append((len(kind), len(radius), x.shape[1], y.shape[1], gain.shape[1], len(more[-2])))

    monkeypatch.setattr("particlesim.engine.rigid.kept_back.passed", look)
    sand = np.random.default_rng(1).uniform(-0.1, 0.1, (40, 3)) + np.array((0, 0.8, 0))
    simulate(
        0.01,
        1e-3,
        bodies=[
            {
                "name": "b",
                "mass": 5,
                "shape": {"type": "box", "size": [0.4, 0.2, 0.4]},
                "position": [0, 0.6, 0],
            }
        ],
        particles=[
            points((-0.3, 0.05, 0), (0.3, 0.05, 0), (0, 0.05, 0.3), mass=0.1, radius=0.0, name="feet"),
            points(*sand.tolist(), mass=1e-3, radius=0.005, name="sand"),
        ],
        rods=[{"name": f"leg{k}", "between": ["b", "feet"], "pairs": [[0, k]]} for k in range(3)],
        interactions=[{"type": "contact", "on": ["sand", "b"], "restitution": 0.0}],
        colliders=[{"type": "rectangle", "size": [4, 4], "restitution": 0.0}],
    )
    assert looks
    assert set(looks) == {(3,) * 6}
