"""What every registered shape must hold to: a gap that is a signed distance, a normal that is its gradient, a response that
gains no energy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pytest
from contract.cases import COLLIDER_CASES, particles
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from particlesim.colliders import COLLIDERS, AnyCollider, Collider
from particlesim.laws.registry import Particle, contact, gap, has_law, moved_to, normal, passing
from particlesim.model.base import field_docs

EPS = np.finfo(float).eps
PARTICLES = particles(24)
CASES = pytest.mark.parametrize("collider", COLLIDER_CASES.values(), ids=COLLIDER_CASES.keys())


def vector(n: Any) -> NDArray[np.float64]:
    """A normal with the zeros that it leaves out."""
    return np.array([part or 0.0 for part in n])


def moved(p: Particle, x: NDArray[np.float64]) -> Particle:
    return moved_to(p, *(p[k] + x[k] for k in range(3)), p.vx, p.vy, p.vz, p.t)  # type: ignore[misc]


def test_every_shape_has_a_case_and_a_place_in_the_scenario() -> None:
    assert {type(collider) for collider in COLLIDER_CASES.values()} == set(COLLIDERS)
    assert set(get_args(get_args(AnyCollider)[0])) == set(COLLIDERS)


@pytest.mark.parametrize("model", COLLIDERS, ids=lambda m: m.__name__)
def test_every_shape_is_documented(model: type[Collider]) -> None:
    docs = field_docs(model)
    assert model.__doc__
    assert [name for name in model.model_fields if name != "type" and not docs.get(name)] == []


@CASES
def test_the_normal_is_the_gradient_of_the_gap_and_a_unit_vector(collider: Collider) -> None:
    shape, h = collider.shape(), 1e-5
    for p in PARTICLES:
        n = vector(normal(shape, p))
        assert np.linalg.norm(n) == pytest.approx(1, abs=8 * EPS)
        slope = [
            (gap(shape, moved(p, h * axis)) - gap(shape, moved(p, -h * axis))) / (2 * h) for axis in np.eye(3)
        ]
        np.testing.assert_allclose(slope, n, atol=1e-8)  # h²/d² of a curved shape, and EPS/h


@CASES
def test_the_radius_of_a_particle_is_a_part_of_the_gap(collider: Collider) -> None:
    shape = collider.shape()
    for p in PARTICLES:
        assert gap(shape, p._replace(r=p.r + 0.125)) == pytest.approx(gap(shape, p) - 0.125, abs=8 * EPS)


@CASES
def test_contact_puts_what_overlaps_on_the_surface_along_the_normal(collider: Collider) -> None:
    record, outcome = collider.record(), collider.record().response.outcome
    for p in PARTICLES:
        q, what = contact(record, p)
        depth = -gap(record.shape, p)
        if depth < 0:
            assert (q, what) == (p, 0)
            continue
        assert what == outcome
        assert gap(record.shape, q) == pytest.approx(0, abs=16 * EPS)
        np.testing.assert_allclose(
            np.array(q[:3]) - p[:3], depth * vector(normal(record.shape, p)), atol=32 * EPS
        )


@CASES
@given(
    seed=st.integers(0, 2**32 - 1), restitution=st.floats(0, 1), loss=st.floats(0, 1), speed=st.floats(0, 1e6)
)
@settings(max_examples=30)
def test_the_response_is_that_of_the_law_and_gains_no_energy(
    collider: Collider, seed: int, restitution: float, loss: float, speed: float
) -> None:
    values = {"contact": "bounce", "restitution": restitution, "tangential_loss": loss}
    record = collider.model_copy(update=values).record()
    rng = np.random.default_rng(seed)
    v = speed * rng.normal(size=3)
    p = Particle(*rng.uniform(-1.5, 1.5, 3), *v, 1.0, 0.1, 0.0, 0.0)
    q, _ = contact(record, p)
    n = vector(normal(record.shape, p))
    across = (v @ n) * n
    bounced = gap(record.shape, p) < 0 and v @ n < 0
    expected = -restitution * across + (1 - loss) * (v - across) if bounced else v
    np.testing.assert_allclose(q[3:6], expected, atol=16 * EPS * np.linalg.norm(v))
    assert np.linalg.norm(q[3:6]) <= np.linalg.norm(v) * (1 + 8 * EPS)


@CASES
def test_a_way_comes_nearest_to_a_shape_where_it_says(collider: Collider) -> None:
    # A shape without this law must have no dents to speak of: a way between two legal places stays legal.
    shape = collider.shape()
    for p, q in pairwise(PARTICLES):
        q = q._replace(r=p.r)
        s = np.linspace(0, 1, 201)
        step = np.subtract(q[:3], p[:3])
        gaps = np.array([gap(shape, moved(p, k * step)) for k in s])
        if has_law(passing, shape):
            there = gap(shape, moved(p, passing(shape, p, q) * step))
            assert there <= gaps.min() + 4 * EPS
        else:
            assert gaps.min() >= min(gaps[0], gaps[-1]) - 16 * EPS


def test_in_the_centre_of_a_ball_the_way_out_is_upwards() -> None:
    record = COLLIDER_CASES["sphere"].record()
    p = Particle(0.1, -0.2, 0.3, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    q, _ = contact(record, p)
    assert q[:3] == pytest.approx((0.1, -0.2 + 0.9, 0.3))
