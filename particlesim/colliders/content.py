"""Shapes whose surface is in a file, which the scenario reads for them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import PrivateAttr, StringConstraints

from particlesim.colliders.solid import Solid
from particlesim.model.base import Model


class FromFile(Model):
    """What is described by a file."""

    kind: ClassVar[str]
    """What it is called."""
    endings: ClassVar[tuple[str, ...]]
    """Endings of the files that it may be in."""

    path: Annotated[str, StringConstraints(min_length=1, max_length=4096)]
    """The file, relative to the scenario's folder; its ending says what it is."""

    _content: Any = PrivateAttr(default=None)

    def __eq__(self, other: object) -> bool:
        return self.says(other)

    def __hash__(self) -> int:
        return hash(self.path)

    def take(self, content: Any) -> None:
        """What the file holds: vertices and triangles, or an array. Raises UsageError where no such shape is in it."""
        raise NotImplementedError

    @property
    def dropped(self) -> int:
        """How many triangles of the file have no area, and are left out."""
        return 0

    @property
    def is_open(self) -> bool:
        """Whether the file has been read."""
        return self._content is not None


class SolidFromFile(FromFile, Solid):
    """A solid that is described by a file."""


def files_in(
    solid: Any, where: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], FromFile]]:
    """The shapes from files that a shape is made of, itself or its parts, and where they are stated."""
    if isinstance(solid, FromFile):
        yield where, solid
    for name in ("of", "without", "parts"):
        for k, part in enumerate(getattr(solid, name, None) or ()):
            yield from files_in(part, (*where, name, k))
