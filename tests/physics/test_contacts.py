"""Particles that touch each other by springs and dampers: restitution, time of contact, friction, and the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, rows, simulate, table

import particlesim as ps
from particlesim.engine.islands import overlaps, separation
from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.islands.separation import Pairs
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.world import World
from particlesim.laws.contact import touch
from particlesim.laws.pair import Pair
from particlesim.process.preparing import told_of_preparing
from particlesim.runs.first_state import doubtful, outside_of_box
from particlesim.scenario.box import PeriodicBox

R, M = 0.05, 0.1
LINEAR = {"type": "contact", "model": "linear", "stiffness": 1e4}
HERTZ = {"type": "contact", "model": "hertz", "young_modulus": "10 MPa", "poisson_ratio": 0.25}


def meeting(
    law: dict[str, Any], dt: float, *, speed: float = 1.0, beside: float = 0.0, **more: Any
) -> ps.Result:
    """Two spheres that meet at a relative speed, the second somewhat beside the path of the first."""
    duration = more.pop("duration", 0.05)
    gap = 0.013 * R
    first = -math.sqrt(4 * R * R - beside * beside) - gap
    group = points((first, 0, 0), (0, beside, 0), velocity=[(speed, 0, 0), (0, 0, 0)], mass=M, radius=R)
    return simulate(duration, dt, particles=[group], interactions=[law], **more)


def rebound(result: ps.Result) -> float:
    return rebound_of(result.final)


def rebound_of(final: ps.Frame) -> float:
    return float(np.diff(final.velocity[:, 0])[0])


@pytest.mark.parametrize("e", [0.9, 0.5, 0.1])
@pytest.mark.parametrize("law", [LINEAR, HERTZ], ids=["linear", "hertz"])
def test_restitution_is_what_was_asked_for_and_the_better_the_shorter_the_step(
    law: dict[str, Any], e: float
) -> None:
    # the contact ends between two steps: an error of first order
    found = [rebound(meeting({**law, "restitution": e}, 1e-3 / n)) for n in (20, 80, 320)]
    miss = np.abs(np.array(found) - e)
    assert miss[2] < 2e-3
    assert miss[2] < miss[0] / 4


@pytest.mark.parametrize("speed", [0.1, 3.0])
def test_restitution_of_hertz_does_not_depend_on_speed(speed: float) -> None:
    found = rebound(meeting({**HERTZ, "restitution": 0.6}, 1e-5, speed=speed, duration=0.03 / speed + 0.02))
    assert found / speed == pytest.approx(0.6, abs=2e-3)


def test_the_time_of_a_contact() -> None:
    # their centre goes on at half of the speed: at the end of the contact the second has gone half as far as it would have
    m = M / 2
    omega = math.sqrt(LINEAR["stiffness"] / m)
    e_star, r_star = 10e6 / (2 * (1 - 0.25**2)), R / 2
    hertz = 2.868 * (m * m / (r_star * e_star**2 * 1.0)) ** 0.2
    for law, lasts in ((LINEAR, math.pi / omega), (HERTZ, hertz)):
        result = meeting(law, 1e-6, duration=0.02)
        free = 0.02 - 0.013 * R  # after the gap at 1 m/s
        assert free - (result.final.position[1, 0]) == pytest.approx(lasts / 2, rel=2e-3)


@pytest.mark.parametrize("law", [LINEAR, HERTZ], ids=["linear", "hertz"])
def test_oblique_elastic_impacts_keep_momentum_energy_and_angular_momentum(law: dict[str, Any]) -> None:
    result = meeting(law, 1e-5, beside=0.6 * R, output={"ledger": True})
    v, x = result.final.velocity, result.final.position
    assert np.abs(v.sum(axis=0) - (1, 0, 0)).max() < 8 * EPS
    before = np.cross((-math.sqrt(4 * R * R - 0.36 * R * R) - 0.013 * R, 0, 0), (1, 0, 0))
    assert np.abs(np.cross(x, v).sum(axis=0) - before).max() < 1000 * EPS
    assert (v**2).sum() == pytest.approx(1, abs=1e-5)
    assert v[0] @ v[1] == pytest.approx(
        0, abs=1e-2 * 1
    )  # equal masses part at a right angle, as contacts take time


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [pytest.param(LINEAR, marks=pytest.mark.slow), HERTZ], ids=["linear", "hertz"]
)
def test_the_books_of_a_contact_balance_in_its_middle_too(law: dict[str, Any]) -> None:
    """At the turn all energy relative to the centre, m v²/4, is in the contact; what dampers and friction take is booked."""
    kept = meeting(law, 2e-5, duration=0.02, output={"every": 5, "ledger": True}).ledger
    stored, start = kept["potential.contact"], kept["kinetic"][0]
    assert start == pytest.approx(M / 2)
    assert stored.max() == pytest.approx(start / 2, rel=1e-3)
    assert kept["kinetic"] + stored == pytest.approx(np.full(len(stored), start), rel=1e-3)
    # cohesion is in the potential alone
    lossy = {**law, "restitution": 0.5, "friction": 0.4, "cohesion": 2.0}  # apart after 0.01 s
    output = {"every": 5, "ledger": True, "work": True}
    books = meeting(lossy, 1e-5, duration=0.012, beside=0.8 * R, output=output).ledger
    lost = -books["work.contact"][-1]
    assert lost > 0.1 * start
    assert (
        np.abs(books["balance"]).max() < 3e-3 * lost
    )  # the contact begins and ends within steps: an error of first order


W = 50.0
JKR = {**HERTZ, "cohesion": W, "adhesion": "jkr"}


def test_the_law_of_johnson_kendall_and_roberts() -> None:
    """The closed form against the two formulas with the radius of the surface that touches; pull-off; load zero; energy."""
    law = ps.from_table(
        table(0.1, 1e-3, particles=[points((0, 0, 0), radius=R)], interactions=[JKR])
    ).interactions[0]
    f, e_star, r = law.record(), 10e6 / (2 * (1 - 0.25**2)), R / 2
    least = (math.pi * W * r * r / (8 * e_star)) ** (1 / 3)
    a = least * np.concatenate([np.linspace(1.001, 4, 400), [5.0, 20.0, 300.0]])
    overlap = a * a / r - np.sqrt(2 * math.pi * W * a / e_star)
    force = 4 * e_star * a**3 / (3 * r) - np.sqrt(8 * math.pi * W * e_star * a**3)
    at = [touch(f, Pair(0, 0, 0, 0, 0, 0, 0, 0, R, R, a1=1 / M, a2=1 / M), d) for d in overlap]
    found = np.array([each.push - each.pull for each in at])
    pull_off = 1.5 * math.pi * W * r
    assert np.abs(found - force).max() < 1e-10 * force.max()
    assert np.abs(found - force)[:400].max() < 1e-9 * pull_off
    assert found.min() == pytest.approx(-pull_off, rel=1e-5)
    # k_t = 8 G a tells the radius
    shear = 10e6 / (4 * (2 - 0.25) * (1 + 0.25))
    radius = np.array([each.stiffness for each in at]) / (8 * shear)
    assert np.abs(radius / a - 1).max() < 1e-6
    unloaded = np.interp(0.0, found[200:400], radius[200:400])
    assert unloaded == pytest.approx((9 * math.pi * W * r * r / (2 * e_star)) ** (1 / 3), rel=1e-4)
    energy, slope = np.array([(each.energy, each.slope) for each in at])[:400].T
    middle = slice(1, -1)
    assert np.gradient(energy, overlap[:400])[middle][20:] == pytest.approx(
        found[:400][middle][20:], abs=2e-3 * pull_off
    )
    assert np.gradient(found[:400], overlap[:400])[50:-1] == pytest.approx(slope[50:-1], rel=1e-2)
    assert law.beyond(2 * r) > law.beyond(r) == pytest.approx(3 * least**2 / r)


def test_what_snaps_apart_has_lost_energy_or_sticks() -> None:
    """From δ = 0 to the snap: π w a_c²/6 (12/5 + 18/5 4^(4/3)); whoever has less stays."""
    e_star, r = 10e6 / (2 * (1 - 0.25**2)), R / 2
    least = (math.pi * W * r * r / (8 * e_star)) ** (1 / 3)
    lost = math.pi * W * least**2 / 6 * (2.4 + 3.6 * 4 ** (4 / 3))
    output = {"every": 40, "ledger": True, "work": True}
    result = meeting(JKR, 1e-5, speed=0.3, duration=0.016, output=output)
    assert rebound(result) == pytest.approx(math.sqrt(0.3**2 - 2 * lost / (M / 2)), rel=0.01)
    # both jumps of the potential are booked; they fall between steps: an error of first order
    assert result.ledger["work.contact"][-1] == pytest.approx(-lost, rel=1e-12)
    assert np.abs(result.ledger["balance"]).max() < 3e-3 * lost
    slow = meeting({**JKR, "restitution": 0.5}, 2e-5, speed=0.15, duration=0.2).final
    assert np.diff(slow.position[:, 0])[0] < 2 * R
    assert abs(rebound_of(slow)) < 0.02
    assert slow.velocity[:, 0].sum() == pytest.approx(0.15, rel=1e-12)


def test_a_grain_hangs_from_a_ceiling_up_to_the_pull_off() -> None:
    """3/2 π w R with R = r; it gets stretched below the ceiling by that."""
    pull = 1.5 * math.pi * W * R
    for part in (0.9, 1.1):
        result = simulate(
            0.2,
            5e-5,
            particles=[points((0, -R, 0), velocity=[(0, 0.01, 0)], mass=M, radius=R)],
            interactions=[{**JKR, "restitution": 0.1}],
            planes=[{"normal": [0, -1, 0], "restitution": 0.1}],
            forces=[{"type": "gravity", "acceleration": [0, -part * pull / M, 0]}],
        )
        assert (result.final.position[0, 1] > -1.01 * R) == (part < 1)


def test_friction_takes_what_coulomb_allows() -> None:
    # a quick glancing impact slides all the time: Δv_t = μ Δv_n
    mu, beside = 0.1, 1.4 * R
    result = meeting({**LINEAR, "friction": mu, "stiffness": 1e7}, 1e-7, beside=beside, duration=0.002)
    change = result.final.velocity[1]
    n = np.array([math.sqrt(1 - (beside / (2 * R)) ** 2), beside / (2 * R), 0])
    along = change @ n
    across = np.linalg.norm(change - along * n)
    assert across / along == pytest.approx(mu, rel=0.02)
    assert np.abs(result.final.velocity.sum(axis=0) - (1, 0, 0)).max() < 1e-14


def pressed(mu: Any, pull: float, duration: float = 0.3) -> np.ndarray:
    """How far and how fast a grain has gone, and its surface where it touches, along another one that is held, pressed on it
    with 1 N and pulled along it."""
    law = {**LINEAR, "friction": mu, "restitution": 0.2, "stiffness": 1e5}
    # a large one, so that the normal hardly turns
    groups = [
        points((0, -100.0, 0), name="floor", mass=M, radius=100.0, pinned=True),
        points((0, R - 1e-5, 0), name="grain", mass=M, radius=R),
    ]
    forces = [{"type": "gravity", "acceleration": [pull / M, -1 / M, 0], "on": ["grain"]}]
    final = simulate(duration, 1e-4, particles=groups, interactions=[law], forces=forces).final
    v = final.velocity[1, 0]
    return np.array([v, v + R * final["angular_velocity"][1, 2]])


def test_a_grain_that_is_pulled_rolls_below_the_static_limit_and_slides_above_it() -> None:
    # rolling takes 2/7 of the pull as friction
    v, slip = pressed(0.5, 1.0)
    assert v == pytest.approx(5 / 7 * 1.0 / M * 0.3, rel=0.01)
    assert abs(slip) < 1e-3 * v
    v, slip = pressed(0.5, 2.1)
    assert v == pytest.approx((2.1 - 0.5) / M * 0.3, rel=0.02)
    assert slip > 0.1 * v
    # a load that comes at once stretches the spring up to twice as far as it will stay
    v, slip = pressed({"static": 0.8, "kinetic": 0.3}, 1.3)
    assert v == pytest.approx(5 / 7 * 1.3 / M * 0.3, rel=0.01)
    assert abs(slip) < 1e-3 * v
    v, slip = pressed({"static": 0.65, "kinetic": 0.3}, 2.4)
    assert v == pytest.approx((2.4 - 0.3) / M * 0.3, rel=0.02)


def heap(model: str = "linear", n: int = 60, **more: Any) -> dict[str, Any]:
    """Grains of sizes 1 to 3 that fall into a box."""
    rng = np.random.default_rng(4)
    laws = {
        "linear": {"stiffness": 2000.0, "overlap": "keep"},
        "hertz": {"young_modulus": 1e5, "overlap": "keep"},
        "impulse": {},
    }
    place = rng.uniform(-0.15, 0.15, (n, 3)) + np.array([0, 0.4, 0])
    return table(
        0.4,
        2e-4,
        particles=[
            {
                **points(*map(tuple, place.tolist())),
                "name": "grains",
                "density": 1000,
                "radius": {"type": "uniform", "low": 0.008, "high": 0.02},
            }
        ],
        forces=[{"type": "gravity", "acceleration": [0, -9.81, 0]}],
        planes=[
            {"point": point, "normal": normal, "restitution": 0.3, "friction": 0.5}
            for point, normal in (
                ([0, 0, 0], [0, 1, 0]),
                ([-0.17, 0, 0], [1, 0, 0]),
                ([0.17, 0, 0], [-1, 0, 0]),
                ([0, 0, -0.17], [0, 0, 1]),
                ([0, 0, 0.17], [0, 0, -1]),
            )
        ],
        interactions=[
            {
                "type": "contact",
                "model": model,
                "restitution": 0.5,
                "friction": {"static": 0.5, "kinetic": 0.4},
                **laws[model],
            }
        ],
        output={"every": 250},
        **more,
    )


def bits(simulation: Simulation) -> bytes:
    return b"".join(state.x.tobytes() + state.v.tobytes() for state in simulation.states)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("model", ["linear", "hertz"])
def test_the_same_bits_with_any_threads_and_after_a_resume(model: str, monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_SPRINGS", 0)
    monkeypatch.setattr("particlesim.engine.islands.stepping.WORTH_THREADS", 0)
    scenario = ps.from_table(heap(model, n=500))
    one, two = Simulation(scenario, threads=1), Simulation(scenario, threads=2)
    other = None
    for step in (250, 500):
        one.advance_to(step)
        two.advance_to(step)
        assert bits(one) == bits(two)
        if step == 250:
            other = Simulation(scenario, threads=2)
            restore(other, snapshot(one))
    assert other is not None
    other.advance_to(500)
    assert bits(other) == bits(one)
    (lists,) = [each.lists for island in one.islands for each in island.interactions]
    assert (lists.memory.state != 0).sum() > 20


def test_a_third_law_to_the_last_bit() -> None:
    table = heap("hertz", n=300)
    del table["planes"], table["forces"]
    table["particles"][0]["layout"]["velocity"] = [[0.1, 0, 0]]
    simulation = Simulation(ps.from_table(table))
    simulation.advance_to(3)
    (island,) = simulation.islands
    total = island.forces(simulation.time)
    assert np.abs(total).max() > 0.01
    assert np.abs(total.sum(axis=1)).max() < 1e-13 * np.abs(total).max()


def test_coincident_centres_come_apart() -> None:
    for law in (LINEAR, HERTZ, {**HERTZ, "friction": 0.3, "restitution": 0.1}):
        final = simulate(
            0.05,
            1e-5,
            particles=[points((0, 0, 0), (0, 0, 0), mass=M, radius=R)],
            interactions=[law],
        ).final
        assert np.isfinite(final.position).all()
        assert np.abs(np.diff(final.position[:, 0])[0]) > R
        assert np.abs(final.velocity.sum(axis=0)).max() < 1e-12


def refused(**changes: Any) -> str:
    law = {**LINEAR, **changes}
    law = {key: value for key, value in law.items() if value is not None}
    scenario = table(
        0.1,
        1e-3,
        method=changes.pop("method", "velocity_verlet"),
        particles=[points((0, 0, 0), radius=law.pop("radius", 0.1))],
        interactions=[law],
    )
    with pytest.raises(ps.ScenarioError) as error:
        ps.from_table(scenario)
    return str(error.value)


def test_bad_input_is_refused_with_what_is_allowed() -> None:
    assert "restitution" in refused(restitution=1.2)
    assert "friction" in refused(friction=-0.1)
    assert "needs a radius greater than 0" in refused(radius=0.0)
    assert "needs a stiffness" in refused(stiffness=None)
    assert 'young_modulus belongs to model = "hertz"' in refused(young_modulus=1e6)
    assert "needs a young_modulus" in refused(model="hertz", stiffness=None)
    assert "there is no work of adhesion" in refused(
        model="hertz", stiffness=None, young_modulus=1e6, adhesion="jkr"
    )
    assert 'adhesion belongs to model = "hertz"' in refused(adhesion="jkr", cohesion=1.0)
    assert "overlap needs contacts that last" in refused(model="impulse", stiffness=None, overlap="keep")
    assert "ends where two particles no longer touch" in refused(cutoff=1.0)


def warned(dt: float = 1e-4, at: float = 0.5, **law: Any) -> str:
    group = points((0, 0, 0), (at, 0, 0), mass=0.1, radius=0.1)
    return " ".join(simulate(10 * dt, dt, particles=[group], interactions=[{**LINEAR, **law}]).warnings)


def test_what_is_doubtful_is_told_before_the_run() -> None:
    assert warned() == ""
    assert "a contact of the lightest particles lasts 0.00702 s" in warned(dt=2e-3)
    # along the surface: sqrt(7/2 k_t / k) = 10 times as stiff
    assert "lasts 0.000702 s" in warned(friction=0.1, tangential_stiffness=LINEAR["stiffness"] * 200 / 7)
    assert "kinetic friction 0.5 is above static friction 0.3" in warned(
        friction={"static": 0.3, "kinetic": 0.5}
    )
    assert "1 pair of particles overlap at the start" in warned(at=0.196)
    assert "by 0.004 m" in warned(at=0.196)
    assert "1 pair of particles overlapped at the start" in warned(at=0.19)
    assert "1 pair of particles overlap at the start" in warned(at=0.19, overlap="keep")


def test_births_in_each_other_are_told_before_the_run() -> None:
    # grains of 1 cm fall from a point: the one before has fallen by g/(2 f²) when the next is born, and is out of its way
    # from √(g / (2 · 2 cm)) = 15.7 births a second on down; it is a fifth of a radius deep at 16.5
    def told(rate: float, model: str = "linear") -> str:
        scenario = table(
            1.0,
            1e-3,
            forces=[{"type": "gravity"}],
            emitters=[
                {
                    "rate": rate,
                    "radius": 0.01,
                    "shape": {"type": "point", "position": [0, 1, 0]},
                    "name": "grains",
                }
            ],
            interactions=[
                {**LINEAR, "stiffness": 1.0} if model == "linear" else {"type": "contact", "model": model}
            ],
        )
        return " ".join(doubtful(Simulation(ps.from_table(scenario))))

    assert "born in others" not in told(16)
    assert "16 of the first 17 particles of 'grains' are born in others, up to 0.3" in told(17)
    assert "born in others" not in told(17, "impulse")


def test_a_start_that_overlaps_is_put_apart_before_the_first_step() -> None:
    """At random, a third of the room is full: deep overlaps, which would fly apart, become shallow ones inside of the walls;
    what is held stays."""
    start = heap("hertz", n=500)
    (group,) = start["particles"]
    group["layout"]["position"] = (
        np.array(group["layout"]["position"]) * (1, 0.8, 1) - (0, 0.16, 0)
    ).tolist()
    group["pinned"] = [0, 1, 2]
    for box in (
        None,
        {"size": [0.34, 1.0, 0.34], "origin": [-0.17, 0, -0.17], "periodic": [True, False, True]},
    ):
        if box is not None:
            start["simulation"]["box"], start["planes"] = box, start["planes"][:1]
        world, kept = (
            World(ps.from_table({**start, "interactions": [{**start["interactions"][0], "overlap": each}]}))
            for each in ("auto", "keep")
        )
        (found,) = world.separations
        (state,), (before,) = world.states, kept.states
        assert found.number > 200
        assert found.depth > 0.5 * state.radius.min()
        assert not found.cramped
        assert not kept.separations
        r, x = state.radius[: state.count], state.position
        i, j, depth = overlapping(x, r, world.scenario.simulation.box)
        free = (i > 2) | (j > 2)
        assert (depth <= 0.02 * np.minimum(r[i], r[j]))[free].all()
        assert np.array_equal(x[:3], before.position[:3])
        assert found.way == pytest.approx(np.linalg.norm(x - before.position, axis=1).max())
        if box is None:
            assert (np.abs(x[3:, 0]) + r[3:]).max() < 0.17 * (1 + EPS)
        assert (x[3:, 1] - r[3:]).min() > -EPS
    # inversely to their masses, so that their centre stays
    pair = Pairs(np.ones(2), np.array([1.0, 1 / 3]), None, None)
    places = rows((0, 0, 0), (1.94, 0, 0))
    pair.find(places, 0.0)
    assert pair.move(places)
    step = places - rows((0, 0, 0), (1.94, 0, 0))
    assert step[0] + 3 * step[1] == pytest.approx(0, abs=4 * EPS)  # of places, about 2
    assert step[0, 0] < -0.04


def test_a_memory_without_room_grows_at_the_next_interval(monkeypatch: Any) -> None:
    monkeypatch.setattr("particlesim.engine.interactions.contacts.ROOM", 0)
    monkeypatch.setattr("particlesim.engine.interactions.contacts.SPARE", 0)
    simulation = Simulation(ps.from_table(heap(n=300)))
    for step in (1, 2, 250):
        simulation.advance_to(step)
    (island,) = simulation.islands
    assert island.interactions[0].lists.first.size > 100
    assert not island.interactions[0].draft.slow.any()


def test_pairs_without_room_still_push_each_other() -> None:
    def fallen(*, roomy: bool) -> Simulation:
        simulation = Simulation(ps.from_table(heap(n=300)))
        simulation.advance_to(250)
        (island,) = simulation.islands
        (each,) = island.interactions
        each.near.report[0] = 1
        room = each.lists.first.size if roomy else 0
        cut = each.lists._replace(first=each.lists.first[:room], second=each.lists.second[:room])
        island.layout.interactions = (each._replace(lists=cut),)
        island.layout._shares.clear()
        return simulation

    energies = []
    for roomy in (True, False):
        (island,) = fallen(roomy=roomy).islands
        (each,) = island.interactions
        energies.append(each.energy(island.island_columns(), 0.0))
        assert each.draft.slow.any() != roomy
    assert energies[1] == pytest.approx(energies[0], rel=1e-12)


def test_contacts_beside_springs_keep_what_both_keep() -> None:
    """A ball hits one end of a spring, off its axis: momentum and angular momentum with spin, and the energy of both."""
    groups = [
        points((0, 0, 0), (0, 0.2, 0), name="ends", mass=M, radius=R),
        points((-0.12, 0.03, 0), velocity=[(1, 0, 0)], name="ball", mass=M, radius=R),
    ]
    springs = [{"on": "ends", "pairs": [[0, 1]], "stiffness": 200.0}]
    for law in (HERTZ, {**HERTZ, "friction": 0.4}):
        result = simulate(
            0.1,
            2e-5,
            particles=groups,
            springs=springs,
            interactions=[law],
            output={"every": 250, "ledger": True},
        )
        kept, final = result.ledger, result.final
        assert kept["potential.springs"].max() > 0.01 * kept["kinetic"][0]
        total = kept["kinetic"] + kept["potential.springs"] + kept["potential.contact"]
        lost = total[0] - total
        assert np.abs(final.velocity.sum(axis=0) - (1, 0, 0)).max() < 1e-13
        if law is HERTZ:
            assert np.abs(lost).max() < 1e-4 * total[0]
        else:
            assert 1e-3 * total[0] < lost[-1] < 0.5 * total[0]
            spin = 0.4 * M * R * R * final["angular_velocity"].sum(axis=0)
            turn = M * np.cross(final.position, final.velocity).sum(axis=0) + spin
            assert np.abs(turn - (0, 0, -M * 0.03)).max() < 1e-12


@pytest.mark.parametrize("least", [0.05, 0.008, 0.0005])
@pytest.mark.parametrize("sides", [None, (True, True, True), (True, False, True)])
def test_overlaps_of_all_sizes_are_those_of_all_pairs(
    least: float, sides: tuple[bool, bool, bool] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the grids of each class of sizes find, against all pairs one by one; sizes differ up to a hundred times, one has
    none, and some are far away."""
    rng = np.random.default_rng(11)
    x, r = rng.uniform(-0.7, 1.3, (900, 3)), rng.uniform(least, 0.09, 900)
    x[5], x[6], x[7], r[8] = 1e12, (1e18, 0, 0), np.nan, 0.0
    box = None if sides is None else PeriodicBox(size=(1.0, 1.1, 0.9), origin=(-0.3, 0, 0), periodic=sides)
    i, j, depth = overlapping(x, r, box)
    monkeypatch.setattr(overlaps, "FEW", 1000)
    p, q, deep = overlapping(x, r, box)
    found = dict(
        zip(zip(np.minimum(i, j).tolist(), np.maximum(i, j).tolist(), strict=True), depth, strict=True)
    )
    known = dict(zip(zip(p.tolist(), q.tolist(), strict=True), deep, strict=True))
    assert len(found) == len(i) > 100
    assert found == pytest.approx(known)


