"""Videos show what the trajectory holds, and draw what there is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import get_args

from particlesim.groups.group import Group, Particles
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.reach import group_tables
from particlesim.scenario.rendering import colorable
from particlesim.scenario.rules.joints import bond_tables
from particlesim.scenario.rules.rods import rod_tables
from particlesim.scenario.tables import Tables
from particlesim.scenario.time_and_output import FieldName


def colors(scenario: Tables) -> Iterator[Invalid]:
    """Videos show what the trajectory holds."""
    name, fields = scenario.render.color_by, scenario.recorded_fields()
    springs = any(True for _ in bond_tables(scenario))
    if name not in (*fields, "position", "id") and name not in (known := colorable(fields, springs=springs)):
        hint = did_you_mean(name, known)
        if hint is None and name in get_args(FieldName):
            hint = f"to record it: fields = [..., {name!r}] under [output]"
        yield Invalid(
            f"the trajectory does not hold {name!r}",
            ("render", "color_by"),
            allowed=", ".join(known),
            hint=hint,
        )


def styles(scenario: Tables) -> Iterator[Invalid]:
    """Videos draw what there is: groups and sets of springs or rods that exist, surfaces and lines where there are some."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    sets = {rods.name: ("rods", k) for k, rods in enumerate(scenario.rods)}
    sets |= {springs.name: ("springs", k) for k, springs in enumerate(scenario.springs)}
    joined = {name for _, names, _ in bond_tables(scenario) for name in names}
    joined |= {name for _, names in rod_tables(scenario) for name in names}
    walls = [each.name for each in scenario.colliders if each.name is not None]
    for key, name in _looks(scenario):
        known = [*tables, *sets, *(walls if key == "opacity" else ())]
        if name not in known:
            yield Invalid(
                f"no group, springs or rods are called {name!r}",
                ("render", key, name),
                allowed=", ".join(known),
                hint=did_you_mean(name, known),
            )
        elif name not in tables and name not in sets:
            continue  # a collider
        elif key == "opacity" and not _has_skin(name, tables):
            yield Invalid(
                f"{name!r} has no surface: nothing else can be seen through",
                ("render", key, name),
                ((tables[name][0], "this group"),) if name in tables else ((sets[name], "these"),),
            )
        elif key == "line_radius" and name not in joined and name not in sets:
            path = tables[name][0]
            at = ("render", key, name)
            yield Invalid(
                f"no springs or rods join the particles of {name!r}", at, (((*path,), "this group"),)
            )
    for name, style in scenario.render.styles.items():
        at = ("render", "styles", name)
        if name in tables:
            path = tables[name][0]
            if style == "surface" and not _has_skin(name, tables):
                yield Invalid(f"{name!r} has no surface", at, (((*path,), "this group"),))
            if style == "lines" and name not in joined:
                yield Invalid(
                    f"no springs or rods join the particles of {name!r}", at, (((*path,), "this group"),)
                )
        elif name in sets and style in ("surface", "points"):
            yield Invalid(
                "springs and rods are lines or hidden",
                at,
                ((sets[name], f"these {sets[name][0]}"),),
                allowed='"lines", "hidden"',
            )


def _has_skin(name: str, tables: Mapping[str, tuple[Path, Group]]) -> bool:
    """Whether a name is that of a group with a surface."""
    group = tables[name][1] if name in tables else None
    return isinstance(group, Particles) and group.layout.has_surface()


def _looks(scenario: Tables) -> Iterator[tuple[str, str]]:
    """The keys of [render] that say something by name, and the names that they use."""
    render = scenario.render
    radii = render.line_radius if isinstance(render.line_radius, dict) else {}
    looks: list[tuple[str, Mapping[str, object]]]
    looks = [
        ("styles", render.styles),
        ("colors", render.colors),
        ("opacity", render.opacity),
        ("line_radius", radii),
    ]
    for key, table in looks:
        yield from ((key, name) for name in table)
