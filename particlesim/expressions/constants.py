"""Names of the constants that a scenario gives to its formulas."""

from __future__ import annotations

import keyword
from collections.abc import Collection

from particlesim.expressions.operations import FUNCTIONS
from particlesim.model.mistakes import invalid


def check_constant(name: str, variables: Collection[str]) -> None:
    """Refuse a constant that no expression could name, or that would hide a variable or a function."""
    place = ("constants", name)
    if name in variables:
        raise invalid(f"{name!r} is a variable of every expression", at=place, hint="choose another name")
    if name in FUNCTIONS:
        raise invalid(f"{name!r} is a function of every expression", at=place, hint="choose another name")
    if not name.isidentifier() or keyword.iskeyword(name):
        hint = "use letters, digits and _, and no word of Python's grammar such as 'in'"
        raise invalid(f"{name!r} cannot be written in an expression", at=place, hint=hint)
