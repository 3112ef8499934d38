"""The books of work: every cause against a closed form, and a balance that closes to the error of the method."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import EPS, G, points, simulate, table

import particlesim as ps
from particlesim.engine.ledger.work import halfway, halfway_between
from particlesim.engine.simulation import Simulation
from particlesim.engine.state.columns import Columns

BOOKED = {"ledger": True, "work": True}


def booked(duration: float, dt: float, method: str, **parts: Any) -> ps.Result:
    every = max(round(duration / dt) // 25, 1)
    return simulate(duration, dt, method, output={**BOOKED, "every": every}, **parts)


def observed(run: Any, dt: float) -> float:
    """The order with which what is left of the balance falls when steps are halved."""
    coarse, fine = (np.abs(run(step).ledger["balance"]).max() for step in (dt, dt / 2))
    return math.log2(coarse / fine)


@pytest.mark.parametrize(("method", "order"), [("symplectic_euler", 1), ("rk4", 4)])
def test_drag_takes_what_it_takes(method: str, order: int) -> None:
    # Thrown upwards at 20 m/s: v' = −g − (k/m) v, W = −k ∫ v² dt with v = (v₀ + u) e^(−t/τ) − u, u = gτ, τ = m/k.
    m, k, v0, t = 0.5, 0.4, 20.0, 2.0
    tau = m / k
    u = G * tau
    a, b = (
        (v0 + u) ** 2 * tau / 2 * (1 - math.exp(-2 * t / tau)),
        2 * (v0 + u) * u * tau * (1 - math.exp(-t / tau)),
    )
    exact = -k * (a - b + u * u * t)

    def run(dt: float) -> ps.Result:
        return booked(
            t,
            dt,
            method,
            particles=[points((0, 0, 0), velocity=[(0, v0, 0)], mass=m)],
            forces=[{"type": "gravity"}, {"type": "linear_drag", "name": "air", "coefficient": k}],
        )

    assert observed(run, 0.1) == pytest.approx(order, abs=0.35)
    fine = run(0.01)
    assert fine.ledger["work.air"][-1] == pytest.approx(exact, rel=1e-2 if order == 1 else 1e-7)
    assert fine.ledger["work.air"][0] == fine.ledger["balance"][0] == 0.0


def test_a_bounce_takes_one_minus_the_square_of_the_restitution() -> None:
    # Dropped from 2 m, the first impact is at 0.64 s, the second 0.64 s after that. Velocity Verlet keeps energy in fall.
    result = booked(
        1.0,
        0.01,
        "velocity_verlet",
        particles=[points((0, 2, 0), mass=3.0)],
        forces=[{"type": "gravity"}],
        planes=[{"restitution": 0.5}],
    )
    assert result.ledger["work.contact"][-1] == pytest.approx(-3 * G * 2 * (1 - 0.25), rel=1e-12)
    assert abs(result.ledger["balance"][-1]) < 200 * EPS * 3 * G * 2


def test_contact_and_drag_together_leave_no_more_than_the_method_errs() -> None:
    result = booked(
        3.0,
        0.01,
        "rk4",
        particles=[points((0, 2, 0), velocity=[(1, 0, 0)], mass=0.1, radius=0.05)],
        forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": 0.05}],
        planes=[{"restitution": 0.8, "tangential_loss": 0.3}],
    )
    ledger = result.ledger
    lost = result.energy[0] - result.energy[-1]
    assert ledger["work.contact"][-1] + ledger["work.linear_drag"][-1] == pytest.approx(
        -lost, abs=1e-6 * lost
    )


def sprung(dt: float, method: str, t: float = 1.0, **more: Any) -> ps.Result:
    """Two masses, a stretched spring and a damper."""
    return booked(
        t,
        dt,
        method,
        particles=[points((0, 0, 0), (1.2, 0, 0), name="pair", mass=0.5)],
        springs=[
            {"on": "pair", "pairs": [[0, 1]], "stiffness": 50.0, "rest_length": 1.0, "damping": 0.3} | more
        ],
    )


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("method", "order"), [("symplectic_euler", 1), ("rk4", 4)])
def test_dampers(method: str, order: int) -> None:
    # ω = 14/s: the order shows from hω = 0.07 on; symplectic Euler's energy swings meanwhile, hence the largest of all.
    assert observed(lambda dt: sprung(dt, method), 0.005) == pytest.approx(order, abs=0.35)
    result = sprung(0.001, "rk4")
    lost = result.energy[0] - result.energy[-1]
    assert lost > 0.5
    assert result.ledger["work.springs"][-1] == pytest.approx(-lost, rel=1e-8)


def test_springs_that_break_take_their_energy_with_them() -> None:
    # Pulled apart at 1 m/s: at the end of the first step with a stretch beyond 0.3 m it breaks, with ½ k s² in it.
    result = booked(
        1.0,
        0.01,
        "velocity_verlet",
        particles=[points((0, 0, 0), (1, 0, 0), velocity=[(-2, 0, 0), (2, 0, 0)], name="pair")],
        springs=[{"on": "pair", "pairs": [[0, 1]], "stiffness": 5.0, "break_strain": 0.3}],
    )
    taken = -result.ledger["work.springs.breaking"][-1]
    assert 0.5 * 5 * 0.3**2 < taken < 0.5 * 5 * 0.35**2
    assert result.ledger["potential.springs"][-1] == 0
    assert abs(result.ledger["balance"][-1]) < 1e-4


def test_a_pin_that_is_led_works() -> None:
    # The hook swings as 0.1 sin 5t through air and pulls a mass by a spring.
    def run(dt: float) -> ps.Result:
        return booked(
            1.5,
            dt,
            "rk4",
            particles=[points((0, 0, 0), (1, 0, 0), name="pair", mass=0.5, pinned=[0])],
            springs=[{"on": "pair", "pairs": [[0, 1]], "stiffness": 20.0, "damping": 0.2}],
            motions=[{"on": "pair", "particles": [0], "path": ["0.1*sin(5*t)", "0", "0"]}],
            forces=[{"type": "linear_drag", "coefficient": 0.3}],
        )

    assert observed(run, 0.05) > 3.6  # as long as the fifth order of RK4's own energy error prevails, more
    assert abs(run(0.005).ledger["work.motion"][-1]) > 0.01


def test_what_leads_a_particle_holds_against_drag() -> None:
    # At 2 m/s through air with k = 0.3 kg/s the drag takes k v² t, which the motion gives.
    result = booked(
        1.0,
        0.1,
        "symplectic_euler",
        particles=[points((0, 0, 0), (0, 1, 0), mass=0.5, pinned=[0])],
        motions=[{"on": "particles", "path": ["2*t", "0", "0"]}],
        forces=[{"type": "linear_drag", "coefficient": 0.3}],
    )
    assert result.ledger["work.linear_drag"][-1] == pytest.approx(-0.3 * 4, rel=1e-12)
    assert result.ledger["work.motion"][-1] == pytest.approx(0.3 * 4, rel=1e-12)
    assert abs(result.ledger["balance"][-1]) < 100 * EPS


def test_what_shakes_a_particle_holds_against_drag() -> None:
    # v = A ω cos ωt takes k A² ω² (t/2 + sin 2ωt / 4ω) from t = 0. Simpson's rule misses h⁴/2880 of the fourth derivative of
    # the power, (2ω)⁴/2: 4e-8 of it at hω = 0.05.
    a, w, k, t = 0.1, 5.0, 0.3, 0.7
    result = booked(
        t,
        0.01,
        "symplectic_euler",
        particles=[points((0, 0, 0), mass=0.5, pinned=[0])],
        motions=[{"on": "particles", "path": [f"{a}*sin({w}*t)", "0", "0"]}],
        forces=[{"type": "linear_drag", "coefficient": k}],
    )
    taken = k * (a * w) ** 2 * (t / 2 + math.sin(2 * w * t) / (4 * w))
    kinetic = 0.25 * (a * w) ** 2 * (math.cos(w * t) ** 2 - 1)
    assert result.ledger["work.linear_drag"][-1] == pytest.approx(-taken, rel=1e-7)
    assert result.ledger["work.motion"][-1] == pytest.approx(taken + kinetic, rel=1e-7)


def test_the_middle_of_a_step_is_that_of_a_cubic() -> None:
    # x = t³ from every beginning, with and without accelerations: both curves go through it, and through v = t³, too.
    start, h = np.linspace(-1, 2, 7), np.linspace(0.1, 0.7, 7)
    nil = np.zeros_like(start)

    def at(t: Any, x: Any, v: Any) -> Columns:
        return Columns(x(t), nil, nil, v(t), nil, nil, nil + 1, None, None, None, ())

    def cube(t: Any) -> Any:
        return t**3

    def slope(t: Any) -> Any:
        return 3 * t**2

    both = at(start, cube, slope), at(start + h, cube, slope)
    found = halfway_between(*both, h)
    assert found.x == pytest.approx(cube(start + h / 2), abs=1e-14)
    assert found.vx == pytest.approx(slope(start + h / 2), abs=1e-13)
    ends = at(start, nil.__add__, cube), at(start + h, nil.__add__, cube)
    a0, a1 = (np.stack([slope(t), nil, nil]) for t in (start, start + h))
    assert halfway(*ends, a0, a1, h).vx == pytest.approx(cube(start + h / 2), abs=1e-13)


def test_births_are_booked_at_their_moments(tmp_path: Path) -> None:
    # U = 2 J/s t everywhere: no force, and each particle brings U at its birth, and ½ m v².
    drops = {
        "name": "drops",
        "rate": 37.0,
        "shape": {"type": "point", "position": [0, 0, 0]},
        "direction": [0, 1, 0],
        "speed": 3.0,
        "mass": 0.5,
    }
    fed = {"type": "field", "potential": "2*t"}
    scenario = table(1.0, 0.1, emitters=[drops], forces=[fed], output={**BOOKED, "every": 2})
    result = ps.run(ps.from_table(scenario), tmp_path / "drops.vtkhdf")
    with ps.open(tmp_path / "drops.vtkhdf") as trajectory:
        times = trajectory.events("birth")["time"]
    assert len(times) == pytest.approx(37, abs=1)
    assert result.ledger["work.births"][-1] == pytest.approx((2 * times + 0.25 * 9).sum(), rel=1e-9)


def test_births_deaths_and_kicks() -> None:
    # Ten drops of 1 g born at 3 m/s, 2 m up, each living 0.25 s: births bring ½mv² + mgy, deaths take as much, as free
    # fall keeps it. A kick of 0.01 N s at 0.5 s finds those alive.
    result = booked(
        1.0,
        0.01,
        "velocity_verlet",
        emitters=[
            {
                "rate": 10.0,
                "shape": {"type": "point", "position": [0, 2, 0]},
                "speed": 3.0,
                "mass": 1e-3,
                "lifetime": 0.25,
            }
        ],
        forces=[{"type": "gravity"}],
        impulses=[{"impulse": [0.01, 0, 0], "at": 0.5}],
    )
    each = 1e-3 * (0.5 * 9 + G * 2)
    ledger = result.ledger
    assert result.born == 10
    assert ledger["work.births"][-1] == pytest.approx(10 * each, rel=1e-12)
    alive = len(result.final)
    kicked = 0.01**2 / (2 * 1e-3)
    number = round(ledger["work.impulses"][-1] / kicked)
    assert ledger["work.impulses"][-1] == pytest.approx(number * kicked, rel=1e-9)
    assert ledger["work.deaths"][-1] == pytest.approx(-(10 - alive) * each - number * kicked, rel=1e-9)
    assert abs(ledger["balance"][-1]) < 1e-12


def test_books_change_nothing_and_have_the_same_bits_for_any_number_of_threads() -> None:
    size = {
        "layout": {
            "type": "cloth",
            "origin": [0, 1, 0],
            "size": [1.9, 1.9],
            "resolution": [40, 40],
            "pinned": "left",
        }
    }
    group = {**size, "name": "flag", "mass": 0.2, "springs": {"structural": 20.0, "damping": 0.01}}
    parts = {
        "particles": [group],
        "forces": [{"type": "gravity"}, {"type": "linear_drag", "coefficient": 1e-4}],
        "planes": [{"point": [0, 0.9, 0], "restitution": 0.3}],
    }
    with_, without = (
        table(0.1, 0.002, "symplectic_euler", output={"ledger": True, "work": work}, **parts)
        for work in (True, False)
    )
    one, two = (ps.run(ps.from_table(with_), threads=n) for n in (1, 2))
    plain = ps.run(ps.from_table(without), threads=2)
    assert np.array_equal(one.final.position, plain.final.position)
    assert all(np.array_equal(one.ledger[name], two.ledger[name]) for name in one.ledger)
    assert set(one.ledger) - set(plain.ledger) == {
        "work.linear_drag",
        "work.flag.structural",
        "work.contact",
        "balance",
    }


SWARM: dict[str, Any] = {
    "particles": [
        points(
            (1, 0, 0),
            (1.3, 0.2, 0),
            (0, 2, 0.3),
            velocity=[(0, 2, 0), (0, 2, 0), (-1, 0, 0)],
            mass=[1.0, 2.0, 0.5],
        )
    ],
    "emitters": [
        {
            "rate": 7.3,
            "shape": {"type": "ball", "center": [0, 0, 1], "radius": 0.5},
            "speed": 1.0,
            "spread": 180.0,
            "mass": 0.7,
            "lifetime": {"type": "uniform", "low": 0.3, "high": 0.9},
        }
    ],
}
FLOCK = {
    "type": "flocking",
    "sight": 4.0,
    "distance": 0.5,
    "separation": 2.0,
    "alignment": 0.3,
    "cohesion": 0.2,
}
RUB = {"type": "friction", "range": 4.0, "coefficient": 1.0}
BY_VELOCITY = pytest.mark.parametrize(
    "law", [FLOCK, RUB, {**RUB, "method": "neighbours"}], ids=["flocking", "friction", "neighbours"]
)


@pytest.mark.sampled(2)
@BY_VELOCITY
def test_pairs_work_for_as_long_as_both_are_there(law: dict[str, Any]) -> None:
    """Births and deaths in the middle of steps; no force stores energy, so books and motion must be of one mind."""

    def run(dt: float) -> ps.Result:
        return booked(2.0, dt, "rk4", interactions=[law], **SWARM)

    result = run(0.02)
    assert result.ledger[f"work.{law['type']}"][-1] < -5  # J
    assert np.abs(result.ledger["balance"]).max() < 1e-4
    assert observed(run, 0.02) > 2


@BY_VELOCITY
def test_own_steps_book_no_pairs_with_those_who_are_not_there(law: dict[str, Any]) -> None:
    for tolerance in (1e-5, 1e-9):
        result = left("dop853", tolerance, interactions=[law], **SWARM)
        assert np.abs(result.ledger["balance"]).max() < 100 * tolerance * 9


def test_work_needs_inertia_and_a_ledger() -> None:
    one = points((0, 0, 0), name="grain")
    with pytest.raises(ps.ScenarioError, match="'grain' has none"):
        booked(1.0, 0.1, "rk4", particles=[{**one, "dynamics": {"type": "first_order", "drag": 1.0}}])
    with pytest.raises(ps.ScenarioError, match="recorded in the ledger"):
        simulate(1.0, 0.1, particles=[one], output={"ledger": False, "work": True})


# Adaptive methods


def left(method: str, tolerance: float, work: bool = True, **parts: Any) -> ps.Result:
    """A run with own steps; `dt`, the longest, is 0.25 s."""
    integrator = {"method": method, "tolerance": tolerance}
    output = {"every": 2, "ledger": True, "work": work}
    return ps.run(ps.from_table(table(2.0, 0.25, integrator, output=output, **parts)), threads=1)


FALL: dict[str, Any] = {
    "particles": [points((0, 3, 0), (1, 40, 0), velocity=[(1, 2, 0), (0, 8, 3)], mass=0.5, radius=0.1)],
    "emitters": [
        {
            "rate": 20.0,
            "shape": {"type": "ball", "center": [5, 3, 0], "radius": 0.5},
            "speed": 3.0,
            "lifetime": 0.6,
            "mass": 0.1,
            "radius": 0.1,
        }
    ],
    "forces": [{"type": "gravity"}, {"type": "drag", "name": "air", "density": 1.2, "coefficient": 0.5}],
    "planes": [{"restitution": 0.7, "tangential_loss": 0.2}],
}
LINKED: dict[str, Any] = {
    "particles": [
        points((0, 2, 0), (0.5, 2, 0), (1.2, 2, 0), (3, 2, 0), name="chain", mass=0.5, pinned=[0]),
    ],
    "forces": [{"type": "gravity"}, {"type": "linear_drag", "name": "air", "coefficient": 0.05}],
    "springs": [
        {"name": "link", "on": "chain", "pairs": [[0, 1], [1, 2]], "stiffness": 60.0, "damping": 0.2},
        {"name": "weak", "on": "chain", "pairs": [[2, 3]], "stiffness": 1.0, "break_strain": 0.2},
    ],
    "motions": [{"on": "chain", "particles": [0], "path": ["0.2*sin(4*t)", "2", "0"]}],
    "planes": [{"point": [0, 0.8, 0], "restitution": 0.5}],
}


@pytest.mark.parametrize(
    ("method", "parts"),
    [("rk45", FALL), ("rk45", LINKED), ("dop853", LINKED)],
    ids=["independent", "coupled", "coupled-dop853"],
)
def test_adaptive_methods_leave_what_they_err(method: str, parts: dict[str, Any]) -> None:
    """A step that errs by r in position and velocity errs by some m g r + m v r, which is less than r times the energy that
    goes to and fro; a hundred steps may do so. Without quadrature of their own they would be off by percents."""
    for tolerance in (1e-5, 1e-9):
        result = left(method, tolerance, **parts)
        scale = sum(np.abs(values).max() for name, values in result.ledger.items() if "work." in name)
        assert scale > 3
        assert np.abs(result.ledger["balance"]).max() < 100 * tolerance * scale
    silent = left(method, 1e-9, work=False, **parts)
    assert silent.final.position.tobytes() == result.final.position.tobytes()
    assert silent.final.velocity.tobytes() == result.final.velocity.tobytes()


PULL = {"type": "gravity", "constant": 1.0, "softening": 0.3}
PUSH = {"type": "soft_sphere", "epsilon": 0.3, "sigma": 0.4, "method": "neighbours"}
FLOOR = {"point": [0, 0, 0.4], "normal": [0, 0, 1]}


@pytest.mark.parametrize("method", ["rk45", "dop853"])
@pytest.mark.parametrize(
    "parts",
    [
        {"interactions": [PULL]},
        {"interactions": [PUSH]},
        {"interactions": [PULL, RUB], "planes": [{**FLOOR, "restitution": 0.5}]},
        {"interactions": [PULL], "planes": [{**FLOOR, "contact": "kill"}]},
    ],
    ids=["gravity", "neighbours", "bounces", "deaths by a plane"],
)
def test_births_and_deaths_are_booked_where_own_steps_end(method: str, parts: dict[str, Any]) -> None:
    """Others move by metres in the longest step, and yet the balance is one of the tolerance."""
    for tolerance in (1e-5, 1e-9):
        ledger = left(method, tolerance, **SWARM, **parts).ledger
        scale = sum(np.abs(values).max() for name, values in ledger.items() if "work." in name)
        assert scale > 3
        assert np.abs(ledger["balance"]).max() < 100 * tolerance * scale


def test_births_bring_what_they_have_stored_with_those_who_are_there() -> None:
    # Each is at rest where it is born, 1 m from the one before, and moves by less than a µm. The second is born when the
    # first is dead, and the third while the second lives: −G m²/r once, and as much when one of them dies.
    born = [(0.01, 0, 0.02), (0.04, 1, 0.2), (0.06, 2, 0.02)]
    emitters = [
        {
            "name": name,
            "burst": {"at": at, "count": 1},
            "shape": {"type": "point", "position": [x, 0, 0]},
            "speed": 0.0,
            "mass": 1e3,
            "lifetime": life,
        }
        for name, (at, x, life) in zip("abc", born, strict=True)
    ]
    result = ps.run(
        ps.from_table(
            table(
                0.2,
                0.1,
                {"method": "dop853", "tolerance": 1e-12},
                emitters=emitters,
                interactions=[{"type": "gravity", "constant": 1e-6}],
                output={**BOOKED, "every": 1},
            )
        ),
        threads=1,
    )
    stored = -1e-6 * 1e3**2
    assert result.ledger["work.births"][-1] == pytest.approx(stored, rel=1e-9)
    assert result.ledger["work.deaths"][-1] == pytest.approx(-stored, rel=1e-5)
    assert abs(result.ledger["balance"][-1]) < 1e-10


def test_own_steps_are_booked_alike_in_any_blocks() -> None:
    """The log of own steps is one of blocks; what is booked is not. A log that is too small is made larger."""
    scenario = ps.from_table(
        table(0.5, 0.25, {"method": "rk45", "tolerance": 1e-7}, output={"every": 1, **BOOKED}, **FALL)
    )
    books = []
    for block, room in ((None, 4096), (3, 1)):
        with closing(Simulation(scenario, threads=1, block=block)) as simulation:
            for island in simulation.islands:
                island._room = room
            simulation.ledger()  # from which the balance counts
            simulation.advance_to(2)
            books.append(simulation.ledger())
    assert books[0] == books[1]
    assert books[0]["work.air"] < 0
