"""Results of a run or a sweep as JUnit XML, which every CI reads."""

from __future__ import annotations

import csv
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from psim.console import plain

if TYPE_CHECKING:
    from particlesim.runs.runner import Result
    from particlesim.sweep import SweepResult


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
                f"{path} exists and is not a report",
                "--junit replaces earlier reports only. Choose another name.",
            )


MARK, MARK_WITHIN = b"<testsuite", 1024
"""What a report has among its first bytes."""


@dataclass(frozen=True)
class Case:
    """A test case: how long it took [s], and what was wrong, if anything: a "failure" or an "error" of a type, or that it
    was "skipped"."""

    name: str
    seconds: float = 0.0
    outcome: Literal["passed", "failure", "error", "skipped"] = "passed"
    type: str = ""
    message: str = ""
    details: str = ""


@dataclass
class Report:
    """What a report will tell, and where: of the work itself, `what` ("run" or "sweep"), and of its parts."""

    path: Path | None
    what: str
    seconds: float = 0.0
    parts: Sequence[Case] | None = None
    """None until the work has ended."""
    error: BaseException | None = None
    """What ended the work early."""

    def of_run(self, result: Result) -> None:
        """Tell how a run ended, and each of its checks."""
        self.seconds = result.seconds
        self.parts = [
            Case(check.name)
            if check.passed
            else Case(check.name, 0.0, "failure", "check", check.message, check.message)
            for check in result.checks
        ]

    def of_sweep(self, result: SweepResult, varied: int) -> None:
        """Tell how a sweep of so many varied values ended, and each of its runs."""
        from particlesim.errors import Interrupted

        self.seconds = result.seconds
        self.parts = _runs(result, varied)
        if result.interrupted:
            self.error = Interrupted("stopped", "The same command continues from there.")

    def keep_apart(self, *others: Path | None) -> None:
        """Raise UsageError, and write no report, if it has the name of another file that the command writes."""
        from particlesim.errors import UsageError

        for other in others:
            if self.path is not None and other is not None and self.path.resolve() == other.resolve():
                self.path = None
                raise UsageError(
                    f"--junit and another output are both {other}", "Give one of them another name."
                )

    def keep_out_of(self, folder: Path) -> None:
        """Raise UsageError, and write no report, if it is in the folder of a sweep: left there by a sweep that could not
        begin, it would be in the way of the next."""
        from particlesim.errors import UsageError

        if self.path is not None and self.path.resolve().is_relative_to(folder.resolve()):
            self.path = None
            raise UsageError(
                f"--junit is in {folder}, the folder of the sweep", "Choose a place outside of it."
            )


@contextmanager
def reported(path: Path | None, suite: str, what: str = "run") -> Iterator[Report]:
    """Write the report `path`, if any, of what the block does, whether it ends well or not.

    Raises UsageError or InputOutputError before the block for a report that could not be written after it.
    """
    report = Report(path, what)
    if path is not None:
        check_report(path)
    began = time.perf_counter()
    try:
        yield report
    except (Exception, KeyboardInterrupt) as error:
        if report.path is not None:
            work = _work(what, time.perf_counter() - began, error)
            write_report(report.path, suite, work.seconds, [work])
        raise
    if report.path is not None and report.parts is not None:
        work = _work(what, report.seconds, report.error)
        write_report(report.path, suite, report.seconds, [work, *report.parts])


def _work(what: str, seconds: float, error: BaseException | None) -> Case:
    """The run or the sweep itself."""
    if error is None:
        return Case(what, seconds)
    kind = type(error).__name__
    return Case(what, seconds, "error", kind, getattr(error, "message", str(error) or kind), str(error))


def _runs(result: SweepResult, varied: int) -> list[Case]:
    """All runs of a sweep, by the rows of its table; those that have no row were not done."""
    cases = [
        Case(f"run {number}", 0.0, "skipped", message="not done") for number in range(1, result.total + 1)
    ]
    csv.field_size_limit(2**31 - 1)
    with result.table.open(newline="", encoding="utf-8") as lines:
        rows = csv.reader(lines)
        keys = next(rows)[1 : 1 + varied]
        for row in rows:
            number, values, (status, cause, seconds) = int(row[0]), row[1 : 1 + varied], row[-3:]
            settings = ", ".join(f"{key}={value}" for key, value in zip(keys, values, strict=True))
            kind = _KINDS[status]
            of = "" if kind == "passed" else status
            cases[number - 1] = Case(f"run {number}: {settings}", float(seconds), kind, of, cause, cause)
    return cases


_KINDS: dict[str, Literal["passed", "failure", "error"]] = {
    "done": "passed",
    "check_failed": "failure",
    "bad_scenario": "error",
    "diverged": "error",
    "failed": "error",
}


def write_report(path: Path, suite: str, seconds: float, cases: Sequence[Case]) -> None:
    """Write a suite with its test cases; replaces an earlier report.

    Missing folders are made. Raises InputOutputError when the file cannot be written.
    """
    from xml.etree import ElementTree  # only here: it takes as long as many a run

    from particlesim.trajectory.target import replacing

    suite = plain(suite)  # XML has no control characters
    number = Counter(case.outcome for case in cases)
    root = ElementTree.Element(
        "testsuite",
        name=suite,
        tests=str(len(cases)),
        failures=str(number["failure"]),
        errors=str(number["error"]),
        skipped=str(number["skipped"]),
        time=f"{seconds:.3f}",
    )
    for case in cases:
        spent = f"{case.seconds:.3f}" if case.seconds else "0"
        node = ElementTree.SubElement(root, "testcase", classname=suite, name=plain(case.name), time=spent)
        if case.outcome != "passed":
            told = {"message": plain(case.message)} | ({"type": case.type} if case.type else {})
            ElementTree.SubElement(node, case.outcome, told).text = plain(case.details)
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    with replacing(path) as temporary:
        tree.write(temporary, encoding="utf-8", xml_declaration=True)
