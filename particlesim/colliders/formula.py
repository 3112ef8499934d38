"""Formulas: solids where a written function of the place is negative, inside of a box."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, StringConstraints, model_validator

from particlesim.colliders.box import Size
from particlesim.colliders.cusps import cusp
from particlesim.colliders.feet import FormulaRecord
from particlesim.colliders.folds import MOST_KINKS, FoldedRecord, KinkRecord
from particlesim.colliders.level_set import BAND, CreasedRecord, LevelRecord, early, is_cut, where_early
from particlesim.colliders.levels import LevelsRecord, levels_of
from particlesim.colliders.pose import UNTURNED, Orientation, Rows, placed
from particlesim.colliders.solid import GRAIN, Solid, SolidCollider
from particlesim.colliders.steps import jump
from particlesim.colliders.surface_net import surface_net
from particlesim.colliders.triangulation import Triangles
from particlesim.expressions.arrays import value_at
from particlesim.expressions.constants import check_constant
from particlesim.expressions.kinks import Kink, folded
from particlesim.expressions.operations import VARIABLES, Node
from particlesim.expressions.parser import ExpressionError, parse
from particlesim.model.arrays import Floats
from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import norm

PLACE = {name: VARIABLES[name] for name in "xyz"}

CELLS = 48
"""Cells of the grid on which a formula is looked at, along the longest side of its box."""

STEEPER = 1.25
"""Its slope may be this many times the largest one seen on that grid."""

FLAT = 1e-4
"""Slope of a formula on its surface, in parts of its steepest slope, below which it is taken for none."""


class Formula(Solid):
    """A solid where a formula of x, y and z is negative, inside of a box; a formula close to the distance works best."""

    kind: ClassVar[str] = "formula"
    convex: ClassVar[bool] = False

    type: Literal["formula"] = "formula"
    distance: Annotated[str, StringConstraints(max_length=2000)]
    """The signed distance from the surface in metres, negative inside, as an expression of x, y and z [m] in the frame of
    the box, and of the constants. Any function will do that has this sign and is 0 on the surface."""
    constants: dict[Name, Number] = Field(default_factory=dict)
    """Numbers by name, for use in the expression."""
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the box, where x, y and z are 0."""
    size: Size
    """Edges of the box; the solid ends there."""
    orientation: Orientation | None = None
    """How it is turned about its centre."""

    _steep: float = PrivateAttr(default=1.0)
    _levels: LevelsRecord | None = PrivateAttr(default=None)
    _field: Any = PrivateAttr(default=None)
    _cut: bool = PrivateAttr(default=False)

    @model_validator(mode="after")
    def _encloses(self) -> Formula:
        for name in self.constants:
            check_constant(name, PLACE)
        try:
            self.node()
        except ExpressionError as error:
            hint = error.hint
            if any(
                error.message.startswith(f"unknown name {name!r}") for name in set(VARIABLES) - set(PLACE)
            ):
                hint = "a shape depends on the place alone; [[motions]] let it move"
            raise invalid(
                error.message, at=("distance",), hint=hint, within=(error.offset, error.length)
            ) from None
        values = self._values()
        if not np.isfinite(values).all():
            where = np.argwhere(~np.isfinite(values))[0]
            x, y, z = (axis[k] for axis, k in zip(self._axes(), where, strict=True))
            raise invalid(
                f"it has no value at ({x:g}, {y:g}, {z:g})",
                at=("distance",),
                also=[(("size",), "in the box of this size")],
                hint="it must have a value everywhere in its box",
            )
        if not (values < 0).any():
            raise invalid(
                f"on a grid of {CELLS} cells it is negative nowhere in its box, so that nothing is solid",
                at=("distance",),
                also=[(("size",), "the box")],
                hint="a smaller box, or a larger shape",
            )
        if not (values > 0).any():
            raise invalid(
                "it is negative in all of its box",
                at=("distance",),
                also=[(("size",), "the box")],
                hint='this is a collider of type "box"',
            )
        self._require_no_jump(values)
        with np.errstate(all="ignore"):
            steep = STEEPER * _slopes(values, self._axes())
        if not np.isfinite(steep).all():
            raise invalid(
                "no number holds the square of its slope",
                at=("distance",),
                also=[(("size",), "in the box of this size")],
                allowed="slopes up to 1e150: the distance itself has one of 1",
            )
        low, high = _range(values)
        self._steep, self._levels = float(steep.max()), levels_of(low, high, steep)
        self._cut = is_cut(values)
        self._require_slope()
        return self

    def _require_no_jump(self, values: Floats) -> None:
        """Refuse a formula that changes its sign without being 0: there is no surface, and balls would be put on it."""
        found = jump(self.node(), self._axes(), values)
        if found is not None:
            x, y, z = np.round(found.place, 4) + 0.0
            raise invalid(
                "it jumps from {:.4g} to {:.4g}".format(*found.values)
                + f" at ({x:g}, {y:g}, {z:g}), so that its surface is open there",
                at=("distance",),
                hint="join parts by min and max, which make upright walls, too: a step at x = 0 is min(y, max(y - 0.4, x))",
            )

    def _require_slope(self) -> None:
        """Refuse a formula that touches zero without going through it, as a square does: it leads nowhere."""
        corners = surface_net(self._values(), self._axes(), self._at).corners
        h = 1e-6 * max(self.size)
        with np.errstate(all="ignore"):  # in a box of no size there is no slope either
            rise = [
                (self._at(corners + h * axis) - self._at(corners - h * axis)) / (2 * h) for axis in np.eye(3)
            ]
        half = 0.5 * np.asarray(self.size)
        inner = (np.abs(corners) < half - 2 * h).all(axis=1)
        slope = np.linalg.norm(rise, axis=0)
        if inner.any() and not np.median(slope[inner]) > FLAT * self._steep:
            raise invalid(
                "it has no slope on its surface, so that it does not tell how far away that is",
                at=("distance",),
                hint="write the distance itself rather than a power of it",
            )

    def endless_slope(self) -> str | None:
        """Words on a place of the surface where the slope has no bound; None if there seems to be none."""
        found = cusp(self.node(), self._axes(), self._values())
        if found is None:
            return None
        x, y, z = np.round(found, 4) + 0.0
        return (
            f"its formula is infinitely steep at ({x:g}, {y:g}, {z:g}), where particles may be put beside the surface "
            "and gain energy; a little under the root bounds its slope: sqrt(abs(x) + 1e-4)"
        )

    def node(self) -> Node:
        """The expression as a tree of records."""
        return parse(self.distance, self.constants, PLACE)

    def _axes(self) -> list[Floats]:
        """Coordinates of the grid on which it is looked at, along each axis [m]."""
        cell = max(self.size) / CELLS
        return [
            np.linspace(-0.5 * side, 0.5 * side, max(int(np.ceil(side / cell)), 4) + 1) for side in self.size
        ]

    def _values(self) -> Floats:
        """The formula on that grid."""
        return value_at(self.node(), *np.meshgrid(*self._axes(), indexing="ij"))

    def _at(self, places: Floats) -> Floats:
        """The formula at places [n, 3] in its frame."""
        return value_at(self.node(), *places.T)

    def rotation(self) -> Rows:
        """From its own axes to those of the world."""
        return UNTURNED if self.orientation is None else self.orientation.rotation()

    def level(self, side: float) -> Any:
        """The solid, or its inside (−1), as kernels take it."""
        a, b, c = (0.5 * each for each in self.size)
        low, high, band = (-a, -b, -c), (a, b, c), BAND * max(self.size)
        assert self._levels is not None, "it has not been looked at"
        known = (low, high, self._steep, self._levels, self._cut, band, self.grain(), side)
        if self._field is None:
            node = self.node()
            pieces, kinks = folded(node)
            few = 0 < len(kinks) <= MOST_KINKS
            self._field = (
                FoldedRecord(node, pieces, tuple(map(self._kink, kinks))) if few else FormulaRecord(node)
            )
        record = CreasedRecord if isinstance(self._field, FoldedRecord) else LevelRecord
        return placed(record(self._field, *known), self.center, self.rotation())

    def _kink(self, kink: Kink) -> KinkRecord:
        """A kink with a bound of its slope."""
        axes = self._axes()
        steep = _slopes(value_at(kink.written, *np.meshgrid(*axes, indexing="ij")), axes).max()
        # where it has no value at some places, none is too far from it
        return KinkRecord(kink.pieces, STEEPER * float(steep) if np.isfinite(steep) else np.finfo(float).max)

    def geometry(self) -> Any:
        return self.level(1.0)

    def grain(self) -> float:
        return GRAIN * max(self.size) / CELLS

    def farthest(self) -> float:
        return max(map(abs, self.center)) + norm(self.size) / 2

    def early(self, radius: float) -> float:
        """How much too early balls of a radius may touch it [m]."""
        return early(self._values(), self._axes(), radius)

    def early_where(self, radius: float) -> str:
        """Where that is, and what avoids it."""
        return where_early(radius)

    def words(self) -> str:
        x, y, z = self.center
        return f"{self.distance} < 0 at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        return surface_net(self._values(), self._axes(), self._at).placed(self.center, self.rotation())


