"""The duration of soft contacts, and the steps that resolve it: for warnings before a run, when nothing is in contact
yet."""

from __future__ import annotations

import math

RESOLVES = 20
"""Steps that a contact should take: a spring and a damper then lose some thousandths of what they should not."""
RAYLEIGH = 0.2
"""Part of Rayleigh's time that a step of grains may take (Y. Li, Y. Xu, C. Thornton, Powder Technol. 160, 219 (2005))."""


def contact_time(stiffness: float, beta: float, mass: float) -> float:
    """How long a linear contact of stiffness [N/m], damping ratio β and reduced mass [kg] lasts [s]: half a period of its
    damped oscillator, or of the undamped one where it does not swing."""
    damped = 1 - beta**2
    return math.pi * math.sqrt(mass / stiffness / (damped if damped > 0 else 1.0))


def rayleigh_time(young_modulus: float, poisson_ratio: float, mass: float, radius: float) -> float:
    """How long Rayleigh's wave takes over half of a grain's circumference [s]: π r √(ρ/G)/(0.1631 ν + 0.8766)."""
    if radius == 0:
        return math.inf
    density = mass / (4 / 3 * math.pi * radius**3)
    shear = young_modulus / (2 * (1 + poisson_ratio))
    return math.pi * radius * math.sqrt(density / shear) / (0.1631 * poisson_ratio + 0.8766)
