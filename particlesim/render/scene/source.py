"""What the renderer draws: planes, balls, other shapes, and a source of recorded frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True)
class PlaneShape:
    """An infinite plane: a point on it [m] and the normal that points to the side where particles may be."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]


@dataclass(frozen=True)
class BallShape:
    """A solid sphere that does not move: its centre and radius [m]."""

    center: tuple[float, float, float]
    radius: float


Pose = tuple[tuple[float, float, float], npt.NDArray[Any]]
"""Where the origin of a shape's frame is [m], and the rotation [3, 3] from its axes to those of the world."""


@dataclass(frozen=True)
class MeshShape:
    """Any other shape: corners [m], shape [n, 3], and triangles [m, 3] with their fronts outwards.

    Of a container (`hollow`) only the walls are drawn that the camera sees from inside. `pose` says where a shape that moves
    is at a time [s]. `group` is the number of a group of rigid bodies, each of which has this shape in its own frame.
    The surface of a fluid (`fluid`) is a square that is drawn as large as the scene. `opacity` is how much of what is behind
    it a shape hides.
    """

    corners: npt.NDArray[Any]
    triangles: npt.NDArray[Any]
    hollow: bool = False
    pose: Callable[[float], Pose] | None = None
    group: int | None = None
    fluid: bool = False
    opacity: float = 1.0

    def spread(self, center: npt.NDArray[Any], half: float) -> MeshShape:
        """The surface of a fluid about the place that is nearest to the centre of the scene, with sides of twice `half`."""
        if not self.fluid:
            return self
        arms = self.corners - self.corners.mean(axis=0)
        normal = np.cross(arms[0], arms[1])
        away = (center - self.corners[0]) @ normal / (normal @ normal)
        return replace(self, corners=center - away * normal + half * arms)


class Frame(Protocol):
    """One recorded instant. `frame["velocity"]` is a recorded field, shape [n] or [n, 3]."""

    @property
    def time(self) -> float:
        """When it was recorded [s]."""

    @property
    def position(self) -> npt.NDArray[Any]:
        """Positions [m], shape [n, 3]."""

    @property
    def id(self) -> npt.NDArray[Any]:
        """Ids, shape [n]."""

    def __getitem__(self, name: str, /) -> npt.NDArray[Any]: ...


@runtime_checkable
class FrameSource(Protocol):
    """A trajectory: `times` [s] in rising order, shape [frames], and the names of the recorded `fields`.

    Four optional attributes are used where they exist: `units`, a mapping from field name to the unit shown
    in the legend; `groups`, the names that the integers of the field "group" stand for; `topology`, the springs
    and surfaces by name (see `particlesim.trajectory.topology.Topology`); `box`, the periodic box that positions are in,
    which is drawn (see `particlesim.trajectory.box.Box`).
    """

    @property
    def times(self) -> npt.NDArray[Any]:
        """Times of all frames [s], in rising order."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the recorded fields."""

    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> Frame: ...


def sample_indices(count: int, limit: int) -> Iterator[int]:
    """At most `limit` frame numbers spread evenly over `count` frames, first and last included."""
    return iter(np.unique(np.linspace(0, count - 1, min(count, limit)).round().astype(int)).tolist())
