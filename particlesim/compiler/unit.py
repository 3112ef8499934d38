"""What is compiled together, and what can go wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


class Again(Exception):
    """What was found while walking changes what was written before: the walk begins anew, with it in `Unit.learned`."""


class CompileError(Exception):
    """A kernel that cannot be compiled: the reason, and the places in files that led there, innermost first."""

    def __init__(self, reason: str, places: list[tuple[str, int, int, str]]) -> None:
        self.reason, self.places = reason, places
        super().__init__(reason)

    def __str__(self) -> str:
        import linecache

        file, line, column, name = self.places[0]
        text = linecache.getline(file, line).rstrip()
        lines = [
            f"{file}:{line}:{column + 1}: in {name}: {self.reason}",
            f"    {text}",
            "    " + " " * column + "^",
        ]
        lines += [f"  called from {name} at {file}:{line}" for file, line, _, name in self.places[1:]]
        return "\n".join(lines)


@dataclass
class Outline:
    """A function compiled by itself: its LLVM name and the form of its result."""

    name: str
    result: Any


@dataclass
class Unit:
    """All that is compiled together: one kernel, with the functions that it calls by themselves."""

    declared: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    bodies: list[str] = field(default_factory=list)
    outlines: dict[Any, Outline] = field(default_factory=dict)
    learned: dict[Any, Any] = field(default_factory=dict)
    modules: set[str] = field(default_factory=set)
    numbers: set[tuple[str, str]] = field(default_factory=set)
    count: int = 0
    nameless: bool = False  # functions took something from around them, that no name tells to other processes

    def learn(self, key: Any, value: Any) -> None:
        """Remember for the next walk, and begin it."""
        self.learned[key] = value
        raise Again

    def fresh(self) -> Unit:
        """The same with nothing written yet."""
        return Unit(learned=self.learned)
