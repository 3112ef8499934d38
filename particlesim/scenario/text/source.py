"""Scenario text: read from a file with care, parsed, and able to say where each value stands."""

from __future__ import annotations

import tomllib
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from particlesim.errors import Diagnostic, Label, ScenarioError, Span, UsageError
from particlesim.scenario.text import positions, syntax
from particlesim.scenario.text.positions import Place, Positions, TextRange
from particlesim.trajectory.places import kind_of

LARGEST_FILE = 8 * 2**20
"""Bytes. Scenarios are kilobytes; particle data belongs into CSV or NPY files that a layout names."""

DEEPEST_NESTING = 64

KeyPath = positions.Path
"""The address of a value in the parsed file: `("forces", 0, "coefficient")`."""

RawTable = dict[str, Any]


@dataclass(frozen=True)
class Text:
    """A piece of TOML text that values come from. `file` is None for an override or text from Python."""

    text: str
    file: Path | None = None

    @cached_property
    def found(self) -> Positions:
        """The places of all values, found at the first question."""
        return positions.scan(self.text)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(at + 1 for at, character in enumerate(self.text) if character == "\n")]

    def span(self, place: TextRange) -> Span:
        """`place` as line and column. What goes beyond the line's end is not underlined."""
        line = bisect_right(self._line_starts, place.start)
        start = self._line_starts[line - 1]
        end_of_line = self.text.find("\n", place.start)
        end = min(place.end, end_of_line if end_of_line >= 0 else len(self.text))
        return Span(line, place.start - start + 1, max(1, end - place.start))


@dataclass(frozen=True)
class OverrideText(Text):
    """`--set forces.air.coefficient=-1`: the text of one override, which gives the value at `path`."""

    path: KeyPath = ()
    key: TextRange = field(default_factory=lambda: TextRange(0, 0))
    value_start: int = 0

    @cached_property
    def found(self) -> Positions:
        return positions.scan_value(self.text, self.value_start, self.path, self.key)


@dataclass(frozen=True)
class Source:
    """A parsed scenario with overrides applied (`raw`) and the texts that its values come from."""

    raw: RawTable
    main: Text
    overrides: tuple[OverrideText, ...] = ()

    @property
    def file(self) -> Path | None:
        """The scenario's file; None where its text comes from elsewhere."""
        return self.main.file

    def text_of(self, path: KeyPath) -> Text:
        """The text that gives the value at `path`: the last override of it or around it, or the file."""
        for override in reversed(self.overrides):
            if path[: len(override.path)] == override.path:
                return override
        if (
            path not in self.main.found.places
        ):  # a table that exists only because an override set something in it
            for override in reversed(self.overrides):
                if override.path[: len(path)] == path:
                    return override
        return self.main

    def place(self, path: KeyPath) -> Place | None:
        """Where the value at `path` stands in `text_of(path)`, None when it is not written there."""
        return self.text_of(path).found.places.get(path)

    def span_in_string(self, path: KeyPath, offset: int, length: int = 1) -> Span | None:
        """The place of characters `offset` to `offset + length` of the string value at `path`.

        Counts decoded characters, as a parser of the string does; an offset at the end points at the closing
        quote. None when the value is no string or is not written in the text.
        """
        text, place = self.text_of(path), self.place(path)
        if place is None or text.text[place.value.start] not in "\"'":
            return None
        literal = text.text[place.value.start : place.value.end]
        quotes = 3 if literal[:3] in ('"""', "'''") and len(literal) >= 6 else 1
        offsets = [at for _, at in positions.decode(literal)] + [len(literal) - quotes]
        first = min(max(offset, 0), len(offsets) - 1)
        last = min(first + max(length, 1), len(offsets) - 1)
        start = place.value.start + offsets[first]
        return text.span(TextRange(start, max(start + 1, place.value.start + offsets[last])))


def read_source(path: str | Path, *, largest: int = LARGEST_FILE) -> Source:
    """The scenario file at `path`, parsed.

    Raises UsageError when it cannot be read as text, ScenarioError when it is not valid TOML.
    """
    path = Path(path)
    return parse_source(_decode(path, _read_bytes(path, largest)), file=path)


