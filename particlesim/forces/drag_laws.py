"""Factors of aerodynamic drag that may be numbers or laws: density, drag coefficient, cross-section.

Each is a record, so that the compiled drag holds only what the scenario uses.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from particlesim.laws.registry import Particle, evaluate, generic, law


@generic(1)
def density(f: Any, p: Particle) -> float:
    """Density of the fluid at the particle's place [kg/m³]."""
    return evaluate(density, f, p)


@generic(1)
def density_slope(f: Any, p: Particle) -> float:
    """Change of the density with height, dρ/dy [kg/m⁴]."""
    return evaluate(density_slope, f, p)


@generic(1)
def drag_speed(f: Any, q: Particle) -> float:
    """Drag coefficient times speed, c_d |u| [m/s], finite at rest; the velocity u of q is relative to the fluid."""
    return evaluate(drag_speed, f, q)


@generic(1)
def drag_slope(f: Any, q: Particle) -> float:
    """Change of the drag coefficient times speed with the speed, d(c_d |u|)/d|u|, for u ≠ 0."""
    return evaluate(drag_slope, f, q)


@generic(1)
def cross_section(f: Any, p: Particle) -> float:
    """Area that the flow sees [m²]."""
    return evaluate(cross_section, f, p)


class Constant(NamedTuple):
    """A number that is the same for all particles, places and times."""

    value: float


class Sphere(NamedTuple):
    """The cross-section π r² of a sphere; `value` is π."""

    value: float


class StandardAtmosphere(NamedTuple):
    """Air by altitude y − sea_level: see `standard_atmosphere`."""

    sea_level: float
    offset: float
    humidity: float


class SchillerNaumann(NamedTuple):
    """c_d(Re) of a sphere in a fluid with kinematic viscosity ν = η/ρ: 24/Re (1 + 0.15 Re^0.687), 0.44 above Re = 1000."""

    nu: float


# International Standard Atmosphere (ISO 2533): troposphere to 11 km, isothermal above it to 20 km.
T0 = 288.15
"""Temperature at sea level [K]."""
P0 = 101325.0
"""Pressure at sea level [Pa]."""
LAPSE = 0.0065
"""Temperature lapse in the troposphere [K/m]."""
R_DRY = 287.05287
"""Gas constant of dry air [J/(kg K)]."""
R_VAPOUR = 461.5
"""Gas constant of water vapour [J/(kg K)]."""
G0 = 9.80665
"""Standard gravity [m/s²]."""
TROPOPAUSE = 11000.0
"""Height of the tropopause [m]."""
T11 = T0 - LAPSE * TROPOPAUSE
P11 = P0 * (T11 / T0) ** (G0 / (LAPSE * R_DRY))


def air_density(y: float, offset: float, humidity: float) -> float:
    """Density of air at altitude y [m] with a temperature offset [K] and a relative humidity (0 to 1) [kg/m³].

    The pressure is the standard one; the temperature the standard one plus the offset; the vapour's share of the
    pressure by Tetens' formula p_s = 610.78 Pa exp(17.27 (T − 273.15)/(T − 35.85)), at most the whole of it.
    """
    if y < TROPOPAUSE:
        standard = T0 - LAPSE * y
        pressure = P0 * (standard / T0) ** (G0 / (LAPSE * R_DRY))
    else:
        standard = T11
        pressure = P11 * math.exp(-G0 * (y - TROPOPAUSE) / (R_DRY * T11))
    t = standard + offset
    vapour = humidity * min(610.78 * math.exp(17.27 * (t - 273.15) / (t - 35.85)), pressure)
    return (pressure - vapour) / (R_DRY * t) + vapour / (R_VAPOUR * t)


@law(density, Constant)
def constant_density(f: Constant, p: Particle) -> float:
    return f.value


@law(density, StandardAtmosphere)
def standard_atmosphere(f: StandardAtmosphere, p: Particle) -> float:
    return air_density(p.y - f.sea_level, f.offset, f.humidity)


@law(density_slope, Constant)
def constant_density_slope(f: Constant, p: Particle) -> float:
    return f.value - f.value


@law(density_slope, StandardAtmosphere)
def standard_atmosphere_slope(f: StandardAtmosphere, p: Particle) -> float:
    # Central difference over 2 m: the relative error of the smooth profile is (1 m / 8.4 km)² / 6.
    y = p.y - f.sea_level
    return (air_density(y + 1, f.offset, f.humidity) - air_density(y - 1, f.offset, f.humidity)) / 2


def speed(q: Particle) -> float:
    """|u|."""
    return np.sqrt(q.vx * q.vx + q.vy * q.vy + q.vz * q.vz)


@law(drag_speed, Constant)
def constant_drag_speed(f: Constant, q: Particle) -> float:
    return f.value * speed(q)


@law(drag_slope, Constant)
def constant_drag_slope(f: Constant, q: Particle) -> float:
    return f.value


# With Re = 2 r |u| / ν, 24/Re |u| = 12 ν/r: no division by the speed is left. A point (r = 0) has no cross-section.
_POINT = 1e-100


@law(drag_speed, SchillerNaumann)
def schiller_naumann(f: SchillerNaumann, q: Particle) -> float:
    u = speed(q)
    re = 2 * q.r * u / f.nu
    return 12 * f.nu / max(q.r, _POINT) * (1 + 0.15 * re**0.687) if re < 1000 else 0.44 * u


@law(drag_slope, SchillerNaumann)
def schiller_naumann_slope(f: SchillerNaumann, q: Particle) -> float:
    re = 2 * q.r * speed(q) / f.nu
    return 24 * 0.15 * 0.687 * re ** (0.687 - 1) if re < 1000 else 0.44


@law(cross_section, Constant)
def constant_area(f: Constant, p: Particle) -> float:
    return f.value


@law(cross_section, Sphere)
def sphere_area(f: Sphere, p: Particle) -> float:
    return f.value * p.r * p.r
