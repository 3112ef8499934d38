"""The datasets of a trajectory file and their creation.

    /VTKHDF                         VTKHDF 2.0, PolyData; https://docs.vtk.org, "VTKHDF file format"
      Points [rows, 3]              positions; PointData/NAME the other fields, row by row
      NumberOfPoints [frames]       particles of each frame
      Vertices/Connectivity, Offsets   0, 1, 2, ...: one vertex per particle, shared by all frames
      Lines, Polygons               springs and surfaces, the same for all frames, in rows; empty where rows change
      Strips                        empty
      Steps                         NSteps; Values (times); where each frame starts
    /psim
      format                        version of this layout (attribute)
      box [3, 3]                    origin, size, periodic or not of a periodic box (attribute); positions are in it
      frames [frames]               number, step, time, offset, count, births, deaths of each
      ledger [frames]               one named column per quantity
      events/births, deaths         id, time, cause
      groups                        names; the field `group` counts into them
      topology/NAME                 springs and triangles, by ids of particles (see `topology`)
      provenance/NAME               scenario as TOML text, versions, seed, host ...
      status, summary               how the run ended

A frame is finished when its row of /psim/frames carries its number (counted from 1); everything else about it
is on its way to the disk before that row is. SWMR forbids new objects once writing has begun, so all are made
here.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particlesim.trajectory.box import Box
from particlesim.trajectory.chunks import chunk_rows
from particlesim.trajectory.fields import FieldSpec, Precision, ledger_unit
from particlesim.trajectory.topology import Topology, write_topology

if TYPE_CHECKING:
    import h5py

FORMAT = 1
# "latest" writes structures that no released VTK reads; before v110 there is no SWMR.
LIBVER = ("v110", "v110")
TABLE_ROWS = 256
EVENT_ROWS = 1024
TOPOLOGY_ROWS = 1 << 16
CELLS = ("Lines", "Polygons", "Strips")

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


def read_box(psim: h5py.Group) -> Box | None:
    """The periodic box that positions are in. Raises ValueError for an attribute that makes none."""
    if "box" not in psim.attrs:
        return None
    stored = np.asarray(psim.attrs["box"], float).reshape(3, 3)
    if not (np.isfinite(stored).all() and stored[1].min() > 0):
        raise ValueError("a box without a size")
    (a, b, c), (width, height, depth), (x, y, z) = stored.tolist()
    return Box((a, b, c), (width, height, depth), (x != 0, y != 0, z != 0))


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
    topology: Sequence[Topology] = (),
    box: Box | None = None,
) -> None:
    """Write a complete trajectory file without frames; `particles` is the count expected in a large one.

    Of the topology, VTK sees the sets that are `drawn`: their ids must be rows of every frame. Raises OSError.
    """
    import h5py

    # Made in memory: HDF5 crashes the process later when the system refuses a write (h5py issue 914). And closed before its
    # bytes are taken: the image that HDF5 1.14 gives of an open file lacks its mark, but has the checksum of one with it.
    image = io.BytesIO()
    with h5py.File(image, "w", libver=LIBVER) as file:
        _create_points(file, fields, precision, compressed, chunk_rows(particles))
        _create_steps(file, fields)
        _create_cells(file, topology)
        _create_psim(file, groups, ledger, causes)
        write_topology(file["psim"], topology)
        if box is not None:
            file["psim"].attrs["box"] = np.array(box, float)
        for key, value in provenance.items():
            file["psim/provenance"][key] = value
    path.write_bytes(image.getbuffer())


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


def _create_cells(file: h5py.File, topology: Sequence[Topology]) -> None:
    """Lines and polygons, which every frame shares: the offsets of its cells are 0."""
    drawn = [each for each in topology if each.drawn]
    vtk = file["VTKHDF"]
    for name, cells in {
        "Lines": [each.pairs for each in drawn if not len(each.triangles)],
        "Polygons": [each.triangles for each in drawn],
        "Strips": [],
    }.items():
        number = sum(len(part) for part in cells)
        corners = np.concatenate([np.empty(0, np.int64), *(part.ravel() for part in cells)])
        group = vtk.create_group(name)
        _table(group, "NumberOfCells", fill=number)
        _table(group, "NumberOfConnectivityIds", fill=len(corners))
        size = 2 if name == "Lines" else 3
        filters = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if number else {}
        group.create_dataset("Offsets", data=size * np.arange(number + 1), **filters)
        group.create_dataset("Connectivity", data=corners, **filters)


def _create_psim(
    file: h5py.File, groups: Sequence[str], ledger: Sequence[str], causes: Sequence[str]
) -> None:
    import h5py

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
