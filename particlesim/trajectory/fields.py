"""What a trajectory can record of every particle, and how it is stored."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from particlesim.errors import UsageError
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.spelling import near_miss

Precision = Literal["single", "double"]


@dataclass(frozen=True)
class FieldSpec:
    """One quantity per particle: name, number of components, SI unit ("" if it has none) and meaning."""

    name: str
    components: int
    unit: str
    kind: Literal["float", "integer"]
    doc: str
    bits: int = 64  # of integers; floats follow the precision of the file

    def dtype(self, precision: Precision) -> np.dtype[Any]:
        """The type on disk: float32 or float64 by `precision`; integers as wide as `bits`."""
        if self.kind == "integer":
            return np.dtype(f"<i{self.bits // 8}")
        return np.dtype("<f4" if precision == "single" else "<f8")

    def shape(self, rows: int) -> tuple[int, ...]:
        """Shape of the array for `rows` particles: [rows] or [rows, components]."""
        return (rows,) if self.components == 1 else (rows, self.components)


FIELDS: dict[str, FieldSpec] = {
    spec.name: spec
    for spec in (
        FieldSpec("position", 3, "m", "float", "Where the particle is."),
        FieldSpec("id", 1, "", "integer", "Number that a particle keeps from birth to death; never reused."),
        FieldSpec("velocity", 3, "m/s", "float", "How fast it moves."),
        FieldSpec("force", 3, "N", "float", "Sum of all forces on it."),
        FieldSpec("orientation", 4, "", "float", "How a rigid body is turned: a unit quaternion w, x, y, z."),
        FieldSpec(
            "angular_velocity",
            3,
            "rad/s",
            "float",
            "How fast a rigid body or a grain turns, along the axes of the world.",
        ),
        FieldSpec("acceleration", 3, "m/s²", "float", "Rate of change of its velocity."),
        *(FieldSpec(each.name, 1, each.unit, "float", each.doc) for each in ATTRIBUTES.values()),
        FieldSpec("age", 1, "s", "float", "Time since its birth."),
        FieldSpec("speed", 1, "m/s", "float", "Length of its velocity."),
        FieldSpec(
            "image",
            3,
            "",
            "integer",
            "How many boxes of a periodic box it has gone: along its path it is at position + "
            "image times the size of the box.",
            bits=32,
        ),
        FieldSpec("group", 1, "", "integer", "Index of its group in the list of group names.", bits=32),
    )
}

ALWAYS = ("position", "id")

_AXES = ("x", "y", "z")
_PREFIX = {
    "position": "",
    "velocity": "v",
    "force": "f",
    "acceleration": "a",
    "angular_velocity": "w",
    "image": "image_",
}
_QUATERNION = ("qw", "qx", "qy", "qz")


def component_names(name: str) -> tuple[str, ...]:
    """Short column names of a field: position → x, y, z; velocity → vx, vy, vz; scalars keep their name."""
    if FIELDS[name].components == 1:
        return (name,)
    if name == "orientation":
        return _QUATERNION
    return tuple(_PREFIX[name] + axis for axis in _AXES)


def component(short: str) -> tuple[str, int | None] | None:
    """What a short name stands for: "vy" → ("velocity", 1), "age" → ("age", None), unknown → None."""
    for name, spec in FIELDS.items():
        names = component_names(name)
        if short in names:
            return name, (names.index(short) if spec.components > 1 else None)
    return None


def short_name(quantity: str) -> str:
    """The short name of what checks call "velocity.y"; other names as they are."""
    name, _, axis = quantity.partition(".")
    if name not in FIELDS or FIELDS[name].components == 1:
        return quantity
    axes = _AXES if FIELDS[name].components == 3 else ("w", *_AXES)
    return component_names(name)[axes.index(axis)] if axis in axes else quantity


def select_fields(names: Iterable[str]) -> tuple[FieldSpec, ...]:
    """The specs to record, position and id first, without repeats.

    Raises UsageError for a name that is no field.
    """
    ordered = dict.fromkeys((*ALWAYS, *names))
    for name in ordered:
        if name not in FIELDS:
            raise unknown_name("field", name, FIELDS)
    return tuple(FIELDS[name] for name in ordered)


def unknown_name(what: str, name: str, known: Iterable[str]) -> UsageError:
    """The error for a name that is not among `known`, with the nearest one suggested."""
    known = tuple(known)
    near = near_miss(name, known)
    guess = f"Did you mean {near!r}? " if near else ""
    listing = ", ".join(known) if known else "none"
    return UsageError(f"unknown {what} {name!r}", f"{guess}Available: {listing}.")


def ledger_unit(column: str) -> str:
    """SI unit of a ledger column, told by the first part of its name ("potential.gravity" → "J")."""
    head = column.split(".", 1)[0]
    if head == "momentum":
        return "kg m/s"
    if head == "angular_momentum":
        return "kg m²/s"
    if head in {"kinetic", "potential", "energy", "total", "work", "balance", "dissipated", "thermal"}:
        return "J"
    if head == "pressure":
        return "Pa"
    return ATTRIBUTES[head].unit if head in ATTRIBUTES else ""
