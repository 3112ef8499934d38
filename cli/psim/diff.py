"""`psim diff`: whether two trajectories are the same, and where they first differ."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psim.annotations import annotate
from psim.complete import trajectory_files
from psim.console import counted, facts, paint, print_json
from psim.options import Tolerance

if TYPE_CHECKING:
    from particlesim.analysis.difference import Change, Comparison, Difference

CHANGES_SHOWN = 12


def diff(
    a: Annotated[Path, typer.Argument(help="A trajectory.", autocompletion=trajectory_files)],
    b: Annotated[Path, typer.Argument(help="Another one.", autocompletion=trajectory_files)],
    tolerance: Tolerance = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")] = False,
) -> None:
    """Compare two trajectories.

    Says that they are identical, or the first frame, particle and field that differ, by how much, and what differs in
    their scenarios. Exit code 1 when they differ.
    """
    import particlesim as ps
    from particlesim.analysis.difference import compare

    with ps.open(a) as left, ps.open(b) as right:
        compared = compare(left, right, tolerance=tolerance)
    tell(compared, str(a), str(b), as_json=as_json)


def tell(compared: Comparison, a: str, b: str, *, as_json: bool) -> None:
    """What a comparison gave, on stdout. Raises typer.Exit(1) when there is a difference."""
    if as_json:
        print_json({"a": a, "b": b, **_as_data(compared)})
    else:
        _show(compared, a, b)
    if compared.first is not None:
        first = compared.first
        place = f" at {_place(first)}" if first.time is not None else ""
        annotate("error", f"{a} and {b} differ: {first.what}{place}")
        raise typer.Exit(1)


def _as_data(compared: Comparison) -> dict[str, Any]:
    return {"same": compared.same, **asdict(compared), "exit_code": 0 if compared.same else 1}


def _show(compared: Comparison, a: str, b: str) -> None:
    out = sys.stdout
    what = f"{counted(compared.frames, 'frame')} of {', '.join(compared.fields)}"
    if compared.same:
        word = "identical" if not compared.tolerance else f"the same within {compared.tolerance:g}"
        print(f"{paint(word, 'bold', out)}: {a} and {b}")
    else:
        print(f"{paint('different', 'red', out)}: {a} and {b}")
    rows = [("compared", what)]
    if compared.first is not None:
        rows += _rows(compared.first)
    if compared.largest is not None and compared.largest != compared.first:
        found = compared.largest
        values = f"{found.a!r} and {found.b!r}"
        rows.append(
            ("largest", f"{_amount(found)}, {found.what} of {_particle(found)}, {_place(found)}: {values}")
        )
    if compared.changes:
        rows.append(("scenario", "\n".join(_change(change) for change in compared.changes[:CHANGES_SHOWN])))
        if more := len(compared.changes) - CHANGES_SHOWN:
            rows += [("", f"and {more} more keys")] if more > 0 else []
    rows += [("note", note) for note in compared.notes]
    facts(rows, out)


def _rows(found: Difference) -> list[tuple[str, str]]:
    """The first difference, line by line."""
    rows = [("first at", _place(found))] if found.time is not None else []
    if found.what == "particle":
        rows.append(("particle", f"{_particle(found)} is only in one of them"))
        rows.append(
            ("particles", f"{found.a:,} and {found.b:,}, of which {found.particles:,} are not in both")
        )
        return rows
    if found.particle is not None:
        rows.append(("particle", _particle(found)))
    rows.append(("field" if found.particle is not None else "quantity", found.what))
    rows.append(("values", f"{found.a!r} and {found.b!r}"))
    rows.append(("apart", _amount(found)))
    if found.particles is not None and found.particles > 1:
        rows.append(("", f"{found.particles:,} particles differ in this frame"))
    return rows


def _place(found: Difference) -> str:
    at = f"t = {found.time:.9g} s" if found.time is not None else ""
    return f"frame {found.frame}, step {found.step:,}, {at}" if found.frame is not None else at


def _particle(found: Difference) -> str:
    return f"{found.particle}" + (f" of {found.group!r}" if found.group is not None else "")


def _amount(found: Difference) -> str:
    """'3 ULP, 2.1e-16 relative, 1e-17 of the largest value'."""
    parts = []
    if found.ulp is not None:
        parts.append(f"{found.ulp:,} ULP" if found.ulp < 10**6 else f"{found.ulp:.2g} ULP")
    parts += [f"{found.relative:.3g} relative"] if found.relative is not None else []
    parts += [f"{found.scaled:.3g} of the largest value in the frame"] if found.scaled is not None else []
    return ", ".join(parts)


def _change(change: Change) -> str:
    a, b = ("missing" if value is None else value for value in (change.a, change.b))
    return f"{change.key}: {a} and {b}"
