"""`psim inspect`: what is inside a trajectory."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from psim.options import TrajectoryFile


def inspect(
    trajectory: TrajectoryFile,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")] = False,
    scenario: Annotated[
        bool, typer.Option("--scenario", help="Print the scenario as it was run; psim run accepts it.")
    ] = False,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair", help="First repair the file of a killed run, so that ParaView opens it, too."
        ),
    ] = False,
) -> None:
    """Show what is inside a trajectory: frames, fields, energies, where it comes from.

    Works on complete files, on those of running simulations, and on those of killed ones.
    """
    from particlesim.trajectory.describe import describe
    from particlesim.trajectory.recovery import recover
    from psim.console import plain, print_json, say

    if repair:
        repaired = recover(trajectory)
        say("repaired" if repaired else "nothing to repair")
    found = describe(trajectory)
    if scenario:
        text = found["provenance"].get("scenario", "")
        print(plain(text) if sys.stdout.isatty() else text, end="")
    elif as_json:
        print_json(found)
    else:
        _show(found)
        _advise(trajectory)


def _show(found: dict[str, Any]) -> None:
    from particlesim.preflight.resources import size
    from psim.console import facts, number, paint
    from psim.summary import check_text

    origin, particles = found["provenance"], found["particles"]
    title = origin.get("title") or Path(found["path"]).stem
    print(paint(str(title), "bold", sys.stdout))
    rows = [
        ("file", f"{found['path']}, {size(found['size'])}, {found['precision']} precision"),
        ("status", found["status"]),
        ("frames", f"{found['frames']:,}" + _span_of_time(found["time"])),
        ("steps", _ends(found["steps"])),
        ("particles", _ends(particles) + _range(particles, "min", "max", "")),
    ]
    if (events := found["events"])["births"] or events["deaths"]:
        rows.append(("events", f"{events['births']:,} births, {events['deaths']:,} deaths"))
    if checks := found["summary"].get("checks"):
        rows.append(("checks", "\n".join(check_text(check) for check in checks)))
    groups = (f"{name} ({count:,})" if count is not None else name for name, count in found["groups"].items())
    rows.append(("groups", ", ".join(groups)))
    facts(rows, sys.stdout)
    _table(
        "fields",
        "at the last frame",
        [(n, f["unit"], _span(f["min"], f["max"])) for n, f in found["fields"].items()],
    )
    ledger = [
        (n, entry["unit"], f"{number(entry['first'])} → {number(entry['last'])}")
        for n, entry in found["ledger"].items()
        if entry["first"] is not None and entry["last"] is not None
    ]
    _table("ledger", "from the first frame to the last", ledger)
    known = (
        "command",
        "started",
        "host",
        "git",
        "seed",
        "dt",
        "psim",
        "python",
        "numpy",
        "llvmlite",
        "numba",
        "extensions",
        "overrides",
    )
    print(paint("origin", "bold", sys.stdout))
    facts([(name, str(origin[name]).replace("\n", ", ")) for name in known if name in origin], sys.stdout)


def _advise(path: Path) -> None:
    """Tell of a mark that a killed writer left, which other programs stumble over."""
    import shlex

    from particlesim.trajectory.files import check_readable
    from particlesim.trajectory.lock import is_being_written
    from psim.console import plain, say

    if check_readable(path).marked and not is_being_written(path):
        say(
            f"the run was killed; to open the file in ParaView too: psim inspect --repair {shlex.quote(plain(path))}"
        )


def _table(name: str, what: str, rows: list[tuple[str, str, str]]) -> None:
    from psim.console import facts, paint

    if rows:
        print(paint(name, "bold", sys.stdout) + paint(f" {what}", "dim", sys.stdout))
        unit = max(len(row[1]) for row in rows)
        facts([(row[0], f"{row[1]:<{unit}}  {row[2]}") for row in rows], sys.stdout)


def _ends(values: dict[str, Any]) -> str:
    return "" if values["first"] is None else f"{values['first']:,} → {values['last']:,}"


def _span_of_time(time: dict[str, Any]) -> str:
    """', 0 to 2 s', or ', at 0 s'."""
    if time["first"] is not None and time["first"] == time["last"]:
        return f", at {time['first']:,.6g} s"
    return _range(time, "first", "last", " s")


def _range(values: dict[str, Any], low: str, high: str, unit: str) -> str:
    return "" if values[low] is None else f", {values[low]:,.6g} to {values[high]:,.6g}{unit}"


def _span(low: Any, high: Any) -> str:
    """'0.1 to 2.5', per component for vectors."""
    if low is None or (isinstance(low, list) and None in low):
        return ""
    if isinstance(low, list):
        return f"({', '.join(f'{v:.4g}' for v in low)}) to ({', '.join(f'{v:.4g}' for v in high)})"
    return f"{low:.6g} to {high:.6g}"
