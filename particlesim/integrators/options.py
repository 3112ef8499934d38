"""The options of methods in scenarios: `integrator = { method = "rk45", tolerance = 1e-6 }`.

Every family of methods has a model like this one: `method` lists the names that share its options, the other fields are the
options, and the family's class has a field of the same name for each. The model stands beside that class, and is one
line in `AnyOptions`.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from particlesim.model.base import Model

FixedStepName = Literal[
    "symplectic_euler",
    "explicit_euler",
    "midpoint",
    "heun",
    "rk3",
    "rk4",
    "stormer_verlet",
    "velocity_verlet",
    "yoshida4",
]


class Options(Model):
    """A method by its name, with its options."""

    tag: ClassVar[str] = "method"

    method: str
    """Name of the method."""

    def settings(self) -> dict[str, Any]:
        """The options by their names, which are fields of the method."""
        return {name: getattr(self, name) for name in type(self).model_fields if name != "method"}


class FixedStep(Options):
    """Explicit methods of a fixed step, which have no options."""

    method: FixedStepName
    """Name of the method."""
