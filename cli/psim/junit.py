"""Results of a run as JUnit XML, which every CI reads."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from psim.talk import plain

if TYPE_CHECKING:
    from particlesim.checking import CheckResult
    from particlesim.errors import PsimError
    from particlesim.runner import Result


def check_report(path: Path) -> None:
    """Refuse a report that could not be written at the end, or in the place of anything but an earlier report; folders that
    are missing will be made. Raises UsageError."""
    from particlesim.errors import UsageError
    from particlesim.trajectory.target import check_target

    check_target(path, overwrite=True)
    if path.exists():
        with path.open("rb") as file:
            beginning = file.read(MARK_WITHIN)
        if beginning and MARK not in beginning:
            raise UsageError(
                f"{path} exists and is no report",
                "--junit replaces earlier reports only. Choose another name.",
            )


MARK, MARK_WITHIN = b"<testsuite", 1024
"""What a report has among its first bytes."""


@dataclass
class Report:
    """What a report will tell, and where: the result of a run, once there is one."""

    path: Path | None
    result: Result | None = None

    def keep_apart(self, *others: Path | None) -> None:
        """Raise UsageError, and write no report, if it has the name of another file that the run writes."""
        from particlesim.errors import UsageError

        for other in others:
            if self.path is not None and other is not None and self.path.resolve() == other.resolve():
                self.path = None
                raise UsageError(
                    f"--junit and the output of the run are both {other}", "Give one of them another name."
                )


@contextmanager
def reported(path: Path | None, suite: str) -> Iterator[Report]:
    """Write the report `path`, if any, of what the block does, whether it ends well or not.

    Raises UsageError or InputOutputError before the block for a report that could not be written after it.
    """
    from particlesim.errors import PsimError

    report = Report(path)
    if path is not None:
        check_report(path)
    began = time.perf_counter()
    try:
        yield report
    except PsimError as error:
        if report.path is not None:
            write_report(report.path, suite, time.perf_counter() - began, (), error)
        raise
    if report.path is not None and report.result is not None:
        write_report(report.path, suite, report.result.seconds, report.result.checks)


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
