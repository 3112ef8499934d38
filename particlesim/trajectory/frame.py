"""One recorded moment of a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.trajectory.box import Box
from particlesim.trajectory.fields import unknown_name

Array = npt.NDArray[Any]


class UnknownAttribute(UsageError, AttributeError):
    """A frame has no such attribute: told as a field, and what `hasattr` and `getattr` with a default understand."""

    def __reduce__(self) -> tuple[Any, ...]:
        return AttributeError.__new__, (type(self), *self.args), vars(self)


class Frame:
    """The particles at `time` [s], after `step` steps; the `index`-th frame of its file.

    Fields are attributes (`frame.position`, `frame.velocity`) or items (`frame["velocity"]`): arrays [n] or
    [n, 3] in SI units, row by row the same particles. They are read when first used, and kept. A pickled frame or a copy
    holds all of them, and needs neither its file nor its run.
    """

    time: float
    step: int
    index: int
    fields: tuple[str, ...]
    groups: tuple[str, ...]
    box: Box | None
    """The periodic box that positions are in; None where there is none."""

    def __init__(
        self,
        *,
        index: int,
        time: float,
        step: int,
        count: int,
        fields: tuple[str, ...],
        groups: tuple[str, ...],
        load: Callable[[str], Array],
        box: Box | None = None,
    ) -> None:
        self.index = index
        self.time = time
        self.step = step
        self.fields = fields
        self.groups = groups
        self.box = box
        self._count = count
        self._load = load
        self._loaded: dict[str, Array] = {}

    def __len__(self) -> int:
        """How many particles there are."""
        return self._count

    def __getitem__(self, field: str) -> Array:
        """The field named `field`; UsageError when it was not recorded."""
        if field not in self.fields:
            raise unknown_name("field", field, self.fields)
        if field not in self._loaded:
            self._loaded[field] = self._load(field)
        return self._loaded[field]

    def __contains__(self, field: object) -> bool:
        """Whether a field was recorded."""
        return field in self.fields

    def __iter__(self) -> Iterator[str]:
        """The names of the recorded fields."""
        return iter(self.fields)

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_"):  # copy and pickle probe for these before __init__ has run
            raise AttributeError(name)
        try:
            return self[name]
        except UsageError as error:
            raise UnknownAttribute(error.message, error.hint) from None

    def __getstate__(self) -> dict[str, Any]:
        for field in self.fields:
            self[field]  # loaded while that can be done
        return {**vars(self), "_load": None}

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.fields]

    def __repr__(self) -> str:
        return f"<Frame {self.index}: t = {self.time:g} s, {self._count} particles>"

    @property
    def position(self) -> Array:
        """Positions [m], shape [n, 3]."""
        return self["position"]

    @property
    def unwrapped(self) -> Array:
        """Positions along the paths of the particles [m], shape [n, 3]: in a periodic box `position` is that of the image in
        the box. Without one they are the positions."""
        return self["position"] if self.box is None else self.box.unwrapped(self["position"], self["image"])

    @property
    def id(self) -> Array:
        """Number of each particle, the same in all frames, shape [n]."""
        return self["id"]

    def of(self, group: str) -> npt.NDArray[np.bool_]:
        """Which particles belong to `group`: a mask [n] to index the fields with.

        Raises UsageError for an unknown group, or when groups were not recorded and there are several.
        """
        if group not in self.groups:
            raise unknown_name("group", group, self.groups)
        if "group" in self.fields:
            mask: npt.NDArray[np.bool_] = self["group"] == self.groups.index(group)
            return mask
        if len(self.groups) == 1:
            return np.ones(self._count, np.bool_)
        raise UsageError(
            "the trajectory does not say which particle belongs to which group",
            'Record the field "group": fields = ["group", ...] under [output].',
        )
