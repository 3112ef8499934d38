"""What every shape of rigid bodies has: volume, centre, inertia, surface, and the convex pieces that touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import PrivateAttr

from particlesim.bodies.mass import Solidity, enclosed_by, principal
from particlesim.bodies.pieces import BOX, HULL, Piece
from particlesim.colliders.triangulation import Triangles
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.model.base import Model
from particlesim.model.vectors import Vector3


class Frame(NamedTuple):
    """The mass properties of a body of any shape: volume [m³], centre of mass in the frame of the shape [m], J along the
    principal axes [m⁵], and these as columns of a rotation in that frame."""

    volume: float
    center: Floats
    spread: Floats
    axes: Floats


class BodyShape(Model):
    """A shape of a rigid body."""

    type: str

    _frame: Frame | None = PrivateAttr(default=None)

    def __eq__(self, other: object) -> bool:
        return self.says(other)

    def __hash__(self) -> int:
        return hash(self.type)

    def solid(self) -> Solidity:
        """What it encloses, in its own frame."""
        raise NotImplementedError

    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces that touch, in its own frame."""
        raise NotImplementedError

    def surface(self, sides: int = 48) -> Triangles:
        """Its surface in its own frame; round ones with so many corners around."""
        raise NotImplementedError

    def words(self) -> str:
        """A body of this shape in a few words."""
        raise NotImplementedError

    def remarks(self) -> tuple[str, ...]:
        """What to tell of it before a run."""
        return ()

    # ---- of its own

    def frame(self) -> Frame:
        """Its centre and its principal axes, found once. Raises UsageError where numbers do not hold them."""
        if self._frame is None:
            try:
                solid = self.solid()
                tensor = solid.second * np.eye(3)
                numbers = np.array([solid.volume, *(np.trace(tensor) - np.diag(tensor))])
                held = bool((np.isfinite(numbers) & (numbers > 0)).all())
            except OverflowError:
                held = False
            if not held:
                raise UsageError(
                    f"{self.words()}: no number holds its volume or its moments of inertia",
                    "sizes from 1e-60 m to 1e60 m that differ by less than 10⁷ times have them",
                )
            spread, axes = principal(solid.second)
            self._frame = Frame(solid.volume, solid.center, spread, axes)
        return self._frame

    def volume(self) -> float:
        """Volume [m³]."""
        return self.frame().volume

    def spread(self) -> Vector3:
        """J = ∫ x² dV along its principal axes [m⁵]."""
        x, y, z = self.frame().spread
        return float(x), float(y), float(z)

    def own_pieces(self) -> tuple[Piece, ...]:
        """The convex pieces that touch, about the centre of mass and along the principal axes."""
        frame = self.frame()
        return tuple(piece.seen_from(frame.center, frame.axes) for piece in self.pieces())

    def all_flat(self) -> bool:
        """Whether all of its sides are flat."""
        return all(piece.kind in (BOX, HULL) for piece in self.pieces())

    def reach(self) -> float:
        """Radius of a ball about its centre of mass that holds all of it [m]."""
        return max(_farthest(piece) for piece in self.own_pieces())

    def fineness(self) -> float:
        """Its smallest size [m]."""
        return min(piece.fineness() for piece in self.pieces())

    def triangles(self) -> Triangles:
        """Its surface about the centre of mass, along the axes of its frame: for pictures."""
        surface = self.surface()
        return Triangles(surface.corners - self.frame().center, surface.faces)

    def skin(self) -> Triangles:
        """A coarser surface about the centre of mass and along the principal axes, which encloses the same volume: fluids
        act on it."""
        frame, surface = self.frame(), self.surface(24)
        corners = (surface.corners - frame.center) @ frame.axes
        size = enclosed_by(corners, surface.faces).volume
        return Triangles(corners * (frame.volume / size) ** (1 / 3), surface.faces)


def _farthest(piece: Piece) -> float:
    """How far a piece reaches from the origin [m], at most."""
    if piece.hull is not None:
        corners = piece.at + piece.hull.corners @ piece.rotation.T
        return float(np.linalg.norm(corners, axis=1).max())
    if piece.kind == BOX:
        return float(np.linalg.norm(np.abs(piece.rotation.T @ piece.at) + piece.size))
    return float(np.linalg.norm(piece.at)) + piece.ball()
