"""Grains whose radii differ ten times: impacts, a large one on small ones, and many against sums over all pairs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import G, points, simulate

SMALL, LARGE = 0.01, 0.1
LIGHT, HEAVY = 1e-3, 1.0
LINEAR = {"type": "contact", "model": "linear", "stiffness": 1e4}
HERTZ = {"type": "contact", "model": "hertz", "young_modulus": "10 MPa", "poisson_ratio": 0.25}
IMPULSE = {"type": "contact", "model": "impulse"}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("e", [1.0, 0.4])
@pytest.mark.parametrize("law", [LINEAR, HERTZ, IMPULSE], ids=lambda law: law["model"])
def test_impacts_of_grains_ten_times_as_large(law: dict[str, Any], e: float) -> None:
    # Head on with w = v − u: v' = V − e w M/(m + M) and u' = V + e w m/(m + M), V of the centre of mass; momentum is kept.
    v, u = 2.0, -1.0
    group = points(
        (-SMALL - LARGE - 2e-3, 0, 0),
        (0, 0, 0),
        velocity=[(v, 0, 0), (u, 0, 0)],
        mass=[LIGHT, HEAVY],
        radius=[SMALL, LARGE],
    )
    dt = 1e-3 if law is IMPULSE else 2e-6
    result = simulate(0.01, dt, particles=[group], interactions=[{**law, "restitution": e}])
    middle = (LIGHT * v + HEAVY * u) / (LIGHT + HEAVY)
    expected = [
        middle - e * HEAVY / (LIGHT + HEAVY) * (v - u),
        middle + e * LIGHT / (LIGHT + HEAVY) * (v - u),
    ]
    found = result.final.velocity[:, 0]
    # the end of a soft contact falls between two steps
    assert found[0] == pytest.approx(expected[0], abs=1e-12 if law is IMPULSE else 3e-3 * (v - u))
    assert LIGHT * found[0] + HEAVY * found[1] == pytest.approx(LIGHT * v + HEAVY * u, abs=1e-13)


@pytest.mark.parametrize("law", [LINEAR, HERTZ, IMPULSE], ids=lambda law: law["model"])
def test_a_large_grain_rests_on_four_small_ones(law: dict[str, Any]) -> None:
    # Over the hole of a square lattice with spacing a, whose corners are a/√2 away: (y − r)² = (R + r − d)² − a²/2, as
    # deep as 4 F(d) cos θ = m g says, for F = k d or Hertz's 4/3 E* √R* d^(3/2). The next ones are out of reach.
    side, a, m = 8, 2.2 * SMALL, 0.1
    places = [
        ((i + 0.5) * a, SMALL, (j + 0.5) * a)
        for i in range(-side // 2, side // 2)
        for j in range(-side // 2, side // 2)
    ]
    across, deep = a / math.sqrt(2), 0.0
    stiff = 4 / 3 * 1e7 / 2 / (1 - 0.25**2) * math.sqrt(SMALL * LARGE / (SMALL + LARGE))
    for _ in range(30):
        reach = SMALL + LARGE - deep
        load = m * G / 4 * reach / math.sqrt(reach**2 - across**2)
        deep = {"linear": load / 1e4, "hertz": (load / stiff) ** (2 / 3), "impulse": 0.0}[law["model"]]
    height = SMALL + math.sqrt((SMALL + LARGE - deep) ** 2 - across**2)
    floor = points(*places, name="floor", radius=SMALL, mass=LIGHT)
    floor["pinned"] = list(range(len(places)))
    ball = points((0, height + 2e-4, 0), name="ball", radius=LARGE, mass=m)
    result = simulate(
        0.2,
        1e-3 if law is IMPULSE else 5e-5,
        particles=[floor, ball],
        interactions=[{**law, "restitution": 0.1}],
        forces=[{"type": "gravity", "on": ["ball"]}],
    )
    assert result.final.position[-1] == pytest.approx([0, height, 0], abs=3e-5 if law is IMPULSE else 2e-6)
    assert np.abs(result.final.velocity[-1]).max() < 1e-3


def test_many_sizes_move_as_sums_over_all_pairs_say() -> None:
    # Velocity Verlet with k d along the line of centres, over all pairs in NumPy: no list of neighbours is made there.
    rng, k, dt, steps = np.random.default_rng(3), 1e4, 2e-5, 1800
    place = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3)
    x = 0.074 * place + rng.uniform(-0.002, 0.002, (64, 3))
    r = np.where(np.arange(64) % 4 == 0, rng.uniform(0.5, 1, 64) * LARGE / 2, SMALL / 2)
    r[place.sum(axis=1) % 2 == 1] = SMALL / 2
    m, v = HEAVY * (r / LARGE) ** 3, rng.normal(size=(64, 3)) * 3
    grains = points(*x.tolist(), velocity=v.tolist(), radius=r.tolist(), mass=m.tolist())
    law = {**LINEAR, "restitution": 1.0}
    final = simulate(steps * dt, dt, particles=[grains], interactions=[law]).final

    def pushes(x: NDArray[np.float64]) -> NDArray[np.float64]:
        way = x[:, None] - x
        distance = np.sqrt((way**2).sum(axis=2)) + np.eye(len(x))
        deep = np.maximum(r[:, None] + r - distance, 0) * (1 - np.eye(len(x)))
        met.update(zip(*np.nonzero(deep), strict=True))
        return (k * deep / distance)[:, :, None] * way

    met: set[tuple[int, int]] = set()
    given = pushes(x).sum(axis=1) / m[:, None]
    assert not met
    for _ in range(steps):
        v = v + 0.5 * dt * given
        x = x + dt * v
        given = pushes(x).sum(axis=1) / m[:, None]
        v = v + 0.5 * dt * given
    assert len(met) > 25
    assert any(max(r[i], r[j]) > 8 * min(r[i], r[j]) for i, j in met)
    assert np.abs(final.position - x).max() < 1e-9
