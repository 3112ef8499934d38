"""`[simulation]` and `[output]`: how long, how fine, and what is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Gt
from pydantic import Field, StrictBool, model_validator

from particlesim.integrators import AnyIntegrator
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Hertz, Seconds
from particlesim.scenario.box import PeriodicBox

if TYPE_CHECKING:
    FieldName = str
else:
    FieldName = Literal[
        (
            *("velocity", "orientation", "angular_velocity", "speed", "acceleration", "force"),
            *(*ATTRIBUTES, "age", "image"),
        )
    ]


class SimulationSettings(Model):
    """Time, method, seed and precision."""

    duration: Annotated[Seconds, Gt(0)]
    """Simulated time."""
    dt: Annotated[Seconds, Gt(0)] | None = None
    """Longest step. It is shortened where frames would fall between steps."""
    substeps: Annotated[int, Field(ge=1, le=10**9, strict=True)] | None = None
    """Steps per frame, instead of dt."""
    integrator: AnyIntegrator = "symplectic_euler"
    """Method of integration, or a table with its options; for groups that name none of their own."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1, strict=True)] = 0
    """Seed of all random numbers."""
    precision: Literal["double", "single"] = "double"
    """Floating-point numbers of the state: 64 bits, or 32 bits for half the memory and more speed."""
    box: PeriodicBox | None = None
    """A periodic box. Particles outside of it at the start are images of others inside."""

    @model_validator(mode="after")
    def _one_step(self) -> SimulationSettings:
        if self.dt is None and self.substeps is None:
            raise invalid("needs a step", allowed="dt = 0.001 (seconds), or substeps = 16 (steps per frame)")
        if self.dt is not None and self.substeps is not None:
            raise invalid(
                "dt and substeps contradict each other",
                at=("substeps",),
                also=[(("dt",), "dt is given here")],
            )
        return self


class Output(Model):
    """Which moments and which quantities go to the trajectory."""

    fps: Annotated[Hertz, Gt(0)] | None = None
    """Frames per simulated second."""
    interval: Annotated[Seconds, Gt(0)] | None = None
    """Simulated time between frames, instead of fps."""
    every: Annotated[int, Field(ge=1, le=10**15, strict=True)] | None = None
    """Steps between frames, instead of fps. Without any of the three, about 300 frames are kept."""
    fields: tuple[FieldName, ...] | None = None
    """Quantities in addition to position and id; velocity, and radius, temperature, charge where there are any, unless
    given."""
    precision: Literal["single", "double"] = "single"
    """Floating-point numbers in the file."""
    compression: Literal["gzip", "none"] = "gzip"
    """Smaller files (gzip), or the fastest writing (none)."""
    ledger: StrictBool = True
    """Energy, momentum and angular momentum at every frame."""
    checkpoint_every: Annotated[Seconds, Gt(0)] | None = None
    """Simulated time between checkpoints, from which psim run --resume continues; it does not matter unless given."""
    checkpoint_wall: Annotated[Seconds, Gt(0)] | None = None
    """Wall-clock time between checkpoints. Left out: 1 s, then twice as long each time, up to 60 s, and longer where they
    would take more than 2 % of the run."""
    work: StrictBool = False
    """In the ledger also the work of drag, dampers, contact, motions, births and all other causes that add or remove energy,
    and the residual of the balance. The run takes a few times as long, and twenty times where many touch softly; it is not
    available with contact of the model "impulse"."""

    @model_validator(mode="after")
    def _one_interval(self) -> Output:
        given = [name for name in ("fps", "interval", "every") if getattr(self, name) is not None]
        if len(given) > 1:
            raise invalid(
                f"{given[1]} and {given[0]} contradict each other",
                at=(given[1],),
                also=[((given[0],), f"{given[0]} is given here")],
            )
        if self.work and not self.ledger:
            raise invalid("work is recorded in the ledger", at=("work",), also=[(("ledger",), "false here")])
        if self.fields is not None and len(set(self.fields)) < len(self.fields):
            raise invalid("a field is named twice", at=("fields",))
        return self

    def period(self) -> float | None:
        """Simulated time between frames [s], None when it is counted in steps."""
        if self.fps is not None:
            return 1 / self.fps
        return self.interval
