"""The quantity that colours particles, and its values in a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particlesim.errors import UsageError
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.spelling import near_miss
from particlesim.render.kernels.records import Array
from particlesim.render.scene.source import Frame, FrameSource
from particlesim.scenario.rendering import colorable

_UNITS = {
    **{name: each.unit for name, each in ATTRIBUTES.items()},
    **dict.fromkeys(("x", "y", "z", "position"), "m"),
    **dict.fromkeys(("speed", "velocity"), "m/s"),
    "acceleration": "m/s²",
    "force": "N",
    "density": "kg/m³",
    **dict.fromkeys(("age", "lifetime", "birth_time"), "s"),
    "pressure": "Pa",
    **dict.fromkeys(("kinetic_energy", "potential_energy", "energy"), "J"),
}


@dataclass(frozen=True)
class Coloring:
    """`kind`: "none", "group", "strain" (of springs), or "value"; `name` is what the legend shows, `field` what is
    read, `axis` its component."""

    kind: str
    name: str = ""
    field: str = ""
    axis: int | None = None
    unit: str = ""


NOTHING = Coloring("none")


def choose_coloring(source: FrameSource, color_by: str) -> Coloring:
    """What `color_by` means for this trajectory. Raises UsageError when it is not recorded."""
    fields = tuple(source.fields)
    if color_by == "auto":
        color_by = "speed" if {"speed", "velocity"} & set(fields) else "none"
    if color_by == "none":
        return NOTHING
    units: dict[str, str] = {**_UNITS, **getattr(source, "units", {})}
    unit = units.get(color_by, "")
    if color_by == "group" and "group" in fields:
        return Coloring("group", "group", "group")
    if color_by == "strain":
        if not any(len(each.pairs) for each in getattr(source, "topology", {}).values()):
            raise UsageError(
                "cannot colour by 'strain': the trajectory has no springs",
                f"Possible here: {', '.join(colorable(fields)[1:])}.",
            )
        return Coloring("strain", "strain")
    if color_by in fields:
        return Coloring("value", color_by.replace("_", " "), color_by, unit=unit)
    if color_by in ("x", "y", "z"):
        return Coloring("value", color_by, "position", "xyz".index(color_by), unit)
    if color_by == "speed" and "velocity" in fields:
        return Coloring("value", "speed", "velocity", unit=unit)
    raise _not_recorded(color_by, fields)


def _not_recorded(color_by: str, fields: tuple[str, ...]) -> UsageError:
    choices = colorable(fields)[1:]
    close = near_miss(color_by, choices)
    needed = "velocity" if color_by == "speed" else color_by
    hint = f"Did you mean '{close}'? " if close else ""
    hint += f"Possible here: {', '.join(choices)}. "
    hint += f'To record it, add "{needed}" to output.fields and run again.'
    return UsageError(f"cannot colour by '{color_by}': the trajectory does not record it", hint)


def values_of(frame: Frame, coloring: Coloring) -> Array | None:
    """The coloured quantity, shape [n], or None when particles are not coloured by a value."""
    if coloring.kind != "value":
        return None
    values = np.asarray(frame.position if coloring.field == "position" else frame[coloring.field])
    if coloring.axis is not None:
        return values[:, coloring.axis]
    if values.ndim == 2:
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", values, values)))
    return values


def color_indices(frame: Frame, coloring: Coloring, low: float, high: float, count: int) -> Array:
    """Index into a palette of `count` colours, uint16 [n]; values that are not finite take the low end."""
    if coloring.kind == "group":
        return np.asarray(np.asarray(frame["group"]).astype(np.int64) % count, np.uint16)
    values = values_of(frame, coloring)
    if values is None:
        return np.zeros(len(frame.position), np.uint16)
    return quantized(values, low, high, count)


def quantized(values: Array, low: float, high: float, count: int) -> Array:
    """Index into a palette of `count` colours that spans low to high, uint16, the shape of `values`."""
    with np.errstate(over="ignore", invalid="ignore"):  # values far outside of the range
        share = (values - low) * ((count - 1) / (high - low))
    share = np.nan_to_num(share, nan=0.0, posinf=count - 1, neginf=0.0)
    return np.asarray(np.clip(share, 0, count - 1) + 0.5, np.uint16)
