"""Heaps of hard grains: they come to rest, however deep, as every step begins with the impulses of the last one, and a start
adds no energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree
from simulate import G, Table, points, table

import particlesim as ps
from particlesim.engine.diagnosis.sunk import DEEP
from particlesim.engine.interactions.hard.memory import Known, known_by
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot

R, M, DT = 0.1, 1.0, 1e-3


def heap(layers: int, duration: float, dt: float = DT, side: int = 4, **parts: Any) -> Table:
    """Layers of grains with gaps between them, in a well with smooth sides."""
    rng = np.random.default_rng(3)
    gap = parts.pop("gap", 2.2)
    cells = np.stack(np.meshgrid(*map(np.arange, (side, layers, side)), indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    places = (cells + 0.5) * gap * R + rng.uniform(-0.4, 0.4, cells.shape) * (gap - 2) * R
    width = side * gap * R
    floor = {"name": "floor", "type": "box", "size": [8, 2, 8], "center": [width / 2, -1, width / 2]}
    well = {"type": "box", "inside": True, "size": [width, 40, width], "center": [width / 2, 10, width / 2]}
    contact = parts.pop("contact", {})
    law = {key: contact[key] for key in ("restitution", "friction") if key in contact}
    group = points(*places.tolist(), velocity=[(0.0, 0.0, 0.0)] * len(places), mass=M, radius=R)
    return table(
        duration,
        dt,
        particles=[group],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 0, **contact}],
        colliders=[{"restitution": 0, **floor, **law}, {"restitution": 0, **well}],
        **parts,
    )


def depths(x: np.ndarray, r: float = R) -> np.ndarray:
    """How far grains overlap [m], of all pairs that do."""
    pairs = cKDTree(x).query_pairs(2 * r, output_type="ndarray")
    return np.asarray(2 * r - np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "contact",
    [
        pytest.param({}, marks=pytest.mark.slow),
        pytest.param({"restitution": 0.5}, marks=pytest.mark.slow),
        {"friction": 0.5},
        pytest.param(
            {"restitution": 0.5, "friction": {"static": 0.6, "kinetic": 0.4}}, marks=pytest.mark.slow
        ),
    ],
    ids=["smooth", "lively", "rough", "both"],
)
def test_deep_heaps_come_to_rest(contact: dict[str, Any]) -> None:
    # In every step forces bring about g dt, and overlaps of g dt² in a heap that does not hold. This one holds to a
    # twentieth of the one, and a fiftieth of a radius. Single grains may still find their place.
    simulation = Simulation(ps.from_table(heap(12, 3.0, gap=2.05, contact=contact)), threads=1)
    simulation.advance_to(3000)
    (state,) = simulation.states
    simulation.close()
    speed = np.sqrt((state.v**2).sum(axis=0))
    assert np.median(speed) < 0.05 * G * DT
    found = depths(state.position)
    assert found.max() < 0.02 * R
    assert found.mean() < 1e-3 * R
    assert (state.position[:, 1] - R).min() > -1e-12


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", [DT, 4 * DT, pytest.param(20 * DT, marks=pytest.mark.slow)])
def test_they_keep_their_height_or_tell(step: float) -> None:
    # 24 layers, in steps in which they fall by 1e-4, 1.6e-3, and 0.04 of a radius. They come down swiftly then, and have so
    # many impacts in a step that some wait for its end; grains may be wedged in.
    result = ps.run(ps.from_table(heap(24, 1.6, step)))
    deep = depths(np.array(result.final["position"])).max() > DEEP * R
    assert any("sunk" in text for text in result.warnings) == deep
    if step == DT:
        assert not result.warnings
    if step > 4 * DT:
        assert any("sunk" in text or "stayed" in text for text in result.warnings)


BLOCK, WIDE = (8, 10, 8), 8 * 2.2 * 0.005
HOLDS = {
    "box": {"type": "box", "size": [WIDE, 10, WIDE], "center": [WIDE / 2, 5, WIDE / 2]},
    "bowl": {"type": "sphere", "radius": 0.22, "center": [WIDE / 2, 0.42, WIDE / 2]},
    "cup": {
        "type": "cylinder",
        "start": [WIDE / 2, 0.2, WIDE / 2],
        "end": [WIDE / 2, 2, WIDE / 2],
        "radius": 0.07,
    },
}


@pytest.mark.sampled(4)
@pytest.mark.sampled(1)  # each has its own way
@pytest.mark.parametrize(
    ("container", "step", "restitution", "friction"),
    [
        ("box", 0.001, 0.0, 0.0),
        pytest.param("box", 0.001, 0.3, 0.5, marks=pytest.mark.slow),
        ("bowl", 0.002, 0.1, 0.5),
        ("cup", 0.002, 0.1, 0.5),
    ],
)
def test_a_block_of_many_grains_falls_and_does_not_sink(
    container: str, step: float, restitution: float, friction: float
) -> None:
    # They come by half of their radius in a step, and are more than 256, so that nobody follows them from impact to impact.
    # Moved apart, they had come into others that nothing had looked at, a radius deep, and lay there, or into bent walls
    # that nothing had looked at, which put them back there. What lifted them out of each other again had been 1 % of the
    # kinetic energy.
    r = 0.005
    cells = np.stack(np.meshgrid(*map(np.arange, BLOCK), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (cells + 0.5) * 2.2 * r + np.random.default_rng(0).uniform(-0.09, 0.09, cells.shape) * r
    law = {"restitution": restitution, "friction": friction}
    grains = points(*(places + np.array([0, 0.3, 0])).tolist(), mass=1e-3, radius=r)
    scenario = table(
        0.45,
        step,
        particles=[grains],
        forces=[{"type": "gravity"}],
        colliders=[{**HOLDS[container], "inside": True, **law}],
        interactions=[{"type": "contact", **law}],
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    deepest, energies, kinetic = [], [], 0.0
    for frame in range(50, 226):
        simulation.advance_to(round(frame * 0.002 / step))
        x = simulation.states[0].position
        deepest.append(depths(x, r).max(initial=0.0))
        row = simulation.ledger()
        energies.append(row["kinetic"] + row["potential.gravity"])
        kinetic = max(kinetic, row["kinetic"])
    simulation.close()
    energy = np.array(energies)
    assert max(deepest) < 0.3 * r
    assert deepest[-1] < 0.02 * r
    assert (energy - np.minimum.accumulate(energy)).max() < 1e-4 * kinetic


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_a_heap_that_loses_its_floor_falls_as_one(restitution: float) -> None:
    # What the last step has given is too much now. The floor goes away at 40 m/s², and in 0.1 s all fall by as much.
    scenario = heap(6, 2.1, contact={"restitution": restitution}, output={"every": 50, "ledger": True})
    scenario["motions"] = [{"collider": "floor", "path": ["x", "y - 20*max(t - 2, 0)**2", "z"]}]
    simulation = Simulation(ps.from_table(scenario), threads=1)
    simulation.advance_to(2000)
    before = simulation.states[0].v.copy()
    kinetic = simulation.ledger()["kinetic"]
    simulation.advance_to(2100)
    change = simulation.states[0].v - before + np.array([[0], [G * 0.1], [0]])
    fall = simulation.ledger()["kinetic"]
    simulation.close()
    # but for what had not come to rest, whose energy does not grow
    own = np.sqrt(2 * kinetic / M)
    assert np.sqrt((change**2).sum()) < 2 * own + 1e-9
    count = before.shape[1]
    assert fall <= 0.5 * M * count * (G * 0.1) ** 2 + M * count * G * 0.1 * own + kinetic + 1e-9


def test_what_a_start_adds_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    # With one turn in a step, which cannot take back what the heap no longer needs without its floor.
    scenario = heap(6, 2.1, gap=2.05)
    scenario["motions"] = [{"collider": "floor", "path": ["x", "y - 20*max(t - 2, 0)**2", "z"]}]
    before = Simulation(ps.from_table(scenario), threads=1)
    before.advance_to(2000)
    for name in ("TURNS", "MOST_TURNS"):
        monkeypatch.setattr(f"particlesim.engine.interactions.hard.impulses.{name}", 1)
    simulation = Simulation(ps.from_table(scenario), threads=1)
    restore(simulation, snapshot(before))
    before.close()
    known = simulation.islands[0].interactions[-1].known
    weight = M * G * DT
    assert np.sqrt((known.push[: known.begin[-1]] ** 2).sum(axis=1)).max() > 4 * weight / M
    energy = []
    for step in range(2000, 2020):
        simulation.advance_to(step)
        v = simulation.states[0].v
        energy.append(float(0.5 * M * ((v - v.mean(axis=1, keepdims=True)) ** 2).sum()))
    simulation.close()
    assert max(energy) < energy[0] + 1e-6 * 0.5 * M * (G * DT) ** 2


@pytest.mark.slow
def test_a_heap_on_a_lift_rests_as_on_the_ground() -> None:
    # Laws are the same for who moves along, and what the floor does work on has not gained energy from nothing.
    speed, duration = 2.0, 4.0
    scenario = heap(5, duration, gap=2.05)
    scenario["particles"][0]["layout"]["velocity"] = [(0.0, speed, 0.0)] * 80
    scenario["motions"] = [{"collider": "floor", "path": ["x", f"y + {speed}*t", "z"]}]
    simulation = Simulation(ps.from_table(scenario), threads=1)
    simulation.advance_to(4000)
    (state,) = simulation.states
    v = state.v - np.array([[0], [speed], [0]])
    assert np.median(np.sqrt((v**2).sum(axis=0))) < 0.05 * G * DT
    assert depths(state.position).max() < 0.02 * R
    simulation.close()


def drawn_together(friction: float, restitution: float, duration: float) -> Table:
    """Grains that a spring to the middle makes a ball, which turns, in empty space."""
    rng = np.random.default_rng(5)
    cells = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) - 1.5
    places = cells * 2.1 * R + rng.uniform(-0.04, 0.04, cells.shape) * R
    velocity = np.cross([0, 1.0, 0], places)
    return table(
        duration,
        DT,
        particles=[points(*places.tolist(), velocity=velocity.tolist(), mass=M, radius=R)],
        forces=[{"type": "point_spring", "stiffness": 40.0}],
        interactions=[{"type": "contact", "restitution": restitution, "friction": friction}],
        output={"every": 50, "ledger": True},
    )


@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 0.0), (0.5, 0.0), (0.5, 0.6)])
def test_a_ball_of_grains_that_turns_keeps_its_angular_momentum_and_gains_no_energy(
    friction: float, restitution: float
) -> None:
    # Impulses act in the middle of a step, along the normal there. Only moving apart changes angular momentum: by 1e-3 in
    # the first blows, by next to nothing where all lie still, and a little more where smooth grains slide.
    simulation = Simulation(ps.from_table(drawn_together(friction, restitution, 3.0)), threads=1)
    sums, energy = [], []
    for step in range(0, 3001, 250):
        simulation.advance_to(step)
        (state,) = simulation.states
        turning = M * np.cross(state.position, state.v.T).sum(axis=0)
        if friction:
            turning += 0.4 * M * R * R * state.angular_velocity.sum(axis=1)
        sums.append(turning)
        row, given = simulation.ledger(), simulation.islands[0].interactions[-1].given
        energy.append(row["kinetic"] + row["potential.point_spring"] - given)
    simulation.close()
    drift = np.abs(np.array(sums) - sums[4]).max(axis=1) / np.abs(sums[4]).max()
    assert drift.max() < 3e-3
    assert drift[5:].max() < (1e-6 if friction else 3e-4)
    # A leapfrog keeps energy to (ω dt)²/4 of what swings, Σ M (dt F/M)²/8, and so does each contact that begins at rest, of
    # which a grain has up to twelve.
    assert np.diff(energy).max() < 12 * 0.25 * 40.0 / M * DT**2 * energy[0]
    assert energy[-1] < 0.95 * energy[0]


@pytest.mark.parametrize(
    "many",
    [pytest.param(False, marks=pytest.mark.slow), True],
    ids=["in their order", "in the order of space"],
)
def test_a_resumed_heap_has_the_same_bits(many: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """What contacts have been given goes with them into checkpoints, and into another order of memory and back."""
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    contact = {"restitution": 0.3, "friction": 0.5}
    scenario = heap(6, 1.0, contact=contact)
    places = np.array(scenario["particles"][0]["layout"]["position"])
    scenario["particles"][0]["layout"]["position"] = np.random.default_rng(0).permutation(places).tolist()
    plain = Simulation(ps.from_table(scenario), threads=1)
    if many:
        monkeypatch.setattr("particlesim.engine.islands.in_space.WORTH_PARTICLES", 1)
    one, other = (Simulation(ps.from_table(scenario), threads=k) for k in (1, 2))
    for step in (250, 500):
        one.advance_to(step)
    restore(other, snapshot(one))
    for each in (one, other):
        each.advance_to(750)
    with monkeypatch.context() as patch:
        patch.setattr("particlesim.engine.islands.in_space.WORTH_PARTICLES", 10**9)
        for step in (250, 500, 750):
            plain.advance_to(step)
    known = one.islands[0].interactions[-1].known
    assert known.begin[-1] > 100
    for each in (other, plain):
        assert one.states[0].x.tobytes() == each.states[0].x.tobytes()
        assert one.states[0].v.tobytes() == each.states[0].v.tobytes()
        each.close()
    one.close()


def test_what_is_known_follows_its_particles() -> None:
    # contacts 0–2, 0–collider 1, 1–2 and 2–3 of four particles, of which the second dies, and the others turn around
    known = Known(np.array([0, 2, 3, 4, 4]), np.array([2, -2, 2, 3, 0]), np.arange(15.0).reshape(5, 3))
    found = known_by(known, np.array([2, -1, 1, 0]), 3, 6)
    assert found.begin.tolist() == [0, 1, 2, 3]
    assert found.partner[:3].tolist() == [1, 2, -2]
    assert found.push[:3].tolist() == [[-9, -10, -11], [0, -1, -2], [3, 4, 5]]
    assert len(found.partner) == len(found.push) == 6


@pytest.mark.slow
def test_grains_that_lie_keep_what_they_carry_while_others_are_born_and_die() -> None:
    # 30 times in the last second: to begin anew would be to fall by g dt each time.
    scenario = heap(8, 4.0, gap=2.05)
    tap = {"type": "point", "position": [0.4, 8.0, 0.4]}
    scenario["emitters"] = [
        {"name": "tap", "shape": tap, "rate": 15.0, "lifetime": 0.1, "mass": M, "radius": R, "speed": 0.0}
    ]
    simulation = Simulation(ps.from_table(scenario), threads=1)
    fastest = []
    for step in range(3000, 4001, 25):
        simulation.advance_to(step)
        fastest.append(float(np.median(np.sqrt((simulation.states[0].v ** 2).sum(axis=0)))))
    simulation.close()
    assert np.median(fastest) < 1e-3 * G * DT
    assert max(fastest) < 0.05 * G * DT


@pytest.mark.parametrize("step", [2e-3, 5e-4])
def test_an_elastic_grain_on_a_pinned_one_keeps_its_height(step: float) -> None:
    # An impact takes place in the middle of what forces do in its step, so energy is kept to rounding, at any step.
    fall = 0.1
    low = points((0, 0, 0), name="low", mass=M, radius=R, pinned=True)
    high = points((0, 2 * R + fall, 0), name="high", mass=M, radius=R)
    scenario = table(
        10.0,
        step,
        particles=[low, high],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 1}],
        output={"every": 100, "ledger": True},
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    energy, steps = [], round(10 / step)
    for number in range(0, steps + 1, steps // 10):
        simulation.advance_to(number)
        row = simulation.ledger()
        energy.append(row["kinetic"] + row["potential.gravity"])
    simulation.close()
    assert np.ptp(energy) < 1e-12 * steps * M * G * fall


@pytest.mark.parametrize("layers", [1, 3, 8])
@pytest.mark.parametrize("restitution", [0.9, 0.5])
def test_a_light_ball_rebounds_from_what_lies(layers: int, restitution: float) -> None:
    # From a column of grains of 50 times its mass, by about e of the speed at which it comes, less what the first of them
    # takes with it. What turns do not settle is solved as at rest, which is not for what has just been hit.
    heavy = [(0.0, R + 2 * R * k, 0.0) for k in range(layers)]
    top = 2 * R * layers + R
    masses = [50 * M] * layers + [M]
    velocity = [(0.0, 0.0, 0.0)] * layers + [(0.0, -2.0, 0.0)]
    column = points(*heavy, (0, top + 0.5 * 2.0 * DT, 0), velocity=velocity, mass=masses, radius=R)
    scenario = table(
        0.02,
        DT,
        particles=[column],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": restitution}],
        planes=[{"restitution": 0}],
    )
    v = ps.run(ps.from_table(scenario)).final.velocity[-1, 1] + G * 0.02
    alone = 2.0 * (50 * restitution - 1) / 51  # the first of them is free for the time of a blow
    assert 0.85 * alone < v < restitution * 2.0 * 1.02


@pytest.mark.sampled(2)
@pytest.mark.parametrize("little", ["PAIRS", "SIDES"])
def test_contacts_without_room_make_their_interval_again(
    little: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # 27 grains are born in each other, with some hundred contacts, and fall into a corner of a box. What finds no room would
    # not push, and a run that is resumed has another room.
    scenario = heap(1, 0.4, output={"every": 50, "ledger": True})
    scenario["emitters"] = [
        {
            "name": "crowd",
            "shape": {"type": "ball", "center": [0.2, 0.6, 0.2], "radius": 0.1},
            "burst": {"count": 27, "at": 0.02},
            "speed": 0.0,
            "mass": M,
            "radius": R,
        }
    ]
    plain = Simulation(ps.from_table(scenario), threads=1)
    monkeypatch.setattr(f"particlesim.engine.interactions.hard.impulses.{little}", 0)
    monkeypatch.setattr("particlesim.engine.interactions.hard.impulses.SOME", 4)
    one, other = (Simulation(ps.from_table(scenario), threads=1) for _ in range(2))
    for step in (50, 100, 150, 200):
        one.advance_to(step)
        plain.advance_to(step)
    restore(other, snapshot(one))
    for step in (250, 300, 350, 400):
        for each in (one, other, plain):
            each.advance_to(step)
    for each in (other, plain):
        assert one.states[0].x.tobytes() == each.states[0].x.tobytes()
        assert one.states[1].x.tobytes() == each.states[1].x.tobytes()
        each.close()
    one.close()


def heap_of_radii(seed: int, restitution: float) -> tuple[float, float]:
    """Median of how fast 72 smooth grains in a box come elsewhere, over g dt, and of the depth over the radius, after 4 to
    5 s."""
    rng = np.random.default_rng(seed)
    r = rng.uniform(4.2e-3, 5.3e-3, 72)
    cells = np.stack(np.meshgrid(*map(np.arange, (3, 8, 3)), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (cells - [1, 0, 1]) * [0.0112, 0.0108, 0.0112] + [0, 0.006, 0]
    grains = points(
        *places.tolist(),
        velocity=rng.normal(0, 0.1, (72, 3)).tolist(),
        mass=(1e4 * r**3).tolist(),
        radius=r.tolist(),
    )
    box = {
        "type": "box",
        "inside": True,
        "center": [0, 1, 0],
        "size": [0.034, 2, 0.034],
        "restitution": restitution,
    }
    scenario = table(
        5.0,
        DT,
        particles=[grains],
        forces=[{"type": "gravity"}],
        colliders=[box],
        interactions=[{"type": "contact", "restitution": restitution}],
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    speeds, depths = [], []
    for step in range(4000, 5001, 100):
        simulation.advance_to(step)
        (state,) = simulation.states
        apart = np.linalg.norm(state.position[:, None] - state.position, axis=2) + np.eye(72)
        depths.append(((r[:, None] + r - apart) / np.minimum(r[:, None], r)).max())
        been = state.position.copy()
        simulation.advance_to(step + 20)
        speeds.append(np.median(np.linalg.norm(simulation.states[0].position - been, axis=1)) / (20 * DT))
    simulation.close()
    return float(np.median(speeds) / (G * DT)), float(np.median(depths))


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_smooth_grains_of_different_radii_come_to_rest(restitution: float) -> None:
    # Hardly more contacts than what they hold. What presses along a line that is hardly inclined is not a blow: it had begun
    # anew in every step, and heaps had kept velocities of up to 0.8 g dt, 7 g dt² deep. A heap that has not found its places
    # yet still moves, by up to 0.3 g dt; which ones changes with every bit.
    found = [heap_of_radii(seed, restitution) for seed in range(4, 8)]
    speeds, depths = (sorted(each) for each in zip(*found, strict=True))
    assert speeds[0] < 0.04
    assert speeds[-1] < 0.3
    assert depths[-2] < 2 * G * DT**2 / 4.2e-3
    assert depths[-1] < 0.02


def test_grains_in_the_tip_of_a_cone_stay_outside_of_it() -> None:
    # To leave one side there leads into the other: grains had ended 5e-5 of a radius inside.
    r, slope = 0.015, 0.6
    cells = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = cells * 0.035 + [-0.05, 0.25, -0.052] + np.random.default_rng(3).uniform(0, 0.003, (64, 3))
    cone = {"type": "cone", "inside": True, "start": [0, 0.5, 0], "end": [0, 0, 0], "radius": 0.5 * slope}
    scenario = table(
        0.8,
        DT,
        particles=[points(*places.tolist(), velocity=[(0.0, 0.0, 0.0)] * 64, mass=0.035, radius=r)],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 0.5}],
        colliders=[{"restitution": 0.5, **cone}],
        output={"every": 50, "precision": "double"},
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    for step in range(500, 801, 50):
        simulation.advance_to(step)
        x, y, z = simulation.states[0].position.T
        gap = (y * slope - np.hypot(x, z)) / np.hypot(slope, 1) - r
        assert gap.min() > -2e-9 * r
    simulation.close()


def test_grains_that_are_crushed_stay_where_they_are() -> None:
    # Two layers under a lid that comes down to where two do not fit. Impulses that only push against each other have no
    # bounds: places had been 1e15 m away.
    cells = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = [-0.051, 0.06, -0.051] + 0.102 * cells
    lid = {"type": "box", "name": "lid", "size": [0.21, 0.2, 0.21], "center": [0, 1.2, 0]}
    walls = {"type": "box", "name": "walls", "inside": True, "size": [0.22, 2, 0.22], "center": [0, 1, 0]}
    scenario = table(
        1.2,
        2e-3,
        "symplectic_euler",
        particles=[points(*places.tolist(), radius=0.05, mass=0.5, name="grains")],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "on": ["grains"], "restitution": 0.5, "friction": 0.3}],
        colliders=[walls, lid],
        motions=[{"collider": "lid", "path": ["x", "y - 0.97*min(t, 1)", "z"]}],
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    for step in range(440, 601):
        simulation.advance_to(step)
        (state,) = simulation.states
        assert np.abs(state.x[:, : state.count]).max() < 0.3
        # The lid works on what cannot move: for a step some are a hundred times as fast, by rounding.
        assert np.abs(state.v[:, : state.count]).max() < 1000
    simulation.close()


@pytest.mark.sampled(6)
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet", "stormer_verlet"])
@pytest.mark.parametrize("grains", [2, 5])
def test_a_column_rests_whatever_way_a_method_moves_by_a_kick(grains: int, method: str) -> None:
    # What symplectic Euler loses by falling through all of a kick is no gain of those who stop the fall.
    places = [(0.0, (2 * k + 1) * R, 0.0) for k in range(grains)]
    scenario = table(
        1.0,
        DT,
        method,
        particles=[points(*places, mass=M, radius=R)],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 0.3}],
        colliders=[{"type": "box", "size": [8, 2, 8], "center": [0, -1, 0], "restitution": 0.3}],
    )
    world = Simulation(ps.from_table(scenario))
    world.advance_to(1_000)
    (state,) = world.states
    # the first step may fall through the way of a kick
    assert np.abs(state.x[1, :grains] - np.array(places)[:, 1]).max() < 2 * grains * G * DT**2
    assert np.abs(state.v[:, :grains]).max() < 1e-9
    world.close()
