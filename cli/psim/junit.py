"""Results of a run as JUnit XML, which every CI reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from psim.talk import plain

if TYPE_CHECKING:
    from particlesim.checking import CheckResult
    from particlesim.errors import PsimError


def check_report(path: Path) -> None:
    """Refuse a report that could not be written at the end. Raises UsageError."""
    from particlesim.errors import UsageError

    if path.is_dir():
        raise UsageError(f"{path} is a directory", "Name a file: --junit report.xml")
    if not path.parent.is_dir():
        raise UsageError(f"the folder {path.parent} does not exist", f"mkdir -p {path.parent}")


def write_report(
    path: Path, suite: str, seconds: float, checks: Sequence[CheckResult], error: PsimError | None = None
) -> None:
    """Write a suite with the run itself and each of its checks as test cases; replaces an earlier report.

    `error` is what ended the run early. Raises OSError when the file cannot be written.
    """
    suite = plain(suite)  # XML has no control characters
    failures = sum(not check.passed for check in checks)
    root = ElementTree.Element(
        "testsuite",
        name=suite,
        tests=str(1 + len(checks)),
        failures=str(failures),
        errors=str(int(error is not None)),
        skipped="0",
        time=f"{seconds:.3f}",
    )
    case = ElementTree.SubElement(root, "testcase", classname=suite, name="run", time=f"{seconds:.3f}")
    if error is not None:
        node = ElementTree.SubElement(case, "error", type=type(error).__name__, message=plain(error.message))
        node.text = plain(error)
    for check in checks:
        case = ElementTree.SubElement(root, "testcase", classname=suite, name=check.name, time="0")
        if not check.passed:
            node = ElementTree.SubElement(case, "failure", type="check", message=check.message)
            node.text = check.message
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    tree.write(path, encoding="utf-8", xml_declaration=True)
