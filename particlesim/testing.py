"""Checks for forces, flows and interactions of your own, to be called from the tests of a package.

    from particlesim.testing import check_force

    def test_axis_pull() -> None:
        check_force(AxisPull(pull=2.0))

They are those that psim's own types are held to. Each raises AssertionError with what is wrong.

Derivatives are compared with the five-point central difference, whose error is h⁴ f⁽⁵⁾/30 + 1.5 ε |f|/h. With h = 10⁻³ m
(or m/s), and fifth derivatives up to about 10⁴ of the scale of f, both are below 10⁻⁹ of that scale; the tolerance of 10⁻⁸
leaves room.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel
from particlesim.extensions.requirements import type_name, undocumented, unlawful
from particlesim.flows import OPEN_FLOWS, Flow
from particlesim.forces import OPEN_FORCES, Force
from particlesim.interactions import OPEN_INTERACTIONS, PairInteraction
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, pair_potential
from particlesim.laws.registry import (
    GENERICS,
    Particle,
    force,
    force_dv,
    force_dx,
    has_law,
    potential,
    velocity,
    velocity_dx,
)
from particlesim.model.attributes import ATTRIBUTES

H = 1e-3
"""Step of differences [m], [m/s]."""
TOLERANCE = 1e-8
"""Of derivatives, relative to the largest component."""
STEEP = 1e-6
"""Of derivatives of pair laws: fifth derivatives of (σ/r)¹² are some 10⁶ of the force's scale, h⁴/30 of which this is."""
COMPILED = 128 * float(np.finfo(float).eps)
"""How far compiled laws may be from plain Python, relative to the largest component: a·b + c may be rounded once, and exp,
sin and pow are psim's own (2 units in the last place)."""


def particles(n: int = 40, seed: int = 1, keep: Callable[[Particle], bool] | None = None) -> list[Particle]:
    """Random particles of human size: coordinates within 2 m, velocities within 3 m/s, 0.5 to 2 kg, radius 0.1 to 0.4 m.

    `keep` says which ones to take, where a law has kinks that differences must stay away from.
    """
    rng = np.random.default_rng(seed)
    found: list[Particle] = []
    while len(found) < n:
        x, y, z = rng.uniform(-2, 2, 3).tolist()
        vx, vy, vz = rng.uniform(-3, 3, 3).tolist()
        m, r, temperature, t = (
            float(rng.uniform(*ends)) for ends in ((0.5, 2), (0.1, 0.4), (250, 350), (0, 2))
        )
        p = Particle(x, y, z, vx, vy, vz, m, r, temperature, t)
        if keep is None or keep(p):
            found.append(p)
    return found


def pairs(n: int = 40, seed: int = 1, keep: Callable[[Pair], bool] | None = None) -> list[Pair]:
    """Random pairs of human size: 0.7 to 1.9 m apart, velocities within 3 m/s, 0.5 to 2 kg, radii of 0.4 to 0.9 m, charges
    within 2 C; what an interaction keeps of particles, a within 0.4 and 0.5, b within 1 and 3.

    `keep` says which ones to take, where a law has kinks that differences must stay away from.
    """
    rng = np.random.default_rng(seed)
    found: list[Pair] = []
    while len(found) < n:
        direction = rng.normal(size=3)
        line = rng.uniform(0.7, 1.9) * direction / np.linalg.norm(direction)
        ends = ((0.5, 2.0), (0.4, 0.9), (-2.0, 2.0), (0.4, 0.5), (1.0, 3.0))
        m, radius, q, a, b = (rng.uniform(*each, 2) for each in ends)
        numbers: list[Any] = [*line, *rng.uniform(-3, 3, 3), *m, *radius, *q, 0.3, *a, *b]
        ids: list[Any] = rng.integers(0, 1000, 2).tolist()
        p = Pair(*(*map(float, numbers), *ids))
        if keep is None or keep(p):
            found.append(p)
    return found


def swapped(p: Pair) -> Pair:
    """The same pair, seen from the second."""
    second = p._replace(m1=p.m2, m2=p.m1, r1=p.r2, r2=p.r1, q1=p.q2, q2=p.q1, id1=p.id2, id2=p.id1)
    second = second._replace(a1=p.a2, a2=p.a1, b1=p.b2, b2=p.b1)
    return second._replace(x=-p.x, y=-p.y, z=-p.z, vx=-p.vx, vy=-p.vy, vz=-p.vz)


