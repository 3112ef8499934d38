"""What every registered force and flow must hold: F = −∇U, Jacobians, and documentation. The checks are those of
`particlesim.testing`, which packages with forces of their own use as well."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from contract.cases import FLOW_CASES, FORCE_CASES, exercised, particles
from contract.pair_cases import records as pair_records

from particlesim.extensions.requirements import undocumented
from particlesim.flows import FLOWS, Flow
from particlesim.flows.vortex import Vortex
from particlesim.forces import FORCES, OPEN_FORCES, Attractor, Drag, Force, LinearDrag
from particlesim.forces.drag import Atmosphere
from particlesim.forces.drag_laws import StandardAtmosphere, density
from particlesim.laws.registry import (
    GENERICS,
    force,
    force_dv,
    force_dx,
    has_law,
    potential,
    velocity,
    velocity_dx,
)
from particlesim.testing import check_jacobian, check_potential, check_reads, scale

PARTICLES = particles()

forces = pytest.mark.parametrize("model", FORCE_CASES.values(), ids=FORCE_CASES)
flows = pytest.mark.parametrize("model", FLOW_CASES.values(), ids=FLOW_CASES)


def test_every_registered_class_and_record_is_reached() -> None:
    assert {type(f) for f in FORCE_CASES.values()} == set(FORCES)
    assert {type(f) for f in FLOW_CASES.values()} == set(FLOWS)
    registered = {record for generic in GENERICS.values() for record in generic.laws}
    # Not those of the engine, of bonds and surfaces (test_bonds), nor paths, which are no forces, of particles or colliders
    # (test_moving_colliders).
    beyond = (
        "particlesim.engine.",
        "particlesim.bonds.",
        "particlesim.colliders.moving",
        "particlesim.groups.motion",
        "particlesim.forces.sheet_drag",
    )
    package = {r for r in registered if r.__module__.startswith("particlesim.")}
    package = {r for r in package if not r.__module__.startswith(beyond)}
    assert package - exercised() - pair_records() == set()


@forces
def test_force_is_minus_the_gradient_of_its_potential(model: Force) -> None:
    check_potential(model, PARTICLES)


@forces
def test_jacobian_by_position(model: Force) -> None:
    check_jacobian(force_dx, force, model.record(), PARTICLES, "x y z")


@forces
def test_jacobian_by_velocity(model: Force) -> None:
    check_jacobian(force_dv, force, model.record(), PARTICLES, "vx vy vz")


@forces
def test_forces_read_only_what_they_say(model: Force) -> None:
    check_reads(model, PARTICLES)


@pytest.mark.parametrize("cls", FORCES, ids=lambda c: c.__name__)
def test_potentials_are_as_documented(cls: type[Force]) -> None:
    records = [f.record() for f in FORCE_CASES.values() if type(f) is cls]
    some = any(has_law(potential, r) for r in records)
    assert some != cls.energy.startswith("none")


@flows
def test_gradient_of_flows(model: Flow) -> None:
    check_jacobian(velocity_dx, velocity, model.record(), PARTICLES, "x y z")


@flows
def test_flows_are_divergence_free(model: Flow) -> None:
    for p in PARTICLES:
        g = velocity_dx(model.record(), p)
        assert abs(g[0] + g[4] + g[8]) <= 8 * np.finfo(float).eps * scale(g)


# Special places


@pytest.mark.parametrize("exponent", [2.0, 1.0, 3.0, -1.0, 2.5])
def test_softened_centre_of_an_attractor_is_a_harmonic_well(exponent: float) -> None:
    # f = −μ m l ε^−(n+1) to first order in l
    model = Attractor(strength=2.0, exponent=exponent, softening=0.5)
    p = PARTICLES[0]._replace(x=0.0, y=0.0, z=0.0)
    assert scale(force(model.record(), p)) == 0
    k = 2.0 * p.m / 0.5 ** (exponent + 1)
    np.testing.assert_allclose(np.reshape(force_dx(model.record(), p), (3, 3)), -k * np.eye(3), rtol=1e-14)


def test_a_linear_attractor_needs_no_softening() -> None:
    model = Attractor(strength=2.0, exponent=-1.0)
    p = PARTICLES[0]._replace(x=0.0, y=0.0, z=0.0)
    np.testing.assert_allclose(np.reshape(force_dx(model.record(), p), (3, 3)), -2.0 * p.m * np.eye(3))


@pytest.mark.parametrize("profile", ["rankine", "lamb_oseen"])
def test_vortex_turns_like_a_solid_body_on_its_axis(profile: Any) -> None:
    # w = Γ/(2πa²) a × d near the axis, for both profiles
    model = Vortex(axis=(0, 0, 1), circulation=3.0, core_radius=0.7, profile=profile)
    rate = 3.0 / (2 * np.pi * 0.7**2)
    for x in (0.0, 1e-200, 1e-9, 1e-5):
        p = PARTICLES[0]._replace(x=x, y=0.0)
        np.testing.assert_allclose(velocity(model.record(), p), (0, rate * x, 0), rtol=1e-9, atol=0)
        expected = [[0, -rate, 0], [rate, 0, 0], [0, 0, 0]]
        np.testing.assert_allclose(
            np.reshape(velocity_dx(model.record(), p), (3, 3)), expected, rtol=1e-9, atol=1e-9
        )


def test_lamb_oseen_gradient_where_the_series_takes_over() -> None:
    model = Vortex(axis=(0, 0, 1), circulation=3.0, core_radius=1.0)
    for s in np.logspace(-8, 0, 33):
        p = PARTICLES[0]._replace(x=float(np.sqrt(s)), y=0.0)
        # dv_θ/dρ = Γ/2π (2 e^−s − (1 − e^−s)/s), all of its terms known to rounding
        exact = 3.0 / (2 * np.pi) * (2 * np.exp(-s) + np.expm1(-s) / s)
        assert velocity_dx(model.record(), p)[3] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    "model",
    [Drag(fluid="air"), LinearDrag(coefficient=2.0), Drag(fluid="air", coefficient="schiller_naumann")],
    ids=["constant", "linear", "schiller_naumann"],
)
def test_drag_at_rest_relative_to_the_fluid(model: Force) -> None:
    p = PARTICLES[0]._replace(vx=0.0, vy=0.0, vz=0.0)
    assert scale(force(model.record(), p)) == 0
    # c_d(Re) joins Stokes' law: −6 π η r; with a constant c_d the drag is of second order
    slope = {"linear_drag": 2.0, "drag": 0.0}[model.type]
    if isinstance(model, Drag) and model.coefficient == "schiller_naumann":
        slope = 6 * np.pi * 1.81e-5 * p.r
    np.testing.assert_allclose(
        np.reshape(force_dv(model.record(), p), (3, 3)), -slope * np.eye(3), rtol=1e-14
    )
    if slope:
        slow = p._replace(vx=1e-18)
        assert force(model.record(), slow)[0] == pytest.approx(-slope * 1e-18, rel=1e-9)


@pytest.mark.parametrize("coefficient", [0.47, "schiller_naumann"])
def test_drag_on_a_point_vanishes(coefficient: Any) -> None:
    record = Drag(fluid="air", coefficient=coefficient).record()
    for p in PARTICLES:
        assert scale(force(record, p._replace(r=0.0))) == 0


@pytest.mark.parametrize(
    ("altitude", "expected"), [(0.0, 1.2250), (2000.0, 1.00655), (11000.0, 0.36391), (20000.0, 0.08803)]
)
def test_standard_atmosphere(altitude: float, expected: float) -> None:
    # Table of ISO 2533, geopotential altitude
    p = PARTICLES[0]._replace(y=altitude)
    assert density(StandardAtmosphere(0.0, 0.0, 0.0), p) == pytest.approx(expected, rel=1e-4)


def test_air_stays_air_in_every_allowed_atmosphere() -> None:
    for offset in (-100.0, -60.0, 0.0, 60.0, 100.0):
        for humidity in (0.0, 1.0):
            record = Drag(density=Atmosphere(temperature_offset=offset, humidity=humidity)).record()
            for y in (-5e3, 0.0, 11e3, 20e3, 80e3):
                p = PARTICLES[0]._replace(y=y)
                assert density(record.density, p) > 0
    for offset in (-300.0, 1000.0):
        with pytest.raises(ValueError, match="temperature_offset"):
            Atmosphere(temperature_offset=offset)


def test_humid_air_is_lighter() -> None:
    # 30 °C, saturated, sea level: 1.1462 kg/m³ against 1.1644 dry
    p = PARTICLES[0]._replace(y=0.0)
    assert density(StandardAtmosphere(0.0, 15.0, 1.0), p) == pytest.approx(1.1462, rel=5e-4)
    assert density(StandardAtmosphere(0.0, 15.0, 0.0), p) == pytest.approx(1.1644, rel=5e-4)


# Documentation


@pytest.mark.parametrize("cls", [*FORCES, *FLOWS, Atmosphere], ids=lambda c: c.__name__)
def test_documented(cls: Any) -> None:
    assert sys.modules[cls.__module__].__doc__
    assert undocumented(cls, OPEN_FORCES.texts if issubclass(cls, Force) else ()) == []


@pytest.mark.parametrize(
    "cls",
    [c for c in FORCES if c.__name__ not in ("Gravity", "PointSpring", "LinearDrag", "Field")],
    ids=lambda c: c.__name__,
)
def test_sources_are_named(cls: type[Force]) -> None:
    doc = sys.modules[cls.__module__].__doc__ or ""
    assert "Source:" in doc or ("(" in doc and any(char.isdigit() for char in doc))
