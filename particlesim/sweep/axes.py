"""What is varied: `KEY=1,2,5`, `KEY=linspace(0, 1, 11)`, `KEY=uniform(0, 1)`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from particlesim.errors import ScenarioError, UsageError
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.text.overrides import Override, toml_value

MOST_VALUES = 10**7
"""Values that a function may make: as many as fit in memory and in the folder of a sweep with ease."""
_CALL = re.compile(r"([A-Za-z_]\w*)\s*\((.*)\)", re.DOTALL)
_WORD = re.compile(r"[A-Za-z_][\w-]*")
_TOML_WORDS = ("true", "false", "inf", "nan")
_PAIRS = {"(": ")", "[": "]", "{": "}"}


@dataclass(frozen=True)
class Listed:
    """A key and the values that it takes, one after the other."""

    key: str
    values: tuple[object, ...]


@dataclass(frozen=True)
class Sampled:
    """A key whose values are drawn between two numbers, evenly or evenly in the logarithm."""

    key: str
    low: float
    high: float
    logarithmic: bool

    def at(self, fraction: float) -> float:
        """The value at a fraction of the range, 0 to 1."""
        if self.logarithmic:
            return math.exp(math.log(self.low) + fraction * (math.log(self.high) - math.log(self.low)))
        return self.low + fraction * (self.high - self.low)


def parse_axis(argument: str) -> Listed | Sampled:
    """`KEY=VALUES` of the command line; a word without quotes is text.

    Raises UsageError for what has no key, no values or a function that there is not; ScenarioError for a value that is
    not TOML.
    """
    key, equals, text = (part.strip() for part in argument.partition("="))
    if not equals or not key:
        raise UsageError(
            f"--vary {argument!r} is not of the form KEY=VALUES",
            "For example: --vary simulation.dt=1e-3,2e-3",
        )
    pieces = _split(text)
    if not any(pieces):
        raise UsageError(
            f"--vary {key} has no values", f"For example: --vary {key}=1,2,5 or '{key}=linspace(0, 1, 11)'"
        )
    if len(pieces) == 1 and (call := _CALL.fullmatch(pieces[0])) and call[1] in ("uniform", "loguniform"):
        low, high = _numbers(key, call[1], call[2], 2)
        return _sampled(key, low, high, call[1] == "loguniform")
    values: list[object] = []
    for piece in pieces:
        values += _values(key, piece)
    return Listed(key, tuple(values))


def _split(text: str) -> list[str]:
    """`text` at the commas that stand outside of quotes and brackets."""
    pieces, closing, quote, begin = [], [""], "", 0
    for at, character in enumerate(text):
        if quote:
            quote = "" if character == quote and text[at - 1] != "\\" else quote
        elif character in "\"'":
            quote = character
        elif character in _PAIRS:
            closing.append(_PAIRS[character])
        elif character == closing[-1]:
            closing.pop()
        elif character == "," and len(closing) == 1:
            pieces.append(text[begin:at].strip())
            begin = at + 1
    return [*pieces, text[begin:].strip()]


def _values(key: str, piece: str) -> list[object]:
    call = _CALL.fullmatch(piece)
    if call is not None:
        return _called(key, call[1], call[2])
    if _WORD.fullmatch(piece) and piece not in _TOML_WORDS:
        return [piece]
    text = f"--vary {key}={piece}"
    start = text.index("=") + 1
    try:
        return [toml_value(Override(key, None, text, len("--vary "), start), piece)]
    except ScenarioError as error:
        forms = "values are listed as 1,2,5 or 'linspace(0, 1, 11)'"
        raise ScenarioError([replace(each, hint=each.hint or forms) for each in error.diagnostics]) from None


def _called(key: str, name: str, arguments: str) -> list[object]:
    """The values of linspace(first, last, count) or logspace(exponent, exponent, count)."""
    if name in ("uniform", "loguniform"):
        raise UsageError(
            f"--vary {key}: {name} stands alone, it draws values", "With --samples N. For a list: linspace."
        )
    functions: dict[str, Callable[[float, float, int], list[float]]] = {
        "linspace": lambda a, b, n: np.linspace(a, b, n).tolist(),
        "logspace": lambda a, b, n: np.logspace(a, b, n).tolist(),
    }
    if name not in functions:
        known = (*functions, "uniform", "loguniform")
        hint = did_you_mean(name, known) or "There are: " + ", ".join(known)
        raise UsageError(f"--vary {key}: there is no function {name!r}", hint)
    first, last, count = _numbers(key, name, arguments, 3)
    if count != int(count) or not 1 <= count <= MOST_VALUES:
        raise UsageError(
            f"--vary {key}: {name} makes a whole number of values, from 1 to {MOST_VALUES:,}, not {_plainly(count)}"
        )
    with np.errstate(over="ignore"):
        values = functions[name](first, last, int(count))
    if not all(map(math.isfinite, values)):
        raise UsageError(
            f"--vary {key}: {name}({arguments}) is not finite", "logspace takes exponents: logspace(-3, 0, 7)"
        )
    whole = all(value.is_integer() for value in values)  # so that whole numbers can be varied as well
    return [int(value) if whole else value for value in values]


def _plainly(count: float) -> str:
    """A number such that no digit is lost of a whole one."""
    return f"{int(count):,}" if count.is_integer() and abs(count) < 1e15 else f"{count:g}"


def _numbers(key: str, name: str, arguments: str, count: int) -> list[float]:
    try:
        numbers = [float(part) for part in arguments.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        usage = f"{name}({'first, last, count' if count == 3 else 'low, high'})"
        raise UsageError(
            f"--vary {key}: {name}({arguments}) does not name {count} finite numbers", f"Write {usage}."
        )
    return numbers


def _sampled(key: str, low: float, high: float, logarithmic: bool) -> Sampled:
    if not low < high:
        raise UsageError(
            f"--vary {key}: the range from {low:g} to {high:g} is empty", "The first number is the lower one."
        )
    if logarithmic and low <= 0:
        raise UsageError(f"--vary {key}: loguniform needs numbers above 0, got {low:g}")
    return Sampled(key, low, high, logarithmic)
