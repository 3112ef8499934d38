"""Checks for forces and flows of your own, to be called from the tests of a package.

    from particlesim.testing import check_force

    def test_axis_pull() -> None:
        check_force(AxisPull(pull=2.0))

They are those that psim's own forces and flows are held to. Each raises AssertionError with what is wrong.

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


def _check_described(model: Any, texts: Sequence[str], laws: Sequence[Callable[..., Any]]) -> None:
    missing = undocumented(type(model), texts)
    assert not missing, f"{type(model).__name__}: {'; '.join(missing)}"
    assert type_name(type(model)), f'{type(model).__name__} needs a field type: Literal["name"] = "name"'
    fault = unlawful(model.record(), laws)
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


def check_compiled(record: Any, laws: Sequence[Callable[..., Any]], points: Sequence[Particle]) -> None:
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


def differences(f: Callable[[Particle], Any], p: Particle, names: str, h: float = H) -> NDArray[np.float64]:
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