def _slopes(values: Floats, axes: list[Floats]) -> Floats:
    """The largest slope of numbers over a grid in each of its cells."""
    square: Floats = np.zeros(1)
    for k in range(3):
        rise = np.abs(np.diff(values, axis=k)) / (axes[k][1] - axes[k][0])
        square = square + _at_corners(np.maximum, rise, [other for other in range(3) if other != k]) ** 2
    return np.sqrt(square)


def _range(values: Floats) -> tuple[Floats, Floats]:
    """Bounds of numbers over a grid in each of its cells, half as far again beyond those at its corners on both sides."""
    low, high = (_at_corners(each, values, [0, 1, 2]) for each in (np.minimum, np.maximum))
    beyond = 0.5 * (high - low)
    return low - beyond, high + beyond


def _at_corners(which: np.ufunc, values: Floats, along: list[int]) -> Floats:
    """The least or the largest number at the corners of each cell, along some axes."""
    for axis in along:
        first, second = [slice(None)] * 3, [slice(None)] * 3
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        values = which(values[tuple(first)], values[tuple(second)])
    return values


class FormulaCollider(Formula, SolidCollider):
    """A solid where a formula of x, y and z is negative, inside of a box; a formula close to the distance works best."""

    costly: ClassVar[bool] = True

    def shape(self) -> Any:
        return self.level(-1.0 if self.inside else 1.0)

    def doubts(self, name: str, lightest: float | None, dt: float) -> Iterator[str]:
        yield from super().doubts(name, lightest, dt)
        if (endless := self.endless_slope()) is not None:
            yield f"{name}: {endless}"
