"""Steps that are too long for contacts: told before a run, as particles that do not touch yet show nothing of it."""

from __future__ import annotations

import math

from particlesim.groups.group import Group
from particlesim.interactions.contact import Contact
from particlesim.sampling.distributions import Distribution, smallest
from particlesim.scenario.reach import interacting
from particlesim.scenario.scenario import Scenario

RESOLVES = 20
"""Steps that a contact should take: a spring and a damper then lose some thousandths of what they should not."""
RAYLEIGH = 0.2
"""Part of Rayleigh's time that a step of grains may take (Y. Li, Y. Xu, C. Thornton, Powder Technol. 160, 219 (2005))."""


def contact_doubts(scenario: Scenario) -> list[str]:
    """A sentence for every interaction whose contacts dt does not resolve, or whose friction is doubtful."""
    found = []
    for each in scenario.interactions:
        if not isinstance(each, Contact):
            continue
        static, kinetic = each.coefficients
        if kinetic > static:
            found.append(
                f"{each.label}: the coefficient of kinetic friction {kinetic:g} is above the static one {static:g}: what "
                "begins to slide is held back more than what lies"
            )
        sizes = [size for group in interacting(each, scenario.groups) if (size := least_size(group))]
        if sizes and each.model != "impulse":
            found += _too_long(each, min(sizes), scenario.grid.dt)
    return found


def _too_long(each: Contact, size: tuple[float, float], dt: float) -> list[str]:
    mass, radius = size
    if each.model == "linear":
        lasts = contact_time(each, mass / 2)
        if dt <= lasts / RESOLVES:
            return []
        return [
            f"{each.label}: a contact of the lightest particles lasts {lasts:.3g} s, {lasts / dt:.3g} steps; "
            f"restitution needs about {RESOLVES}, dt = {lasts / RESOLVES:.2g} s"
        ]
    rayleigh = rayleigh_time(each, mass, radius)
    if radius == 0 or dt <= RAYLEIGH * rayleigh:
        return []
    return [
        f"{each.label}: Rayleigh's time of the smallest grains is {rayleigh:.3g} s, {rayleigh / dt:.3g} steps; contacts "
        f"need steps of a fifth of it, dt = {RAYLEIGH * rayleigh:.2g} s"
    ]


def contact_time(each: Contact, mass: float) -> float:
    """How long a `linear` contact of a reduced mass [kg] lasts [s]: half a period of its damped oscillator."""
    assert each.stiffness is not None
    damped = 1 - each.beta**2
    return (
        math.pi * math.sqrt(mass / each.stiffness / damped)
        if damped > 0
        else math.pi * math.sqrt(mass / each.stiffness)
    )


def rayleigh_time(each: Contact, mass: float, radius: float) -> float:
    """How long Rayleigh's wave takes over half of a grain's circumference [s]: π r √(ρ/G)/(0.1631 ν + 0.8766)."""
    assert each.young_modulus is not None
    if radius == 0:
        return math.inf
    density = mass / (4 / 3 * math.pi * radius**3)
    shear = each.young_modulus / (2 * (1 + each.poisson_ratio))
    return math.pi * radius * math.sqrt(density / shear) / (0.1631 * each.poisson_ratio + 0.8766)


def least_size(group: Group) -> tuple[float, float] | None:
    """Mass [kg] and radius [m] of the smallest particle that a scenario gives a group; None where it does not tell."""
    mass, radius = (_least(getattr(group, name)) for name in ("mass", "radius"))
    volume = 4 / 3 * math.pi
    if group.density is not None and radius is not None:
        return volume * group.density * radius**3, radius
    if group.density is not None and mass is not None:
        return mass, (mass / (volume * group.density)) ** (1 / 3)
    return None if radius is None else (1.0 if mass is None else mass, radius)


def _least(value: float | tuple[float, ...] | Distribution | None) -> float | None:
    if value is None:
        return None
    least = smallest(value)
    return least if least > 0 else None
