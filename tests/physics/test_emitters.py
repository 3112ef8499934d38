"""Births and deaths: how many, when, where, how fast, and of what."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from simulate import EPS, record, simulate

import particlesim as ps
from particlesim.preflight.resources import BIRTH_MEMORY, EVENT_BYTES, needs

ORIGIN = {"type": "point", "position": [0, 0, 0]}
SIGNIFICANT = 1e-3
"""Seeds are fixed, so these tests cannot fail by chance from run to run; a wrong distribution of thousands of particles
has a p-value of zero."""


def emit(
    duration: float = 1.0, dt: float = 0.1, seed: int = 1, output: Any = None, **emitter: Any
) -> ps.Result:
    """Run one emitter of free particles in memory."""
    emitter = {"shape": ORIGIN, **emitter}
    return simulate(duration, dt, "symplectic_euler", emitters=[emitter], seed=seed, output=output or {})


def film(
    path: Path,
    duration: float = 1.0,
    dt: float = 0.1,
    seed: int = 1,
    beside: dict[str, Any] | None = None,
    **emitter: Any,
) -> ps.Trajectory:
    """The same into a file, with every step a frame; `beside`: what else the scenario has."""
    parts = {"emitters": [{"shape": ORIGIN, **emitter}], "seed": seed, "output": {"every": 1}}
    return record(path, duration, dt, "symplectic_euler", **parts, **(beside or {}))


def p_value(sample: NDArray[Any], distribution: Any) -> float:
    return float(stats.kstest(sample, distribution.cdf).pvalue)


@pytest.mark.parametrize(
    ("rate", "start", "stop"), [(997.0, 0.0, None), (10.0, 0.05, 0.65), (333.3, 0.3, 0.8)]
)
def test_births_come_exactly_at_the_rate(
    tmp_path: Path, rate: float, start: float, stop: float | None
) -> None:
    # Birth j is at start + j/rate, for all of them before the end of the rate or of the run.
    times = start + np.arange(2000) / rate
    expected = times[times < (1.0 if stop is None else stop)]
    limits = {} if stop is None else {"stop": stop}
    with film(tmp_path / "rate.vtkhdf", rate=rate, start=start, **limits) as trajectory:
        births = trajectory.events("birth")
        assert births["time"].tolist() == expected.tolist()
        assert births["id"].tolist() == list(range(len(expected)))
        assert trajectory.counts.tolist() == [int((expected < t).sum()) for t in trajectory.times]


def test_jittered_births_keep_to_their_intervals() -> None:
    # Birth j at (j + u_j)/rate with u_j uniform.
    result = emit(rate=2000.0, timing="jittered")
    births = 1.0 - np.sort(result.final["age"])[::-1]
    u = births * 2000 - np.arange(len(births))
    assert result.born == 2000
    assert u.min() >= -1e-9
    assert u.max() <= 1 + 1e-9
    assert p_value(u, stats.uniform()) > SIGNIFICANT


def test_bursts_come_at_their_moments_beside_the_rate(tmp_path: Path) -> None:
    bursts = [{"count": 30, "at": 0.25}, {"count": 5, "at": 0.0}]
    with film(tmp_path / "bursts.vtkhdf", rate=20.0, burst=bursts) as trajectory:
        times = trajectory.events("birth")["time"]
    expected = np.sort(np.concatenate([np.arange(20) / 20, np.full(30, 0.25), np.zeros(5)]))
    assert times.tolist() == expected.tolist()


def test_particles_born_inside_a_step_have_moved_only_since_then() -> None:
    # Without force x = v (T − birth), for any step.
    places = []
    for dt in (0.5, 0.1, 0.001):
        final = emit(dt=dt, rate=77.0, direction=[1, 2, 2], speed=3.0).final
        assert final["age"] == pytest.approx(1.0 - np.arange(77) / 77, abs=4 * EPS)
        assert final.position == pytest.approx(np.outer(final["age"], [1, 2, 2]), abs=1000 * EPS * 3)
        places.append(final.position)
    assert places[0] == pytest.approx(places[2], abs=1000 * EPS * 3)


@pytest.mark.parametrize("half_angle", [20.0, 90.0, 180.0])
def test_directions_fill_the_cone_evenly(half_angle: float) -> None:
    # Even in solid angle: cos θ uniform from cos α to 1, the azimuth uniform (Archimedes).
    axis = np.array([2.0, 1.0, -2.0]) / 3
    final = emit(burst={"count": 4000, "at": 0.0}, direction=list(axis), spread=half_angle, speed=2.0).final
    unit = final.velocity / 2.0
    assert np.linalg.norm(unit, axis=1) == pytest.approx(np.ones(4000), abs=8 * EPS)
    cosine, least = unit @ axis, math.cos(math.radians(half_angle))
    assert cosine.min() >= least - 8 * EPS
    assert p_value(cosine, stats.uniform(least, 1 - least)) > SIGNIFICANT
    across = np.cross(axis, [0.0, 1.0, 0.0])
    u = across / np.linalg.norm(across)
    azimuth = np.arctan2(unit @ np.cross(axis, u), unit @ u)
    assert p_value(azimuth, stats.uniform(-math.pi, 2 * math.pi)) > SIGNIFICANT


def test_outward_particles_leave_the_middle() -> None:
    center = np.array([1.0, 2.0, 3.0])
    final = emit(
        burst={"count": 500, "at": 0.0},
        shape={"type": "sphere", "center": list(center), "radius": 0.5},
        direction="outward",
        speed=2.0,
        velocity=[0, 0, 1.0],
    ).final
    # |x − c| = 0.5 + 2 t, beside the emitter's own velocity.
    assert np.linalg.norm(final.position - center - [0, 0, 1], axis=1) == pytest.approx(
        np.full(500, 2.5), abs=1e-14
    )


SPEEDS = {
    "uniform": ({"type": "uniform", "low": 1, "high": 4}, stats.uniform(1, 3)),
    "normal": ({"type": "normal", "mean": 5, "std": 2}, stats.norm(5, 2)),
    "cut": ({"type": "normal", "mean": 2, "std": 2, "min": 1, "max": 5}, stats.truncnorm(-0.5, 1.5, 2, 2)),
    "lognormal": ({"type": "lognormal", "median": 2, "sigma": 0.4}, stats.lognorm(0.4, scale=2)),
    "exponential": ({"type": "exponential", "mean": 3}, stats.expon(scale=3)),
}


@pytest.mark.parametrize("name", list(SPEEDS))
def test_speeds_have_their_distribution(name: str) -> None:
    given, expected = SPEEDS[name]
    velocity = emit(rate=4000.0, direction=[0, 0, 1], speed=given).final.velocity
    assert velocity[:, :2].tolist() == [[0, 0]] * 4000
    assert p_value(velocity[:, 2], expected) > SIGNIFICANT


def test_choices_come_as_often_as_their_weights() -> None:
    # Binomial: 4000 draws of p = 0.25 spread by √(4000 · 0.25 · 0.75) = 27; four times that.
    radius = emit(rate=4000.0, radius={"type": "choice", "values": [1, 2], "weights": [1, 3]}).final["radius"]
    assert set(radius.tolist()) == {1.0, 2.0}
    assert abs(int((radius == 1).sum()) - 1000) < 110


def test_density_joins_mass_and_radius() -> None:
    final = emit(rate=1000.0, radius={"type": "uniform", "low": 0.01, "high": 0.02}, density=800.0).final
    assert final["mass"] == pytest.approx(800 * 4 / 3 * math.pi * final["radius"] ** 3, rel=1e-14)


def test_different_attributes_and_seeds_are_independent() -> None:
    def draws(seed: int) -> tuple[NDArray[Any], NDArray[Any]]:
        even = {"type": "uniform", "low": 0.5, "high": 1.5}
        final = emit(seed=seed, rate=3000.0, direction=[0, 0, 1], speed=even, radius=even).final
        return final.velocity[:, 2], final["radius"]

    (speed, radius), (other, _) = draws(1), draws(2)
    assert abs(np.corrcoef(speed, radius)[0, 1]) < 4 / math.sqrt(3000)
    assert abs(np.corrcoef(speed, other)[0, 1]) < 4 / math.sqrt(3000)
    assert draws(1)[0].tobytes() == speed.tobytes()


def test_lifetimes_have_their_distribution_and_end_to_the_moment(tmp_path: Path) -> None:
    life = {"type": "uniform", "low": 0.1, "high": 0.4}
    with film(
        tmp_path / "life.vtkhdf", duration=1.0, dt=0.05, rate=4000.0, stop=0.5, lifetime=life
    ) as trajectory:
        births, deaths = trajectory.events("birth"), trajectory.events("death")
        assert set(deaths["cause"]) == {"age"}
        assert sorted(deaths["id"].tolist()) == births["id"].tolist()
        deaths_at = deaths["time"][np.argsort(deaths["id"])]
        assert p_value(deaths_at - births["time"], stats.uniform(0.1, 0.3)) > SIGNIFICANT
        for frame in trajectory:
            alive = (births["time"] < frame.time) & (deaths_at > frame.time)
            assert frame.id.tolist() == births["id"][alive].tolist()


def test_at_the_limit_the_oldest_make_room(tmp_path: Path) -> None:
    # Never more than the limit alive; those there are the newest; each dies in the moment its successor is born.
    limit = 25
    with film(tmp_path / "limit.vtkhdf", rate=300.0, limit=limit) as trajectory:
        births, deaths = trajectory.events("birth"), trajectory.events("death")
        assert trajectory.counts.max() == limit
        for frame in trajectory:
            born = int((births["time"] < frame.time).sum())
            assert frame.id.tolist() == list(range(max(born - limit, 0), born))
    assert set(deaths["cause"]) == {"recycled"}
    assert deaths["id"].tolist() == list(range(300 - limit))
    assert deaths["time"].tolist() == births["time"][limit:].tolist()


def test_at_the_limit_births_may_wait(tmp_path: Path) -> None:
    # Four live for 0.3 s each: never more than four, nobody dies early, and no place stays empty for a whole step.
    with film(
        tmp_path / "wait.vtkhdf", dt=0.01, rate=100.0, limit=4, when_full="wait", lifetime=0.3
    ) as trajectory:
        births, deaths = trajectory.events("birth"), trajectory.events("death")
        assert trajectory.counts.max() == 4
        assert trajectory.counts[5:].min() >= 3
    assert set(deaths["cause"]) == {"age"}
    assert deaths["time"] - births["time"][: len(deaths["time"])] == pytest.approx(
        np.full(len(deaths["time"]), 0.3)
    )
    assert len(births["time"]) >= 12


def test_particles_cool_by_newton_and_die_of_cold(tmp_path: Path) -> None:
    # T = T_a + (T₀ − T_a) e^(−kt): dead when it passes T_d, at ln((T₀ − T_a)/(T_d − T_a))/k.
    hot, cold, ambient, rate = 1200.0, 600.0, 300.0, 2.0
    life = math.log((hot - ambient) / (cold - ambient)) / rate
    with film(
        tmp_path / "cold.vtkhdf",
        rate=50.0,
        stop=0.3,
        temperature=hot,
        cooling={"rate": rate, "ambient": ambient},
        die={"temperature_below": cold},
    ) as trajectory:
        births, deaths = trajectory.events("birth"), trajectory.events("death")
        assert set(deaths["cause"]) == {"cold"}
        assert deaths["time"] == pytest.approx(births["time"][: len(deaths["time"])] + life, abs=4 * EPS)
        assert len(deaths["time"]) == int((births["time"] + life <= 1.0).sum())
        frame = trajectory[3]
        ages = frame.time - births["time"][frame.id]
        assert frame["temperature"] == pytest.approx(
            ambient + (hot - ambient) * np.exp(-rate * ages), rel=1e-12
        )


FAR = {
    "interactions": [{"type": "contact"}],
    "colliders": [{"type": "sphere", "center": [0, 5, 0], "radius": 1, "detection": "discrete"}],
}


@pytest.mark.parametrize("beside", [{}, FAR], ids=["alone", "with what it may touch"])
def test_particles_die_outside_of_their_box(tmp_path: Path, beside: dict[str, Any]) -> None:
    # At 1 m/s along x out of a box that ends at 0.42 m: dead by the end of the step in which they leave.
    with film(
        tmp_path / "box.vtkhdf",
        dt=0.05,
        beside=beside,
        radius=1e-9,
        burst={"count": 3, "at": 0.1},
        direction=[1, 0, 0],
        speed=1.0,
        die={"outside": [[-1, -1, -1], [0.42, 1, 1]]},
    ) as trajectory:
        deaths = trajectory.events("death")
        assert deaths["cause"].tolist() == ["outside"] * 3
        assert np.all((deaths["time"] >= 0.52 - EPS) & (deaths["time"] <= 0.55 + EPS))
        assert all(frame.position[:, 0].max(initial=0.0) <= 0.42 for frame in trajectory)


def test_what_is_born_between_frames_is_counted_as_memory_and_work() -> None:
    # 1000 births/s for 1 s with a frame every 0.1 s: at most 10 alive, but 100 in memory, in each of 1000 steps.
    emitter = {"shape": ORIGIN, "rate": 1000.0, "limit": 10}
    table = {
        "simulation": {"duration": 1.0, "dt": 1e-3},
        "output": {"interval": 0.1, "compression": "none"},
        "emitters": [emitter],
    }
    some, more = (
        needs(ps.from_table(table)),
        needs(ps.from_table(table | {"emitters": [emitter | {"rate": 1e6}]})),
    )
    assert (some.particles, some.births) == (10, 1000)
    assert some.particle_steps == pytest.approx(1000 * 110, rel=0.1)
    assert more.memory - some.memory > 1e5 * BIRTH_MEMORY
    assert more.disk - some.disk == 2 * EVENT_BYTES * (more.births - some.births)
