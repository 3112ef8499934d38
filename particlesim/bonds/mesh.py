"""The springs and rods of a body that brings its own: cloth, rope, jelly."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt
from pydantic import StrictBool, model_validator

from particlesim.bonds.base import SpringLaw
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Joules, KilogramsPerSecond, Newtons, NewtonsPerMetre, Number

Stiffness = Annotated[NewtonsPerMetre, Gt(0)]


class MeshSprings(Model):
    """Springs between the particles of a cloth, a rope or a jelly; their rest lengths are the distances at the start."""

    structural: Stiffness | None = None
    """Stiffness of the springs between neighbours; needed unless they are rigid."""
    rigid: StrictBool = False
    """Instead of structural springs: rods between the neighbours in a rope, a net or hair, whose distances do not change."""
    shear: Stiffness | None = None
    """Stiffness of the springs across diagonals; none unless given."""
    bend: Stiffness | None = None
    """Stiffness of the springs to every other particle; none unless given."""
    angle: Annotated[Joules, Ge(0)] | None = None
    """Stiffness, in joules (per radian squared), of the angles of a rope or of hair; none unless given."""
    dihedral: Annotated[Joules, Ge(0)] | None = None
    """Stiffness, in joules (per radian squared), of the folds between triangles of a cloth or a mesh; none unless given."""
    damping: Annotated[KilogramsPerSecond, Ge(0)] = 0.0
    """Damping c along every spring."""
    damping_ratio: Annotated[Number, Ge(0)] | None = None
    """Instead of the damping: ζ in c = 2 ζ √(k μ), with the reduced mass μ of the two particles."""
    tension_only: StrictBool = False
    """Springs that pull and never push."""
    break_strain: Annotated[Number, Gt(0)] | None = None
    """Strain beyond which a spring breaks, for good."""
    break_force: Annotated[Newtons, Gt(0)] | None = None
    """Pull beyond which a spring breaks, for good."""

    @model_validator(mode="after")
    def _neighbours(self) -> MeshSprings:
        if self.rigid and self.structural is not None:
            raise invalid(
                "neighbours are joined by rods already", at=("structural",), also=[(("rigid",), "here")]
            )
        if not self.rigid and self.structural is None:
            raise invalid(
                "what joins neighbours?",
                at=("rigid",) if "rigid" in self.model_fields_set else None,
                allowed="structural = 800.0 (N/m); or rigid = true in a rope, a net or hair",
            )
        if not self.stiffness():
            for key in ("damping", "damping_ratio", "tension_only", "break_strain", "break_force"):
                if getattr(self, key):
                    raise invalid(
                        f"there are only rods here, and {key} is for springs",
                        at=(key,),
                        also=[(("rigid",), "rods")],
                    )
        return self

    @model_validator(mode="after")
    def _damping(self) -> MeshSprings:
        if self.damping > 0 and self.damping_ratio is not None:
            raise invalid(
                "the damping is given already", at=("damping_ratio",), also=[(("damping",), "here")]
            )
        return self

    def stiffness(self) -> dict[str, float]:
        """Stiffness by kind of spring [N/m], of the kinds that are given."""
        kinds = {"structural": self.structural, "shear": self.shear, "bend": self.bend}
        return {kind: k for kind, k in kinds.items() if k is not None}

    def hinges(self) -> dict[str, float]:
        """Stiffness of angles and dihedrals [J], of the kinds that are given."""
        kinds = {"angle": self.angle, "dihedral": self.dihedral}
        return {kind: k for kind, k in kinds.items() if k is not None}

    def laws(self) -> dict[str, SpringLaw]:
        """The constants of every kind of spring."""
        return {
            kind: SpringLaw(
                stiffness,
                damping=self.damping,
                damping_ratio=self.damping_ratio,
                tension_only=self.tension_only,
                break_strain=self.break_strain,
                break_force=self.break_force,
            )
            for kind, stiffness in self.stiffness().items()
        }