def check_force(model: Force, at: Iterable[Particle] | None = None) -> None:
    """Check a force on single particles, at some particles (random ones unless given).

    It is documented and its numbers have units; F = −∇U if it has a potential; its Jacobians, where it has laws for them,
    are the derivatives of F; it reads velocity, radius and temperature only if it says so; the compiled laws give the
    numbers of plain Python. Raises AssertionError.
    """
    points = list(particles() if at is None else at)
    _check_described(model, OPEN_FORCES.texts, OPEN_FORCES.laws)
    some = has_law(potential, model.record())
    assert some != model.energy.startswith("none"), (
        f"energy is {model.energy!r}, but there is {'a' if some else 'no'} law for potential"
    )
    check_reads(model, points)
    check_potential(model, points)
    for generic, names in ((force_dx, "x y z"), (force_dv, "vx vy vz")):
        if has_law(generic, model.record()):
            check_jacobian(generic, force, model.record(), points, names)
    check_compiled(model.record(), OPEN_FORCES.laws, points)


def check_flow(model: Flow, at: Iterable[Particle] | None = None) -> None:
    """Check a flow at some particles (random ones unless given).

    It is documented and its numbers have units; its gradient is the derivative of its velocity; the compiled laws give the
    numbers of plain Python. Raises AssertionError.
    """
    points = list(particles() if at is None else at)
    _check_described(model, OPEN_FLOWS.texts, OPEN_FLOWS.laws)
    if has_law(velocity_dx, model.record()):
        check_jacobian(velocity_dx, velocity, model.record(), points, "x y z")
    check_compiled(model.record(), OPEN_FLOWS.laws, points)


def check_interaction(model: PairInteraction, at: Iterable[Pair] | None = None) -> None:
    """Check an interaction of pairs, at some pairs (random ones unless given).

    It is documented and its numbers have units; the second of a pair feels the opposite of what the first feels; F = −∇U if
    it has a potential; its Jacobians are the derivatives of F; it reads velocities, attributes and the time only if
    `needs_velocity`, `needs` and `changes` say so; the compiled laws give the numbers of plain Python.
    Raises AssertionError.
    """
    points, record = list(pairs() if at is None else at), model.record()
    _check_described(model, OPEN_INTERACTIONS.texts, OPEN_INTERACTIONS.laws, points[0])
    some = has_law(pair_potential, record)
    assert some != model.energy.startswith("none"), (
        f"energy is {model.energy!r}, but there is {'a' if some else 'no'} law for pair_potential"
    )
    for p in points:
        f = pair_force(record, p)
        opposite = tuple(-each for each in pair_force(record, swapped(p)))
        assert np.allclose(f, opposite, rtol=0, atol=COMPILED * scale(f)), (
            f"{model.type} breaks the third law at {p}: {f} on the first, minus {opposite} on the second"
        )
        _check_reads_of_pairs(model, record, p, f)
        if some:
            still = p._replace(vx=0.0, vy=0.0, vz=0.0)  # dampers beside a potential do nothing then
            force = pair_force(record, still)
            gradient = differences(lambda q: pair_potential(record, q), still, "x y z")[0]
            noise = 1.5 * np.finfo(float).eps / H * abs(pair_potential(record, still))
            bound = STEEP * scale(force) + 4 * noise
            np.testing.assert_allclose(force, -gradient, rtol=0, atol=bound, err_msg=f"F is not −∇U at {p}")
        for generic, names in ((pair_force_dx, "x y z"), (pair_force_dv, "vx vy vz")):
            if has_law(generic, record):
                expected = differences(lambda q: pair_force(record, q), p, names)
                np.testing.assert_allclose(
                    np.reshape(np.asarray(generic(record, p), float), (3, 3)),
                    expected,
                    rtol=0,
                    atol=STEEP * scale(expected) + TOLERANCE * scale(f),
                    err_msg=f"{generic.__name__} is not the derivative of pair_force by {names} at {p}",
                )
    check_compiled(record, OPEN_INTERACTIONS.laws, points)


def _check_reads_of_pairs(model: PairInteraction, record: Any, p: Pair, f: Any) -> None:
    """A pair law reads only what it says."""
    if not model.needs_velocity():
        same = f == pair_force(record, p._replace(vx=9.0, vy=-9.0, vz=9.0))
        assert same, f"{model.type} reads the velocity: override needs_velocity"
    if not (model.changes() or model.random()):
        assert f == pair_force(record, p._replace(t=p.t + 1)), (
            f"{model.type} reads the time: override changes"
        )
    for each in ATTRIBUTES.values():
        if each.name not in ("mass", "temperature") and each.name not in model.needs():
            more = {f"{each.symbol}{k}": getattr(p, f"{each.symbol}{k}") + 1 for k in (1, 2)}
            assert f == pair_force(record, p._replace(**more)), (
                f"{model.type} reads the {each.name}: `needs` must name it"
            )


