"""Which particles of a group are meant: by the names that a layout gives its parts, by index, or by region."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StringConstraints

from particlesim.layouts import Layout
from particlesim.model.arrays import Ints
from particlesim.model.mistakes import Invalid
from particlesim.model.spelling import did_you_mean
from particlesim.model.variants import Tagged
from particlesim.sampling.shapes import Ball, Box, Shape, Shell

Path = tuple[str | int, ...]

Index = Annotated[int, Field(ge=0, strict=True)]
Region = Annotated[Box | Ball | Shell, Tagged("type")]
Part = Annotated[str, StringConstraints(min_length=1, max_length=64)]
Selection = Part | tuple[Index | Part, ...] | Region
"""A name such as "left" or "row 3", a list of names and indices, or a box, ball or shell: those in it at the start."""


def selected(selection: Selection, layout: Layout, position: NDArray[np.floating]) -> Ints:
    """Indices of the particles that a selection means, sorted; positions [m] at the start have shape [3, n].

    Names and indices must have been checked by `mistakes`; an index may still be beyond the end of a file.
    """
    if isinstance(selection, Shape):
        return np.flatnonzero(selection.contains(np.asarray(position, float)))
    items: tuple[int | str, ...] = (selection,) if isinstance(selection, str) else selection
    chosen = [layout.part(item) if isinstance(item, str) else np.array([item]) for item in items]
    return np.unique(np.concatenate([part for part in chosen if part is not None])).astype(np.int64)


def mistakes(selection: Selection, layout: Layout, at: Path, place: Path) -> list[Invalid]:
    """Names that the layout does not have, and indices beyond its end; `place` is where the layout is stated."""
    if isinstance(selection, Shape):
        return []
    number = layout.number()
    found = []
    items: tuple[int | str, ...] = (selection,) if isinstance(selection, str) else selection
    if not items:
        found.append(
            Invalid(
                "an empty list names no particle", at, hint="leave the key out, or list some, as in [0, 5]"
            )
        )
    for j, item in enumerate(items):
        here = at if isinstance(selection, str) else (*at, j)
        if isinstance(item, str):
            known = layout.part_names()
            if layout.part(item) is None:
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
                    allowed=f"0 to {number - 1}" if number > 1 else "0",
                )
            )
    return found
