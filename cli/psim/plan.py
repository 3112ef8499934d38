"""What a scenario would run: its size, known before it starts."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psim.console import duration, facts, listed, number, paint, places, warn

if TYPE_CHECKING:
    from particlesim.engine.stability.limits import Stability
    from particlesim.scenario.scenario import Scenario

MOST_PARTICLES = 2_000_000
"""Particles up to which they are placed to look for the largest stable step; a run places them anyway."""
MOST_LED = 50_000
"""The same where particles are led along paths or held by rods: plain Python may have to put them into place."""
MOST_IN_PYTHON = 300
"""Particles that act on each other up to which plain Python looks at their pairs; kernels look at those of more."""


def default_output(scenario: Path) -> Path:
    """Where a run lands unless told otherwise."""
    return Path("outputs") / f"{scenario.stem}.vtkhdf"


def plan(
    scenario: Scenario, output: Path | None, *, must_fit: bool = True, look: bool = True
) -> dict[str, Any]:
    """Particles, steps, frames, memory and disk of a run, as plain data; with `look`, also what the initial state tells.

    Raises UsageError when the run cannot fit (unless `must_fit` is False), or a file that the scenario names cannot be read.
    """
    from particlesim.compiler import NotKept
    from particlesim.graph.graph import methods_of
    from particlesim.preflight.advice import advice, long_sums, replaced, sliding
    from particlesim.preflight.jumps import jumps
    from particlesim.preflight.resources import check_fits, needs

    required = needs(scenario)
    if not look and (scenario.colliders or scenario.bodies or scenario.motions):
        from particlesim.scenario.open_colliders import open_colliders

        open_colliders(scenario)  # their files are read by a first look, too
    stepped, bodies = methods_of(scenario), {body.name for body in scenario.bodies}
    names = sorted(stepped, key=lambda name: name in bodies)  # bodies come last
    methods = dict.fromkeys(stepped[name].label for name in names)
    if must_fit:
        check_fits(required, output)
    most = MOST_LED if scenario.motions or scenario.rod_sets else MOST_PARTICLES
    found: Stability | None = None
    doubts: tuple[str, ...] = ()
    missing = None
    if look and required.particles <= most:
        try:
            found, doubts = _first_look(scenario, required.particles)
        except NotKept:
            missing = "not computed, as that would compile kernels: psim stability does so, and so does a run"
            doubts = _seen_at_once(scenario)
    grid = scenario.grid
    told = [
        *doubts,
        *advice(scenario),
        *sliding(scenario),
        *long_sums(scenario),
        *jumps(scenario),
        *replaced(scenario),
    ]
    return {
        "title": scenario.title,
        "groups": [group.name for group in scenario.groups],
        "forces": list(scenario.labels.all),
        "particles": required.particles,
        "births": required.births,
        "duration": grid.duration,
        "steps": grid.steps,
        "dt": grid.dt,
        "dt_asked": grid.asked,
        "integrator": " and ".join(methods),
        "precision": scenario.simulation.precision,
        "frames": required.frames,
        "fields": ["position", "id", *scenario.recorded_fields()],
        "particle_steps": required.particle_steps,
        "memory": required.memory,
        "disk": required.disk,
        "compressed": required.compressed,
        "output": None if output is None else str(output),
        "stability": None if found is None else found.as_data(),
        "stability_missing": missing,
        "advice": told,
        "advice_places": places(told, scenario),
    }


def _seen_at_once(scenario: Scenario) -> tuple[str, ...]:
    """What to doubt of the places of particles alone, where no kernel is needed to place them."""
    if scenario.simulation.box is None:
        return ()
    from particlesim.compiler import NotKept, much, uncompiled
    from particlesim.engine.world import World
    from particlesim.runs.first_state import outside_of_box

    with uncompiled(), much(True):
        try:
            return tuple(outside_of_box(World(scenario)))
        except NotKept:
            return ()


def _first_look(scenario: Scenario, particles: int) -> tuple[Stability, tuple[str, ...]]:
    """What the initial state tells: largest stable steps, and what to doubt. Nothing is compiled for it.

    Raises NotKept where that is too much for plain Python and kernels are not on disk."""
    from particlesim.compiler import much, uncompiled
    from particlesim.engine.stability.limits import stability
    from particlesim.engine.world import World
    from particlesim.runs.first_state import doubtful

    crowded = scenario.interactions and particles > MOST_IN_PYTHON
    with uncompiled(), much(bool(crowded)):
        world = World(scenario)
        found = stability(world)
        return found, (*found.warnings, *doubtful(world))


def show_plan(name: str, planned: dict[str, Any], scenario: Scenario) -> None:
    """A plan on stdout, for people."""
    from particlesim.preflight.resources import size

    steps = f"{planned['steps']:,} of {planned['dt']:.6g} s"
    if planned["dt_asked"] is not None:
        steps += f" (dt = {planned['dt_asked']:.6g} s is shortened, so that frames fall on steps)"
    bound = "up to" if planned["compressed"] else "about"
    title = f" · {planned['title']}" if planned["title"] else ""
    print(paint(f"{name}{title}", "bold", sys.stdout))
    facts(
        (
            ("groups", listed(planned["groups"])),
            ("forces", listed(planned["forces"]) or "none"),
            ("particles", f"at most {planned['particles']:,} at once"),
            ("births", f"{planned['births']:,}" if planned["births"] else ""),
            ("time", f"{planned['duration']:.6g} s"),
            ("steps", steps),
            ("method", f"{planned['integrator']}, {planned['precision']} precision"),
            ("stable dt", planned["stability_missing"] or "\n".join(stability_rows(planned["stability"]))),
            ("work", f"about {number(planned['particle_steps'])} particle-steps{_takes(planned)}"),
            ("frames", f"{planned['frames']:,} with {', '.join(planned['fields'])}"),
            ("memory", f"about {size(planned['memory'])}"),
            ("disk", f"{bound} {size(planned['disk'])} for {planned['output']}"),
        ),
        sys.stdout,
    )
    for line in planned["advice"]:
        warn(line, scenario)
    if planned["output"] is not None and Path(planned["output"]).exists():
        warn(f"{planned['output']} exists; psim run needs --force or another --output")


def _takes(planned: dict[str, Any]) -> str:
    """', some 12 s of stepping' where that has been estimated."""
    seconds = planned.get("seconds")
    return "" if seconds is None else f", some {duration(seconds)} of stepping"


def stability_rows(found: dict[str, Any] | None) -> list[str]:
    """The largest stable steps in words, islands with the same ones together: 'up to 0.0034 s (springs 0.0038 s)'."""
    groups: dict[str, list[str]] = {}
    for island in () if found is None else found["islands"]:
        alone = ", ".join(f"{name} {_step(step)}" for name, step in island["forces"].items())
        text = f"{_step(island['largest_stable_dt'])} with {island['method']}"
        if len(island["forces"]) > 1:
            text += f" (alone: {alone})"
        groups.setdefault(text, []).extend(island["groups"])
    return [text if len(groups) == 1 else f"{', '.join(names)}: {text}" for text, names in groups.items()]


def _step(step: float | None) -> str:
    if step is None:
        return "any"
    return f"{step:.4g} s" if step > 0 else "none"
