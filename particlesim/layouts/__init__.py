"""Initial particles. To add a layout, write its file and add its class to `AnyLayout`."""

from typing import Annotated

from particlesim.layouts.base import CHUNK, Layout, Placed
from particlesim.layouts.bridge import Bridge
from particlesim.layouts.cloth import Cloth
from particlesim.layouts.disc import Disc
from particlesim.layouts.file import File
from particlesim.layouts.hair import Hair
from particlesim.layouts.jelly import Jelly
from particlesim.layouts.lattice import Lattice
from particlesim.layouts.net import Net
from particlesim.layouts.plummer import Plummer
from particlesim.layouts.points import Points
from particlesim.layouts.random import Random
from particlesim.layouts.rope import Rope
from particlesim.layouts.surface import SurfaceFile
from particlesim.layouts.waves import Waves
from particlesim.model.variants import Tagged, models_of

AnyLayout = Annotated[
    Points
    | Random
    | Lattice
    | Cloth
    | Rope
    | Jelly
    | Net
    | Hair
    | Bridge
    | SurfaceFile
    | Plummer
    | Disc
    | Waves
    | File,
    Tagged("type"),
]
LAYOUTS: tuple[type[Layout], ...] = models_of(AnyLayout)

__all__ = ["CHUNK", "LAYOUTS", "AnyLayout", "Layout", "Placed"]
