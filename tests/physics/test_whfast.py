"""WHFast: two bodies at any step, the order and size of its errors, very many steps, and what it does not take."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import EPS, Table, points, table

import particlesim as ps
from particlesim.compiler import kernel
from particlesim.engine.coupled.kepler import kepler_step

GRAVITY = [{"type": "gravity", "constant": 1.0}]
MU = 1.1
PERIOD = 2 * math.pi / math.sqrt(MU)
COORDINATES = ("jacobi", "democratic_heliocentric")


def bodies(*these: tuple[str, float, Any, Any]) -> list[Table]:
    """Groups of one body each: name, mass, place, velocity."""
    return [points(x, velocity=[v], name=name, mass=m) for name, m, x, v in these]


def two(e: float) -> list[Table]:
    """An orbit of eccentricity e and semi-major axis 1 m from its pericentre, about the common centre of mass."""
    x, v, light, heavy = 1 - e, math.sqrt(MU * (1 + e) / (1 - e)), 0.1 / 1.1, 1 / 1.1
    return bodies(
        ("sun", 1.0, (-light * x, 0, 0), (0, -light * v, 0)),
        ("planet", 0.1, (heavy * x, 0, 0), (0, heavy * v, 0)),
    )


def three(mass: float, shift: float = 0.0) -> list[Table]:
    """Two planets about a sun of 1 kg; `shift` [m/s] is the velocity of the centre of mass."""
    x = np.array([[0, 0, 0], [1, 0, 0.01], [-1.9, 0.3, 0]])
    v = np.array([[0, 0, 0], [0, 1.02, 0], [-0.1, -0.7, 0.03]])
    m = np.array([1.0, mass, 1.3 * mass])
    x, v = x - m @ x / m.sum(), v - m @ v / m.sum() + [shift, 0, 0]
    return bodies(*(("sab"[k], m[k], tuple(x[k].tolist()), tuple(v[k].tolist())) for k in range(3)))


def ran(duration: float, dt: float, groups: list[Table], every: int = 0, **parts: Any) -> ps.Result:
    method = parts.pop("integrator", {"method": "whfast"})
    threads = parts.pop("threads", None)
    output = {"output": {"every": every, "ledger": True}} if every else {}
    scenario = table(duration, dt, method, particles=groups, interactions=GRAVITY, **output, **parts)
    return ps.run(ps.from_table(scenario), threads=threads)


def energy_errors(r: ps.Result) -> NDArray[np.float64]:
    energy = r.ledger["kinetic"] + r.ledger["potential.gravity"]
    return np.asarray(energy - energy[0])


def on_ellipse(e: float, turns: float) -> NDArray[np.float64]:
    """Place on an ellipse after some turns."""
    mean = 2 * math.pi * math.remainder(turns, 1)
    low, high = mean - 1, mean + 1  # |E − M| ≤ e
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if middle - e * math.sin(middle) < mean else (low, middle)
    return np.array([math.cos(low) - e, math.sqrt(1 - e * e) * math.sin(low), 0])


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("part", [0.01, 0.37, 3.3, -1 / 3])
def test_two_bodies_are_exact_at_any_step(e: float, part: float) -> None:
    # What rounds is the energy: by some 2 (1 + e)/(1 − e) roundings in a passage of the pericentre, of which each moves the
    # phase by 3π a turn from then on.
    part, steps = (abs(part), 3) if part < 0 else (part, 20)
    turns = steps * part
    x = ran(turns * PERIOD, part * PERIOD, two(e)).final.position
    allowed = 4 * EPS * (1 + 3 * math.pi * turns * math.sqrt(steps + turns) * (1 + e) / (1 - e)) / (1 - e)
    assert np.linalg.norm(x[1] - x[0] - on_ellipse(e, turns)) < allowed


@pytest.mark.parametrize("h", [0.1, 3.0, 300.0])
def test_all_conics_have_their_energy_and_their_way_back(h: float) -> None:
    @kernel
    def there_and_back(s: Any, h: Any, out: Any) -> None:
        for i in range(s.shape[1]):
            d = kepler_step(1.0, s[0, i], s[1, i], s[2, i], s[3, i], s[4, i], s[5, i], h)
            for k, change in enumerate(d):
                out[0, k, i] = s[k, i] + change
            q = out[0]
            d = kepler_step(1.0, q[0, i], q[1, i], q[2, i], q[3, i], q[4, i], q[5, i], -h)
            for k, change in enumerate(d):
                out[1, k, i] = q[k, i] + change

    rng = np.random.default_rng(2)
    s = np.repeat(rng.uniform(0.1, 2, (2, 400)), 3, axis=0) * rng.normal(size=(6, 400))
    out = np.zeros((2, 6, 400))
    there_and_back(s, h, out)
    terms = [
        np.square(q[3:]).sum(axis=0) / 2 + 1j / np.linalg.norm(q[:3], axis=0) for q in (s, out[0], out[1])
    ]
    scale = sum(each.real + each.imag for each in terms)
    # passages of near pericentres, where terms are large, round most
    missed = np.abs((terms[0] - terms[1]).real - (terms[0] - terms[1]).imag) / scale
    assert np.median(missed) < 10 * EPS
    assert missed.max() < 1e-10
    spin = [np.cross(q[:3], q[3:], axis=0) for q in (s, out[0])]
    size = sum(np.linalg.norm(q[:3], axis=0) * np.linalg.norm(q[3:], axis=0) for q in (s, out[0]))
    assert (np.abs(spin[0] - spin[1]) < 1e-10 * size).all()
    if h < 1:  # for longer times a rounding of the energy is seen in the place
        assert np.median(np.abs(out[1] - s)) < 100 * EPS
    radial = np.array([[1.0], [0], [0], [0], [0], [0]])  # falls through the centre, and comes back
    fall = np.zeros((2, 6, 1))
    there_and_back(radial, 2 * math.pi / 2**1.5, fall)
    assert fall[0, :, 0] == pytest.approx(radial[:, 0], abs=1e-7)


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_errors_are_of_second_order_and_small_as_the_masses(coordinates: str) -> None:
    # The energy of the planets is of the size of their mass ε, and the error is ε² h².
    integrator = {"method": "whfast", "coordinates": coordinates}
    errors = {
        (mass, dt): np.abs(energy_errors(ran(60.0, dt, three(mass), 2, integrator=integrator))).max()
        for mass, dt in ((1e-3, 0.2), (1e-3, 0.1), (1e-4, 0.1))
    }
    assert math.log2(errors[1e-3, 0.2] / errors[1e-3, 0.1]) == pytest.approx(2, abs=0.1)
    assert math.log10(errors[1e-3, 0.1] / errors[1e-4, 0.1]) == pytest.approx(2, abs=0.1)
    assert errors[1e-3, 0.1] < 1e-3**2 * 0.1**2 * 100


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_the_way_is_that_of_ias15(coordinates: str) -> None:
    # Errors of the way of second order, too; at this step below 1e-5.
    integrator = {"method": "whfast", "coordinates": coordinates}
    outside = {"forces": [{"type": "point_spring", "anchor": [0.1, 0, 0], "stiffness": 1e-5}]}
    exact = ran(20.0, 20.0, three(1e-3, 0.1), integrator="ias15", **outside).final.position
    misses = [
        np.abs(ran(20.0, dt, three(1e-3, 0.1), integrator=integrator, **outside).final.position - exact).max()
        for dt in (0.04, 0.02)
    ]
    assert misses[0] < 1e-5
    assert math.log2(misses[0] / misses[1]) == pytest.approx(2, abs=0.1)


def test_errors_do_not_drift_in_very_many_steps() -> None:
    # 10⁵ steps of two bodies: roundings add up at random, as √n; systematic ones, as n, would be 300 times that.
    error = np.abs(energy_errors(ran(1e5 * PERIOD / 17.32, PERIOD / 17.32, two(0.3), 10_000)) / 0.05)
    assert error.max() < 4 * EPS * math.sqrt(1e5)
    # of three: the bounded error of the method stays what it is
    r = ran(1e4, 0.1, three(1e-3, 0.3), 500)
    errors = energy_errors(r)
    early, late = errors[: len(errors) // 2], errors[len(errors) // 2 :]
    assert abs(early.mean() - late.mean()) < 0.05 * errors.std()
    # no forces from outside move the centre of mass: only what shows it rounds
    assert np.ptp(r.ledger["momentum.x"]) < 20 * EPS * 0.3


def test_bits_depend_on_nothing_but_the_scenario() -> None:
    # Frames, threads, and the order in which bodies are listed: the innermost is found by itself.
    few, many = (ran(50.0, 0.1, three(1e-3), every).final for every in (500, 3))
    assert np.array_equal(few.position, many.position)
    assert np.array_equal(few.velocity, many.velocity)
    two_threads = ran(50.0, 0.1, three(1e-3), threads=2).final
    assert np.array_equal(few.position, two_threads.position)
    groups = three(1e-3)
    turned = ran(50.0, 0.1, [groups[2], groups[0], groups[1]]).final.position
    assert np.abs(turned[[1, 2, 0]] - few.position).max() < 1e-12


def test_a_kick_in_between_is_taken_up() -> None:
    kick = {"on": ["a"], "at": 5.0, "impulse": [1e-5, 0, 0]}
    exact = ran(20.0, 20.0 / 400, three(1e-3), 100, integrator="ias15", impulses=[kick]).final.position
    mine = ran(20.0, 20.0 / 400, three(1e-3), 100, impulses=[kick]).final.position
    assert np.abs(mine - exact).max() < 5e-5


def test_the_longest_step_is_that_of_the_fastest_pericentre() -> None:
    # of a circle of radius 1 m about 1 kg: 2π/16 s; of two bodies alone there is none
    planets = bodies(
        ("s", 1.0, (0, 0, 0), (0, 0, 0)),
        ("a", 1e-9, (1, 0, 0), (0, 1, 0)),
        ("b", 1e-9, (9, 0, 0), (0, 1 / 3, 0)),
    )
    for groups, step in ((planets, 2 * math.pi / 16), (two(0.5), math.inf)):
        scenario = table(1.0, 0.5, "whfast", particles=groups, interactions=GRAVITY)
        found = ps.stability(ps.from_table(scenario))
        assert found.step == pytest.approx(step, rel=1e-6)
        assert bool(found.warnings) == (step < 0.5)


@pytest.mark.parametrize(
    ("change", "where", "words"),
    [
        ({"interactions": []}, "simulation.integrator", "needs gravity"),
        (
            {"interactions": [{"type": "gravity", "softening": 0.1}]},
            "interactions.gravity.softening",
            "without softening",
        ),
        (
            {"interactions": [{"type": "gravity", "method": "tree"}]},
            "interactions.gravity.method",
            "directly",
        ),
        ({"interactions": [{"type": "gravity", "on": ["sun"]}]}, "particles.planet", "feels none"),
        ({"forces": [{"type": "linear_drag", "coefficient": 1.0}]}, "forces.linear_drag", "velocity"),
        ({"planes": [{"normal": [0, 1, 0]}]}, "planes", "contacts"),
        (
            {"springs": [{"between": ["sun", "planet"], "pairs": [[0, 0]], "stiffness": 1.0}]},
            "springs",
            "without springs",
        ),
        ({"simulation": {"precision": "single"}}, "simulation.precision", "double precision"),
        ({"simulation": {"integrator": {"method": "whfast", "central": "moon"}}}, "central", "'moon'"),
        ({"output": {"work": True, "ledger": True}}, "output.work", "recorded"),
    ],
)
def test_what_it_does_not_take_is_told(change: dict[str, Any], where: str, words: str) -> None:
    scenario = table(1.0, 0.1, "whfast", particles=two(0.5), interactions=GRAVITY)
    for name, part in change.items():
        scenario[name] = scenario[name] | part if isinstance(part, dict) else part
    with pytest.raises(ps.ScenarioError, match=words) as caught:
        ps.from_table(scenario)
    assert where.split(".")[0] in str(caught.value)


def test_bodies_that_none_outweighs_are_told() -> None:
    groups = three(0.6)
    with pytest.raises(ps.UsageError, match=r"1 kg, the others have 1.38 kg"):
        ran(1.0, 0.1, groups)
    with pytest.raises(ps.UsageError, match="is one"):
        ran(
            1.0,
            0.1,
            [points((1, 0, 0), (2, 0, 0), velocity=[(0, 0, 0)] * 2, name="sun")],
            integrator={"method": "whfast", "central": "sun"},
        )
