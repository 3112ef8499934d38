"""What is wrong within a file of triangles, before its name is known."""

from __future__ import annotations

from collections.abc import Sequence


class Malformed(Exception):
    """What is wrong with the text or the bytes of a file, and what to do about it."""

    def __init__(
        self, message: str, hint: str = "is it of the type that its ending says, and complete?"
    ) -> None:
        super().__init__(message)
        self.hint = hint


def numbers(words: Sequence[bytes], count: int) -> list[bytes]:
    """Words that are as many numbers as they should be. Raises ValueError."""
    if len(words) != count:
        raise ValueError
    return [repr(float(word)).encode() for word in words]
