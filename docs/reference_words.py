"""Types and defaults of model fields in words: 'length [m], > 0, or a distribution'."""

from __future__ import annotations

import re
import types
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, StringConstraints
from pydantic.fields import FieldInfo

from particlesim.bodies import Bodies, BodyShape, Joint, Motor
from particlesim.bonds import Angles, Dihedrals, MeshSprings, Rods, Springs
from particlesim.checks.check import Check
from particlesim.checks.quantities import InUnitOfQuantity
from particlesim.colliders import Collider, Plane
from particlesim.colliders.friction import FallingRestitution, Friction
from particlesim.colliders.pose import Orientation
from particlesim.colliders.solid import Solid
from particlesim.emitters import Emitter
from particlesim.emitters.emitter import Burst, Die, OnImpact
from particlesim.flows import Flow
from particlesim.flows.fluids import FluidName
from particlesim.forces import Force
from particlesim.forces.drag import Atmosphere
from particlesim.groups.group import Cooling, FirstOrder, Particles, SecondOrder, TracerMotion
from particlesim.groups.impulse import Impulse
from particlesim.groups.motion import Motion, Spin, Waypoint
from particlesim.integrators import MethodName, Options
from particlesim.interactions import PairInteraction
from particlesim.layouts import Layout
from particlesim.model.base import Name
from particlesim.model.units import Unit
from particlesim.sampling.distributions import Distribution
from particlesim.sampling.regions import HalfSpace
from particlesim.sampling.shapes import Shape
from particlesim.scenario.box import PeriodicBox
from particlesim.scenario.rendering import Camera, RenderSettings
from particlesim.scenario.time_and_output import Output, SimulationSettings

# What a table is called, and where on the page it is described. The first match counts.
TABLES: tuple[tuple[type | tuple[type, ...], str], ...] = (
    (SimulationSettings, "[simulation](#simulation)"),
    (PeriodicBox, "[box](#box)"),
    (Output, "[output](#output)"),
    (RenderSettings, "[render](#render)"),
    (Camera, "[camera](#camera)"),
    (Bodies, "[bodies](#bodies)"),
    (Joint, "[joints](#joints)"),
    (Motor, "[motor](#motor)"),
    (BodyShape, "[shape of a body](#shapes-of-bodies)"),
    (Particles, "[particles](#particles)"),
    (Emitter, "[emitters](#emitters)"),
    (Force, "[forces](#forces)"),
    (PairInteraction, "[interactions](#interactions)"),
    (MeshSprings, "[springs of bodies](#springs-of-bodies)"),
    (Springs, "[springs](#springs)"),
    (Rods, "[rods](#rods)"),
    (Angles, "[angles](#angles)"),
    (Dihedrals, "[dihedrals](#dihedrals)"),
    (Plane, "[planes](#planes)"),
    (Collider, "[colliders](#colliders)"),
    (Solid, "[shape of a collider](#colliders)"),
    (Orientation, "[orientation](#orientation)"),
    (Impulse, "[impulses](#impulses)"),
    (Motion, "[motions](#motions)"),
    (Waypoint, "[waypoint](#waypoint)"),
    (Spin, "[spin](#spin)"),
    (Check, "[checks](#checks)"),
    (Layout, "[layout](#layouts)"),
    (Shape, "[shape](#shapes)"),
    (HalfSpace, "[region](#regions)"),
    (Flow, "[flows](#flows)"),
    ((SecondOrder, FirstOrder, TracerMotion), "[dynamics](#dynamics)"),
    (Options, "[table](#integrators)"),
    (Cooling, "[cooling](#cooling)"),
    (Friction, "[friction](#friction)"),
    (FallingRestitution, "[restitution](#restitution)"),
    (Burst, "[burst](#burst)"),
    (OnImpact, "[births of impacts](#births-of-impacts)"),
    (Die, "[die](#die)"),
    (Atmosphere, "[standard_atmosphere](#standard_atmosphere)"),
    (Distribution, "[distribution](#distributions)"),
)

