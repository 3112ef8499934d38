"""Convert a trajectory into files that other tools read: CSV, NPZ."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.trajectory.fields import component_names, unknown_name
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory
from particlesim.trajectory.target import check_target, replacing

_BLOCK = 4096


def export(
    path_in: Path,
    path_out: Path,
    *,
    frames: slice | None = None,
    fields: Sequence[str] | None = None,
    overwrite: bool = False,
) -> int:
    """Write the trajectory `path_in` as `path_out`, in the format that its ending names (see `FORMATS`).

    frames: which ones, all by default. fields: which ones, all that were recorded by default; position and id
    always come along. Returns the number of rows: one per particle and frame. A partial file is never left
    behind. Raises UsageError for an unknown ending or field, an unusable input, and an output that exists
    (unless `overwrite`) or cannot be written; InputOutputError when writing fails.
    """
    path_in, path_out = Path(path_in), Path(path_out)
    write = FORMATS.get(path_out.suffix.lower())
    if write is None:
        raise UsageError(
            f"cannot export to {str(path_out)!r}: unknown ending {path_out.suffix!r}",
            f"Known endings: {', '.join(FORMATS)}.",
        )
    check_target(path_out, overwrite=overwrite)
    with Trajectory(path_in) as trajectory:
        chosen = _choose_fields(trajectory, fields)
        indices = range(len(trajectory))[frames or slice(None)]
        with replacing(path_out) as temporary:
            write(trajectory, indices, chosen, temporary)
        return int(trajectory.counts[indices].sum()) if indices else 0


def _choose_fields(trajectory: Trajectory, fields: Sequence[str] | None) -> tuple[str, ...]:
    if fields is None:
        return trajectory.fields
    for name in fields:
        if name not in trajectory.fields:
            raise unknown_name("field", name, trajectory.fields)
    return tuple(dict.fromkeys(("position", "id", *fields)))


def write_csv(trajectory: Trajectory, indices: Sequence[int], fields: Sequence[str], path: Path) -> None:
    """One row per particle and frame: time, id, then the components of every field, in SI units.

    Numbers have as many digits as it takes to read the same bits back: 9 for float32, else Python's `repr`.
    Groups are given by name.
    """
    others = [name for name in fields if name != "id"]
    names = ["time", "id", *chain.from_iterable(component_names(name) for name in others)]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + "\n")
        for index in indices:
            frame = trajectory[index]
            file.writelines(_csv_blocks(frame, others))


def _csv_blocks(frame: Frame, fields: Sequence[str]) -> Iterator[str]:
    """The rows of a frame as text; one format string serves thousands of them, to be fast."""
    columns: list[Sequence[Any]] = [frame.id.tolist()]
    formats = [repr(frame.time), "%d"]
    for name in fields:
        values = frame[name]
        if name == "group":
            quoted = [_quote(group) for group in frame.groups]
            columns.append([quoted[code] for code in values.tolist()])
            formats.append("%s")
            continue
        for column in np.atleast_2d(values.T):
            columns.append(column.tolist())
            formats.append({"f4": "%.9g", "f8": "%r"}.get(column.dtype.str[1:], "%d"))
    row = ",".join(formats) + "\n"
    for start in range(0, len(frame), _BLOCK):
        block = [column[start : start + _BLOCK] for column in columns]
        yield row * len(block[0]) % tuple(chain.from_iterable(zip(*block, strict=True)))


def _quote(text: str) -> str:
    """A CSV cell (RFC 4180): quoted when it holds a comma, a quote or a line break."""
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\r\n') else text


def write_npz(trajectory: Trajectory, indices: Sequence[int], fields: Sequence[str], path: Path) -> None:
    """Arrays for `numpy.load`: frame k has the rows offset[k] to offset[k] + count[k] of every field.

    Also time, step, groups, and the ledger as "ledger.NAME". One frame at a time is in memory.
    """
    at = np.array(indices, np.int64)
    counts = trajectory.counts[at]
    offsets = np.cumsum(counts) - counts
    arrays = {"time": trajectory.times[at], "step": trajectory.steps[at], "offset": offsets, "count": counts}
    arrays["groups"] = np.array(trajectory.groups, np.str_)
    arrays |= {f"ledger.{name}": values[at] for name, values in trajectory.ledger.items()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            _add_array(archive, name, array.shape, array.dtype, [array])
        for name in fields:
            shape, dtype = trajectory.shape_of(name, int(counts.sum()))
            _add_array(archive, name, shape, dtype, (trajectory[index][name] for index in indices))


def _add_array(
    archive: zipfile.ZipFile,
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    pieces: Iterable[npt.NDArray[Any]],
) -> None:
    """Add the concatenated `pieces` as one .npy file."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as raw:
        file: IO[bytes] = raw
        header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_2_0(file, header)
        for piece in pieces:
            file.write(np.ascontiguousarray(piece, dtype).tobytes())


FORMATS: dict[str, Callable[[Trajectory, Sequence[int], Sequence[str], Path], None]] = {
    ".csv": write_csv,
    ".npz": write_npz,
}
