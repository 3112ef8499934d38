"""A unit of compilation: one kernel with the functions that it calls, and its errors."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")


class Again(Exception):
    """Something found while walking changes instructions written before: the walk of the function begins anew, with it in
    `Unit.learned`. Functions that are complete did not need it, and stay as they are."""


def again(walk: Callable[[], T]) -> T:
    """What a walk gives that begins anew until nothing more is found."""
    while True:
        try:
            return walk()
        except Again:
            pass


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
    """A function compiled by itself: its LLVM name, its type and those of its parameters, and the form of its result."""

    name: str
    type: str
    parameters: list[str]
    result: Any


@dataclass
class Part:
    """A function in a module of its own: its text, packed as there may be thousands in a process, and what went in."""

    packed: bytes
    outline: Outline
    parts: dict[str, Part]
    modules: set[str]
    numbers: set[tuple[str, str]]
    nameless: bool

    @property
    def text(self) -> str:
        """The text of the module."""
        return zlib.decompress(self.packed).decode()


@dataclass
class Unit:
    """All that is compiled together: one kernel, or one function in a module of its own, with the functions that it calls.

    `parts` are those of them that have modules of their own: the shared ones, or all where kernels are to compile quickly.
    """

    declared: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    bodies: list[str] = field(default_factory=list)
    outlines: dict[Any, Outline] = field(default_factory=dict)
    learned: dict[Any, Any] = field(default_factory=dict)
    parts: dict[str, Part] = field(default_factory=dict)
    modules: set[str] = field(default_factory=set)
    numbers: set[tuple[str, str]] = field(default_factory=set)
    count: int = 0
    checked: bool = False  # indices are looked at
    quick: bool = False  # nothing is optimised across functions: all that are outlined are parts
    nameless: bool = False  # functions took something from around them, that no name tells to other processes

    def learn(self, key: Any, value: Any) -> None:
        """Remember for the next walk, and begin it."""
        self.learned[key] = value
        raise Again

    def part(self, outline: Outline, text: str) -> Part:
        """What was compiled here, for units that call it."""
        packed = zlib.compress(text.encode(), 1)
        return Part(packed, outline, self.parts, self.modules, self.numbers, self.nameless)

    def take_in(self, part: Part) -> None:
        """Call a function of another module: what went into it has gone into this unit."""
        made = part.outline
        self.declared[made.name] = f"declare {made.type} {made.name}({', '.join(made.parameters)}) nounwind"
        self.parts |= {made.name: part} | part.parts
        self.modules |= part.modules
        self.numbers |= part.numbers
        self.nameless |= part.nameless

    def module(self, function: str) -> str:
        """The text of the module that holds this function and all that it calls."""
        constants = [
            f'{name} = private unnamed_addr constant [{len(text) // 3} x i8] c"{text}", align 64'
            for text, name in self.constants.items()
        ]
        return "\n\n".join([*self.declared.values(), *constants, *self.bodies, function])
