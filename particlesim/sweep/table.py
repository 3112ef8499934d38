"""The table of a sweep: one row per run, one column per parameter and quantity."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from particlesim.checks.quantities import is_count
from particlesim.sweep.axes import Listed, Sampled
from particlesim.sweep.design import Design
from particlesim.sweep.files import plain
from particlesim.sweep.outcome import Outcome
from particlesim.trajectory.target import replacing


class Table:
    """Rows of results.csv; kept as text, so that a million of them fit in memory.

    Numbers are written with as many digits as it takes to read back the same bits; what there is not is empty.
    """

    def __init__(self, parameters: Iterable[str], quantities: Iterable[str], checks: Iterable[str]) -> None:
        self._parameters, self._quantities, self._checks = tuple(parameters), tuple(quantities), tuple(checks)
        self._rows: dict[int, str] = {}

    def add(self, outcome: Outcome) -> None:
        """The row of a run."""
        row = [
            outcome.run,
            *(_cell(outcome.parameters.get(key)) for key in self._parameters),
            *(_cell(outcome.quantities.get(name)) for name in self._quantities),
            *(_cell(outcome.checks.get(name)) for name in self._checks),
            outcome.status,
            outcome.cause,
            f"{outcome.seconds:.6f}",
        ]
        self._rows[outcome.run] = _line(row)

    def text(self) -> str:
        """The table as CSV, by run number."""
        checks = (f"check {name}" for name in self._checks)
        head = ["run", *self._parameters, *self._quantities, *checks, "status", "cause", "seconds"]
        return _line(head) + "".join(self._rows[number] for number in sorted(self._rows))


def _cell(value: Any) -> Any:
    value = plain(value)
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    return value if isinstance(value, int | str) and not isinstance(value, bool) else json.dumps(value)


def _line(row: list[Any]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerow(row)
    return out.getvalue()


def write_parquet(table: Path, target: Path, design: Design) -> Path | None:
    """Write a table of a design again as Parquet, with numbers as numbers; None where pyarrow is not installed.

    The types of columns do not depend on how runs end. Raises InputOutputError when it cannot be written.
    """
    try:
        import pyarrow as pa
        from pyarrow import csv as reader
        from pyarrow import parquet
    except ImportError:
        return None
    with table.open(newline="", encoding="utf-8") as lines:
        head = next(csv.reader(lines))
    kinds = {"int": pa.int64(), "float": pa.float64(), "bool": pa.bool_(), "text": pa.string()}
    varied = {axis.key: kind_of(axis) for axis in design.axes}
    types = {name: kinds[varied.get(name) or _kind_of_column(name)] for name in head}
    with replacing(target) as temporary:
        options = reader.ConvertOptions(
            column_types=types, strings_can_be_null=True, quoted_strings_can_be_null=False
        )
        parquet.write_table(reader.read_csv(table, convert_options=options), temporary)
    return target


def _kind_of_column(name: str) -> str:
    if name in ("status", "cause"):
        return "text"
    return "int" if name in ("run", "count") or is_count(name) else "float"


def kind_of(axis: Listed | Sampled) -> str:
    """What the values of an axis are: "int", "float", "bool" or "text" (also for mixtures and what JSON cannot say)."""
    values = axis.values if isinstance(axis, Listed) else (axis.low,)
    if all(isinstance(value, bool) for value in values):
        return "bool"
    if any(isinstance(value, bool) or not isinstance(value, int | float) for value in values):
        return "text"
    if all(isinstance(value, int) and abs(value) < 2**63 for value in values):
        return "int"
    return "float"
