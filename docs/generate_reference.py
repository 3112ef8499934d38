"""Write docs/scenario.md, the reference of scenario files, from the models that read them.

python docs/generate_reference.py           write it
python docs/generate_reference.py --check   exit 1 if the file is not what would be written
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from reference_methods import integrators_table
from reference_words import default_words, type_words

from particlesim.bodies import BODY_SHAPES, JOINTS, Bodies, Joint, Motor
from particlesim.bonds import MeshSprings
from particlesim.colliders import COLLIDERS, Collider
from particlesim.colliders.friction import FallingRestitution, Friction
from particlesim.colliders.pose import Orientation
from particlesim.emitters import Emitter
from particlesim.emitters.emitter import Burst, Die, OnImpact
from particlesim.expressions.operations import FUNCTIONS, VARIABLES
from particlesim.expressions.parser import MAX_DEPTH, MAX_LENGTH
from particlesim.flows import FLOWS
from particlesim.flows.fluids import FLUIDS
from particlesim.forces import FORCES, SURFACE_FORCES, Force
from particlesim.forces.drag import Atmosphere
from particlesim.groups.group import Cooling, FirstOrder, Particles, SecondOrder, TracerMotion
from particlesim.groups.impulse import Impulse
from particlesim.groups.motion import Spin, Waypoint
from particlesim.integrators import METHODS
from particlesim.interactions import INTERACTIONS, PairInteraction
from particlesim.layouts import LAYOUTS
from particlesim.model.base import field_docs
from particlesim.sampling.distributions import Choice, Exponential, LogNormal, Normal, Uniform
from particlesim.sampling.regions import HalfSpace
from particlesim.sampling.shapes import Ball, Box, Disc, Point, Shell, Sphere
from particlesim.scenario.box import PeriodicBox
from particlesim.scenario.rendering import Camera, RenderSettings
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text import typewalk
from particlesim.scenario.time_and_output import Output, SimulationSettings

TARGET = Path(__file__).with_name("scenario.md")
TEXTS = Path(__file__).with_name("reference")

DISTRIBUTIONS = (Uniform, Normal, LogNormal, Exponential, Choice)
SHAPES = (Point, Box, Ball, Sphere, Shell, Disc)
DYNAMICS = (SecondOrder, FirstOrder, TracerMotion)


def reference() -> str:
    """The whole page."""
    return "\n\n".join(part.strip() for part in parts()) + "\n"


def parts() -> Iterator[str]:
    """The page, section by section."""
    yield prose("head")
    yield entry("## The file", Scenario)
    yield "## `[simulation]`"
    yield prose("simulation")
    yield table(SimulationSettings)
    yield entry("### `box`", PeriodicBox)
    yield "### Integrators"
    yield prose("integrators")
    yield integrators_table()
    yield from options_of_methods()
    yield "## `[output]`"
    yield prose("output")
    yield table(Output)
    yield from parts_of_matter()
    yield from parts_of_forces()
    yield from parts_of_surroundings()


def parts_of_matter() -> Iterator[str]:
    """Particles, bodies and emitters."""
    yield "## `[[particles]]`"
    yield prose("particles")
    yield table(Particles)
    yield "### Layouts"
    yield from variants(LAYOUTS)
    yield "### Springs of bodies"
    yield prose("bodies")
    yield table(MeshSprings)
    yield "### Dynamics"
    yield prose("dynamics")
    yield from variants(DYNAMICS)
    yield entry("### Cooling", Cooling)
    yield "## `[[bodies]]`"
    yield prose("rigid_bodies")
    yield table(Bodies, without=Bodies.unused)
    yield "### Shapes of bodies"
    yield from variants(BODY_SHAPES)
    yield "## `[[joints]]`"
    yield prose("joints")
    yield table(Joint)
    yield from variants(JOINTS)
    yield "### Motor"
    yield summary(Motor) + "\n\n" + table(Motor)
    yield "## `[[emitters]]`"
    yield prose("emitters")
    yield table(Emitter)
    yield entry("### Burst", Burst)
    yield entry("### Births of impacts", OnImpact)
    yield entry("### Die", Die)
    yield "## Shapes"
    yield "Places are chosen uniformly by volume, on flat shapes and spheres uniformly by area."
    yield from variants(SHAPES)
    yield "## Distributions"
    yield prose("distributions")
    yield from variants(DISTRIBUTIONS)


def parts_of_forces() -> Iterator[str]:
    """What acts on particles, and between them."""
    yield "## `[[forces]]`"
    yield prose("forces")
    yield table(Force)
    for force in (*FORCES, *SURFACE_FORCES):
        yield force_section(force)
    yield entry("#### standard_atmosphere", Atmosphere, without=("type",))
    yield "### Expressions"
    yield prose("expressions")
    yield expressions_table()
    yield "### Fluids"
    yield fluids_table()
    yield "## Flows"
    yield prose("flows")
    yield from variants(FLOWS)
    yield "## `[[interactions]]`"
    yield prose("interactions")
    yield table(PairInteraction)
    for interaction in INTERACTIONS:
        yield force_section(interaction)
    yield section("springs")
    yield section("rods")
    yield section("angles")
    yield section("dihedrals")


def parts_of_surroundings() -> Iterator[str]:
    """Motions, colliders, kicks, checks and pictures."""
    yield section("motions")
    yield entry("### Waypoint", Waypoint)
    yield entry("### Spin", Spin)
    yield section("planes")
    yield "## `[[colliders]]`"
    yield prose("colliders")
    yield table(Collider)
    yield from (collider_section(shape) for shape in COLLIDERS)
    yield entry("### Orientation", Orientation)
    yield entry("### Friction", Friction)
    yield entry("### Restitution", FallingRestitution)
    yield entry("## `[[impulses]]`", Impulse)
    yield section("checks")
    yield "### Regions"
    yield prose("regions")
    yield from variants((HalfSpace,))
    yield "## `[render]`"
    yield prose("render")
    yield table(RenderSettings)
    yield entry("### Camera", Camera)


def prose(name: str) -> str:
    """A text of docs/reference, for what no model can say."""
    return (TEXTS / f"{name}.md").read_text(encoding="utf-8")


def section(field: str) -> str:
    """Title, text and the table of the entries of a list in the scenario."""
    entries = typewalk.node(Scenario.model_fields[field].annotation)
    each = typewalk.child(entries, 0, None)
    assert each is not None
    assert each.model is not None
    return f"## `[[{field}]]`\n\n{prose(field).strip()}\n\n{table(each.model)}"


def entry(title: str, model: type[BaseModel], without: tuple[str, ...] = ()) -> str:
    """Title, summary and table of a model."""
    return f"{title}\n\n{summary(model)}\n\n{table(model, without=without)}"


def options_of_methods() -> Iterator[str]:
    """For every family of methods that has options: which they are."""
    for model in dict.fromkeys(method.options for method in METHODS.values()):
        if rows := table(model, without=("method",)):
            names = [f"`{name}`" for name, method in METHODS.items() if method.options is model]
            yield f"#### Options of {', '.join(names)}\n\n{summary(model)}\n\n{rows}"


def variants(models: tuple[type[BaseModel], ...]) -> Iterator[str]:
    """One subsection for each class that a `type` may name."""
    for model in models:
        text = f"#### {type_name(model)}\n\n{summary(model)}"
        rows = table(model, without=("type",))
        yield f"{text}\n\n{rows}" if rows else text


def type_name(model: type[BaseModel]) -> str:
    """What the scenario writes as `type`."""
    return str(model.model_fields["type"].default)


def summary(model: type[BaseModel]) -> str:
    """The class's docstring in Markdown, its line breaks undone."""
    paragraphs = re.split(r"\n\s*\n", model.__doc__ or "")
    return "\n\n".join(" ".join(p.split()) for p in paragraphs)


