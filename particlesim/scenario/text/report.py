"""Diagnostics as text: the message, the lines of the file with carets, what is allowed, what to try.

error: must be greater than 0, got -1
  --> fountain.toml:12:15  (forces.air.coefficient)
   |
12 | coefficient = -1
   |               ^^
   = allowed: a number > 0, in kg/s
"""

from __future__ import annotations

import textwrap
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass

from particlesim.errors import Diagnostic, Span

_WIDEST = 100
"""Columns of source that are shown; longer lines are cut around the caret."""

_TAB = "    "

_RED, _BLUE, _CYAN, _BOLD, _PLAIN = "\x1b[1;31m", "\x1b[1;34m", "\x1b[36m", "\x1b[1m", "\x1b[0m"


def render_all(diagnostics: Iterable[Diagnostic], *, color: bool = False) -> str:
    """All `diagnostics`, with an empty line between them."""
    return "\n\n".join(render_text(diagnostic, color=color) for diagnostic in diagnostics)


def render_text(diagnostic: Diagnostic, *, color: bool = False) -> str:
    """One diagnostic as lines of text, without a final line end. ANSI colours only if asked for."""
    paint = _Paint(color)
    marks = _marks(diagnostic)
    # An override stands alone on its line, a number would mean nothing.
    numbers = [
        str(mark.line) if diagnostic.file is not None or "\n" in diagnostic.source else "" for mark in marks
    ]
    gutter = max((len(number) for number in numbers), default=0) or 1
    bar = paint(_BLUE, f"{'':{gutter}} |")
    lines = [paint(_RED, "error") + paint(_BOLD, f": {printable(diagnostic.message)}")]
    if place := place_of(diagnostic):
        lines.append(f"{'':{gutter}}{paint(_BLUE, '-->')} {place}")
    source = diagnostic.source.split("\n")
    previous = None
    for mark, number in zip(marks, numbers, strict=True):
        if mark.line > len(source):
            continue
        if previous is None:
            lines.append(bar)
        elif mark.line > previous + 1:
            lines.append(paint(_BLUE, "..."))
        shown, indent, width = _excerpt(source[mark.line - 1], mark)
        if mark.line != previous:
            lines.append(f"{paint(_BLUE, f'{number:>{gutter}} |')} {shown}".rstrip())
        under = ("^" if mark.primary else "-") * width + (f" {mark.text}" if mark.text else "")
        lines.append(f"{bar} {' ' * indent}{paint(_RED if mark.primary else _BLUE, under)}")
        previous = mark.line
    for word, text in (("allowed", diagnostic.allowed), ("help", diagnostic.hint)):
        if text:
            wrapped = textwrap.wrap(printable(text), _WIDEST, break_long_words=False, break_on_hyphens=False)
            folded = f"\n{'':{gutter + 5 + len(word)}}".join(wrapped)
            lines.append(f"{'':{gutter}} {paint(_BLUE, '=')} {paint(_CYAN, word)}: {folded}")
    return "\n".join(lines)


@dataclass(frozen=True)
class _Mark:
    """A caret line: where, and what to write beside it."""

    line: int
    column: int
    length: int
    text: str
    primary: bool


class _Paint:
    def __init__(self, color: bool) -> None:
        self.color = color

    def __call__(self, code: str, text: str) -> str:
        return f"{code}{text}{_PLAIN}" if self.color and text else text


def _marks(diagnostic: Diagnostic) -> list[_Mark]:
    """The primary span and the labels in the order of the file."""
    if not diagnostic.source:
        return []
    spans: list[tuple[Span, str, bool]] = [(label.span, label.text, False) for label in diagnostic.labels]
    if diagnostic.span is not None:
        spans.append((diagnostic.span, "", True))
    marks = [_Mark(s.line, s.column, s.length, printable(text), primary) for s, text, primary in spans]
    return sorted(marks, key=lambda mark: (mark.line, not mark.primary, mark.column))


def place_of(diagnostic: Diagnostic) -> str:
    """File, line, column and address of a diagnostic, as far as there are such."""
    place = "" if diagnostic.file is None else str(diagnostic.file)
    if diagnostic.span is not None and place:
        place += f":{diagnostic.span.line}:{diagnostic.span.column}"
    elif diagnostic.span is not None and "\n" in diagnostic.source:
        place = f"line {diagnostic.span.line}, column {diagnostic.span.column}"
    path = f"({diagnostic.path})" if diagnostic.path else ""
    return "  ".join(printable(part) for part in (place, path) if part)


def _excerpt(line: str, mark: _Mark) -> tuple[str, int, int]:
    """The line to show, cut to `_WIDEST` around the caret, the columns before the caret and its width."""
    start = min(mark.column - 1, len(line))
    end = min(start + mark.length, len(line))
    first = 0
    if _width(line) > _WIDEST and _width(line[:end]) > _WIDEST - 5:
        first = max(0, start - _WIDEST // 3)
    before, marked = _expand(line[first:start]), _expand(line[start:end])
    lead = "..." if first else ""
    room = _WIDEST - _width(lead + before)
    shown = _cut(_expand(line[first:]), _WIDEST - len(lead))
    return lead + shown, _width(lead + before), max(1, min(_width(marked), room))


def _cut(text: str, widest: int) -> str:
    if _width(text) <= widest:
        return text
    kept, width = [], 0
    for character in text:
        width += _width(character)
        if width > widest - 3:
            break
        kept.append(character)
    return "".join(kept) + "..."


def _expand(text: str) -> str:
    return "".join(_TAB if character == "\t" else _visible(character) for character in text)


def printable(text: str) -> str:
    """`text` without control characters, which could move the terminal's cursor or change its colours."""
    return "".join(_visible(character) for character in text)


def _visible(character: str) -> str:
    return (
        "\ufffd" if unicodedata.category(character) in ("Cc", "Cf", "Cs") and character != "\n" else character
    )


def _width(text: str) -> int:
    """Columns on a terminal: 2 for wide characters, 0 for combining marks."""
    return sum(
        0 if unicodedata.combining(character) else 2 if unicodedata.east_asian_width(character) in "WF" else 1
        for character in text
    )
