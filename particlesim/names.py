"""Suggestions for misspelt names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str | None:
    """A hint with the one of `known` that `word` was probably meant to be."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.55)
    return f'did you mean "{near[0]}"?' if near else None