def test_overlaps_are_found_below_the_origin_of_a_box_along_its_open_axes() -> None:
    box = PeriodicBox(size=(1.0, 1.0, 1.0), origin=(0, 0, 0), periodic=(True, True, False))
    x = np.array([[0.95, 0.5, -0.4], [0.05, 0.5, -0.4]])
    i, j, depth = overlapping(x, np.full(2, 0.1), box)
    assert sorted((*i.tolist(), *j.tolist())) == [0, 1]
    assert depth == pytest.approx([0.1])


def overlapping_start(radii: Any, room: float, seed: int = 3) -> tuple[Any, Any]:
    """What grains at random in a cube are put apart by, and how each went, in free space."""
    places = np.random.default_rng(seed).uniform(0, room, (len(radii), 3))
    start = heap("hertz")
    start.pop("planes")
    start["simulation"]["precision"] = "double"
    group = {**points(*map(tuple, places.tolist())), "name": "grains", "density": 1000, "radius": radii}
    start["particles"], start["interactions"][0]["overlap"] = [group], "relax"
    world = World(ps.from_table(start))
    (found,), (state,) = world.separations, world.states
    return found, state.position - places


@pytest.mark.parametrize("ratio", [1.0, 10.0, 100.0])
def test_grains_put_apart_keep_their_centre_of_mass(ratio: float) -> None:
    """Σ m Δx = 0 to the rounding of sums, whatever the sizes, and no overlap is left: what makes a pair go less holds for
    both of it."""
    n = 1500
    radii = (
        0.004 * np.exp(np.random.default_rng(2).uniform(0, math.log(ratio), n))
        if ratio > 1
        else np.full(n, 0.004)
    )
    mass = 1000 * 4 / 3 * math.pi * radii**3
    found, way = overlapping_start(radii.tolist(), float(4 / 3 * math.pi * (radii**3).sum() / 0.3) ** (1 / 3))
    assert found.number > 200
    assert not found.cramped
    moved = mass[:, None] * way
    assert np.abs(moved.sum(axis=0)).max() < 1e-13 * np.abs(moved).sum()


