"""Files of particles and measurements, looked at before they are read: their kind, length of lines, and memory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, AnyStr

from particlesim.errors import ResourceError, UsageError
from particlesim.memory import available_memory
from particlesim.trajectory.places import kind_of

LONGEST_LINE = 1 << 16
"""Characters. A line of a table or a mesh has tens; without a bound, a file of zeros would be one line as long as itself."""

RELATIVE = "paths are relative to the scenario's folder"


def check_regular(path: Path, what: str, names: str, missing: str | None = RELATIVE) -> int:
    """The size of a regular file [bytes]; anything else is refused before it is opened, as that may wait for ever.

    `what` it should be is told ("a file of particles"), which `names` it may have, and what to look at where it is
    `missing`. Raises UsageError.
    """
    kind = kind_of(path)
    if kind is None:
        raise UsageError(f"{path} does not exist", missing)
    if kind != "file":
        raise UsageError(
            f"{path} is a {'directory' if kind == 'folder' else kind}, not {what}", f"name {names}"
        )
    return path.stat().st_size


def require_memory(path: Path, needed: float, what: str) -> None:
    """Refuse to read what the machine has no room for. Raises ResourceError."""
    free = available_memory()
    if free is not None and needed > free:
        raise ResourceError(
            f"{path} holds {what}, which take about {needed / 1e9:.3g} GB of memory; {free / 1e9:.3g} GB are free",
            "fewer particles take less",
        )


def bounded_lines(path: Path, file: IO[AnyStr], longest: int = LONGEST_LINE) -> Iterator[AnyStr]:
    """The lines of a file, one after the other. Raises UsageError at one that is longer than any line of sense."""
    number = 0
    while line := file.readline(longest + 1):
        number += 1
        if len(line) > longest:
            raise UsageError(
                f"{path}:{number}: a line of more than {longest:,} characters",
                "is it of the type that its ending says, and complete?",
            )
        yield line
