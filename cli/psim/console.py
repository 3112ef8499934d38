"""What psim says besides its data: always to stderr, in colour only where someone looks."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from particlesim.scenario.scenario import Scenario

_CODES = {"red": "1;31", "yellow": "1;33", "cyan": "36", "bold": "1", "dim": "2"}


def colorful(stream: TextIO) -> bool:
    """Whether `stream` is a terminal that may be coloured (https://no-color.org)."""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def paint(text: str, style: str, stream: TextIO | None = None) -> str:
    """`text` in a style (red, yellow, cyan, bold, dim) if `stream`, by default stderr, shows colours."""
    text = plain(text)
    return f"\x1b[{_CODES[style]}m{text}\x1b[0m" if colorful(stream or sys.stderr) else text


def plain(text: object) -> str:
    """`text` without control characters: names and titles from files could move the cursor or change the colours."""
    from particlesim.scenario.text.report import printable

    return printable(str(text))


def print_path(path: Path) -> None:
    """A path on stdout: with every byte for programs, without control characters for a terminal."""
    print(plain(path) if sys.stdout.isatty() else path)


def animated() -> bool:
    """Whether progress may move: stderr is a terminal that can go back in its line."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def say(text: str) -> None:
    """A line to the user."""
    print(text, file=sys.stderr)


def warn(text: str, scenario: Scenario | None = None) -> None:
    """A warning to the user, with the place in a scenario of what it speaks of."""
    say(f"{paint('warning', 'yellow')}: {plain(text)}")
    if scenario is not None:
        from particlesim.scenario.subject import subject
        from particlesim.scenario.text.report import place_of

        if (found := subject(scenario, text)) is not None and (place := place_of(found)):
            say(f"  {paint('-->', 'cyan')} {place}")


def places(texts: Sequence[str], scenario: Scenario) -> list[dict[str, Any] | None]:
    """The place in a scenario of what every warning speaks of, for JSON; None where there is none."""
    if not texts:
        return []
    from particlesim.scenario.subject import subject

    return [
        None
        if found is None
        else {
            "path": found.path,
            "file": None if found.file is None else str(found.file),
            "line": None if found.span is None else found.span.line,
            "column": None if found.span is None else found.span.column,
        }
        for found in (subject(scenario, text) for text in texts)
    ]


def facts(rows: Iterable[tuple[str, str]], stream: TextIO) -> None:
    """Names and values in two columns; values longer than the terminal are folded under themselves."""
    import shutil
    import textwrap

    rows = [(name, plain(value)) for name, value in rows if value]
    indent = max((len(name) for name, _ in rows), default=0) + 4
    width = max(shutil.get_terminal_size().columns - indent, 24) if stream.isatty() else 10_000
    for name, value in rows:
        lines = [part for line in value.splitlines() for part in textwrap.wrap(line, width) or [""]]
        head = paint(f"{name:<{indent - 4}}", "cyan", stream)
        print(f"  {head}  " + f"\n{'':{indent}}".join(lines), file=stream)


def number(value: float) -> str:
    """A number for people: whole ones with thousands separators, others with six digits."""
    return f"{value:,}" if isinstance(value, int) else f"{value:.6g}"


def listed(names: Sequence[str], most: int = 12) -> str:
    """Names with commas; of many, the first and how many more."""
    more = f" and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def counted(count: int, noun: str) -> str:
    """'1 particle', '2,000 particles'."""
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"


def duration(seconds: float) -> str:
    """Wall time for people: '0.42 s', '3 min 20 s', '2 h 05 min'."""
    if seconds < 60:
        return f"{seconds:.2f} s" if seconds < 10 else f"{seconds:.1f} s"
    minutes = int(seconds) // 60
    if minutes < 60:
        return f"{minutes} min {int(seconds) % 60:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def rate(per_second: float) -> str:
    """Particle-steps per second for people: '312 M particle-steps/s'."""
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if per_second >= factor:
            return f"{per_second / factor:.3g} {prefix} particle-steps/s"
    return f"{per_second:.3g} particle-steps/s"


def print_json(data: Any) -> None:
    """`data` on stdout as one JSON value; numbers that JSON cannot say become null."""
    import json

    print(json.dumps(_finite(data), ensure_ascii=False, indent=2, allow_nan=False))


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float) and data - data != 0:  # NaN, ±∞
        return None
    return data
