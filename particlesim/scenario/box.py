"""`box` under `[simulation]`: a periodic box."""

from __future__ import annotations

import math
from typing import Annotated

from annotated_types import Gt
from pydantic import StrictBool, model_validator

from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Vector
from particlesim.trajectory.box import Box

FINE = 1e-6
"""How far numbers may be apart in a periodic box, as a part of its side."""


class PeriodicBox(Model):
    """A periodic box: particles that leave it on one side enter on the other, and act on each other by nearest images."""

    size: Vector[Annotated[Metres, Gt(0)]]
    """Lengths of its sides; of an axis that is not periodic, only pictures show it."""
    periodic: Vector[StrictBool] = (True, True, True)
    """Along which axes it repeats; there is no wall along the others."""
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Its lowest corner."""

    @model_validator(mode="after")
    def _repeats(self) -> PeriodicBox:
        if not any(self.periodic):
            raise invalid(
                "a box that is periodic along no axis does nothing",
                at=("periodic",),
                hint="leave the box out",
            )
        for axis, (low, size) in enumerate(zip(self.origin, self.size, strict=True)):
            if math.ulp(low) > FINE * size:
                raise invalid(
                    f"at {low:g} m numbers are {math.ulp(low):.2g} m apart, too far for a box of {size:g} m",
                    at=("origin", axis),
                    allowed=f"up to {FINE * size / math.ulp(1.0):.2g} m",
                )
        return self

    def as_box(self) -> Box:
        """What frames are wrapped by."""
        return Box(self.origin, self.size, self.periodic)
