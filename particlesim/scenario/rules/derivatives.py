"""Implicit methods need the derivatives of every force that acts on their groups."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.integrators import ImplicitMethod, method_for
from particlesim.laws.registry import force_dv, force_dx, has_law, triangle_force_dv
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import acts_on, group_tables, interacting
from particlesim.scenario.tables import Tables

HINT = (
    "an explicit method steps it, rk4 or symplectic_euler for instance; or name its groups with on = [...]; a jump can be "
    "made a steep slope, as in tanh(vx/0.01) for sign(vx)"
)


def undifferentiable(scenario: Tables) -> Iterator[Invalid]:
    """Forces without derivatives on groups that an implicit method steps."""
    implicit = {
        group.name: (path, method.name)
        for path, group in group_tables(scenario)
        if isinstance(
            method := method_for(group.integrator or scenario.simulation.integrator), ImplicitMethod
        )
    }
    for place, what, why, names in _without_derivatives(scenario):
        for name in names:
            if name in implicit:
                path, stepper = implicit[name]
                yield Invalid(
                    f"{stepper} needs the derivatives of every force, and {what} {why}",
                    place,
                    ((path, f"stepped by {stepper}"),),
                    hint=HINT,
                )
                break


def _without_derivatives(scenario: Tables) -> Iterator[tuple[Path, str, str, list[str]]]:
    """Every force without derivatives: its place, its name, why it has none, and the groups that it acts on."""
    for k, (label, force) in enumerate(zip(scenario.labels.forces, scenario.forces, strict=True)):
        groups = [group.name for group in scenario.groups if acts_on(force, group)]
        needed = (triangle_force_dv,) if force.on_surfaces else (force_dx, force_dv)
        if not all(has_law(derivative, force.record()) for derivative in needed):
            yield ("forces", k), label, "has no law for them", groups
        elif force.kink() is not None and (jump := force.jump()) is not None:
            key, cause = jump
            yield ("forces", k, *key), label, f"has none where it jumps ({cause})", groups
    for k, each in enumerate(scenario.interactions):
        if (found := each.jump()) is not None:
            names = [group.name for group in interacting(each, scenario.groups)]
            why = f"has none at r = {found.at:.4g} m, where its {found.of} jumps"
            yield ("interactions", k, "potential"), each.label, why, names
