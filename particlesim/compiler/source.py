"""The syntax trees of functions, and which of their variables need no memory.

A variable is *plain* if only one assignment can reach each of its uses, the one before it: then the walker binds the name to
the value. Others, such as sums in a loop, are memory on the stack, which LLVM turns into registers.
"""

from __future__ import annotations

import ast
import functools
import linecache
from collections.abc import Callable
from dataclasses import dataclass, field
from types import CodeType
from typing import Any

from particlesim.compiler.values import Unsupported

LAMBDA = "<lambda>"
"""What Python calls a function without a name."""


@dataclass(frozen=True)
class Source:
    """A function's tree (a FunctionDef or a Lambda), its file and its variables that are not plain."""

    tree: Any
    file: str
    cells: frozenset[str]


@functools.cache
def _tree(path: str) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse("".join(linecache.getlines(path)))


@functools.cache
def _functions(path: str) -> dict[tuple[int, str], list[Any]]:
    """The functions of a file by first line and name."""
    found: dict[tuple[int, str], list[Any]] = {}
    statements: list[Any] = [_tree(path)]
    for node in statements:  # expressions, most of the tree, hold no functions with a name
        if isinstance(node, ast.FunctionDef):
            first = min((each.lineno for each in node.decorator_list), default=node.lineno)
            found.setdefault((first, node.name), []).append(node)
        for part in ("body", "orelse", "handlers", "finalbody", "cases"):
            inside = getattr(node, part, ())
            statements += inside if isinstance(inside, list) else ()
    return found


@functools.cache
def _lambdas(path: str) -> dict[tuple[int, str], list[Any]]:
    """The lambdas of a file by line."""
    found: dict[tuple[int, str], list[Any]] = {}
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Lambda):
            found.setdefault((node.lineno, LAMBDA), []).append(node)
    return found


@functools.cache
def _source(code: CodeType) -> Source:
    functions = _lambdas if code.co_name == LAMBDA else _functions
    found = functions(code.co_filename).get((code.co_firstlineno, code.co_name), [])
    if len(found) > 1:  # lambdas of one line: the one that holds what the code was compiled from
        columns = [column for _, _, column, _ in code.co_positions() if column]
        found = [
            each
            for each in found
            if columns and each.body.col_offset <= columns[0] < each.body.end_col_offset
        ]
    if len(found) != 1:
        raise Unsupported(
            f"the source of {code.co_name} is not at line {code.co_firstlineno} of {code.co_filename}"
        )
    return Source(found[0], code.co_filename, _cells(found[0]))


def source_of(function: Callable[..., Any]) -> Source:
    """The source of a Python function. Raises Unsupported where there is none, such as for functions written in C."""
    code = getattr(function, "__code__", None)
    if code is None:
        raise Unsupported(f"{function!r} is no function of Python, and the compiler does not know it")
    return _source(code)


@dataclass
class _Uses(ast.NodeVisitor):
    """Assignments and uses of names in the order of execution, each with the blocks around it."""

    blocks: tuple[tuple[int, bool], ...] = ()  # number, whether a loop
    count: int = 0
    events: dict[str, list[tuple[int, bool, tuple[tuple[int, bool], ...]]]] = field(default_factory=dict)

    def _note(self, name: str, store: bool) -> None:
        self.count += 1
        self.events.setdefault(name, []).append((self.count, store, self.blocks))

    def _inside(self, nodes: list[Any], loop: bool = False) -> None:
        self.count += 1
        outer, self.blocks = self.blocks, (*self.blocks, (self.count, loop))
        for each in nodes:
            self.visit(each)
        self.blocks = outer

    def visit_Name(self, node: ast.Name) -> None:
        self._note(node.id, isinstance(node.ctx, ast.Store))

    def visit_arg(self, node: ast.arg) -> None:
        self._note(node.arg, True)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for each in node.args.args:
            self._note(each.arg, True)
        for statement in node.body:
            self.visit(statement)

    def visit_Lambda(self, node: ast.Lambda) -> None:
        for each in node.args.args:
            self._note(each.arg, True)
        self.visit(node.body)

    def visit_Assign(self, node: ast.Assign) -> None:
        self.visit(node.value)
        for target in node.targets:
            self.visit(target)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)
            self.visit(node.target)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Name):
            self._note(node.target.id, False)
        self.visit(node.value)
        self.visit(node.target)

    def visit_If(self, node: ast.If) -> None:
        self.visit(node.test)
        self._inside(node.body)
        self._inside(node.orelse)

    def visit_While(self, node: ast.While) -> None:
        self._inside([node.test, *node.body], loop=True)

    def visit_For(self, node: ast.For) -> None:
        self.visit(node.iter)
        self._inside([node.target, *node.body], loop=True)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        self.visit(node.iter)

    def visit_GeneratorExp(self, node: Any) -> None:
        """Names of a comprehension are its own; what it uses of others counts."""
        own = {
            each.id for one in node.generators for each in ast.walk(one.target) if isinstance(each, ast.Name)
        }
        for each in ast.walk(node):
            if isinstance(each, ast.Name) and each.id not in own:
                self._note(each.id, False)

    visit_ListComp = visit_GeneratorExp


def _cells(tree: Any) -> frozenset[str]:
    uses = _Uses()
    uses.visit(tree)
    return frozenset(
        name for name, events in uses.events.items() if not all(_plain(load, events) for load in events)
    )


def _plain(load: Any, events: list[Any]) -> bool:
    at, is_store, around = load
    if is_store:
        return True
    stores = [each for each in events if each[1]]
    before = [each for each in stores if each[0] < at]
    if not stores:
        return True  # a global
    if not before:
        return False
    last = before[-1][2]
    if around[: len(last)] != last:
        return False
    # An assignment further down comes back with the next turn of a loop, unless the loop begins with the one before.
    turns = {block for block in around if block[1]} - set(last)
    return not any(turns & set(each[2]) for each in stores if each[0] > at)
