"""What is public is documented: functions, classes and methods, but for what implements a face that is."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "particlesim"
Classes = dict[str, list[ast.ClassDef]]
LAWS = ("law", "central_law", "contact_law")


def test_public_names_have_docstrings() -> None:
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
    classes: Classes = defaultdict(list)
    for tree in trees.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                classes[node.name].append(node)
    bare = [
        f"{path}:{node.lineno} {node.name}" for path, tree in trees.items() for node in _bare(tree, classes)
    ]
    assert bare == []


def _bare(tree: ast.Module, classes: Classes) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Public functions, classes and methods without a docstring that need one of their own."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
            continue
        if not ast.get_docstring(node) and not _is_law(node):
            yield node
        for method in node.body if isinstance(node, ast.ClassDef) else ():
            if not isinstance(method, ast.FunctionDef) or method.name.startswith("_"):
                continue
            if not ast.get_docstring(method) and not _of_a_base(node, method.name, classes):
                yield method


def _is_law(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """Whether it is the law of a record for a generic, which is documented."""
    return any(ast.unparse(each).partition("(")[0] in LAWS for each in node.decorator_list)


def _of_a_base(node: ast.ClassDef, method: str, classes: Classes) -> bool:
    """Whether a class that it derives from has the method."""
    names = [ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in node.bases]
    bases = [base for name in names for base in classes.get(name, []) if base is not node]
    return any(
        any(isinstance(each, ast.FunctionDef) and each.name == method for each in base.body)
        or _of_a_base(base, method, classes)
        for base in bases
    )
