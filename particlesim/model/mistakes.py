"""Mistakes that no single field shows: a model validator raises `invalid(...)`, and points at several places.

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low > self.high:
            raise invalid("low is above high", at=("low",), also=[(("high",), "the upper end")])
        return self

Paths are relative to the model that raises. A check of the whole scenario after validation collects `Invalid`
records with absolute paths instead, and `diagnose.scenario_error` turns them into one error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic_core import PydanticCustomError

Path = tuple[str | int, ...]
"""Keys and indices from a table down to a value."""

CROSS_FIELD_ERROR = "cross_field"


@dataclass(frozen=True)
class Invalid:
    """One mistake: what is wrong, at which value, further places with what to read there, what to do.

    `within` is (offset, length) in characters when part of the string at `at` is meant, as in an expression.
    """

    message: str
    at: Path = ()
    also: tuple[tuple[Path, str], ...] = ()
    allowed: str | None = None
    hint: str | None = None
    within: tuple[int, int] | None = None


def invalid(
    message: str,
    *,
    at: Path | None = None,
    also: Sequence[tuple[Path, str]] = (),
    allowed: str | None = None,
    hint: str | None = None,
    within: tuple[int, int] | None = None,
) -> PydanticCustomError:
    """The exception to raise from a validator; `at` None points at the model's own table."""
    mistake = Invalid(message, at or (), tuple(also), allowed, hint, within)
    return PydanticCustomError(CROSS_FIELD_ERROR, "{message}", {"message": message, "invalid": mistake})
