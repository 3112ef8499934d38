"""What a set of interactions or a constraint is near a state, for the largest stable step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Coupling(Protocol):
    """A set of interactions linearised near a state, for the largest stable step."""

    @property
    def number(self) -> int:
        """How many there are."""
        ...

    def matrices(self, count: int) -> tuple[Any, Any]:
        """Stiffness and damping of all particles as sparse matrices, shape [3 count, 3 count], without what pushes apart."""
        ...

    def jacobians(self, count: int) -> tuple[Any, Any]:
        """∂f/∂x and ∂f/∂v of all particles as sparse matrices."""
        ...

    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]:
        """What bounds the stiffness or the damping of particles with w = 1/m: which ones [n], and tensors to be added up, as
        xx, yy, zz, xy, xz, yz [n]; of 1 row, a bound on their largest eigenvalue."""
        ...

    def add_tension(self, total: Floats) -> None:
        """Add the forces that rods have to bear to `total` [3, particles] [N]."""
        ...
