"""Heavy bodies among so many light ones that what presses on these may not be found."""

from __future__ import annotations

from particlesim.engine.rigid.equations import MOST_BODIES, STEEP
from particlesim.scenario.scenario import Scenario


def too_heavy(scenario: Scenario) -> list[str]:
    """A sentence where bodies are so heavy, and so many, that impulses under heavy ones are not found."""
    number = sum(1 if body.layout is None else body.layout.number() or 0 for body in scenario.bodies)
    if number <= MOST_BODIES:
        return []
    masses = {body.name: body.weight for body in scenario.bodies}
    heavy, light = max(masses, key=lambda name: masses[name]), min(masses, key=lambda name: masses[name])
    ratio = masses[heavy] / masses[light]
    if not ratio >= STEEP:
        return []
    return [
        f"bodies {heavy!r} have {ratio:.3g} times the mass of {light!r} ({masses[heavy]:.3g} kg, {masses[light]:.3g} kg): "
        f"where more than {MOST_BODIES} of the {number} bodies touch, impulses are found by sweeps alone, and what is heavy "
        "sinks into what is light below it; masses that are more alike, fewer bodies, or heavy ones below help"
    ]
