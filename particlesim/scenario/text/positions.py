"""Where each key and value of a TOML text stands.

tomllib gives values without places. This scanner gives the places: for a path such as
`("forces", 0, "coefficient")` the character ranges of its key and of its value. It runs only once an error
has to be shown, and on text that tomllib has accepted, so it checks nothing; on other text it stops where it
no longer understands (`Positions.stopped_at`), which helps to explain syntax errors.

A table's value is its header (`[simulation]`, `[[forces]]`), an implied table's value is its name.
Grammar: https://toml.io/en/v1.0.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

_DEEPEST = 100  # brackets inside each other; a bound for the recursion

Path = tuple[str | int, ...]

# Compiled when they are needed, which is when there is a mistake: most scenarios have none.
_SPACE = r"[ \t]*"
_TRIVIA = r"(?:[ \t\r\n]+|#[^\n]*)*"
_BARE_KEY = r"[A-Za-z0-9_-]+"
_SCALAR = r"\d{4}-\d\d-\d\d \d\d:[^,\]}\s#]*|[^,\[\]{}\s#\"'=]+"
_STRING = (
    r'"""(?:[^\\"]|\\[\s\S]|"(?!""))*"{3,5}'
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
)
_ESCAPE = r'\\(?:u([0-9a-fA-F]{4})|U([0-9a-fA-F]{8})|x([0-9a-fA-F]{2})|([btnfre"\\]))|\\[ \t]*\n\s*'
_ESCAPED = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", "e": "\x1b", '"': '"', "\\": "\\"}


@dataclass(frozen=True)
class TextRange:
    """Characters `start` to `end` (exclusive) of the text."""

    start: int
    end: int


@dataclass(frozen=True)
class Place:
    """The ranges of a value and of the key that names it (None for an element of an array)."""

    key: TextRange | None
    value: TextRange
    explicit: bool = True
    """False for a table that exists only because a longer key or header passes through it."""


@dataclass
class Positions:
    """What the scanner found."""

    places: dict[Path, Place] = field(default_factory=dict)
    duplicates: list[tuple[Path, Place, Place]] = field(default_factory=list)
    stopped_at: int | None = None
    open_bracket: int | None = None
    """Where the innermost bracket or brace opens that was still open when the scan stopped."""


def scan(text: str) -> Positions:
    """The places of every key and value of the document `text` (with `\\n` line ends)."""
    return _Scanner(text).document()


def scan_value(text: str, start: int, path: Path, key: TextRange) -> Positions:
    """The places inside the single value at `start` of `text`, which the key at `key` names `path`."""
    return _Scanner(text).single(start, path, key)


