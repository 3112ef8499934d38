"""Expressions of the place on arrays of places, by NumPy: for looking at a formula as a whole, before a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from particlesim.expressions import operations as op
from particlesim.model.arrays import Floats

OPERATIONS: dict[type, Callable[..., Any]] = {
    op.Negate: np.negative,
    op.Add: np.add,
    op.Subtract: np.subtract,
    op.Multiply: np.multiply,
    op.Divide: np.divide,
    op.Square: np.square,
    op.GeneralPower: np.power,
    op.Sin: np.sin,
    op.Cos: np.cos,
    op.Tan: np.tan,
    op.Asin: np.arcsin,
    op.Acos: np.arccos,
    op.Atan: np.arctan,
    op.Sinh: np.sinh,
    op.Cosh: np.cosh,
    op.Tanh: np.tanh,
    op.Exp: np.exp,
    op.Log: np.log,
    op.Sqrt: np.sqrt,
    op.Abs: np.abs,
    op.Sign: np.sign,
    op.Atan2: np.arctan2,
    op.Hypot: np.hypot,
    op.Minimum: np.minimum,
    op.Maximum: np.maximum,
}
"""For each operation on values of expressions its function of arrays."""


def value_at(node: op.Node, x: Floats, y: Floats, z: Floats) -> Floats:
    """The values of an expression that reads nothing but the place, at places in arrays of one shape; NaN or infinite where
    it has none."""
    with np.errstate(all="ignore"):
        return np.broadcast_to(np.asarray(_value(node, (x, y, z)), float), x.shape)


def _value(node: Any, place: tuple[Floats, Floats, Floats]) -> Any:
    for kind, coordinate in zip((op.X, op.Y, op.Z), place, strict=True):
        if isinstance(node, kind):
            return coordinate
    if isinstance(node, op.Constant):
        return node.number
    if isinstance(node, op.Power):
        return np.power(_value(node.a, place), node.b)
    parts = [_value(part, place) for part in node]
    if isinstance(node, op.IfLess):
        a, b, yes, no = parts
        return np.where(a < b, yes, no)
    return OPERATIONS[type(node)](*parts)
