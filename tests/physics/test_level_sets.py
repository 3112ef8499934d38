"""Solids by a formula and by distances over a grid: how exact they are, that nothing gets through, and what is refused."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import EPS, G, points
from support import careful, columns, position, program, run, velocity

import particlesim as ps
from particlesim.colliders import (
    BoxCollider,
    DistanceGridCollider,
    FormulaCollider,
    PlaneCollider,
    SphereCollider,
)
from particlesim.colliders.gaps import gaps_of
from particlesim.engine.simulation import Simulation
from particlesim.expressions.arrays import value_at
from particlesim.expressions.operations import VARIABLES, value
from particlesim.expressions.parser import parse
from particlesim.forces import Gravity
from particlesim.laws.registry import Particle
from particlesim.preflight.advice import advice


def gaps(collider: Any, places: NDArray[Any], radius: float = 0.0) -> NDArray[Any]:
    out = np.empty(len(places))
    gaps_of(collider.shape(), *np.ascontiguousarray(places.T), np.full(len(places), radius), 0.0, out)
    return out


def grid_of(spacing: float, **values: Any) -> DistanceGridCollider:
    """The distance from a ball of radius 1 about the origin, sampled in a cube of half edge 1.5."""
    number = round(3 / spacing) + 1
    axis = -1.5 + spacing * np.arange(number)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    grid = DistanceGridCollider(path="ball.npy", origin=(-1.5, -1.5, -1.5), spacing=spacing, **values)
    grid.take(np.sqrt(x * x + y * y + z * z) - 1)
    return grid


def on_a_ball(radius: float, number: int = 500) -> NDArray[Any]:
    rng = np.random.default_rng(3)
    x = rng.normal(size=(number, 3))
    return radius * x / np.linalg.norm(x, axis=1)[:, None]


@pytest.mark.slow
@pytest.mark.optimised
def test_what_is_far_from_a_formula_is_stepped_as_if_it_looked_at_it() -> None:
    """Balls fall, bounce, slide and come to rest on a floor about a hill, and some of them hit it: the same bits."""
    hill = FormulaCollider(
        distance="x**2 + y**2 + z**2 - 1", size=(2.5, 2.5, 2.5), restitution=0.7, friction=0.2
    )
    floor = PlaneCollider(restitution=0.6, friction=0.3)
    x = on_a_ball(3.0, 60)
    x[:, 1] = np.abs(x[:, 1])
    for speed, dt in ((3.0, 5e-3), (60.0, 0.05)):  # the fast ones strike both in one step
        v = speed * on_a_ball(1.0, 60)[::-1] - speed * x / 3.0
        found = []
        for one_by_one in ((), None):
            contacts = careful([hill.record(), floor.record()])._replace(one_by_one=one_by_one)
            c = columns(x, v, radius=0.05)
            run(program("velocity_verlet", [Gravity().record()], contacts), c, 400, dt)
            found.append((position(c), velocity(c)))
        np.testing.assert_array_equal(found[0], found[1])
        assert (found[0][1] == 0).all(axis=1).any()


@pytest.mark.parametrize("inside", [False, True])
def test_a_formula_that_is_no_distance_is_as_exact_as_the_shape(inside: bool) -> None:
    # x² + y² + z² = R² is a ball: impacts in gravity, along the whole way as at a sphere.
    formula = FormulaCollider(
        distance="x**2 + y**2 + z**2 - R**2",
        constants={"R": 1.0},
        size=(2.5, 2.5, 2.5),
        inside=inside,
        restitution=0.9,
    )
    ball = SphereCollider(radius=1.0, inside=inside, restitution=0.9)
    x = on_a_ball(0.5 if inside else 1.5, 40)
    v = -1.5 * x[:, [1, 2, 0]] - x
    found = []
    for shape in (formula, ball):
        c = columns(x, v, radius=0.05)
        contacts = careful(continuous=[shape.record()], tolerance=16 * EPS, reach=shape.reach())
        assert not run(program("velocity_verlet", (Gravity().record(),), contacts), c, 40, 0.01).any()
        found.append(np.hstack([position(c), velocity(c)]))
    assert np.abs(found[0][:, :3] - x - 0.4 * v).max() > 0.5  # they do bounce
    # rounding, which every one of some impacts makes larger by a distance over the radius
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


BOXES = {
    "distance_inside": "max(abs(x) - 0.5, max(abs(y) - 0.4, abs(z) - 0.3))",
    "uneven": "max(2*(abs(x) - 0.5), max(abs(y) - 0.4, 5*(abs(z) - 0.3)))",
    "distance": "min(max(abs(x) - 0.5, max(abs(y) - 0.4, abs(z) - 0.3)), 0)"
    " + sqrt(max(abs(x) - 0.5, 0)**2 + max(abs(y) - 0.4, 0)**2 + max(abs(z) - 0.3, 0)**2)",
}
"""Boxes by formulas with kinks."""


@pytest.mark.sampled(6)
@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("name", BOXES)
def test_a_formula_with_kinks_is_as_exact_as_the_shape(name: str, inside: bool) -> None:
    # Faces, edges and corners. On an edge of "distance" the slope is that of a root of rounding errors.
    x = np.random.default_rng(1).uniform(-0.8, 0.8, (2000, 3))
    formula = FormulaCollider(distance=BOXES[name], size=(2, 2, 2), inside=inside)
    box = BoxCollider(size=(1, 0.8, 0.6), inside=inside)
    np.testing.assert_allclose(gaps(formula, x), gaps(box, x), atol=1e-12 if name == "distance" else 16 * EPS)


PROFILES: dict[str, tuple[str, list[tuple[float, float]]]] = {
    "rooms": (
        "min(max(hypot(x,z)-0.4, max(-y,y-0.9)), max(hypot(x,z)-0.6, max(y-0.12,-0.9-y)))",
        [(0, 0.9), (0.4, 0.9), (0.4, 0.12), (0.6, 0.12), (0.6, -0.9), (0, -0.9)],
    ),
    "silo": (
        "min(min(max(hypot(x,z)-0.55, max(-y,y-0.9)), max(hypot(x,z)-0.22, abs(y)-0.2)),"
        " max(hypot(x,z)-0.66, max(y+0.08,-0.9-y)))",
        [(0, 0.9), (0.55, 0.9), (0.55, 0), (0.22, 0), (0.22, -0.08), (0.66, -0.08), (0.66, -0.9), (0, -0.9)],
    ),
    "hourglass": (
        "max(hypot(x,z)-0.1-0.5*abs(y), abs(y)-0.8)",
        [(0, 0.8), (0.5, 0.8), (0.1, 0), (0.5, -0.8), (0, -0.8)],
    ),
    "pipe": (
        "max(abs(hypot(x,z)-0.5)-0.1, abs(y)-0.5)",
        [(0.4, -0.5), (0.4, 0.5), (0.6, 0.5), (0.6, -0.5), (0.4, -0.5)],
    ),
}
"""Solids about the y axis, and the line whose turn makes their surface: (distance from the axis, y)."""


def from_line(x: NDArray[Any], corners: list[tuple[float, float]]) -> NDArray[Any]:
    """Distances of places from the surface that a line makes that turns about the y axis."""
    q, line = np.stack([np.hypot(x[:, 0], x[:, 2]), x[:, 1]], axis=1)[:, None], np.array(corners)
    begin, way = line[:-1], np.diff(line, axis=0)
    part = np.clip(((q - begin) * way).sum(axis=2) / (way**2).sum(axis=1), 0, 1)
    return np.linalg.norm(q - begin - part[..., None] * way, axis=2).min(axis=1)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("name", PROFILES)
def test_balls_touch_surfaces_and_nothing_else(name: str, inside: bool) -> None:
    # Where two rooms overlap, the faces in which each ends go on, and φ is small. A place on the axis has no nearest side.
    text, line = PROFILES[name]
    formula = FormulaCollider(distance=text, size=(2, 2, 2), inside=inside)
    x = np.random.default_rng(5).uniform(-0.9, 0.9, (3000, 3))
    x[::6, [0, 2]] = 0
    x = x[(value_at(formula.node(), *x.T) < 0) == inside]
    expected = from_line(x, line)
    if inside:
        expected = np.minimum(expected, 1 - np.abs(x).max(axis=1))
    for radius in (0.01, 0.03, 0.1):
        found, near = gaps(formula, x, radius), expected < radius
        assert near.any()
        np.testing.assert_allclose(found[near], expected[near] - radius, atol=1e-9)
        assert (found[~near] >= 0).all()
        assert (found < expected - radius + 1e-9).all()


@pytest.mark.slow
def test_balls_fall_freely_through_rooms_that_overlap() -> None:
    # The rim is 20 mm from the axis; φ on it is 3 mm and less where the rooms overlap.
    radii = [0.0005, 0.0018, 0.004, 0.008, 0.014]
    final = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": 0.1, "dt": 1e-3, "integrator": "velocity_verlet"},
                "particles": [
                    {
                        "name": f"p{k}",
                        "layout": {"type": "points", "position": [[0, 0.03, 0], [1e-3, 0.03, 2e-3]]},
                        "radius": radius,
                        "mass": 1.0,
                    }
                    for k, radius in enumerate(radii)
                ],
                "forces": [{"type": "gravity"}],
                "colliders": [
                    {
                        "type": "formula",
                        "inside": True,
                        "distance": "min(max(hypot(x,z)-0.02,-y), max(hypot(x,z)-0.03,y-0.006))",
                        "size": [0.08, 0.5, 0.08],
                    }
                ],
            }
        )
    ).final
    np.testing.assert_allclose(final.position[:, 1], 0.03 - 0.005 * G, atol=1e-12)


def test_the_nearest_of_the_faces_of_a_formula_counts() -> None:
    # Of two faces in a dent the one with the smaller φ decides, at places that are nearer to the other.
    formula = FormulaCollider(distance="min(y - 0.3*abs(x), 4*(y - 0.2*z + 0.5*x))", size=(4, 4, 4))
    faces = np.array([[-0.3, 1, 0], [0.3, 1, 0], [0.5, 1, -0.2]])
    x = np.random.default_rng(1).uniform(-0.6, 0.6, (2000, 3))
    above = x @ faces.T
    free = (above[:, :2].min(axis=1) > 0) & (above[:, 2] > 0)
    nearest = (above / np.linalg.norm(faces, axis=1)).min(axis=1)
    assert free.sum() > 500
    np.testing.assert_allclose(gaps(formula, x[free]), nearest[free], atol=16 * EPS)


def of_a_cut_plane(normal: NDArray[Any], places: NDArray[Any], half: NDArray[Any]) -> NDArray[Any]:
    """How far places are from the part of the plane normal·x = 0.1 in a box about the origin, of half edges `half`."""
    best = np.full(len(places), np.inf)
    planes = [np.eye(3)[k] * side for k in range(3) for side in (-1, 1)]
    for number in range(3):
        for sides in itertools.combinations(planes, number):
            rows = np.array([normal, *sides])
            if np.linalg.matrix_rank(rows) <= number:
                continue
            levels = np.array([0.1, *(np.abs(side) @ half for side in sides)])
            foot = places + (levels - places @ rows.T) @ np.linalg.pinv(rows).T
            far = np.where(
                (np.abs(foot) <= half + 1e-12).all(axis=1), np.linalg.norm(foot - places, axis=1), np.inf
            )
            best = np.minimum(best, far)
    return best


@pytest.mark.parametrize("normal", [(0.3, 1, 0), (0.8, 1, 0.5), (-1, 0.2, 2)])
def test_a_face_ends_at_the_sides_of_the_box(normal: tuple[float, float, float]) -> None:
    # A kink that does nothing. The nearest place of what the box leaves of the plane is on its face, on an edge where it
    # meets a side, or in a corner where it meets two.
    size = np.array([2.6, 1.4, 2.6])
    a, b, c = normal
    plane = f"{a}*x + {b}*y + {c}*z - 0.1"
    formula = FormulaCollider(distance=f"{plane} + 0*abs(x - 1)", size=tuple(size))
    smooth = FormulaCollider(distance=plane, size=tuple(size))
    x = np.random.default_rng(1).uniform(-0.7, 0.7, (4000, 3)) * size
    inner = np.clip(x, -size / 2, size / 2)
    above = inner @ normal - 0.1
    near = (above > 0) & (above / np.linalg.norm(normal) < 0.3)
    x, inner, above = x[near], inner[near], above[near]
    found, cut = gaps(formula, x), of_a_cut_plane(np.array(normal), inner, size / 2)
    whole = above / np.linalg.norm(normal)
    np.testing.assert_allclose(found, np.hypot(np.linalg.norm(x - inner, axis=1), cut), atol=32 * EPS)
    assert (cut > whole + 1e-6).sum() > 30
    same = cut < whole + 1e-14
    np.testing.assert_allclose(found[same], gaps(smooth, x)[same], atol=8 * EPS)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("restitution", [0.0, 1.0])
@pytest.mark.parametrize("text", ["y - 0.3*abs(x)", "y + 0.3*x + 0*abs(x - 1)", "max(y + 0.3*x, y - 0.5)"])
def test_what_rolls_off_the_end_of_a_formula_gains_nothing(text: str, restitution: float) -> None:
    # Where its centre is above the face still, and the foot beyond the side of the box, balls were lifted by r/4.
    rise = 0.3 + 0.05 * np.sqrt(1.09) + 1e-6
    ended = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": 0.3, "dt": 2e-3, "integrator": "velocity_verlet"},
                "output": {"every": 1, "precision": "double"},
                "particles": [points((-1, rise, 0), velocity=[[-3.0, 0.9, 0.2]], radius=0.05, mass=1.0)],
                "forces": [{"type": "gravity", "acceleration": [0, -10, 0]}],
                "colliders": [
                    {
                        "type": "formula",
                        "distance": text,
                        "size": [2.6, 1.4, 2.6],
                        "restitution": restitution,
                    }
                ],
            }
        )
    )
    assert ended.final.position[0, 0] < -1.4
    assert np.diff(ended.energy).max() < 1e-12 * ended.energy[0]


def test_what_slides_over_the_side_of_a_smooth_formula_gains_nothing() -> None:
    # Between its face and the side of its box a ball is put back more than once, each time by a look at the whole step.
    place, velocity = (-2.99981717, 0.05760417, 1.54645243), [[-1.54333122, -0.60839797, 2.06010928]]
    ended = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": 0.02, "dt": 2e-3, "integrator": "symplectic_euler"},
                "output": {"every": 1, "precision": "double"},
                "particles": [points(place, velocity=velocity, radius=0.05, mass=1.0)],
                "forces": [{"type": "gravity"}],
                "colliders": [
                    {
                        "type": "formula",
                        "distance": "(y - 0.2*sin(3*x)*cos(3*z))/1.3",
                        "size": [6, 3, 6],
                        "restitution": 0.3,
                    }
                ],
            }
        )
    )
    assert np.diff(ended.energy).max() < 1e-12 * ended.energy[0]


def test_distances_between_the_samples_are_of_fourth_order() -> None:
    # cubic splines; ends without curvature do not matter this far from them
    errors = [np.abs(gaps(grid_of(h), on_a_ball(1.1)) - 0.1).max() for h in (0.25, 0.125, 0.0625)]
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert order.min() > 3.5
    assert errors[-1] < 2e-6


@pytest.mark.parametrize("radius", [0.1, 0.5, 3.0])
@pytest.mark.parametrize("name", ["samples", "square", "tight", "kinks"])
def test_large_balls_touch_where_the_surface_is(name: str, radius: float) -> None:
    # The distance of places near a ball of radius 1 is |x| − 1, that of places near a cube a root. The cusp in the middle of
    # samples, where the spline is steepest, and the sides of the box count for nothing outside.
    x = np.random.default_rng(4).uniform(-2 - radius, 2 + radius, (20_000, 3))
    expected, atol = np.linalg.norm(x, axis=1) - 1 - radius, 1e-8
    if name == "samples":
        # of fourth order in the spacing: 3e-6 at 1/16, as in `test_distances_between_the_samples_are_of_fourth_order`
        shape, atol = grid_of(0.0625), 3e-6
    elif name == "kinks":
        expected = np.linalg.norm(np.maximum(np.abs(x) - 0.5, 0), axis=1) - radius
        shape = FormulaCollider(distance="max(abs(x), max(abs(y), abs(z))) - 0.5", size=(1.1, 1.1, 1.1))
    else:
        side = 2.1 if name == "tight" else 3.0
        shape = FormulaCollider(distance="x**2 + y**2 + z**2 - 1", size=(side, side, side))
    some = (expected > -0.01 * radius) & (expected < 0.3)
    found, expected = gaps(shape, x[some], radius), expected[some]
    near = expected < 0
    np.testing.assert_allclose(found[near], expected[near], atol=atol)
    # Others are not touched, and no gap is more than it is.
    assert (found[~near] > -atol).all()
    assert (found < expected + atol).all()


def test_balls_that_may_touch_a_cut_solid_too_early_are_told() -> None:
    # A floor 0.1 m below the upper side of its box. A ball of 0.2 m touches early by (√2 − 1) 0.2 m at most: where the ways
    # out of the box and on to the floor are equal, 0.2/√2 m ≥ 0.1 m.
    table = {
        "simulation": {"duration": 0.01, "dt": 1e-3},
        "particles": [points((0.0, 2.0, 0.0), radius=0.2, mass=1.0)],
        "colliders": [{"name": "floor", "type": "formula", "distance": "y", "size": [4, 0.2, 4]}],
    }
    told = [each for each in advice(ps.from_table(table)) if "too early" in each]
    assert len(told) == 1
    assert "formula floor: balls of 0.2 m may touch it up to 0.083 m too early" in told[0]
    table["colliders"][0]["size"] = [4, 0.8, 4]
    assert not any("too early" in each for each in advice(ps.from_table(table)))


def test_samples_of_a_plane_are_a_plane() -> None:
    n = np.array([0.48, 0.6, 0.64])
    axes = [step * np.arange(k) for step, k in zip((0.1, 0.2, 0.15), (11, 6, 8), strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    grid = DistanceGridCollider(path="plane.npy", spacing=(0.1, 0.2, 0.15))
    grid.take(x @ n - 0.8)
    places = np.random.default_rng(1).uniform(0.3, 0.7, (200, 3))
    d = places @ n - 0.8
    assert (d > 0).any()
    assert (d < 0).any()
    np.testing.assert_allclose(gaps(grid, places), d, atol=64 * EPS)
    np.testing.assert_allclose(gaps(grid, places, 0.1), d - 0.1, atol=64 * EPS)


SHAPES = {
    "hills": FormulaCollider(distance="y - 0.2*sin(3*x)*cos(2*z)", size=(2.4, 1.6, 2.6)),
    "wide": FormulaCollider(distance="exp(3*(x**2 + y**2)) - 8 + 0*z", size=(2, 2, 2)),
    "bowl": grid_of(0.1, inside=True),
    "vase": FormulaCollider(distance="hypot(x, z) - 0.6 - 0.2*sin(4*y)", size=(2, 2, 2), inside=True),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("name", "speed"),
    [
        *((name, 1.0) for name in SHAPES),
        *(pytest.param(name, 1e4, marks=[pytest.mark.slow] * (name in ("bowl", "vase"))) for name in SHAPES),
    ],
)
def test_nothing_gets_through(name: str, speed: float) -> None:
    collider = SHAPES[name].model_copy(update={"restitution": 0.6})
    rng = np.random.default_rng(8)
    # the fast ones have a thousand impacts in a step: fewer of them are enough
    x = rng.uniform(-1.6, 1.6, (500 if speed == 1 else 80, 3))
    radius = 0.02
    x = x[gaps(collider, x, radius) > 0]
    assert len(x) > 4
    v = rng.normal(size=x.shape) * speed
    c = columns(x, v, radius=radius)
    contacts = careful(continuous=[collider.record()], tolerance=16 * EPS, reach=collider.reach())
    contacts = contacts._replace(one_by_one=())
    energy = 0.5 * (v * v).sum(axis=1)
    for k in range(4):
        assert not run(program("velocity_verlet", (), contacts), c, 1, 0.2, first_step=k).any()
        deep = gaps(collider, position(c), radius)
        assert deep.min() > -64 * EPS * (4 + 0.2 * speed * 6)
        now = 0.5 * (velocity(c) ** 2).sum(axis=1)
        assert (now <= energy * (1 + 64 * EPS)).all()
        energy = now


def test_its_picture_is_a_closed_surface_on_its_zeros() -> None:
    for collider in (SHAPES["wide"], grid_of(0.1), SHAPES["vase"]):
        corners, faces = collider.triangles()
        a, b, c = corners[faces].transpose(1, 0, 2)
        around = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        there = around[:, 0] * len(corners) + around[:, 1]
        back = around[:, 1] * len(corners) + around[:, 0]
        assert (
            np.isin(there, back).mean() > 0.999
        )  # each edge in both directions, but for slivers that were left out
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0
        assert np.abs(gaps(collider, corners)).max() < 1e-3
    corners, faces = grid_of(0.1).triangles()
    a, b, c = corners[faces].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    # chords of cells of 0.1 in a ball: 4/3 π less than about h²/2 of it
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.006)


def test_arrays_of_values_are_the_values() -> None:
    texts = (
        "a*x**2 - sin(y)/cosh(z) + atan2(x, y)*hypot(y, z) + min(x, y)*max(y, z)",
        "abs(x)**1.5 + (2 + x)**y + sign(z) + sqrt(1 + x**2) - exp(-z) * tan(x) + log(3 + x) + asin(x/2)",
        "x if x < y else acos(y/2) + atan(z) + sinh(x) + tanh(y) - cos(x)",
    )
    x, y, z = np.random.default_rng(4).uniform(-1, 1, (3, 50))
    for text in texts:
        node = parse(text, {"a": 0.7})
        one_by_one = [
            value(node, Particle(*place, 0, 0, 0, 1, 0, 0, 0)) for place in zip(x, y, z, strict=True)
        ]
        np.testing.assert_allclose(value_at(node, x, y, z), one_by_one, rtol=1e-14, atol=1e-14)
    assert set("xyz") < set(VARIABLES)


HEAD = "format = 1\n[simulation]\nduration = 1\ndt = 0.01\n"
BAD = {
    "velocity": ('distance = "x + vy"', "unknown name 'vy'"),
    "nothing": ('distance = "x**2 + y**2 + 1 + z*0"', "negative nowhere"),
    "everything": ('distance = "x - 5"', "in all of its box"),
    "no_value": ('distance = "sqrt(x) - 0.5"', "it has no value at"),
    "no_slope": ('distance = "(x**2 + y**2 + z**2 - 0.5)**7"', "no slope on its surface"),
    "step": ('distance = "y if x < 0 else y - 0.4"', r"jumps from 0 to -0.4 at \(0, 0, 0\)"),
    "low_step": ('distance = "y - (1e-4 if x < 0.01 else 0)"', "jumps from -0.0001 to 0"),
    "sign": ('distance = "y - 0.2*sign(x)"', "surface is open there"),
    "cliff": ('distance = "y - (0.3 if hypot(x, z) < 0.5 else 0)"', "jumps from"),
    "filled": ('distance = "y if y > 0 else -1"', "jumps from"),
    "ramp": ('distance = "y - 0.1*atan2(z, x)"', "jumps from"),
    "pole": ('distance = "y - 0.01/(x - 0.013)"', "jumps from"),
    "teeth": ('distance = "y - 0.1*tan(2*x)"', "jumps from"),
    "no_formula": ('distance = "x +"', "not an expression"),
    "no_size": ('distance = "x"\nsize = [0, 1, 1]', "greater than 0"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_formulas_are_refused_where_they_are(tmp_path: Path, name: str) -> None:
    text, words = BAD[name]
    size = "" if "size" in text else "size = [2, 2, 2]\n"
    file = tmp_path / "s.toml"
    file.write_text(f'{HEAD}[[colliders]]\ntype = "formula"\n{text}\n{size}')
    with pytest.raises(ps.ScenarioError, match=words) as told:
        ps.load(file)
    assert told.value.diagnostics[0].span.line in (7, 8)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("x +", "+ - * / **, functions and a if b < c else d; names: x, y, z, pi, e, k; functions: sin, cos"),
        ("", "names: x, y, z, pi, e, k"),
        ("x < y", "names: x, y, z, pi, e, k"),
        ("y - é", "names are of a to z"),
        ("y - min(x)", "write min(a, b)"),
        ("y - 0x10", "12, 0.5 and 1e-3"),
        ("y  # no", "behind the quotation mark"),
    ],
)
def test_what_is_no_formula_is_told_what_one_may_have(text: str, hint: str) -> None:
    collider = {"type": "formula", "distance": text, "size": [1, 1, 1], "constants": {"k": 1}}
    with pytest.raises(ps.ScenarioError) as told:
        ps.from_table({"format": 1, "simulation": {"duration": 1, "dt": 0.01}, "colliders": [collider]})
    assert hint in str(told.value.diagnostics[0].hint)


@pytest.mark.parametrize(
    "text",
    [
        "min(y, max(y - 0.4, x))",
        "y - (x**2 if x < 0 else -x**2)",
        "y - 0.3*x*sign(x)",
        "y + 0.2*sign(x) - (0.2 if x > 0 else -0.2)",
        "y - 0.2*abs(sin(30*x))*sign(sin(30*x))",
        "y - 0.3*(0 if x < 0 else 3*x**2 - 2*x**3 if x < 1 else 1)",
        "y - (x if x < 0.2 else (0.2 if z < 0 else 0.2 + z*(x - 0.2)))",
        "y*(1 if x + y + 0.3*z*z < 0.1 else 3)",  # it jumps, but not on its surface
        "y + (0.4 if y > 0.3 else 0)",
        "(y - 0.3*x)/(0.5 + abs(x))",
        "y - 0.1*atan2(z + 3, x)",
        "y - 0.1*tan(0.8*x)",
        "y - 0.05*tanh(1000*x)",
    ],
)
def test_formulas_that_come_to_zero_on_their_surface_are_taken(text: str) -> None:
    FormulaCollider(distance=text, size=(2.6, 1.4, 2.6))


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        (np.zeros((4, 4)) - 1, "has the shape"),
        (np.ones((4, 4, 4)), "has no surface: none of its distances is negative"),
        (-np.ones((4, 4, 4)), "has no surface: none of its distances is positive"),
        (np.full((4, 4, 4), np.nan), "not finite"),
        (np.ones(5), "axes"),
    ],
)
def test_bad_grids_are_refused_where_they_are(tmp_path: Path, numbers: NDArray[Any], words: str) -> None:
    np.save(tmp_path / "grid.npy", numbers)
    file = tmp_path / "s.toml"
    file.write_text(f'{HEAD}[[colliders]]\ntype = "distance_grid"\npath = "grid.npy"\nspacing = 0.1\n')
    with pytest.raises(ps.ScenarioError, match=words) as told:
        ps.run(ps.load(file, {"particles": [points((0, 3, 0), radius=0.05)]}))
    assert told.value.diagnostics[0].span.line == 7


def test_a_grain_falls_on_a_ball_from_a_file_and_on_one_that_is_cut(tmp_path: Path) -> None:
    grid = grid_of(0.1)
    np.save(tmp_path / "ball.npy", grid._content)
    (tmp_path / "s.toml").write_text(HEAD)
    h, e = 1.0, 0.5
    t = np.sqrt(2 * h / G)
    ball = {"type": "distance_grid", "path": "ball.npy", "origin": [-1.5, -1.5, -1.5], "spacing": 0.1}
    cut = {
        "type": "difference",
        "of": [ball, {"type": "box", "size": [3, 1, 3], "center": [0, 1.3, 0]}],  # its top is at 0.8 now
        "restitution": e,
    }
    for collider, top in (({**ball, "restitution": e}, 1.0), (cut, 0.8)):
        made = ps.load(
            tmp_path / "s.toml",
            {
                "simulation": {"duration": t * (1 + e), "dt": t / 50, "integrator": "velocity_verlet"},
                "particles": [points((0, top + 0.05 + h, 0), name="grain", radius=0.05)],
                "forces": [{"type": "gravity"}],
                "colliders": [collider],
            },
        )
        final = ps.run(made).final
        # the spline through samples 0.1 apart is 1e-4 off at most; bounces double what that changes
        assert final.position[0] == pytest.approx([0, top + 0.05 + e * e * h, 0], abs=1e-3)


def test_bodies_may_stand_beside_a_formula_with_constants() -> None:
    ground = {"type": "formula", "distance": "y - a", "constants": {"a": 0.1}, "size": [4, 1, 4]}
    body = {"name": "box", "shape": {"type": "box", "size": [1, 1, 1]}, "position": [0, 2, 0]}
    parts = {"bodies": [body, {**body, "name": "other", "position": [2, 2, 0]}], "colliders": [ground]}
    Simulation(ps.from_table({"simulation": {"duration": 0.1, "dt": 0.01}, **parts})).close()


def test_emitted_balls_come_to_rest_on_a_rough_hill_within_bounds() -> None:
    final = ps.run(
        ps.from_table(
            {
                "simulation": {"duration": 0.3, "dt": 2e-3, "seed": 1},
                "emitters": [
                    {
                        "name": "balls",
                        "rate": 100,
                        "shape": {"type": "point", "position": [0, 1.1, 0]},
                        "radius": 0.005,
                        "density": 1000.0,
                        "die": {"outside": [[-2, -1, -2], [2, 3, 2]]},
                    }
                ],
                "forces": [{"type": "gravity"}],
                "colliders": [
                    {
                        "type": "formula",
                        "distance": "x**2 + y**2 + z**2 - 1",
                        "size": [2.5] * 3,
                        "friction": 0.4,
                    }
                ],
                "planes": [{"friction": 0.3}],
            }
        )
    ).final
    assert len(final.position) > 0
    assert (np.linalg.norm(final.position, axis=1) > 1.005 - 1e-12).all()
