"""What every registered shape must hold to: a gap that is a signed distance, a normal that is its gradient, a response that
gains no energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from contract.cases import COLLIDER_CASES, particles
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from particlesim.colliders import COLLIDERS, COMPONENTS, SOLIDS, Collider
from particlesim.colliders.combination import Combination, Difference, Intersection
from particlesim.colliders.distance_grid import DistanceGrid
from particlesim.colliders.formula import Formula
from particlesim.colliders.mesh import Mesh
from particlesim.colliders.pose import seen_from
from particlesim.colliders.rectangle import Sheet
from particlesim.colliders.solid import Solid
from particlesim.colliders.way import place_on, way_of
from particlesim.compiler import kernel
from particlesim.laws.registry import Particle, apart, contact, first_contact, gap, has_law, moved_to, normal
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


def test_every_solid_can_be_put_together_with_others() -> None:
    others = (Combination, Sheet)
    whole = {model for model in COLLIDERS if issubclass(model, Solid) and not issubclass(model, others)}
    assert {solid.kind for solid in SOLIDS} == {"plane", *(model.kind for model in whole)}
    assert all(any(issubclass(model, solid) for solid in SOLIDS) for model in whole)
    together = {model.kind for model in COLLIDERS if issubclass(model, Combination)}
    assert {part.kind for part in COMPONENTS} == together | {solid.kind for solid in SOLIDS}


@pytest.mark.parametrize("model", COLLIDERS, ids=lambda m: m.__name__)
def test_every_shape_is_documented(model: type[Collider]) -> None:
    docs = field_docs(model)
    assert model.__doc__
    assert [name for name in model.model_fields if name != "type" and not docs.get(name)] == []


def near_by(collider: Collider) -> list[Particle]:
    """Particles anywhere; those of a level set near its surface, as its gap is a mere bound of the distance elsewhere."""
    if not isinstance(collider, Formula | DistanceGrid):
        return PARTICLES
    corners = collider.triangles().corners
    some = PARTICLES[::3]  # a search for each gap takes long in plain Python
    rng = np.random.default_rng(5)
    places = corners[rng.integers(0, len(corners), len(some))]
    places = places + rng.uniform(-0.05, 0.05, places.shape)
    return [p._replace(x=x, y=y, z=z) for p, (x, y, z) in zip(some, places, strict=True)]


def smooth(collider: Collider, p: Particle) -> bool:
    """Whether the gap is smooth about a particle: near an edge, or as far from two faces, its normal jumps."""
    shape, n = collider.shape(), vector(normal(collider.shape(), p))
    around = [vector(normal(shape, moved(p, side * 3e-3 * axis))) for axis in np.eye(3) for side in (-1, 1)]
    return all(np.linalg.norm(n - m) < 0.1 for m in around)


@CASES
def test_the_normal_is_the_gradient_of_the_gap_and_a_unit_vector(collider: Collider) -> None:
    shape, h = collider.shape(), 1e-5
    found, looked = 0, near_by(collider)
    for p in looked:
        n = vector(normal(shape, p))
        assert np.linalg.norm(n) == pytest.approx(1, abs=16 * EPS)
        if smooth(collider, p):
            slope = [
                (gap(shape, moved(p, h * axis)) - gap(shape, moved(p, -h * axis))) / (2 * h)
                for axis in np.eye(3)
            ]
            found += 1
            # h² times the third derivative of a curved gap, 1/d² at a distance d of 0.05 and more; and EPS/h
            np.testing.assert_allclose(slope, n, atol=5e-8)
    assert found > len(looked) // 2


@CASES
def test_the_gap_is_the_distance_to_the_surface(collider: Collider) -> None:
    # From the triangles of its picture, which deviate from round surfaces by no more than R (1 − cos(π/96)) = 5·10⁻⁴ R, and
    # from a sheet by its round edges.
    if not isinstance(collider, Solid):
        return
    shape, surface = collider.shape(), collider.triangles()
    a, b, c = surface.corners[surface.faces].transpose(1, 0, 2)
    near = 1e-3 * np.ptp(surface.corners, axis=0).max() + (getattr(collider, "thickness", 0.0) or 0.0)
    # outside of these, and far from level sets, the gap is a lower bound
    level = isinstance(collider, Formula | DistanceGrid)
    near *= 3 if level else 1  # the egg has 20 samples across
    cut = isinstance(collider, Intersection | Difference) or level
    sheet = isinstance(collider, Mesh) and collider.thickness is not None
    for p in PARTICLES:
        place = np.array(p[:3])
        distance = distance_to_triangles(place, a, b, c).min()
        g = abs(gap(shape, p._replace(r=0.0)))
        assert g <= distance + near
        assert cut or g == pytest.approx(distance, abs=near)
        # a foot is found up to half a radius of curvature, but not beyond the faces of the box
        assert not level or distance > 0.1 or g == pytest.approx(distance, abs=near) or at_faces(collider, p)
        # cuts leave gaps of a 128th of a part, which are large from near by
        if distance > (0.05 if cut else 2 * near) and not sheet:
            free = gap(shape, p._replace(r=0.0)) > 0
            within = free == getattr(collider, "inside", False)
            assert solid_angles(place, a, b, c).sum() / (4 * np.pi) == pytest.approx(
                float(within),
                abs=4e-2 if cut else 1e-6,  # cuts leave small gaps
            )


def at_faces(collider: Any, p: Particle) -> bool:
    """Whether a place is near the faces of a level set's box, or outside of it."""
    record = collider.shape()
    places = np.array([p[k] for k in range(3)])
    low, high = np.asarray(record.shape.low), np.asarray(record.shape.high)
    local = np.array(seen_from(record, p)[:3])
    return bool((local < low + 0.15).any() or (local > high - 0.15).any()) and places.size == 3


