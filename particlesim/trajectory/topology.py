"""The springs, rods and surfaces of a trajectory, written once, before the first frame.

Particles are named by their ids, which never change; rows of a frame do where particles die.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from particlesim.model.arrays import Floats, Ints

if TYPE_CHECKING:
    import h5py

_FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def _no_pairs() -> Ints:
    return np.empty((0, 2), np.int64)


def _no_triangles() -> Ints:
    return np.empty((0, 3), np.int64)


@dataclass(frozen=True)
class Topology:
    """Springs, the triangles of a surface, or both, of one name.

    pairs: ids of both ends of every spring, shape [springs, 2]. rest: rest lengths [m], shape [springs]. broke: when each
    spring broke [s], infinity while it holds, shape [springs]. triangles: ids of the corners, counter-clockwise seen from
    the side to which the surface's normal points, shape [triangles, 3]. breakable: whether springs can break at all.
    drawn: whether it is among the cells that other programs see. points: of springs and rods at rigid bodies, from the
    place of a body to each end [m], along the axes of its orientation; for the world, whose id is −1, the place itself;
    shape [springs, 2, 3], None for those between particles.
    """

    name: str
    pairs: Ints = field(default_factory=_no_pairs)
    rest: Floats = field(default_factory=lambda: np.empty(0))
    broke: Floats = field(default_factory=lambda: np.empty(0))
    triangles: Ints = field(default_factory=_no_triangles)
    breakable: bool = False
    drawn: bool = False
    points: Floats | None = None

    def holds(self, time: float) -> npt.NDArray[np.bool_]:
        """Which springs are whole at a time [s], shape [springs]."""
        return np.asarray(self.broke > time)


def write_topology(psim: h5py.Group, sets: Sequence[Topology]) -> None:
    """Store sets of springs and triangles in /psim/topology/NAME, before a file is opened for its frames."""
    group = psim.create_group("topology")
    for each in sets:
        entry = group.create_group(each.name)
        entry.attrs["drawn"] = each.drawn
        if len(each.pairs):
            entry.create_dataset("pairs", data=_narrow(each.pairs), chunks=True, **_FILTERS)
            rest = entry.create_dataset("rest", data=np.asarray(each.rest, "<f8"), chunks=True, **_FILTERS)
            rest.attrs["unit"] = "m"
        if each.points is not None:
            points = entry.create_dataset("points", data=np.asarray(each.points, "<f8"))
            points.attrs["unit"] = "m"
        if each.breakable:  # neither chunked nor compressed: it is changed in place
            broke = entry.create_dataset("broke", data=np.asarray(each.broke, "<f8"))
            broke.attrs["unit"] = "s"
        if len(each.triangles):
            entry.create_dataset("triangles", data=_narrow(each.triangles), chunks=True, **_FILTERS)


def _narrow(ids: Ints) -> npt.NDArray[Any]:
    """Ids in four bytes where they fit."""
    return ids.astype("<i4" if int(ids.max()) < 2**31 else "<i8")


def read_topology(file: h5py.File) -> Mapping[str, Topology]:
    """All sets of a file by name; none in files of versions that did not store them.

    Raises ValueError for numbers of springs that contradict each other, and what h5py raises on damaged metadata.
    """
    from particlesim.trajectory.hdf5 import entries

    found = {}
    for name, entry in entries(file.get("psim/topology", {})):
        pairs = entry["pairs"][:].astype(np.int64) if "pairs" in entry else _no_pairs()
        broke = np.full(len(pairs), np.inf)
        if "broke" in entry:
            broke = entry["broke"][:]
        rest = entry["rest"][:] if "rest" in entry else np.empty(0)
        points = entry["points"][:] if "points" in entry else None
        if points is not None and points.shape != (len(pairs), 2, 3):
            raise ValueError(f"{len(pairs)} springs, points of shape {points.shape}")
        if not len(pairs) == len(rest) == len(broke):
            raise ValueError(f"{len(pairs)} springs, {len(rest)} rest lengths, {len(broke)} times")
        found[name] = Topology(
            name,
            pairs,
            rest,
            broke,
            entry["triangles"][:].astype(np.int64) if "triangles" in entry else _no_triangles(),
            "broke" in entry,
            bool(entry.attrs["drawn"]),
            points,
        )
    return found
