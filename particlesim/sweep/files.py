"""The folder of a sweep: its manifest, a folder for every run, and the table."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

from particlesim.errors import UsageError
from particlesim.sweep.outcome import Outcome

MANIFEST, TABLE = "sweep.json", "results.csv"
SCENARIO, RESULT, TRAJECTORY = "scenario.toml", "result.json", "trajectory.vtkhdf"


def run_folder(folder: Path, number: int, total: int) -> Path:
    """The folder of a run: 0001, 0002 ..., with as many digits as the last one needs."""
    return folder / f"{number:0{max(4, len(str(total)))}}"


def write_atomically(path: Path, text: str) -> None:
    """Write a file such that it is there as a whole or not at all. Raises OSError."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_json(path: Path, data: Any) -> None:
    """Write data of a sweep as JSON, atomically. Raises OSError."""
    write_atomically(path, json.dumps(plain(data), ensure_ascii=False, allow_nan=False) + "\n")


def plain(data: Any) -> Any:
    """Values of TOML as JSON has them: dates and numbers that are not finite become text."""
    if isinstance(data, dict):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    if data is None or isinstance(data, str | int) or (isinstance(data, float) and math.isfinite(data)):
        return data
    return str(data)


def prepare(folder: Path, definition: dict[str, Any], total: int, *, force: bool) -> None:
    """Make the folder of a sweep, or find that it is there.

    With `force`, what another sweep left there is removed: files of its runs, and nothing else.
    Raises UsageError when the folder holds a sweep of another definition or something else, or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is not a folder", "Choose another one with --output.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        earlier = _manifest(folder)
        if earlier is None and any(folder.iterdir()):
            raise UsageError(
                f"{folder} is not empty, and holds no sweep", "Choose another one with --output."
            )
        wanted = plain(definition)
        if earlier is not None and (earlier != wanted or force):
            if not force:
                changed = [k for k in wanted.keys() | earlier.keys() if wanted.get(k) != earlier.get(k)]
                raise UsageError(
                    f"{folder} holds another sweep: {', '.join(sorted(changed))} changed",
                    "Choose another folder with --output, or --force to remove its runs.",
                )
            _clear(folder, earlier.get("runs", total))
        write_json(folder / MANIFEST, definition)
    except OSError as error:
        raise UsageError(
            f"{folder} cannot be written: {error.strerror or error}", "Choose another one."
        ) from None


def _manifest(folder: Path) -> dict[str, Any] | None:
    path = folder / MANIFEST
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValueError:
        data = None
    if not isinstance(data, dict):
        raise UsageError(f"{path} is damaged", "Remove the folder, or choose another one.")
    return data


def _clear(folder: Path, total: int) -> None:
    for child in folder.iterdir():
        if child.is_dir() and child.name.isdigit() and 1 <= int(child.name) <= total:
            for name in (SCENARIO, RESULT, TRAJECTORY):
                (child / name).unlink(missing_ok=True)
            if not any(child.iterdir()):
                child.rmdir()
    for name in (TABLE, MANIFEST):
        (folder / name).unlink(missing_ok=True)


def finished(folder: Path, number: int, total: int) -> Outcome | None:
    """The result of a run that was done earlier; None if it was not, was cut off, or failed for want of a resource."""
    path = run_folder(folder, number, total) / RESULT
    try:
        outcome = Outcome.from_data(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return None
    if outcome is None or outcome.run != number or outcome.status == "failed":
        return None
    return outcome
