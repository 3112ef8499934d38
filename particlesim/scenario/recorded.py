"""Which quantities a scenario's trajectory holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from particlesim.scenario.scenario import Scenario


def recorded_fields(scenario: Scenario) -> tuple[str, ...]:
    """Fields of a scenario's trajectory beside position and id."""
    groups = ("group",) if len(scenario.groups) > 1 else ()
    if scenario.output.fields is not None:
        return (*scenario.output.fields, *groups)
    fields = ["velocity"]
    if any(group.has_radius() for group in scenario.groups):
        fields.append("radius")
    if any(group.temperature is not None for group in scenario.groups):
        fields.append("temperature")
    return (*fields, *groups)