def table(model: type[BaseModel], without: tuple[str, ...] = ()) -> str:
    """The fields of a model as a Markdown table; empty when it has none."""
    for base in (Force, PairInteraction):
        if issubclass(model, base):
            without = (*without, "type") if model is base else (*without, "type", *base.model_fields)
    fields = {name: info for name, info in model.model_fields.items() if name not in without}
    if not fields:
        return ""
    docs = field_docs(model)
    rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    for name, info in fields.items():
        meaning = cell(docs.get(name, ""))
        kind = cell(type_words(info.annotation, tuple(info.metadata)))
        rows.append(f"| `{name}` | {kind} | {cell(default_words(info))} | {meaning} |")
    return "\n".join(rows)


def cell(text: str) -> str:
    """Text that cannot break a row of a Markdown table."""
    return " ".join(text.split()).replace("|", "\\|")


def force_section(force: type[Force | PairInteraction]) -> str:
    """Formula, potential energy, source and parameters of a force or of an interaction."""
    lines = [f"### {type_name(force)}", summary(force)]
    facts = [f"- Force: {maths(force.formula)}", f"- Energy: {maths(force.energy)}"]
    if (source := source_of(force)) is not None:
        facts.append(f"- Source: {source}")
    if force.model_construct().needs_velocity():  # by its defaults: a formula may or may not
        facts.append("- Depends on the velocity, so it does not act on particles without inertia.")
    return "\n\n".join([*lines, "\n".join(facts), table(force)])


