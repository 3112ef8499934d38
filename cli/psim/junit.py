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
    """Refuse a report that could not be written at the end; folders that are missing will be made. Raises UsageError."""
    from particlesim.trajectory.target import check_target

    check_target(path, overwrite=True)


def write_report(
    path: Path, suite: str, seconds: float, checks: Sequence[CheckResult], error: PsimError | None = None
) -> None:
    """Write a suite with the run itself and each of its checks as test cases; replaces an earlier report.

    `error` is what ended the run early. Missing folders are made. Raises InputOutputError when the file cannot be written.
    """
    from particlesim.trajectory.target import replacing

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
    with replacing(path) as temporary:
        tree.write(temporary, encoding="utf-8", xml_declaration=True)
