"""Contact through the block kernel: nothing sinks, nothing gains energy, and the bits do not depend on blocks or intervals.

Planes here are general ones, three continuous and two discrete, so that few programs are compiled; unused ones stand far
away.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support import careful, clock, position, program, run, state, velocity
from support import columns as plain_columns

from particlesim.colliders.bounds import edge
from particlesim.colliders.plane import Plane, PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.colliders.response import ColliderRecord, ResponseRecord
from particlesim.engine.independent.kernel import new_room, step_range
from particlesim.engine.step.at_rest import keeps_still, rest, stay
from particlesim.engine.step.contacts import Careful, Simple
from particlesim.engine.step.following import MAX_STALLS
from particlesim.engine.step.moments import MAX_HALVINGS
from particlesim.engine.step.program import BLOCK
from particlesim.forces import Gravity
from particlesim.laws.registry import GENERICS, KILL, LEAVE, PASS, STICK, Particle, force

EPS = np.finfo(float).eps
G = 9.80665
GRAVITY = (Gravity().record(),)
NO_GRAVITY = (Gravity(acceleration=(0, 0, 0)).record(),)


def columns(position: Any, velocity: Any, **options: Any) -> Any:
    """Columns that always have a clock and a radius, so that fewer kernels are compiled."""
    return plain_columns(
        position, velocity, **{"clock": clock(len(np.atleast_2d(position))), "radius": 0.0} | options
    )


def plane(
    normal: Any, offset: float = 0.0, restitution: float = 1.0, loss: float = 0.0, outcome: int = PASS
) -> ColliderRecord:
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    response = ResponseRecord(1 + restitution, loss, 1 - loss, outcome)
    return ColliderRecord(PlaneRecord(*n.tolist(), offset), response)


ELASTIC = ResponseRecord(2.0, 0.0, 1.0, PASS)


FAR = plane((0, 1, 0), -1e9)


def continuous(*planes: ColliderRecord) -> Careful:
    return careful(continuous=[*planes, *[FAR] * (3 - len(planes))], discrete=[FAR, FAR])


def discrete(*planes: ColliderRecord) -> Careful:
    return careful(discrete=[*planes, *[FAR] * (3 - len(planes))])


def mixed(*planes: ColliderRecord) -> Careful:
    return careful(continuous=[planes[0], FAR, FAR], discrete=[*planes[1:], *[FAR] * (3 - len(planes))])


def gaps(planes: list[ColliderRecord], c: Any, radius: float) -> NDArray[Any]:
    """Smallest gap of every particle [m]."""
    normals = np.array([p.shape[:3] for p in planes])
    offsets = np.array([p.shape.offset for p in planes])
    return (position(c) @ normals.T - offsets - radius).min(axis=1)  # type: ignore[no-any-return]


# Never below, never faster


def wedge(
    rng: np.random.Generator, n: int, restitution: float, loss: float, outwards: bool
) -> list[ColliderRecord]:
    """n random planes around the origin, which lies at least 1 on their legal side."""
    planes = []
    for _ in range(n):
        normal = rng.normal(size=3)
        if outwards:
            normal[1] = abs(normal[1])  # all look upwards: no closed box
        planes.append(plane(normal, -1.0 - rng.uniform(0, 0.5), restitution, loss))
    return planes


@pytest.mark.parametrize("kind", [continuous, discrete, mixed], ids=lambda k: k.__name__)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3),
    restitution=st.sampled_from([0.0, 0.3, 0.9, 1.0]),
    loss=st.sampled_from([0.0, 0.2, 1.0]),
    speed=st.sampled_from([0.01, 1.0, 50.0, 1e4, 1e8]),
    radius=st.sampled_from([0.0, 0.1, 0.9]),
    weight=st.booleans(),
)
@settings(max_examples=40)
def test_never_below_and_never_faster(
    kind: Any,
    seed: int,
    count: int,
    restitution: float,
    loss: float,
    speed: float,
    radius: float,
    weight: bool,
) -> None:
    rng = np.random.default_rng(seed)
    planes = wedge(rng, count, restitution, loss, True)
    x = np.zeros((16, 3))
    v = rng.normal(size=(16, 3)) * speed
    c = columns(x, v, radius=radius)
    p = program("velocity_verlet", GRAVITY if weight else NO_GRAVITY, kind(*planes))
    energy = (v**2).sum(axis=1)
    for k in range(12):
        # Rounding is that of the places between which the particle moves before it is put back.
        scale = 1 + np.abs(position(c)).max(axis=1) + 0.05 * np.abs(velocity(c)).max(axis=1)
        assert not run(p, c, 1, 0.05, first_step=k).any()
        assert (gaps(planes, c, radius) >= -16 * EPS * scale).all()
        now = (velocity(c) ** 2).sum(axis=1)
        if not weight:
            assert (now <= energy * (1 + 200 * EPS)).all()
        energy = now


@pytest.mark.parametrize("kind", [continuous, discrete], ids=lambda k: k.__name__)
def test_no_tunnelling_at_any_speed(kind: Any) -> None:
    v = -(10.0 ** np.arange(0, 200, 10))
    c = columns(np.tile([0, 1.0, 0], (len(v), 1)), np.stack([0 * v, v, 0 * v], axis=1), radius=0.0)
    run(program("velocity_verlet", NO_GRAVITY, kind(plane((0, 1, 0)))), c, 3, 1.0)
    assert (c.y >= 0).all()
    assert (c.vy == -v).all()


def test_an_elastic_box_keeps_the_energy() -> None:
    # Six axis-aligned walls, at most two impacts of each pair a step; 10⁴ impacts and more.
    walls = [
        ColliderRecord(kind(side, -1.0), ELASTIC)
        for kind in (PlaneXRecord, PlaneYRecord, PlaneZRecord)
        for side in (1.0, -1.0)
    ]
    c = columns([[0.1, 0.2, 0.3]], [[3.1, 4.7, 5.9]], radius=0.05)
    before = np.abs(velocity(c))
    bounces = 0
    p = program("velocity_verlet", NO_GRAVITY, careful(continuous=walls))
    for k in range(40):
        sign = np.sign(velocity(c))
        run(p, c, 100, 0.35, first_step=100 * k)
        bounces += int((sign != np.sign(velocity(c))).sum())
    # 4000 · 0.35 s · 13.7 m/s / 1.9 m = 10⁴ impacts. An axis-aligned wall gives v − 2v = −v, exactly.
    assert bounces > 10
    np.testing.assert_array_equal(np.abs(velocity(c)), before)
    # The path unfolds to a straight line. A wall that is touched already, in a corner, is hit within 2⁻³⁰ of a step:
    # 5.9 m/s · 0.35 s · 2⁻³⁰ = 2·10⁻⁹ m each time.
    width = 1.9
    far = np.array([0.1, 0.2, 0.3]) + before[0] * 4000 * 0.35 + width / 2
    folded = np.abs((far + width) % (2 * width) - width) - width / 2
    np.testing.assert_allclose(position(c)[0], folded, rtol=0, atol=1e-8)


def test_many_impacts_in_one_step() -> None:
    # 100 m/s between walls 2 m apart: 50 impacts in 1 s, back where it began
    walls = [ColliderRecord(PlaneXRecord(side, -1.0), ELASTIC) for side in (1.0, -1.0)]
    walls += [
        ColliderRecord(kind(side, -1.0), ELASTIC)
        for kind in (PlaneYRecord, PlaneZRecord)
        for side in (1.0, -1.0)
    ]
    c = columns([[0.0, 0, 0]], [[100.0, 0, 0]], radius=0.05)
    run(program("velocity_verlet", NO_GRAVITY, careful(continuous=walls)), c, 1, 1.9)
    assert c.vx[0] == 100
    assert c.x[0] == pytest.approx(0, abs=1e-9)


def test_oblique_elastic_planes_keep_the_energy() -> None:
    # A closed tetrahedron needs four planes: three from this program and gravity's pull back to them.
    planes = [plane((math.cos(a), 0.8, math.sin(a))) for a in (0.0, 2.1, 4.2)]
    c = columns([[0.1, 1.0, 0.05]], [[0.3, 0.0, -0.2]], radius=0.0)
    energy = 0.5 * (velocity(c) ** 2).sum() + G * c.y[0]
    p = program("velocity_verlet", GRAVITY, continuous(*planes))
    for k in range(100):
        run(p, c, 50, 0.01, first_step=50 * k)
        now = 0.5 * (velocity(c) ** 2).sum() + G * c.y[0]
        assert now == pytest.approx(energy, rel=1e-9)


# Known answers


@pytest.mark.parametrize("method", ["velocity_verlet", "stormer_verlet"])
@pytest.mark.parametrize("e", [1.0, 0.8, 0.5])
def test_bounce_heights(method: str, e: float) -> None:
    # Dropped from h0, the n-th apex is e²ⁿ h0, (eⁿ⁻¹ + eⁿ) t0 after the one before, with t0 = √(2 h0/g). The step is
    # exact for constant g; each run starts its clock anew.
    h0, radius, steps = 2.0, 0.3, 137
    t0 = math.sqrt(2 * h0 / G)
    c = columns([[0, h0 + radius, 0]], [[0, 0, 0]], radius=radius, method=method, clock=clock(1))
    p = program(method, GRAVITY, continuous(plane((0, 1, 0), 0.0, e)))
    for n in range(1, 6):
        run(p, c, steps, t0 * (e ** (n - 1) + e**n) / steps)
        assert c.y[0] - radius == pytest.approx(e ** (2 * n) * h0, rel=1e-9)
        assert abs(c.vy[0]) < 1e-6


@pytest.mark.parametrize(
    ("kind", "e"), [(continuous, 0.0), (continuous, 0.5), (continuous, 1.0), (discrete, 0), (discrete, 0.5)]
)
def test_a_resting_ball_rests(kind: Any, e: float) -> None:
    c = columns([[0.3, 0.1, 0.0]], [[0, 0, 0]], radius=0.1)
    p = program("velocity_verlet", GRAVITY, kind(plane((0, 1, 0), 0.0, e)))
    h = 0.01
    for k in range(200):
        run(p, c, 1, h, first_step=k)
        # Discrete contact gives back at most e times the speed that a step of gravity adds, and no more energy than that.
        speed = 0.0 if kind is continuous else G * h
        assert abs(c.vy[0]) <= speed
        assert 0.1 * (1 - 2 * EPS) <= c.y[0] <= 0.1 * (1 + 2 * EPS) + speed * h
    assert (c.x[0], c.vx[0]) == (0.3, 0)


def test_a_bouncing_ball_comes_to_rest() -> None:
    # Zeno: infinitely many bounces until t0 (1 + e)/(1 − e) = 3 t0 for e = ½
    c = columns([[0, 1.0, 0]], [[0, 0, 0]], radius=0.0)
    p = program("velocity_verlet", GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.5)))
    run(p, c, 200, 0.01)
    assert abs(c.y[0]) < 1e-12
    assert abs(c.vy[0]) < 1e-12


def test_tangential_loss() -> None:
    # v' = (1 − k) v_t − e v_n
    c = columns([[0, 1.0, 0]], [[3.0, -2.0, 1.0]], radius=0.0)
    run(program("velocity_verlet", NO_GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.5, 0.25))), c, 1, 1.0)
    np.testing.assert_allclose(velocity(c)[0], [2.25, 1.0, 0.75], rtol=4 * EPS)
    np.testing.assert_allclose(position(c)[0], [1.5 + 2.25 / 2, 0.5, 0.5 + 0.75 / 2], rtol=8 * EPS)


# Sticking and dying


@pytest.mark.parametrize(
    ("outcome", "kind"), [(STICK, continuous), (KILL, continuous), (STICK, discrete), (KILL, discrete)]
)
def test_stick_and_kill(outcome: int, kind: Any) -> None:
    # From 1 m with −2 m/s it is there at 0.5 s.
    time = clock(2)
    c = columns([[0, 1.0, 0], [0, 50.0, 0]], [[1.0, -2.0, 0]] * 2, radius=0.0, clock=time)
    p = program("velocity_verlet", NO_GRAVITY, kind(plane((0, 1, 0), 0.0, 0.5, 0.0, outcome)))
    run(p, c, 10, 0.2)
    assert time.outcome.tolist() == [outcome, PASS]
    assert c.y[0] == pytest.approx(0, abs=4 * EPS)
    assert c.x[0] == pytest.approx(0.5 if kind is continuous else 0.6, rel=1e-12)
    assert c.x[1] == pytest.approx(2.0)
    if outcome == STICK:
        assert time.start[0] == np.inf
    else:
        assert time.stop[0] == pytest.approx(0.5 if kind is continuous else 0.6)


def test_leaving_the_bounds_counts_at_the_end_of_the_step() -> None:
    time = clock(1)
    c = columns([[0, 0, 0]], [[1.0, 0, 0]], radius=0.0, clock=time)
    run(program("velocity_verlet", NO_GRAVITY, Simple((edge((-1, -1, -1), (1, 1, 1)),))), c, 10, 0.3)
    assert time.outcome[0] == LEAVE
    assert time.stop[0] == pytest.approx(1.2)
    assert c.x[0] == pytest.approx(1.2)


def test_birth_and_death_inside_a_step() -> None:
    # moves from 0.25 s to 0.65 s
    c = columns([[0, 10.0, 0]], [[1.0, 0, 0]], radius=0.0, clock=clock(1, 0.25, 0.65))
    run(program("velocity_verlet", NO_GRAVITY, continuous()), c, 10, 0.1)
    assert c.x[0] == pytest.approx(0.4, rel=1e-12)


# The same bits


def crowd(method: str, n: int, dtype: Any = np.float64) -> Any:
    rng = np.random.default_rng(5)
    return columns(
        rng.uniform(0.5, 2, (n, 3)),
        rng.normal(size=(n, 3)) * 4,
        radius=rng.uniform(0.01, 0.1, n),
        mass=rng.uniform(1, 2, n),
        method=method,
        dtype=dtype,
        clock=clock(n, 0.03, 0.9),
    )


@pytest.mark.parametrize("method", ["velocity_verlet", "stormer_verlet"])
def test_same_bits_for_any_block_and_any_split(method: str) -> None:
    p = program(method, GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.7), plane((1, 0.2, 0), 0.0, 0.5, 0.1)))
    n, dt = 1100, 0.02
    reference = crowd(method, n)
    run(p, reference, 50, dt, block=512)
    assert (np.abs(velocity(reference) - velocity(crowd(method, n))) > 0).any(axis=1).all()
    for block in (1, 7, 64, 4096):
        c = crowd(method, n)
        run(p, c, 50, dt, block=block)
        np.testing.assert_array_equal(state(c), state(reference))
    c = crowd(method, n)
    for lo, hi in ((0, 1), (1, 500), (500, n)):
        done = 0
        for steps in (1, 3, 17, 29):
            run(p, c, steps, dt, first_step=done, first=lo, last=hi)
            done += steps
    np.testing.assert_array_equal(state(c), state(reference))


def test_single_precision() -> None:
    p = program("velocity_verlet", GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.7)), dtype=np.float32)
    p = p._replace(contacts=p.contacts._replace(tolerance=np.float32(4 * np.finfo(np.float32).eps)))
    c, fine = crowd("velocity_verlet", 64, np.float32), crowd("velocity_verlet", 64)
    run(p, c, 20, 0.02)
    run(program("velocity_verlet", GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.7))), fine, 20, 0.02)
    assert c.x.dtype == np.float32
    # 20 steps and a bounce or two: 10⁻⁵ of the speed
    np.testing.assert_allclose(state(c), state(fine), rtol=0, atol=2e-4)
    assert (c.y - c.r >= -1e-6).all()


def test_a_fault_puts_its_block_back() -> None:
    time = clock(3)
    c = columns(
        [[0, 1.0, 0], [0, 1.0, 0], [0, 1.0, 0]],
        [[0, 0, 0], [0, 0, np.nan], [0, 0, 0]],
        radius=0.0,
        clock=time,
    )
    before = state(c)
    p = program("velocity_verlet", GRAVITY, continuous(plane((0, 1, 0), 0.0, 0.5, 0.0, KILL)))
    faults = run(p, c, 100, 0.01, block=2)
    assert faults.tolist() == [True, False, False]
    np.testing.assert_array_equal(state(c)[:2], before[:2])
    assert time.outcome.tolist() == [PASS, PASS, KILL]
    assert time.stop[0] == np.inf


def test_a_fault_puts_the_memory_back() -> None:
    c = columns([[0, 1.0, 0]], [[1.0, 0, 0]], radius=0.0, method="stormer_verlet", clock=clock(1))
    p = program("stormer_verlet", GRAVITY, continuous(plane((0, 1, 0))))
    run(p, c, 3, 0.01)
    memory = [m.copy() for m in c.memory]
    c.m[0] = 0.0
    assert run(p, c, 3, 0.01, first_step=3).all()
    for now, then in zip(c.memory, memory, strict=True):
        np.testing.assert_array_equal(now, then)


class CountedRecord(NamedTuple):
    """Gravity that counts how often it is asked for."""

    number: Any


def counted(f: CountedRecord, p: Any) -> tuple[float, float, float]:
    f.number[0] += 1
    return 0.0, -G * p.m, 0.0


def test_a_ball_settles_in_a_few_impacts_far_from_the_origin(monkeypatch: pytest.MonkeyPatch) -> None:
    # Some ten hops are longer than a step. Those of its length are g h²/8 high, and each is a quarter as high as the one
    # before: after log₄(g h²/8 / slack) ≈ 14 they are below rounding. The search for an impact ends after MAX_HALVINGS tries
    # of two evaluations at most, and a step takes six with its traces.
    monkeypatch.setitem(GENERICS[force].laws, CountedRecord, counted)
    dt, steps, height = 2e-3, 100, 1e-3
    c = columns([[0, -5 + height, 0]], [[0, 0, 0]])
    asked = np.zeros(1, np.int64)
    floor = continuous(plane((0, 1, 0), -5.0, restitution=0.5))
    counting = program("velocity_verlet", (CountedRecord(asked),), floor)
    step_range(counting, c, 0, steps, dt, 0, 1, BLOCK, np.zeros(1, np.bool_), new_room(c, BLOCK))
    assert c.y[0] == pytest.approx(-5, abs=1e-14)
    assert c.vy[0] == 0
    assert asked[0] < 6 * steps + (10 + 14 + MAX_STALLS) * 2 * MAX_HALVINGS


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_quick_look_at_what_lies_still_finds_the_bits_of_the_long_one(friction: float) -> None:
    # Three walls, the last twice; of what lies on one of them, in a corner, off them or moves, at radii of both kinds.
    walls = [
        Plane(normal=n, point=p, friction=friction, restitution=e)
        for n, p, e in (
            ((0, 1, 0), (0, 0.3, 0), 0.5),
            ((-1, 0, 0), (2, 0, 0), 1.0),
            ((0, 0, 1), (0, 0, 0), 0.0),
        )
    ]
    contacts = careful([each.record() for each in (*walls, walls[-1])], tolerance=16 * EPS)
    assert keeps_still(contacts)
    assert not keeps_still(contacts._replace(discrete=(walls[0].record(),)))
    rng, h, found = np.random.default_rng(1), 1e-3, 0
    for _ in range(600):
        r = float(rng.choice([0.0, 0.1]))
        x = np.where(rng.random(3) < 0.5, (2 - r, 0.3 + r, r), rng.uniform(0.5, 1.5, 3))
        x *= 1 + EPS * rng.integers(-1, 2)
        v = rng.normal(size=3) * rng.integers(0, 2, 3) * rng.choice([0, 0, 1e-4, 1])
        a = rng.normal(size=3) * rng.choice([0.0, 1e-9, 10.0], 3)
        p = Particle(*x.tolist(), *v.tolist(), 1.0, r, 0.0, 0.0, 1.0)
        q = p._replace(
            **dict(
                zip(["x", "y", "z", "vx", "vy", "vz"], [*(x + h * v + h * h * a), *(v + h * a)], strict=True)
            )
        )
        quick, still = stay(contacts, p, q, h)
        if still:
            found += 1
            assert rest(contacts, p, q, h) == (quick, True)
    assert found > 20