def _check_described(
    model: Any, texts: Sequence[str], laws: Sequence[Callable[..., Any]], *sample: Any
) -> None:
    missing = undocumented(type(model), texts)
    assert not missing, f"{type(model).__name__}: {'; '.join(missing)}"
    assert type_name(type(model)), f'{type(model).__name__} needs a field type: Literal["name"] = "name"'
    fault = unlawful(model.record(), laws, *sample)
    assert fault is None, f"{type(model).__name__}: {fault}"


def check_potential(model: Force, points: Iterable[Particle]) -> None:
    """F = −∇U for particles at rest, if the force has a potential U."""
    record = model.record()
    if not has_law(potential, record):
        return
    for p in points:
        p = p._replace(vx=0.0, vy=0.0, vz=0.0)  # Coriolis does no work and has no potential
        gradient = differences(lambda q: potential(record, q), p, "x y z")[0]
        f = force(record, p)
        noise = 1.5 * np.finfo(float).eps / H * abs(potential(record, p))
        np.testing.assert_allclose(
            f, -gradient, rtol=0, atol=TOLERANCE * scale(f) + 4 * noise, err_msg=f"F is not −∇U at {p}"
        )


def check_jacobian(
    jacobian: Callable[..., Any],
    generic: Callable[..., Any],
    record: Any,
    points: Iterable[Particle],
    names: str,
) -> None:
    """The law for `jacobian` gives the derivatives of the law for `generic` by the particle's `names`."""
    for p in points:
        expected = differences(lambda q: generic(record, q), p, names)
        actual = np.reshape(np.asarray(jacobian(record, p), float), (3, 3))
        np.testing.assert_allclose(
            actual,
            expected,
            rtol=0,
            atol=TOLERANCE * (scale(generic(record, p)) + scale(expected)),
            err_msg=f"{jacobian.__name__} is not the derivative of {generic.__name__} by {names} at {p}",
        )


def check_reads(model: Force, points: Iterable[Particle]) -> None:
    """The force reads the velocity only if `needs_velocity` says so, and attributes only if `needs` names them."""
    record = model.record()
    for p in points:
        f = force(record, p)
        if not model.needs_velocity():
            same = f == force(record, p._replace(vx=9.0, vy=-9.0, vz=9.0))
            assert same, f"{model.type} reads the velocity: override needs_velocity"
        for each in ATTRIBUTES.values():
            if each.name != "mass" and each.name not in model.needs():
                same = f == force(record, p._replace(**{each.symbol: getattr(p, each.symbol) + 1}))
                assert same, f"{model.type} reads the {each.name}: `needs` must name it"


def check_compiled(record: Any, laws: Sequence[Callable[..., Any]], points: Sequence[Any]) -> None:
    """The compiled laws of a record give the numbers of plain Python."""
    for generic in laws:
        if not has_law(generic, record):
            continue
        expected = np.array([np.atleast_1d(generic(record, p)) for p in points], float)
        np.testing.assert_allclose(
            compiled(generic, [record], points)[0],
            expected,
            rtol=0,
            atol=COMPILED * scale(expected),
            err_msg=f"{generic.__name__}, compiled, is not what plain Python gives",
        )


def compiled(
    generic: Callable[..., Any], records: Sequence[Any], points: Sequence[Any]
) -> NDArray[np.float64]:
    """A generic of every record at every point by one compiled function, shape [records, points, size]."""
    out = np.zeros((len(points), len(records), max(GENERICS[generic].size, 1)))
    for i, p in enumerate(points):
        _evaluate_all(generic, tuple(records), p, out[i])
    return out.swapaxes(0, 1)


@kernel
def _evaluate_all(generic: Any, records: Any, p: Any, out: Any) -> None:
    """The generic of every record at a point, into out [records, size]."""
    for k, record in enumerate(records):
        result = generic(record, p)
        for j, number in enumerate(result if isinstance(result, tuple) else (result,)):
            out[k, j] = number


def differences(f: Callable[[Any], Any], p: Any, names: str, h: float = H) -> NDArray[np.float64]:
    """∂f_i/∂name_j by the five-point central difference, shape [components of f, len(names)]."""

    def at(name: str, step: float) -> NDArray[np.float64]:
        return np.atleast_1d(np.asarray(f(p._replace(**{name: getattr(p, name) + step})), float))

    columns = [
        (8 * (at(n, h) - at(n, -h)) - (at(n, 2 * h) - at(n, -2 * h))) / (12 * h) for n in names.split()
    ]
    return np.stack(columns, axis=1)


def scale(values: Any) -> float:
    """The largest absolute value."""
    return float(np.abs(np.asarray(values, float)).max())
