"""Initial particles. To add a layout, write its file and add a line to `LAYOUTS`."""

from typing import Annotated

from particlesim.layouts.base import CHUNK, Layout, Placed
from particlesim.model.variants import Family, Tagged

LAYOUTS = Family[Layout](
    "particlesim.layouts",
    points="points.Points",
    random="random.Random",
    lattice="lattice.Lattice",
    cloth="cloth.Cloth",
    rope="rope.Rope",
    jelly="jelly.Jelly",
    net="net.Net",
    hair="hair.Hair",
    bridge="bridge.Bridge",
    mesh="surface.SurfaceFile",
    plummer="plummer.Plummer",
    disc="disc.Disc",
    waves="waves.Waves",
    file="file.File",
)

AnyLayout = Annotated[Layout, Tagged("type", LAYOUTS)]

__getattr__ = LAYOUTS.by_name

__all__ = ["CHUNK", "LAYOUTS", "AnyLayout", "Layout", "Placed"]