def collider_section(shape: type[Collider]) -> str:
    """What a shape has beside the keys of all colliders."""
    rows = table(shape, without=("type", *Collider.model_fields))
    return f"#### {type_name(shape)}\n\n{summary(shape)}\n\n{rows}"


def maths(text: str) -> str:
    """A formula as it stands, safe from Markdown's asterisks and bars."""
    return text.replace("|", "\\|").replace("*", "\\*")


def source_of(force: type[Force | PairInteraction]) -> str | None:
    """The sentence after 'Source:' in the docstring of the module that the class is in."""
    found = re.search(r"Source: (.*?)(?:\n\s*\n|\Z)", sys.modules[force.__module__].__doc__ or "", re.DOTALL)
    return " ".join(found[1].split()) if found else None


def expressions_table() -> str:
    """Names and functions of the formulas of the force `field`."""
    functions = [f"`{name}({', '.join(f._fields)})`" for name, f in FUNCTIONS.items()]  # type: ignore[attr-defined]
    rows = {
        "part": "what is allowed",
        "---": "---",
        "variables": ", ".join(f"`{name}`" for name in VARIABLES),
        "constants": "`pi`, `e`, and those of `constants`",
        "operators": "`+` `-` `*` `/` `**`, parentheses, `a if b < c else d` with `<`, `<=`, `>` or `>=`",
        "functions": ", ".join(functions),
        "limits": f"{MAX_LENGTH} characters, {MAX_DEPTH} operations inside each other; a long sum or product is not deep",
    }
    return "\n".join(f"| {part} | {allowed} |" for part, allowed in rows.items())


def fluids_table() -> str:
    """Viscosities and densities by name."""
    rows = ["| fluid | viscosity [Pa s] | density [kg/m³] | at |", "| --- | --- | --- | --- |"]
    for name, fluid in FLUIDS.items():
        density = "–" if fluid.density is None else f"{fluid.density:g}"
        rows.append(f"| `{name}` | {fluid.viscosity:g} | {density} | {fluid.conditions} |")
    return "\n".join(rows)


def main() -> int:
    """Write the page, or check it."""
    parser = argparse.ArgumentParser(description="Write docs/scenario.md from the models.")
    parser.add_argument("--check", action="store_true", help="only say whether the page is up to date")
    wanted = reference()
    if not parser.parse_args().check:
        TARGET.write_text(wanted, encoding="utf-8")
        return 0
    if TARGET.exists() and TARGET.read_text(encoding="utf-8") == wanted:
        return 0
    print(f"{TARGET.name} is out of date: run `python docs/generate_reference.py`", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
