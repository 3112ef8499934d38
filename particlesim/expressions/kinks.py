"""Kinks of expressions, where |a|, min, max or a condition changes from one smooth expression to another.

An expression with n kinks is made of up to 2ⁿ smooth pieces. `folded` writes it so that a piece may be asked for beyond the
kinks at which it ends, as a face of a solid may be continued beyond its edges: the k-th bit of a `Spot` says which of its
two expressions the k-th kink has.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.expressions import operations as op
from particlesim.expressions.operations import Node, slope, value
from particlesim.laws.registry import law


class Spot(NamedTuple):
    """A place, and a piece: bit k of its number is 1 where kink k takes its first expression."""

    x: float
    y: float
    z: float
    piece: int


class Either(NamedTuple):
    """The first or the second expression, by the bit of a piece."""

    bit: int
    first: Any
    second: Any


@law(value, Either)
def _either_value(f: Either, p: Any) -> float:
    return value(f.first, p) if ((p.piece >> f.bit) & 1) > 0 else value(f.second, p)


@law(slope, Either)
def _either_slope(f: Either, p: Any) -> float:
    return slope(f.first, p) if ((p.p.piece >> f.bit) & 1) > 0 else slope(f.second, p)


class Kink(NamedTuple):
    """What is positive where a kink takes its first expression: as written, and by the pieces of kinks before it."""

    written: Node
    pieces: Node


def folded(node: Node) -> tuple[Node, tuple[Kink, ...]]:
    """An expression by its pieces, and its kinks. The same kink in two places of the expression is one."""
    found: dict[str, tuple[int, Kink]] = {}
    whole = _folded(node, found)
    return whole, tuple(kink for _, kink in found.values())


def _folded(node: Any, found: dict[str, tuple[int, Kink]]) -> Any:
    if not isinstance(node, tuple):
        return node
    parts = [_folded(part, found) for part in node]
    if not isinstance(node, op.Abs | op.Minimum | op.Maximum | op.IfLess):
        return type(node)(*parts)
    written, pieces = _argument(node, node), _argument(node, parts)
    # by its text: records of other types with the same parts are equal
    bit, _ = found.setdefault(repr(written), (len(found), Kink(written, pieces)))
    first, second = (parts[0], op.Negate(parts[0])) if isinstance(node, op.Abs) else parts[-2:]
    return Either(bit, first, second)


def _argument(kind: Node, parts: Any) -> Node:
    """What changes its sign at the kink of a node with these parts."""
    if isinstance(kind, op.Abs):
        return parts[0]
    return op.Subtract(*parts[:2]) if isinstance(kind, op.Maximum) else op.Subtract(parts[1], parts[0])