NAME_PATTERN = next(str(m.pattern) for m in get_args(Name)[1:] if isinstance(m, StringConstraints))
TUPLES = {2: "`[a, b]`", 3: "`[x, y, z]`", 4: "`[a, b, c, d]`"}
CHOICES = {get_args(MethodName): "[method](#integrators)", get_args(FluidName): "[fluid](#fluids)"}


def type_words(annotation: Any, metadata: tuple[Any, ...] = ()) -> str:
    """A type as a reader of the reference needs it."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_words(arguments[0], (*arguments[1:], *metadata))
    if origin in (Union, types.UnionType):
        words = dict.fromkeys(type_words(a) for a in arguments if a is not type(None))
        return joined([*words]) + limits(metadata)
    if origin is Literal:
        return CHOICES.get(arguments) or joined([f"`{toml(value)}`" for value in arguments])
    if origin is tuple:
        return tuple_words(arguments)
    if origin is dict:
        return "table of numbers by name"
    if isinstance(annotation, TypeVar):
        return "as the quantity"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return next(words for kinds, words in TABLES if issubclass(annotation, kinds))
    return plain_words(annotation, metadata) + limits(metadata)


def tuple_words(arguments: tuple[Any, ...]) -> str:
    """'`[x, y, z]`, velocity [m/s]', 'list of whole number' or 'list of [flows](#flows)'."""
    inner = type_words(arguments[0])
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return f"list of {inner}"
    return f"{TUPLES[len(arguments)]}, {inner}"


def plain_words(annotation: Any, metadata: tuple[Any, ...]) -> str:
    """Numbers with their unit, texts, truth values."""
    for unit in (m for m in metadata if isinstance(m, Unit)):
        return unit.noun + (f" [{power_signs(unit.symbol)}]" if unit.symbol else "")
    if any(isinstance(mark, InUnitOfQuantity) for mark in metadata):
        return "number in the unit of the quantity"
    if annotation is str:
        named = any(isinstance(m, StringConstraints) and m.pattern == NAME_PATTERN for m in metadata)
        return "name" if named or NAME_PATTERN in str(metadata) else "text"
    return {float: "number", int: "whole number", bool: "`true` or `false`"}[annotation]


def limits(metadata: tuple[Any, ...]) -> str:
    """', > 0, ≤ 1' from the constraints of a number."""
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤", "multiple_of": "a multiple of"}
    found: dict[str, None] = {}
    for mark in unpacked(metadata):
        for attribute, sign in signs.items():
            if (bound := getattr(mark, attribute, None)) is not None and not isinstance(
                mark, StringConstraints
            ):
                found[f", {sign} {number_words(bound)}"] = None
    return "".join(found)


def number_words(bound: float) -> str:
    """A bound, large powers of ten and two as such."""
    if bound == 2**63 - 1:
        return "2⁶³ − 1"
    exponent = len(str(bound)) - 1
    if isinstance(bound, int) and exponent > 5 and bound == 10**exponent:
        return power_signs(f"10^{exponent}")
    return f"{bound:g}".replace("-", "−")


def power_signs(text: str) -> str:
    """'m^3/s^2' as 'm³/s²'."""
    raised = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
    return re.sub(r"\^(\d+)", lambda found: found[1].translate(raised), text)


def unpacked(metadata: tuple[Any, ...]) -> list[Any]:
    """Constraints, those inside pydantic's Field too."""
    marks: list[Any] = []
    for mark in metadata:
        marks += mark.metadata if isinstance(mark, FieldInfo) else [mark]
    return marks


def joined(words: list[str]) -> str:
    """'a, b or c'; a distribution comes last, with its article."""
    words = ["a " + w if w.startswith("[distribution]") else w for w in words]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def default_words(info: FieldInfo) -> str:
    """The default as TOML, 'required', or nothing where a value may be left out."""
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    if value is None or value in ((), {}):
        return ""
    if isinstance(value, BaseModel):
        kind = getattr(value, "type", None)
        return f'`{{ type = "{kind}" }}`' if kind is not None else ""
    return f"`{toml(value)}`"


def toml(value: Any) -> str:
    """A value as a scenario writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(toml(v) for v in value)}]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return str(value)
