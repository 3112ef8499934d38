"""Two bodies and a spring: the one problem with pair forces that has a closed form."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import EPS, G, points, simulate, way

import particlesim as ps
from particlesim.integrators import METHODS, ImplicitMethod

M1, M2, K, REST, STRETCH = 0.5, 1.5, 30.0, 0.8, 0.2
MU = M1 * M2 / (M1 + M2)
OMEGA = math.sqrt(K / MU)
ALONG = np.array([2.0, -1.0, 2.0]) / 3
DRIFT = np.array([0.3, 0.1, -0.2])


def dumbbell(t: float, steps: int, method: str, damping: float = 0.0, **spring: Any) -> ps.Result:
    """Two masses, stretched and let go while both drift; the spring lies across the axes."""
    reach = (REST + STRETCH) * ALONG
    return simulate(
        t,
        t / steps,
        method,
        particles=[
            points((0, 0, 0), velocity=[DRIFT], mass=M1, name="a"),
            points(reach, velocity=[DRIFT], mass=M2, name="b"),
        ],
        springs=[
            {
                "between": ["a", "b"],
                "pairs": [[0, 0]],
                "stiffness": K,
                "damping": damping,
                "rest_length": REST,
            }
        ],
        output={"ledger": True},
    )


def length(result: ps.Result) -> float:
    return float(np.linalg.norm(result.final.position[0] - result.final.position[1]))


# Implicit and adaptive methods have tests of their own.
EXPLICIT = [m.name for m in METHODS.values() if m.by_modes and not isinstance(m, ImplicitMethod)]


@pytest.mark.parametrize("method", EXPLICIT)
def test_two_masses_swing_with_the_frequency_of_their_reduced_mass(method: str) -> None:
    # l = L₀ + A cos ωt, ω = √(k/μ), μ = m₁ m₂/(m₁ + m₂). At 1.1 periods phase and amplitude both count; a method of order
    # p misses l by C hᵖ, so that half the step leaves 2⁻ᵖ of the miss; C is less than ωt of the amplitude for h in 1/ω.
    order = METHODS[method].order
    t = 1.1 * 2 * math.pi / OMEGA
    exact = REST + STRETCH * math.cos(OMEGA * t)
    steps = {1: 4000, 2: 400, 3: 300, 4: 150}[order]
    coarse, fine = (dumbbell(t, n, method) for n in (steps, 2 * steps))
    misses = abs(length(coarse) - exact), abs(length(fine) - exact)
    assert math.log2(misses[0] / misses[1]) == pytest.approx(order, abs=0.1)
    assert misses[1] < STRETCH * OMEGA * t * (OMEGA * t / (2 * steps)) ** order
    # The forces on both ends are the same number with opposite signs: momentum is kept to rounding.
    miss = steps * EPS * OMEGA
    center = (M1 * coarse.final.position[0] + M2 * coarse.final.position[1]) / (M1 + M2)
    start = M2 * (REST + STRETCH) * ALONG / (M1 + M2)
    assert center == pytest.approx(start + DRIFT * t, abs=miss / OMEGA)
    momentum = M1 * coarse.final.velocity[0] + M2 * coarse.final.velocity[1]
    assert momentum == pytest.approx((M1 + M2) * DRIFT, abs=miss)


def test_a_damper_takes_energy_at_its_rate() -> None:
    # l = L₀ + A e^(−δt) (cos ω't + δ/ω' sin ω't), δ = c/2μ, ω'² = ω² − δ². RK4 errs by less than (ωh)⁵/60 a step.
    damping, t, steps = 0.6, 2.0, 2000
    delta = damping / (2 * MU)
    swing = math.sqrt(OMEGA**2 - delta**2)
    exact = REST + STRETCH * math.exp(-delta * t) * (
        math.cos(swing * t) + delta / swing * math.sin(swing * t)
    )
    result = dumbbell(t, steps, "rk4", damping)
    assert length(result) == pytest.approx(
        exact, abs=STRETCH * steps * (OMEGA * t / steps) ** 5 / 60 + steps * EPS
    )


def test_a_damper_with_its_sign_right_ends_with_a_millijoule() -> None:
    # Two masses of 1 kg, k = 10 N/m, c = 0.5 kg/s, 0.2 J at the start, 5 s: the amplitude falls as e^(−ct/m), the energy,
    # taken at a moment when the envelope is touched, as its square: 0.2 e⁻⁵ J = 1.35 mJ within the swing of
    # (1 ± δ/ω)². With the sign of the relative velocity turned it would be 40 J.
    result = simulate(
        5.0,
        0.001,
        "rk4",
        particles=[points((0, 0, 0), mass=1.0, name="a"), points((1.2, 0, 0), mass=1.0, name="b")],
        springs=[
            {"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": 10.0, "damping": 0.5, "rest_length": 1.0}
        ],
        output={"ledger": True},
    )
    ratio = 0.5 / math.sqrt(20.0)
    assert result.energy[0] == pytest.approx(0.2, rel=1e-12)
    assert 0.2 * math.exp(-5) * (1 - ratio) ** 2 < result.energy[-1] < 0.2 * math.exp(-5) * (1 + ratio) ** 2


def test_a_spring_takes_its_rest_length_from_the_start() -> None:
    # Without rest_length the spring is slack at the start: nothing ever moves.
    result = simulate(
        1.0,
        0.01,
        "rk4",
        particles=[points((0, 0, 0), mass=1.0, name="a"), points((0.3, 0.4, 0), mass=2.0, name="b")],
        springs=[{"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": 50.0}],
    )
    assert result.final.position.tolist() == [[0, 0, 0], [0.3, 0.4, 0]]


def test_a_pinned_end_stays_and_still_pulls() -> None:
    # One end fixed: ω = √(k/m). Velocity Verlet's phase lags by (ωh)²/24 of itself.
    k, m, t, steps = 20.0, 0.8, 1.3, 2000
    final = simulate(
        t,
        t / steps,
        particles=[points((0, 0, 0), (1.5, 0, 0), mass=m, pinned=[0], name="chain")],
        springs=[{"on": "chain", "pairs": [[0, 1]], "stiffness": k, "rest_length": 1.0}],
    ).final
    omega = math.sqrt(k / m)
    phase = omega * t
    bound = 0.5 * phase * (phase / steps) ** 2 / 20
    assert final.position[0].tolist() == [0, 0, 0]
    assert final.position[1] == pytest.approx([1 + 0.5 * math.cos(phase), 0, 0], abs=bound)


def test_pinned_particles_ignore_forces_and_kicks() -> None:
    final = simulate(
        0.5,
        0.01,
        particles=[points((0, 1, 0), (0, 2, 0), velocity=[(1, 1, 1)], pinned=[1])],
        forces=[{"type": "gravity"}],
        impulses=[{"at": 0.2, "impulse": [5, 0, 0]}],
    ).final
    assert final.position[1].tolist() == [0, 2, 0]
    assert final.velocity[1].tolist() == [0, 0, 0]
    assert final.position[0, 0] == pytest.approx(0.5 + 5 * 0.3, abs=1e-14)


# What springs may be beside linear: by frequency, strings, and such that break.


@pytest.mark.parametrize("pinned", [False, True])
def test_a_spring_by_frequency_swings_at_it(pinned: bool) -> None:
    # k = μ (2πf)²: after half a period, 1/2f, the stretch has changed its sign. A pinned end is infinitely heavy: μ = m.
    # RK4 errs by (ωh)⁵/120 a step in phase, hence by its square in the cosine, and by (ωh)⁶/144 in amplitude.
    f, steps = 2.5, 500
    result = simulate(
        0.5 / f,
        0.5 / f / steps,
        "rk4",
        particles=[
            points((0, 0, 0), mass=M1, pinned=pinned, name="a"),
            points((1.2, 0, 0), mass=M2, name="b"),
        ],
        springs=[{"between": ["a", "b"], "pairs": [[0, 0]], "frequency": f, "rest_length": 1.0}],
    )
    assert length(result) == pytest.approx(0.8, abs=steps * ((math.pi / steps) ** 6 + 2 * EPS))


def test_the_damping_ratio_says_how_fast_a_swing_dies() -> None:
    # One period of a spring with ratio ζ takes e^(−2πζ/√(1 − ζ²)) of its stretch; the period is T/√(1 − ζ²).
    f, zeta, steps = 2.0, 0.25, 2000
    root = math.sqrt(1 - zeta**2)
    t = 1 / (f * root)
    result = simulate(
        t,
        t / steps,
        "rk4",
        particles=[points((0, 0, 0), mass=M1, name="a"), points((1.2, 0, 0), mass=M2, name="b")],
        springs=[
            {
                "between": ["a", "b"],
                "pairs": [[0, 0]],
                "frequency": f,
                "damping_ratio": zeta,
                "rest_length": 1.0,
            }
        ],
    )
    exact = 1 + 0.2 * math.exp(-2 * math.pi * zeta / root)
    assert length(result) == pytest.approx(exact, abs=steps * ((2 * math.pi / steps) ** 5 + 2 * EPS))


def test_a_string_goes_slack() -> None:
    # Pulled at 1 + A, a string throws its ends at each other and lets go at its rest length: from then on they fly freely,
    # at A ω towards each other, with ω = √(k/μ) reached after a quarter of the period.
    k, stretch, t, steps = 40.0, 0.1, 1.0, 4000
    omega = math.sqrt(2 * k)  # two masses of 1 kg
    result = simulate(
        t,
        t / steps,
        "velocity_verlet",
        particles=[points((0, 0, 0), (1 + stretch, 0, 0), mass=1.0, name="ends")],
        springs=[{"on": "ends", "pairs": [[0, 1]], "stiffness": k, "rest_length": 1.0, "tension_only": True}],
        output={"ledger": True},
    )
    quarter = math.pi / 2 / omega
    # One step is partly taut and partly slack: an error of A ω² h in the speed of the ends at most.
    error = stretch * omega**2 * (t / steps)
    assert length(result) == pytest.approx(1 - stretch * omega * (t - quarter), abs=error * t + error / omega)
    assert result.ledger["potential.springs"][-1] == 0


def test_a_strut_is_an_elastic_contact() -> None:
    # A ball that meets an equal one at rest hands over its speed: half a period π/ω of the contact, ω = √(2k/m), later the
    # first one rests where it is, 0.3 + ½ v π/ω, and the other one flies on. Verlet errs by (ωh)²/24 of the turn.
    k, v, h, t = 5e3, 2.0, 1e-5, 0.5
    result = simulate(
        t,
        h,
        "velocity_verlet",
        particles=[points((0, 0, 0), (0.5, 0, 0), velocity=[(v, 0, 0), (0, 0, 0)], mass=1.0, name="balls")],
        springs=[
            {"on": "balls", "pairs": [[0, 1]], "stiffness": k, "rest_length": 0.2, "compression_only": True}
        ],
        output={"ledger": True},
    )
    contact = math.pi / math.sqrt(2 * k)
    # Where the contact begins and ends inside a step, the speeds err by k h²/2 of the depth that v h reaches.
    error = 10 * k * h**2 * v
    assert result.final.velocity[:, 0] == pytest.approx([0, v], abs=error)
    assert result.final.position[:, 0] == pytest.approx(
        [0.3 + v * contact / 2, 0.5 + v * (t - 0.15 - contact / 2)], abs=error * t
    )
    assert result.ledger["potential.springs"][-1] == 0


@pytest.mark.parametrize("other", [{"tension_only": True}, {"break_strain": 0.1}, {"break_force": 1.0}])
def test_a_strut_neither_pulls_nor_breaks(other: dict[str, float]) -> None:
    springs = {"on": "ends", "pairs": [[0, 1]], "stiffness": 1.0, "compression_only": True, **other}
    with pytest.raises(ps.ScenarioError, match="a strut"):
        simulate(0.1, 0.1, particles=[points((0, 0, 0), (1, 0, 0), name="ends")], springs=[springs])


@pytest.mark.parametrize(
    "limit", [{"break_strain": 0.5}, {"break_force": 10.0}, {"break_strain": 0.5, "break_force": 1e9}]
)
def test_a_spring_breaks_where_it_should_and_never_heals(limit: dict[str, float]) -> None:
    # Drawn apart at a constant speed (the ends are heavy), from l = 1: strain 0.5, and with k = 20 N/m the pull 10 N, are
    # both reached at t = 0.5 s. The broken spring lets go; brought back by nothing, the ends keep their speed.
    heavy, k = 1e9, 20.0

    def pulled(t: float) -> ps.Result:
        return simulate(
            t,
            0.01,
            particles=[
                points((0, 0, 0), (1, 0, 0), velocity=[(0, 0, 0), (1, 0, 0)], mass=heavy, name="ends"),
            ],
            springs=[{"name": "thread", "on": "ends", "pairs": [[0, 1]], "stiffness": k, **limit}],
            output={"ledger": True, "every": 1},
        )

    assert pulled(0.49).broken == {"thread": (0, 1)}
    after = pulled(0.8)
    assert after.broken == {"thread": (1, 1)}
    stored = after.ledger["potential.thread"]
    stretch = after.times
    assert stored[:50] == pytest.approx(0.5 * k * stretch[:50] ** 2, rel=1e-6)
    assert not stored[52:].any()


def test_a_broken_spring_stays_broken_when_its_ends_come_back() -> None:
    result = simulate(
        2.0,
        0.005,
        particles=[
            points((0, 0, 0), mass=1.0, pinned=True, name="hook"),
            points((1, 0, 0), velocity=[(4, 0, 0)], mass=1.0, name="ball"),
        ],
        springs=[
            {
                "name": "thread",
                "between": ["hook", "ball"],
                "pairs": [[0, 0]],
                "stiffness": 1.0,
                "break_strain": 0.2,
            },
            {"name": "rubber", "between": ["hook", "ball"], "pairs": [[0, 0]], "stiffness": 50.0},
        ],
        output={"ledger": True, "every": 1},
    )
    x = result.times
    assert result.broken == {"thread": (1, 1)}
    broken = int(np.flatnonzero(result.ledger["potential.thread"] == 0)[1])  # the first is the start
    assert x[broken] < 0.1
    assert not result.ledger["potential.thread"][broken:].any()
    assert result.ledger["potential.rubber"][broken:].max() > 1


def test_coincident_ends_feel_nothing() -> None:
    for kind in ({}, {"tension_only": True}, {"compression_only": True}, {"damping": 2.0}):
        result = simulate(
            0.1,
            0.01,
            particles=[points((1, 2, 3), (1, 2, 3), mass=1.0, name="ends")],
            springs=[{"on": "ends", "pairs": [[0, 1]], "stiffness": 50.0, "rest_length": 0.0, **kind}],
        )
        assert result.final.position.tolist() == [[1, 2, 3], [1, 2, 3]]


def test_springs_join_all_that_are_near() -> None:
    # A lattice of 3 × 3 × 3 with spacing 1: 54 edges, 72 face diagonals (√2), 32 space diagonals (√3).
    lattice = {"layout": {"type": "lattice", "counts": [3, 3, 3], "spacing": 1.0}, "name": "block"}
    for within, number in ((1.1, 54), (1.5, 126), (1.8, 158)):
        result = simulate(
            0.1,
            0.1,
            particles=[lattice],
            springs=[{"on": "block", "within": within, "stiffness": 1.0, "break_force": 1.0}],
        )
        assert result.broken == {"springs": (0, number)}
    between = simulate(
        0.1,
        0.1,
        particles=[lattice, points((0, 0, 0.25), name="probe")],
        springs=[{"between": ["block", "probe"], "within": 1.04, "stiffness": 1.0, "break_force": 1.0}],
    )
    assert between.broken == {"springs": (0, 4)}  # below, above at 0.75, and two sides at √(1 + 1/16)


def test_a_hanging_mass_stretches_its_spring() -> None:
    # At rest: k (l − L₀) = m g. Critical damping brings it there: after 20 time constants e^(−20)(1 + 20) of m g/k is left.
    k, m, rest = 50.0, 2.0, 0.5
    omega = math.sqrt(k / m)
    t = 20 / omega
    result = simulate(
        t,
        t / 4000,
        "rk4",
        particles=[points((0, 0, 0), (0, -rest, 0), mass=m, pinned=[0], name="line")],
        springs=[{"on": "line", "pairs": [[0, 1]], "stiffness": k, "damping_ratio": 1.0}],
        forces=[{"type": "gravity"}],
    )
    assert length(result) == pytest.approx(rest + m * G / k, abs=m * G / k * 21 * math.exp(-20) * 1.01)


@pytest.mark.parametrize(
    ("spring", "message"),
    [
        ({"stiffness": -1.0}, "at least 0"),
        ({"stiffness": 1.0, "frequency": 2.0}, "stiffness or the frequency"),
        ({}, "stiffness or the frequency"),
        ({"stiffness": 1.0, "damping": 1.0, "damping_ratio": 0.1}, "damping is given already"),
        ({"stiffness": 1.0, "break_strain": 0.1, "rest_length": 0.0}, "rest length greater than 0"),
        ({"stiffness": 1.0, "within": 0.1}, "pairs are listed already"),
        ({"stiffness": 1.0, "pairs": None, "within": 0.0}, "springs.0.within"),
        ({"stiffness": 1.0, "pairs": [[0, 5]]}, "has no particle 5"),
        ({"stiffness": 1.0, "pairs": [[0, 1], [1, 0]]}, "already joined"),
        ({"stiffness": 1.0, "pairs": [[1, 1]]}, "to itself"),
        ({"stiffness": 1.0, "pairs": None}, "which particles are joined"),
        ({"stiffness": 1.0, "pairs": None, "within": 0.1}, "no two particles are within"),
    ],
)
def test_springs_that_cannot_be(spring: dict[str, Any], message: str) -> None:
    entry = {"on": "ends", "pairs": [[0, 1]], **spring}
    with pytest.raises(ps.UsageError, match=message):
        simulate(
            0.1,
            0.1,
            particles=[points((0, 0, 0), (1, 0, 0), name="ends")],
            springs=[{k: v for k, v in entry.items() if v is not None}],
        )


def test_what_only_places_tell_has_its_place_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "far.toml"
    file.write_text(
        "[simulation]\nduration = 0.1\ndt = 0.1\n"
        '[[particles]]\nname = "ends"\n[particles.layout]\ntype = "points"\nposition = [[0, 0, 0], [1, 0, 0]]\n'
        '[[springs]]\non = "ends"\nwithin = 0.5\nstiffness = 1.0\n'
    )
    with pytest.raises(ps.ScenarioError, match="no two particles are within") as caught:
        ps.run(ps.load(file))
    assert f"{file}:9:1" in str(caught.value)
    assert caught.value.exit_code == 2
    with pytest.raises(ps.ScenarioError, match="so far out"):  # 1e300² is no number
        ps.run(ps.load(file, {"particles.ends.layout.position": [[0, 0, 0], [1e300, 0, 0]]}))


def test_damped_springs_need_inertia() -> None:
    grains = points((0, 0, 0), (1, 0, 0), name="grains", dynamics={"type": "first_order", "drag": 1.0})
    with pytest.raises(ps.UsageError, match="has no inertia"):
        simulate(
            0.1,
            0.1,
            "heun",
            particles=[grains],
            springs=[{"on": "grains", "pairs": [[0, 1]], "frequency": 1.0}],
        )


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet", "stormer_verlet", "rk4"])
def test_what_lies_on_a_floor_swings_along_it_as_if_it_flew(method: str) -> None:
    # h ω = 1, half of the largest stable step: a step that is followed along another way than the method's multiplies the
    # swing by √(1 + h² ω²/2)
    h = 1 / OMEGA
    two = {
        "particles": [points((0, 0, 0), (REST + STRETCH, 0, 0), mass=[M1, M2], name="two")],
        "springs": [{"on": "two", "pairs": [[0, 1]], "stiffness": K, "rest_length": REST}],
    }
    flying, _ = way(1, 100 * h, h, method, **two)
    floor = {"forces": [{"type": "gravity"}], "planes": [{"name": "floor", "restitution": 0.5}]}
    lying, _ = way(1, 100 * h, h, method, **two, **floor)
    assert np.abs(lying - flying).max() < 1e-11  # rounding of a hundred steps
