"""Which types installed packages add, and the import of one of them.

A package lists its types as entry points, in a group such as `particlesim.forces`: the name is the `type` that scenarios
write, the value is the class. Looking at the list imports nothing.
"""

from __future__ import annotations

import functools
import importlib.metadata
from typing import Any, NamedTuple


class ExtensionError(Exception):
    """A type of a package that cannot be used; the message names the package."""


class Extension(NamedTuple):
    """A type that a package adds: its name in scenarios, the place of its class ("package.module:Class"), the name of the
    package on the index, and its version."""

    type: str
    target: str
    package: str
    version: str

    @property
    def origin(self) -> str:
        """The package with its version: 'swirl-forces 1.2'."""
        return f"{self.package} {self.version}"

    def load(self) -> Any:
        """Import what the entry point names. Raises ExtensionError, whatever goes wrong in the package."""
        point = importlib.metadata.EntryPoint(self.type, self.target, "")
        try:
            return point.load()
        except (Exception, SystemExit) as error:
            said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
            raise ExtensionError(
                f"{self.type!r} of the package {self.origin} cannot be imported from {self.target}: {said}"
            ) from error


@functools.cache
def installed(group: str) -> tuple[Extension, ...]:
    """The types of a group of entry points, by name; several packages may claim the same.

    This looks at every installed package, which takes milliseconds: psim asks only when a scenario names a type that is not
    its own, or when all types are to be listed.
    """
    found = []
    for point in importlib.metadata.entry_points(group=group):
        package, version = (getattr(point.dist, what, None) or "unknown" for what in ("name", "version"))
        found.append(Extension(point.name, point.value, package, version))
    return tuple(sorted(found))
