"""Expressions written in a scenario, such as "-k*x + 0.1*sin(2*pi*t)", as trees of records.

Python's own parser reads the text; a whitelist turns its tree into records, one type per operation. Nothing is ever
evaluated as Python: like every law, an expression is compiled from the types of its records (`operations`).
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.expressions.operations import (
    FUNCTIONS,
    VARIABLES,
    Add,
    Constant,
    Divide,
    GeneralPower,
    IfLess,
    Maximum,
    Minimum,
    Multiply,
    Negate,
    Node,
    Power,
    Square,
    Subtract,
    value,
)
from particlesim.laws.registry import Particle
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.spelling import near_miss

MAX_LENGTH = 2000
"""Characters in an expression; longer ones are refused before they are parsed."""
MAX_DEPTH = 16
"""Operations inside each other; the compiler recurses over them, and would run out of stack at some thirty."""


WRITTEN = "numbers, names, ( ), + - * / **, functions and a if b < c else d"
"""What expressions are written with."""
DEEPEST = "write it with fewer brackets inside each other"


class ExpressionError(ValueError):
    """A text that is no expression: what is wrong, where (0-based, in characters), how long, and what is allowed."""

    def __init__(self, message: str, offset: int, length: int = 1, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.length = length
        self.hint = hint


BUILTIN_CONSTANTS = {"pi": math.pi, "e": math.e}

_BINARY: dict[type[ast.operator], Callable[..., Node]] = {
    ast.Add: Add,
    ast.Sub: Subtract,
    ast.Mult: Multiply,
    ast.Div: Divide,
}
_PLAIN = {"²": "**2", "³": "**3", "×": "*", "·": "*", "÷": "/", "−": "-", "–": "-", "π": "pi"}
_BASED = re.compile(r"(?<![\w.])0[xXoObB]\w*")
_PROBE = Particle(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def parse(text: str, constants: Mapping[str, float], variables: Mapping[str, Node] = VARIABLES) -> Node:
    """The tree of records of an expression.

    Names are the variables, pi, e, and the given constants. Raises ExpressionError with the place inside the text.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"longer than {MAX_LENGTH:,} characters", 0, 1, hint=f"{len(text):,} here")
    known = [*variables, *BUILTIN_CONSTANTS, *constants]
    stripped = text.strip()
    if not stripped:
        raise ExpressionError("an empty expression", 0, 1, hint=_allowed(known))
    indent = len(text) - len(text.lstrip())
    _check_characters(text)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            warnings.simplefilter("ignore", DeprecationWarning)
            tree = ast.parse(stripped, mode="eval").body
    except SyntaxError as error:
        raise ExpressionError(
            "not an expression", indent + _place(error, stripped), hint=_allowed(known)
        ) from None
    except (RecursionError, MemoryError):
        raise ExpressionError("nested too deeply", 0, len(text), hint=DEEPEST) from None
    return _Builder(stripped, indent, constants, variables).build(tree)


def _check_characters(text: str) -> None:
    """Refuse what Python's parser would read and an expression does not have: comments, other letters, other bases."""
    for offset, character in enumerate(text):
        if character == "#":
            hint = "write it behind the quotation mark at the end"
            raise ExpressionError("an expression has no comments", offset, len(text) - offset, hint=hint)
        if not (character.isascii() and (character.isprintable() or character.isspace())):
            written = _PLAIN.get(character)
            raise ExpressionError(
                "not a character of an expression",
                offset,
                hint=f"write {written}" if written else f"{WRITTEN}; names are of a to z, digits and _",
            )
    if (based := _BASED.search(text)) is not None:
        hint = "numbers such as 12, 0.5 and 1e-3"
        raise ExpressionError("not a decimal number", based.start(), len(based[0]), hint=hint)


def _place(error: SyntaxError, text: str) -> int:
    """Where Python's parser stumbled, in characters; the last one when it came to the end."""
    if not error.lineno or not error.offset:
        return len(text) - 1
    before = sum(len(line) for line in _lines(text)[: error.lineno - 1])
    return min(before + error.offset - 1, len(text) - 1)


def _lines(text: str) -> list[str]:
    """The lines as Python's parser counts them, with their ends."""
    return re.findall(r"[^\r\n]*(?:\r\n|\r|\n|$)", text)


_Chain = list[tuple[type[ast.operator], ast.expr]]
"""Terms of a sum or factors of a product, each with the operator before it; that of the first means nothing."""


