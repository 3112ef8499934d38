"""What a scenario's `[render]` table may say.

Plain data: importing this module loads neither the compiler nor Pillow. Colours are sRGB components between 0 and 1.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Literal, Self

from annotated_types import Ge, Gt, Le
from pydantic import Field, StrictBool, model_validator

from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Degrees, Hertz, Metres, Number, Vector

Fraction = Annotated[float, Field(ge=0, le=1)]
ColormapName = Literal["viridis", "magma", "inferno", "turbo", "coolwarm", "steel", "blackbody"]
Style = Literal["surface", "lines", "points", "hidden"]
Thickness = Annotated[Metres, Gt(0)]
_CORNERS = "such as [[-1, 0, -1], [1, 2, 1]]"
Pixels = Annotated[int, Field(ge=16, le=8192, multiple_of=2)]


def colorable(fields: Collection[str], *, springs: bool = False) -> tuple[str, ...]:
    """What `color_by` may be for a trajectory with these fields, and perhaps with springs."""
    speed = ("speed",) if {"velocity", "speed"} & set(fields) else ()
    strain = ("strain",) if springs else ()
    own = sorted({*fields, *speed, *strain, "x", "y", "z"} - {"position", "id", "image"})
    return ("auto", "none", *own)


class Camera(Model):
    """Where the picture is taken from. Keys that are left out are chosen so that the particles fill the frame."""

    eye: Vector[Metres] | None = Field(None, description="Position of the camera [m].")
    target: Vector[Metres] | None = Field(None, description="Point in the middle of the picture [m].")
    up: Vector[Number] = Field((0.0, 1.0, 0.0), description="Direction that is upwards in the picture.")
    fov: Annotated[Degrees, Ge(1), Le(150)] = Field(40.0, description="Vertical field of view [degrees].")
    orbit: Degrees = Field(
        0.0, description="Turn about the target while the video plays [degrees per second of video]."
    )

    @model_validator(mode="after")
    def _directions_exist(self) -> Self:
        if not any(self.up):
            raise invalid("a direction needs a length", at=("up",), hint="such as [0, 1, 0]")
        if self.eye is not None and self.eye == self.target:
            raise invalid("eye and target are the same point", at=("eye",), also=[(("target",), "here")])
        return self


class RenderSettings(Model):
    """How a trajectory becomes pictures."""

    look: Literal["dots", "spheres"] = Field(
        "spheres", description="Shaded spheres, or round dots that suit millions of particles."
    )
    size: tuple[Pixels, Pixels] = Field(
        (1920, 1080),
        description="Width and height [pixels], both even; unless given, psim run --video takes 1280 × 720.",
    )
    fps: Annotated[Hertz, Gt(0), Le(240)] = Field(30.0, description="Frames per second of video.")
    speed: Annotated[Number, Gt(0)] | None = Field(
        None,
        description="Simulated seconds per second of video. Left out: 1 where the recording is about as "
        "dense as the video (between half and four video frames per recorded frame), else one video frame "
        "per recorded frame.",
    )
    bounds: tuple[Vector[Metres], Vector[Metres]] | None = Field(
        None,
        description="Two opposite corners of the box that pictures are made for [m]. Left out: what the particles take "
        "up in all frames. Videos of different runs with the same bounds can be compared; and if there are no trails, and "
        "`color_range` is given or not needed, `psim run --video` draws while it steps.",
    )
    camera: Camera = Field(Camera(), description="Viewpoint; automatic where left out.")
    color_by: str = Field(
        "auto",
        description="A recorded field (vectors by their length), 'speed', 'x', 'y', 'z', 'group', 'strain', "
        "'none', or 'auto': surfaces plain like cloth, everything else by its speed if velocity is recorded, else in one "
        "colour. The strain of a line is that of "
        "its spring; in a point of a surface it is the root mean square over the springs that meet there.",
    )
    colormap: ColormapName = Field(
        "viridis", description="Colours from the low to the high end of the range."
    )
    color_range: tuple[Number, Number] | Literal["auto"] = Field(
        "auto", description="Values at the two ends of the colour map; 'auto' fits the recorded values."
    )
    particle_radius: Annotated[Metres, Gt(0)] | None = Field(
        None,
        description="Drawn radius [m]. Left out: the recorded radius where there is one (spheres), else "
        "chosen by the extent of the scene and the number of particles.",
    )
    styles: dict[str, Style] = Field(
        {},
        description="How groups and sets of springs are drawn, by their names: 'surface' (a cloth, or the "
        "skin of a body), 'lines' (its springs, and spheres for particles with a radius), 'points' (its "
        "particles by the `look`), or 'hidden'. What is not named is a surface if it has one, else lines if "
        "it has springs, else points.",
    )
    colors: dict[str, tuple[Fraction, Fraction, Fraction]] = Field(
        {},
        description="Colours [r, g, b] of groups and sets of springs, by their names, instead of `color_by`.",
    )
    opacity: dict[str, Fraction] = Field(
        {},
        description="Of groups that are drawn as a surface, and of colliders, by their names: how much of what is behind "
        "them they hide. Each that hides less than all (1) takes the time of a picture of its own.",
    )
    line_radius: Thickness | dict[str, Thickness] | None = Field(
        None,
        description="Radius of the lines that springs are drawn as [m]: of all, or by the names of groups and "
        "sets of springs. Left out: chosen by the springs' length and the extent of the scene.",
    )
    trails: StrictBool | Literal["auto"] = Field(
        "auto",
        description="Draw each particle's recent path; 'auto': when there are at most 64 particles and "
        "no springs.",
    )
    ground: StrictBool = Field(
        True, description="Draw the planes and the colliders that particles meet, and surfaces of fluids."
    )
    shadows: StrictBool = Field(True, description="Cast shadows and darken corners.")
    light: Vector[Number] | None = Field(
        None, description="Direction towards the light. Left out: above the camera, to its left."
    )
    exposure: Annotated[Number, Gt(0), Le(100)] = Field(1.0, description="Brightness factor.")
    background: Literal["dark", "light"] | tuple[Fraction, Fraction, Fraction] = Field(
        "dark", description="A theme, or one colour [r, g, b]."
    )
    legend: StrictBool = Field(True, description="Show what the colours mean.")
    time_label: StrictBool = Field(True, description="Show the simulated time.")
    title: StrictBool = Field(True, description="Show the scenario's title.")
    supersampling: Literal[1, 2] = Field(
        1, description="2 draws four samples per pixel: finer edges, a quarter of the speed."
    )
    crf: Annotated[int, Field(ge=1, le=51)] = Field(
        18, description="Quality of MP4 (H.264 constant rate factor): 1 is best, 51 is smallest."
    )

    @model_validator(mode="after")
    def _values_make_sense(self) -> Self:
        if self.color_range != "auto" and not self.color_range[0] < self.color_range[1]:
            low, high = self.color_range
            raise invalid(
                f"the first value must be below the second, got {low:g} and {high:g}", at=("color_range",)
            )
        if self.bounds is not None and not any(a < b for a, b in zip(*self.bounds, strict=True)):
            raise invalid(
                "this box is empty: the second corner is not beyond the first along any axis",
                at=("bounds",),
                hint=_CORNERS,
            )
        if self.bounds is not None and any(a > b for a, b in zip(*self.bounds, strict=True)):
            raise invalid("the first corner has the smaller coordinates", at=("bounds",), hint=_CORNERS)
        if self.light is not None and not any(self.light):
            raise invalid("a direction needs a length", at=("light",), hint="such as [1, 2, 1]")
        return self
