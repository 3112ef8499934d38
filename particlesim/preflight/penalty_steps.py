"""Steps that are too long for surfaces that push back: told before a run, as nothing touches them yet."""

from __future__ import annotations

import math

from particlesim.groups.group import Group
from particlesim.preflight.contact_steps import least_size
from particlesim.sampling.distributions import smallest
from particlesim.scenario.reach import held_back
from particlesim.scenario.scenario import Scenario

RESOLVES = 20
"""Steps that a touch should take: the kicks are of first order in the step."""


def penalty_doubts(scenario: Scenario) -> list[str]:
    """A sentence for every collider whose spring the lightest particles make too fast for dt.

    With ω = √(k/m), kicks by the spring and drifts are stable for h ω < 2: the determinant (1 − a)/(1 + a) and the trace
    1 + (1 − a − h² ω²)/(1 + a) of a step with a damper, a = h c/2m, meet the conditions of Jury.
    """
    found = []
    for k, each in enumerate(scenario.all_colliders):
        if each.contact != "penalty" or each.stiffness is None:
            continue
        touching = [group for group in scenario.groups if held_back(each, (group.name,))]
        masses = [mass for group in touching if (mass := least_mass(group)) is not None]
        if not masses:
            continue
        mass, dt = min(masses), scenario.grid.dt
        omega = math.sqrt(each.stiffness / mass)
        stable = 2 / omega
        name = f"{each.kind} {each.name or k}"
        if dt >= stable:
            found.append(
                f"{name}: its spring throws particles of {mass:.3g} kg out with more energy than they come in "
                f"with: dt must be below {stable:.3g} s for them, and is {dt:.3g} s"
            )
        elif dt > (lasts := math.pi / omega) / RESOLVES:
            found.append(
                f"{name}: a touch of the lightest particles lasts {lasts:.3g} s, {lasts / dt:.3g} steps; its spring needs "
                f"about {RESOLVES}, dt = {lasts / RESOLVES:.2g} s"
            )
    return found


def least_mass(group: Group) -> float | None:
    """Mass of the lightest particle that a scenario gives a group [kg]; None where it does not tell."""
    if group.density is not None:
        size = least_size(group)
        return None if size is None else size[0]
    if group.mass is None:
        return 1.0
    least = smallest(group.mass)
    return least if least > 0 else None