class _Stop(Exception):
    """The text is no TOML from here on."""


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.found = Positions()
        self.open: list[int] = []
        self.entries: dict[Path, int] = {}  # how many [[entries]] each array of tables has so far

    def document(self) -> Positions:
        table: Path = ()
        try:
            while self._skip(_TRIVIA) < len(self.text):
                if self._next() == "[":
                    table = self._header()
                else:
                    self._statement(table)
                self._skip(_SPACE)
                if self.at < len(self.text) and self._next() not in "\n#\r":
                    raise _Stop
        except _Stop:
            self._note_stop()
        return self.found

    def single(self, start: int, path: Path, key: TextRange) -> Positions:
        self.at = start
        try:
            self._value(path, key)
        except _Stop:
            self._note_stop()
        return self.found

    def _note_stop(self) -> None:
        self.found.stopped_at = self.at
        self.found.open_bracket = self.open[-1] if self.open else None

    def _skip(self, pattern: str) -> int:
        match = re.compile(pattern).match(self.text, self.at)
        if match is not None:
            self.at = match.end()
        return self.at

    def _next(self) -> str:
        if self.at >= len(self.text):
            raise _Stop
        return self.text[self.at]

    def _take(self, pattern: str) -> TextRange:
        match = re.compile(pattern).match(self.text, self.at)
        if match is None:
            raise _Stop
        self.at = match.end()
        return TextRange(match.start(), match.end())

    def _expect(self, character: str) -> None:
        if self._next() != character:
            raise _Stop
        self.at += 1

    def _keys(self) -> list[tuple[str, TextRange]]:
        """A dotted key: the name and the range of each part."""
        parts = []
        while True:
            self._skip(_SPACE)
            quoted = self._next() in "\"'"
            place = self._take(_STRING if quoted else _BARE_KEY)
            raw = self.text[place.start : place.end]
            parts.append(("".join(c for c, _ in decode(raw)) if quoted else raw, place))
            self._skip(_SPACE)
            if self.at >= len(self.text) or self.text[self.at] != ".":
                return parts
            self.at += 1

    def _header(self) -> Path:
        """`[a.b]` or `[[a.b]]`; returns the path of the table that it opens."""
        start = self.at
        is_array = self.text.startswith("[[", start)
        self.at += 2 if is_array else 1
        keys = self._keys()
        for _ in range(2 if is_array else 1):
            self._expect("]")
        header = TextRange(start, self.at)
        path: Path = ()
        for name, place in keys[:-1]:
            path = self._enter(path, name, place)
        name, place = keys[-1]
        path = (*path, name)
        if not is_array:
            self._record(path, Place(place, header))
            return path
        index = self.entries.get(path, 0)
        if index == 0 and path in self.found.places:  # the name is taken by a value or a table
            self._record(path, Place(place, header))
        self.entries[path] = index + 1
        self.found.places.setdefault(path, Place(place, header))
        self._record((*path, index), Place(place, header))
        return (*path, index)

    def _enter(self, path: Path, name: str, place: TextRange) -> Path:
        """One step of a dotted key or header, into the newest entry where `name` is an array of tables."""
        path = (*path, name)
        self.found.places.setdefault(path, Place(place, place, explicit=False))
        return (*path, self.entries[path] - 1) if path in self.entries else path

    def _record(self, path: Path, place: Place) -> None:
        known = self.found.places.get(path)
        if known is not None and known.explicit:
            self.found.duplicates.append((path, known, place))
        else:
            self.found.places[path] = place

    def _statement(self, table: Path) -> None:
        """`a.b = value` inside `table`."""
        keys = self._keys()
        path = table
        for name, place in keys[:-1]:
            path = self._enter(path, name, place)
        name, place = keys[-1]
        self._expect("=")
        self._skip(_SPACE)
        self._value((*path, name), place)

    def _value(self, path: Path, key: TextRange | None) -> None:
        first = self._next()
        start = self.at
        if first == "[":
            self._array(path)
        elif first == "{":
            self._inline_table(path)
        else:
            self._take(_STRING if first in "\"'" else _SCALAR)
        self._record(path, Place(key, TextRange(start, self.at)))

    def _array(self, path: Path) -> None:
        for index in self._members("[", "]"):
            self._value((*path, index), None)

    def _inline_table(self, path: Path) -> None:
        for _ in self._members("{", "}"):
            self._statement(path)

    def _members(self, opening: str, closing: str) -> Iterator[int]:
        """Stops at the start of each member between the brackets, and after the closing one."""
        if len(self.open) >= _DEEPEST:
            raise _Stop
        self.open.append(self.at)
        self._expect(opening)
        index = 0
        self._skip(_TRIVIA)
        while self._next() != closing:
            yield index
            index += 1
            self._skip(_TRIVIA)
            if self._next() == ",":
                self.at += 1
                self._skip(_TRIVIA)
            elif self._next() != closing:
                raise _Stop
        self.at += 1
        self.open.pop()


def decode(literal: str) -> Iterator[tuple[str, int]]:
    """Each character of the TOML string `literal` (quotes included) with its offset in `literal`."""
    quote = literal[0]
    width = 3 if literal.startswith(quote * 3) and len(literal) >= 6 else 1
    at, end = width, len(literal) - width
    if width == 3 and literal.startswith(
        "\n", at
    ):  # a line end right after the quotes is no part of the text
        at += 1
    while at < end:
        escape = re.compile(_ESCAPE).match(literal, at, end) if quote == '"' else None
        if escape is None:
            yield literal[at], at
            at += 1
            continue
        code = escape[1] or escape[2] or escape[3]
        if code is not None:
            yield chr(min(int(code, 16), 0x10FFFF)), at
        elif escape[4] is not None:
            yield _ESCAPED[escape[4]], at
        at = escape.end()
