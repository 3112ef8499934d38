"""Which particles of a group are meant: by the names that a layout gives its parts, by index, or by region."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from particlesim.crossfield import Invalid
from particlesim.layouts import Layout
from particlesim.model import Name
from particlesim.names import did_you_mean
from particlesim.shapes import Ball, Box, Shape, Shell

Ints = NDArray[np.int64]
Path = tuple[str | int, ...]

Index = Annotated[int, Field(ge=0, strict=True)]
Region = Annotated[Box | Ball | Shell, Field(discriminator="type")]
Selection = (
    Name
    | Annotated[tuple[Index, ...], Field(min_length=1)]
    | Annotated[tuple[Name, ...], Field(min_length=1)]
    | Region
)
"""A name such as "left", several, a list of indices, or a box, ball or shell: those that are in it at the start."""


def selected(selection: Selection, layout: Layout, position: NDArray[np.floating]) -> Ints:
    """Indices of the particles that a selection means, sorted; positions [m] at the start have shape [3, n].

    Names and indices must have been checked by `mistakes`; an index may still be beyond the end of a file.
    """
    if isinstance(selection, Shape):
        return np.flatnonzero(selection.contains(np.asarray(position, float)))
    if isinstance(selection, str):
        return np.unique(layout.places()[selection])
    chosen = [layout.places()[item] if isinstance(item, str) else np.array([item]) for item in selection]
    return np.unique(np.concatenate(chosen)).astype(np.int64)


def mistakes(selection: Selection, layout: Layout, at: Path, place: Path) -> list[Invalid]:
    """Names that the layout does not have, and indices beyond its end; `place` is where the layout is stated."""
    if isinstance(selection, Shape):
        return []
    number = layout.number()
    found = []
    items: tuple[int | str, ...] = (selection,) if isinstance(selection, str) else selection
    for j, item in enumerate(items):
        here = at if isinstance(selection, str) else (*at, j)
        if isinstance(item, str):
            known = list(layout.places())
            if item not in known:
                found.append(
                    Invalid(
                        f"a layout of type {layout.type!r} has no part called {item!r}",
                        here,
                        ((place, "the layout"),),
                        allowed=", ".join(known) or "indices such as [0, 5], or a region",
                        hint=did_you_mean(item, known),
                    )
                )
        elif number is not None and item >= number:
            found.append(
                Invalid(
                    f"there is no particle {item}",
                    here,
                    ((place, f"{number} particles"),),
                    allowed=f"0 to {number - 1}",
                )
            )
    return found
