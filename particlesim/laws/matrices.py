"""3 × 3 matrices as nine numbers, row by row, for laws and kernels."""

from __future__ import annotations

from typing import Any


def outer(a: Any, b: Any) -> Any:
    """a bᵀ."""
    (p, q, r), (x, y, z) = a, b
    return p * x, p * y, p * z, q * x, q * y, q * z, r * x, r * y, r * z


def with_diagonal(k: Any, a: Any) -> Any:
    """k 1 + a."""
    return a[0] + k, a[1], a[2], a[3], a[4] + k, a[5], a[6], a[7], a[8] + k


def product(a: Any, b: Any) -> Any:
    """Matrix product."""
    columns = ((b[0], b[3], b[6]), (b[1], b[4], b[7]), (b[2], b[5], b[8]))
    x, y, z = (tuple(a[i] * c[0] + a[i + 1] * c[1] + a[i + 2] * c[2] for c in columns) for i in (0, 3, 6))
    return (*x, *y, *z)