class _Builder:
    """Turns Python's syntax tree into records, and refuses all operations that are not listed."""

    def __init__(
        self, text: str, indent: int, constants: Mapping[str, float], variables: Mapping[str, Node]
    ) -> None:
        self.lines = _lines(text)
        self.indent = indent
        self.constants = {**BUILTIN_CONSTANTS, **constants}
        self.variables = variables
        self.depth = 0

    def build(self, node: ast.expr) -> Node:
        """The record of a node."""
        if self.depth > MAX_DEPTH:
            hint = "write some of it apart: several fields add up"
            raise self._error(node, f"more than {MAX_DEPTH} operations inside each other", hint)
        self.depth += 1
        record = self._record(node)
        self.depth -= 1
        return record

    def _record(self, node: ast.expr) -> Node:
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd):
            return self.build(node.operand)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self._folded(Negate(self.build(node.operand)), node)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, ast.IfExp):
            return self._choice(node)
        raise self._error(node, "not allowed in an expression", self._allowed())

    def _number(self, node: ast.Constant) -> Node:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise self._error(node, "not a number", self._allowed())
        try:
            number = float(node.value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._error(node, "the number is too large", "numbers are up to 1.8e308")
        return Constant(number)

    def _name(self, node: ast.Name) -> Node:
        if node.id in self.constants:
            return Constant(float(self.constants[node.id]))
        if node.id in self.variables:
            return self.variables[node.id]
        if node.id in FUNCTIONS:
            raise self._error(node, f"{node.id} is a function", f"write what it acts on: {node.id}(x)")
        known = [*self.variables, *self.constants]
        raise self._error(node, f"unknown name {node.id!r}", _nearest(node.id, known, "names", known))

    def _binary(self, node: ast.BinOp) -> Node:
        if isinstance(node.op, ast.Pow):
            return self._power(node)
        if type(node.op) not in _BINARY:
            hint = (
                "write a**b for a power" if isinstance(node.op, ast.BitXor) else "+ - * / and ** are allowed"
            )
            raise self._error(node, "unknown operator", hint)
        chain = _chain(node)  # the bits of a short one are those of reading from left to right
        if len(chain) > 2 and self.depth - 1 + _height(node) > MAX_DEPTH:
            return self._halved(chain, node)
        return self._folded(_BINARY[type(node.op)](self.build(node.left), self.build(node.right)), node)

    def _halved(self, chain: _Chain, node: ast.BinOp) -> Node:
        """A long sum or product, cut in halves again and again: from left to right, all others are around its first term."""
        half = len(chain) // 2
        operator, right = chain[half][0], chain[half:]
        if operator is ast.Sub:  # a + b - c + d = (a + b) - (c - d)
            right = [(ast.Add if before is ast.Sub else ast.Sub, term) for before, term in right]
        return self._folded(_BINARY[operator](self._half(chain[:half], node), self._half(right, node)), node)

    def _half(self, chain: _Chain, node: ast.BinOp) -> Node:
        if len(chain) == 1:
            return self.build(chain[0][1])
        self.depth += 1
        record = self._halved(chain, node)
        self.depth -= 1
        return record

    def _power(self, node: ast.BinOp) -> Node:
        base, exponent = self.build(node.left), self.build(node.right)
        if not isinstance(exponent, Constant):
            return GeneralPower(base, exponent)
        if exponent.number == 0:
            return Constant(1.0)
        if exponent.number == 1:
            return base
        if exponent.number == 2:
            return self._folded(Square(base), node)
        return self._folded(Power(base, exponent.number), node)

    def _call(self, node: ast.Call) -> Node:
        if not isinstance(node.func, ast.Name):
            raise self._error(node.func, "only functions can be called", "functions: " + ", ".join(FUNCTIONS))
        name = node.func.id
        if name not in FUNCTIONS:
            hint = _nearest(name, list(FUNCTIONS), "functions", list(FUNCTIONS))
            raise self._error(node.func, f"unknown function {name!r}", hint)
        function = FUNCTIONS[name]
        wanted = len(function._fields)  # type: ignore[attr-defined]
        if node.keywords or len(node.args) != wanted or any(isinstance(a, ast.Starred) for a in node.args):
            such = ", ".join("abc"[:wanted])
            plural = "s" if wanted > 1 else ""
            raise self._error(node, f"{name} takes {wanted} argument{plural}", f"write {name}({such})")
        return self._folded(function(*(self.build(a) for a in node.args)), node)

    def _choice(self, node: ast.IfExp) -> Node:
        test = node.test
        if not isinstance(test, ast.Compare) or len(test.ops) != 1:
            raise self._error(test, "a condition is one comparison", "such as: k*x if x < 1 else 0")
        a, b = self.build(test.left), self.build(test.comparators[0])
        yes, no = self.build(node.body), self.build(node.orelse)
        op = type(test.ops[0])
        if op is ast.Lt:
            return IfLess(a, b, yes, no)
        if op is ast.Gt:
            return IfLess(b, a, yes, no)
        if op is ast.LtE:
            return IfLess(b, a, no, yes)
        if op is ast.GtE:
            return IfLess(a, b, no, yes)
        raise self._error(test, "unknown comparison", "<, <=, > and >= are allowed")

    def _allowed(self) -> str:
        return _allowed([*self.variables, *self.constants])

    def _error(self, node: ast.expr, message: str, hint: str | None) -> ExpressionError:
        start = self._characters(node.lineno, node.col_offset)
        end = self._characters(node.end_lineno or node.lineno, node.end_col_offset or node.col_offset + 1)
        return ExpressionError(message, self.indent + start, max(end - start, 1), hint)

    def _characters(self, line: int, column: int) -> int:
        """The place of a column of a line, which Python counts, in the whole text."""
        before = sum(len(text) for text in self.lines[: line - 1])
        return before + column

    def _folded(self, record: Node, node: ast.expr) -> Node:
        """Constants of constants are computed here, once."""
        if not all(isinstance(part, Constant | float) for part in record):
            return record
        with np.errstate(all="ignore"):
            try:
                number = float(value(record, _PROBE))
            except (ArithmeticError, TypeError, ValueError):  # 1/0, 9.0**999 and the complex (−8)**0.5
                number = math.nan
        if not math.isfinite(number):
            raise self._error(
                node, "this is not a finite number", "the constants in it give infinity, or nothing real"
            )
        return Constant(number)


def _chain(node: ast.BinOp) -> _Chain:
    """The terms of a sum, or the factors of a product."""
    same = next((kinds for kinds in ((ast.Add, ast.Sub), (ast.Mult,)) if isinstance(node.op, kinds)), ())
    found: _Chain = []
    here: ast.expr = node
    while isinstance(here, ast.BinOp) and isinstance(here.op, same):
        found.append((type(here.op), here.right))
        here = here.left
    return [(type(node.op), here), *reversed(found)]


def _height(node: ast.expr) -> int:
    """How many operations are inside each other, at most."""
    highest, left = 0, [(node, 0)]
    while left:
        here, height = left.pop()
        highest = max(highest, height)
        inside = height + (not isinstance(here, ast.Compare))
        left += [(part, inside) for part in ast.iter_child_nodes(here) if isinstance(part, ast.expr)]
    return highest


def _allowed(known: list[str]) -> str:
    """What an expression may have, which knows these names."""
    return f"{WRITTEN}; names: {', '.join(known)}; functions: {', '.join(FUNCTIONS)}"


def _nearest(name: str, candidates: list[str], what: str, known: list[str]) -> str:
    close = near_miss(name, candidates)
    return (f"did you mean {close!r}? " if close else "") + f"{what}: " + ", ".join(known)


def reads(node: Node, variable: type) -> bool:
    """Whether an expression reads a variable."""
    return isinstance(node, variable) or any(
        isinstance(part, tuple) and reads(part, variable) for part in node
    )


def attributes_read(nodes: Iterable[Node]) -> frozenset[str]:
    """Attributes of particles that expressions read in addition to the mass, by name."""
    symbols = {each.symbol: name for name, each in ATTRIBUTES.items() if name != "mass"}
    return frozenset(
        name
        for symbol, name in symbols.items()
        if any(reads(node, type(VARIABLES[symbol])) for node in nodes)
    )


def on_arrays(node: Node, variables: Callable[[Node], npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """The value of an expression for many particles at once; `variables` gives the numbers of a variable.

    As in compiled code, what is no real number is a NaN, and division by zero gives an infinity.
    """
    with np.errstate(all="ignore"):
        return np.asarray(_on_arrays(node, variables), np.float64)


def _on_arrays(node: Node, variables: Callable[[Node], npt.NDArray[np.float64]]) -> Any:
    if isinstance(node, Constant):
        return np.float64(node.number)
    if not any(isinstance(part, tuple) for part in node):
        return variables(node)
    parts = [_on_arrays(part, variables) if isinstance(part, tuple) else part for part in node]
    if isinstance(node, IfLess):
        a, b, yes, no = parts
        return np.where(a < b, yes, no)
    if isinstance(node, Minimum | Maximum):
        return np.where(parts[0] < parts[1], *(parts if isinstance(node, Minimum) else parts[::-1]))
    known = (
        Constant(part) if isinstance(old, tuple) else part for old, part in zip(node, parts, strict=True)
    )
    return value(type(node)(*known), _PROBE)  # the law itself, on arrays
