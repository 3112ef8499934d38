"""What every bond must hold: F = −∇U, no net force and no net moment, documentation, units; in plain Python.

Derivatives are compared with the five-point central difference: h⁴ U⁽⁵⁾/30 + 1.5 ε |U|/h. With h = 10⁻³ of the size of the
shapes here and fifth derivatives up to some 10³ of the scale of the force, 10⁻⁸ leaves room.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from particlesim.bonds import Angles, Dihedrals, MeshSprings, SpringRecord, Springs, StringRecord, StrutRecord
from particlesim.bonds.hinge import (
    Cosine,
    Harmonic,
    angle_forms,
    angle_gradient,
    angles_at,
    dihedral_gradient,
    wrapped,
)
from particlesim.bonds.spring import Pair
from particlesim.extensions.requirements import numbers_without_unit
from particlesim.flows.uniform import Uniform
from particlesim.forces.sheet_drag import SheetDrag, Triangle
from particlesim.laws.registry import (
    GENERICS,
    Particle,
    bond_force,
    bond_force_dv,
    bond_force_dx,
    bond_potential,
    hinge_energy,
    hinge_moment,
    hinge_stiffness,
    triangle_force,
    triangle_force_dv,
)
from particlesim.model.base import field_docs

H = 1e-3
TOLERANCE = 1e-8
EPS = float(np.finfo(float).eps)
Floats = NDArray[np.float64]


def spring(record: Any, rest: float) -> tuple[int, Callable[[Floats], float], Callable[[Floats], Floats]]:
    """Number of particles, potential and forces [n, 3] of a spring, as functions of positions [n, 3]."""

    def pair(x: Floats) -> Pair:
        return Pair(*(x[0] - x[1]), 0.0, 0.0, 0.0, 7.0, 0.3, rest)

    def forces(x: Floats) -> Floats:
        f = np.array(bond_force(record, pair(x)))
        return np.stack([f, -f])

    return 2, lambda x: bond_potential(record, pair(x)), forces


def angle(record: Any, rest: float) -> tuple[int, Callable[[Floats], float], Callable[[Floats], Floats]]:
    def gradient(x: Floats) -> tuple[float, Floats]:
        g = angle_gradient(*(x[0] - x[1]), *(x[2] - x[1]))
        a, b = np.array(g[1:4]), np.array(g[4:7])
        return wrapped(g[0] - rest), np.stack([a, -(a + b), b])

    return (
        3,
        lambda x: hinge_energy(record, gradient(x)[0]),
        lambda x: -hinge_moment(record, gradient(x)[0]) * gradient(x)[1],
    )


def dihedral(record: Any, rest: float) -> tuple[int, Callable[[Floats], float], Callable[[Floats], Floats]]:
    def gradient(x: Floats) -> tuple[float, Floats]:
        g = dihedral_gradient(*(x[0] - x[1]), *(x[1] - x[2]), *(x[3] - x[2]))
        a, b, d = (np.array(g[k : k + 3]) for k in (1, 4, 7))
        return wrapped(g[0] - rest), np.stack([a, b, -(a + b + d), d])

    return (
        4,
        lambda x: hinge_energy(record, gradient(x)[0]),
        lambda x: -hinge_moment(record, gradient(x)[0]) * gradient(x)[1],
    )


CASES = {
    "spring": spring(SpringRecord(), 0.4),
    "spring_of_no_length": spring(SpringRecord(), 0.0),
    "string_taut": spring(StringRecord(), 0.05),
    "string_slack": spring(StringRecord(), 9.0),
    "strut_slack": spring(StrutRecord(), 0.05),
    "strut_pressed": spring(StrutRecord(), 9.0),
    "angle": angle(Harmonic(2.0), 1.0),
    "angle_straight": angle(Harmonic(2.0), np.pi),
    "angle_folded": angle(Harmonic(2.0), 0.0),
    "angle_cosine": angle(Cosine(2.0), 2.0),
    "dihedral": dihedral(Harmonic(2.0), 0.3),
    "dihedral_flat": dihedral(Harmonic(2.0), 0.0),
    "dihedral_cosine": dihedral(Cosine(2.0), -1.0),
}
bonds = pytest.mark.parametrize("bond", CASES.values(), ids=CASES)


def shapes(n: int, number: int = 30) -> list[Floats]:
    """Random places of n particles, none of them near one another."""
    rng = np.random.default_rng(n)
    found: list[Floats] = []
    while len(found) < number:
        x = rng.uniform(-1, 1, (n, 3))
        apart = np.linalg.norm(x[:, None] - x[None], axis=2) + 9 * np.eye(n)
        # Nor nearly in a line: there are the poles of the gradients.
        corners = [x[[k, k + 1, k + 2]] for k in range(n - 2)]
        bent = all(np.linalg.norm(np.cross(a - b, c - b)) > 0.15 for a, b, c in corners)
        if apart.min() > 0.3 and bent:
            found.append(x)
    return found


@bonds
def test_forces_are_minus_the_gradient_of_the_potential(bond: Any) -> None:
    n, energy, forces = bond
    for x in shapes(n):
        gradient = np.zeros((n, 3))
        for i, k in np.ndindex(n, 3):
            step = np.zeros((n, 3))
            step[i, k] = H
            values = [energy(x + s * step) for s in (1, -1, 2, -2)]
            gradient[i, k] = (8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * H)
        scale = max(float(np.abs(forces(x)).max()), 1.0)
        if abs(energy(x)) < 2.8**2:  # d² for k = 2: at ±π the deviation jumps
            np.testing.assert_allclose(forces(x), -gradient, rtol=0, atol=50 * TOLERANCE * scale)


@bonds
def test_forces_have_no_sum_and_no_moment(bond: Any) -> None:
    n, _, forces = bond
    for x in shapes(n):
        f = forces(x)
        scale = float(np.abs(f).max())
        assert np.abs(f.sum(axis=0)).max() <= 4 * EPS * scale
        assert np.abs(np.cross(x, f).sum(axis=0)).max() <= 64 * EPS * scale


@pytest.mark.parametrize("rest", [0.05, 0.4, 9.0])
@pytest.mark.parametrize(
    "record", [SpringRecord(), StringRecord(), StrutRecord()], ids=lambda r: type(r).__name__
)
def test_jacobians_of_springs(record: Any, rest: float) -> None:
    rng = np.random.default_rng(8)

    def force(state: Floats) -> Floats:
        return np.array(bond_force(record, Pair(*state, 7.0, 0.3, rest)))

    for x in shapes(2):
        state = np.concatenate([x[0] - x[1], rng.normal(size=3)])
        if abs(np.linalg.norm(state[:3]) - rest) < 4 * H:
            continue  # strings and struts have a kink there
        pair = Pair(*state, 7.0, 0.3, rest)
        exact = np.hstack([np.reshape(law(record, pair), (3, 3)) for law in (bond_force_dx, bond_force_dv)])
        steps = H * np.eye(6)
        columns = [
            (8 * (force(state + s) - force(state - s)) - (force(state + 2 * s) - force(state - 2 * s)))
            / (12 * H)
            for s in steps
        ]
        numeric = np.stack(columns, axis=1)
        np.testing.assert_allclose(exact, numeric, atol=50 * TOLERANCE * (1 + np.abs(numeric).max()))


def differences(force: Callable[[Floats], Floats], x: Floats, h: float) -> Floats:
    """∂f_i/∂x_j by the five-point central difference."""
    columns = [
        (8 * (force(x + s) - force(x - s)) - (force(x + 2 * s) - force(x - 2 * s))) / (12 * h)
        for s in h * np.eye(x.size)
    ]
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("record", [Harmonic(2.0), Cosine(2.0)], ids=lambda r: type(r).__name__)
def test_stiffness_of_hinges(record: Any) -> None:
    for d in np.linspace(-3, 3, 7):
        numeric = differences(lambda x: np.array([hinge_moment(record, x[0])]), np.array([d]), H)
        assert hinge_stiffness(record, d) == pytest.approx(numeric[0, 0], abs=10 * TOLERANCE)


def derivatives_of_an_angle(rest: float, x: Floats) -> tuple[Floats, Floats]:
    """Second derivatives of U = d² by a and b: numerically, and their positive part."""
    record = Harmonic(2.0)

    def slope(y: Floats) -> Floats:
        g = angle_gradient(*y)
        return hinge_moment(record, wrapped(g[0] - rest)) * np.array(g[1:])

    moment = hinge_moment(record, wrapped(angle_gradient(*x)[0] - rest))
    w, p = np.reshape(angle_forms(2.0, moment, *x), (2, 6))
    return differences(slope, x, 1e-2 * H), np.outer(w, w) + np.outer(p, p)


@pytest.mark.parametrize(
    ("rest", "x"),
    [
        (None, [0.7, 0.2, -0.4, 0.1, 0.9, 0.3]),
        (np.pi, [1.0, 0, 0, -2.0, 0, 0]),
        (np.pi, [0, 0.3, 0, 0, -0.4, 0]),
        (0.0, [0, 0, 1.0, 0, 0, 0.7]),
    ],
)
def test_second_derivatives_of_an_angle_at_rest(rest: float | None, x: list[float]) -> None:
    # U'' ∇θ ∇θᵀ is all there is, and on a straight or folded angle its limit, which has no plane. The gradient is odd in the
    # distance from there: differences find the limit to h² ~ 10⁻¹⁰ over the length's square.
    place = np.array(x)
    exact, positive = derivatives_of_an_angle(angle_gradient(*place)[0] if rest is None else rest, place)
    np.testing.assert_allclose(positive, exact, rtol=0, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("real", [np.float64, np.float32])
@pytest.mark.parametrize("side", [-1, 1], ids=["straight", "folded"])
def test_a_nearly_straight_or_folded_angle_is_soft_out_of_its_plane(side: int, real: Any) -> None:
    # p² |a|² = ½ |U'| (|a||b| ∓ a·b)/|a × b|, which is ½ |U'| tan δ/2 with δ the small angle that is left: rounding of the
    # difference must not make it negative.
    rng = np.random.default_rng(8)
    for _ in range(300):
        a = rng.normal(size=3)
        b = side * rng.uniform(0.5, 2) * a + rng.normal(size=3) * 10 ** rng.uniform(-9, -5)
        x = [real(value) for value in (*a, *b)]
        moment = real(-1.0 if side > 0 else 1.0)  # towards a right angle
        found = np.array(angle_forms(real(2.0), moment, *x), float)
        assert np.isfinite(found).all()
        one, two = np.array(x[:3], float), np.array(x[3:], float)
        left = np.linalg.norm(np.cross(one, two)) / (np.linalg.norm(one) * np.linalg.norm(two))
        if left > 100 * np.finfo(real).eps:
            out = np.linalg.norm(found[6:9]) ** 2 * (one @ one)
            assert out == pytest.approx(0.5 * np.tan(left / 2), rel=0.1)


@pytest.mark.parametrize("rest", [np.pi, 0.0, 1.2])
def test_a_bent_angle_resists_being_turned_out_of_its_plane(rest: float) -> None:
    # Displacements along the normal, α |a| and β |b|, decouple from those in the plane: of α + β and α − β one is resisted.
    for shape in shapes(3):
        x = np.concatenate([shape[0] - shape[1], shape[2] - shape[1]])
        exact, positive = derivatives_of_an_angle(rest, x)
        n = np.cross(x[:3], x[3:]) / np.linalg.norm(np.cross(x[:3], x[3:]))
        out = np.kron(np.diag(np.linalg.norm(x.reshape(2, 3), axis=1)), n)
        values, vectors = np.linalg.eigh(out @ exact @ out.T)
        scale = np.abs(values).max()
        assert values[0] < 1e-7 * scale
        kept = np.maximum(values, 0)
        np.testing.assert_allclose(
            out @ positive @ out.T, vectors @ np.diag(kept) @ vectors.T, atol=1e-6 * scale
        )


def test_every_law_of_bonds_is_reached() -> None:
    reached = {SpringRecord, StringRecord, StrutRecord, Harmonic, Cosine}
    laws = {
        record
        for generic in (
            *(bond_force, bond_force_dx, bond_force_dv, bond_potential),
            *(hinge_energy, hinge_moment, hinge_stiffness),
        )
        for record in GENERICS[generic].laws
    }
    assert laws == reached


# Special places


@pytest.mark.parametrize("rest", [0.0, 1.0, np.pi])
def test_straight_and_folded_angles_are_safe(rest: float) -> None:
    # Exactly collinear: no direction, no force. Nearly so, and at its rest angle: a force as small as the deviation.
    _, _, forces = angle(Harmonic(2.0), rest)
    for x in ([[1, 0, 0], [0, 0, 0], [-2, 0, 0]], [[1, 0, 0], [0, 0, 0], [2, 0, 0]], [[0, 0, 0]] * 3):
        assert np.abs(forces(np.array(x, float))).max() == 0
    small = 1e-9
    for straight, end in ((np.pi, -1.0), (0.0, 1.0)):
        x = np.array([[1, small, 0], [0, 0, 0], [end, 0, 0]])
        f = angle(Harmonic(2.0), straight)[2](x)
        assert np.abs(f[[0, 2]]).max(axis=1) == pytest.approx(2 * small, rel=1e-6)
        assert angle(Cosine(2.0), straight)[2](x) == pytest.approx(f, rel=1e-6)


def test_degenerate_triangles_do_not_fold() -> None:
    _, energy, forces = dihedral(Harmonic(2.0), 0.0)
    for x in ([[1, 0, 0], [0, 0, 0], [2, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 1, 0]]):
        assert energy(np.array(x, float)) == 0
        assert np.abs(forces(np.array(x, float))).max() == 0


def test_folds_have_their_sign_and_flat_is_zero() -> None:
    # Triangles on both sides of an edge along z; the second one turned up by an angle about it.
    for fold in (-3.0, -1.0, 0.0, 0.5, 2.0):
        x = np.array([[-1, 0, 0.5], [0, 0, 0], [0, 0, 1], [np.cos(fold), np.sin(fold), 0.5]])
        found = dihedral_gradient(*(x[0] - x[1]), *(x[1] - x[2]), *(x[3] - x[2]))[0]
        assert abs(found) == pytest.approx(abs(fold), abs=1e-15)
        assert found == angles_at(x.T, np.array([[0, 1, 2, 3]]))[0]
        assert angles_at(x.T, np.array([[0, 1, 3]]))[0] == angle_gradient(*(x[0] - x[1]), *(x[3] - x[1]))[0]


# Drag on a triangle

WIND = Uniform(velocity=(3.0, -1.0, 2.0))


def plate(area: Any, velocity: Any = (0.0, 0.0, 0.0)) -> Triangle:
    return Triangle(*area, Particle(0.0, 0.0, 0.0, *velocity, 0.0, 0.0, 0.0, 0.0))


def test_a_plate_across_the_wind_and_one_along_it() -> None:
    drag = SheetDrag(density=1.2, normal_coefficient=1.1, tangential_coefficient=0.03, flow=(WIND,))
    u = np.array(WIND.velocity)
    speed, along = np.linalg.norm(u), np.cross(u, (0, 0, 1))
    across = triangle_force(drag.record(), plate(0.5 * u / speed))
    np.testing.assert_allclose(across, 0.5 * 1.2 * 1.1 * 0.5 * speed * u, rtol=1e-14)
    tangential = triangle_force(drag.record(), plate(0.5 * along / np.linalg.norm(along)))
    np.testing.assert_allclose(tangential, 0.5 * 1.2 * 0.03 * 0.5 * speed * u, rtol=1e-13, atol=1e-15)


def test_drag_on_a_plate_only_takes_energy_and_does_not_know_its_front() -> None:
    drag = SheetDrag(fluid="air").record()
    rng = np.random.default_rng(4)
    for _ in range(50):
        area, velocity = rng.normal(size=3), rng.normal(size=3)
        force = np.array(triangle_force(drag, plate(area, velocity)))
        assert force @ velocity < 0
        np.testing.assert_array_equal(triangle_force(drag, plate(-area, velocity)), force)
    assert triangle_force(drag, plate((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))) == (0, 0, 0)
    assert triangle_force(drag, plate((1.0, 0.0, 0.0))) == (0, 0, 0)


@pytest.mark.parametrize("closed", [False, True])
def test_jacobian_of_the_drag_on_a_plate(closed: bool) -> None:
    drag = SheetDrag(fluid="air", tangential_coefficient=0.3, flow=(WIND,)).surface_record(closed)
    rng = np.random.default_rng(4)
    for _ in range(30):
        area, velocity = rng.normal(size=3), rng.normal(size=3)
        exact = np.reshape(triangle_force_dv(drag, plate(area, velocity)), (3, 3))
        numeric = differences(lambda v, a=area: np.array(triangle_force(drag, plate(a, v))), velocity, H)
        np.testing.assert_allclose(exact, numeric, atol=10 * TOLERANCE * np.abs(numeric).max())
        np.testing.assert_allclose(exact, exact.T, atol=4 * EPS * np.abs(exact).max())
        assert np.linalg.eigvalsh(exact).max() <= 4 * EPS * np.abs(exact).max()
    for still in (plate((0.0, 0.0, 0.0)), plate((1.0, 0.0, 0.0), WIND.velocity)):
        assert np.abs(triangle_force_dv(drag, still)).max() == 0


def test_the_lee_of_a_closed_surface_is_not_pushed() -> None:
    drag = SheetDrag(fluid="air", tangential_coefficient=0.0, flow=(WIND,)).surface_record(True)
    assert triangle_force(drag, plate(WIND.velocity)) == (0, 0, 0)
    windward = triangle_force(drag, plate([-w for w in WIND.velocity]))
    assert np.dot(windward, WIND.velocity) > 0


# Documentation


@pytest.mark.parametrize(
    "model", [Springs, MeshSprings, Angles, Dihedrals, SheetDrag], ids=lambda m: m.__name__
)
def test_documented_with_units(model: Any) -> None:
    assert model.__doc__
    assert sys.modules[model.__module__].__doc__
    for name in model.model_fields:
        assert name == "type" or field_docs(model).get(name), f"{model.__name__}.{name} has no description"
    assert [path for path in numbers_without_unit(model.model_json_schema()) if "/axis/" not in path] == []
