"""The table of columns: the quantities that a group has for every particle.

State, blocks, copies from which steps are repeated, snapshots, checkpoints, births, deaths, growth and joining follow from
it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.model.arrays import zeros
from particlesim.model.attributes import FURTHER


class Column(NamedTuple):
    """A column of a group: an array [n], or [rows, n] of several rows.

    `name` in GroupState; `unit` "" if it has none; `kernel` the fields of `columns.Columns` that show it to kernels; `rows`
    is METHOD where the method decides; `dtype` is None for the precision of the run; `changes` if a step may change it.
    `part` is what a group must have for the column to have a length at all, None for what all groups have.
    """

    name: str
    unit: str
    kernel: tuple[str, ...] = ()
    rows: int = 1
    dtype: Any = None
    changes: bool = False
    part: str | None = None

    def empty(self, capacity: int, precision: Any, parts: frozenset[str], memory: int) -> NDArray[Any]:
        """The column of a group that has some parts; zeros, which take no memory before they are written."""
        size = capacity if self.part is None or self.part in parts else 0
        rows = memory if self.rows == METHOD else self.rows
        shape = (size,) if self.rows == 1 else (rows, size)
        return zeros(shape, precision if self.dtype is None else self.dtype)


METHOD = -1
"""As many rows as the method remembers numbers."""

ROTATION = "rotation"
"""Part of groups of rigid bodies."""

SPIN = "spin"
"""Part of groups of grains, spheres that rub each other and turn."""

CLOCK = "clock"
"""Part of groups whose particles may be born, die, stick or be pinned."""

CLINGS = "clings"
"""Part of groups whose particles may stick to colliders that move."""

WATCHED = "watched"
"""Part of groups that may pass a collider unseen."""

TRACED = "traced"
"""Part of groups whose particles are followed from impact to impact within a step."""

HEARD = "heard"
"""Part of groups to whose impacts an emitter reacts."""

HIT = ("time", "collider", "speed", *("x", "y", "z"), *("nx", "ny", "nz"), *("vx", "vy", "vz"), "other")
"""The columns of an impact: time [s], the number of the collider or the code of a group (`reach.codes_of_groups`), the
speed along its normal relative to it [m/s], the place of the particle [m], the normal, the velocity before it [m/s], and the
id of the particle or body of that group, −1 for a collider."""

TABLE: tuple[Column, ...] = (
    Column("x", "m", ("x", "y", "z"), rows=3, changes=True),
    Column("v", "m/s", ("vx", "vy", "vz"), rows=3, changes=True),
    Column("mass", "kg", ("m",)),
    Column("radius", "m", ("r",)),
    Column("id", "", dtype=np.int64),
    Column("memory", "", ("memory",), rows=METHOD, changes=True),
    Column("birth", "s", ("thermal",), dtype=np.float64, part=CLOCK),
    Column("start", "s", ("clock",), dtype=np.float64, changes=True, part=CLOCK),
    Column("stop", "s", ("clock",), dtype=np.float64, changes=True, part=CLOCK),
    Column("outcome", "", ("clock",), dtype=np.int8, changes=True, part=CLOCK),
    Column("cause", "", dtype=np.uint8, part=CLOCK),
    Column("stuck_at", "s", ("clock",), dtype=np.float64, changes=True, part=CLINGS),
    Column("held", "m", rows=4, dtype=np.float64, part=CLINGS),
    Column("missed", "", ("missed",), dtype=np.int64, changes=True, part=WATCHED),
    Column("exhausted", "", ("exhausted",), dtype=np.int32, changes=True, part=TRACED),
    Column("hit", "", ("hit",), rows=len(HIT), dtype=np.float64, changes=True, part=HEARD),
    Column("turn", "", rows=4, dtype=np.float64, changes=True, part=ROTATION),
    Column("spin", "kg m²/s", rows=3, dtype=np.float64, changes=True, part=ROTATION),
    Column("angular_velocity", "rad/s", ("spin",), rows=3, changes=True, part=SPIN),
    Column("turned", "rad", ("spin",), rows=3, changes=True, part=SPIN),
    Column("heat", "K", ("thermal",), dtype=np.float64, part="temperature"),
    *(Column(each.name, each.unit, ("further",), part=each.name) for each in FURTHER),
)
"""All columns. Of every one the particles that are there are part of the saved state."""

CHANGING = tuple(dict.fromkeys(field for column in TABLE if column.changes for field in column.kernel))
"""Fields of `columns.Columns` that a step may change."""


def column_of(attribute: str) -> str:
    """The column of an attribute at the start: `heat` for the temperature, which may change by a law of its own."""
    return "heat" if attribute == "temperature" else attribute
