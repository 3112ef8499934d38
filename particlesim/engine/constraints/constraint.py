"""The interface of a kind of constraint.

A constraint is no force: after every drift it moves particles such that it holds, and takes from velocities the components
that would violate it. Kernels get its record (`records`), with connected components distributed among threads; all else runs
in Python. An island has one constraint or none, made of all the sets that the scenario lists (`registry`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from particlesim.engine.faults import Unheld
from particlesim.engine.interactions.coupling import Coupling
from particlesim.engine.interactions.interaction import Site
from particlesim.model.arrays import Floats, Ints
from particlesim.trajectory.topology import Topology


class Constraint:
    """Base of the constraints on the particles of an island. States are `Columns` of the whole island."""

    @property
    def number(self) -> int:
        """How many numbers it holds."""
        raise NotImplementedError

    @property
    def effort(self) -> int:
        """About how many springs take as long on several threads; 0 where only one can hold it."""
        raise NotImplementedError

    @property
    def given(self) -> float:
        """The energy that it has given to led particles since `begin` [J]."""
        raise NotImplementedError

    def records(self, threads: int) -> list[Any]:
        """What each of some threads holds, as kernels take it."""
        raise NotImplementedError

    def begin(self) -> None:
        """Forget what earlier steps have left: what could not be held, and energies."""
        raise NotImplementedError

    def fit(self, columns: Any) -> None:
        """Bring particles to the nearest places and velocities that fit."""
        raise NotImplementedError

    def unheld(self, site: Site) -> tuple[int, Unheld] | None:
        """The first of what could not be held since `begin`, before it the row of a free particle that is concerned."""
        raise NotImplementedError

    def lay_again(self, site: Site, place: Ints) -> None:
        """Use other rows, after births and deaths: row k has become row `place[k]` of `site`."""
        raise NotImplementedError

    def topology(self, ids: Ints) -> list[Topology]:
        """What a trajectory keeps of it; `ids` are those of the island's rows."""
        raise NotImplementedError

    @property
    def ends(self) -> Ints:
        """Rows of all particles that it holds, sorted."""
        raise NotImplementedError

    def couplings(self, columns: Any, force: Floats, w: Floats) -> Iterator[tuple[str, Coupling]]:
        """What it does to the stiffness of an island near a state, set by set; `force` [N] is what pulls on its `ends`,
        shape [3, n], and w is 1/m. Raises ValueError for a state that is not finite."""
        raise NotImplementedError

    def directions(self, x: Floats) -> Any:
        """The motions that it does not allow to particles at x [3, n]: a sparse matrix of shape [number, 3 n]."""
        raise NotImplementedError
