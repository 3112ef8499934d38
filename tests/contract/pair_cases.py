"""Every interaction with enough variants to reach every record, and pairs to try them on."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from contract.cases import records_in

from particlesim.interactions import PairInteraction
from particlesim.interactions.contact import Contact
from particlesim.interactions.coulomb import Coulomb
from particlesim.interactions.flocking import Flocking
from particlesim.interactions.formula import PairFormula
from particlesim.interactions.friction import PairFriction
from particlesim.interactions.gravity import MutualGravity
from particlesim.interactions.lennard_jones import LennardJones
from particlesim.interactions.morse import Morse
from particlesim.interactions.power_law import PairPowerLaw
from particlesim.interactions.soft_sphere import SoftSphere
from particlesim.interactions.yukawa import Yukawa
from particlesim.laws.pair import Pair

PAIR_CASES: dict[str, PairInteraction] = {
    "gravity": MutualGravity(constant=2.3),
    "gravity_soft": MutualGravity(constant=2.0, softening=0.4),
    "gravity_spline": MutualGravity(constant=2.3, softening=0.55, softened="spline"),
    "coulomb": Coulomb(constant=3.0),
    "coulomb_water": Coulomb(relative_permittivity=80.0, softening=0.3),
    "coulomb_shifted": Coulomb(constant=3.0, cutoff=2.5, shift="force"),
    "power_law": PairPowerLaw(strength=2.0, exponent=2.5, softening=0.2),
    "power_spring": PairPowerLaw(strength=2.0, exponent=-1.0),
    "power_repels": PairPowerLaw(strength=-2.0, exponent=3.0),
    "power_logarithm": PairPowerLaw(strength=2.0, exponent=1.0, softening=0.1),
    "lennard_jones": LennardJones(epsilon=1.5, sigma=0.9),
    "lennard_jones_energy": LennardJones(epsilon=1.5, sigma=0.9, cutoff=2.2, shift="energy"),
    "lennard_jones_force": LennardJones(epsilon=1.5, sigma=0.9, cutoff=2.2, shift="force"),
    "lennard_jones_mixed": LennardJones(epsilon={"a": 1.5, "b": 0.7}, sigma=0.9, cutoff=2.2, shift="force"),
    "morse": Morse(depth=2.0, width=1.3, distance=1.1),
    "yukawa": Yukawa(strength=2.0, screening_length=0.8),
    "yukawa_shifted": Yukawa(strength=-2.0, screening_length=0.8, cutoff=2.0, shift="energy"),
    "soft_sphere": SoftSphere(epsilon=3.0, sigma=1.4),
    "soft_sphere_hertz": SoftSphere(epsilon=3.0, sigma=1.4, exponent=2.5),
    "soft_sphere_radii": SoftSphere(epsilon=3.0),
    "formula": PairFormula(potential="k*m1*m2*exp(-r/a)*cos(t)", constants={"k": 2.0, "a": 0.7}),
    "formula_all": PairFormula(potential="q1*q2/r + (r1 + r2 - r)**2", cutoff=2.5, shift="force"),
    "friction": PairFriction(coefficient=1.7, range=2.1),
    "thermostat": PairFriction(coefficient=1.7, range=2.1, temperature=0.8, boltzmann=1.0),
    "flocking": Flocking(sight=2.3, distance=1.4, separation=3.0, alignment=0.8, cohesion=0.6),
    "contact_linear": Contact(model="linear", stiffness=30.0, restitution=0.6, friction=0.3),
    "contact_hertz": Contact(model="hertz", young_modulus=200.0, restitution=0.9),
    "contact_elastic": Contact(model="hertz", young_modulus=200.0),
    "contact_jkr": Contact(model="hertz", young_modulus=200.0, restitution=0.9, cohesion=0.5, adhesion="jkr"),
    "contact_impulse": Contact(model="impulse", restitution=0.6),
    "flocking_apart": Flocking(sight=2.3, cohesion=0.6),
}


def record_of(model: PairInteraction) -> Any:
    """The record of a case in a run with steps of 0.1 s."""
    return model.in_steps(0.1, 5)


def records() -> set[type]:
    """All record types that the cases reach."""
    tops = map(record_of, PAIR_CASES.values())
    return {type(r) for r in itertools.chain.from_iterable(map(records_in, tops))}


def pairs(n: int = 40, seed: int = 1) -> list[Pair]:
    """Random pairs: 0.7 to 1.9 m apart, 3 m/s, 0.5 to 2 kg, radii of 0.4 to 0.9 m, charges of ±2 C; away from the places
    where a case has a kink."""
    rng = np.random.default_rng(seed)
    found: list[Pair] = []
    while len(found) < n:
        direction = rng.normal(size=3)
        r = rng.uniform(0.7, 1.9)
        line = r * direction / np.linalg.norm(direction)
        v = rng.uniform(-3, 3, 3)
        m, radius, q, a, b = (
            rng.uniform(*ends, 2) for ends in ((0.5, 2), (0.4, 0.9), (-2, 2), (0.4, 0.5), (1, 3))
        )
        numbers: list[Any] = [*line, *v, *m, *radius, *q, 0.3, *a, *b]
        if min(abs(r - 1.4), abs(r - 1.54), abs(r - 0.77), abs(r - radius.sum())) > 0.02:
            found.append(Pair(*map(float, numbers), *map(int, rng.integers(0, 1000, 2))))
    return found