def dots(a: Any, b: Any) -> Any:
    return np.einsum("ij,ij->i", a, b)


def distance_to_triangles(p: Any, a: Any, b: Any, c: Any) -> Any:
    """Distances of a point to triangles, from the feet on their planes and on their edges, shape [n]."""
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1)[:, None]
    height = dots(p - a, n)
    foot = p - height[:, None] * n
    inside, edges = True, np.inf
    for u, v in ((a, b), (b, c), (c, a)):
        inside &= dots(np.cross(v - u, foot - u), n) >= 0
        t = np.clip(dots(p - u, v - u) / dots(v - u, v - u), 0, 1)
        edges = np.minimum(edges, np.linalg.norm(p - u - t[:, None] * (v - u), axis=1))
    return np.where(inside, np.abs(height), edges)


def solid_angles(p: Any, a: Any, b: Any, c: Any) -> Any:
    """Signed solid angles of triangles from a point (van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983))."""
    a, b, c = a - p, b - p, c - p
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = dots(a, np.cross(b, c))
    return 2 * np.arctan2(above, la * lb * lc + dots(a, b) * lc + dots(b, c) * la + dots(c, a) * lb)


@CASES
def test_the_radius_of_a_particle_is_a_part_of_the_gap(collider: Collider) -> None:
    shape = collider.shape()
    for p in near_by(collider):
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
        n = vector(normal(record.shape, p))
        np.testing.assert_allclose(np.array(q[:3]) - p[:3], depth * n, atol=32 * EPS)
        if np.allclose(
            vector(normal(record.shape, q)), n, atol=1e-9
        ):  # not in a corner, where other walls are near
            assert gap(record.shape, q) == pytest.approx(0, abs=32 * EPS)


@CASES
@given(
    seed=st.integers(0, 2**32 - 1), restitution=st.floats(0, 1), loss=st.floats(0, 1), speed=st.floats(0, 1e6)
)
@settings(max_examples=15)
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
    np.testing.assert_allclose(
        q[3:6], expected, atol=16 * max(EPS * np.linalg.norm(v), np.finfo(float).smallest_subnormal)
    )
    assert np.linalg.norm(q[3:6]) <= np.linalg.norm(v) * (1 + 8 * EPS)


@kernel
def look_along(shape: Any, p: Any, q: Any, h: Any, slack: Any, gaps: Any, found: Any) -> None:
    """Gaps at places along the way of a step; the part of it at the first contact, the gap there, and whether it is free."""
    way = way_of(p, q, h)
    for k in range(gaps.size):
        gaps[k] = gap(shape, place_on(way, p, k / (gaps.size - 1)))
    if has_law(first_contact, shape) and gaps[0] >= 0:
        found[0] = first_contact(shape, p, q, h, slack)
        found[1] = gap(shape, place_on(way, p, found[0]))
        found[2] = 1.0 if apart(shape, p, q, h, slack) else 0.0


@CASES
@given(seed=st.integers(0, 2**32 - 1), bend=st.sampled_from([0.0, 0.5, 3.0]))
@settings(max_examples=20)
def test_a_way_is_free_up_to_its_first_contact(collider: Collider, seed: int, bend: float) -> None:
    # Against 400 places on the parabola. A shape without this law has no dents to speak of: straight ways between two legal
    # places stay legal.
    shape, slack = collider.shape(), 1e-14
    rng = np.random.default_rng(seed)
    size = 0.0 if seed % 2 else 0.05
    p = Particle(*rng.uniform(-2, 2, 3), *rng.normal(0, 1, 3), 1.0, size, 0.0, 0.0)
    h = rng.uniform(0.1, 4)
    c = bend * rng.normal(0, 1, 3)
    q = moved(p, h * np.array(p[3:6]) + c)
    gaps, found = np.empty(401), np.ones(3)
    look = look_along if collider.costly else look_along.python  # loops that Python takes long for
    look(shape, p, q, h, slack, gaps, found)
    if not has_law(first_contact, shape):
        if bend == 0:
            assert gaps.min() >= min(gaps[0], gaps[-1]) - 64 * EPS
        return
    if gaps[0] < 0:
        return
    s, there, free = found
    before = gaps[np.linspace(0, 1, 401) < s]
    assert before.min(initial=0) >= -1e-8  # grain²/8R
    if s < 1:
        assert -1e-3 < there < 0
    if free:
        assert s == 1
        assert gaps[:-1].min() >= -1e-12


def test_in_the_centre_of_a_ball_the_way_out_is_upwards() -> None:
    record = COLLIDER_CASES["sphere"].record()
    p = Particle(0.1, -0.2, 0.3, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    q, _ = contact(record, p)
    assert q[:3] == pytest.approx((0.1, -0.2 + 0.9, 0.3))
