"""The datasets of a trajectory file and their creation.

    /VTKHDF                         VTKHDF 2.0, PolyData; https://docs.vtk.org, "VTKHDF file format"
      Points [rows, 3]              positions; PointData/NAME the other fields, row by row
      NumberOfPoints [frames]       particles of each frame
      Vertices/Connectivity, Offsets   0, 1, 2, ...: one vertex per particle, shared by all frames
      Lines, Strips, Polygons       empty; three names of one group
      Steps                         NSteps; Values (times); where each frame starts
    /psim
      format                        version of this layout (attribute)
      frames [frames]               number, step, time, offset, count, births, deaths of each
      ledger [frames]               one named column per quantity
      events/births, deaths         id, time, cause
      groups                        names; the field `group` counts into them
      provenance/NAME               scenario as TOML text, versions, seed, host ...
      status, summary               how the run ended

A frame is finished when its row of /psim/frames carries its number (counted from 1); everything else about it
is on its way to the disk before that row is. SWMR forbids new objects once writing has begun, so all are made
here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particlesim.trajectory.chunks import chunk_rows
from particlesim.trajectory.fields import FieldSpec, Precision, ledger_unit

FORMAT = 1
# "latest" writes structures that no released VTK reads; before v110 there is no SWMR.
LIBVER = ("v110", "v110")
TABLE_ROWS = 256
EVENT_ROWS = 1024
TOPOLOGY_ROWS = 1 << 16

FRAME = np.dtype(
    {
        "names": ["number", "step", "time", "offset", "count", "births", "deaths"],
        "formats": ["<i8", "<i8", "<f8", "<i8", "<i8", "<i8", "<i8"],
    }
)
EVENT = np.dtype([("id", "<i8"), ("time", "<f8"), ("cause", "u1")])
STATUS = np.dtype("S16")
STATES = ("complete", "running", "interrupted", "diverged", "failed")


def column_path(field: str) -> str:
    """Where the rows of a field are in the file."""
    return "VTKHDF/Points" if field == "position" else f"VTKHDF/PointData/{field}"


def ledger_dtype(columns: Sequence[str]) -> np.dtype[Any]:
    """One float64 per ledger column."""
    return np.dtype([(name, "<f8") for name in columns])


def create_file(
    path: Path,
    *,
    fields: Sequence[FieldSpec],
    groups: Sequence[str],
    ledger: Sequence[str],
    causes: Sequence[str],
    provenance: Mapping[str, str | int | float],
    precision: Precision,
    compressed: bool,
    particles: int,
) -> None:
    """Write a complete trajectory file without frames; `particles` is the count expected in a large one."""
    with h5py.File(path, "w", libver=LIBVER) as file:
        _create_points(file, fields, precision, compressed, chunk_rows(particles))
        _create_steps(file, fields)
        _create_psim(file, groups, ledger, causes)
        for key, value in provenance.items():
            file["psim/provenance"][key] = value


def _create_points(
    file: h5py.File, fields: Sequence[FieldSpec], precision: Precision, compressed: bool, rows: int
) -> None:
    vtk = file.create_group("VTKHDF")
    vtk.attrs["Version"] = np.array([2, 0], np.int64)
    vtk.attrs.create("Type", np.bytes_("PolyData"))
    filters = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if compressed else {}
    for spec in fields:
        dataset = file.create_dataset(
            column_path(spec.name),
            shape=spec.shape(0),
            maxshape=(None, *spec.shape(0)[1:]),
            chunks=spec.shape(rows),
            dtype=spec.dtype(precision),
            **filters,
        )
        dataset.attrs["unit"] = spec.unit
        dataset.attrs["description"] = spec.doc


def _create_steps(file: h5py.File, fields: Sequence[FieldSpec]) -> None:
    """The bookkeeping of VTK. What it wants twice, or all zero, is one dataset with several names."""
    vtk = file["VTKHDF"]
    _table(vtk, "NumberOfPoints")
    steps = vtk.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(0)
    _table(steps, "Values", "<f8")
    for name in ("PointOffsets", "PartOffsets"):
        _table(steps, name)
    _table(steps, "NumberOfParts", fill=1)
    _table(steps, "CellOffsets", shape=(4,))
    steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
    for spec in fields:
        if spec.name != "position":
            steps[f"PointDataOffsets/{spec.name}"] = steps["PointOffsets"]

    vertices = vtk.create_group("Vertices")
    for name in ("NumberOfCells", "NumberOfConnectivityIds"):
        vertices[name] = vtk["NumberOfPoints"]
    for name in ("Connectivity", "Offsets"):
        _table(vertices, name, rows=TOPOLOGY_ROWS, compression="gzip", compression_opts=1, shuffle=True)

    empty = vtk.create_group("Lines")
    _table(empty, "NumberOfCells")
    empty["NumberOfConnectivityIds"] = empty["NumberOfCells"]
    empty.create_dataset("Offsets", data=np.zeros(1, np.int64))
    _table(empty, "Connectivity")
    vtk["Strips"] = vtk["Polygons"] = empty


def _create_psim(
    file: h5py.File, groups: Sequence[str], ledger: Sequence[str], causes: Sequence[str]
) -> None:
    psim = file.create_group("psim")
    psim.attrs["format"] = np.int64(FORMAT)
    _table(psim, "frames", FRAME)
    if ledger:
        table = _table(psim, "ledger", ledger_dtype(ledger))
        table.attrs["units"] = [ledger_unit(name) for name in ledger]
    for kind in ("births", "deaths"):
        table = _table(psim, f"events/{kind}", EVENT, rows=EVENT_ROWS)
        table.attrs["causes"] = json.dumps(list(causes))
    psim.create_dataset("groups", data=list(groups), shape=(len(groups),), dtype=h5py.string_dtype())
    psim.create_group("provenance")
    psim.create_dataset("status", data=np.array(b"running", STATUS))
    _table(psim, "summary", "u1", rows=4096)


def _table(
    group: h5py.Group,
    name: str,
    dtype: Any = "<i8",
    *,
    shape: tuple[int, ...] = (),
    rows: int = TABLE_ROWS,
    fill: int | None = None,
    **filters: Any,
) -> h5py.Dataset:
    """An empty dataset that grows by rows."""
    return group.create_dataset(
        name,
        shape=(0, *shape),
        maxshape=(None, *shape),
        chunks=(rows, *shape),
        dtype=dtype,
        fillvalue=fill,
        **filters,
    )
