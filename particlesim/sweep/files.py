"""The folder of a sweep: its manifest, a folder for every run, and the table."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from particlesim.errors import InputOutputError, PsimError, UsageError
from particlesim.sweep.outcome import Outcome

MANIFEST, TABLE, LOCK = "sweep.json", "results.csv", ".lock"
PARQUET = "results.parquet"
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
    """State in its folder, which is ours `alone`, what a sweep is, or find that it is stated there.

    With `force`, what another sweep left there is removed: files of its runs, and nothing else.
    Raises UsageError when the folder holds a sweep of another definition, InputOutputError when it cannot be written.
    """
    try:
        earlier = _manifest(folder)
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
        raise unwritable(folder, error) from None


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep other sweeps out of a folder; the lock ends with the process, however it ends.

    Where the file system has no locks, it does without. Raises UsageError when another sweep is at work there.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is not a folder", "Choose another one with --output.")
    foreign = (
        folder.exists()
        and not (folder / MANIFEST).exists()
        and any(child.name != LOCK for child in folder.iterdir())
    )
    if foreign:
        raise UsageError(f"{folder} is not empty, and holds no sweep", "Choose another one with --output.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK).open("a")
    except OSError as error:
        raise unwritable(folder, error) from None
    with file:
        if not _locked(file.fileno()):
            raise UsageError(
                f"another sweep is at work in {folder}",
                "Wait for its end, or choose another folder with --output.",
            )
        yield


def _locked(descriptor: int) -> bool:
    """Lock an open file. False if another process holds it; True also where there are no locks."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK, errno.EDEADLK)
    return True


def unwritable(folder: Path, error: OSError) -> PsimError:
    """The error for a folder that takes no files: no folder at all, or one where nothing may be written."""
    kind = (
        UsageError if error.errno in (errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG) else InputOutputError
    )
    return kind(f"{folder} cannot be written: {error.strerror or error}", "Choose another one.")


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
    for name in (TABLE, PARQUET, MANIFEST):
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
