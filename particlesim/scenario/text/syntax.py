"""What is wrong with a text that is not TOML, in words that help to mend it."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass

from particlesim.scenario.text import positions
from particlesim.scenario.text.positions import TextRange

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")

# 64 names joined by dots: tomllib's time grows with the square of the parts of a key.
_ENDLESS_KEY = re.compile(r"(?<![\w.-])(?:[\w-]++\.){64}")

_KEY = r"^\s*(?P<key>[\w.\"'-]++)\s*+"
_VALUE = r"(?:=|[\[,{])\s*"
_STATEMENT = r"\s*(?:\[\[?[\w.\"'-]+\]\]?\s*(?:#|$)|[\w.-]+\s*=)"
_LONGEST_LINE = 2000  # the patterns below are for lines that people write
_END = r"\s*(?:[,\]}#]|$)"
_NUMBER = r"[+-]?\d[\d_]*(?:\.\d+)?(?:[eE][+-]?\d+)?"

# Typical mistakes: a pattern for the offending line, and the advice; the group `at` is what is pointed at. They are compiled
# once there is a mistake: that takes longer than to read a scenario.
_MISTAKES: tuple[tuple[str, str], ...] = (
    (r"(?P<at>[“”„‘’«»])", "use straight quotes: \"text\" or 'text'"),
    (
        r"^\s*\[\[[^\]]*\]?(?P<at>)\s*(?:#.*)?$",
        "an entry of a list of tables has two brackets: [[forces]]",
    ),
    (r"^\s*\[[^\[\]=,]*(?P<at>)\s*(?:#.*)?$", "a table's name stands in brackets: [simulation]"),
    (rf"{_KEY}(?P<at>:)(?!=)", "TOML separates key and value with '=': {key} = ..."),
    (rf"{_KEY}(?P<at>:=|==)", "TOML separates key and value with '=': {key} = ..."),
    (rf"{_KEY}=(?P<at>)\s*(?:#.*)?$", "{key} has no value"),
    (
        rf"{_VALUE}(?P<at>[Tt][Rr][Uu][Ee]|[Ff][Aa][Ll][Ss][Ee]){_END}",
        "write true or false, in lower case",
    ),
    (rf"{_VALUE}(?P<at>None|null|nil|Null){_END}", "TOML has no empty value: leave the key out"),
    (
        rf"{_VALUE}[+-]?(?P<at>(?:NaN|NAN|Inf|INF|Infinity|infinity)){_END}",
        "the number must be finite",
    ),
    (rf"{_VALUE}(?P<at>[+-]?\.\d+)", "a number starts with a digit: 0{tail}"),
    (rf"{_VALUE}(?P<at>[+-]?\d+\.)(?!\d)", "a number ends with a digit: {at}0"),
    (rf"{_VALUE}(?P<at>[+-]?0\d[\d.]*)", "a number has no leading zeros"),
    (rf"=\s*(?P<at>[+-]?\d+,\d+){_END}", "write the decimal point as '.': {dotted}"),
    (
        rf"{_VALUE}(?P<at>[A-Za-z_][\w.]*\([^()]*\)?)",
        "TOML has numbers and texts, no calls: write what {at} gives",
    ),
    (
        rf"{_VALUE}(?!{_NUMBER}{_END})(?P<at>[+-]?\d[\d.]*(?:[eE][+-]?\d+)?\s*[A-Za-zµ°%][^\"',\]}}#=]*?){_END}",
        'a number with a unit is text: "{at}"',
    ),
    (rf"{_VALUE}(?P<at>[A-Za-z_][\w .-]*?){_END}", 'text stands in quotes: "{at}"'),
    (rf"{_KEY}(?P<at>)(?:[\w\"'\[{{+-].*)?$", "there must be '=' between key and value: {key} = ..."),
)


@dataclass(frozen=True)
class Mistake:
    """A syntax error: what is wrong, where, other places that matter, what to do."""

    message: str
    place: TextRange
    also: tuple[tuple[TextRange, str], ...] = ()
    hint: str | None = None


def has_endless_key(text: str) -> bool:
    """Whether a dotted key is so long that parsing it would take for ever."""
    return _ENDLESS_KEY.search(text) is not None


def explain(text: str, error: tomllib.TOMLDecodeError) -> Mistake:
    """The mistake behind `error`, which tomllib raised for `text`."""
    found = _PLACE.search(str(error))
    reason = _PLACE.sub("", str(error))
    at = _offset(text, int(found[1]), int(found[2])) if found and found[1] else len(text)
    if reason.startswith(("Cannot", "Duplicate")):
        return _defined_twice(text, at, reason)
    if re.match(r"Unterminated string|Illegal character '\\n'|Expected ['\"]{2}", reason):
        return _unclosed_text(text, at)
    control = _CONTROL.search(text, max(at - 1, 0))
    if control is not None and r"character '\x" in reason:
        what = f"a control character (number {ord(control[0])}) cannot stand here"
        return Mistake(what, TextRange(control.start(), control.end()), hint="take it out")
    if re.search(r"\\|[Ee]scape|[Hh]ex value", reason):
        advice = "write the text in 'single quotes', or each backslash twice"
        first = max(text.rfind("\\", 0, at + 1), 0)
        return Mistake("a backslash starts an escape", TextRange(first, first + 2), hint=advice)
    if text[at : at + 1] == "}" and (before := text[:at].rstrip()).endswith(","):
        comma = TextRange(len(before) - 1, len(before))
        return Mistake("a table in braces has no comma after its last key", comma, hint="leave the comma out")
    opening = positions.scan(text).open_bracket
    if opening is not None and "\n" in text[opening:at] and re.match(_STATEMENT, _line(text, at)[1]):
        return _unclosed_bracket(text, opening, at)
    if (typical := _typical(text, at)) is not None:
        return typical
    if opening is not None:
        return _unclosed_bracket(text, opening, at)
    return Mistake(f"not valid TOML: {reason[:1].lower()}{reason[1:]}", TextRange(at, at + 1))


def endless_integer(text: str) -> Mistake:
    """The mistake of an integer with thousands of digits."""
    digits = re.search(r"[\d_]{1000,}", text)
    place = TextRange(digits.start(), digits.end()) if digits else TextRange(0, 1)
    return Mistake("this integer has too many digits", place, hint="write 1e300 for a large number")


def _line(text: str, at: int) -> tuple[int, str]:
    """The offset and the text of the line that holds `at`."""
    start = text.rfind("\n", 0, at) + 1
    end = text.find("\n", at)
    return start, text[start : end if end >= 0 else len(text)]


def _offset(text: str, line: int, column: int) -> int:
    start = 0
    for _ in range(line - 1):
        start = text.index("\n", start) + 1
    return min(start + column - 1, len(text))


def _defined_twice(text: str, at: int, reason: str) -> Mistake:
    start, line = _line(text, at)
    scanned = positions.scan(text[: start + len(line)])
    if not scanned.duplicates:
        return Mistake(
            f"not valid TOML: {reason[:1].lower()}{reason[1:]}",
            TextRange(max(at - 1, 0), at),
            hint="the same name stands for a value and a table, or for a table and a list of tables",
        )
    path, first, second = scanned.duplicates[0]
    name = ".".join(str(part) for part in path)
    is_header = second.key is not None and second.value.start < second.key.start
    hint = "keep one of the two"
    if is_header:
        hint = (
            f"put all its keys under one [{name}]; only entries of a list, such as [[forces]], are repeated"
        )
    return Mistake(
        f"{name!r} is defined twice",
        second.key or second.value,
        also=((first.key or first.value, "first defined here"),),
        hint=hint,
    )


def _typical(text: str, at: int) -> Mistake | None:
    """The first typical mistake in the line of `at`, or in the last line when the text ended too early."""
    start, line = _line(text, min(at, len(text.rstrip())))
    if len(line) > _LONGEST_LINE:
        return None
    for pattern, advice in _MISTAKES:
        found = re.search(pattern, line)
        if found is None:
            continue
        groups = found.groupdict()
        what = groups["at"].strip()
        words = advice.format(
            key=groups.get("key"), at=what, tail=what.lstrip("+-"), dotted=what.replace(",", ".")
        )
        first = start + found.start("at")
        return Mistake("not valid TOML", TextRange(first, first + max(len(what), 1)), hint=words)
    return None


def _unclosed_bracket(text: str, opening: int, at: int) -> Mistake:
    closing = "]" if text[opening] == "[" else "}"
    if at < len(text) and "\n" not in text[opening : at + 1]:
        message = f"expected a value, ',' or {closing!r} here"
        return Mistake(message, TextRange(at, at + 1), ((TextRange(opening, opening + 1), "opened here"),))
    also = ((TextRange(at, at + 1), f"{closing!r} expected before this"),) if at < len(text) else ()
    return Mistake(f"this {text[opening]!r} is not closed", TextRange(opening, opening + 1), also)


def _unclosed_text(text: str, at: int) -> Mistake:
    multi_line = max(text.rfind('"""', 0, at), text.rfind("'''", 0, at))
    if at >= len(text) and multi_line >= 0 and "\n" in text[multi_line:]:
        return Mistake("this text has no closing quotes", TextRange(multi_line, multi_line + 3))
    start = _line(text, at)[0]
    quotes = [start + found.start() for found in re.finditer(r"[\"']", text[start:at])]
    first = quotes[-1] if quotes else max(at - 1, 0)
    return Mistake("this text has no closing quote", TextRange(first, max(at, first + 1)))