def parse_source(text: str, file: Path | None = None) -> Source:
    """`text` parsed as TOML. Raises ScenarioError, with the place of the mistake and how to mend it."""
    main = Text(text.removeprefix("\ufeff").replace("\r\n", "\n"), file)
    if syntax.has_endless_key(main.text):
        raise _too_deep(main)
    try:
        raw = tomllib.loads(main.text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(main, syntax.explain(main.text, error)) from None
    except RecursionError:
        raise _too_deep(main) from None
    except ValueError:  # Python refuses to convert integers of more than some thousand digits
        raise _syntax_error(main, syntax.endless_integer(main.text)) from None
    if _deeper_than(raw, DEEPEST_NESTING):
        raise _too_deep(main)
    return Source(raw, main)


def source_from_dict(raw: Mapping[str, Any]) -> Source:
    """A scenario given as Python data, which has no text to point at."""
    return Source(dict(raw), Text(""))


def _syntax_error(main: Text, mistake: syntax.Mistake) -> ScenarioError:
    labels = tuple(Label(main.span(place), words) for place, words in mistake.also)
    span = main.span(mistake.place)
    return ScenarioError(
        [Diagnostic(mistake.message, "", main.file, main.text, span, labels, None, mistake.hint)]
    )


def _too_deep(main: Text) -> ScenarioError:
    message = f"arrays or tables are nested more than {DEEPEST_NESTING} deep"
    return ScenarioError([Diagnostic(message, file=main.file, hint="no scenario needs more than six")])


def _deeper_than(raw: RawTable, limit: int) -> bool:
    """Whether containers are nested deeper than `limit`, without recursion."""
    level: list[Any] = [raw]
    for _ in range(limit):
        level = [
            child
            for parent in level
            for child in (parent.values() if isinstance(parent, dict) else parent)
            if isinstance(child, dict | list)
        ]
        if not level:
            return False
    return True


def _read_bytes(path: Path, largest: int) -> bytes:
    try:
        if path.is_dir():
            raise UsageError(f"{path} is a directory, not a scenario file", _files_in(path))
        with path.open("rb") as file:
            if kind_of(path) == "device":  # a pipe is welcome: `psim run <(make_scenario)`
                raise UsageError(f"{path} is a device, not a scenario file", "name a .toml file")
            size = path.stat().st_size
            data = file.read(largest + 1) if size <= largest else b""
    except FileNotFoundError:
        raise UsageError(f"{path} does not exist", _similar_files(path)) from None
    except PermissionError:
        raise UsageError(f"{path} may not be read", "check its permissions") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UsageError(f"{str(path)[:200]!r} cannot be read: {reason}", "check the path") from None
    if max(size, len(data)) > largest:
        shown = f"{size / 2**20:.0f} MiB" if size > largest else "larger"
        raise UsageError(
            f"{path} is {shown}; a scenario may have at most {largest / 2**20:.0f} MiB",
            "put particle data into a CSV or NPY file and name it in a layout",
        )
    return data


def _decode(path: Path, data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise UsageError(f"{path} is UTF-16 text, TOML must be UTF-8", "save it with the encoding UTF-8")
    if data.startswith(b"\x89HDF"):
        raise UsageError(f"{path} is an HDF5 file, not a scenario", "to see what it holds: psim inspect")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        message = f"{path} is not UTF-8 text: byte 0x{data[error.start]:02x} in line {line}"
        raise UsageError(message, "save it with the encoding UTF-8") from None


def _files_in(folder: Path) -> str:
    try:
        names = sorted(child.name for child in folder.glob("*.toml"))
    except OSError:
        names = []
    return f"it contains {', '.join(names[:5])}" if names else "name a .toml file"


def _similar_files(path: Path) -> str:
    try:
        names = [child.name for child in path.parent.iterdir()]
    except OSError:
        return f"the folder {path.parent} does not exist" if not path.parent.exists() else "check the path"
    import difflib

    near = difflib.get_close_matches(path.name, names, n=1)
    return f"did you mean {path.parent / near[0]}?" if near else "check the path"
