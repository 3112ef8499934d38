"""Compiled laws give the numbers of plain Python.

Compiled code may contract a·b + c into one rounding, share a reciprocal, and has its own exp, sin and pow (≤ 2 ulp), so
results may differ by a few rounding errors of the largest term. Terms here cancel by a factor below 100.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from contract.cases import COLLIDER_RECORDS, EXPRESSIONS, FLOW_CASES, FORCE_CASES, particles, records_in

from particlesim.compiler import compiling_seconds, kernel, told_of_compiling
from particlesim.expressions.operations import Ray, slope, value
from particlesim.expressions.parser import parse
from particlesim.forces.drag_laws import StandardAtmosphere
from particlesim.forces.field import PotentialRecord
from particlesim.laws.registry import (
    Particle,
    contact,
    force,
    force_dv,
    force_dx,
    gap,
    has_law,
    potential,
    velocity,
    velocity_dx,
)
from particlesim.testing import compiled

PARTICLES = particles(12)
EPS = np.finfo(float).eps


def tolerance(generic: Callable[..., Any], record: Any) -> float:
    """Rounding errors of the largest number, relative."""
    differences = generic is force_dx and {PotentialRecord, StandardAtmosphere} & {
        type(r) for r in records_in(record)
    }
    # Finite differences of ρ over 2 m, 1/4000 of its scale height, and of ∇U over 10⁻⁵ of the scale, enlarge them.
    return (1e6 if differences else 128) * EPS


def check(generic: Callable[..., Any], records: list[Any], points: list[Any]) -> None:
    actual = compiled(generic, records, points)
    for k, record in enumerate(records):
        expected = np.array([np.atleast_1d(generic(record, p)) for p in points], float)
        assert np.isfinite(expected).all(), record
        scale = np.abs(expected).max()
        np.testing.assert_allclose(
            actual[k], expected, rtol=0, atol=tolerance(generic, record) * scale, err_msg=str(record)
        )


@pytest.mark.parametrize("generic", [force, potential, force_dx, force_dv], ids=lambda g: g.__name__)
def test_forces(generic: Callable[..., Any]) -> None:
    records = [r for f in FORCE_CASES.values() if has_law(generic, r := f.record())]
    check(generic, records, PARTICLES)


@pytest.mark.parametrize("generic", [velocity, velocity_dx], ids=lambda g: g.__name__)
def test_flows(generic: Callable[..., Any]) -> None:
    check(generic, [f.record() for f in FLOW_CASES.values()], PARTICLES)


@pytest.mark.parametrize("generic", [force, force_dx, velocity_dx], ids=lambda g: g.__name__)
def test_sums(generic: Callable[..., Any]) -> None:
    cases: Any = FLOW_CASES if generic is velocity_dx else FORCE_CASES
    records = [f.record() for f in list(cases.values())[:3]]
    check(generic, [(), (records[1],), tuple(records)], PARTICLES)


@pytest.mark.parametrize("generic", [value, slope], ids=lambda g: g.__name__)
def test_expressions(generic: Callable[..., Any]) -> None:
    records = [parse(text, {}) for text in EXPRESSIONS]
    direction = Particle(0.3, -0.5, 0.7, 0.2, 0.1, -0.4, 0.5, 0.6, 0.7, 0.8)
    points = PARTICLES if generic is value else [Ray(p, direction) for p in PARTICLES]
    check(generic, records, points)


def test_gaps() -> None:
    check(gap, list(COLLIDER_RECORDS.values()), PARTICLES)


@kernel
def contacts_with(records: Any, p: Any) -> Any:
    return tuple((*q, outcome) for q, outcome in (contact(each, p) for each in records))


def test_contacts() -> None:
    records = tuple(COLLIDER_RECORDS.values())
    outcomes = set()
    for p in PARTICLES:
        for record, (*q, outcome) in zip(records, contacts_with(records, p), strict=True):
            expected, what = contact(record, p)
            assert outcome == what
            # the normal of a spline is a sum of 64 terms, of others of a few
            roundings = 24 if record is COLLIDER_RECORDS["distance_grid"] else 8
            np.testing.assert_allclose(q, expected, rtol=0, atol=roundings * EPS * np.abs(p[:6]).max())
            outcomes.add(outcome)
    assert outcomes == {0, 1, 2, 3, 4}


def test_the_time_of_compiling_is_known() -> None:
    @kernel
    def next_to(x: int) -> int:
        return x + 1

    heard: list[bool] = []
    before = compiling_seconds()
    with told_of_compiling(heard.append):
        assert next_to(1) == 2
    assert heard == [True, False]
    took = compiling_seconds() - before
    assert took > 0
    assert compiling_seconds() == before + took
