"""docs/architecture.md leads to what there is: every folder has a line, and what is named stands where it says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "particlesim"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
FILE = re.compile(r"`(?:particlesim/)?((?:[a-z_]+/)+[a-z_]+\.py)`")


def test_every_folder_has_a_line() -> None:
    tables = {
        word
        for row in re.findall(r"^\| (`.*?) \|", PAGE, re.MULTILINE)
        for word in re.findall(r"`(\w+)/`", row)
    }
    tables |= set(re.findall(r"`(\w+)/` ", PAGE))
    folders = [path.parent for path in PACKAGE.rglob("__init__.py") if path.parent != PACKAGE]
    assert folders
    assert not [str(path) for path in folders if path.name not in tables]


def test_files_that_are_named_exist() -> None:
    named = set(FILE.findall(PAGE))
    assert len(named) > 50
    places = (PACKAGE, PACKAGE / "engine", ROOT)
    named.remove("forces/axis_pull.py")  # the one that the reader writes
    missing = [name for name in named if not any((place / name).is_file() for place in places)]
    assert missing == []


def test_names_stand_in_their_files() -> None:
    """`path.py`: `name`, in the table of what is where."""
    pairs = re.findall(r"`([a-z_/]+\.py)`: `(\w+)`", PAGE)
    assert len(pairs) > 10
    for file, name in pairs:
        tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
        defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        targets = [t for node in tree.body if isinstance(node, ast.Assign) for t in node.targets]
        targets += [node.target for node in tree.body if isinstance(node, ast.AnnAssign)]
        defined |= {target.id for target in targets if isinstance(target, ast.Name)}
        assert name in defined, f"{file} has no {name}"