def test_a_pair_of_grains_is_put_apart_in_inverse_proportion_to_the_masses() -> None:
    """m₁ Δx₁ = −m₂ Δx₂ to rounding, where the second is a thousand times as heavy."""
    found, way = overlapping_start([0.01, 0.1], 0.06)
    assert found.number == 1
    assert way[0] == pytest.approx(-1000 * way[1], rel=1e-11)


def test_grains_put_apart_stay_in_the_box_in_which_they_were_placed() -> None:
    """Through a side of a periodic box they come back on the other, so that nobody is told to start outside."""
    x = np.random.default_rng(5).uniform(0, 1, (600, 3))
    start = {
        "simulation": {"duration": 1e-3, "dt": 1e-3, "box": {"size": [1, 1, 1]}},
        "particles": [{**points(*x.tolist()), "radius": 0.05, "mass": 1.0}],
        "interactions": [{"type": "contact", "model": "linear", "stiffness": 1e4}],
    }
    world = World(ps.from_table(start))
    placed = world.states[0].position
    assert np.abs(placed - x).max() > 0.5
    assert ((placed >= 0) & (placed <= 1)).all()
    assert not outside_of_box(world)


def test_grains_of_sizes_that_differ_are_put_apart_without_looking_for_pairs_again_and_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The smallest of sizes that differ six times does not say how far all look ahead: by its radius, pairs were looked for
    in one turn of three, which was most of the time."""
    looked, said = [], []

    def counted(*given: Any) -> Any:
        looked.append(given)
        return overlapping(*given)

    monkeypatch.setattr(separation, "overlapping", counted)
    start = heap("hertz", n=400)
    start["particles"][0]["radius"] = {"type": "uniform", "low": 0.004, "high": 0.024}
    start["interactions"][0]["overlap"] = "auto"
    with told_of_preparing(said.append):
        (found,) = World(ps.from_table(start)).separations
    assert found.number > 100
    assert len(looked) < 20
    assert said == ["moving apart particles that overlap at the start", None]
