"""What a scenario's `[render]` table may say.

Plain data: importing this module loads neither Numba nor Pillow. Lengths are in metres, angles in degrees, times
in seconds; colours are sRGB components between 0 and 1.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Fraction = Annotated[float, Field(ge=0, le=1)]
ColormapName = Literal["viridis", "magma", "inferno", "turbo", "coolwarm", "blackbody"]
Pixels = Annotated[int, Field(ge=16, le=8192, multiple_of=2)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Camera(_Model):
    """Where the picture is taken from. What is left out is chosen so that the particles fill the frame."""

    eye: Vector | None = Field(None, description="Position of the camera [m].")
    target: Vector | None = Field(None, description="Point in the middle of the picture [m].")
    up: Vector = Field((0.0, 1.0, 0.0), description="Direction that is upwards in the picture.")
    fov: Annotated[float, Field(ge=1, le=150)] = Field(40.0, description="Vertical field of view [degrees].")
    orbit: Finite = Field(
        0.0, description="Turn about the target while the video plays [degrees per second of video]."
    )

    @model_validator(mode="after")
    def _directions_exist(self) -> Self:
        if not any(self.up):
            raise ValueError("up is the zero vector; give a direction such as [0, 1, 0]")
        if self.eye is not None and self.eye == self.target:
            raise ValueError("eye and target are the same point, so the camera looks nowhere")
        return self


class RenderSettings(_Model):
    """How a trajectory becomes pictures."""

    look: Literal["dots", "spheres"] = Field(
        "spheres", description="Shaded spheres, or round dots that suit millions of particles."
    )
    size: tuple[Pixels, Pixels] = Field((1920, 1080), description="Width and height [pixels], both even.")
    fps: Annotated[float, Field(gt=0, le=240)] = Field(30.0, description="Frames per second of video.")
    speed: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None,
        description="Simulated seconds per second of video. Left out: 1 where the recording is about as dense as "
        "the video (between half and four video frames per recorded frame), else one video frame per recorded frame.",
    )
    camera: Camera = Field(Camera(), description="Viewpoint; automatic where left out.")
    color_by: str = Field(
        "auto",
        description="A recorded field (vectors by their length), 'speed', 'x', 'y', 'z', 'group', 'none', or 'auto': "
        "the speed if velocity is recorded, else one colour.",
    )
    colormap: ColormapName = Field(
        "viridis", description="Colours from the low to the high end of the range."
    )
    color_range: tuple[Finite, Finite] | Literal["auto"] = Field(
        "auto", description="Values at the two ends of the colour map; 'auto' fits the recorded values."
    )
    particle_radius: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None,
        description="Drawn radius [m]. Left out: the recorded radius where there is one (spheres), else chosen by "
        "the extent of the scene and the number of particles.",
    )
    trails: bool | Literal["auto"] = Field(
        "auto", description="Draw each particle's recent path; 'auto': when there are at most 64 particles."
    )
    ground: bool = Field(True, description="Draw the planes of the scenario.")
    shadows: bool = Field(True, description="Cast shadows and darken corners.")
    light: Vector | None = Field(
        None, description="Direction towards the light. Left out: above the camera, to its left."
    )
    exposure: Annotated[float, Field(gt=0, le=100)] = Field(1.0, description="Brightness factor.")
    background: Literal["dark", "light"] | tuple[Fraction, Fraction, Fraction] = Field(
        "dark", description="A theme, or one colour [r, g, b]."
    )
    legend: bool = Field(True, description="Show what the colours mean.")
    time_label: bool = Field(True, description="Show the simulated time.")
    title: bool = Field(True, description="Show the scenario's title.")
    supersampling: Literal[1, 2] = Field(
        1, description="2 draws four samples per pixel: finer edges, a quarter of the speed."
    )
    crf: Annotated[int, Field(ge=0, le=51)] = Field(
        18, description="Quality of MP4 (H.264 constant rate factor): 0 is best, 51 is smallest."
    )

    @model_validator(mode="after")
    def _values_make_sense(self) -> Self:
        if self.color_range != "auto" and not self.color_range[0] < self.color_range[1]:
            low, high = self.color_range
            raise ValueError(f"color_range must rise, but {low:g} is not below {high:g}")
        if self.light is not None and not any(self.light):
            raise ValueError("light is the zero vector; give the direction towards the light")
        return self
