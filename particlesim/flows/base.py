"""What a flow is: a velocity field w(x, t) of a fluid, which drag acts towards and tracers follow."""

from __future__ import annotations

from typing import Any

from particlesim.model.base import Model


class Flow(Model):
    """A velocity field [m/s]. Laws: `velocity` w and `velocity_dx` ∂w_i/∂x_j of its record."""

    def record(self) -> tuple[Any, ...]:
        """The parameters as kernels take them."""
        raise NotImplementedError
