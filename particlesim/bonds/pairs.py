"""The base of lists of joined particles, for springs and rods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from particlesim.model.mistakes import invalid

Index = Annotated[int, Field(ge=0, strict=True)]
Pairs = tuple[tuple[Index, Index], ...]
WORLD = "world"
"""What stands for the world where groups of bodies are named."""
SINGLE: Pairs = ((0, 0),)
"""The first of both groups."""


def joined_groups(on: str | None, between: tuple[str, str] | None) -> tuple[str, str]:
    """The groups of the first and of the second ends. Raises a mistake unless exactly one of `on` and `between` is given."""
    if between is not None and on is None:
        return between
    if on is not None and between is None:
        return on, on
    raise invalid("joins one group or two", allowed='on = "chain", or between = ["hook", "chain"]')


def check_pairs(pairs: Sequence[tuple[int, int]], *, inside: bool, of: str = "particle") -> None:
    """Raises a mistake for a pair that is listed twice and, `inside` one group, for a particle that is joined to itself."""
    seen: dict[frozenset[int] | tuple[int, int], int] = {}
    for k, (a, b) in enumerate(pairs):
        if inside and a == b:
            raise invalid(f"joins {of} {a} to itself", at=("pairs", k), allowed="two different indices")
        key = frozenset((a, b)) if inside else (a, b)
        if key in seen:
            raise invalid(
                "this pair is already joined", at=("pairs", k), also=[(("pairs", seen[key]), "here")]
            )
        seen[key] = k


def check_points(points: object, groups: tuple[str, str], pairs: Sequence[tuple[int, int]] | None) -> None:
    """Raises a mistake where both ends of what `points` and the world describe cannot be."""
    first, second = groups
    if first == WORLD:
        raise invalid(
            '"world" must be the second of the two',
            at=("between", 0),
            allowed=f'between = ["{second}", "world"]',
        )
    if second == WORLD and points is None:
        raise invalid(
            '"world" needs points: where is the other end?',
            allowed="points = [[0, 0, 0], [0, 2, 0]]: at the body, and in the world",
        )
    if points is not None and pairs is None and first == second:
        raise invalid(
            "which bodies are joined?", allowed="pairs = [[0, 1]], or two groups with between = [...]"
        )
    for k, pair in enumerate(pairs or ()):
        if second == WORLD and pair[1] != 0:
            raise invalid("the index of the world is 0", at=("pairs", k, 1), allowed="0")
