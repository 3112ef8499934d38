"""Interactions with the potential Σ w/√(r² + ε²), of which far particles act by multipoles, or by a mesh."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import model_validator

from particlesim.interactions.base import PairInteraction
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number

LEAST_ACCURACY, MOST_ACCURACY = 1e-9, 0.1


class FarInteraction(PairInteraction):
    """An interaction by mass or charge that has no end, with U = −c w₁ w₂/√(r² + ε²)."""

    accuracy: Annotated[Number, Ge(LEAST_ACCURACY), Le(MOST_ACCURACY)] = 1e-3
    """Root of the mean square of the relative errors of forces that is allowed where far particles act by multipoles or by a
    mesh."""

    by: ClassVar[str]
    """The attribute w."""

    def coupling(self) -> float:
        """c: positive where equal w attract."""
        raise NotImplementedError

    def product(self) -> tuple[str, float]:
        return self.by, self.coupling()

    def softening_length(self) -> float:
        """ε [m]."""
        return float(getattr(self, "softening", 0.0))

    def far_softening(self) -> float:
        """The ε [m] that far particles see, also where near ones see another law."""
        return self.softening_length()

    def near_reach(self) -> float:
        """Distance up to which the law is another one than that of far particles [m]."""
        return 0.0

    def lacks_a_mesh(self) -> str | None:
        if self.cutoff is not None:
            return "all images act on each other, and with a cutoff they do not"
        if self.between is not None:
            return "pairs between two groups are summed one by one"
        return None

    def lacks_multipoles(self) -> str | None:
        if self.cutoff is not None:
            return "far particles do not act on each other with a cutoff"
        if self.between is not None:
            return "pairs between two groups are summed one by one"
        return None

    @model_validator(mode="after")
    def _accuracy_is_used(self) -> Any:
        given = "accuracy" in self.model_fields_set
        if given and self.method == "direct":
            raise invalid(
                "direct sums have no error to allow", at=("accuracy",), also=[(("method",), "here")]
            )
        by_tree, by_mesh = self.lacks_multipoles(), self.lacks_a_mesh()
        why = {"tree": by_tree, "mesh": by_mesh}.get(self.method, by_tree if by_mesh else None)
        if given and why:
            raise invalid(f"there is no error to allow: {why}", at=("accuracy",))
        return self
