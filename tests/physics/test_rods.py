"""Rods against closed forms: lengths, orders, momenta, statics, led ends and their work; loops, and what cannot be held."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk
from simulate import EPS, G, points, simulate, table

import particlesim as ps
from particlesim.compiler import uncompiled
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability import linearised as linear

METHODS = [("symplectic_euler", 1), ("velocity_verlet", 2), ("yoshida4", 4)]


def chain(*position: Any, pinned: Any = (0,), **more: Any) -> dict[str, Any]:
    """Particles in a row on rods, the first one pinned, under gravity."""
    group = {"name": "chain", **points(*position, **more)}
    if pinned:
        group["pinned"] = list(pinned)
    pairs = [[k, k + 1] for k in range(len(position) - 1)]
    return {
        "particles": [group],
        "rods": [{"name": "links", "on": "chain", "pairs": pairs}],
        "forces": [{"type": "gravity"}],
    }


def lengths(result: ps.Result) -> Any:
    """Distances of neighbours at the end [m]."""
    return np.linalg.norm(np.diff(result.final.position, axis=0), axis=1)


@pytest.mark.parametrize(("method", "order"), METHODS)
def test_a_pendulum_of_large_amplitude_swings_in_its_period(method: str, order: int) -> None:
    # Released at rest at 120°: sin(θ/2) = k sn(K − ωt, k) with k = sin 60°.
    k, t = math.sin(math.radians(60)), 3.0
    sine = ellipj(ellipk(k * k) - math.sqrt(G) * t, k * k)[0]
    theta = 2 * math.asin(k * sine)
    exact = np.array([math.sin(theta), -math.cos(theta), 0])
    start = (math.sin(math.radians(120)), -math.cos(math.radians(120)), 0)

    def error(dt: float) -> float:
        result = simulate(t, dt, method, **chain((0, 0, 0), start))
        assert lengths(result) == pytest.approx(1, abs=1e-12)
        return float(np.linalg.norm(result.final.position[1] - exact))

    assert math.log2(error(0.01) / error(0.005)) == pytest.approx(order, abs=0.1)


def test_a_double_pendulum_keeps_lengths_and_its_energy_swings_without_drift() -> None:
    result = simulate(
        60.0,
        0.002,
        output={"every": 30, "ledger": True},
        **chain((0, 0, 0), (1, 0, 0), (1, 1, 0), mass=1.0),
    )
    assert lengths(result) == pytest.approx([1, 1], abs=1e-12)
    swing = result.energy - result.energy[0]
    half = len(swing) // 2
    # Errors are of the order (hω)²/12 of energies of 30 J, ω up to 10/s or so; chaotic motion has spikes, and no trend.
    assert np.abs(swing).max() < 0.02
    assert abs(swing[half:].mean() - swing[:half].mean()) < 0.1 * np.abs(swing).max()


def test_a_free_dumbbell_turns_and_keeps_its_momenta() -> None:
    # Masses 1 and 3 kg, 2 m apart, turn at ω = 5/s about their centre, which goes straight; in the plane x, z.
    omega, drift = 5.0, np.array([0.3, 0.7, -0.2])
    x = np.array([[1.5, 0, 0], [-0.5, 0, 0]])
    v = drift + omega * np.cross([0, 1, 0], x)

    def run(dt: float) -> ps.Result:
        return simulate(
            2.0,
            dt,
            output={"ledger": True},
            particles=[
                points(tuple(x[0]), velocity=[v[0].tolist()], name="light", mass=1.0),
                points(tuple(x[1]), velocity=[v[1].tolist()], name="heavy", mass=3.0),
            ],
            rods=[{"between": ["light", "heavy"], "pairs": [[0, 0]], "length": 2.0}],
        )

    def error(result: ps.Result) -> float:
        angle = omega * 2.0
        turned = x[:, :1] * [math.cos(angle), 0, -math.sin(angle)]
        return float(np.abs(result.final.position - turned - 2.0 * drift).max())

    coarse, fine = run(0.01), run(0.005)
    assert math.log2(error(coarse) / error(fine)) == pytest.approx(2, abs=0.05)
    for name, values in fine.ledger.items():
        if "momentum" in name:
            # 400 steps, each with some ten roundings of numbers up to m v r = 30.
            assert np.ptp(values) < 4000 * EPS * 30, name
    assert np.ptp(fine.energy) < 4000 * EPS * 100, "nothing pulls: the speed stays"


def test_a_chain_at_rest_hangs_as_statics_says() -> None:
    # Between two pins, with drag until it rests: the horizontal pull H is the same everywhere, and each particle's weight
    # turns the next link, so that the slopes of the links are an arithmetic progression with the difference m g/H.
    angle = np.linspace(0, math.pi, 12)
    around = [(-math.cos(a), -math.sin(a), 0) for a in angle]
    scene = chain(*around, pinned=(0, 11), mass=0.2)
    scene["forces"].append({"type": "linear_drag", "coefficient": 1.0})
    result = simulate(40.0, 0.01, **scene)
    link = np.diff(result.final.position, axis=0)
    slope = link[:, 1] / link[:, 0]
    assert np.diff(slope) == pytest.approx(np.full(10, np.diff(slope).mean()), rel=1e-9)
    assert lengths(result) == pytest.approx(np.full(11, 2 * math.sin(math.pi / 22)), abs=1e-12)
    assert np.abs(result.final.velocity).max() < 1e-9


def kapitza(dt: float, method: str) -> tuple[ps.Result, Any]:
    """A pendulum whose pin is shaken, θ'' = −(g + a″) sin θ with a = 0.1 sin 20t, and where it is after 1.5 s."""
    omega = -0.75  # the pin begins at 2 m/s, and the ball with it, as it turns about the pin
    velocity = [(0, 0, 0), (0.8 * omega, 2.0 + 0.6 * omega, 0)]
    scene = chain((0, 0, 0), (0.6, -0.8, 0), mass=2.0, velocity=velocity)
    scene["motions"] = [{"on": "chain", "path": ["x", "y + 0.1*sin(20*t)", "z"]}]
    result = simulate(
        1.5, dt, method, output={"ledger": True, "work": True, "every": max(1, round(0.1 / dt))}, **scene
    )

    def slope(t: float, y: Any) -> list[float]:
        return [y[1], -(G - 0.1 * 400 * math.sin(20 * t)) * math.sin(y[0])]

    exact = solve_ivp(slope, (0, 1.5), [math.asin(0.6), omega], rtol=1e-12, atol=1e-12).y[0, -1]
    top = 0.1 * math.sin(30)
    return result, np.array([math.sin(exact), top - math.cos(exact), 0])


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("method", "order"), METHODS[1:])
def test_a_led_end_gives_what_the_books_say(method: str, order: int) -> None:
    errors, left = [], []
    for dt in (0.005, 0.0025):
        result, exact = kapitza(dt, method)
        errors.append(np.linalg.norm(result.final.position[1] - exact))
        left.append(np.abs(result.ledger["balance"]).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)
    assert math.log2(left[0] / left[1]) == pytest.approx(order, abs=0.4)
    assert np.ptp(result.ledger["work.motion"]) > 1, "it is no small matter"


def test_drag_and_impulses_on_rods_are_booked() -> None:
    scene = chain((0, 0, 0), (0.6, -0.8, 0), (1.6, -0.8, 0), mass=0.5)
    scene["forces"].append({"type": "linear_drag", "name": "air", "coefficient": 0.3})
    scene["impulses"] = [{"impulse": [0.4, 0.3, 0.1], "at": 0.5}]

    def left(dt: float) -> float:
        result = simulate(1.0, dt, output={"ledger": True, "work": True, "every": round(0.1 / dt)}, **scene)
        # What a kick gives along the rods is not in the motion, nor in the books.
        assert abs(result.ledger["work.impulses"][-1]) > 0.1
        assert result.ledger["work.air"][-1] < -0.1
        return float(np.abs(result.ledger["balance"]).max())

    # With a force that depends on the velocity kicks and drifts are of first order, and that is what is left.
    assert math.log2(left(0.01) / left(0.005)) == pytest.approx(1, abs=0.3)


def test_rods_that_depend_on_each_other_are_held_by_the_others() -> None:
    # Five particles of a body, all joined: ten rods, of which nine do it. It turns about a main axis as a whole.
    corner = [(1, 0, 0), (-0.5, 0, 0.8), (-0.5, 0, -0.8), (0, 0.9, 0), (0, -0.9, 0)]
    x = np.array(corner, float)
    x -= x.mean(axis=0)
    v = np.cross([0, 3.0, 0], x)
    every = [[a, b] for a in range(5) for b in range(a)]
    result = simulate(
        2.0,
        0.002,
        output={"ledger": True},
        particles=[points(*x.tolist(), velocity=v.tolist(), name="body", mass=1.0)],
        rods=[{"on": "body", "pairs": every}],
    )
    a, b = np.array(every).T
    apart = [np.linalg.norm(p[a] - p[b], axis=1) for p in (x, result.final.position)]
    assert apart[1] == pytest.approx(apart[0], rel=1e-12)
    turn = 3.0 * 2.0
    turned = x @ np.array(
        [[math.cos(turn), 0, -math.sin(turn)], [0, 1, 0], [math.sin(turn), 0, math.cos(turn)]]
    )
    # Second order: the phase of a turning body errs by (hω)² ωt/24 or so.
    assert result.final.position == pytest.approx(turned, abs=(0.002 * 3.0) ** 2 * turn)
    assert np.ptp(result.ledger["angular_momentum.y"]) < 1e-11


def test_what_cannot_be_held_ends_the_run_and_names_the_rod() -> None:
    # A straight chain between two pins has no length to give: the first step of fall cannot be mended.
    with pytest.raises(ps.DivergenceError) as caught:
        simulate(1.0, 0.01, **chain((0, 0, 0), (1, 0, 0), (2, 0, 0), pinned=(0, 2)))
    assert "rods 'links' could not be held in the step from t = 0 s" in str(caught.value)
    assert caught.value.post_mortem is not None
    assert caught.value.post_mortem.cause == "not held"
    assert caught.value.post_mortem.particle == 1, "not the pinned one"


def test_a_chain_falls_on_the_ground_and_stays_whole() -> None:
    position = [(0.1 * k, 0.5 + 0.02 * k, 0.03 * (k % 2)) for k in range(12)]
    scene = chain(*position, pinned=(), mass=0.1, radius=0.02)
    scene["planes"] = [{"restitution": 0.3, "tangential_loss": 0.2}]
    result = simulate(3.0, 0.002, output={"ledger": True, "every": 10}, **scene)
    before = np.linalg.norm(np.diff(np.array(position), axis=0), axis=1)
    assert lengths(result) == pytest.approx(before, abs=1e-12)
    assert result.final.position[:, 1] == pytest.approx(np.full(12, 0.02), abs=1e-3)
    assert np.diff(result.energy).max() < 1e-3 * result.energy[0], "the ground takes energy"


def test_lengths_that_fit_nearly_are_put_right_before_the_start() -> None:
    scene = chain((0, 0, 0), (0.60003, 0.8, 0))
    scene["rods"][0]["length"] = 1.0
    simulation = Simulation(ps.from_table(table(1.0, 0.01, **scene)), threads=1)
    assert np.linalg.norm(simulation.states[0].position[1]) == pytest.approx(1, abs=1e-15)
    simulation.close()


def rope(**springs: Any) -> dict[str, Any]:
    layout = {"type": "rope", "start": [0, 0, 0], "end": [0.8, 0, 0.6], "count": 9, "pinned": "start"}
    return {
        "particles": [{"name": "rope", "layout": layout, "mass": 0.9, "springs": springs}],
        "forces": [{"type": "gravity"}],
    }


def test_a_rope_of_rods_is_the_chain() -> None:
    place = [(0.1 * k, 0, 0.075 * k) for k in range(9)]
    whole = simulate(1.0, 0.005, **rope(rigid=True))
    listed = simulate(1.0, 0.005, **chain(*place, mass=0.1))
    assert whole.final.position == pytest.approx(listed.final.position, abs=1e-9)


def hanging(number: int, dt: float, aside: float = 0.0, duration: float = 1.0) -> dict[str, Any]:
    """A chain of rods of half a metre that hangs at rest, its end a little aside."""
    place = [(0.0, -0.5 * k, 0.0) for k in range(number)]
    angle = aside / 0.5
    place.append((0.5 * math.sin(angle), -0.5 * (number - 1) - 0.5 * math.cos(angle), 0.0))
    return table(duration, dt, output={"ledger": True}, **chain(*place, mass=0.7))


def test_the_look_at_stability_knows_what_rods_leave() -> None:
    # The double pendulum of equal masses and lengths: ω² = (2 ± √2) g/l.
    found = ps.stability(ps.from_table(hanging(2, 0.01)))
    limit = 2 / math.sqrt((2 + math.sqrt(2)) * G / 0.5)
    assert found.step == pytest.approx(limit, rel=1e-6)
    assert found.islands[0].forces == {"links": pytest.approx(limit, rel=1e-6)}
    steady = ps.run(ps.from_table(hanging(2, 0.97 * limit, 1e-6, 400 * 0.97 * limit)))
    assert np.abs(steady.final.position[1:, 0]).max() < 1e-4
    with pytest.raises(ps.DivergenceError, match="could not be held") as caught:
        ps.run(ps.from_table(hanging(2, 1.03 * limit, 1e-6, 400 * 1.03 * limit)))
    assert "try simulation.dt = 0.21" in str(caught.value)
    assert "backward_euler" not in str(caught.value)
    turning = hanging(2, 0.01)
    turning["particles"][0]["radius"] = 0.26
    turning["interactions"] = [{"type": "contact", "model": "linear", "stiffness": 1.0, "friction": 0.5}]
    with uncompiled():  # NumPy looks at every index
        assert ps.stability(ps.from_table(turning)).step > 0


def test_bounds_on_long_chains_are_never_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = ps.from_table(hanging(12, 0.01))
    exact = ps.stability(scenario).step
    monkeypatch.setattr(linear, "DENSE", 3)
    bounded = ps.stability(scenario)
    assert bounded.islands[0].how == "extreme modes"
    assert 0.9 * exact < bounded.step <= exact * (1 + 1e-9)
    monkeypatch.setattr(linear, "MOST_RODS", 3)
    assert ps.stability(scenario).islands[0].how == "extreme modes (without rods)"


def test_a_pendulum_counts_as_hanging_wherever_it_starts() -> None:
    for start in ((0.0, -0.5, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0)):
        found = ps.stability(ps.from_table(table(1.0, 0.01, **chain((0, 0, 0), start))))
        assert found.step == pytest.approx(2 / math.sqrt(G / 0.5), rel=1e-6)
    # Nothing hangs where nothing is pinned.
    falling = chain((0, 0, 0), (0.5, 0, 0), pinned=())
    assert ps.stability(ps.from_table(table(1.0, 0.01, **falling))).step == math.inf


def test_rods_that_leave_no_motion_put_no_limit() -> None:
    # Two pins and a taut rod on each leave one direction across, and a third rod takes that.
    locked = chain((0, 0, 0), (1, 1, 0), (2, 0, 0), (1, 0, 1), pinned=(0, 2, 3))
    locked["rods"][0]["pairs"] = [[0, 1], [1, 2], [1, 3]]
    assert ps.stability(ps.from_table(table(1.0, 0.01, **locked))).step == math.inf
